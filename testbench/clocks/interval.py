"""How sure a fitted clock is.

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

import numpy as np

from balance.arrays import Floats, Indices

from .equations import MOVES, Signal, places
from .shared import Flags

SMOOTHED = 0.125
"""Width over which the spectrum is smoothed, as a share of the highest frequency compared."""

LEAST_SHARE = 0.02
"""Of the covariance by one side's rates, below which that by the rates of both is chance."""


@dataclass(frozen=True)
class Scatter:
    """Of ``at`` and drift by the residual, before the degrees of freedom of what is fitted are taken off."""

    covariance: Floats
    """By the rates of both sides, (2, 2)."""
    most: float
    """Variance of ``at`` by the reference's rates alone [s2]: noise in them makes it too large, never too small."""
    freedom: float


def scatter(signals: list[Signal], bend: Floats, used: Flags, width: float) -> Scatter:
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
    return Scatter(both if told else alone, float(alone[0, 0]), float(freedom))


def lacked(signals: list[Signal], bend: Floats, variance: float) -> Floats:
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


def led(signals: list[Signal], bend: Floats) -> Floats:
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
