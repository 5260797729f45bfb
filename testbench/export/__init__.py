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
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{folder}: no folder to write into ({error.strerror or error}); name another") from error
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


def write_export(run: Run, groups: list[str], to: str, target: Path) -> Exported:
    """Write groups of a run into one file, under a hidden name first; never over another file."""
    if target.exists():
        raise _taken(target)
    part = target.with_name(f".{uuid4().hex[:12]}{TARGETS[to]}")
    try:
        losses = getattr(import_module(".tables", __package__), f"export_{to}")(run, groups, part)
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
