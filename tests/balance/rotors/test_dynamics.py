"""A corrected rotor in independent dynamics: it shakes its base no more, at any speed and acceleration."""

from cmath import phase
from math import cos, sin

import numpy as np
import pinocchio
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion import Samples
from balance.rotors import correction_planes
from balance.rotors.rotor import Plane, Unbalance

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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("places", [(-0.8, 0.9), (-1.0, 0.1, 0.7)])
def test_no_force_and_no_tilting_moment_is_left(seed, places):
    """Two planes or three: force and moments across the axis below 1e-10 of before, at varying speed."""
    unbalances = _rotor(seed)
    corrected = correction_planes.correct_planes(unbalances, [Plane(f"p{z}", z) for z in places]).after
    before, after = (_simulated(u) for u in (unbalances, corrected))
    assert np.abs(after.force).max() < 1e-10 * np.abs(before.force).max()
    assert np.abs(after.moment[:, :2]).max() < 1e-10 * np.abs(before.moment[:, :2]).max()


def test_pinocchio_as_referee():
    """The rate of momentum that Pinocchio finds is that of the unbalances, and vanishes with the corrections."""
    unbalances = _rotor(7)
    corrected = correction_planes.correct_planes(unbalances, [Plane("a", -0.5), Plane("b", 0.6)]).after
    expected = (sum(u.vector for u in unbalances) * (OMEGA**2 - 1j * ALPHA) * np.exp(1j * THETA)).tolist()
    size = max(abs(f) for f in expected)
    for state, force in ((unbalances, expected), (corrected, [0.0] * len(TIME))):
        model = mechanism_from_text(_mjcf(state), "rotor").pinocchio_model()
        data = model.createData()
        for q, v, a, f in zip(THETA, OMEGA, ALPHA, force, strict=True):
            args = (np.array([x]) for x in (q, v, a))
            rate = pinocchio.computeCentroidalMomentumTimeVariation(model, data, *args)
            assert abs(-rate.linear[0] - 1j * rate.linear[1] - f) < 1e-12 * size


def _simulated(unbalances):
    model = mechanism_from_text(_mjcf(unbalances), "rotor")
    turning = Samples(TIME, THETA[:, None], OMEGA[:, None], ALPHA[:, None], joints=("shaft",))
    return simulate(model, Closure(model).follow(turning))
