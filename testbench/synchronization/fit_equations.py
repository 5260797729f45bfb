"""The equations of a fit of one clock to another: what each signal says of offset, drift and factors of its own.

y(t) = c + e t + Z(t) g + X(s) b + f(s) at s = p + (1 + d)(t - t0), f known, both sides behind one filter. Noise on both
sides leaves p unbiased, but not the first-order bend of the sum of squares: second derivatives are therefore included.

How sure a fitted clock is.

The error of the fit is the sum of L(t) r(t), L its influence and r the residual. Where r is stationary, its variance is
the integral of L(f)* S(f) L(f), S from the whitened residual, smoothed over frequency (prewhitened spectral estimator:
Andrews and Monahan, Econometrica 60, 1992), here with one L from the rates of each side: their noise is independent,
so that noise in a rate does not count as signal. Where r is loud when the signals are fast, as by jitter, the ratio of
White (Econometrica 48, 1980) makes up for it. What is fitted is taken off the degrees of freedom.

What the model lacks is fitted by columns of its own (sensors' inexact factors, a frame that gives way). They leave some
of it: where they move the answer by more than noise does, whose variance is the difference of the variances with and
without them (Hausman, Econometrica 46, 1978), what they leave is taken to be evenly distributed within as much.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats, Indices

from .signal_preparation import Flags
from .signal_preparation import whitened as filtered

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

MOVES = 2
"""Parameters of the clock: when its middle was, and its drift."""


@dataclass(frozen=True)
class PiecePosition:
    """Where the own clock is thought to run on the reference's: ``at`` + (1 + drift) (own - middle)."""

    middle: float
    at: float
    drift: float = 0.0

    def instants(self, own: Floats) -> Floats:
        """Own instants on the reference's clock, (n,) [s]."""
        return self.at + (1.0 + self.drift) * (own - self.middle)


@dataclass(frozen=True)
class Segment:
    """A stretch of the own clock without holes, and which of its samples count."""

    own: Floats
    """(n,) [s]"""
    seen: Floats
    """(n, signals)"""
    beside: Floats
    """What else moves the signals, on the own clock, (n, k)."""
    used: Flags
    """(n,)"""

    @property
    def step(self) -> float:
        """Between samples [s]."""
        return float(self.own[-1] - self.own[0]) / (len(self.own) - 1)


class Signal:
    """One signal of the own clock against its columns at a place; constant, trend and factors are solved for.

    ``along`` columns, the last of the spline's, like those beside, are what the model of the others lacks.
    """

    def __init__(
        self, stretch: Segment, index: int, spline: "BSpline", place: PiecePosition, taps: Floats, along: int = 0
    ) -> None:
        at, used, lever = place.instants(stretch.own), stretch.used, stretch.own - place.middle
        self.lever = np.column_stack([np.ones_like(lever), lever])[used]
        beside = np.column_stack([np.ones_like(lever), lever / np.abs(lever).max(), stretch.beside])
        self.still = beside.shape[1]
        free = spline.c.shape[1] - 1 - along
        self.lacking = np.r_[np.zeros(2), np.ones(self.still - 2), np.zeros(free), np.ones(along)].astype(bool)
        raw = [np.asarray(spline(at, order)) for order in (0, 1, 2)]
        value, rate, bow = (filtered(x, taps)[used] for x in raw)
        self.columns = np.column_stack([filtered(beside, taps)[used], value[:, 1:]])
        self.seen = filtered(stretch.seen[:, index], taps)[used]
        self.factors = np.linalg.lstsq(self.columns, self.seen - value[:, 0], rcond=None)[0]
        share = np.r_[1.0, self.factors[self.still :]]
        self.rates, self.fixed_rate, self.speed, self.bow = rate[:, 1:], rate[:, 0], rate @ share, bow @ share
        self.left = stretch.seen[:, index] - raw[0] @ share - beside @ self.factors[: self.still]
        """Residual before the filter, of all samples of the stretch."""
        whitened = filtered(self.left, taps)
        self.residual = whitened[used]
        self.seen_speed = self.speed + np.gradient(whitened, stretch.step)[used]

    @cached_property
    def weight(self) -> float:
        """1 / mean square of the residual."""
        return 1.0 / max(float(np.mean(self.residual**2)), 1e-12 * float(np.mean(self.seen**2)))

    def design(self, speed: Floats) -> Floats:
        """How the signal answers to the clock's parameters and to its own, (n, p), at its rates ``speed`` (n,)."""
        return np.column_stack([self.lever * speed[:, None], self.columns])

    def equations(self) -> tuple[Floats, Floats]:
        """Gradient (p,) and bend (p, p) of half the weighted sum of squares."""
        design = self.design(self.speed)
        first_order = design.T @ design
        bend, at = first_order.copy(), MOVES + self.still
        bend[:MOVES, :MOVES] -= (self.lever * (self.residual * self.bow)[:, None]).T @ self.lever
        crossed = self.lever.T @ (self.residual[:, None] * self.rates)
        bend[:MOVES, at:] -= crossed
        bend[at:, :MOVES] -= crossed.T
        if np.linalg.eigvalsh(bend).min() <= 0.0:
            bend = first_order
        return -self.weight * (design.T @ self.residual), self.weight * bend


