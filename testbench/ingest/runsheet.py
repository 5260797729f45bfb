"""The sheet of run conditions, ``runs.csv``: which file was recorded with what."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

from ..errors import RigError
from ..recording import Conditions, Origin
from .sheetrows import COLUMNS, SheetRow, read

__all__ = ["COLUMNS", "PlannedRun", "Ready", "SheetRow", "plan", "read", "ready", "same_file"]

_NAME = re.compile(r"[\w+(#@][\w+()#@,=~ .-]{0,119}")


@dataclass(frozen=True)
class PlannedRun:
    """A run to be: its name, its log files, and what the sheet says of it (None: there is no sheet).

    ``problem`` is why it cannot be stored under its name; empty if it can.
    """

    name: str
    files: tuple[Path, ...]
    origin: Origin | None = None
    conditions: Conditions | None = None
    problem: str = ""


def plan(files: Sequence[Path], sheet: Path | None) -> list[PlannedRun]:
    """Which files make which runs: those that the sheet puts together, else each file its own.

    Raises RigError if files and sheet do not name the same.
    """
    if sheet is None:
        runs = [PlannedRun(path.stem, (path,)) for path in files]
        problems = _problems(runs)
        return [replace(run, problem=problems.get(run.name, "")) for run in runs]
    files = [path for path in files if not same_file(path, sheet)]
    runs = _from_sheet(read(sheet), files, sheet)
    _check_names(runs)
    return runs


@dataclass(frozen=True)
class Ready:
    """What a sheet makes of the files that are there so far."""

    runs: tuple[PlannedRun, ...]
    """Those of which all files are there."""
    waiting: dict[Path, str]
    """Files of other runs, and what they wait for."""
    unnamed: tuple[Path, ...]
    """Files that the sheet does not name."""


def ready(rows: Sequence[SheetRow], files: Sequence[Path], sheet: Path) -> Ready:
    """The runs of a sheet that are complete, of the files that are there so far.

    Raises RigError if rows of one run differ in their conditions, or runs would have one name.
    """
    there = {row.line: path for row in rows for path in files if _means(row, path, sheet)}
    groups: dict[str, list[SheetRow]] = {}
    for row in rows:
        groups.setdefault(row.run or PurePath(row.file).stem, []).append(row)
    runs, waiting = [], {}
    for name, together in groups.items():
        missing = [row.file for row in together if row.line not in there]
        if not missing:
            runs.append(_run(name, together, there, sheet))
            continue
        for row in together:
            if row.line in there:
                waiting[there[row.line]] = f"waits for {', '.join(missing)}, of the same run {name!r}"
    _check_names(runs)
    return Ready(tuple(runs), waiting, tuple(path for path in files if path not in there.values()))


def _means(row: SheetRow, path: Path, sheet: Path) -> bool:
    return path.name == row.file or same_file(path, sheet.parent / row.file)


def _check_names(runs: Sequence[PlannedRun]) -> None:
    for problem in _problems(runs).values():
        raise RigError(problem)


def _problems(runs: Sequence[PlannedRun]) -> dict[str, str]:
    """Why runs of these names cannot be stored, by name."""
    files: dict[str, list[str]] = {}
    for run in runs:
        files.setdefault(run.name, []).append(str(run.files[0]))
    found = {}
    for name, same in files.items():
        if _NAME.fullmatch(name) is None:
            found[name] = (
                f"{Path(same[0]).name}: {name!r} is no name for a stored run; expected up to 120 letters, digits, "
                "blanks and - _ . + , = ~ @ # ( ); rename the file, or name the run by a column 'run' of a sheet"
            )
        elif len(same) > 1:
            found[name] = (
                f"{', '.join(same)}: would all be stored as run {name!r}; name them apart by a column 'run' of a sheet"
            )
    return found


def _from_sheet(rows: Sequence[SheetRow], files: Sequence[Path], sheet: Path) -> list[PlannedRun]:
    """The runs of a sheet, after a check that it names the given files, each once, and no others."""
    paths = {row.line: _given(row, files, sheet) for row in rows}
    named = list(paths.values())
    for row in rows:
        if named.count(paths[row.line]) > 1:
            raise RigError(f"{sheet.name}, line {row.line}: names {row.file} a second time")
    if left := [path.name for path in files if path not in named]:
        raise RigError(f"{sheet.name}: does not name {', '.join(left)}; add a line for it, or do not give it")
    runs: dict[str, list[SheetRow]] = {}
    for row in rows:
        runs.setdefault(row.run or paths[row.line].stem, []).append(row)
    return [_run(name, together, paths, sheet) for name, together in runs.items()]


def _run(name: str, rows: Sequence[SheetRow], paths: Mapping[int, Path], sheet: Path) -> PlannedRun:
    first = rows[0]
    for row in rows[1:]:
        if row.run is None:
            raise RigError(
                f"{sheet.name}, line {row.line}: {row.file} would be stored as {name!r}, as line {first.line}"
            )
        if (row.conditions, row.origin) != (first.conditions, first.origin):
            raise RigError(f"{sheet.name}, line {row.line}: run {name!r} has other conditions in line {first.line}")
    return PlannedRun(name, tuple(paths[row.line] for row in rows), first.origin, first.conditions)


def _given(row: SheetRow, files: Iterable[Path], sheet: Path) -> Path:
    """The given file that a row means: the one at that place beside the sheet, else the only one of that name."""
    beside = sheet.parent / row.file
    exact = [path for path in files if same_file(path, beside)]
    matches = exact or [path for path in files if path.name == row.file]
    if len(matches) == 1:
        return matches[0]
    problem = "several of the given files have" if matches else "none of the given files has"
    raise RigError(f"{sheet.name}, line {row.line}: {problem} the name {row.file!r}; give the file, or mend the line")


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths are one file."""
    return one.resolve() == other.resolve()
