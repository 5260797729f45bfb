"""Loads reduced to the crank."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from balance.drives.machine import LAWS, Load

KINDS = [*LAWS, "table"]
TABLE = PchipInterpolator(np.linspace(-1.0, 8.0, 30), np.sin(np.linspace(-1.0, 8.0, 30)))


def load(kind, value=1.7):
    """A load of a kind."""
    return Load("x", kind, 0, value, TABLE if kind == "table" else None)


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
            torque = load(kind, value).torque(phi, gain, rate)
            assert torque * rate == pytest.approx(-law(gain * rate) * gain * rate, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_slope_is_the_derivative(kind):
    """dQ/du' by central differences."""
    one, h = load(kind), 1e-6
    for gain in (0.6, -1.3):
        difference = (one.torque(0.8, gain, 2.0 + h) - one.torque(0.8, gain, 2.0 - h)) / (2 * h)
        assert one.slope(gain, 2.0) == pytest.approx(difference, abs=1e-8)
