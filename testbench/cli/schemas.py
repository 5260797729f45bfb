"""``testbench schema``: JSON schemas of the input files of ``testbench``."""

import balance.cli.schemas
from balance.cli.schemas import schema_command

MODELS = {
    **balance.cli.schemas.MODELS,
    "import-description": "testbench.readers.import_description:ImportDescription",
    "plan": "testbench.campaign_plan:Plan",
    "published": "testbench.published_tables:PublishedTable",
    "rig": "testbench.rig:Rig",
    "run-table": "testbench.ingestion.run_table:RunRow",
}
"""Model of each kind of input file, those of ``balance`` among them."""
schema = schema_command("testbench", MODELS, "rig")
