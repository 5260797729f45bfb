"""Offset and drift between two clocks by what both loggers recorded: a rough lag, then least squares at every sample.

Newton's method starts on the segment where the rough offset was found and goes on to segments four times as long until
all is used, then again with the residual whitened. Of the two fits the one with the smaller variance is taken: where
both sides are very noisy, whitening lays weight on frequencies at which they have nothing in common.

Least-squares equations of one clock against another, and the covariance of the clock that they determine.

Each signal is y(t) = c + e t + Z(t) g + X(s) b + f(s) at s = p + (1 + d)(t - t0), with f known to its size and both
sides behind one whitening filter. Noise on both sides leaves p unbiased, but not the first-order Hessian of the sum of
squares: second derivatives are therefore included.

The error of the fit is the sum of L(t) r(t), L its influence and r the residual. Where r is stationary, its variance is
the integral of L(f)* S(f) L(f), S from the whitened residual, smoothed over frequency (prewhitened spectral estimator:
Andrews and Monahan, Econometrica 60, 1992). One L is taken from the rates of each side: their noise is independent, so
that noise in a rate does not count as signal. Where r is larger when the signals are fast, as by jitter, the ratio of
White (Econometrica 48, 1980) widens the variance. What is fitted is taken off the degrees of freedom.

Misspecification (inexact sensitivities, compliance of the frame) is fitted by nuisance columns, which explain part of
it. Where they move the estimate by more than noise does, whose variance is the difference of the variances with and
without them (Hausman, Econometrica 46, 1978), the rest is taken to be evenly distributed within as much.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import numpy as np

from balance.arrays import Floats, Indices, Mask
from balance.results import INLINE, Key

from ..errors import AnalysisError
from .clock_map import ASSUMED_DRIFT, PPM, ClockMap
from .coarse_lag import search_lag
from .signal_preparation import PERIODS, PreparedSignals, SharedSignals, prepare, whitener, with_history
from .signal_preparation import whitened as filtered

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

CLOCK_SIZE = 2
"""Parameters of the clock: when its middle was, and its drift."""


@dataclass(frozen=True)
class TrialClock:
    """A clock during the fit: reference = ``at`` + (1 + drift) (own - middle), all in s."""

    middle: float
    at: float
    drift: float = 0.0

    def instants(self, own: Floats) -> Floats:
        """Own instants (n,) [s] on the reference's clock, (n,) [s]."""
        return self.at + (1.0 + self.drift) * (own - self.middle)


@dataclass(frozen=True)
class Segment:
    """A segment of the own clock, and which of its samples are used."""

    own: Floats
    """(n,) [s]"""
    lever: Floats
    """The same less the middle of the fit, (n,) [s]."""
    instants: Floats
    """On the reference's clock by the trial clock, (n,) [s]."""
    own_signals: Floats
    """(n, signals)"""
    own_nuisance: Floats
    """Nuisance columns on the own clock, (n, k)."""
    used: Mask
    """(n,)"""

    @property
    def step(self) -> float:
        """Between samples [s]."""
        return float(self.own[-1] - self.own[0]) / (len(self.own) - 1)


