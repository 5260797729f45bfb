"""The steady turn of a crank: time over angle as a straight line and a few harmonics, by least squares.

t(phi) = t0 + P phi / (2 pi) + sum_h a_h cos(h phi) + b_h sin(h phi) is linear in its coefficients, so jitter of the
instants does not push the largest speed up and the smallest down, as it does with differences of single edges. The
speed is 1 / (dt/dphi). The number of harmonics is chosen by the Bayesian information criterion. Intervals contain
jitter, errors of the disc, changes from turn to turn, and the answers with one and two harmonics more.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from balance.arrays import Floats, Indices, parabola_peak
from balance.estimation.estimate import chi_square_tail, coverage_factor, effective_degrees_of_freedom
from balance.results import Brief

from ..errors import AnalysisError
from .encoder_edges import Edges, require_stated_turn

STEADY = 1e-3
"""Share by which the duration of a steady turn may differ from the median of the later half."""
MOST_HARMONICS = 40
_GRID = 1440
"""Angles of a turn among which extremes of the speed are searched."""
_DITHERED = 0.4
"""Jitter in steps of the clock above which rounding is random from edge to edge; rounding alone is 0.29."""
_LEAST_PARTS, _MOST_PARTS = 8, 200
"""Quarter turns, or groups of them, whose means tell a random walk."""
_SIGNIFICANCE = 0.01
"""Probability below which changes from turn to turn are not jitter."""
_SUSPECTED = 1.0
"""Standard deviations by which parts scatter more than neighbours differ, from which they count as a random walk."""


def time_regressor(phi: Floats, harmonics: int) -> Floats:
    """Regressor of instants at angles (n,) [rad]: times (t0, P, a_h, b_h, ...), (n, 2 harmonics + 2) [-]."""
    h = np.arange(1, harmonics + 1)
    waves = np.stack([np.cos(np.outer(phi, h)), np.sin(np.outer(phi, h))], axis=2)
    line = np.stack([np.ones_like(phi), phi / (2.0 * np.pi)], axis=1)
    return np.hstack([line, waves.reshape(len(phi), 2 * harmonics)])


def fit_time_over_angle(edges: Edges, harmonics: int) -> tuple[Floats, Floats]:
    """t0 and the coefficients, (2 harmonics + 2,) [s], and the residual (n,) [s]."""
    rows = time_regressor(edges.angle, harmonics)
    start = edges.time[0]
    solved = np.linalg.lstsq(rows, edges.time - start, rcond=None)[0]
    residual = edges.time - start - rows @ solved
    solved[0] += start
    return solved, residual


def supported_harmonics(edges: Edges, most: int) -> int:
    """Number of harmonics by the Bayesian information criterion: least n log(RSS / n) + k log n, at most ``most``.

    RSS is that of the turn averaged over all turns: errors of the disc, which repeat every turn, count as noise once.
    """
    count = edges.disc.whole_per_turn or int(edges.disc.per_turn)
    most = max(1, min(most, (count - 3) // 2))
    solved, residual = fit_time_over_angle(edges, most)
    power = 0.5 * (solved[2::2] ** 2 + solved[3::2] ** 2)
    rest = float(np.mean(_average_turn(edges, residual, count) ** 2))
    left = rest + np.array([power[h:].sum() for h in range(most + 1)]) + 1e-40
    cost = count * np.log(left) + (2 * np.arange(most + 1) + 2) * np.log(count)
    return max(1, int(np.argmin(cost)))


def _average_turn(edges: Edges, values: Floats, count: int) -> Floats:
    """Values at edges averaged over the turns, by slot in the turn; slots without an edge omitted."""
    place = np.rint(edges.angle / (2.0 * np.pi) * count).astype(int) % count
    have = np.bincount(place, minlength=count)
    mean: Floats = (np.bincount(place, values, count) / np.maximum(have, 1))[have > 0]
    return mean


def scatter_by_slot(edges: Edges, residual: Floats, parameters: int, turns: int) -> tuple[float, float] | None:
    """Standard deviations of the residual (n,) [s] that repeats every turn, and of the rest [s].

    None where no slot comes again. ``parameters`` is the number of fitted coefficients.
    """
    whole = edges.disc.whole_per_turn
    if whole is None or turns < 2:
        return None
    slot = edges.pulse % whole
    have = np.bincount(slot, minlength=whole)
    mean = np.bincount(slot, residual, whole) / np.maximum(have, 1)
    used = int((have > 0).sum())
    random = float(((residual - mean[slot]) ** 2).sum() / max(len(slot) - used, 1))
    return float(np.sqrt((mean**2).sum() / max(used - parameters, 1))), float(np.sqrt(random))


def fit_covariance(edges: Edges, rows: Floats, residual: Floats, slot_scatter: tuple[float, float] | None) -> Floats:
    """Covariance of t0 and the coefficients, (m, m) [s2], for the regressor ``rows`` (n, m) [-] and residual (n,) [s].

    Jitter is independent in every instant; a slot's error is the same in all turns, so its weights in the solution are
    summed over the turns before squaring.
    """
    inverse = np.linalg.inv(rows.T @ rows)
    whole = edges.disc.whole_per_turn
    if slot_scatter is None or whole is None:
        found: Floats = float((residual**2).sum() / max(len(residual) - rows.shape[1], 1)) * inverse
        return found
    pattern, jitter = slot_scatter
    turns = len(residual) / whole
    taken = inverse @ rows.T
    summed = np.stack([np.bincount(edges.pulse % whole, row, whole) for row in taken])
    repeated = max(0.0, pattern**2 - jitter**2 / turns)
    both: Floats = jitter**2 * inverse + repeated * (summed @ summed.T)
    return both


def steady_turns(edges: Edges, within: float) -> tuple[int, int, int]:
    """First steady turn, the one after the last, and the number of whole turns of the log."""
    whole = int(np.floor(edges.angle[-1] / (2.0 * np.pi) + 1e-9))
    if whole < 2:
        raise AnalysisError(
            f"{edges.name}: {edges.angle[-1] / (2 * np.pi):.2f} turns of the crank: expected two or more; "
            "take a longer log"
        )
    ends = np.interp(2.0 * np.pi * np.arange(whole + 1), edges.angle, edges.time)
    duration = np.diff(ends)
    usual = float(np.median(duration[whole // 2 :]))
    steady = np.abs(duration - usual) <= within * usual
    first, last = _longest_run(steady)
    if last - first < 2:
        spread = 100.0 * np.ptp(duration[whole // 2 :]) / usual
        raise AnalysisError(
            f"{edges.name}: no two turns in a row are steady: the later ones differ by {spread:.2g} % in duration; "
            f"allow more with steady_within (--steady-within), or use the speed edge by edge (--csv, --figure)"
        )
    return first, last, whole


def _longest_run(flags: Indices) -> tuple[int, int]:
    """Begin and end of the longest run of True; the later of equals."""
    best, begin = (0, 0), 0
    for k, flag in enumerate([*flags, False]):
        if not flag:
            best = (begin, k) if k - begin >= best[1] - best[0] else best
            begin = k + 1
    return best


@dataclass(frozen=True)
class TurnChanges:
    """Deviations of single turns from the steady turn."""

    shape: Floats
    """Harmonics of each turn less those of all, (turns, 2 harmonics) [s]."""
    is_significant: bool
    """Whether the shapes differ by more than jitter explains."""
    wander: tuple[float, float]
    """Variance of P by a random walk of the turns beyond jitter [s2], and its degrees of freedom."""


def turn_changes(edges: Edges, residual: Floats, harmonics: int, jitter: float) -> TurnChanges:
    """Changes from turn to turn in the residual (n,) [s] of a steady turn; ``jitter`` is that of an instant [s]."""
    number = np.floor(edges.angle / (2.0 * np.pi) + 1e-9).astype(int)
    shapes, size = [], 0.0
    for k in np.unique(number):
        here = np.flatnonzero(number == k)
        if len(here) <= 2 * harmonics + 4:
            continue
        rows = np.delete(time_regressor(edges.angle[here], harmonics), 1, axis=1)
        inverse = np.linalg.inv(rows.T @ rows)
        solved = inverse @ (rows.T @ residual[here])
        shapes.append(solved[1:])
        size += float(solved[1:] @ np.linalg.solve(inverse[1:, 1:], solved[1:]))
    shape, turns = np.array(shapes).reshape(len(shapes), 2 * harmonics), len(shapes)
    is_significant = turns > 2 and _beyond(size, jitter, (turns - 1) * 2 * harmonics)
    return TurnChanges(shape, is_significant, _wander(edges.angle, residual, jitter))


def _beyond(squares: float, jitter: float, freedom: int) -> bool:
    return chi_square_tail(squares / max(jitter**2, 1e-40), freedom) < _SIGNIFICANCE


def _wander(angle: Floats, residual: Floats, jitter: float) -> tuple[float, float]:
    """Variance of P by a random walk in the residual (n,) [s] at angles (n,) [rad], and its degrees of freedom.

    Means of quarter turns, or of several, that scatter about a line more than neighbours differ are taken for a walk
    altogether. Degrees of freedom are Satterthwaite's.
    """
    quarter = np.floor((angle - angle[0]) / (0.5 * np.pi) + 1e-9)
    joined = np.floor(quarter / max(1.0, np.ceil(quarter[-1] / _MOST_PARTS))).astype(int)
    have = np.bincount(joined)
    if len(have) < _LEAST_PARTS or not have.all():
        return 0.0, np.inf
    means, count = np.bincount(joined, residual) / have, len(have)
    number = np.arange(count)
    lever = number - number.mean()
    across = np.eye(count) - 1.0 / count - np.outer(lever, lever) / (lever @ lever)
    walk = np.minimum.outer(number, number).astype(float)
    shown = across @ walk @ across
    scatter, size, change = float(means @ across @ means), float(np.trace(shown)), float(np.mean(np.diff(means) ** 2))
    own = min(0.5 * change, jitter**2 / float(have.mean()))
    if scatter <= own * (count - 2) * (1.0 + _SUSPECTED / np.sqrt(count)):  # von Neumann's ratio scatters by as much
        return 0.0, np.inf
    freedom = size**2 / float(np.sum(shown**2))
    parts = 2.0 * np.pi * count / (angle[-1] - angle[0])
    return scatter / size * float(lever @ walk @ lever) / float(lever @ lever) ** 2 * parts**2, freedom


@dataclass(frozen=True)
class SpeedEstimate:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float

    def contains(self, value: float) -> bool:
        """Whether the interval contains a value."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class SteadySpeedFit(Brief):
    """A steady turn of the crank, estimated from edges."""

    edges: Edges
    """The edges of the steady turns."""
    turns: int
    """Whole turns used."""
    unsteady_turns: int
    """Whole turns of the log that are not yet, or no longer, steady."""
    coefficients: Floats
    """P, then a_h, b_h for h = 1, 2, ..., (2 harmonics + 1,) [s]."""
    covariance: Floats
    """Of the coefficients, from jitter and pitch errors, (2 harmonics + 1, 2 harmonics + 1) [s2]."""
    slot_scatter: tuple[float, float] | None
    """Standard deviations of the residual that repeats every turn, and of the rest [s]; None where no slot repeats."""
    residual: Floats
    """Instants less the fit, (n,) [s]."""
    finer: tuple["SteadySpeedFit", ...] = ()
    """The same turn with one and two harmonics more: intervals contain these answers too."""

    @property
    def harmonics(self) -> int:
        """Number of harmonics of time over angle."""
        return (len(self.coefficients) - 1) // 2

    def slope(self, phi: Floats) -> Floats:
        """dt/dphi at angles (n,) [rad] from the first edge, (n,) [s/rad]."""
        return np.asarray(slope_regressor(phi, self.harmonics) @ self.coefficients)

    def speed(self, phi: Floats) -> Floats:
        """Speed of the crank at angles (n,) [rad] from the first edge, (n,) [rad/s]."""
        return 1.0 / self.slope(phi)

    def speed_error(self, phi: Floats) -> Floats:
        """Half width of the 95 % interval of the speed at angles (n,) [rad], dn = n^2 d(dt/dphi), (n,) [rad/s]."""
        return self.speed(phi) ** 2 * self._half_width(slope_regressor(phi, self.harmonics))

    @cached_property
    def fastest_at(self) -> float:
        """Angle from the first edge where the crank is fastest [rad]."""
        return self._least(1.0)

    @cached_property
    def slowest_at(self) -> float:
        """Angle from the first edge where the crank is slowest [rad]."""
        return self._least(-1.0)

    def _least(self, sign: float) -> float:
        """Angle where ``sign`` times the slope is least: the best of a grid, refined by a parabola [rad]."""
        step = 2.0 * np.pi / _GRID
        values = -sign * self.slope(step * np.arange(_GRID))
        k = int(np.argmax(values))
        return float(step * (k + parabola_peak(values, k, periodic=True)[0]) % (2.0 * np.pi))

    @property
    def fastest(self) -> SpeedEstimate:
        """Largest speed of the turn [rad/s]."""
        return self._widened(self._speed_at(self.fastest_at), [t.fastest.value for t in self.finer])

    @property
    def slowest(self) -> SpeedEstimate:
        """Smallest speed of the turn [rad/s]."""
        return self._widened(self._speed_at(self.slowest_at), [t.slowest.value for t in self.finer])

    @property
    def mean(self) -> SpeedEstimate:
        """Mean speed over time, 2 pi / P [rad/s]."""
        period = self.coefficients[0]
        wander, freedom = self._changes.wander
        variances = np.array([self.covariance[0, 0] + self._rounding, wander])
        known = effective_degrees_of_freedom(variances, np.array([np.inf, freedom])) if wander else np.inf
        half = coverage_factor(known) * float(np.sqrt(variances.sum()))
        return _about(2.0 * np.pi / period, half * 2.0 * np.pi / period**2)

    def fluctuation(self, nominal: float | None = None) -> SpeedEstimate:
        """Coefficient of speed fluctuation, (n_max - n_min) / n, n the nominal or else the mean speed [rad/s]."""
        rows = slope_regressor(np.array([self.fastest_at, self.slowest_at]), self.harmonics)
        fast, slow = 1.0 / (rows @ self.coefficients)
        base = nominal or 2.0 * np.pi / self.coefficients[0]
        gradient = (-(fast**2) * rows[0] + slow**2 * rows[1]) / base
        if nominal is None:
            gradient[0] += (fast - slow) / (2.0 * np.pi)
        found = _about(float((fast - slow) / base), float(self._half_width(gradient[None])[0]))
        return self._widened(found, [t.fluctuation(nominal).value for t in self.finer])

    @property
    def jitter(self) -> float:
        """Standard deviation of a single instant, without what repeats every turn [s]."""
        return self.slot_scatter[1] if self.slot_scatter else float(np.std(self.residual))

    @property
    def _rounding(self) -> float:
        """Variance of P by the clock's step, where jitter is too small to make rounding random [s2]."""
        step = self.edges.clock_step or 0.0
        return step**2 / 6.0 / self.turns**2 if self.jitter < _DITHERED * step else 0.0

    @cached_property
    def _changes(self) -> TurnChanges:
        return turn_changes(self.edges, self.residual, self.harmonics, self.jitter)

    @property
    def repeated(self) -> float:
        """Standard deviation of what repeats every turn beyond the harmonics, over the pitch of the disc [-].

        Zero where jitter alone explains it. Slow errors, such as an eccentric disc's, do not show here.
        """
        if self.slot_scatter is None:
            return 0.0
        pattern, jitter = self.slot_scatter
        expected = jitter / np.sqrt(self.turns)
        step = self.edges.clock_step or 0.0
        if pattern <= max(2.0 * expected, 0.6 * step):
            return 0.0
        return float(np.sqrt(pattern**2 - expected**2)) * self.edges.disc.per_turn / float(self.coefficients[0])

    def _speed_at(self, phi: float) -> SpeedEstimate:
        at = np.array([phi])
        return _about(float(self.speed(at)[0]), float(self.speed_error(at)[0]))

    @staticmethod
    def _widened(found: SpeedEstimate, others: list[float]) -> SpeedEstimate:
        """The interval, widened to contain the answers with more harmonics."""
        off = [value - found.value for value in others]
        return SpeedEstimate(found.value, found.low + min([0.0, *off]), found.high + max([0.0, *off]))

    def _half_width(self, rows: Floats) -> Floats:
        """Half widths of 95 % intervals of ``rows @ coefficients``, by the residual or by the scatter of the turns.

        Pitch errors repeat and are in the residual alone; where turns change by more than jitter, as with changes of
        load, the wider of the two.
        """
        degrees_of_freedom = max(
            len(np.unique(np.round(self.edges.angle % (2 * np.pi), 9))) - len(self.coefficients) - 1, 1
        )
        by_residual = coverage_factor(degrees_of_freedom) * np.sqrt(
            np.einsum("ki,ij,kj->k", rows, self.covariance, rows)
        )
        if not self._changes.is_significant:
            return by_residual
        each = self._changes.shape @ rows[:, 1:].T
        between = coverage_factor(self.turns - 1) * each.std(axis=0, ddof=1) / np.sqrt(self.turns)
        return np.maximum(by_residual, between)


