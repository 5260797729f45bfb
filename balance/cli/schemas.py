"""``balance schema``: JSON schemas of input files: what a key means, its unit, an example, its default."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click

from .framework import emit_json


def file_schema(models: Mapping[str, str], kind: str) -> dict[str, Any]:
    """The schema of a kind of input file, whose model is ``module:class``."""
    from ..input_files import json_schema

    module, _, model = models[kind].partition(":")
    return json_schema(getattr(import_module(module), model))


def schema_command(program: str, models: Mapping[str, str], example: str) -> click.Command:
    """The command ``schema`` of a program, of its kinds of input files and their models."""

    @click.command(
        "schema",
        help="Print the JSON schema of an input file: its keys, their meaning, unit, example and default.\n\n"
        "Editors check a file by it while it is written.",
        epilog=f"\b\nExample:\n  {program} schema {example} > {example}.schema.json",
    )
    @click.argument("kind", type=click.Choice(list(models)))
    def schema(kind: str) -> None:
        emit_json(file_schema(models, kind))

    return schema


MODELS = {
    "drive": "balance.drives.drive_files:DriveTable",
    "engine": "balance.engines.engine_files:EngineTable",
    "linkage": "balance.linkages.linkage_files:LinkageTable",
    "materials": "balance.balancing.stock_plates:MaterialsTable",
    "motion": "balance.motion.motion_files:MotionTable",
    "rotor": "balance.rotors.rotor_files:RotorTable",
    "springs": "balance.balancing.springs:SpringsTable",
    "trial-runs": "balance.rotors.trial_run_files:TrialRunsTable",
}
"""Model of each kind of input file."""
schema = schema_command("balance", MODELS, "drive")
