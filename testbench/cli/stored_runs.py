"""RUN... on a command line: stored runs, or campaigns of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..store import Run


def opened(paths: Sequence[Path]) -> "list[Run]":
    """The runs that paths name: each a stored run, or a folder with all the runs in it."""
    from ..store import open_campaign, open_run

    return [run for path in paths for run in (open_campaign(path).runs if path.is_dir() else (open_run(path),))]
