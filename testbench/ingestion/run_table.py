"""The run table, ``runs.csv`` or ``runs.xlsx``: what each run was made with, checked by line and column.

A long table has a row a log file, a wide one a row a run with a column ``file_NAME`` for each log.
"""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path, PurePath
from typing import Annotated, cast

from pydantic import BeforeValidator, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from balance.errors import CounterpoiseError, DataError, suggestion
from balance.input_files import NoUnderscores, Table, Text, model_from_table, read_text
from balance.units import si

from ..errors import RigError
from ..recording import Conditions, Origin

NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False), NoUnderscores]


def _by_site(text: object) -> object:
    """``SITE=KG;SITE=KG``, or ``SITE=500 g``, as masses by site; nothing: no counter-masses.

    A comma before the next ``SITE=`` separates too.
    """
    masses: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in re.split(r";|,(?=[^;,=]*=)", str(text)))):
        site, equals, mass = (word.strip() for word in part.partition("="))
        if not site or not equals or "=" in mass:
            raise ValueError(f"{part!r}: expected SITE=KG;SITE=KG")
        if site in masses:
            raise ValueError(f"name the site {site!r} twice")
        plain = re.fullmatch(r"[-+.\d]*(e[-+]?\d+)?", mass, re.IGNORECASE)
        try:
            masses[site] = mass if plain else repr(si(mass, "mass"))
        except CounterpoiseError as error:
            raise ValueError(f"{error}; or a number in kg") from error
    return masses


BySite = Annotated[dict[str, NotNegative], BeforeValidator(_by_site, json_schema_input_type=str)]


class RunRow(Table):
    """A row: a log file, or all logs of a run, and what the run was made with."""

    model_config = ConfigDict(
        json_schema_extra={
            "patternProperties": {
                "^file_.+$": {
                    "type": "string",
                    "description": "In a table with a row a run: one column for each of its log files, by any NAME.",
                },
                "^payload_.+_kg$": {
                    "type": "number",
                    "minimum": 0,
                    "description": "All that the body NAME carries, itself included, or what is added at the site "
                    "NAME [kg].",
                },
            }
        }
    )

    file: Text | None = None
    """Name of the log file, or its place relative to the table's folder; or columns file_NAME."""
    run: Text | None = None
    """Name of the run; files of one run are stored together."""
    origin: Origin = "unstated"
    """Where the log is from."""
    payload_kg: NotNegative | None = None
    """Everything that the mechanism's payload body carries, itself included [kg]."""
    payloads: SkipJsonSchema[dict[str, NotNegative] | None] = None
    """Of columns ``payload_NAME_kg``: by body or site [kg]."""
    files: SkipJsonSchema[tuple[Text, ...]] = ()
    """Of columns ``file_NAME``."""
    counter_masses: BySite | None = None
    """Counter-masses by site, ``SITE=KG;SITE=KG`` [kg]; a mass may have its unit, ``SITE=500 g``."""
    motion: Text | None = None
    """Name of the motion, or its file."""
    peak_acceleration_g: NotNegative | None = None
    """Peak acceleration of the motion of a point, in g0."""
    peak_acceleration_rad_s2: NotNegative | None = None
    """Peak acceleration of the motion of joints that turn [rad/s2]."""
    repeat: Annotated[int, Field(ge=0), NoUnderscores] | None = None
    """Which repeat of the same conditions it is."""

    @property
    def conditions(self) -> Conditions:
        """What the run was made with; what the table leaves empty is absent."""
        return cast(Conditions, self.model_dump(exclude={"file", "files", "run", "origin"}, exclude_none=True))

    def _check(self) -> None:
        if bool(self.file) == bool(self.files):
            raise DataError("file: missing: expected name of the log file, or columns file_NAME, one for each log")
        if self.files and self.run is None:
            raise DataError("run: missing: expected a name, which the run of several files needs")


COLUMNS = tuple(name for name in RunRow.model_fields if name not in {"payloads", "files"})
"""Columns of a run table, beside those of _OTHERS; ``file``, or some ``file_NAME``, alone must be there."""
_OTHERS = {"files": re.compile(r"file_(.+)"), "payloads": re.compile(r"payload_(.+)_kg")}
"""Columns with a name of the user's."""
_ONE_MARK = "expected decimal commas or decimal points throughout, lest 1,451 and 1.451 be taken for the same"
_NUMBERS = {"payload_kg", "counter_masses", "peak_acceleration_g", "peak_acceleration_rad_s2"}


@dataclass(frozen=True)
class RunTableRow:
    """One line of the run table."""

    line: int
    file: str
    run: str | None
    origin: Origin
    conditions: Conditions
    marks: frozenset[str] = frozenset()
    """Decimal marks in its numbers."""


def read_run_table(run_table: Path) -> list[RunTableRow]:
    """The rows of a run table, one a log. Raises RigError, with line and column, for what it does not understand.

    Of a CSV commas, tabs or semicolons separate the cells, as the first line shows; with semicolons, as spreadsheets of
    half of Europe write them, numbers may have decimal commas, all or none.
    """
    rows, problems = run_table_rows(run_table)
    if problems:
        raise RigError("\n".join(problems))
    return rows


