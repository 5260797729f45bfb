"""Reactions: free bodies by Pinocchio with the closures' forces as outer ones, and a hand-sized case."""

import numpy as np
import pinocchio
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.reactions import find_reactions
from balance.errors import ModelError
from balance.mechanism.loop_constraints import Loop
from balance.motion import Samples

from .. import models, referees


@pytest.mark.parametrize("name", [*models.SHIPPED, "driven by its rocker"])
def test_free_bodies_are_in_equilibrium(name: str) -> None:
    """Pinocchio's Newton-Euler, with the closures as outer forces, finds the same wrench in every joint.

    Along the axis of a joint without a motor nothing is left but its friction.
    """
    rocker = models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0, driven="rocker")
    mechanism = models.load(name) if name in models.SHIPPED else models.model(rocker)
    motion = referees.random_motion(mechanism, count=6)
    response = simulate(mechanism, motion)
    found = find_reactions(mechanism, motion, response)
    model = mechanism.pinocchio_model()
    data, bodies = model.createData(), mechanism.tree.bodies
    for k, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        pinocchio.forwardKinematics(model, data, q, v, a)
        outer = pinocchio.StdVec_Force()
        outer.extend([pinocchio.Force.Zero() for _ in range(model.njoints)])
        for loop in (loop for loop in mechanism.loops if isinstance(loop, Loop)):
            for end, sign in ((loop.first, 1.0), (loop.second, -1.0)):
                if end.joint >= 0:
                    body = bodies.index(end.joint) + 1
                    point = data.oMi[body].act(end.position)
                    force = pinocchio.Force(
                        sign * found.loops[loop.name if loop.name in found.loops else f"loop {loop.name}"][k]
                    )
                    in_base = pinocchio.SE3(np.eye(3), point).act(force)
                    outer[body] += data.oMi[body].actInv(in_base)
        torque = pinocchio.rnea(model, data, q, v, a, outer)
        scale = max(np.abs(np.array(list(found.joints.values()))[:, k]).max(), 1.0)
        for body, joint in enumerate(bodies):
            place = pinocchio.SE3(np.eye(3), data.oMi[body + 1].translation)
            expected = place.actInv(data.oMi[body + 1].act(data.f[body + 1])).vector
            np.testing.assert_allclose(found.joints[mechanism.coordinates[joint]][k], expected, atol=1e-9 * scale)
        if not found.couplings:
            losses = mechanism.viscous * v + mechanism.coulomb * np.sign(v)
            motors = [mechanism.coordinate_index(joint) for joint in response.torque]
            idle = np.delete(torque + losses, motors)
            np.testing.assert_allclose(idle, 0.0, atol=1e-9 * scale)


def test_a_pendulum_at_its_lowest_point() -> None:
    """Its bearing carries weight and m r w2, upwards; the base frame's y is up."""
    mechanism = models.load("serial-1r")
    still = np.zeros((1, 1))
    motion = Closure(mechanism).follow(Samples(np.zeros(1), still - np.pi / 2, still + 3.0, still, ("J1",)))
    mass, first = mechanism.parameters[0, :2]
    found = find_reactions(mechanism, motion, simulate(mechanism, motion))
    expected = mass * -mechanism.gravity + np.array([0.0, first * 9.0, 0.0])
    np.testing.assert_allclose(found.joints["J1"][0, :3], expected, atol=1e-12 * mass * 9.81)
    assert found.redundant == 0


def test_redundant_closures_are_counted() -> None:
    """A planar four-bar is closed in space: of three rows two are independent; nothing pushes out of the plane."""
    mechanism = models.load("four-bar")
    motion = referees.random_motion(mechanism, count=3)
    found = find_reactions(mechanism, motion, simulate(mechanism, motion))
    (force,) = found.loops.values()
    assert found.redundant == 1
    assert np.abs(force[:, 2]).max() < 1e-12 * np.abs(force).max()
    assert {name.rpartition("_")[0][-2:] for name in found.undetermined} == {"Fz", "Mx", "My"}
    assert {name.split("_")[1] for name in found.undetermined} == {"A0", "A", "B0", "B"}


def test_without_motors_they_are_not_determined() -> None:
    """Loops without an <actuator>: refused with what to add."""
    text = models.four_bar(0.3, 0.12, 0.31, 0.24, 1.0).replace(models.motors("crank"), "")
    mechanism = models.model(text)
    one = np.ones((1, 1))
    motion = Closure(mechanism).follow(Samples(np.zeros(1), one, one, one, ("crank",)))
    with pytest.raises(ModelError, match="the file names none: add <actuator>"):
        find_reactions(mechanism, motion, simulate(mechanism, motion))
