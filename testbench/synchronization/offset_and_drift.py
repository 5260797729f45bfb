"""Offset and drift between two clocks, precisely: least squares at every sample, from a rough offset.

Newton's method, first where the rough offset was found, then on stretches four times as long until all is used; then
again with the residual made white. Of the two, the one that is surer counts: where both sides are very noisy, making
white lays weight on frequencies at which they have nothing in common.

Two clocks aligned by what both loggers saw: a rough lag by correlation, then offset and drift by least squares.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .clock_map import ASSUMED_DRIFT, PPM, ClockMap
from .coarse_lag import CoarseLag, search_lag
from .fit_equations import (
    MOVES,
    SMOOTHED,
    ClockScatter,
    PiecePosition,
    Segment,
    Signal,
    clock_scatter,
    joined,
    lacking_evidence,
    lead_interval,
)
from .signal_preparation import PERIODS, Flags, Prepared, Shared, prepare, whitener, with_history

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LEAST_FREEDOM = 2.0
"""Degrees of freedom below which scatter is not told."""
LIVELY = 0.05
"""Share of the largest change, averaged over LIVELY_PERIODS of the cut-off, from which samples are used."""
LIVELY_PERIODS = 5.0
LARGEST_DRIFT = 1e-3
"""A drift that is known no better than this is not determined: no logger's clock is so wrong."""
WHITENINGS = 2
"""Rounds in which the residual is made white."""
_STEPS = 50
_SETTLED = 1e-9


@dataclass(frozen=True)
class RefinedClock:
    """A clock's map, and the share of the energy that it leaves unexplained."""

    clock: ClockMap
    left: float


@dataclass(frozen=True)
class _Fit:
    """A settled fit."""

    place: PiecePosition
    stretch: Segment
    signals: list[Signal]


class _Problem:
    """Two clocks to be fitted; ``loose`` is the standard deviation of a drift that is not asked for, else None."""

    def __init__(self, content: Prepared, among: Flags, loose: float | None) -> None:
        self.content, self.among, self.loose = content, among, loose
        self.splines = _splines(content)

    def settled(self, place: PiecePosition, half: float, taps: list[Floats]) -> _Fit:
        """Newton's method on the stretch of the own clock within ``half`` [s] of the middle."""
        content, reach = self.content, 0.125 / self.content.cutoff
        along, history = content.along.shape[1], max(len(t) for t in taps) - 1
        for _ in range(_STEPS):
            stretch = _inside(content, place, half, self.among, history)
            signals = [
                Signal(stretch, i, spline, place, t, along)
                for i, (spline, t) in enumerate(zip(self.splines, taps, strict=True))
            ]
            gradient, bend = joined(signals, place, self.loose)
            move = -np.linalg.lstsq(bend, gradient, rcond=1e-13)[0]
            shift = float(np.clip(move[0], -reach, reach))
            turn = float(np.clip(move[1], -LARGEST_DRIFT, LARGEST_DRIFT))
            place = PiecePosition(place.middle, place.at + shift, place.drift + turn)
            if abs(shift) < _SETTLED and abs(turn) * half < _SETTLED:
                return _Fit(place, stretch, signals)
        raise AnalysisError(f"{content.name}: the offset does not settle: the two have too little in common")

    def whitened(self, fit: _Fit, half: float) -> _Fit:
        """The same with residuals made white."""
        longest = max(1, round(PERIODS / (self.content.cutoff * self.content.own.step)))
        for _ in range(WHITENINGS):
            taps = [whitener(s.left, fit.stretch.used, longest) for s in fit.signals]
            fit = self.settled(fit.place, half, taps)
        return fit

    def scatter(self, fit: _Fit) -> ClockScatter:
        """How a fit scatters."""
        bend = joined(fit.signals, fit.place, self.loose)[1]
        return clock_scatter(
            fit.signals, bend, fit.stretch.used, SMOOTHED * self.content.cutoff * self.content.own.step
        )

    def mapped(self, fit: _Fit, by: ClockScatter) -> ClockMap:
        """The map with its covariance. Raises AnalysisError where there is too little to tell it."""
        content, signals, freedom = self.content, fit.signals, by.freedom
        bend = joined(signals, fit.place, self.loose)[1]
        fitted = MOVES + sum(s.columns.shape[1] for s in signals) / len(signals)
        own = fit.stretch.own[fit.stretch.used]
        if freedom - fitted < LEAST_FREEDOM:
            raise AnalysisError(
                f"{content.name}: too short: {own[-1] - own[0]:.3g} s at {content.cutoff:.3g} Hz leave "
                f"{max(freedom - fitted, 0.0):.1f} degrees of freedom, expected at least {LEAST_FREEDOM:g}"
            )
        covariance = by.covariance * freedom / (freedom - fitted)
        for effect in (
            lacking_evidence(signals, bend, float(covariance[0, 0])),
            content.fixed_doubt * lead_interval(signals, bend),
        ):
            covariance += np.outer(effect, effect)
        if self.loose is not None:
            assumed = np.linalg.inv(bend)[:MOVES, 1] / self.loose
            covariance += np.outer(assumed, assumed)
        if content.partial:
            covariance[0, 0] += _shifted(fit) ** 2
        span, known = (float(own[0]), float(own[-1])), max(1, int(freedom - fitted))
        return ClockMap(fit.place.middle, fit.place.at, fit.place.drift, covariance, known, span)


