"""The shipped two-joint arms: published first moments, textbook equations of the double pendulum, hanging at zero."""

import numpy as np
import pytest

from balance.balancing import conditions
from balance.balancing.sizing import exact_sizing
from balance.dynamics.regressor import torque_regressor
from balance.mechanism.mjcf_parser import load_mechanism

ARMS = {
    "two-joint-arm-a0": (0.3, 0.3491, 0.1111, 0.053470810264216295, 0.02392374528789766, 0.6043459469186889),
    "two-joint-arm-c1": (0.2, 0.2298, 0.1600, 0.031887199591513114, 0.05086984812807257, 0.6255677234174437),
}
"""l1 [m], m1 r1 + m2 l1, m2 r2 [kg m], inertias about the joints [kg m2], m2 [kg], as published."""


@pytest.fixture(params=list(ARMS))
def arm(request):
    """A shipped arm and its published parameters."""
    return load_mechanism(request.param), ARMS[request.param]


def test_first_moments_as_published(arm):
    """The left-hand sides of the balance conditions are the published first moments."""
    mechanism, (length, first, second, *_) = arm
    found = conditions.balance_conditions(mechanism)
    values = dict(zip([found.text(i) for i in range(found.rank)], found.values(), strict=True))
    assert values[f"mcx[link_1] + {length:g} m[link_2] = 0"] == pytest.approx(first, abs=6e-5)
    assert values["mcx[link_2] = 0"] == pytest.approx(second, abs=6e-5)


def test_equations_of_the_double_pendulum(arm):
    """Torques at random states are those of the textbook equations, q1 = 0 hanging down, q2 relative to link 1."""
    mechanism, (l1, _, _, i1, i2, m2) = arm
    q, v, a = np.random.default_rng(1).normal(size=(3, 20, 2))
    torque = torque_regressor(mechanism, q, v, a) @ mechanism.pi
    p1 = mechanism.pi[1] + l1 * m2
    p2, g = mechanism.pi[11], 9.81
    both, sine, cosine = q.sum(axis=1), np.sin(q[:, 1]), np.cos(q[:, 1])
    weight = g * p2 * np.sin(both)
    coriolis = p2 * l1 * sine
    expected_1 = (
        (i1 + i2 + m2 * l1**2 + 2 * p2 * l1 * cosine) * a[:, 0] + (i2 + p2 * l1 * cosine) * a[:, 1]
        - coriolis * v[:, 1] * (2 * v[:, 0] + v[:, 1]) + g * p1 * np.sin(q[:, 0]) + weight
    )  # fmt: skip
    expected_2 = (i2 + p2 * l1 * cosine) * a[:, 0] + i2 * a[:, 1] + coriolis * v[:, 0] ** 2 + weight
    np.testing.assert_allclose(torque, np.stack([expected_1, expected_2], axis=1), atol=1e-8)


def test_counter_masses_at_100_mm(arm):
    """Counter-masses 100 mm behind the joints balance the arm; the inner one carries the outer one too."""
    mechanism, (l1, *_) = arm
    inner, outer = exact_sizing(conditions.balance_conditions(mechanism), mechanism).counter_masses
    p1 = mechanism.pi[1] + l1 * mechanism.pi[10]
    assert outer.mass == pytest.approx(mechanism.pi[11] / 0.1)
    assert inner.mass == pytest.approx((p1 + l1 * outer.mass) / 0.1)
