"""``balance files`` and ``schema``: what is shipped, and copies of it to be edited; what a key of an input file means.

The reference page of all files, ``docs/files.md``, is made of the same schemas.
"""

import json
import re
import shutil
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import click

from .. import datasets
from ..errors import DataError, suggestion
from ..results import Key, table
from .framework import Answer, Word, argument, command, option
from .printing import emit_table, json_text, plain_text, say

_OF_MECHANICS = "mechanism robot motion linkage engine drive rotor springs stock materials"
MECHANICS = {kind: datasets.KINDS[kind] for kind in _OF_MECHANICS.split()}
"""Folder and ending of each kind of file that ``balance`` takes."""
_SENTENCE = re.compile(r"(.*?)(?:(?<=[\w)%-]{2})\.\s|\.?$)")


@dataclass(frozen=True)
class Shipped:
    """A file that is shipped."""

    kind: Annotated[str, Key("", "kind")]
    name: Annotated[str, Key("", "name")]
    file: Annotated[Path, Key("", to=lambda path: path.name)]

    @property
    def about(self) -> Annotated[str, Key("", "what it is")]:
        """The first sentence of its comment, its name where it has one for people, its columns, or its source."""
        text = self.file.read_text(encoding="utf-8")
        if self.file.suffix == ".csv":
            return f"columns {text.partition(chr(10))[0]}"
        if self.file.suffix == ".json":
            return str(json.loads(text)["source"])
        if self.file.suffix in {".xml", ".urdf"}:
            found = text.partition("<!--")[2].partition("-->")[0]
        else:
            lines = text.splitlines()
            first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
            stated = str(tomllib.loads(text).get("name", "")) if self.kind == "engine" else ""
            found = stated or " ".join(line.lstrip("# ") for line in lines[:first])
        return str(_SENTENCE.split(" ".join(found.split()), maxsplit=1)[1])


def copy_shipped(name: str, files: list[Shipped], folder: Path) -> Path:
    """Copy the file of this NAME, or KIND/NAME, into a folder; nothing is overwritten.

    Raises DataError for a name that no file has, or several, and where there is a file already.
    """
    found = [one for one in files if name in {one.name, one.file.name, f"{one.kind}/{one.name}"}]
    if not found:
        known = {one.name for one in files} | {f"{one.kind}/{one.name}" for one in files}
        raise DataError(
            f"{name}: no shipped file has this name{suggestion(name, sorted(known))}; without --copy all are listed"
        )
    if len(found) > 1:
        kinds = " or ".join(f"{one.kind}/{one.name}" for one in found)
        raise DataError(f"{name}: several files have this name: expected {kinds}")
    target = folder / found[0].file.name
    if target.exists():
        raise DataError(f"{target}: is there already; name another folder, -o FOLDER")
    folder.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copyfile(found[0].file, target))


def files_command(program: str, kinds: Mapping[str, tuple[str, str]], example: str) -> click.Command:
    """The command ``files`` of a program, of its kinds of files."""

    @command(
        "files",
        help="List what is shipped, or copy a file of it for editing.\n\n"
        f"A command takes a shipped file by its name, and a file of your own by its path. KIND: {', '.join(kinds)}.",
        epilog=f"\b\nExamples:\n  {program} files {example.partition('/')[0]}\n"
        f"  {program} files --copy {example} -o mine\n"
        "\b\nExit codes: 0 done, 1 no file, or several, of that name, or it is there already.",
    )
    def files(
        kind: str | None = argument("[KIND]", type=Word(list(kinds)), required=False),
        name: str | None = option(
            "Copy this file; KIND/NAME where several have the name.", None, "--copy", metavar="NAME"
        ),
        folder: Path = option(
            "The folder to copy into; the present one unless given.",
            None,
            "-o",
            "--output",
            default=".",
            show_default=False,
        ),
    ) -> Answer:
        known = [
            Shipped(kind_of, shipped, datasets.ROOT / place / f"{shipped}{suffix}")
            for kind_of, (place, suffix) in kinds.items()
            if kind in (None, kind_of)
            for shipped in datasets.dataset_names(place, suffix)
        ]
        if name is not None:
            copied = copy_shipped(name, known, folder)
            text = f"{plain_text(str(copied))}: a copy to be edited; commands take it by its path."
            return Answer({"copied": copied}, lambda: say(text))
        title, remark = f"Shipped with {program}: {len(known)} files", f"copy one: {program} files --copy NAME"
        return Answer({"files": known}, lambda: emit_table(title, *table(Shipped, known), remark))

    return files