class Signal:
    """One signal of the own clock fitted by its columns; constant, trend and factors are solved for.

    Nuisance columns, those of the segment and the last ``reference_nuisances`` of the spline, are what the model of the
    other columns lacks.
    """

    def __init__(self, segment: Segment, index: int, spline: "BSpline", taps: Floats, reference_nuisances: int) -> None:
        used, lever = segment.used, segment.lever
        self.lever = np.column_stack([np.ones_like(lever), lever])[used]
        own_columns = np.column_stack([np.ones_like(lever), lever / np.abs(lever).max(), segment.own_nuisance])
        self.own_count = own_columns.shape[1]
        nuisance = np.zeros(self.own_count + spline.c.shape[1] - 1, dtype=bool)
        nuisance[2 : self.own_count] = True
        nuisance[len(nuisance) - reference_nuisances :] = True
        self.nuisance = nuisance
        """Which columns are nuisance columns, (columns,)."""
        raw = [np.asarray(spline(segment.instants, order)) for order in (0, 1, 2)]
        value, rate, curvature = (filtered(x, taps)[used] for x in raw)
        self.columns = np.column_stack([filtered(own_columns, taps)[used], value[:, 1:]])
        self.readings = filtered(segment.own_signals[:, index], taps)[used]
        self.factors = np.linalg.lstsq(self.columns, self.readings - value[:, 0], rcond=None)[0]
        share = np.r_[1.0, self.factors[self.own_count :]]
        self.column_rates, self.fixed_rate = rate[:, 1:], rate[:, 0]
        self.fitted_rate, self.curvature = rate @ share, curvature @ share
        fitted = raw[0] @ share + own_columns @ self.factors[: self.own_count]
        self.raw_residual = segment.own_signals[:, index] - fitted
        """Residual before the filter, of all samples of the segment."""
        whitened = filtered(self.raw_residual, taps)
        self.residual = whitened[used]
        self.observed_rate = self.fitted_rate + np.gradient(whitened, segment.step)[used]

    @cached_property
    def weight(self) -> float:
        """1 / mean square of the residual."""
        return 1.0 / max(float(np.mean(self.residual**2)), 1e-12 * float(np.mean(self.readings**2)))

    def design(self, rate: Floats) -> Floats:
        """Derivatives by the clock's parameters and its own, (n, p) [SI], with rates (n,) [1/s] of the signal."""
        return np.column_stack([self.lever * rate[:, None], self.columns])

    def equations(self) -> tuple[Floats, Floats]:
        """Gradient (p,) and Hessian (p, p) of half the weighted sum of squares [SI, signals in any unit]."""
        design = self.design(self.fitted_rate)
        first_order = design.T @ design
        hessian, at = first_order.copy(), CLOCK_SIZE + self.own_count
        hessian[:CLOCK_SIZE, :CLOCK_SIZE] -= (self.lever * (self.residual * self.curvature)[:, None]).T @ self.lever
        crossed = self.lever.T @ (self.residual[:, None] * self.column_rates)
        hessian[:CLOCK_SIZE, at:] -= crossed
        hessian[at:, :CLOCK_SIZE] -= crossed.T
        if np.linalg.eigvalsh(hessian).min() <= 0.0:
            hessian = first_order
        return -self.weight * (design.T @ self.residual), self.weight * hessian


def joint_equations(signals: list[Signal]) -> tuple[Floats, Floats]:
    """Gradient (p,) and Hessian (p, p) [SI] of all signals; they share the clock's parameters alone."""
    indices = parameter_indices(signals)
    size = int(indices[-1][-1]) + 1
    gradient, hessian = np.zeros(size), np.zeros((size, size))
    for signal, index in zip(signals, indices, strict=True):
        own_gradient, own_hessian = signal.equations()
        gradient[index] += own_gradient
        hessian[index[:, None], index] += own_hessian
    return gradient, hessian


def parameter_indices(signals: list[Signal]) -> list[Indices]:
    """Indices of each signal's parameters among all, (p,) each [-]."""
    ends = CLOCK_SIZE + np.cumsum([s.columns.shape[1] for s in signals])
    return [np.r_[0:CLOCK_SIZE, end - s.columns.shape[1] : end] for s, end in zip(signals, ends, strict=True)]


SMOOTHED = 0.125
"""Width over which the spectrum is smoothed, as a share of the highest frequency compared."""
LEAST_SHARE = 0.02
"""Of the covariance by one side's rates, below which that by the rates of both may be chance."""


@dataclass(frozen=True)
class ClockCovariance:
    """Covariance of ``at`` and drift by the residual, before the degrees of freedom of the fit are taken off."""

    covariance: Floats
    """By the rates of both sides, (2, 2)."""
    upper_variance: float
    """Variance of ``at`` by the reference's rates alone [s2]: noise in them makes it too large, never too small."""
    degrees_of_freedom: float


