"""Hum of the mains and its harmonics: found in the rest, where its phase is known, and extrapolated into the motion."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from balance.arrays import Floats, upper_median

from .noise_floor import squared_magnitudes

MAINS_HZ = (50.0, 60.0)
OFF_HZ = 0.15
"""Standard deviation of a large grid's frequency about its nominal one."""
OWN_HZ = 1.05
"""By how much a small grid or a generator may be off."""
OWN_SURE = 50.0
"""Logarithm of the likelihood by which lines of such a frequency must explain more than those of a large grid."""
HARMONICS = 8
SHORTEST_S = 0.12
"""Rest from which lines of the mains are told from each other: six periods."""
_SIGNIFICANT = 25.0
"""Power of a line over its variance from which it is taken out: by chance once in a million."""
_ROUNDS, _LEAST_ROUNDS, _SETTLED = 24, 4, 0.3
"""Steps to the frequency of the lines, at most and at least; its standard deviations below which one is the last."""
_TRIED = 141
_LOG_2 = float(np.log(2.0))
_FINER = 4
"""How much closer than one period a record frequencies are looked at."""


@dataclass(frozen=True)
class Lines:
    """Sine waves of one fundamental, with their covariance."""

    hz: float
    """Fundamental."""
    orders: Floats
    """(h,) [-]"""
    shares: Floats
    """Of cosine and sine, (2 h,) [unit]."""
    root: Floats
    """Of the covariance of the shares and the fundamental, (2 h + 1, 2 h + 1)."""

    @classmethod
    def fitted(cls, resting: Floats, rate_hz: float) -> "Lines | None":
        """From a rest (n,) [unit] that begins at time zero; None where it shows no mains, or is too short."""
        from scipy.fft import next_fast_len, rfft

        if len(resting) / rate_hz < SHORTEST_S:
            return None
        slow = np.vander(np.linspace(-1.0, 1.0, len(resting)), 2)
        flat = resting - slow @ _solved(slow, resting)
        power = squared_magnitudes(rfft(flat, 2 * next_fast_len(_FINER * len(flat) // 2, real=True)))
        about = _periodogram(flat)
        best = max((_candidate(flat, power, about, rate_hz, hz) for hz in MAINS_HZ), key=lambda found: found[0])
        _, hz, orders = best
        if not len(orders):
            return None
        count, size = len(resting), 2 * len(orders)
        for done in range(_ROUNDS):  # Gauss-Newton in the frequency
            waves = _waves(count, rate_hz, hz, orders)
            shares = _solved(np.column_stack([waves, slow]), resting)[:size]
            design = np.column_stack([waves, _by_frequency(waves, rate_hz, orders, shares), slow])
            left = resting - waves @ shares
            weights = _weights(_periodogram(left - slow @ _solved(slow, left)), count, rate_hz, hz, orders)
            scale = np.concatenate([np.repeat(weights, 2), [weights.mean()], np.full(slow.shape[1], weights.mean())])
            information = design.T @ design / np.sqrt(np.outer(scale, scale))
            off = hz - min(MAINS_HZ, key=lambda mains: abs(mains - hz))
            prior = (OFF_HZ if abs(off) <= 3.0 * OFF_HZ else OWN_HZ) ** -2
            information[size, size] += prior
            score = design.T @ left / scale
            score[size] -= prior * off
            covariance = np.linalg.inv(information)
            step = float(np.clip((covariance @ score)[size], -0.1, 0.1))
            hz += step
            if done >= _LEAST_ROUNDS - 1 and abs(step) < _SETTLED * covariance[size, size] ** 0.5:
                break
        shares = _solved(np.column_stack([_waves(count, rate_hz, hz, orders), slow]), resting)[:size]
        known = covariance[: size + 1, : size + 1]
        return cls(hz, orders, shares, np.linalg.cholesky(known + 1e-18 * np.trace(known) * np.eye(len(known))))

    def at(self, count: int, rate_hz: float) -> Floats:
        """The lines in so many samples since the rest began, (n,) [unit]."""
        return np.asarray(_waves(count, rate_hz, self.hz, self.orders) @ self.shares)

    def errors(self, count: int, rate_hz: float) -> Floats:
        """By how much they may be wrong in samples (n,): independent courses of a standard deviation, (j, n) [unit]."""
        waves = _waves(count, rate_hz, self.hz, self.orders)
        design = np.column_stack([waves, _by_frequency(waves, rate_hz, self.orders, self.shares)])
        return np.asarray((design @ self.root).T)


def _solved(design: Floats, values: Floats) -> Floats:
    """Least squares of values (n,) by nearly orthogonal columns (n, k), (k,)."""
    return np.linalg.solve(design.T @ design, design.T @ values)


def _waves(count: int, rate_hz: float, hz: float, orders: Floats) -> Floats:
    """Cosine and sine of each order in samples (n,), each in the middle of its period, (n, 2 h) [-]."""
    first = np.exp(2j * np.pi * hz / rate_hz * (np.arange(count) + 0.5))
    powers = [first]
    while len(powers) < orders.max():
        powers.append(powers[-1] * first)
    chosen = np.column_stack([powers[int(order) - 1] for order in orders])
    return chosen.view(float)


def _by_frequency(waves: Floats, rate_hz: float, orders: Floats, shares: Floats) -> Floats:
    """Derivative of lines by their fundamental, (n,) [unit/Hz]."""
    cosine, sine = shares.reshape(-1, 2).T
    turned = np.stack([orders * sine, -orders * cosine], axis=1).ravel()
    return np.asarray(2.0 * np.pi * (np.arange(len(waves)) + 0.5) / rate_hz * (waves @ turned))


def _candidate(flat: Floats, power: Floats, about: Floats, rate_hz: float, mains: float) -> tuple[float, float, Floats]:
    """How significant lines of one mains are in what has no slope (n,), by its power (m,) and its periodogram (k,), at
    the likeliest fundamental, and the orders of those that are.
    """
    orders = np.arange(1, min(HARMONICS, int(0.38 * rate_hz / mains)) + 1).astype(float)
    if not len(orders):  # sampled too slowly to show any
        return 0.0, mains, orders
    off, count = np.linspace(-OWN_HZ, OWN_HZ, _TRIED), len(flat)
    places = np.outer(mains + off, orders) * (2.0 * (len(power) - 1) / rate_hz)
    below = places.astype(int)
    powers = power[below] + (places - below) * (power[below + 1] - power[below])
    near = np.where(np.abs(off) <= 3.0 * OFF_HZ, powers.sum(axis=1) * np.exp(-0.5 * (off / OFF_HZ) ** 2), 0.0)
    likelihood = (powers / count / _weights(about, count, rate_hz, mains, orders, _median)).sum(axis=1)
    best, own = int(np.argmax(near)), int(np.argmax(likelihood))
    best = own if likelihood[own] > likelihood[best] + OWN_SURE else best
    hz = float(mains + off[best])
    rough = 2.0 / count * powers[best] / _weights(about, count, rate_hz, hz, orders)
    if count >= rate_hz and rough.max() < 0.5 * _SIGNIFICANT:  # over many periods that is the ratio below, to a third
        return 0.0, hz, orders[:0]
    waves = _waves(count, rate_hz, hz, orders)
    shares = _solved(waves, flat)
    variance = _weights(_periodogram(flat - waves @ shares), count, rate_hz, hz, orders) * 2.0 / count
    ratio = (shares.reshape(-1, 2) ** 2).sum(axis=1) / np.maximum(variance, 1e-300)
    return float(ratio[ratio > _SIGNIFICANT].sum()), hz, orders[ratio > _SIGNIFICANT]


def _periodogram(left: Floats) -> Floats:
    """Variance of white noise with the density that what is left (n,) has at even frequencies, (k,) [unit^2]."""
    from scipy.fft import next_fast_len, rfft

    count = len(left)
    return squared_magnitudes(rfft(left * _hanning(count), next_fast_len(4 * count, real=True))) / (0.375 * count)


def _weights(
    power: Floats, count: int, rate_hz: float, hz: float, orders: Floats, of: Callable[[Floats], Any] = np.mean
) -> Floats:
    """Mean of a periodogram (k,) of ``count`` samples around each order, (h,) [unit^2], or what ``of`` says of it."""
    from scipy.fft import next_fast_len

    step, reach = rate_hz / next_fast_len(4 * count, real=True), max(0.4 * hz, 3.0 * rate_hz / count)
    ends = np.maximum(np.ceil(np.stack([orders * hz - reach, orders * hz + reach]) / step).astype(int), 0)
    return np.array([max(float(of(power[first:last])), 1e-300) for first, last in ends.T])


def _median(power: Floats) -> float:
    """Mean of a periodogram (k,) of noise by its median, which lines do not move [unit^2]."""
    return upper_median(power) / _LOG_2


_hanning = lru_cache(maxsize=4)(np.hanning)
