"""Times of day that begin again at midnight, counted on."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

import numpy as np

from ...findings import Finding
from ...recording import Block, Report, Samples
from .moments import DAY, SECOND

_HALF_A_DAY_S = 43_200.0


class _Days:
    """The days that have passed in one column."""

    def __init__(self) -> None:
        self.days, self.last = 0, -np.inf

    def counted_on(self, seconds: Samples) -> tuple[Samples, list[int]]:
        """The seconds with the days that passed, to the nanosecond, and where they did; not finite ones as they are."""
        at = np.flatnonzero(np.isfinite(seconds))
        steps = np.diff(seconds[at], prepend=self.last)
        passed = at[steps < -_HALF_A_DAY_S]
        if len(at):
            self.last = float(seconds[at[-1]])
        before, self.days = self.days, self.days + len(passed)
        if not self.days:
            return seconds, []
        days = before + np.searchsorted(passed, at, side="right")
        result = seconds.copy()
        result[at] = (np.rint(seconds[at] * SECOND) + days * float(DAY)) / SECOND
        return result, [int(i) for i in passed]


def counted_on(blocks: Iterable[Block], columns: Collection[int], report: Report) -> Iterator[Block]:
    """The same blocks; in the ``columns`` a fall by more than half a day is a midnight, which is reported."""
    passed = {i: _Days() for i in columns}
    for block in blocks:
        given = list(block.columns)
        for i, days in passed.items():
            given[i], at = days.counted_on(given[i])
            for row in at:
                message = "midnight passes before this row"
                report(Finding("time_as_text", block.group.channels[i].name, block.where(row), message))
        yield replace(block, columns=tuple(given))