def clock_covariance(signals: list[Signal], hessian: Floats, used: Mask, width: float) -> ClockCovariance:
    """Covariance of the clock; by the reference's rates alone where those of both sides determine none.

    ``hessian`` (p, p) [SI] of the fit, ``used`` (n,) [-] its samples, ``width`` of the smoothing [periods/sample].
    """
    inverse, where = np.linalg.inv(hessian)[:, :CLOCK_SIZE], np.flatnonzero(used)
    where -= where[0]
    length = int(2 ** np.ceil(np.log2(2 * (where[-1] + 1))))
    pairs = list(zip(signals, parameter_indices(signals), strict=True))
    residual = np.array([s.residual for s in signals])
    one, other = (
        np.array([s.weight * s.design(rate) @ inverse[index] for (s, index), rate in zip(pairs, rates, strict=True)])
        for rates in ([s.fitted_rate for s in signals], [s.observed_rate for s in signals])
    )

    def spectra(values: Floats) -> Floats:
        """Of values (signals, n, k) at the samples, zero elsewhere, (signals, frequencies, k)."""
        padded = np.zeros((len(values), length, values.shape[2]))
        padded[:, where] = values
        return np.asarray(np.fft.rfft(padded, axis=1))

    residual_spectra, first, second = (spectra(x) for x in (residual[:, :, None], one, other))
    twice = np.full(first.shape[1], 2.0 / length)
    twice[[0, -1]] = 1.0 / length
    both, alone = np.zeros((2, CLOCK_SIZE, CLOCK_SIZE))
    shares = np.zeros(first.shape[1])
    for i in range(len(signals)):
        for j in range(len(signals)):
            cross = residual_spectra[i, :, 0] * residual_spectra[j, :, 0].conj()
            density = _smoothed(cross, width * length) / len(where)
            influence = twice[:, None] * first[i].conj()
            both += np.real(np.einsum("k,ka,kb->ab", density, influence, second[j]))
            alone += np.real(np.einsum("k,ka,kb->ab", density, influence, first[j]))
            shares += np.real(_smoothed(influence[:, 0] * first[j, :, 0], width * length) * density)
    widening = np.sqrt(_heteroscedastic_widening(one, residual))
    both, alone = (0.5 * (c + c.T) * np.outer(widening, widening) for c in (both, alone))
    degrees_of_freedom = 2.0 * shares.sum() ** 2 / np.sum(shares**2) * len(where) / length
    positive = np.linalg.eigvalsh(both / np.sqrt(np.outer(np.diag(alone), np.diag(alone)))).min() > LEAST_SHARE
    return ClockCovariance(both if positive else alone, float(alone[0, 0]), float(degrees_of_freedom))


def misspecification_deviation(signals: list[Signal], hessian: Floats, variance: float) -> Floats:
    """Standard deviations of ``at`` [s] and drift [-] by misspecification that remains, (2,); ``hessian`` (p, p)."""
    nuisance, factors = np.zeros(len(hessian), dtype=bool), np.zeros(len(hessian))
    for signal, index in zip(signals, parameter_indices(signals), strict=True):
        nuisance[index[CLOCK_SIZE:]], factors[index[CLOCK_SIZE:]] = signal.nuisance, signal.factors
    if not nuisance.any():
        return np.zeros(CLOCK_SIZE)
    without = np.linalg.inv(hessian[~nuisance][:, ~nuisance])
    moved = (without @ hessian[~nuisance][:, nuisance] @ factors[nuisance])[:CLOCK_SIZE]
    by_noise = variance * (1.0 - without[0, 0] / np.linalg.inv(hessian)[0, 0])
    beyond = max(0.0, 1.0 - by_noise / max(float(moved[0] ** 2), 1e-300))
    return np.asarray(moved * np.sqrt(beyond / 3.0))


def fixed_time_effect(signals: list[Signal], hessian: Floats) -> Floats:
    """Change of ``at`` [-] and drift [1/s] per delay of the fixed part, (2,); ``hessian`` (p, p)."""
    joint = np.zeros(len(hessian))
    for signal, index in zip(signals, parameter_indices(signals), strict=True):
        joint[index] += signal.weight * (signal.design(signal.fitted_rate).T @ signal.fixed_rate)
    return np.asarray(np.linalg.solve(hessian, joint)[:CLOCK_SIZE])


def _heteroscedastic_widening(influence: Floats, residual: Floats) -> Floats:
    """Factor on the variance for a residual that is uneven in time, at least 1, (2,)."""
    total = np.einsum("snm,sn->nm", influence, residual)
    even = np.einsum("snm,tnm,st->m", influence, influence, residual @ residual.T / residual.shape[1])
    return np.maximum(1.0, np.sum(total**2, axis=0) / np.maximum(even, 1e-300))


def _smoothed(spectrum: Floats, width: float) -> Floats:
    """A spectrum averaged over a triangle ``width`` bins wide at its base, mirrored at the ends."""
    half = max(1, min(round(0.5 * width), len(spectrum) - 2))
    kernel = np.bartlett(2 * half + 1)
    mirrored = [np.conj(spectrum[half:0:-1]), spectrum, np.conj(spectrum[-2 : -half - 2 : -1])]
    return np.asarray(np.convolve(np.concatenate(mirrored), kernel / kernel.sum(), mode="valid"))


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
class _Fit:
    """A settled fit."""

    trial: TrialClock
    segment: Segment
    signals: list[Signal]
    hessian: Floats
    """Of half the weighted sum of squares, (p, p) [SI]."""

    @property
    def residual_share(self) -> float:
        """Share of the energy in the residual."""
        used = self.segment.used
        residual = sum(np.sum(s.raw_residual[used] ** 2) for s in self.signals)
        return float(residual / np.sum(self.segment.own_signals[used] ** 2))


