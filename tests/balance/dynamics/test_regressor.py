"""Regressors: columns against Pinocchio, the sum over bodies, and the terms of each joint's own drive."""

import numpy as np
import pytest

from balance.dynamics import regressor
from balance.dynamics.inverse_dynamics import driven_rates, momentum, simulate
from balance.dynamics.regressor import JOINT_TERMS, joint_friction_regressor
from balance.mechanism.loop_constraints import constraints_at
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.pinocchio_engine import PinocchioEngine

from .. import models, referees

EVERY = [*models.SHIPPED, "skew arm", "spatial four-bar"]


def mechanism_of(name: str) -> Mechanism:
    """A built-in mechanism with loads, or one of the spatial ones."""
    texts = {"skew arm": models.skew_arm, "spatial four-bar": models.spatial_four_bar}
    return models.model(texts[name]()) if name in texts else models.loaded(name)


@pytest.mark.parametrize("name", EVERY)
def test_regressors_times_parameters_are_the_dynamics(name: str) -> None:
    """W @ pi is the summed momentum, the shaking wrench and the torque of the driven joints."""
    mechanism = mechanism_of(name)
    motion = referees.random_motion(mechanism)
    q, v, a = motion.q, motion.v, motion.a
    response = simulate(mechanism, motion)
    wrench = regressor.wrench_regressor(mechanism, q, v, a) @ mechanism.pi
    assert referees.relative(wrench, np.hstack([response.force, response.moment])) < 1e-12
    carried = regressor.momentum_regressor(mechanism, q, v) @ mechanism.pi
    assert referees.relative(carried, momentum(mechanism, q, v)) < 1e-12
    driven = tuple(response.torque)
    rates = driven_rates(mechanism, motion.per_drive, driven)
    torque = regressor.driven_torque_regressor(mechanism, q, v, a, rates) @ mechanism.pi
    losses = mechanism.armature * a + mechanism.viscous * v + mechanism.coulomb * np.sign(v)
    torque += np.einsum("nij,ni->nj", rates, losses)
    assert referees.relative(torque, np.array(list(response.torque.values())).T) < 1e-12


