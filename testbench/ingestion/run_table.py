"""The run table, ``runs.csv``: one row a log file with the conditions of its run, checked by line and column.

From it, and the files that are given, follow the runs to be stored, or why one cannot be.
"""

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
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
    """Name of the log file, or its place relative to the table's folder."""
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
    """Peak acceleration of the motion of a point, in g0."""
    peak_acceleration_rad_s2: NotNegative | None = None
    """Peak acceleration of the motion of joints that turn [rad/s2]."""
    repeat: Annotated[int, Field(ge=0)] | None = None
    """Which repeat of the same conditions it is."""

    @property
    def conditions(self) -> Conditions:
        """What the run was made with; what the table leaves empty is absent."""
        return cast(Conditions, self.model_dump(exclude={"file", "run", "origin"}, exclude_none=True))


COLUMNS = tuple(RunRow.model_fields)
"""Columns of a run table; ``file`` alone must be there."""
_NUMBERS = ("payload_kg", "counter_masses", "peak_acceleration_g", "peak_acceleration_rad_s2")


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
    """The rows of a run table. Raises RigError, with line and column, for what it does not understand.

    Commas, tabs or semicolons separate the cells, as the first line shows; with semicolons, as spreadsheets of half of
    Europe write them, numbers may have decimal commas, all or none.
    """
    text = read_text(run_table, RigError).removeprefix("\ufeff")
    first = text.partition("\n")[0]
    delimiter = ";" if ";" in first else "\t" if "\t" in first else ","
    table = csv.DictReader(io.StringIO(text), delimiter=delimiter)
    columns = [name.strip() for name in table.fieldnames or []]
    table.fieldnames = columns
    if "file" not in columns:
        raise RigError(f"{run_table.name}: no column 'file': expected a run table with {', '.join(COLUMNS)}")
    if unknown := [name for name in columns if name not in COLUMNS]:
        hint = suggestion(unknown[0], COLUMNS) or f": expected some of {', '.join(COLUMNS)}"
        raise RigError(f"{run_table.name}: unknown column {unknown[0]!r}{hint}")
    try:
        rows = [_row(run_table.name, table.line_num, cells, delimiter) for cells in table if any(cells.values())]
    except csv.Error as error:
        raise RigError(f"{run_table.name}, line {table.line_num}: {error}") from error
    if not rows:
        raise RigError(f"{run_table.name}: names no file")
    _check_rows(run_table, rows)
    return rows


def _check_rows(run_table: Path, rows: Sequence[RunTableRow]) -> None:
    """Each file once, and one decimal mark throughout."""
    lines: dict[PurePath, int] = {}
    for row in rows:
        place = PurePath(row.file)
        if place in lines:
            raise RigError(
                f"{run_table.name}, line {row.line}: names {row.file} a second time, after line {lines[place]}; "
                "expected each file once: its conditions would be those of either line"
            )
        lines[place] = row.line
    marks = {mark: row.line for row in rows for mark in row.marks}
    if len(marks) > 1:
        raise RigError(
            f"{run_table.name}: decimal commas (line {marks[',']}) and decimal points (line {marks['.']}): expected "
            "one of the two, lest 1,451 and 1.451 be taken for the same"
        )


def _row(name: str, line: int, cells: Mapping[str | None, str | None], delimiter: str) -> RunTableRow:
    place = f"{name}, line {line}"
    if None in cells or None in cells.values():
        hint = (
            "" if delimiter != ";" else "; counter_masses with several sites need quotes in a run table with semicolons"
        )
        raise RigError(f"{place}: more or fewer cells than columns{hint}")
    text = {str(column): (cell or "").strip() for column, cell in cells.items()}
    marks = frozenset(re.findall(r"(?<=\d)[.,](?=\d)", " ".join(text.get(column, "") for column in _NUMBERS)))
    if delimiter == ";" and marks == {","}:
        text |= {column: text[column].replace(",", ".") for column in _NUMBERS if column in text}
    given = {column: cell for column, cell in text.items() if cell or column == "counter_masses"}
    row = model_from_table(RunRow, given, place, RigError)
    return RunTableRow(line, row.file, row.run, row.origin, row.conditions, marks)


_NAME = re.compile(r"[\w+(#@][\w+()#@,=~ .-]{0,119}")


