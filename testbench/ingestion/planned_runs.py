"""Which of the files that are given make which runs, by the run table or without one, or why one cannot be stored."""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from ..errors import RigError
from ..recording import Conditions, Origin

if TYPE_CHECKING:
    from .run_table import RunTableRow

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
        runs = [PlannedRun(path.stem, (path,)) for path in {p.resolve(): p for p in reversed(files)}.values()][::-1]
        problems = _problems(runs)
        return [replace(run, problem=problems.get(run.name, "")) for run in runs]
    from .run_table import read_run_table  # late: a log alone needs no model of a table

    return plan_rows(read_run_table(run_table), [p for p in files if not same_file(p, run_table)], run_table)


def plan_rows(rows: "Sequence[RunTableRow]", files: Sequence[Path], run_table: Path) -> list[PlannedRun]:
    """The runs of a run table, also those of which logs are missing; then files that it does not name, each as a run.

    Raises RigError, a line for each, if rows of one run differ in their conditions, or runs would have one name, or two
    rows name one file; and if one row means several files.
    """
    files = list(dict.fromkeys(files))
    places: dict[Path, list[Path]] = {}
    for path in files:
        places.setdefault(path.resolve(), []).append(path)
    folder = run_table.parent.resolve()
    given = {row.file: _given(row, files, places.get((folder / row.file).resolve(), []), run_table) for row in rows}
    paths = {name: path for name, path in given.items() if path is not None}
    named = list(paths.values())
    wrong = [
        f"{run_table.name}, line {row.line}: names {row.file} a second time"
        for place, row in enumerate(rows)
        if row.file in paths and paths[row.file] in [paths.get(earlier.file) for earlier in rows[:place]]
    ]
    groups: dict[str, list[RunTableRow]] = {}
    for row in rows:
        groups.setdefault(row.run or PurePath(row.file).stem, []).append(row)
    runs = []
    for name, together in groups.items():
        first = together[0]
        for row in together[1:]:
            line = f"{run_table.name}, line {row.line}"
            if row.run is None:
                wrong.append(f"{line}: {row.file} would be stored as {name!r}, as line {first.line}")
            elif (row.conditions, row.origin) != (first.conditions, first.origin):
                wrong.append(f"{line}: run {name!r} has other conditions in line {first.line}: is the name used twice?")
        missing = tuple(row.file for row in together if row.file not in paths)
        own = tuple(paths[row.file] for row in together if row.file in paths)
        problem = f"waits for {', '.join(missing)}, of the same run {name!r}" if missing else ""
        runs.append(PlannedRun(name, own, first.origin, first.conditions, problem, run_table.parent, missing))
    if wrong := [*wrong, *_problems(runs).values()]:
        raise RigError("\n".join(dict.fromkeys(wrong)))
    unnamed = f"{run_table.name} does not name it: add a row for it, or do not give it"
    table = "it is a run table, not a log, and is left alone"
    return runs + [
        PlannedRun(path.stem, (path,), problem=f"{path.name}: {table if is_run_table(path) else unnamed}")
        for path in files
        if path not in named
    ]


def other_run_tables(files: Sequence[Path], run_table: Path | None) -> dict[Path, str]:
    """Run tables among the files of a command, beside the one that it names, and what is said of each.

    None are told apart where no file but these is given, for then somebody means them.
    """
    found = dict[Path, str]()
    for path in files:
        if run_table is None and is_run_table(path):
            found[path] = "is a run table and no log, and left alone: if it is that of these logs, give it with --runs"
        elif run_table is not None and not same_file(path, run_table):
            if _same_content(path, run_table):
                found[path] = f"is a copy of the run table {run_table.name} and no log, and is left alone"
            elif is_run_table(path):
                found[path] = f"is a run table and no log, and is left alone: what runs were made with says {run_table}"
    return found if len(found) < len(files) else {}


def _same_content(one: Path, other: Path) -> bool:
    with suppress(OSError):
        return one.is_file() and one.stat().st_size == other.stat().st_size and one.read_bytes() == other.read_bytes()
    return False


def is_run_table(path: Path) -> bool:
    """Whether a file has the columns ``run``, and ``file`` or some ``file_NAME``, and no row of numbers next."""
    if not path.is_file():  # a pipe would wait for who writes it
        return False
    try:
        with path.open(encoding="utf-8-sig", errors="replace") as stream:
            names, values = (re.split("[,;\t]", stream.readline(10_000).strip()) for _ in range(2))
    except OSError:
        return False
    columns, is_log = {name.strip(' "\n') for name in names}, False
    with suppress(ValueError):  # of a log the rows are numbers
        is_log = bool([float(value) for value in values if value])
    return not is_log and "run" in columns and any(name == "file" or name.startswith("file_") for name in columns)


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


def _given(row: "RunTableRow", files: Iterable[Path], exact: Sequence[Path], run_table: Path) -> Path | None:
    """The given file that a row means: the one at that place from the run table, ``exact``, else that of its name."""
    matches = exact or [path for path in files if path.name == row.file]
    if len(matches) > 1:
        raise RigError(
            f"{run_table.name}, line {row.line}: several of the given files have the name {row.file!r}: "
            f"{', '.join(map(str, matches))}; give one, or write its place from the table's folder into the table"
        )
    return matches[0] if matches else None


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths are one file."""
    return one.resolve() == other.resolve()
