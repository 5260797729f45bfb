"""``balance files`` and ``testbench files``: what is shipped, a line each, and copies of it to be edited."""

import json
import re
import shutil
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click

from .. import datasets
from ..errors import DataError, suggestion
from ..results import Key, document, table
from .framework import Word, emit_json, emit_table, json_option, plain_text

MECHANICS = {
    "mechanism": ("mechanisms", ".xml"),
    "robot": ("robots", ".urdf"),
    "motion": ("motions", ".toml"),
    "linkage": ("linkages", ".toml"),
    "engine": ("engines", ".toml"),
    "drive": ("drives", ".toml"),
    "rotor": ("rotors", ".toml"),
    "springs": ("springs", ".toml"),
    "stock": ("stock", ".csv"),
    "materials": ("materials", ".toml"),
}
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


def shipped_files(kinds: Mapping[str, tuple[str, str]]) -> list[Shipped]:
    """All shipped files of the kinds, which map to folder and ending."""
    return [
        Shipped(kind, name, datasets.ROOT / folder / f"{name}{suffix}")
        for kind, (folder, suffix) in kinds.items()
        for name in datasets.dataset_names(folder, suffix)
    ]


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

    @click.command(
        "files",
        help="List what is shipped, or copy a file of it for editing.\n\n"
        f"A command takes a shipped file by its name, and a file of your own by its path. KIND: {', '.join(kinds)}.",
        epilog=f"\b\nExamples:\n  {program} files {example.partition('/')[0]}\n"
        f"  {program} files --copy {example} -o mine\n"
        "\b\nExit codes: 0 done, 1 no file, or several, of that name, or it is there already.",
    )
    @click.argument("kind", type=Word(list(kinds)), metavar="[KIND]", required=False)
    @click.option("--copy", "name", metavar="NAME", help="Copy this file; KIND/NAME where several have the name.")
    @click.option(
        "-o", "--output", "folder", type=click.Path(path_type=Path), default=".", help="The folder to copy into; here."
    )
    @json_option
    def files(kind: str | None, name: str | None, folder: Path, as_json: bool) -> None:
        known = shipped_files(kinds if kind is None else {kind: kinds[kind]})
        if name is not None:
            copied = copy_shipped(name, known, folder)
            if as_json:
                emit_json({"copied": copied})
            else:
                click.echo(f"{plain_text(str(copied))}: a copy to be edited; commands take it by its path.")
        elif as_json:
            emit_json({"files": [document(one) for one in known]})
        else:
            emit_table(f"Shipped with {program}", *table(Shipped, known), f"copy one: {program} files --copy NAME")

    return files


files = files_command("balance", MECHANICS, "mechanism/five-bar")
