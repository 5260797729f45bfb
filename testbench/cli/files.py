"""``testbench files`` and ``schema``: what is shipped for campaigns, and what a key of an input file means."""

from balance.cli import files as mechanics
from balance.cli.files import MECHANICS, files_command, schema_command

LABORATORY = {
    "mechanism": MECHANICS["mechanism"],
    "robot": MECHANICS["robot"],
    "motion": MECHANICS["motion"],
    "rig": ("rigs", ".toml"),
    "import-description": ("loggers", ".toml"),
    "plan": ("plans", ".toml"),
    "stock": MECHANICS["stock"],
    "published": ("published", ".json"),
}
"""Folder and ending of each kind of file that ``testbench`` takes."""
files = files_command("testbench", LABORATORY, "rig/parallelogram-6bar")


MODELS = {
    **mechanics.MODELS,
    "import-description": "testbench.readers.import_description:ImportDescription",
    "plan": "testbench.campaign_plan:Plan",
    "published": "testbench.published_tables:PublishedTable",
    "rig": "testbench.rig:Rig",
    "run-table": "testbench.ingestion.run_table:RunRow",
}
"""Model of each kind of input file, those of ``balance`` among them."""
schema = schema_command("testbench", MODELS, "rig")