def refine_clock(content: Prepared, rough: CoarseLag, drift: bool = True, among: Flags | None = None) -> RefinedClock:
    """Offset and drift (or the offset, and a drift within ASSUMED_DRIFT) with their covariance.

    ``among`` (own samples,) leaves the others out.
    Raises AnalysisError where too little overlaps, the steps do not settle, or the drift is not determined.
    """
    lively = _lively(content)
    among = (lively if among is None else lively & among) & content.sound
    problem = _Problem(content, among, None if drift else 0.5 * ASSUMED_DRIFT)
    begin, end = rough.stretch
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    place = PiecePosition(middle, middle + rough.offset)
    while True:
        plain = problem.settled(place, half, [np.ones(1)] * len(problem.splines))
        if middle - half <= content.own.start and middle + half >= content.own.time[-1]:
            break
        place, half = plain.place, 4.0 * half
    clock = _surer(problem, plain, half)
    low, high = clock.drift_interval
    if drift and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{content.name}: too short for a drift: {clock.span[1] - clock.span[0]:.3g} s tell it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone, which takes the drift to "
            f"be within {ASSUMED_DRIFT / PPM:g} ppm"
        )
    return RefinedClock(clock, _share_left(plain))


def _surer(problem: _Problem, plain: _Fit, half: float) -> ClockMap:
    """The map of the fit as it is, or of the one made white, whichever tells the offset better."""
    chosen, by = plain, problem.scatter(plain)
    try:
        white = problem.whitened(plain, half)
    except AnalysisError:  # made white, both sides have nothing in common: the plain fit stands
        return problem.mapped(chosen, by)
    if (other := problem.scatter(white)).most < by.most:
        chosen, by = white, other
    return problem.mapped(chosen, by)


def _lively(content: Prepared) -> Flags:
    """Own samples about which the signals change; where they rest, noise would pass for information."""
    from scipy.ndimage import uniform_filter1d

    own = content.own
    change = np.sum(np.gradient(content.seen / content.seen.std(axis=0).max(), own.step, axis=0) ** 2, axis=1)
    near = uniform_filter1d(change, max(3, round(LIVELY_PERIODS / content.cutoff / own.step)), mode="constant")
    return np.asarray(near >= LIVELY * near.max())


def _splines(content: Prepared) -> "list[BSpline]":
    """For each signal, its fixed part, its columns, and those along."""
    from scipy.interpolate import make_interp_spline

    all_ = [np.column_stack([f, c, content.along]) for f, c in zip(content.fixed.T, content.columns, strict=True)]
    return [make_interp_spline(content.reference.time, b, 5) for b in all_]


def _inside(content: Prepared, place: PiecePosition, half: float, among: Flags, history: int) -> Segment:
    """The stretch near the middle that the reference's record covers, without its gaps."""
    own, grid = content.own.time, content.reference
    instants = place.instants(own)
    rows = np.flatnonzero((np.abs(own - place.middle) <= half) & (instants >= grid.start) & (instants <= grid.time[-1]))
    sound = content.sound[rows] & ~content.in_gap(instants[rows])
    used = among[rows] & with_history(sound, history)
    if np.count_nonzero(used) < 2 * sum(c.shape[1] + 2 for c in content.columns) + 4:
        raise AnalysisError(f"{content.name}: the two records hardly overlap: {np.count_nonzero(used)} samples")
    return Segment(own[rows], content.seen[rows], content.beside[rows], used)


def _share_left(fit: _Fit) -> float:
    """Share of the energy that stays unexplained."""
    used = fit.stretch.used
    return float(sum(np.sum(s.left[used] ** 2) for s in fit.signals) / np.sum(fit.stretch.seen[used] ** 2))


def _shifted(fit: _Fit) -> float:
    """By how much all that stays unexplained may shift the answer, as half an interval of 95 %: the deviation [s]."""
    rate = np.gradient(fit.stretch.seen, fit.stretch.step, axis=0)[fit.stretch.used]
    slope = np.sqrt(np.sum(rate**2) / np.sum(fit.stretch.seen[fit.stretch.used] ** 2))
    return float(0.5 * np.sqrt(_share_left(fit)) / slope)


@dataclass(frozen=True)
class Aligned:
    """A clock's map, how it was found, from what, and how much of the signal it explains (None: edges alone)."""

    clock: ClockMap
    method: str
    content: str
    explained: float | None
    findings: tuple[str, ...] = ()
    """What a person should know of the records."""


def by_correlation(shared: Shared, drift: bool = True) -> Aligned:
    """Align by all of the record. Raises AnalysisError, saying why, where the data do not determine the clock."""
    content = prepare(shared)
    found = refine_clock(content, search_lag(content), drift)
    return Aligned(found.clock, "correlation", shared.name, 1.0 - found.left, content.findings)