class _Problem:
    """Two clocks to be fitted by the own samples ``among`` (m,)."""

    def __init__(self, content: PreparedSignals, among: Mask, drift_prior: float | None) -> None:
        from scipy.interpolate import make_interp_spline

        self.content, self.among = content, among
        self.drift_prior = drift_prior
        """Standard deviation of a drift that is not estimated, about zero [-]; None: it is estimated."""
        columns = [
            np.column_stack([f, c, content.reference_nuisance])
            for f, c in zip(content.fixed.T, content.reference_columns, strict=True)
        ]
        self.splines = [make_interp_spline(content.reference.time, b, 5) for b in columns]
        """For each signal, of its fixed part, its columns, and the reference's nuisance columns."""

    def settled(self, trial: TrialClock, half: float, taps: list[Floats]) -> _Fit:
        """Newton's method on the segment of the own clock within ``half`` [s] of the middle."""
        content, reach = self.content, 0.125 / self.content.cutoff
        nuisances, history = content.reference_nuisance.shape[1], max(len(t) for t in taps) - 1
        for _ in range(_STEPS):
            segment = self._segment(trial, half, history)
            signals = [
                Signal(segment, i, *both, nuisances) for i, both in enumerate(zip(self.splines, taps, strict=True))
            ]
            gradient, hessian = joint_equations(signals)
            if self.drift_prior is not None:
                gradient[1] += trial.drift / self.drift_prior**2
                hessian[1, 1] += 1.0 / self.drift_prior**2
            move = -np.linalg.lstsq(hessian, gradient, rcond=1e-13)[0]
            shift = float(np.clip(move[0], -reach, reach))
            turn = float(np.clip(move[1], -LARGEST_DRIFT, LARGEST_DRIFT))
            trial = TrialClock(trial.middle, trial.at + shift, trial.drift + turn)
            if abs(shift) < _SETTLED and abs(turn) * half < _SETTLED:
                return _Fit(trial, segment, signals, hessian)
        raise AnalysisError(f"{content.name}: the offset does not settle: the two have too little in common")

    def _segment(self, trial: TrialClock, half: float, history: int) -> Segment:
        """The segment near the middle that the reference's record covers; samples in gaps are not used."""
        content, own, grid = self.content, self.content.own.time, self.content.reference
        lever, instants = own - trial.middle, trial.instants(own)
        rows = np.flatnonzero((np.abs(lever) <= half) & (instants >= grid.start) & (instants <= grid.time[-1]))
        valid = content.valid[rows] & ~content.in_gap(instants[rows])
        used = self.among[rows] & with_history(valid, history)
        if np.count_nonzero(used) < 2 * sum(c.shape[1] + 2 for c in content.reference_columns) + 4:
            raise AnalysisError(f"{content.name}: the two records overlap in {np.count_nonzero(used)} samples: too few")
        return Segment(
            own[rows], lever[rows], instants[rows], content.own_signals[rows], content.own_nuisance[rows], used
        )

    def whitened(self, fit: _Fit, half: float) -> _Fit:
        """The same with residuals whitened."""
        longest = max(1, round(PERIODS / (self.content.cutoff * self.content.own.step)))
        for _ in range(WHITENINGS):
            taps = [whitener(s.raw_residual, fit.segment.used, longest) for s in fit.signals]
            fit = self.settled(fit.trial, half, taps)
        return fit

    def covariance_of(self, fit: _Fit) -> ClockCovariance:
        """Covariance of the clock by a fit."""
        width = SMOOTHED * self.content.cutoff * self.content.own.step
        return clock_covariance(fit.signals, fit.hessian, fit.segment.used, width)

    def clock_map(self, fit: _Fit, by: ClockCovariance) -> ClockMap:
        """The map with its covariance. Raises AnalysisError where there are too few degrees of freedom."""
        content, signals, used = self.content, fit.signals, fit.segment.used
        own = fit.segment.own[used]
        fitted = CLOCK_SIZE + sum(s.columns.shape[1] for s in signals) / len(signals)
        degrees_of_freedom = by.degrees_of_freedom - fitted
        if degrees_of_freedom < LEAST_FREEDOM:
            raise AnalysisError(
                f"{content.name}: too short: {own[-1] - own[0]:.3g} s at {content.cutoff:.3g} Hz leave "
                f"{max(degrees_of_freedom, 0.0):.1f} degrees of freedom, expected at least {LEAST_FREEDOM:g}; "
                "record for longer, or compare up to a higher --cutoff"
            )
        covariance = by.covariance * by.degrees_of_freedom / degrees_of_freedom
        effects = [
            misspecification_deviation(signals, fit.hessian, float(covariance[0, 0])),
            content.fixed_time_deviation * fixed_time_effect(signals, fit.hessian),
        ]
        if self.drift_prior is not None:
            effects.append(np.linalg.inv(fit.hessian)[:CLOCK_SIZE, 1] / self.drift_prior)
        for effect in effects:
            covariance += np.outer(effect, effect)
        if content.partial:  # the whole residual as a shift is half an interval of 95 %
            rate = np.gradient(fit.segment.own_signals, fit.segment.step, axis=0)[used]
            slope = np.sqrt(np.sum(rate**2) / np.sum(fit.segment.own_signals[used] ** 2))
            covariance[0, 0] += float(0.5 * np.sqrt(fit.residual_share) / slope) ** 2
        span = float(own[0]), float(own[-1])
        trial = fit.trial
        return ClockMap(trial.middle, trial.at, trial.drift, covariance, max(1, int(degrees_of_freedom)), span)


