"""RUN... on a command line: stored runs, or campaigns of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .reading import plain

if TYPE_CHECKING:
    from ..store import Run


@dataclass(frozen=True)
class NotOpened:
    """A run that cannot be opened, and why."""

    name: str
    message: str

    def as_dict(self) -> dict[str, str]:
        """As it is printed among the runs."""
        return {"run": self.name, "status": "refused", "message": self.message}


def opened(paths: Sequence[Path]) -> "list[Run]":
    """The runs that paths name, all of them: each a stored run, or a folder with all the runs in it."""
    from ..store import open_campaign, open_run

    return [run for path in paths for run in (open_campaign(path).runs if path.is_dir() else (open_run(path),))]


def each(paths: Sequence[Path]) -> "tuple[list[Run], list[NotOpened]]":
    """The runs that can be opened, and those that cannot: for commands that do each run by itself."""
    from ..errors import StoreError
    from ..store import open_campaign, open_run

    runs, refused = [], []
    for path in paths:
        try:
            files = open_campaign(path).run_paths if path.is_dir() else [path]
        except StoreError as error:
            refused.append(NotOpened(path.name, str(error)))
            continue
        for file in files:
            try:
                runs.append(open_run(file))
            except StoreError as error:
                refused.append(NotOpened(file.stem, str(error)))
    return runs, refused


def say(refused: Sequence[NotOpened]) -> None:
    """Print to stderr what could not be opened."""
    for one in refused:
        click.echo(f"testbench: {plain(one.message)}", err=True)
