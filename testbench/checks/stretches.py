"""Stretches of a recorded time column, kept as they came: what a distribution of steps does not show is their order."""

from dataclasses import dataclass, field

import numpy as np

from ..recording import Samples

LENGTH = 4096
"""Steps of one stretch."""
_MOST = 16


@dataclass
class Stretches:
    """Up to 16 stretches of 4096 steps in a row, evenly over the column; all of it while it is no longer than that."""

    _kept: dict[int, list[Samples]] = field(default_factory=dict)
    _stride: int = 1
    _count: int = 0

    def add(self, steps: Samples) -> None:
        """Take in the next steps."""
        begin, end = self._count, self._count + len(steps)
        self._count = end
        for number in range(begin // LENGTH, -(-end // LENGTH)):
            if number % self._stride:
                continue
            first, last = max(begin, number * LENGTH), min(end, (number + 1) * LENGTH)
            self._kept.setdefault(number, []).append(steps[first - begin : last - begin].copy())
            if len(self._kept) > _MOST:
                self._stride *= 2
                self._kept = {n: parts for n, parts in self._kept.items() if n % self._stride == 0}

    def in_a_row(self) -> list[Samples]:
        """The steps that are kept, each array (n,) without a break."""
        if self._stride == 1:
            parts = [part for parts in self._kept.values() for part in parts]
            return [np.concatenate(parts)] if parts else []
        return [np.concatenate(parts) for parts in self._kept.values()]
