"""Two loggers that see the same signal, each with its own clock, jitter and noise."""

import numpy as np

from testbench.synchronization.signal_preparation import SharedSignals

OFFSET, DRIFT = 0.6, 30e-6
"""reference = OFFSET + (1 + DRIFT) own [s]."""


def wave(seed: int, highest: float = 40.0):
    """A smooth random signal of unit size, as a function of the reference's time."""
    rng = np.random.default_rng([seed, 1])
    omega, phase = 2 * np.pi * rng.uniform(1.0, highest, 60), rng.uniform(0, 2 * np.pi, 60)
    size = rng.normal(size=60) / np.sqrt(30.0)
    return lambda t: np.sin(np.multiply.outer(t, omega) + phase) @ size


def pair(
    seed: int, seconds: float = 20.0, jitter: float = 1e-3, noise: float = 0.02, rate: float = 1000.0
) -> SharedSignals:
    """A reference and another logger whose time stamps jitter by ``jitter`` [s]."""
    rng, signal = np.random.default_rng([seed, 2]), wave(seed)
    there = np.arange(0.0, seconds, 1.0 / rate)
    here = np.arange(0.0, seconds - OFFSET, 1.0 / rate)
    own_signals = signal(OFFSET + (1.0 + DRIFT) * here) + noise * rng.normal(size=len(here))
    first = signal(there) + noise * rng.normal(size=len(there))
    stamped = here + jitter * rng.normal(size=len(here))
    return SharedSignals("pair", there, (first[:, None],), stamped, own_signals[:, None])


def plain(reference: np.ndarray, own: np.ndarray, rate: float = 1000.0) -> SharedSignals:
    """Two recorded signals (n,) at one rate."""
    one, other = np.arange(len(reference)) / rate, np.arange(len(own)) / rate
    return SharedSignals("plain", one, (reference[:, None],), other, own[:, None])