@dataclass(frozen=True)
class PlannedRun:
    """A run to be: its name, its log files, and what the run table says of it (None: it says nothing).

    ``problem`` is why it cannot be stored; empty if it can.
    """

    name: str
    files: tuple[Path, ...]
    origin: Origin | None = None
    conditions: Conditions | None = None
    problem: str = ""
    folder: Path | None = None
    """Of the run table."""
    missing: tuple[str, ...] = ()
    """Logs that the run table names, and that are not given."""


def plan_runs(files: Sequence[Path], run_table: Path | None) -> list[PlannedRun]:
    """Which files make which runs: those that the run table puts together, else each file its own.

    Raises RigError for a run table that contradicts itself.
    """
    if run_table is None:
        runs = [PlannedRun(path.stem, (path,)) for path in files]
        problems = _problems(runs)
        return [replace(run, problem=problems.get(run.name, "")) for run in runs]
    return plan_rows(read_run_table(run_table), [p for p in files if not same_file(p, run_table)], run_table)


def plan_rows(rows: Sequence[RunTableRow], files: Sequence[Path], run_table: Path) -> list[PlannedRun]:
    """The runs of a run table, also those of which logs are missing; then files that it does not name, each as a run.

    Raises RigError if rows of one run differ in their conditions, or runs would have one name, or one row means several
    files.
    """
    paths = {row.line: path for row in rows if (path := _given(row, files, run_table)) is not None}
    named = list(paths.values())
    for row in rows:
        if row.line in paths and named.count(paths[row.line]) > 1:
            raise RigError(f"{run_table.name}, line {row.line}: names {row.file} a second time")
    groups: dict[str, list[RunTableRow]] = {}
    for row in rows:
        groups.setdefault(row.run or PurePath(row.file).stem, []).append(row)
    runs = [_run(name, together, paths, run_table) for name, together in groups.items()]
    for problem in _problems(runs).values():
        raise RigError(problem)
    unnamed = f"{run_table.name} does not name it: add a row for it, or do not give it"
    return runs + [
        PlannedRun(path.stem, (path,), problem=f"{path.name}: {unnamed}") for path in files if path not in named
    ]


def _problems(runs: Sequence[PlannedRun]) -> dict[str, str]:
    """Why runs of these names cannot be stored, by name."""
    files: dict[str, list[str]] = {}
    for run in runs:
        files.setdefault(run.name, []).append(str([*run.files, run.name][0]))
    found = {}
    for name, same in files.items():
        if _NAME.fullmatch(name) is None:
            found[name] = (
                f"{Path(same[0]).name}: {name!r} is no name for a stored run; expected up to 120 letters, digits, "
                "blanks and - _ . + , = ~ @ # ( ); rename the file, or name the run by a column 'run' of a run table"
            )
        elif len(same) > 1:
            found[name] = (
                f"{', '.join(same)}: would all be stored as run {name!r}; name each in column 'run' of a run table"
            )
    return found


def _run(name: str, rows: Sequence[RunTableRow], paths: Mapping[int, Path], run_table: Path) -> PlannedRun:
    first = rows[0]
    for row in rows[1:]:
        if row.run is None:
            raise RigError(
                f"{run_table.name}, line {row.line}: {row.file} would be stored as {name!r}, as line {first.line}"
            )
        if (row.conditions, row.origin) != (first.conditions, first.origin):
            raise RigError(f"{run_table.name}, line {row.line}: run {name!r} has other conditions in line {first.line}")
    missing = tuple(row.file for row in rows if row.line not in paths)
    given = tuple(paths[row.line] for row in rows if row.line in paths)
    problem = f"waits for {', '.join(missing)}, of the same run {name!r}" if missing else ""
    return PlannedRun(name, given, first.origin, first.conditions, problem, run_table.parent, missing)


def _given(row: RunTableRow, files: Iterable[Path], run_table: Path) -> Path | None:
    """The given file that a row means: the one at that place from the run table, else the only one of that name."""
    place = run_table.parent / row.file
    exact = [path for path in files if same_file(path, place)]
    matches = exact or [path for path in files if path.name == row.file]
    if len(matches) > 1:
        raise RigError(
            f"{run_table.name}, line {row.line}: several of the given files have the name {row.file!r}; write their "
            "folder too"
        )
    return matches[0] if matches else None


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths are one file."""
    return one.resolve() == other.resolve()