files = files_command("balance", MECHANICS, "mechanism/five-bar")


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
    "trial-runs": "balance.rotors.trial_runs:TrialRunsTable",
}
"""Model of each kind of input file."""
_LONGEST_DEFAULT = 40
_IN_BRACKETS = re.compile(r"\[[^]]*\]")
_HEAD = (
    "# Input files",
    "",
    "Every key of every file that the commands read: TOML unless its text says otherwise. What is not required may be",
    "left out. A table is headed `[key]`, each table of a list `[[key]]`. `testbench schema KIND` prints the JSON",
    "schema, by which editors complete and check; `testbench files` lists the shipped files and copies them.",
    "Mechanisms are MJCF, URDF or SDF: [mechanism files](mechanisms.md). This page is written by",
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

    @command(
        "schema",
        help="Print the JSON schema of an input file: its keys, their meaning, unit, example and default.\n\n"
        f"Editors check a file by it while it is written. KIND: {', '.join(models)}.",
        epilog=f"\b\nExamples:\n  {program} schema {example} > {example}.schema.json\n"
        f"  {program} schema {example} --text",
    )
    def schema(
        kind: str | None = argument("KIND", type=Word(list(models)), required=False),
        text: bool = option("As tables for people (Markdown); of all kinds unless one is named."),
    ) -> None:
        if text:
            click.echo(reference_page(models, [kind] if kind else list(models)), nl=False)
        elif kind is None:
            raise click.UsageError(f"expected a KIND: one of {', '.join(models)}")
        else:
            click.echo(json_text(file_schema(models, kind), version={}))

    return schema


def reference_page(models: Mapping[str, str], kinds: Iterable[str]) -> str:
    """The keys of kinds of files, in Markdown."""
    kinds = list(kinds)
    lines = [line for kind in kinds for line in reference(kind, file_schema(models, kind))]
    return "\n".join([*(_HEAD if len(kinds) > 1 else ()), *lines])


def reference(kind: str, schema: Mapping[str, Any]) -> Iterable[str]:
    """Lines of Markdown: the keys of a kind of file, a table each for the file and what it holds."""
    yield f"## {kind}"
    for title, part in {"": schema, **schema.get("$defs", {})}.items():
        yield from ([f"### {kind}: {_title(title)}"] if title else [])
        yield from (part["description"].partition("\n\n>>>")[0].replace("``", "`"), "")
        yield from ("| key | meaning | written as | default |", "|---|---|---|---|")
        for key, one in part.get("properties", {}).items():
            default = "required" if key in part.get("required", ()) else _default(one.get("default"))
            yield f"| `{key}` | {_cell(one['description'])} | {_cell(_form(one, kind))} | {default} |"
        for pattern, one in part.get("patternProperties", {}).items():
            key = pattern.strip("^$").replace(".+", "NAME")
            yield f"| `{key}` | {_cell(one['description'])} | {_form(one, kind)} | |"
        yield ""


def _title(name: str) -> str:
    """``_WrenchUnits`` and ``MoveTable`` as people read them."""
    return "".join(f" {c.lower()}" if c.isupper() else c for c in name.strip("_").removesuffix("Table")).strip()


def _cell(text: str) -> str:
    return " ".join(text.replace("``", "`").replace("|", "\\|").split())


def _default(value: object) -> str:
    text = "" if value in (None, "", []) or isinstance(value, dict) else json.dumps(value, ensure_ascii=False)
    return f"`{text}`" if 0 < len(text) <= _LONGEST_DEFAULT else ""


def _form(one: Mapping[str, Any], kind: str) -> str:
    """How a value is written: a text with a unit, one of some words, a number, a list, a table of the same page."""
    if "$ref" in one:
        title = _title(one["$ref"].rpartition("/")[2])
        return f"table [{title}](#{kind}-{title.replace(' ', '-')})"
    if "const" in one or "enum" in one:
        return " or ".join(f"`{word}`" for word in one.get("enum", [one.get("const")]))
    if several := [part for key in ("anyOf", "oneOf") for part in one.get(key, ()) if part.get("type") != "null"]:
        return " or ".join(dict.fromkeys(_form(part, kind) for part in several))
    if "unit" in one:
        return f"text with a unit, [{one['unit']}], such as `{one['examples'][0]}`"
    if one.get("type") == "array":
        items = [one["items"]] if isinstance(one.get("items"), dict) else one.get("prefixItems", [])
        each = " or ".join(dict.fromkeys(_form(item, kind) for item in items))
        return "list" + (f" of ({each})" if " or " in _IN_BRACKETS.sub("", each) else f" of {each}" if items else "")
    if one.get("type") == "object":
        inner = one.get("additionalProperties")
        return "table" + (f" by name, each {_form(inner, kind)}" if isinstance(inner, dict) else "")
    words = {"number": "number", "integer": "whole number", "boolean": "true or false"}
    example = "".join(f", such as `{text}`" for text in one.get("examples", [])[:1])
    return words.get(one.get("type", ""), "text") + example


schema = schema_command("balance", MODELS, "drive")
