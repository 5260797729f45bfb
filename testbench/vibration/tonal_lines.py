"""Hum of the mains and its harmonics: found in the rest, where its phase is known, and extrapolated into the motion."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

MAINS_HZ = (50.0, 60.0)
OFF_HZ = 0.15
"""Standard deviation of the mains' frequency about its nominal one."""
HARMONICS = 8
SHORTEST_S = 0.12
"""Rest from which lines of the mains are told from each other: six periods."""
_SIGNIFICANT = 25.0
"""Power of a line over its variance from which it is taken out: by chance once in a million."""
_TRIED = 61


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
        time = (np.arange(len(resting)) + 0.5) / rate_hz
        if len(resting) / rate_hz < SHORTEST_S:
            return None
        best = max((_candidate(resting, time, rate_hz, hz) for hz in MAINS_HZ), key=lambda found: found[0])
        _, hz, orders = best
        if not len(orders):
            return None
        slow = _slow(time)
        for _ in range(4):  # Gauss-Newton in the frequency
            waves = _waves(time, hz, orders)
            shares = np.linalg.lstsq(np.column_stack([waves, slow]), resting, rcond=None)[0][: 2 * len(orders)]
            design = np.column_stack([waves, _by_frequency(time, hz, orders, shares), slow])
            left = resting - waves @ shares
            weights = _weights(left - slow @ np.linalg.lstsq(slow, left, rcond=None)[0], rate_hz, hz, orders)
            normal = design.T @ design
            scale = np.concatenate([np.repeat(weights, 2), [weights.mean()], np.full(slow.shape[1], weights.mean())])
            information = normal / np.sqrt(np.outer(scale, scale))
            nominal = min(MAINS_HZ, key=lambda mains: abs(mains - hz))
            information[2 * len(orders), 2 * len(orders)] += 1.0 / OFF_HZ**2
            score = design.T @ left / scale
            score[2 * len(orders)] += (nominal - hz) / OFF_HZ**2
            covariance = np.linalg.inv(information)
            hz += float(np.clip((covariance @ score)[2 * len(orders)], -0.1, 0.1))
        waves = _waves(time, hz, orders)
        shares = np.linalg.lstsq(np.column_stack([waves, slow]), resting, rcond=None)[0][: 2 * len(orders)]
        known = covariance[: 2 * len(orders) + 1, : 2 * len(orders) + 1]
        return cls(hz, orders, shares, np.linalg.cholesky(known + 1e-18 * np.trace(known) * np.eye(len(known))))

    def at(self, time: Floats) -> Floats:
        """The lines at instants (n,) [s] after the rest began, (n,) [unit]."""
        return np.asarray(_waves(time, self.hz, self.orders) @ self.shares)

    def errors(self, time: Floats) -> Floats:
        """By how much they may be wrong at instants (n,): independent courses of one standard deviation, (j, n)."""
        design = np.column_stack(
            [_waves(time, self.hz, self.orders), _by_frequency(time, self.hz, self.orders, self.shares)]
        )
        return np.asarray((design @ self.root).T)


def _waves(time: Floats, hz: float, orders: Floats) -> Floats:
    phase = 2.0 * np.pi * hz * np.outer(time, orders)
    return np.stack([np.cos(phase), np.sin(phase)], axis=2).reshape(len(time), -1)


def _by_frequency(time: Floats, hz: float, orders: Floats, shares: Floats) -> Floats:
    cosine, sine = shares.reshape(-1, 2).T
    phase = 2.0 * np.pi * hz * np.outer(time, orders)
    return np.asarray((2.0 * np.pi * time[:, None] * orders * (sine * np.cos(phase) - cosine * np.sin(phase))).sum(1))


def _slow(time: Floats) -> Floats:
    return np.column_stack([np.ones_like(time), time - time.mean()])


def _candidate(resting: Floats, time: Floats, rate_hz: float, mains: float) -> tuple[float, float, Floats]:
    """How significant lines of one mains are, at the likeliest fundamental, and the orders of those that are."""
    orders = np.arange(1, min(HARMONICS, int(0.38 * rate_hz / mains)) + 1).astype(float)
    slow = _slow(time)
    flat = resting - slow @ np.linalg.lstsq(slow, resting, rcond=None)[0]
    tried = mains + np.linspace(-3.0, 3.0, _TRIED) * OFF_HZ
    powers = np.abs(np.exp(-2j * np.pi * np.outer(np.outer(tried, orders), time)) @ flat).reshape(len(tried), -1) ** 2
    hz = float(tried[np.argmax(powers.sum(axis=1) * np.exp(-0.5 * ((tried - mains) / OFF_HZ) ** 2))])
    waves = _waves(time, hz, orders)
    shares = np.linalg.lstsq(waves, flat, rcond=None)[0]
    variance = _weights(flat - waves @ shares, rate_hz, hz, orders) * 2.0 / len(time)
    ratio = (shares.reshape(-1, 2) ** 2).sum(axis=1) / np.maximum(variance, 1e-300)
    return float(ratio[ratio > _SIGNIFICANT].sum()), hz, orders[ratio > _SIGNIFICANT]


def _weights(left: Floats, rate_hz: float, hz: float, orders: Floats) -> Floats:
    """Variance of white noise with the density that what is left has around each order, (h,) [unit^2]."""
    power = np.abs(np.fft.rfft(left * np.hanning(len(left)), 4 * len(left))) ** 2 / (0.375 * len(left))
    frequency = np.fft.rfftfreq(4 * len(left), 1.0 / rate_hz)
    near = [np.abs(frequency - order * hz) < max(0.4 * hz, 3.0 * rate_hz / len(left)) for order in orders]
    return np.array([max(float(power[some].mean()), 1e-300) for some in near])
