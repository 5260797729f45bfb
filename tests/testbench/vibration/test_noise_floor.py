"""The spectrum of noise: power and degrees of freedom against closed forms, pooling, low frequencies, what is too
short."""

import numpy as np
import pytest

from testbench.signal.filters import Band
from testbench.vibration import Noise
from testbench.vibration.noise_floor import Segment

RATE = 1000.0
PASSED = 0.875 * (np.pi / 8) / np.sin(np.pi / 8)
"""Of white noise below its edge a band passes the integral of (1 + x^8)^-2."""


def white(seed: int, count: int, size: float = 1.0) -> Segment:
    """A rest in white noise."""
    return Segment(size * np.random.default_rng(seed).normal(size=count), RATE)


def test_white_noise():
    """White noise of standard deviation 2 has the power 4 in all frequencies, and a fifth of it in a fifth of them."""
    noise = Noise.of([white(1, 20_000, 2.0)])
    assert noise.power(None)[0] == pytest.approx(4.0, rel=0.03)
    assert noise.power(Band(0.0, 100.0))[0] == pytest.approx(0.8 * PASSED, rel=0.08)


def test_how_well_it_is_known():
    """The power of many rests scatters no more than its degrees of freedom say, which count every cell as a narrow
    mode.
    """
    band = Band(0.0, 100.0)
    powers, freedom = np.array([Noise.of([white(k, 400)]).power(band) for k in range(200)]).T
    assert powers.std() / powers.mean() <= np.sqrt(2.0 / np.median(freedom))
    assert powers.std() / powers.mean() == pytest.approx(np.sqrt(2.0 / np.median(freedom)), rel=0.6)


def test_pooling():
    """Four rests know as much as one of four times their degrees of freedom."""
    one, four = Noise.of([white(1, 400)]), Noise.of([white(k, 400) for k in range(4)])
    assert four.freedom == pytest.approx(4.0 * one.freedom, rel=0.4)
    assert four.scatter == 0.0


def test_rests_that_disagree():
    """Rests of very different power make the next one uncertain by as much."""
    noise = Noise.of([white(k, 400, size) for k, size in enumerate((1.0, 1.0, 8.0, 8.0))])
    assert noise.scatter > 1.0


@pytest.mark.parametrize(("slope", "most"), [(0, 0.75), (1, 2.0)])
def test_below_the_first_frequency(slope, most):
    """Below 1 / T the density rises like that of the octaves above: as a random walk does, or hardly."""
    rng = np.random.default_rng(2)
    values = rng.normal(size=400) if slope == 0 else np.cumsum(rng.normal(size=400))
    noise = Noise.of([Segment(values, RATE)])
    below, at_rest = noise.draws(noise.lowest_hz * np.array([0.25, 1.0]), np.ones(2), 4000, rng).T ** 2
    assert 0.0 <= np.median(np.log(below / at_rest)) / np.log(4.0) <= most + 0.3


def test_steps():
    """The density is nowhere less than that of the steps."""
    noise = Noise.of([Segment(np.zeros(500), RATE)], 1e-4)
    assert noise.density == pytest.approx(np.full_like(noise.density, 1e-4))


@pytest.mark.parametrize("values", [np.zeros(9), np.zeros(20)])
def test_too_short(values):
    """A handful of samples make no spectrum."""
    assert Noise.of([Segment(values, RATE)]) is None


def test_a_rig_that_states_none():
    """A stated noise of zero is none."""
    assert Noise.stated(0.0, RATE) is None
    assert Noise.stated(2.0, RATE).power(None)[0] == pytest.approx(4.0, rel=0.01)
