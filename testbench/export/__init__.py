"""Stored runs in other people's forms: values with units and time, and where they come from.

One file a run or a group. Nothing is ever overwritten; a file has its name only once it is whole.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from uuid import uuid4

from ..errors import StoreError
from ..store import Run
from ..store.atomic_files import take_name
from .columns import sep005

__all__ = ["TARGETS", "Exported", "export", "sep005"]

TARGETS = {"csv": ".csv", "parquet": ".parquet", "mat": ".mat", "uff": ".uff"}
"""Files that runs become, and their endings; each is written by ``tables.export_TARGET``."""
PER_GROUP = frozenset({"csv", "parquet"})
"""Targets that hold one table a file."""
Progress = Callable[[int], None]


@dataclass(frozen=True)
class Exported:
    """A file that was written, and what it does not hold of the run."""

    file: Path
    losses: tuple[str, ...] = ()


def export(run: Run, to: str, folder: Path) -> list[Exported]:
    """Write a run into ``folder``, one file a run, or a group if the target holds one table a file."""
    _make(folder)
    groups = [group.name for group in run.groups]
    if to not in PER_GROUP:
        return [write_export(run, groups, to, folder / f"{run.name}{TARGETS[to]}")]
    if len(groups) == 1:
        return [write_export(run, groups, to, folder / f"{run.name}{TARGETS[to]}")]
    stems = [group.path.rpartition("/")[2] for group in run.groups]
    return [
        write_export(run, [name], to, folder / f"{run.name}.{stem}{TARGETS[to]}")
        for name, stem in zip(groups, stems, strict=True)
    ]


def export_joined(run: Run, rate: str, to: str, folder: Path) -> Exported:
    """Write all loggers of a run as one table on one clock, at ``rate`` such as ``1 kHz``: csv or parquet."""
    _make(folder)
    write = import_module(".tables", __package__).export_joined
    return _whole(folder / f"{run.name}{TARGETS[to]}", lambda part: write(run, rate, to, part))


def write_export(run: Run, groups: list[str], to: str, target: Path) -> Exported:
    """Write groups of a run into one file, under a hidden name first; never over another file."""
    write = getattr(import_module(".tables", __package__), f"export_{to}")
    return _whole(target, lambda part: write(run, groups, part))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{folder}: no folder to write into ({error.strerror or error}); name another") from error


def _whole(target: Path, write: Callable[[Path], list[str]]) -> Exported:
    """A file that has its name once ``write`` is through, which gives what is lost; never over another file."""
    if target.exists():
        raise _taken(target)
    part = target.with_name(f".{uuid4().hex[:12]}{target.suffix}")
    try:
        losses = write(part)
        take_name(part, target)
    except FileExistsError as error:
        raise _taken(target) from error
    except OSError as error:
        raise StoreError(f"{target}: cannot be written ({error.strerror or error}); nothing of it is left") from error
    finally:
        part.unlink(missing_ok=True)
    return Exported(target, tuple(losses))


def _taken(target: Path) -> StoreError:
    return StoreError(f"{target}: is there already; nothing is overwritten, name another place")
