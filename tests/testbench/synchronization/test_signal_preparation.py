"""Residuals made white, and what is gained by it."""

import numpy as np
from scipy.signal import lfilter

from testbench.synchronization.offset_and_drift import by_correlation
from testbench.synchronization.signal_preparation import SharedSignals, whitened, whitener, with_history

from ..coverage import assert_holds
from .loggers import DRIFT, OFFSET, wave


def test_an_autoregression_is_found_again():
    """Of noise that leans on the one before it by 0.8 the filter leaves noise that does not."""
    noise = lfilter([1.0], [1.0, -0.8], np.random.default_rng(0).normal(size=20_000))
    taps = whitener(noise, np.ones(len(noise), dtype=bool), 3)
    white = whitened(noise, taps)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.03 < np.corrcoef(noise[1:], noise[:-1])[0, 1]


def test_history():
    """A sample counts where it and as many as the filter is long before it do."""
    used = np.array([1, 1, 1, 0, 1, 1, 1, 1], dtype=bool)
    assert with_history(used, 2).tolist() == [False, False, True, False, False, False, True, True]
    assert with_history(used, 0).tolist() == used.tolist()
    assert not with_history(used, 20).any()


def loud_above(seed: int) -> SharedSignals:
    """Two loggers; what one adds is differentiated twice, as steps of an encoder are, and drowns the signal above."""
    rng, signal = np.random.default_rng([seed, 3]), wave(seed, 20.0)
    there, here = np.arange(0.0, 5.0, 1e-3), np.arange(0.0, 4.4, 1e-3)
    steps = np.convolve(rng.normal(size=len(here) + 2), [1.0, -2.0, 1.0], mode="valid")
    own_signals = signal(OFFSET + (1.0 + DRIFT) * here) + 0.3 * steps
    return SharedSignals("loud", there, (signal(there)[:, None],), here, own_signals[:, None])


def test_intervals_hold_in_coloured_noise():
    """Noise nearly as loud as the signal, but above it, leaves 0.1 ms; the intervals hold as often as 95 % promises."""
    clocks = [by_correlation(loud_above(seed), drift=False).clock for seed in range(15)]
    late = [c.at_reference - (OFFSET + (1.0 + DRIFT) * c.at_own) for c in clocks]
    assert np.max(np.abs(late)) < 1e-4
    assert_holds(sum(abs(e) <= c.half_width(c.at_own) for e, c in zip(late, clocks, strict=True)), len(clocks))
