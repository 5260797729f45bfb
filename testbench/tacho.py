"""A tachometer's pulses, one a turn: their instants, and whether the speed between them is steady."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .encoder.gaps import lost, spurious
from .errors import AnalysisError

LEAST_TURNS = 10
"""Turns below which no interval can be given."""
STEADY_WITHIN = 0.01
"""Largest change of speed in a record, of its mean, that counts as steady."""
_REARM = 0.2
"""The signal must fall so far below the level, of its whole swing, before the next pulse counts."""
_BLOCKS = 8
_STEEP = 0.3
"""Share of the swing within one sample above which the crossing between the samples cannot be told."""


@dataclass(frozen=True)
class Turns:
    """Whole turns between pulses."""

    pulses: Floats
    """Instants of the pulses, (turns + 1,) [s]."""
    resolution: float
    """Step of the samples that the pulses were timed with [s]."""
    timing: float = 0.0
    """Half a step where pulses rise within one sample, so that all may be early or late alike; else zero [s]."""

    @property
    def count(self) -> int:
        """Number of whole turns."""
        return len(self.pulses) - 1

    @property
    def speed(self) -> float:
        """Mean speed [turns/s]."""
        return self.count / float(self.pulses[-1] - self.pulses[0])

    @property
    def change(self) -> float:
        """Largest less smallest speed, of the mean: of blocks of turns, and of single turns beyond what timing blurs.

        A pulse is timed to a sample, so the time of one turn is blurred by up to two.
        """
        edges = np.linspace(0, self.count, min(_BLOCKS, self.count // 2) + 1).astype(int)
        blocks = np.diff(edges) / np.diff(self.pulses[edges])
        blur = 2.0 * self.resolution * self.speed
        return float(max(np.ptp(blocks), np.ptp(1.0 / np.diff(self.pulses)) - blur * self.speed) / self.speed)

    def angle(self, time: Floats) -> Floats:
        """Angle of the rotor since the first pulse, in turns: even between pulses, (n,)."""
        return np.interp(time, self.pulses, np.arange(len(self.pulses), dtype=float))


def pulses(time: Floats, signal: Floats, level: float | None = None, falling: bool = False) -> Floats:
    """Instants at which ``signal`` (n,) rises (falls) through ``level``, by default half its swing, (pulses,) [s]."""
    low, high = float(signal.min()), float(signal.max())
    level = 0.5 * (low + high) if level is None else level
    rising = level - signal if falling else signal - level
    above, below = rising > 0.0, rising < -_REARM * (high - low)
    known = above | below
    last = np.maximum.accumulate(np.where(known, np.arange(len(signal)), 0))
    state = above[last]
    at = np.flatnonzero(state[1:] & ~state[:-1])
    share = rising[at] / (rising[at] - rising[at + 1])
    return time[at] + share * (time[at + 1] - time[at])


def steady_turns(name: str, time: Floats, signal: Floats, level: float | None, falling: bool, within: float) -> Turns:
    """Turns of a record at steady speed.

    Raises AnalysisError for a signal without pulses, too few turns, lost or spurious pulses, a speed that changes by
    more than ``within`` of its mean.
    """
    found = pulses(time, signal, level, falling)
    if len(found) < LEAST_TURNS + 1:
        raise AnalysisError(
            f"{name}: {len(found)} pulses in {time[-1] - time[0]:.3g} s, values {signal.min():g} to {signal.max():g}: "
            f"expected at least {LEAST_TURNS + 1}, one a turn; another channel, --level, or a longer record"
        )
    _refuse_gaps(name, found)
    step = float(np.median(np.diff(time)))
    turns = Turns(found, step, 0.5 * step if _is_steep(time, signal, found) else 0.0)
    if turns.change > within:
        raise AnalysisError(
            f"{name}: the speed changes by {100 * turns.change:.2g} % of its mean {60 * turns.speed:.5g} rpm; expected "
            f"at most {100 * within:g} %: amplitude and phase belong to one speed; cut a steady part, or state "
            "--steady-within"
        )
    return turns


def _is_steep(time: Floats, signal: Floats, found: Floats) -> bool:
    """Whether pulses rise between two samples: then the instant between them is not known."""
    after = np.searchsorted(time, found).clip(1, len(time) - 1)
    return bool(np.median(np.abs(signal[after] - signal[after - 1])) > _STEEP * np.ptp(signal))


def _refuse_gaps(name: str, found: Floats) -> None:
    never_again = len(found)  # no slot of a disc explains an odd interval: there is one pulse a turn
    if gaps := lost(found, never_again):
        places = "; ".join(gap.text().replace("edge", "pulse") for gap in gaps[:8])
        raise AnalysisError(
            f"{name}: {sum(gap.missing for gap in gaps)} pulses lost: {places}. Turns counted through a gap would be "
            "wrong: check --level and the sensor's distance, or cut the record"
        )
    if extra := spurious(found, never_again):
        places = ", ".join(f"{found[k]:.6f} s" for k in extra[:8])
        raise AnalysisError(f"{name}: {len(extra)} pulses too many, at {places}: expected one a turn; check --level")
