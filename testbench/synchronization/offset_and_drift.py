"""Offset and drift between two clocks by what both loggers recorded: a rough lag, then least squares at every sample.

Newton's method starts on the segment where the rough offset was found and goes on to segments four times as long until
all is used, then again with the residual whitened. Of the two fits the one with the smaller variance is taken: where
both sides are very noisy, whitening lays weight on frequencies at which they have nothing in common.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from balance.arrays import Floats
from balance.results import INLINE, Key

from ..errors import AnalysisError
from .clock_map import ASSUMED_DRIFT, PPM, ClockMap
from .coarse_lag import CoarseLag, search_lag
from .fit_equations import (
    CLOCK_SIZE,
    SMOOTHED,
    ClockCovariance,
    Segment,
    Signal,
    TrialClock,
    clock_covariance,
    fixed_time_effect,
    joint_equations,
    misspecification_deviation,
)
from .signal_preparation import PERIODS, Flags, PreparedSignals, SharedSignals, prepare, whitener, with_history

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LEAST_FREEDOM = 2.0
"""Degrees of freedom below which no variance is estimated."""
LEAST_CHANGE = 0.05
"""Share of the largest change, averaged over CHANGE_PERIODS of the cut-off, from which samples are used."""
CHANGE_PERIODS = 5.0
LARGEST_DRIFT = 1e-3
"""A drift that is known no better than this is not determined: no logger's clock is so wrong."""
WHITENINGS = 2
"""Rounds in which the residual is whitened."""
_STEPS = 50
_SETTLED = 1e-9


@dataclass(frozen=True)
class RefinedClock:
    """A clock's map, and the share of the energy that it leaves unexplained."""

    clock: ClockMap
    residual_share: float


@dataclass(frozen=True)
class _Fit:
    """A settled fit."""

    trial: TrialClock
    segment: Segment
    signals: list[Signal]


class _Problem:
    """Two clocks to be fitted; ``drift_prior``: standard deviation of a drift that is not estimated, else None."""

    def __init__(self, content: PreparedSignals, among: Flags, drift_prior: float | None) -> None:
        self.content, self.among, self.drift_prior = content, among, drift_prior
        self.splines = _splines(content)

    def settled(self, trial: TrialClock, half: float, taps: list[Floats]) -> _Fit:
        """Newton's method on the segment of the own clock within ``half`` [s] of the middle."""
        content, reach = self.content, 0.125 / self.content.cutoff
        nuisances, history = content.reference_nuisance.shape[1], max(len(t) for t in taps) - 1
        for _ in range(_STEPS):
            segment = _segment_near(content, trial, half, self.among, history)
            signals = [
                Signal(segment, i, spline, trial, t, nuisances)
                for i, (spline, t) in enumerate(zip(self.splines, taps, strict=True))
            ]
            gradient, hessian = joint_equations(signals, trial, self.drift_prior)
            move = -np.linalg.lstsq(hessian, gradient, rcond=1e-13)[0]
            shift = float(np.clip(move[0], -reach, reach))
            turn = float(np.clip(move[1], -LARGEST_DRIFT, LARGEST_DRIFT))
            trial = TrialClock(trial.middle, trial.at + shift, trial.drift + turn)
            if abs(shift) < _SETTLED and abs(turn) * half < _SETTLED:
                return _Fit(trial, segment, signals)
        raise AnalysisError(f"{content.name}: the offset does not settle: the two have too little in common")

    def whitened(self, fit: _Fit, half: float) -> _Fit:
        """The same with residuals whitened."""
        longest = max(1, round(PERIODS / (self.content.cutoff * self.content.own.step)))
        for _ in range(WHITENINGS):
            taps = [whitener(s.raw_residual, fit.segment.used, longest) for s in fit.signals]
            fit = self.settled(fit.trial, half, taps)
        return fit

    def covariance_of(self, fit: _Fit) -> ClockCovariance:
        """Covariance of the clock by a fit."""
        hessian = joint_equations(fit.signals, fit.trial, self.drift_prior)[1]
        return clock_covariance(
            fit.signals, hessian, fit.segment.used, SMOOTHED * self.content.cutoff * self.content.own.step
        )

    def clock_map(self, fit: _Fit, by: ClockCovariance) -> ClockMap:
        """The map with its covariance. Raises AnalysisError where there are too few degrees of freedom."""
        content, signals, total = self.content, fit.signals, by.degrees_of_freedom
        hessian = joint_equations(signals, fit.trial, self.drift_prior)[1]
        fitted = CLOCK_SIZE + sum(s.columns.shape[1] for s in signals) / len(signals)
        own = fit.segment.own[fit.segment.used]
        degrees_of_freedom = total - fitted
        if degrees_of_freedom < LEAST_FREEDOM:
            raise AnalysisError(
                f"{content.name}: too short: {own[-1] - own[0]:.3g} s at {content.cutoff:.3g} Hz leave "
                f"{max(degrees_of_freedom, 0.0):.1f} degrees of freedom, expected at least {LEAST_FREEDOM:g}; "
                "record for longer, or compare up to a higher --cutoff"
            )
        covariance = by.covariance * total / degrees_of_freedom
        for effect in (
            misspecification_deviation(signals, hessian, float(covariance[0, 0])),
            content.fixed_time_deviation * fixed_time_effect(signals, hessian),
        ):
            covariance += np.outer(effect, effect)
        if self.drift_prior is not None:
            assumed = np.linalg.inv(hessian)[:CLOCK_SIZE, 1] / self.drift_prior
            covariance += np.outer(assumed, assumed)
        if content.partial:
            covariance[0, 0] += _largest_bias(fit) ** 2
        span = float(own[0]), float(own[-1])
        return ClockMap(
            fit.trial.middle, fit.trial.at, fit.trial.drift, covariance, max(1, int(degrees_of_freedom)), span
        )


