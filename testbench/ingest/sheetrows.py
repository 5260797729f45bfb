"""The rows of the sheet of run conditions, ``runs.csv``: one a log file, checked by line and column."""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import cast, get_args

from ..errors import RigError
from ..recording import Conditions, Origin

COLUMNS = ("file", "run", "origin", "payload_kg", "counter_masses", "motion", "peak_acceleration_g", "repeat")
"""Columns of a sheet; ``file`` alone must be there. Files of one ``run`` are stored together."""
_NUMBERS = ("payload_kg", "counter_masses", "peak_acceleration_g")


@dataclass(frozen=True)
class SheetRow:
    """One line of the sheet."""

    line: int
    file: str
    run: str | None
    origin: Origin
    conditions: Conditions
    marks: frozenset[str] = frozenset()
    """Decimal marks in its numbers."""


def read(sheet: Path) -> list[SheetRow]:
    """The rows of a sheet. Raises RigError, with line and column, for what it does not understand.

    Commas, tabs or semicolons separate the cells, as the first line shows; with semicolons, as spreadsheets of half of
    Europe write them, numbers may have decimal commas, all or none.
    """
    try:
        text = sheet.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise RigError(f"{sheet.name}: not UTF-8; save the sheet as UTF-8 (in a spreadsheet: CSV UTF-8)") from error
    except FileNotFoundError as error:
        raise RigError(f"{sheet}: no such file; expected a sheet of run conditions") from error
    except IsADirectoryError as error:
        raise RigError(f"{sheet}: is a folder; expected a sheet of run conditions, such as runs.csv") from error
    first = text.partition("\n")[0]
    delimiter = ";" if ";" in first else "\t" if "\t" in first else ","
    table = csv.DictReader(io.StringIO(text), delimiter=delimiter)
    columns = [name.strip() for name in table.fieldnames or []]
    table.fieldnames = columns
    if "file" not in columns:
        raise RigError(f"{sheet.name}: no column 'file'; expected a sheet of run conditions with {', '.join(COLUMNS)}")
    if unknown := [name for name in columns if name not in COLUMNS]:
        raise RigError(f"{sheet.name}: unknown column {unknown[0]!r}; expected some of {', '.join(COLUMNS)}")
    try:
        rows = [_row(sheet, table.line_num, cells, delimiter) for cells in table if any(cells.values())]
    except csv.Error as error:
        raise RigError(f"{sheet.name}, line {table.line_num}: {error}") from error
    if not rows:
        raise RigError(f"{sheet.name}: names no file")
    _check_rows(sheet, rows)
    return rows


def _check_rows(sheet: Path, rows: Sequence[SheetRow]) -> None:
    """Each file once, and one decimal mark throughout."""
    lines: dict[PurePath, int] = {}
    for row in rows:
        place = PurePath(row.file)
        if place in lines:
            raise RigError(
                f"{sheet.name}, line {row.line}: names {row.file} a second time, after line {lines[place]}; "
                "expected each file once: its conditions would be those of either line"
            )
        lines[place] = row.line
    marks = {mark: row.line for row in rows for mark in row.marks}
    if len(marks) > 1:
        raise RigError(
            f"{sheet.name}: decimal commas (line {marks[',']}) and decimal points (line {marks['.']}): expected one of "
            "the two, lest 1,451 and 1.451 be taken for the same"
        )


def _row(sheet: Path, line: int, cells: Mapping[str | None, str | None], delimiter: str) -> SheetRow:
    if None in cells or None in cells.values():
        hint = "" if delimiter != ";" else "; counter_masses with several sites need quotes in a sheet with semicolons"
        raise RigError(f"{sheet.name}, line {line}: more or fewer cells than columns{hint}")
    text = {str(name): (cell or "").strip() for name, cell in cells.items()}
    place = f"{sheet.name}, line {line}"
    if not text["file"]:
        raise RigError(f"{place}: column 'file' is empty; expected the name of a log file")
    origin = text.get("origin") or "unstated"
    if origin not in get_args(Origin):
        raise RigError(f"{place}: origin {origin!r}; expected {', '.join(get_args(Origin))}, or nothing")
    numbers = " ".join(text.get(name, "") for name in _NUMBERS)
    marks = frozenset(re.findall(r"(?<=\d)[.,](?=\d)", numbers))
    if delimiter == ";" and marks == {","}:
        text |= {name: text[name].replace(",", ".") for name in _NUMBERS if name in text}
    run = text.get("run") or None
    return SheetRow(line, text["file"], run, cast(Origin, origin), _conditions(place, text), marks)


def _conditions(place: str, text: Mapping[str, str]) -> Conditions:
    found = Conditions()
    if payload := text.get("payload_kg"):
        found["payload_kg"] = _number(place, "payload_kg", payload)
    if "counter_masses" in text:
        found["counter_masses"] = _masses(place, text["counter_masses"])
    if motion := text.get("motion"):
        found["motion"] = motion
    if peak := text.get("peak_acceleration_g"):
        found["peak_acceleration_g"] = _number(place, "peak_acceleration_g", peak)
    if repeat := text.get("repeat"):
        if not repeat.isdecimal():
            raise RigError(f"{place}: repeat {repeat!r}; expected a whole number")
        found["repeat"] = int(repeat)
    return found


def _masses(place: str, text: str) -> dict[str, float]:
    """``SITE=KG;SITE=KG`` as masses [kg] by site; nothing: no counter-masses."""
    masses: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in text.split(";"))):
        site, equals, mass = (word.strip() for word in part.partition("="))
        if not site or not equals:
            raise RigError(f"{place}: counter_masses {part!r}; expected SITE=KG;SITE=KG")
        if site in masses:
            raise RigError(f"{place}: counter_masses name the site {site!r} twice")
        masses[site] = _number(place, f"counter_masses {site}", mass)
    return masses


def _number(place: str, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0):
        raise RigError(f"{place}: {column} {text!r}; expected a number such as 1.451, not negative")
    return value