def run_table_rows(run_table: Path) -> tuple[list[RunTableRow], list[str]]:
    """The rows that are understood, and what is wrong with the others or between them, all of it.

    Raises RigError for a table that is none.
    """
    if run_table.suffix.lower() in {".xlsx", ".xlsm"}:
        from .spreadsheet import spreadsheet_rows  # late: it needs a library that few tables do

        table, delimiter = spreadsheet_rows(run_table), ""
    else:
        table, delimiter = _csv_table(run_table)
    columns = [cell.strip() for cell in table[0][1]] if table else []
    if "file" not in columns and not any(_OTHERS["files"].fullmatch(name) for name in columns):
        raise RigError(
            f"{run_table.name}: no column 'file': expected a run table with {', '.join(COLUMNS)}; or a row a run, with "
            "columns file_NAME in place of file"
        )
    if again := [name for name in columns if columns.count(name) > 1]:
        raise RigError(f"{run_table.name}: column {again[0]!r} is there twice: remove one")
    for name in columns:
        if name not in COLUMNS and not any(form.fullmatch(name) for form in _OTHERS.values()):
            hint = suggestion(name, COLUMNS) or f": expected some of {', '.join(COLUMNS)}, payload_BODY_kg, file_LOGGER"
            raise RigError(f"{run_table.name}: unknown column {name!r}{hint}")
    rows, problems = list[RunTableRow](), list[str]()
    for line, cells in table[1:]:
        try:
            rows += _rows(run_table.name, line, columns, cells, delimiter)
        except RigError as error:
            problems.append(str(error))
    if not rows and not problems:
        raise RigError(f"{run_table.name}: names no file")
    return rows, problems + list(_row_contradictions(run_table, rows))


def write_run_table(path: Path, rows: Iterable[tuple[str, str, Origin, Conditions]]) -> None:
    """Write a long run table: a row for each file, with its run, origin and conditions."""
    lines = [
        {"run": run, "file": file, "origin": origin} | condition_cells(stated) for file, run, origin, stated in rows
    ]
    used = dict.fromkeys(column for line in lines for column in line)
    known = [column for column in ("run", *COLUMNS) if column in used]
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(dict.fromkeys([*known, *used])), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def condition_cells(stated: Conditions) -> dict[str, str]:
    """Conditions as the cells of a row."""
    found = {key: _written(value) for key, value in stated.items() if key != "payloads"}
    return found | {f"payload_{name}_kg": _written(mass) for name, mass in stated.get("payloads", {}).items()}


def _written(value: object) -> str:
    if isinstance(value, dict):
        return ";".join(f"{site}={_written(mass)}" for site, mass in value.items())
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _csv_table(run_table: Path) -> tuple[list[tuple[int, list[str]]], str]:
    """Line and cells of each row that is not blank, and what separates the cells."""
    text = read_text(run_table, RigError).removeprefix("\ufeff")
    first = text.partition("\n")[0]
    delimiter = ";" if ";" in first else "\t" if "\t" in first else ","
    lines = csv.reader(io.StringIO(text), delimiter=delimiter)
    try:
        return [(lines.line_num, cells) for cells in lines if any(cells)], delimiter
    except csv.Error as error:
        raise RigError(f"{run_table.name}, line {lines.line_num}: {error}") from error


def _row_contradictions(run_table: Path, rows: Sequence[RunTableRow]) -> Iterator[str]:
    """What contradicts each file once, and one decimal mark throughout."""
    lines: dict[PurePath, int] = {}
    for row in rows:
        place = PurePath(row.file)
        if place in lines:
            yield (
                f"{run_table.name}, line {row.line}: names {row.file} a second time, after line {lines[place]}; "
                "expected each file once: its conditions would be those of either line"
            )
        lines.setdefault(place, row.line)
    marks = {mark: row.line for row in rows for mark in row.marks}
    if len(marks) > 1:
        yield (
            f"{run_table.name}: decimal commas (line {marks[',']}) and decimal points (line {marks['.']}): {_ONE_MARK}"
        )


def _rows(name: str, line: int, columns: Sequence[str], cells: Sequence[str], delimiter: str) -> Iterator[RunTableRow]:
    """The logs that a row of the table names; without a ``delimiter`` it ends with its last cell that is not blank."""
    place = f"{name}, line {line}"
    if len(cells) > len(columns) or (delimiter and len(cells) < len(columns)):
        hint = (
            "" if delimiter != ";" else "; counter_masses with several sites need quotes in a run table with semicolons"
        )
        raise RigError(f"{place}: {len(cells)} cells: expected {len(columns)}, one for each column{hint}")
    text = {column: cell.strip() for column, cell in zip_longest(columns, cells, fillvalue="")}
    if "\0" in "".join(text.values()):
        raise RigError(f"{place}: holds a NUL character; write the table anew as text")
    numbers = [column for column in text if column in _NUMBERS or _OTHERS["payloads"].fullmatch(column)]
    marks = frozenset(re.findall(r"(?<=\d)[.,](?=\d)", " ".join(text[column] for column in numbers)))
    if delimiter == ";" and marks == {","}:
        text |= {column: re.sub(r"(?<=\d),(?=\d)", ".", text[column]) for column in numbers}
    elif len(marks) > 1:
        raise RigError(f"{place}: {_ONE_MARK}")
    given: dict[str, object] = {
        column: cell for column, cell in text.items() if column in COLUMNS and (cell or column == "counter_masses")
    }
    named = {
        key: {found[1]: cell for column, cell in text.items() if cell and (found := form.fullmatch(column))}
        for key, form in _OTHERS.items()
    }
    given |= {"files": tuple(named["files"].values())} if named["files"] else {}
    given |= {"payloads": named["payloads"]} if named["payloads"] else {}
    try:
        row = model_from_table(RunRow, given, place, RigError)
    except RigError as error:
        raise RigError(re.sub(r'payloads\.("?)(.+?)\1: ', r"payload_\2_kg: ", str(error))) from error
    for file in row.files or (row.file or "",):
        yield RunTableRow(line, file, row.run, row.origin, row.conditions, marks)