def joined(signals: list[Signal], place: PiecePosition, loose: float | None) -> tuple[Floats, Floats]:
    """The equations of all signals: the clock's parameters are shared, the others each signal's own.

    ``loose``: standard deviation about zero within which the drift is taken to be; None: nothing is known of it.
    """
    size = int(places(signals)[-1][-1]) + 1
    gradient, bend = np.zeros(size), np.zeros((size, size))
    for signal, index in zip(signals, places(signals), strict=True):
        its_gradient, its_bend = signal.equations()
        gradient[index] += its_gradient
        bend[index[:, None], index] += its_bend
    if loose is not None:
        gradient[1] += place.drift / loose**2
        bend[1, 1] += 1.0 / loose**2
    return gradient, bend


def places(signals: list[Signal]) -> list[Indices]:
    """Where the parameters of each signal stand among all."""
    ends = MOVES + np.cumsum([s.columns.shape[1] for s in signals])
    return [np.r_[0:MOVES, end - s.columns.shape[1] : end] for s, end in zip(signals, ends, strict=True)]


SMOOTHED = 0.125
"""Width over which the spectrum is smoothed, as a share of the highest frequency compared."""

LEAST_SHARE = 0.02
"""Of the covariance by one side's rates, below which that by the rates of both is chance."""


@dataclass(frozen=True)
class ClockScatter:
    """Of ``at`` and drift by the residual, before the degrees of freedom of what is fitted are taken off."""

    covariance: Floats
    """By the rates of both sides, (2, 2)."""
    most: float
    """Variance of ``at`` by the reference's rates alone [s2]: noise in them makes it too large, never too small."""
    freedom: float


