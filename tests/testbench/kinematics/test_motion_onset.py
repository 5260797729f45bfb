"""Where something moves."""

import numpy as np

from testbench.kinematics.encoder_motion import moving_interval


def test_moving():
    """The span holds the movement and little else, in spite of noise and an offset."""
    noise = 0.01 * np.random.default_rng(1).normal(size=10_000)
    signal = noise + 5.0
    signal[4000:6000] += np.sin(np.linspace(0, 6 * np.pi, 2000))
    span = moving_interval(signal, 1000.0, margin_s=0.1)
    assert 3880 < span.start <= 4000
    assert 6000 <= span.stop < 6120


def test_rest():
    """A record in which nothing moves is kept whole."""
    assert moving_interval(np.zeros(100), 10.0) == slice(0, 100)
    assert moving_interval(0.01 * np.random.default_rng(2).normal(size=1000), 10.0) == slice(0, 1000)
