"""Loads reduced to the crank."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from balance.drives.machine import KINDS, Load

TABLE = PchipInterpolator(np.linspace(-1.0, 8.0, 30), np.sin(np.linspace(-1.0, 8.0, 30)))


@pytest.mark.parametrize("kind", KINDS)
def test_power_is_force_times_the_joint_s_speed(kind):
    """Q u' = -F q' with q' = g u', for the law of each kind."""
    value, phi = 1.7, 0.8
    law = {
        "constant": lambda _: value,
        "dry": lambda v: value * np.sign(v),
        "viscous": lambda v: value * v,
        "quadratic": lambda v: value * v * abs(v),
        "table": lambda _: float(TABLE(phi)),
    }[kind]
    for gain in (0.6, -1.3, 0.0):
        for rate in (2.0, -3.0):
            torque = Load("x", kind, 0, value, TABLE).torque(phi, gain, rate)
            assert torque * rate == pytest.approx(-law(gain * rate) * gain * rate, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_slope_is_the_derivative(kind):
    """dQ/du' by central differences."""
    load, h = Load("x", kind, 0, 1.7, TABLE), 1e-6
    for gain in (0.6, -1.3):
        difference = (load.torque(0.8, gain, 2.0 + h) - load.torque(0.8, gain, 2.0 - h)) / (2 * h)
        assert load.slope(gain, 2.0) == pytest.approx(difference, abs=1e-8)