def clock_scatter(signals: list[Signal], bend: Floats, used: Flags, width: float) -> ClockScatter:
    """How the fit scatters; by the reference's rates alone where those of both tell no covariance.

    ``used`` (n,) are the samples that count, ``width`` is that of the smoothing in periods a sample.
    """
    inverse, where = np.linalg.inv(bend)[:, :MOVES], np.flatnonzero(used)
    where -= where[0]
    length = int(2 ** np.ceil(np.log2(2 * (where[-1] + 1))))
    pairs = list(zip(signals, places(signals), strict=True))
    left = np.array([s.residual for s in signals])
    one, other = (
        np.array([s.weight * s.design(speed) @ inverse[index] for (s, index), speed in zip(pairs, speeds, strict=True)])
        for speeds in ([s.speed for s in signals], [s.seen_speed for s in signals])
    )
    said, first, second = (_spectra(x, where, length) for x in (left[:, :, None], one, other))
    twice = np.full(first.shape[1], 2.0 / length)
    twice[[0, -1]] = 1.0 / length
    both, alone, shares = np.zeros((MOVES, MOVES)), np.zeros((MOVES, MOVES)), np.zeros(first.shape[1])
    for i in range(len(signals)):
        for j in range(len(signals)):
            density = _smoothed(said[i, :, 0] * said[j, :, 0].conj(), width * length) / len(where)
            heard = twice[:, None] * first[i].conj()
            both += np.real(np.einsum("k,ka,kb->ab", density, heard, second[j]))
            alone += np.real(np.einsum("k,ka,kb->ab", density, heard, first[j]))
            shares += np.real(_smoothed(heard[:, 0] * first[j, :, 0], width * length) * density)
    louder = np.sqrt(_louder(one, left))
    both, alone = (0.5 * (c + c.T) * np.outer(louder, louder) for c in (both, alone))
    freedom = 2.0 * shares.sum() ** 2 / np.sum(shares**2) * len(where) / length
    told = np.linalg.eigvalsh(both / np.sqrt(np.outer(np.diag(alone), np.diag(alone)))).min() > LEAST_SHARE
    return ClockScatter(both if told else alone, float(alone[0, 0]), float(freedom))


def lacking_evidence(signals: list[Signal], bend: Floats, variance: float) -> Floats:
    """Standard deviations of ``at`` and drift by what the columns leave of what the model lacks, (2,)."""
    lacking, factors = np.zeros(len(bend), dtype=bool), np.zeros(len(bend))
    for signal, index in zip(signals, places(signals), strict=True):
        lacking[index[MOVES:]], factors[index[MOVES:]] = signal.lacking, signal.factors
    if not lacking.any():
        return np.zeros(MOVES)
    without = np.linalg.inv(bend[~lacking][:, ~lacking])
    moved = (without @ bend[~lacking][:, lacking] @ factors[lacking])[:MOVES]
    by_noise = variance * (1.0 - without[0, 0] / np.linalg.inv(bend)[0, 0])
    beyond = max(0.0, 1.0 - by_noise / max(float(moved[0] ** 2), 1e-300))
    return np.asarray(moved * np.sqrt(beyond / 3.0))


def lead_interval(signals: list[Signal], bend: Floats) -> Floats:
    """By how much later ``at`` and drift are for a fixed part that came later, (2,)."""
    joint = np.zeros(len(bend))
    for signal, index in zip(signals, places(signals), strict=True):
        joint[index] += signal.weight * (signal.design(signal.speed).T @ signal.fixed_rate)
    return np.asarray(np.linalg.solve(bend, joint)[:MOVES])


def _spectra(values: Floats, where: Indices, length: int) -> Floats:
    """Of values (signals, n, k) at samples ``where`` (n,), zero elsewhere, (signals, frequencies, k)."""
    padded = np.zeros((len(values), length, values.shape[2]))
    padded[:, where] = values
    return np.asarray(np.fft.rfft(padded, axis=1))


def _louder(influence: Floats, left: Floats) -> Floats:
    """How much more the scatter counts than if it were even in time, at least 1, (2,)."""
    total = np.einsum("snm,sn->nm", influence, left)
    even = np.einsum("snm,tnm,st->m", influence, influence, left @ left.T / left.shape[1])
    return np.maximum(1.0, np.sum(total**2, axis=0) / np.maximum(even, 1e-300))


def _smoothed(spectrum: Floats, width: float) -> Floats:
    """Averaged over a triangle ``width`` bins wide at its base, mirrored at the ends."""
    half = max(1, min(round(0.5 * width), len(spectrum) - 2))
    kernel = np.bartlett(2 * half + 1)
    mirrored = [np.conj(spectrum[half:0:-1]), spectrum, np.conj(spectrum[-2 : -half - 2 : -1])]
    return np.asarray(np.convolve(np.concatenate(mirrored), kernel / kernel.sum(), mode="valid"))
