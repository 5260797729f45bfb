"""The steady turn behind a log: time over angle as a straight line and a few harmonics, by least squares.

t(phi) = t0 + P phi / (2 pi) + sum_h a_h cos(h phi) + b_h sin(h phi) is linear in what is sought, so jitter of the
instants does not push the largest speed up and the smallest down, as it does with differences of single edges; the
speed is 1 / (dt/dphi). Harmonics are as many as the record supports.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from ..errors import AnalysisError
from . import fit
from .changes import Changes, of_turns
from .edges import Edges
from .turncount import refuse_other_turn

STEADY = 1e-3
"""Share by which the duration of a turn may differ from the median of the later half."""
MOST_HARMONICS = 40
_GRID = 1440
_DITHERED = 0.4
"""Jitter, of the clock's step, above which the rounding of each edge is its own; rounding alone is 0.29."""


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether the interval holds a value."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Turn:
    """A steady turn of the crank, estimated from edges."""

    edges: Edges
    """Those that were used."""
    turns: int
    """Whole turns used."""
    left_out: int
    """Whole turns of the log that were not yet, or no longer, steady."""
    coefficients: Floats
    """P, then a_h, b_h for h = 1, 2, ..., (2 harmonics + 1,) [s]."""
    covariance: Floats
    """Of the coefficients, from what the harmonics leave over: jitter and pitch errors, [s2]."""
    places: tuple[float, float] | None
    """Standard deviation of what repeats every turn, and of what does not [s]; None where nothing can repeat."""
    residual: Floats
    """What is left over of each instant, (n,) [s]."""
    finer: tuple["Turn", ...] = ()
    """The same with one and two harmonics more: intervals hold these answers too."""

    @property
    def harmonics(self) -> int:
        """Harmonics of time over angle."""
        return (len(self.coefficients) - 1) // 2

    def slope(self, phi: Floats, coefficients: Floats | None = None) -> Floats:
        """dt/dphi at angles from the first edge [s/rad]."""
        rows: Floats = slope_rows(phi, self.harmonics) @ (self.coefficients if coefficients is None else coefficients)
        return rows

    def speed(self, phi: Floats) -> Floats:
        """Speed of the crank at angles from the first edge [rad/s]."""
        return 1.0 / self.slope(phi)

    def speed_error(self, phi: Floats) -> Floats:
        """Half width of the 95 % interval of that speed: dn = n^2 d(dt/dphi) [rad/s]."""
        return self.speed(phi) ** 2 * self._half_width(slope_rows(phi, self.harmonics))

    @cached_property
    def fastest_at(self) -> float:
        """Angle from the first edge where the crank is fastest [rad]."""
        return self._least(1.0)

    @cached_property
    def slowest_at(self) -> float:
        """Angle from the first edge where the crank is slowest [rad]."""
        return self._least(-1.0)

    def _least(self, sign: float) -> float:
        """Angle where the slope, or its opposite, is least: the best of a grid, then the parabola about it [rad]."""
        step = 2.0 * np.pi / _GRID
        values = sign * self.slope(step * np.arange(_GRID))
        k = int(np.argmin(values))
        before, least, after = values[k - 1], values[k], values[(k + 1) % _GRID]
        bend = float(before - 2.0 * least + after)
        return float(step * (k + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) % (2.0 * np.pi))

    @property
    def fastest(self) -> Estimate:
        """Largest speed of the turn [rad/s]."""
        return self._widened(self._speed_at(self.fastest_at), [t.fastest.value for t in self.finer])

    @property
    def slowest(self) -> Estimate:
        """Smallest speed of the turn [rad/s]."""
        return self._widened(self._speed_at(self.slowest_at), [t.slowest.value for t in self.finer])

    @property
    def mean(self) -> Estimate:
        """Mean speed over time, 2 pi / P [rad/s]."""
        period = self.coefficients[0]
        variance = self.covariance[0, 0] + self._changes.wander / self.turns + self._rounding
        half = coverage_factor() * float(np.sqrt(variance))
        return _about(2.0 * np.pi / period, half * 2.0 * np.pi / period**2)

    def fluctuation(self, nominal: float | None = None) -> Estimate:
        """Coefficient of speed fluctuation, (n_max - n_min) / n, n the nominal or else the mean speed [rad/s]."""
        rows = slope_rows(np.array([self.fastest_at, self.slowest_at]), self.harmonics)
        fast, slow = 1.0 / (rows @ self.coefficients)
        base = nominal or 2.0 * np.pi / self.coefficients[0]
        gradient = (-(fast**2) * rows[0] + slow**2 * rows[1]) / base
        if nominal is None:
            gradient[0] += (fast - slow) / (2.0 * np.pi)
        found = _about(float((fast - slow) / base), float(self._half_width(gradient[None])[0]))
        return self._widened(found, [t.fluctuation(nominal).value for t in self.finer])

    @property
    def jitter(self) -> float:
        """Standard deviation of a single instant, what repeats every turn left out [s]."""
        return self.places[1] if self.places else float(np.std(self.residual))

    @property
    def _rounding(self) -> float:
        """Variance of P by the clock's step, where jitter is too small to make rounding random [s2]."""
        step = self.edges.clock_step or 0.0
        return step**2 / 6.0 / self.turns**2 if self.jitter < _DITHERED * step else 0.0

    @cached_property
    def _changes(self) -> Changes:
        return of_turns(self.edges, self.residual, self.harmonics, self.jitter)

    @property
    def repeated(self) -> float:
        """Standard deviation of what repeats every turn and is no low harmonic, in shares of the pitch of the disc.

        Zero where jitter alone explains it. Slow errors of the disc, such as an eccentric one's, do not show here.
        """
        if self.places is None:
            return 0.0
        pattern, jitter = self.places
        expected = jitter / np.sqrt(self.turns)
        step = self.edges.clock_step or 0.0
        if pattern <= max(2.0 * expected, 0.6 * step):
            return 0.0
        return float(np.sqrt(pattern**2 - expected**2)) * self.edges.disc.per_turn / float(self.coefficients[0])

    def _speed_at(self, phi: float) -> Estimate:
        at = np.array([phi])
        return _about(float(self.speed(at)[0]), float(self.speed_error(at)[0]))

    @staticmethod
    def _widened(found: Estimate, others: list[float]) -> Estimate:
        """The interval, moved out as far as the answers with more harmonics."""
        off = [value - found.value for value in others]
        return Estimate(found.value, found.low + min([0.0, *off]), found.high + max([0.0, *off]))

    def _half_width(self, rows: Floats) -> Floats:
        """Half widths of 95 % intervals of ``rows @ coefficients``: by what is left over, or from turn to turn.

        Pitch errors repeat and do not show from turn to turn; where turns change by more than jitter, as with changes
        of load, the wider of the two.
        """
        spare = max(len(np.unique(np.round(self.edges.angle % (2 * np.pi), 9))) - len(self.coefficients) - 1, 1)
        left_over = coverage_factor(spare) * np.sqrt(np.einsum("ki,ij,kj->k", rows, self.covariance, rows))
        if not self._changes.is_told:
            return left_over
        each = self._changes.shape @ rows[:, 1:].T
        between = coverage_factor(self.turns - 1) * each.std(axis=0, ddof=1) / np.sqrt(self.turns)
        return np.maximum(left_over, between)