def periodic_turn(edges: Edges, harmonics: int | None = None, steady_within: float = STEADY) -> SteadySpeedFit:
    """The steady turn of a log; harmonics are chosen by the Bayesian information criterion unless given.

    Raises AnalysisError where fewer than two whole turns are steady or too many harmonics are asked for, RecordingError
    where the motion repeats after another number of edges than a turn has.
    """
    require_stated_turn(edges)
    first, last, whole = steady_turns(edges, steady_within)
    in_turn = np.floor(edges.angle / (2.0 * np.pi) + 1e-9).astype(int)
    used = edges.part(np.flatnonzero((in_turn >= first) & (in_turn < last)))
    most = min(MOST_HARMONICS, int(edges.disc.per_turn // 4))
    chosen = harmonics if harmonics is not None else supported_harmonics(used, most)
    if not 1 <= chosen <= int(edges.disc.per_turn // 2 - 1):
        raise AnalysisError(f"{edges.name}: --harmonics {chosen} is too many for {edges.disc.per_turn:g} edges a turn")
    finer = tuple(_turn(used, chosen + more, first, last, whole) for more in (1, 2) if chosen + more <= most)
    return replace(_turn(used, chosen, first, last, whole), finer=finer)


def _turn(used: Edges, harmonics: int, first: int, last: int, whole: int) -> SteadySpeedFit:
    solved, residual = fit_time_over_angle(used, harmonics)
    rows = time_regressor(used.angle, harmonics)
    slot_scatter = scatter_by_slot(used, residual, 2 * harmonics + 1, last - first)
    covariance = fit_covariance(used, rows, residual, slot_scatter)[1:, 1:]
    return SteadySpeedFit(used, last - first, whole - (last - first), solved[1:], covariance, slot_scatter, residual)


def slope_regressor(phi: Floats, harmonics: int) -> Floats:
    """Regressor of dt/dphi at angles (n,) [rad]: times (P, a_h, b_h, ...), (n, 2 harmonics + 1) [1/rad]."""
    h = np.arange(1, harmonics + 1)
    waves = np.stack([-h * np.sin(np.outer(phi, h)), h * np.cos(np.outer(phi, h))], axis=2)
    return np.hstack([np.full((len(phi), 1), 0.5 / np.pi), waves.reshape(len(phi), 2 * harmonics)])


def _about(value: float, half: float) -> SpeedEstimate:
    return SpeedEstimate(value, value - half, value + half)
