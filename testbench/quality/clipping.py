"""Samples that are no measured values: flat tops at a limit or at the largest value, a stuck sensor, and codes.

An overflow is written as 9.9E37 (SCPI-99, vol. 1, 7.2.1.4; 9.91E37 for not a number) or as the largest number of its
type. A missing value is written as -9999 and its kin, which measured values may reach too: they count as a code only
where no other sample comes half as far.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

from ..recording import Block, Samples, SensorRange

LONG_RUN = 3
"""Successive equal samples at the extreme that a smooth peak does not leave."""
_LIMIT_TOLERANCE = 1e-4
_MOST_EDGES = 1000
_STEPS = 10_000
_FEW = 64
"""Samples that show of a channel that lives that it does."""
_JUMP = 3.0
STUCK_S = 0.05
"""Shortest time of one value that counts as stuck [s]: half a period of 10 Hz."""
_LONGER = 10
"""How many times longer it is than any other, the rest at the beginning among them."""


def code_below(limit: SensorRange) -> float:
    """The largest value that a converter gives for ``limit``: +16 g of 16 bits is 16 - 16 / 2**15 = 15.99951 g."""
    step = limit.limit * 2.0 ** (1 - limit.bits) if limit.bits else 0.0
    return limit.limit - step - limit.limit * (_LIMIT_TOLERANCE if not limit.bits else 2.0 ** -(limit.bits + 3))


@dataclass
class Plateau:
    """Samples at or beyond a level: how many, how many long runs, the longest run, the steps up to long runs.

    ``side`` is +1 for the top and -1 for the bottom of a channel; ``level`` is that of ``side * samples``. The level
    is fixed, or follows the extreme that was seen (``follow``).
    """

    side: int
    level: float = -np.inf
    follow: bool = False
    count: int = 0
    longest: int = 0
    long_runs: int = 0
    edges: list[float] = field(default_factory=list)
    _run: int = 0

    def update(self, samples: Samples, extreme: float) -> None:
        """Take in the next samples, of which ``extreme`` is the one furthest to this side."""
        if self.follow and extreme > self.level:
            self.level, self.count, self.longest, self.long_runs, self._run = extreme, 0, 0, 0, 0
            self.edges.clear()
        if extreme < self.level:
            self._run = 0
            return
        beyond = samples >= self.level if self.side > 0 else samples <= -self.level
        self._take(samples, np.flatnonzero(beyond))

    def _take(self, samples: Samples, at: NDArray[np.int64]) -> None:
        """Count the runs among the indices ``at``; the first may continue the last run of the block before."""
        self.count += len(at)
        cuts = np.flatnonzero(np.diff(at) > 1) + 1
        starts, lengths = at[np.concatenate(([0], cuts))], np.diff(np.concatenate(([0], cuts, [len(at)])))
        carried = self._run if starts[0] == 0 else 0
        lengths[0] += carried
        self.longest = max(self.longest, int(lengths.max()))
        self.long_runs += int((lengths >= LONG_RUN).sum()) - (carried >= LONG_RUN)
        self._run = int(lengths[-1]) if at[-1] == len(samples) - 1 else 0
        inner = starts[(lengths >= LONG_RUN) & (starts > 0)][: _MOST_EDGES - len(self.edges)]
        self.edges.extend(map(float, self.level - self.side * samples[inner - 1]))


@dataclass
class Clipping:
    """Both flat tops of a channel: at the limits of a stated range, or at its own extremes if none is stated."""

    limit: SensorRange | None
    above: Plateau = field(init=False)
    below: Plateau = field(init=False)
    smallest_step: float = 0.0

    def __post_init__(self) -> None:
        level = -np.inf if self.limit is None else code_below(self.limit)
        self.above, self.below = (Plateau(side, level, follow=self.limit is None) for side in (+1, -1))

    def update(self, samples: Samples, extremes: tuple[float, float] | None = None) -> None:
        """Take in the next samples, and the least and the largest of them where they are known and all are finite."""
        least, most = extremes or (float(np.fmin.reduce(samples)), float(np.fmax.reduce(samples)))
        if np.isnan(most):
            return
        if not self.smallest_step:
            steps = np.abs(np.diff(samples[:_STEPS]))
            steps = steps[(steps > 0) & np.isfinite(steps)]
            self.smallest_step = float(steps.min()) if len(steps) else 0.0
        self.above.update(samples, most)
        self.below.update(samples, -least)

    def message(self, unit: str | None) -> str | None:
        """What is clipped; None if nothing is."""
        if self.limit is not None:
            if not self.above.count + self.below.count:
                return None
            at = f"at the limits of the stated range of ±{self.limit.limit:g} {self.limit.unit}"
        else:
            if not self._looks_flat():
                return None
            at = f"at {self.above.level:g} and {-self.below.level:g} {unit or ''}".rstrip()
        top, bottom = self.above, self.below
        runs = f"the longest run has {max(top.longest, bottom.longest)} samples"
        return f"{top.count} samples at the top and {bottom.count} at the bottom lie {at}; {runs}"

    def _looks_flat(self) -> bool:
        """Whether flat tops without a stated range are those of a cut signal.

        A cut signal jumps onto its flat top; one that is only quantised, or at rest, arrives by its smallest step.
        Zero is where unloaded sensors rest.
        """
        return any(
            side.long_runs >= LONG_RUN
            and side.level != 0
            and len(side.edges) > 0
            and float(np.median(side.edges)) >= _JUMP * self.smallest_step > 0
            for side in (self.above, self.below)
        )


def is_dead(values: Floats) -> bool:
    """Whether a record (n,) in any unit, e.g. [m/s2], shows one value only."""
    return bool(np.ptp(values[:: max(len(values) // _FEW, 1)]) == 0.0 and np.ptp(values) == 0.0)


def stuck_value(values: Floats, rate_hz: float) -> str | None:
    """Where a record (n,) in any unit, e.g. [m/s2], keeps one value after it has moved; None if nowhere.

    A coarse channel keeps a value whenever it rests: such times are many, or one lies at the beginning.
    """
    every = max(int(0.5 * STUCK_S * rate_hz), 1)
    if not (values[every::every] == values[:-every:every]).any():
        return None  # two of these samples lie in any such time
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    lengths = np.diff(edges)
    at = int(np.argmax(lengths))
    longest, others = int(lengths[at]), np.delete(lengths, at)
    if at == 0 or longest < STUCK_S * rate_hz or longest < _LONGER * int(others.max()):
        return None
    start, seconds = edges[at] / rate_hz, longest / rate_hz
    return (
        f"one value for {seconds:.3f} s from {start:.3f} s of the record on, elsewhere it changes: stuck or unplugged"
    )


def flat_tops(values: Floats, unit: str = "m/s2") -> str | None:
    """What looks like flat tops at the extremes of a record (n,) [``unit``], whatever its range; None if none."""
    clipping = Clipping(None)
    clipping.update(np.asarray(values, dtype=np.float64))
    return clipping.message(unit)


_OVERFLOW = (9.9e37, 9.91e37, float(np.finfo(np.float32).max), float(np.finfo(np.float64).max))
_MISSING = (-999.0, -999.25, -999.9, -9999.0, -9999.25, -9999.9, -99999.0, -999999.0, 9999.0, 99999.0, 999999.0, 1e30)
_CODES = np.array(sorted({*_OVERFLOW, *(-code for code in _OVERFLOW), *_MISSING}))
_LIKE = 1e-6
"""Share by which a code may differ: float32 rounds it."""


@dataclass
class CodedValues:
    """The samples of one channel that are such codes, block by block, and the extremes of all others."""

    found: dict[float, tuple[int, str]] = field(default_factory=dict)
    """How many samples are each code, and where the first stands."""
    least: float = np.inf
    most: float = -np.inf

    def update(self, block: Block, samples: Samples, extremes: tuple[float, float] | None) -> None:
        """Take in the next samples, whose least and largest are ``extremes`` if all are finite."""
        if extremes is None:
            finite = samples[np.isfinite(samples)]
            if not len(finite):
                return
            extremes = float(finite.min()), float(finite.max())
        while (code := _code(extremes[0])) or (code := _code(extremes[1])):
            same = np.isclose(samples, code, rtol=_LIKE, atol=0.0)
            count, first = self.found.get(code, (0, block.where(int(np.argmax(same)))))
            self.found[code] = count + int(same.sum()), first
            samples = samples[np.isfinite(samples) & ~same]
            if not len(samples):
                return
            extremes = float(samples.min()), float(samples.max())
        self.least, self.most = min(self.least, extremes[0]), max(self.most, extremes[1])

    def places(self) -> list[tuple[str, str]]:
        """For each code that is no measured value a message, and where it stands first."""
        found = []
        for code, (count, first) in self.found.items():
            rest = self.least if code < 0.0 else self.most
            if abs(code) not in _OVERFLOW and not (np.isfinite(rest) and rest / code < 0.5):
                continue
            what = "an instrument's overflow" if abs(code) in _OVERFLOW else "a missing value, it seems"
            message = f"{count} samples are {code:g}, the code of {what}; kept as written, and no measured value"
            found.append((message, first))
        return found


def _code(value: float) -> float:
    """The code that a value is; 0 if it is none."""
    at = int(np.searchsorted(_CODES, value * (1.0 - np.copysign(_LIKE, value))))
    return float(_CODES[at]) if at < len(_CODES) and abs(value - _CODES[at]) <= _LIKE * abs(_CODES[at]) else 0.0