def refine_clock(
    content: PreparedSignals, rough: CoarseLag, drift: bool = True, among: Flags | None = None
) -> RefinedClock:
    """Offset and drift (or the offset, and a drift within ASSUMED_DRIFT) with their covariance.

    Only own samples ``among`` (m,) [-] are used, all by default.
    Raises AnalysisError where too little overlaps, the steps do not settle, or the drift is not determined.
    """
    changing = _changing_samples(content)
    among = (changing if among is None else changing & among) & content.valid
    problem = _Problem(content, among, None if drift else 0.5 * ASSUMED_DRIFT)
    begin, end = rough.segment
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    trial = TrialClock(middle, middle + rough.offset)
    while True:
        plain = problem.settled(trial, half, [np.ones(1)] * len(problem.splines))
        if middle - half <= content.own.start and middle + half >= content.own.time[-1]:
            break
        trial, half = plain.trial, 4.0 * half
    clock = _more_precise(problem, plain, half)
    low, high = clock.drift_interval
    if drift and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{content.name}: too short for a drift: {clock.span[1] - clock.span[0]:.3g} s determine it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone, which takes the drift to "
            f"be within {ASSUMED_DRIFT / PPM:g} ppm"
        )
    return RefinedClock(clock, _residual_share(plain))


def _more_precise(problem: _Problem, plain: _Fit, half: float) -> ClockMap:
    """The map of the plain or of the whitened fit, whichever has the smaller variance of the offset."""
    chosen, by = plain, problem.covariance_of(plain)
    try:
        white = problem.whitened(plain, half)
    except AnalysisError:  # whitened, both sides have nothing in common
        return problem.clock_map(chosen, by)
    if (other := problem.covariance_of(white)).upper_variance < by.upper_variance:
        chosen, by = white, other
    return problem.clock_map(chosen, by)


def _changing_samples(content: PreparedSignals) -> Flags:
    """Own samples near which the signals change, (m,); at rest, noise would pass for information."""
    from scipy.ndimage import uniform_filter1d

    own = content.own
    change = np.sum(
        np.gradient(content.own_signals / content.own_signals.std(axis=0).max(), own.step, axis=0) ** 2, axis=1
    )
    near = uniform_filter1d(change, max(3, round(CHANGE_PERIODS / content.cutoff / own.step)), mode="constant")
    return np.asarray(near >= LEAST_CHANGE * near.max())


def _splines(content: PreparedSignals) -> "list[BSpline]":
    """For each signal, splines of its fixed part, its columns, and the reference's nuisance columns."""
    from scipy.interpolate import make_interp_spline

    columns = [
        np.column_stack([f, c, content.reference_nuisance])
        for f, c in zip(content.fixed.T, content.reference_columns, strict=True)
    ]
    return [make_interp_spline(content.reference.time, b, 5) for b in columns]


def _segment_near(content: PreparedSignals, trial: TrialClock, half: float, among: Flags, history: int) -> Segment:
    """The segment near the middle that the reference's record covers; samples in gaps are not used."""
    own, grid = content.own.time, content.reference
    instants = trial.instants(own)
    rows = np.flatnonzero((np.abs(own - trial.middle) <= half) & (instants >= grid.start) & (instants <= grid.time[-1]))
    valid = content.valid[rows] & ~content.in_gap(instants[rows])
    used = among[rows] & with_history(valid, history)
    if np.count_nonzero(used) < 2 * sum(c.shape[1] + 2 for c in content.reference_columns) + 4:
        raise AnalysisError(f"{content.name}: the two records overlap in {np.count_nonzero(used)} samples: too few")
    return Segment(own[rows], content.own_signals[rows], content.own_nuisance[rows], used)


def _residual_share(fit: _Fit) -> float:
    """Share of the energy in the residual."""
    used = fit.segment.used
    return float(
        sum(np.sum(s.raw_residual[used] ** 2) for s in fit.signals) / np.sum(fit.segment.own_signals[used] ** 2)
    )


def _largest_bias(fit: _Fit) -> float:
    """Standard deviation of the offset [s] for which the whole residual as a shift is half an interval of 95 %."""
    rate = np.gradient(fit.segment.own_signals, fit.segment.step, axis=0)[fit.segment.used]
    slope = np.sqrt(np.sum(rate**2) / np.sum(fit.segment.own_signals[fit.segment.used] ** 2))
    return float(0.5 * np.sqrt(_residual_share(fit)) / slope)


@dataclass(frozen=True)
class AlignedClock:
    """A clock's map, how it was found, from what, and how much of the signal it explains (None: edges alone)."""

    clock: Annotated[ClockMap, INLINE]
    method: Annotated[str, Key()]
    content: Annotated[str, Key("", "by")]
    explained: Annotated[float | None, Key()]
    findings: Annotated[tuple[str, ...], Key()] = ()
    """Gaps in the records, as text."""


def by_correlation(shared: SharedSignals, drift: bool = True) -> AlignedClock:
    """Align by all of the record. Raises AnalysisError, saying why, where the data do not determine the clock."""
    content = prepare(shared)
    found = refine_clock(content, search_lag(content), drift)
    return AlignedClock(found.clock, "correlation", shared.name, 1.0 - found.residual_share, content.findings)
