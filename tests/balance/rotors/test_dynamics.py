"""A corrected rotor in independent dynamics: it shakes its base no more, at any speed and acceleration."""

from cmath import phase
from math import cos, sin

import numpy as np
import pinocchio
import pytest

from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.rotors.rotor import Plane, Unbalance, correct_planes

TIME = np.linspace(0.0, 1.0, 60)
THETA, OMEGA, ALPHA = 50 * TIME + np.sin(9 * TIME), 50 + 9 * np.cos(9 * TIME), -81 * np.sin(9 * TIME)


def _mjcf(unbalances):
    """A shaft along z with each unbalance as a mass at 0.1 m."""
    masses = ""
    for i, u in enumerate(unbalances):
        x, y = 0.1 * cos(phase(u.vector)), 0.1 * sin(phase(u.vector))
        inertial = f'<inertial pos="0 0 0" mass="{abs(u.vector) / 0.1!r}" diaginertia="1e-4 1e-4 1e-4"/>'
        masses += f'<body name="{i}" pos="{x!r} {y!r} {u.at!r}">{inertial}</body>'
    return (
        '<mujoco model="rotor"><option gravity="0 0 0"/><worldbody><body name="base"><body name="shaft">'
        '<joint name="shaft" type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="3" diaginertia="0.1 0.1 0.05"/>'
        f"{masses}</body></body></worldbody></mujoco>"
    )


def _rotor(seed):
    rng = np.random.default_rng(seed)
    return [Unbalance(str(i), complex(*rng.normal(0, 0.05, 2)), float(rng.uniform(-1, 1))) for i in range(4)]


@pytest.mark.parametrize("places", [(-0.5, 0.6), (-1.0, 0.1, 0.7)])
def test_pinocchio_as_referee(places):
    """The rate of momentum that Pinocchio finds is that of the unbalances; with the corrections none is left.

    Nor of angular momentum across the axis; about it remains the torque of the acceleration.
    """
    unbalances = _rotor(7)
    corrected = correct_planes(unbalances, [Plane(f"p{z}", z) for z in places]).after
    expected = (sum(u.vector for u in unbalances) * (OMEGA**2 - 1j * ALPHA) * np.exp(1j * THETA)).tolist()
    size = max(abs(f) for f in expected)
    for state, force in ((unbalances, expected), (corrected, [0.0] * len(TIME))):
        model = mechanism_from_text(_mjcf(state), "rotor").pinocchio_model()
        data = model.createData()
        for q, v, a, f in zip(THETA, OMEGA, ALPHA, force, strict=True):
            args = (np.array([x]) for x in (q, v, a))
            rate = pinocchio.computeCentroidalMomentumTimeVariation(model, data, *args)
            assert abs(-rate.linear[0] - 1j * rate.linear[1] - f) < 1e-12 * size
            tilting = np.abs(rate.angular[:2]).max()
            assert tilting < 1e-12 * size or state is unbalances
