"""Several columns of time in one text: each is the clock of the columns behind it, which are a group of their own."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...findings import Finding
from ...recording import Block, Channel, Clock, Group, Report, Samples
from . import marks, names

Read = Callable[[Report], Iterator[Block]]
_MOST_ROWS = 1 << 16


@dataclass(frozen=True)
class Several:
    """The ``groups`` of one table, and the places of each one's columns in it."""

    groups: tuple[Group, ...]
    places: tuple[tuple[int, ...], ...]

    def apart(self, read: Read) -> Read:
        """``read`` with the columns of each group for itself, up to the last row in which one of them holds a value."""
        return lambda report: _apart(self, read, report)

    @property
    def finding(self) -> Finding:
        """That there are several clocks."""
        listed = ", ".join(repr(group.channels[0].name) for group in self.groups)
        message = f"columns of time: {listed}; each is taken as the clock of those behind it, in a group of its own"
        return Finding("several_clocks", None, None, message)


def find(
    group: Group,
    rows: Sequence[Sequence[str]],
    kept: Sequence[int],
    clock_of: Callable[[Sequence[int]], Clock | None],
) -> Several | None:
    """The groups in a table of these ``rows``, if it begins with a time, and others of this name have columns behind.

    ``kept`` are the fields of the channels of ``group``; ``clock_of`` finds the clock among fields.
    """
    bases = [names.base_of_time(channel.label) for channel in group.channels]
    begins = [i for i, base in enumerate(bases) if base and base == bases[0]]
    if len(begins) < 2 or begins[0] or any(b - a < 2 for a, b in pairwise([*begins, len(bases)])):
        return None
    if any(all(len(row) <= kept[i] or marks.is_missing(row[kept[i]]) for row in rows) for i in begins):
        return None
    places = tuple(tuple(range(a, b)) for a, b in pairwise([*begins, len(bases)]))
    groups = tuple(
        Group(f"{group.name} {n}", tuple(group.channels[i] for i in columns), clock_of([kept[i] for i in columns]))
        for n, columns in enumerate(places, 1)
    )
    return Several(groups, places)


def named(channel: Channel) -> Channel:
    """The channel, its label the name of time alone if it is one of several times."""
    base = names.base_of_time(channel.label)
    return channel if base is None else replace(channel, label=base)


@dataclass
class _Part:
    """One group as it is read: samples so far, and rows without a value that wait for one behind them."""

    group: Group
    places: tuple[int, ...]
    samples: int = 0
    waiting: int = 0
    not_numbers: Counter[str] = field(default_factory=Counter)

    def blocks(self, block: Block) -> Iterator[Block]:
        """The group's share of a block of the table."""
        columns = [block.columns[i] for i in self.places]
        given = np.flatnonzero(~np.isnan(columns).all(axis=0))
        if not len(given):
            self.waiting += len(block)
            return
        while self.waiting:
            count = min(self.waiting, _MOST_ROWS)
            self.waiting -= count
            yield self._next([np.full(count, np.nan) for _ in columns], None, block.bytes_read)
        end = int(given[-1]) + 1
        self.waiting = len(block) - end
        lines = None if block.lines is None else block.lines[:end]
        yield self._next([column[:end] for column in columns], lines, block.bytes_read)

    def _next(self, columns: list[Samples], lines: "range | NDArray[np.int64] | None", bytes_read: int) -> Block:
        start, self.samples = self.samples, self.samples + len(columns[0])
        for channel, column in zip(self.group.channels, columns, strict=True):
            self.not_numbers[channel.name] += int((~np.isfinite(column)).sum())
        return Block(self.group, tuple(columns), start, lines, bytes_read)


def _apart(several: Several, read: Read, report: Report) -> Iterator[Block]:
    parts: list[_Part] = []
    seen: Counter[str] = Counter()
    table = ""

    def told(finding: Finding) -> None:
        """Cells behind the end of a shorter group are no values that are missing."""
        counted = seen + sum((part.not_numbers for part in parts), Counter())
        if finding.code != "not_a_number" or counted[finding.channel or ""]:
            report(finding)

    for block in read(told):
        if block.group.name != table:
            seen += sum((part.not_numbers for part in parts), Counter())
            table = block.group.name
            parts = [
                _Part(replace(group, name=f"{table} {number}"), places)
                for number, (group, places) in enumerate(zip(several.groups, several.places, strict=True), 1)
            ]
        for part in parts:
            yield from part.blocks(block)
