"""Times in so few digits that their steps are a few whole numbers of the last place: rounded, or samples lost?

Sample k of a steady clock, rounded to places of q, is at q floor(k T / q + c): for n q < T < (n + 1) q its steps are n
and n + 1 places, and come so evenly that no time is further than one place from a straight line. Steps that are longer
because samples were lost by chance wander off it. Only steps of one and of two places may be either.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..recording import Samples
from .clock import ClockStats

_NEIGHBOURS, _SHARE = 8, 2.0**-16
"""To what a step is known: floating-point numbers beside the times, or the share of a step that is kept of it."""
_MOST_PLACES = 10
"""Steps of more places than that are alike to a tenth, and no reason for doubt."""
_NEARLY_ALL = 0.9
"""Share of the steps that are of two neighbouring numbers of places."""
_WHOLE = 0.05
"""How far a step may be from a whole number of places [places]."""
_WIDTH = 1.5
"""How far apart the furthest times above and below a fitted line may be [places]: 1, and up to 1.4 by the fit."""
_RARER, _LENGTH = 32, 128
"""Steps of the rarer kind in a piece that is fitted by one line, and of both kinds, whichever makes it longer."""
_FEWEST, _SHORTEST = 10, 64
"""The fewest of either from which a piece is judged: fewer may well come evenly by chance."""
_MOSTLY = 0.75
"""Share of the pieces that are even where the times are rounded; in the others samples may be lost besides."""


class Grid(NamedTuple):
    """Steps of ``short`` and ``short`` + 1 places, each so long, and how many there are of both kinds."""

    place: float
    short: int
    shorter: int
    longer: int

    @property
    def mean(self) -> float:
        """The mean step, in the unit of the times."""
        return self.place * (self.short + self.longer / (self.shorter + self.longer))

    @property
    def longer_share(self) -> float:
        """Share of the longer steps."""
        return self.longer / (self.shorter + self.longer)

    def kinds(self, steps: Samples) -> NDArray[np.int64]:
        """Each step as 0 (the shorter kind), 1 (the longer kind), or -1 (any other), (n,)."""
        places = steps / self.place - self.short
        whole = np.rint(places)
        return np.where((np.abs(places - whole) <= _WHOLE) & (whole >= 0) & (whole <= 1), whole, -1).astype(np.int64)


@dataclass(frozen=True)
class Evenness:
    """In how many pieces of the column both kinds of steps come evenly, and in how many they do not."""

    even: int
    uneven: int
    mean: float
    """The mean step of the even pieces, in the unit of the times; NaN if there are none."""

    @property
    def judged(self) -> int:
        """Pieces from which it could be told."""
        return self.even + self.uneven

    @property
    def rounded(self) -> bool:
        """Whether the steps are those of a steady clock whose times were rounded."""
        return self.even > 0 and self.even >= _MOSTLY * self.judged


def known_to(clock: ClockStats, step: float) -> float:
    """To how much a step of the column is known, in the unit of the times."""
    return max(_NEIGHBOURS * math.ulp(max(abs(clock.first), abs(clock.last))), _SHARE * step)


def grid(clock: ClockStats) -> Grid | None:
    """The two kinds of steps; None where nearly all are not of two neighbouring numbers of places, both small."""
    values, counts = clock.steps.gathered(known_to(clock, clock.steps.quantile(0.5)))
    if len(values) < 2:
        return None
    low, high = sorted(np.argsort(counts)[-2:])
    place = float(values[high] - values[low])
    short = round(float(values[low]) / place)
    if counts[low] + counts[high] < _NEARLY_ALL * counts.sum() or not 1 <= short <= _MOST_PLACES:
        return None
    if abs(values[low] / place - short) > _WHOLE:
        return None
    return Grid(place, short, int(counts[low]), int(counts[high]))


def evenness(clock: ClockStats, steps: Grid) -> Evenness:
    """How evenly the two kinds of steps come, piece by piece."""
    length = max(_LENGTH, math.ceil(_RARER / min(steps.longer_share, 1.0 - steps.longer_share)))
    even, judged, longer, count = 0, 0, 0, 0
    for part in _unbroken(clock, steps):
        pieces = max(1, len(part) // length)
        kinds = part[: len(part) // pieces * pieces].reshape(pieces, -1)
        rarer = np.minimum(kinds.sum(axis=1), (1 - kinds).sum(axis=1))
        kinds = kinds[(rarer >= _FEWEST) & (kinds.shape[1] >= _SHORTEST)]
        straight = kinds[_widths(kinds) <= _WIDTH]
        even, judged = even + len(straight), judged + len(kinds)
        longer, count = longer + int(straight.sum()), count + straight.size
    return Evenness(even, judged - even, steps.place * (steps.short + longer / count) if count else math.nan)


def _unbroken(clock: ClockStats, steps: Grid) -> Iterator[NDArray[np.int64]]:
    """The kinds of the steps that are kept, 0 or 1, in rows that no other step interrupts."""
    for row in clock.stretches.in_a_row():
        kinds = steps.kinds(row)
        for part in np.split(kinds, np.flatnonzero(kinds < 0)):
            yield part[part >= 0]


def _widths(kinds: NDArray[np.int64]) -> Samples:
    """How far the times of m pieces lie apart, above and below each one's line of least squares, (m,) [places]."""
    at = np.pad(np.cumsum(kinds, axis=1), ((0, 0), (1, 0))).astype(float)
    along = np.arange(at.shape[1]) - (at.shape[1] - 1) / 2.0
    apart = at - np.outer(at @ along / (along @ along), along)
    return np.ptp(apart, axis=1)
