"""``testbench files``: what is shipped for campaigns, and copies of it to be edited."""

from balance.cli.files import MECHANICS, files_command

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
