"""Noise at rest: power and degrees of freedom against closed forms, steps, and what is too short."""

import numpy as np
import pytest

from testbench.errors import AnalysisError
from testbench.signal.filters import Band
from testbench.vibration import Noise

RATE = 1000.0
PASSED = 0.875 * (np.pi / 8) / np.sin(np.pi / 8)
"""Of white noise below its edge a band passes the integral of (1 + x^8)^-2."""


def test_white_noise():
    """White noise of standard deviation 2 has the power 4 in all frequencies, and a fifth of it in a fifth of them."""
    noise = Noise.of(2.0 * np.random.default_rng(1).normal(size=100_000), RATE)
    assert noise.power(None) == pytest.approx(4.0, rel=0.02)
    assert noise.power(Band(0.0, 100.0)) == pytest.approx(0.8 * PASSED, rel=0.06)
    assert noise.degrees_of_freedom(Band(0.0, 100.0)) == pytest.approx(2 * 100.0 * 100.0, rel=0.15)


def test_how_well_a_short_rest_knows():
    """The power of many short stretches scatters as its degrees of freedom say: sqrt(2 / freedom)."""
    rng, band = np.random.default_rng(2), Band(0.0, 100.0)
    found = [Noise.of(rng.normal(size=300), RATE) for _ in range(300)]
    powers = np.array([noise.power(band) for noise in found])
    freedom = np.median([noise.degrees_of_freedom(band) for noise in found])
    assert powers.mean() == pytest.approx(0.2 * PASSED, rel=0.1)
    assert powers.std() / powers.mean() == pytest.approx(np.sqrt(2.0 / freedom), rel=0.2)


def test_coloured_noise():
    """Noise that is not white has its power where it is: a band elsewhere holds little of it."""
    slow = Band(0.0, 30.0).filtered(np.random.default_rng(3).normal(size=20_000), RATE)
    noise = Noise.of(slow, RATE)
    assert noise.power(Band(0.0, 60.0)) == pytest.approx(slow.var(), rel=0.1)
    assert noise.power(Band(100.0, 300.0)) < 1e-3 * slow.var()


def test_steps():
    """A channel whose steps are coarser than its noise shows none at rest; its steps are noise of q^2 / 12."""
    noise = Noise.of(np.zeros(500), RATE, step=0.1)
    assert noise.power(None) == pytest.approx(0.1**2 / 12.0)
    fine = Noise.of(np.random.default_rng(4).normal(size=500), RATE, step=1e-3)
    assert fine.power(None) == pytest.approx(Noise.of(np.random.default_rng(4).normal(size=500), RATE).power(None))


def test_too_short():
    """A handful of samples make no spectrum."""
    with pytest.raises(AnalysisError, match="9 samples at rest"):
        Noise.of(np.zeros(9), RATE)