def periodic_turn(edges: Edges, harmonics: int | None = None, steady_within: float = STEADY) -> Turn:
    """The steady turn of a log; harmonics are chosen by the Bayesian information criterion unless given.

    Raises AnalysisError where fewer than two whole turns are steady, RecordingError where edges a turn are not so many.
    """
    refuse_other_turn(edges)
    first, last, whole = fit.steady_turns(edges, steady_within)
    in_turn = np.floor(edges.angle / (2.0 * np.pi) + 1e-9).astype(int)
    used = edges.part(np.flatnonzero((in_turn >= first) & (in_turn < last)))
    most = min(MOST_HARMONICS, int(edges.disc.per_turn // 4))
    chosen = harmonics if harmonics is not None else fit.supported(used, most)
    if not 1 <= chosen <= int(edges.disc.per_turn // 2 - 1):
        raise AnalysisError(f"{edges.name}: {chosen} harmonics asked of {edges.disc.per_turn:g} edges a turn: too many")
    finer = tuple(_turn(used, chosen + more, first, last, whole) for more in (1, 2) if chosen + more <= most)
    return replace(_turn(used, chosen, first, last, whole), finer=finer)


def _turn(used: Edges, harmonics: int, first: int, last: int, whole: int) -> Turn:
    solved, residual = fit.fit(used, harmonics)
    rows = fit.time_rows(used.angle, harmonics)
    places = fit.by_place(used, residual, 2 * harmonics + 1, last - first)
    covariance = fit.covariance(used, rows, residual, places)[1:, 1:]
    return Turn(used, last - first, whole - (last - first), solved[1:], covariance, places, residual)


def slope_rows(phi: Floats, harmonics: int) -> Floats:
    """Rows that take the coefficients to dt/dphi, (n, 2 harmonics + 1) [1/rad]."""
    h = np.arange(1, harmonics + 1)
    waves = np.stack([-h * np.sin(np.outer(phi, h)), h * np.cos(np.outer(phi, h))], axis=2)
    return np.hstack([np.full((len(phi), 1), 0.5 / np.pi), waves.reshape(len(phi), 2 * harmonics)])


def _about(value: float, half: float) -> Estimate:
    return Estimate(value, value - half, value + half)
