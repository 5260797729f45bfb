"""A campaign: a folder of stored runs, each with its digest beside it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..errors import StoreError
from . import digest
from .run import Run, open_run

SUFFIX = ".h5"


@dataclass(frozen=True)
class Campaign:
    """A folder of runs."""

    path: Path

    @property
    def run_paths(self) -> list[Path]:
        """The files of the stored runs, by name."""
        return sorted(p for p in self.path.glob(f"*{SUFFIX}") if not p.name.startswith("."))

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The stored runs, by name; their data are read when asked for."""
        return tuple(open_run(path) for path in self.run_paths)


def open_campaign(folder: str | Path) -> Campaign:
    """Open the campaign in ``folder``."""
    path = Path(folder)
    if not path.is_dir():
        raise StoreError(f"{path}: no such folder; expected a campaign, as `testbench ingest -o` makes it")
    if not Campaign(path).run_paths:
        raise StoreError(
            f"{path}: holds no run (*{SUFFIX}); `testbench ingest FILE... -o {path}` puts some there"
        )
    return Campaign(path)


def damage(run: Path) -> str | None:
    """What is wrong with a stored run's bytes, or None if its digest agrees."""
    try:
        expected = digest.recorded(run)
        found = digest.sha256_of(run)
    except StoreError as error:
        return str(error)
    if found == expected:
        return None
    return f"{run.name}: its content changed (SHA-256 {found[:12]}..., when written {expected[:12]}...)"
