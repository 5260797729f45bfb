"""The mechanism as the base feels it, against Pinocchio; sensors on moving bodies; linear systems, exactly."""

import numpy as np
import pytest
from scipy.linalg import expm

from balance.closure import Closure
from balance.dynamics.moving_base import acceleration_in_body, linear_response, locked_inertia, rigid_body
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion, motion_from_table

pinocchio = pytest.importorskip("pinocchio")


@pytest.mark.parametrize("name", ["parallelogram-6bar", "four-bar", "serial-3r"])
def test_locked_inertia(name):
    """Locked, the bodies weigh and turn as the composite body that Pinocchio computes."""
    mechanism = load_mechanism(name)
    masses = dict.fromkeys(mechanism.counter_sites, 3.0)
    mechanism = mechanism.with_counter_mass(masses)
    q = Closure(mechanism).states(3, seed=4)[-1]
    model = mechanism.pinocchio_model()
    data = model.createData()
    pinocchio.ccrba(model, data, q, np.zeros(model.nv))
    about = pinocchio.SE3(np.eye(3), data.com[0]).act(data.Ig)
    expected = rigid_body(about.mass, about.mass * about.lever, about.matrix()[3:, 3:])
    assert locked_inertia(mechanism, q) == pytest.approx(expected, abs=1e-12)


def test_platform_on_a_base_at_rest():
    """Where the base rests, an accelerometer on the platform sees the commanded acceleration."""
    mechanism = load_mechanism("parallelogram-6bar")
    samples = load_motion("triangle").sample(2000.0)
    trajectory = Closure(mechanism).follow(samples)
    still = np.zeros((len(samples.time), 6))
    found = acceleration_in_body(mechanism, trajectory, still, mechanism.anchor("platform", np.zeros(3)))
    assert found[:, :2] == pytest.approx(samples.acceleration, abs=1e-9)


def test_base_that_moves():
    """What the base does adds to it: u'' + phi'' x p, seen in the axes of the body."""
    mechanism = load_mechanism("serial-1r")
    joint = mechanism.coordinates[0]
    motion = {"driven": "joints", "joints": [joint], "start": ["30 deg"], "peak_acceleration": "1 rad/s^2"}
    samples = motion_from_table({**motion, "moves": [{"joint": joint, "to": ["1 rad"]}]}).sample(100.0)
    trajectory = Closure(mechanism).follow(samples)
    moving = np.tile([1.0, 2.0, 0.0, 0.0, 0.0, 0.5], (len(samples.time), 1))
    point = mechanism.anchor(mechanism.bodies[0], np.array([0.2, 0.0, 0.0]))
    still = acceleration_in_body(mechanism, trajectory, np.zeros_like(moving), point)
    found = acceleration_in_body(mechanism, trajectory, moving, point) - still
    q = trajectory.q[:, 0]
    at = 0.2 * np.column_stack([np.cos(q), np.sin(q), 0 * q])
    added = moving[:, :3] + np.cross(moving[:, 3:], at)
    turned = np.column_stack([
        np.cos(q) * added[:, 0] + np.sin(q) * added[:, 1], np.cos(q) * added[:, 1] - np.sin(q) * added[:, 0], 0 * q,
    ])  # fmt: skip
    assert found == pytest.approx(turned, abs=1e-12)


def test_recursion():
    """All samples at once are what one step after the other gives, over several blocks."""
    rng = np.random.default_rng(1)
    a, b, w = rng.normal(size=(4, 4)) - 3.0 * np.eye(4), rng.normal(size=(4, 2)), rng.normal(size=(777, 2))
    constant = np.repeat(w[:1], 777, axis=0)
    phi, rest, state = expm(0.01 * a), np.zeros(4), []
    for _ in range(777):
        state.append(rest)
        rest = phi @ rest + np.linalg.solve(a, (phi - np.eye(4)) @ b @ w[0])
    assert linear_response(a, b, constant, 0.01) == pytest.approx(np.array(state), abs=1e-12)


def test_ramp():
    """Under a ramp, a lag of time constant T follows: y = t - T (1 - exp(-t / T)), at any step."""
    for step in (1e-3, 0.05):
        time = np.arange(200) * step
        found = linear_response(np.array([[-10.0]]), np.array([[10.0]]), time[:, None], step)[:, 0]
        assert found == pytest.approx(time - 0.1 * (1.0 - np.exp(-10.0 * time)), abs=1e-12)


@pytest.mark.parametrize("count", [1, 2, 127, 128, 129, 300])
def test_several_at_once(count):
    """Several signals through one system are as each for itself, whatever their length relative to a block."""
    rng = np.random.default_rng(2)
    a, b, w = np.array([[0.0, 1.0], [-400.0, -4.0]]), np.array([[0.0], [1.0]]), rng.normal(size=(count, 3, 1))
    together = linear_response(a, b, w, 0.01)
    assert together.shape == (count, 3, 2)
    for k in range(3):
        assert together[:, k] == pytest.approx(linear_response(a, b, w[:, k], 0.01), abs=1e-15)
