"""A campaign: a folder of stored runs, each with its digest beside it."""

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

from ..errors import StoreError
from . import digest
from .run import Run, open_run
from .writer import PART

SUFFIX = ".h5"


@dataclass(frozen=True)
class FileState:
    """What :meth:`Campaign.verify` found of a file: ``intact``, ``damaged``, ``missing``, ``unfinished``, ``extra``."""

    name: str
    status: str
    message: str = ""

    def as_dict(self) -> dict[str, str]:
        """The state as it is printed."""
        return asdict(self)


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

    def verify(self) -> list[FileState]:
        """The state of every file in the folder: of runs by their digests, of others that they are there."""
        states = [_state_of(path) for path in self.run_paths]
        known = {path.name for path in self.run_paths} | {digest.beside(path).name for path in self.run_paths}
        for path in sorted(self.path.iterdir()):
            if path.name.endswith(SUFFIX + digest.SUFFIX) and path.name not in known:
                name = path.name.removesuffix(digest.SUFFIX)
                states.append(FileState(name, "missing", "its digest is there, the run is not"))
            elif path.name.endswith(PART):
                states.append(FileState(path.name, "unfinished", "left by an ingest that was stopped; no run of it"))
            elif path.name not in known:
                states.append(FileState(path.name, "extra", "no stored run"))
        return states


def open_campaign(folder: str | Path) -> Campaign:
    """Open the campaign in ``folder``."""
    path = Path(folder)
    if not path.is_dir():
        raise StoreError(f"{path}: no such folder; expected a campaign, as `testbench ingest -o` makes it")
    campaign = Campaign(path)
    if not campaign.run_paths and not any(path.glob(f"*{SUFFIX}{digest.SUFFIX}")):
        raise StoreError(f"{path}: holds no run (*{SUFFIX}); `testbench ingest FILE... -o {path}` puts some there")
    return campaign


def _state_of(run: Path) -> FileState:
    """Whether the bytes of a run are those that were written."""
    try:
        expected = digest.recorded(run)
        found = digest.sha256_of(run)
    except (StoreError, OSError) as error:
        return FileState(run.name, "damaged", str(error))
    if found == expected:
        return FileState(run.name, "intact")
    message = f"its content changed: SHA-256 {found[:12]}..., when written {expected[:12]}..."
    return FileState(run.name, "damaged", message)