def refine_clock(
    content: PreparedSignals,
    offset: float,
    part: tuple[float, float],
    drift: bool = True,
    among: Mask | None = None,
) -> tuple[ClockMap, float]:
    """The clock by a rough ``offset`` [s] found on a ``part`` of the own clock [s], and the share of energy explained.

    Offset and drift, or the offset and a drift within ASSUMED_DRIFT, with their covariance. Only own samples ``among``
    (m,) [-] are used, all by default.
    Raises AnalysisError where too little overlaps, the steps do not settle, or the drift is not determined.
    """
    from scipy.ndimage import uniform_filter1d

    # own samples near which the signals change: at rest, noise would pass for information
    own = content.own
    scaled = content.own_signals / content.own_signals.std(axis=0).max()
    change = np.sum(np.gradient(scaled, own.step, axis=0) ** 2, axis=1)
    near = uniform_filter1d(change, max(3, round(CHANGE_PERIODS / content.cutoff / own.step)), mode="constant")
    used = np.asarray(near >= LEAST_CHANGE * near.max()) & content.valid
    problem = _Problem(content, used if among is None else used & among, None if drift else 0.5 * ASSUMED_DRIFT)
    middle, half = 0.5 * (part[0] + part[1]), 0.5 * (part[1] - part[0])
    trial = TrialClock(middle, middle + offset)
    while True:
        plain = problem.settled(trial, half, [np.ones(1)] * len(problem.splines))
        if middle - half <= own.start and middle + half >= own.time[-1]:
            break
        trial, half = plain.trial, 4.0 * half
    chosen, by = plain, problem.covariance_of(plain)
    try:
        white = problem.whitened(plain, half)
    except AnalysisError:  # whitened, both sides have nothing in common
        pass
    else:
        if (other := problem.covariance_of(white)).upper_variance < by.upper_variance:
            chosen, by = white, other
    clock = problem.clock_map(chosen, by)
    low, high = clock.drift_interval
    if drift and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{content.name}: too short for a drift: {clock.span[1] - clock.span[0]:.3g} s determine it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone, which takes the drift to "
            f"be within {ASSUMED_DRIFT / PPM:g} ppm"
        )
    return clock, 1.0 - plain.residual_share


@dataclass(frozen=True)
class AlignedClock:
    """A clock's map, how it was found, from what, and how much of the signal it explains (None: edges alone)."""

    clock: Annotated[ClockMap, INLINE]
    method: Annotated[str, Key()]
    content: Annotated[str, Key("", "by")]
    explained: Annotated[float | None, Key()]
    findings: Annotated[tuple[str, ...], Key()] = ()
    """Gaps in the records, and what speaks against the match, as text."""


def by_correlation(shared: SharedSignals, drift: bool = True) -> AlignedClock:
    """Align by all of the record. Raises AnalysisError, saying why, where the data do not determine the clock."""
    content = prepare(shared)
    clock, explained = refine_clock(content, *search_lag(content), drift)
    return AlignedClock(clock, "correlation", shared.name, explained, content.findings)
