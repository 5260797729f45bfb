"""A tachometer's pulses, one a turn: their instants, and whether the speed between them is steady."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import LEVEL, coverage_factor

from ..encoder.gaps import Gap, lost, spurious
from ..errors import AnalysisError
from .subsample import open_offset

LEAST_TURNS = 10
"""Turns below which no interval can be given."""
STEADY_WITHIN = 0.01
"""Largest change of speed in a record, of its mean, that counts as steady."""
_REARM = 0.2
"""The signal must fall so far below the level, of its whole swing, before the next pulse counts."""
_BLOCKS = 8
_UNIFORM = coverage_factor() / (LEVEL * np.sqrt(3.0))
"""Twice the deviation of a uniform error, of the half width that holds 95 % of it."""
_IN_STEP = 0.1
"""How early or late steep pulses may be alike, in samples, from which it is said that the sampling keeps step."""
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
    """How early or late all pulses may be alike, half a 95 % interval [s]."""
    steep: bool = False
    """Whether pulses rise within a sample, so that their places between two samples are not seen."""

    @property
    def timing_within(self) -> float:
        """Half a 95 % interval of a normal error of the same standard deviation: what sums of such errors need [s]."""
        return self.timing * (_UNIFORM if self.steep else 1.0)

    @property
    def keeps_step(self) -> bool:
        """Whether the sampling keeps step with the rotor, so that the pulses' places in a sample do not average out."""
        return self.steep and self.timing > _IN_STEP * self.resolution

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
    level = half_swing(time, signal, falling)[0] if level is None else level
    return _crossings(time, signal, level, falling)


def half_swing(time: Floats, signal: Floats, falling: bool = False) -> tuple[float, float]:
    """Midway between largest and smallest value of a turn, the mean of all turns, and its standard error.

    Of the whole record the extremes lie as far apart as noise has it. Without turns: its middle, no error.
    """
    middle = 0.5 * float(signal.min() + signal.max())
    begins = np.searchsorted(time, _crossings(time, signal, middle, falling))
    if len(begins) < 3:
        return middle, 0.0
    inside, starts = signal[begins[0] : begins[-1]], begins[:-1] - begins[0]
    each = 0.5 * (np.maximum.reduceat(inside, starts) + np.minimum.reduceat(inside, starts))
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))


def _crossings(time: Floats, signal: Floats, level: float, falling: bool) -> Floats:
    rising = level - signal if falling else signal - level
    above, below = rising > 0.0, rising < -_REARM * float(np.ptp(signal))
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
    guessed, found = level is None, pulses(time, signal, level, falling)
    if len(found) < LEAST_TURNS + 1:
        raise AnalysisError(
            f"{name}: {len(found)} pulses in {time[-1] - time[0]:.3g} s, values {signal.min():g} to {signal.max():g}: "
            f"expected at least {LEAST_TURNS + 1}, one a turn; another channel, --level, or a longer record"
        )
    _refuse_gaps(name, found)
    turns = _timed(time, signal, found, half_swing(time, signal, falling)[1] if guessed else 0.0)
    if turns.change > within:
        raise AnalysisError(
            f"{name}: the speed changes by {100 * turns.change:.2g} % of its mean {60 * turns.speed:.5g} rpm; expected "
            f"at most {100 * within:g} %: amplitude and phase belong to one speed; cut a steady part, or state "
            "--steady-within"
        )
    return turns


def _timed(time: Floats, signal: Floats, found: Floats, level_error: float) -> Turns:
    """Pulses with how early or late all may be alike: slow ones by the level's error, steep ones by the samples."""
    step = float(np.median(np.diff(time)))
    after = np.searchsorted(time, found, side="right").clip(1, len(time) - 1)
    rise = float(np.median(np.abs(signal[after] - signal[after - 1])))
    if rise <= _STEEP * float(np.ptp(signal)):
        return Turns(found, step, coverage_factor() * level_error / rise * step)
    later, within = open_offset(time[after - 1], time[after], found)
    return Turns(found + later, step, within, steep=True)


def _count(gaps: list[Gap]) -> str:
    lost_ones = sum(gap.missing for gap in gaps)
    return f"{lost_ones} pulse{'s' * (lost_ones > 1)}"


def _refuse_gaps(name: str, found: Floats) -> None:
    never_again = len(found)  # no slot of a disc explains an odd interval: there is one pulse a turn
    if gaps := lost(found, never_again):
        places = "; ".join(gap.text().replace("edge", "pulse") for gap in gaps[:8])
        raise AnalysisError(
            f"{name}: {_count(gaps)} lost: {places}. Turns counted through a gap would be "
            "wrong: check --level and the sensor's distance, or cut the record"
        )
    if extra := spurious(found, never_again):
        places = ", ".join(f"{found[k]:.6f} s" for k in extra[:8])
        raise AnalysisError(
            f"{name}: {len(extra)} pulse{'s' * (len(extra) > 1)} too many, at {places}: expected one a turn; check "
            "--level"
        )
