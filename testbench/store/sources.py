"""Which recordings a campaign holds: the run of each source, by the source's size and SHA-256."""

import os
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import StoreError
from .campaign import Campaign
from .run import open_run


@dataclass
class StoredSources:
    """The sources of the runs in ``folder``, as of the last :meth:`look`; runs are opened once."""

    folder: Path
    unopened: dict[str, str] = field(default_factory=dict, init=False)
    """Runs that cannot be opened, and why: what they hold is not known."""
    _runs: dict[tuple[int, str], str] = field(default_factory=dict, init=False)
    _known: set[Path] = field(default_factory=set, init=False)

    def look(self) -> None:
        """Take in the runs that came since last, and try again those that could not be opened."""
        self.unopened.clear()
        for path in Campaign(self.folder).run_paths:
            if path in self._known:
                continue
            try:
                sources = open_run(path).provenance["sources"]
                self._runs.update({(s["size_bytes"], s["sha256"]): path.name for s in sources})
            except (StoreError, LookupError, TypeError) as error:
                self.unopened[path.name] = str(error).replace(f"{self.folder}{os.sep}", "")
            else:
                self._known.add(path)

    def any_of_size(self, sizes: set[int]) -> bool:
        """Whether a source has one of these sizes [bytes]; if not, no digest need be waited for."""
        return any(size in sizes for size, _ in self._runs)

    def run_of(self, size: int, sha256: str) -> str | None:
        """The file of the run that was made of a source of this size [bytes] and digest."""
        return self._runs.get((size, sha256))
