"""What readers of all binary formats refuse and report in the same words.

A file that ends too early (``cut``), that contradicts itself (``damaged``) or holds no samples (``nothing_to_read``) is
refused; what float64 rounds, texts and samples that are no finite number are findings by channel.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..recording import Block, Finding, Group, Refusal, Report, Samples

_FIRST_INEXACT = 2.0**53
_MOST_NAMES = 10


def cut(path: Path, message: str) -> Refusal:
    """The refusal of a file that ends too early."""
    return Refusal(path.name, Finding("cut_file", None, None, message))


def damaged(path: Path, message: str) -> Refusal:
    """The refusal of a file that contradicts itself."""
    return Refusal(path.name, Finding("damaged_file", None, None, message))


@contextmanager
def refusing(path: Path, what: str, *errors: type[Exception]) -> Iterator[None]:
    """Make ``errors`` of reading ``what`` a refusal of the file as damaged."""
    try:
        yield
    except errors as error:
        reason = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
        raise damaged(path, f"{what} cannot be read: {reason}") from error


def nothing_to_read(path: Path, findings: Sequence[Finding], otherwise: str) -> Refusal:
    """The refusal of a file without samples, by the first of the ``findings`` that say why, else by ``otherwise``."""
    return Refusal(path.name, next(iter(findings), Finding("no_data", None, None, otherwise)))


def is_beyond_exact(column: Samples) -> bool:
    """Whether a whole number of ``column`` (n,) [-] is so large that float64 may round it."""
    return bool((np.abs(column) >= _FIRST_INEXACT).any())


def rounded_integers(channel: str, where: str | None = None) -> Finding:
    """The finding that a channel holds whole numbers that float64 rounds."""
    return Finding("not_exact", channel, where, "holds integers beyond 2**53, which float64 rounds")


def names_listed(names: Sequence[str]) -> str:
    """The first ten names, and that there are more."""
    return ", ".join(names[:_MOST_NAMES]) + (" and more" if len(names) > _MOST_NAMES else "")


def watch_nonfinite(blocks: Iterable[Block], report: Report, but: Group | None = None) -> Iterator[Block]:
    """The same blocks; at their end, channels with samples that are not finite are reported, ``but`` those of one."""
    counts: dict[tuple[str, int], int] = {}
    first: dict[tuple[str, int], tuple[str, str]] = {}
    for block in blocks:
        for i, column in enumerate(block.columns if block.group is not but else ()):
            if number := int(np.count_nonzero(~np.isfinite(column))):
                key = (block.group.name, i)
                counts[key] = counts.get(key, 0) + number
                place = block.where(int(np.flatnonzero(~np.isfinite(column))[0]))
                first.setdefault(key, (block.group.channels[i].name, place))
        yield block
    for key, number in counts.items():
        channel, place = first[key]
        message = f"{number} samples of group {key[0]!r} are no finite number, the first is {place}"
        report(Finding("not_a_number", channel, place, message))
