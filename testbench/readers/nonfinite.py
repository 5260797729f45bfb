"""Samples of binary formats that are no finite number: kept as they are, counted and said by channel."""

from collections.abc import Iterable, Iterator

import numpy as np

from ..findings import Finding
from ..recording import Block, Group, Report


def watched(blocks: Iterable[Block], report: Report, but: Group | None = None) -> Iterator[Block]:
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
