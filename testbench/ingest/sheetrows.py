"""The rows of the run table, ``runs.csv``: one a log file, checked by line and column."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated, cast

from pydantic import BeforeValidator, Field

from balance.input_files import Table, Text, model_from_table, read_text, suggestion

from ..errors import RigError
from ..recording import Conditions, Origin

NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


def _by_site(text: object) -> object:
    """``SITE=KG;SITE=KG`` as masses by site; nothing: no counter-masses."""
    masses: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in str(text).split(";"))):
        site, equals, mass = (word.strip() for word in part.partition("="))
        if not site or not equals:
            raise ValueError(f"{part!r}: expected SITE=KG;SITE=KG")
        if site in masses:
            raise ValueError(f"name the site {site!r} twice")
        masses[site] = mass
    return masses


BySite = Annotated[dict[str, NotNegative], BeforeValidator(_by_site, json_schema_input_type=str)]


class RunRow(Table):
    """A log file, and what its run was made with."""

    file: Text
    """Name of the log file, or its place beside the table."""
    run: Text | None = None
    """Name of the run; files of one run are stored together."""
    origin: Origin = "unstated"
    """Where the log is from."""
    payload_kg: NotNegative | None = None
    """Everything that the platform carries, itself included [kg]."""
    counter_masses: BySite | None = None
    """Counter-masses by site, ``SITE=KG;SITE=KG`` [kg]."""
    motion: Text | None = None
    """Name of the motion, or its file."""
    peak_acceleration_g: NotNegative | None = None
    """Peak acceleration of the motion, in g0."""
    repeat: Annotated[int, Field(ge=0)] | None = None
    """Which repeat of the same conditions it is."""

    @property
    def conditions(self) -> Conditions:
        """What the run was made with; what the table leaves empty is absent."""
        return cast(Conditions, self.model_dump(exclude={"file", "run", "origin"}, exclude_none=True))


COLUMNS = tuple(RunRow.model_fields)
"""Columns of a run table; ``file`` alone must be there."""
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
    """The rows of a run table. Raises RigError, with line and column, for what it does not understand.

    Commas, tabs or semicolons separate the cells, as the first line shows; with semicolons, as spreadsheets of half of
    Europe write them, numbers may have decimal commas, all or none.
    """
    text = read_text(sheet, RigError).removeprefix("\ufeff")
    first = text.partition("\n")[0]
    delimiter = ";" if ";" in first else "\t" if "\t" in first else ","
    table = csv.DictReader(io.StringIO(text), delimiter=delimiter)
    columns = [name.strip() for name in table.fieldnames or []]
    table.fieldnames = columns
    if "file" not in columns:
        raise RigError(f"{sheet.name}: no column 'file': expected a run table with {', '.join(COLUMNS)}")
    if unknown := [name for name in columns if name not in COLUMNS]:
        hint = suggestion(unknown[0], COLUMNS) or f": expected some of {', '.join(COLUMNS)}"
        raise RigError(f"{sheet.name}: unknown column {unknown[0]!r}{hint}")
    try:
        rows = [_row(sheet.name, table.line_num, cells, delimiter) for cells in table if any(cells.values())]
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


def _row(name: str, line: int, cells: Mapping[str | None, str | None], delimiter: str) -> SheetRow:
    place = f"{name}, line {line}"
    if None in cells or None in cells.values():
        hint = "" if delimiter != ";" else "; counter_masses with several sites need quotes in a sheet with semicolons"
        raise RigError(f"{place}: more or fewer cells than columns{hint}")
    text = {str(column): (cell or "").strip() for column, cell in cells.items()}
    marks = frozenset(re.findall(r"(?<=\d)[.,](?=\d)", " ".join(text.get(column, "") for column in _NUMBERS)))
    if delimiter == ";" and marks == {","}:
        text |= {column: text[column].replace(",", ".") for column in _NUMBERS if column in text}
    given = {column: cell for column, cell in text.items() if cell or column == "counter_masses"}
    row = model_from_table(RunRow, given, place, RigError)
    return SheetRow(line, row.file, row.run, row.origin, row.conditions, marks)
