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


@dataclass(frozen=True)
class Exported:
    """A file that was written, and what it does not hold of the run."""

    file: Path
    losses: tuple[str, ...] = ()


def export(run: Run, to: str, folder: Path) -> list[Exported]:
    """Write a run into ``folder``, one file a run, or a group if the target holds one table a file."""
    write = getattr(import_module(".tables", __package__), f"export_{to}")
    parts = {run.name: [group.name for group in run.groups]}
    if to in PER_GROUP and len(run.groups) > 1:
        parts = {f"{run.name}.{group.path.rpartition('/')[2]}": [group.name] for group in run.groups}
    return [
        _whole(folder, f"{name}{TARGETS[to]}", lambda part, groups=groups: write(run, groups, part))  # type: ignore[misc]
        for name, groups in parts.items()
    ]


def export_joined(run: Run, rate: str, to: str, folder: Path) -> Exported:
    """Write all loggers of a run as one table on one clock, at ``rate`` such as ``1 kHz``: csv or parquet."""
    write = import_module(".tables", __package__).export_joined
    return _whole(folder, f"{run.name}{TARGETS[to]}", lambda part: write(run, rate, to, part))


def _whole(folder: Path, name: str, write: Callable[[Path], list[str]]) -> Exported:
    """A file that has its name once ``write`` is through, which gives what is lost; never over another file."""
    target = folder / name
    taken = StoreError(f"{target}: is there already; nothing is overwritten, name another place")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{folder}: no folder to write into ({error.strerror or error}); name another") from error
    if target.exists():
        raise taken
    part = target.with_name(f".{uuid4().hex[:12]}{target.suffix}")
    try:
        losses = write(part)
        take_name(part, target)
    except FileExistsError as error:
        raise taken from error
    except OSError as error:
        raise StoreError(f"{target}: cannot be written ({error.strerror or error}); nothing of it is left") from error
    finally:
        part.unlink(missing_ok=True)
    return Exported(target, tuple(losses))
