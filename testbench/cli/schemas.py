"""``testbench schema``: JSON schemas of the input files of ``testbench``."""

from balance.cli.schemas import schema_command

MODELS = {
    "plan": "testbench.campaign_plan:Plan",
    "rig": "testbench.rig:Rig",
    "run-table": "testbench.ingestion.run_table:RunRow",
}
"""Model of each kind of input file."""
schema = schema_command("testbench", MODELS, "rig")
