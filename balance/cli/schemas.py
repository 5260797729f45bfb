"""``balance schema``: JSON schemas of input files: what a key means, its unit, an example, its default.

The reference page of all files, ``docs/files.md``, is made of the same schemas.
"""

import json
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

import click

from .framework import Word, json_text

MODELS = {
    "drive": "balance.drives.drive_files:DriveTable",
    "engine": "balance.engines.engine_files:EngineTable",
    "linkage": "balance.linkages.linkage_files:LinkageTable",
    "materials": "balance.balancing.stock_plates:MaterialsTable",
    "motion": "balance.motion.motion_files:MotionTable",
    "robot-loops": "balance.mechanism.robot_files:RobotLoops",
    "rotor": "balance.rotors.rotor_files:RotorTable",
    "springs": "balance.balancing.springs:SpringsTable",
    "stock": "balance.balancing.stock_plates:StockRow",
    "trial-runs": "balance.rotors.trial_run_files:TrialRunsTable",
}
"""Model of each kind of input file."""
_LONGEST_DEFAULT = 40
_HEAD = (
    "# Input files",
    "",
    "Every key of every file that the commands read: TOML unless its text says otherwise. `testbench schema KIND`",
    "prints the JSON schema, by which editors complete and check; `testbench files` lists the shipped files and copies",
    "them. Mechanisms are MJCF, URDF or SDF: [mechanism files](mechanisms.md). This page is written by",
    "`testbench schema --text > docs/files.md`.",
    "",
)


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
        f"Editors check a file by it while it is written. KIND: {', '.join(models)}.",
        epilog=f"\b\nExamples:\n  {program} schema {example} > {example}.schema.json\n"
        f"  {program} schema {example} --text",
    )
    @click.argument("kind", type=Word(list(models)), metavar="KIND", required=False)
    @click.option("--text", is_flag=True, help="As tables for people (Markdown); of all kinds unless one is named.")
    def schema(kind: str | None, text: bool) -> None:
        if text:
            click.echo(reference_page(models, [kind] if kind else list(models)), nl=False)
        elif kind is None:
            raise click.UsageError(f"expected a KIND: one of {', '.join(models)}")
        else:
            click.echo(json_text(file_schema(models, kind), version={}))

    return schema


def reference_page(models: Mapping[str, str], kinds: Iterable[str]) -> str:
    """The keys of kinds of files, in Markdown."""
    lines = [line for kind in kinds for line in reference(kind, file_schema(models, kind))]
    return "\n".join([*_HEAD, *lines])


def reference(kind: str, schema: Mapping[str, Any]) -> Iterable[str]:
    """Lines of Markdown: the keys of a kind of file, a table each for the file and what it holds."""
    yield f"## {kind}"
    for title, part in {"": schema, **schema.get("$defs", {})}.items():
        yield from ([f"### {kind}: {_title(title)}"] if title else [])
        yield from (part["description"].partition("\n")[0], "")
        yield from ("| key | meaning | written as | default |", "|---|---|---|---|")
        for key, one in part.get("properties", {}).items():
            default = "required" if key in part.get("required", ()) else _default(one.get("default"))
            yield f"| `{key}` | {_cell(one['description'])} | {_cell(_form(one))} | {default} |"
        for pattern, one in part.get("patternProperties", {}).items():
            yield f"| `{pattern.strip('^$').replace('.+', 'NAME')}` | {_cell(one['description'])} | {_form(one)} | |"
        yield ""


def _title(name: str) -> str:
    """``_WrenchUnits`` and ``MoveTable`` as people read them."""
    words = "".join(f" {c.lower()}" if c.isupper() else c for c in name.strip("_").removesuffix("Table"))
    return words.strip()


def _cell(text: str) -> str:
    return " ".join(text.replace("``", "`").replace("|", "\\|").split())


def _default(value: object) -> str:
    text = "" if value in (None, "", [], {}) else json.dumps(value, ensure_ascii=False)
    return f"`{text}`" if 0 < len(text) <= _LONGEST_DEFAULT else ""


def _form(one: Mapping[str, Any]) -> str:
    """How a value is written: a text with a unit, one of some words, a number, a list, a table."""
    if "$ref" in one:
        return f"table: {_title(one['$ref'].rpartition('/')[2])}"
    if "const" in one or "enum" in one:
        return " or ".join(f"`{word}`" for word in one.get("enum", [one.get("const")]))
    if several := [part for key in ("anyOf", "oneOf") for part in one.get(key, ()) if part.get("type") != "null"]:
        return " or ".join(dict.fromkeys(map(_form, several)))
    if "unit" in one:
        return f"text with a unit, [{one['unit']}], such as `{one['examples'][0]}`"
    if one.get("type") == "array":
        items = [one["items"]] if isinstance(one.get("items"), dict) else one.get("prefixItems", [])
        return "list" + (f" of {' or '.join(dict.fromkeys(map(_form, items)))}" if items else "")
    if one.get("type") == "object":
        inner = one.get("additionalProperties")
        return "table" + (f" by name, each {_form(inner)}" if isinstance(inner, dict) else "")
    words = {"number": "number", "integer": "whole number", "boolean": "true or false"}
    example = "".join(f", such as `{text}`" for text in one.get("examples", [])[:1])
    return words.get(one.get("type", ""), "text") + example


schema = schema_command("balance", MODELS, "drive")