@pytest.mark.parametrize("name", EVERY)
def test_regressors_are_pinocchios(name: str) -> None:
    """Momentum, wrench and torque of the open tree, column by column, and the Jacobian of the loops."""
    mechanism = mechanism_of(name)
    motion, engine = referees.random_motion(mechanism, count=6), PinocchioEngine(mechanism)
    states, root = (motion.q, motion.v, motion.a), np.random.default_rng(1).normal(size=(6, regressor.ROOT))
    for mine, other in (
        (regressor.momentum_regressor(mechanism, *states[:2]), map(engine.momentum_regressor, *states[:2])),
        (regressor.wrench_regressor(mechanism, *states), map(engine.wrench_regressor, *states)),
        (regressor.torque_regressor(mechanism, *states), map(engine.torque_regressor, *states)),
        (regressor.torque_regressor(mechanism, *states, root), map(engine.torque_regressor, *states, root)),
    ):
        expected = np.array(list(other))
        np.testing.assert_allclose(mine, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    jacobian = constraints_at(mechanism.tree, mechanism.loops, motion.q)[1]
    np.testing.assert_allclose(jacobian, [engine.constraint_jacobian(q) for q in motion.q], atol=1e-14)


ARM = """
    <body pos="0.1 0.2 0.05"><joint name="a" type="hinge" axis="0 0.6 0.8"/><inertial pos="0.2 0.1 -0.1" mass="2"
      fullinertia="0.2 0.3 0.4 0.01 0.02 0.03"/>
    <body pos="0.4 0 0"><joint name="b" type="slide" axis="0.6 0 0.8"/><inertial pos="0 0.1 0" mass="1"
      diaginertia="0.1 0.2 0.15"/></body></body>"""
CARRIED = """
    <body><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
    <joint name="t" type="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{}</body>"""


def test_a_base_that_moves_is_a_body_that_moves() -> None:
    """Of an arm on two slides and a hinge, the arm's torques are those of the arm on a base with that motion."""
    whole, arm = (models.model(models.mjcf(body.format(ARM))) for body in (CARRIED, "{}"))
    q, v, a = np.random.default_rng(2).normal(size=(3, 5, 5))
    c, s, none = np.cos(q[:, 2]), np.sin(q[:, 2]), np.zeros(5)
    to_base = np.moveaxis(np.array([[c, s, none], [-s, c, none], [none, none, none + 1.0]]), 2, 0)
    pushed = np.einsum("nij,nj->ni", to_base, np.column_stack([a[:, :2], none]) - whole.gravity) + arm.gravity
    root = np.column_stack([none, none, v[:, 2], pushed, none, none, a[:, 2]])
    on_it = regressor.torque_regressor(arm, q[:, 3:], v[:, 3:], a[:, 3:], root)
    np.testing.assert_allclose(on_it, regressor.torque_regressor(whole, q, v, a)[:, 3:, 10:], atol=1e-12)


def test_wrench_regressor_is_the_rate_of_the_momentum_regressor() -> None:
    """Column by column, the wrench is minus the rate of momentum: central differences along a smooth motion."""
    mechanism, step = models.model(models.skew_arm()), 1e-5
    time = np.linspace(0.0, 1.0, 5)[:, None]
    phase = np.arange(mechanism.tree.size)

    def states(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.sin(3 * at + phase), 3 * np.cos(3 * at + phase), -9 * np.sin(3 * at + phase)

    before, after = (regressor.momentum_regressor(mechanism, *states(time + s)[:2]) for s in (-step, step))
    wrench = regressor.wrench_regressor(mechanism, *states(time))
    np.testing.assert_allclose(wrench, -(after - before) / (2 * step), rtol=1e-6, atol=1e-7 * np.abs(wrench).max())


def test_momentum_is_linear_in_the_rates_and_zero_at_rest() -> None:
    """Twice the rates, twice the momentum regressor; no rates, none."""
    mechanism = models.load("parallelogram-6bar-full")
    motion = referees.random_motion(mechanism)
    once = regressor.momentum_regressor(mechanism, motion.q, motion.v)
    np.testing.assert_allclose(
        regressor.momentum_regressor(mechanism, motion.q, -2 * motion.v), -2 * once, rtol=1e-12, atol=1e-12
    )
    assert not regressor.momentum_regressor(mechanism, motion.q, 0 * motion.v).any()


def test_columns_are_named_by_parameter() -> None:
    """A column is the effect of one unit of the parameter that names it: here 1 kg more at the origin of link 2."""
    mechanism = models.load("serial-2r")
    motion = referees.random_motion(mechanism)
    w = regressor.wrench_regressor(mechanism, motion.q, motion.v, motion.a)
    assert w.shape == (24, 6, 20)
    column = w[:, :, mechanism.parameter_names.index("m[link_2]")]
    t1, w1, a1 = motion.q[:, 0], motion.v[:, 0], motion.a[:, 0]
    acceleration = 0.3 * (a1 * 1j - w1**2) * np.exp(1j * t1)  # of the joint between the links, 0.3 m from the first
    np.testing.assert_allclose(column[:, 0] + 1j * column[:, 1], -acceleration, rtol=1e-12)


V = np.array([[2.0, -3.0], [-2.0, 0.0]])
A = np.array([[0.5, 4.0], [-1.0, 2.0]])


def test_each_joint_has_its_own_terms():
    """coulomb sign(v) + viscous v + offset + armature a on the joint itself, nothing on the other."""
    columns, names = joint_friction_regressor(("J1", "J2"), V, A)
    assert names == tuple(f"{term}[{joint}]" for joint in ("J1", "J2") for term in JOINT_TERMS)
    assert columns.shape == (2, 2, 8)
    np.testing.assert_allclose(columns[0, 0], [1.0, 2.0, 1.0, 0.5, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(columns[0, 1], [0, 0, 0, 0, -1.0, -3.0, 1.0, 4.0], atol=1e-12)
    np.testing.assert_allclose(columns[1, 1], [0, 0, 0, 0, 0.0, 0.0, 1.0, 2.0], atol=1e-12)


def test_friction_takes_energy():
    """Friction's power is never negative, whichever way the joint turns; a joint at rest has none."""
    v = np.linspace(-1.0, 1.0, 41)[:, None]
    columns, _ = joint_friction_regressor(("J",), v, np.zeros_like(v))
    assert (columns[:, 0, 0] * v[:, 0] >= 0.0).all()
    assert columns[20, 0, 0] == 0.0
    assert (np.abs(columns[np.arange(41) != 20, 0, 0]) > 0.999).all()  # a sign, not a slope
