"""What sensors would have shown on a base that stands still."""

import mujoco
import numpy as np
import pytest

from balance.closure import Trajectory
from balance.dynamics.moving_base import acceleration_in_body, displacement_at
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import mechanism_from_text
from studies import simulated_runs as memory
from testbench.kinematics import base_motion

ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="elbow" axis="0 0 1"/>
<inertial pos="0.1 0 0" mass="1" diaginertia="1 1 1"/><body name="hand" pos="0.2 0.1 0.05" euler="0.3 -0.5 0.9"/></body>
</worldbody></mujoco>"""
"""An arm, and a hand that is fixed to it."""


def test_the_base_is_not_seen():
    """Whatever the base's six accelerations, what is projected does not see them."""
    rng = np.random.default_rng(0)
    rows = np.stack([displacement_at(p) for p in rng.normal(0.0, 0.2, (5, 3))])
    base = displacement_at(np.array([0.2, -0.1, 0.0]))
    share = base_motion.projector(rows, base)
    seen = np.concatenate([rows, np.broadcast_to(base, (5, 3, 6))], axis=1) @ rng.normal(size=6)
    assert np.abs(np.einsum("nij,nj->ni", share, seen)).max() < 1e-4


def test_one_accelerometer_leaves_the_line_to_it():
    """With one accelerometer of three axes, what remains of a point's acceleration is its part along the line to it."""
    place, point = np.array([0.2, -0.1, 0.0]), np.array([-0.1, 0.3, 0.0])
    share = base_motion.projector(displacement_at(point)[None], displacement_at(place))[0, :, :3]
    line = (point - place) / np.linalg.norm(point - place)
    assert share == pytest.approx(0.5 * np.outer(line, line), abs=1e-4)


@pytest.mark.parametrize("motion", ["x", "y", "triangle"])
def test_forces_of_a_moving_bench(motion):
    """Forces with the base's motion taken out are those of the mechanism on a base at rest, to 0.2 %."""
    scene = memory.scene(motion)
    run, path = scene.bench, scene.bench.trajectory
    names = ("Fx", "Fy", "Fz")
    force = np.column_stack([sum(scene.seen.get(f"{c}{i}", 0.0) for i in range(1, 5)) for c in names])
    felt = np.column_stack([scene.seen[c] for c in ("AccX", "AccY", "AccZ")])
    share = base_motion.projector(
        base_motion.force_rows(run.mechanism, path), displacement_at(np.array([0.2, -0.1, 0.0]))
    )
    total = run.mechanism.total_mass * felt
    left = np.einsum("nij,nj->ni", share[:, :, :3], force) + np.einsum("nij,nj->ni", share[:, :, 3:], total)
    still = np.einsum("nij,nj->ni", share[:, :, :3], run.response.force)
    assert np.abs(left - still).max() < 2e-3 * np.abs(still).max()
    assert np.abs(force - run.response.force).max() > 0.2 * np.abs(still).max()


def test_mass_centre():
    """The centre of mass times the mass is minus the second integral of the shaking force: it moves as F says."""
    scene = memory.scene("x", masses={})
    path = scene.bench.trajectory
    centre = base_motion.mass_centre(scene.bench.mechanism, path)
    step = float(path.time[1] - path.time[0])
    force = -scene.bench.mechanism.total_mass * np.gradient(np.gradient(centre, step, axis=0), step, axis=0)
    assert np.abs(force - scene.bench.response.force).max() < 0.02 * np.abs(force).max()
    assert isinstance(scene.bench.mechanism, Mechanism)


def test_a_level_needs_no_two_samples():
    """Rest is at its own level, whatever it is; a record of one sample, which has no rate, is at rest."""
    time = np.arange(400) / 100.0
    moved = np.where(time > 1.0, np.sin(20.0 * time), 0.0)
    found = base_motion.without_rest(np.column_stack([moved - 9.8, 2.0 * moved + 3.0]), time)
    np.testing.assert_allclose(found, np.column_stack([moved, 2.0 * moved]), atol=1e-12)
    np.testing.assert_array_equal(base_motion.without_rest(np.array([[3.0, -1.0]]), np.array([0.5])), [[0.0, 0.0]])


def test_sensor_on_a_body_that_is_fixed_to_another():
    """Its place and its axes are those of that body: what turns steadily shows -w x (w x p) there, as does the base."""
    mechanism = mechanism_from_text(ARM, "arm.xml")
    q, still = np.array([[0.4], [0.7]]), np.zeros((2, 1))
    path = Trajectory("arm", q[:, 0], q, still + 3.0, still, still[:, :, None], 0.0, 1.0, "")
    base, mounted = np.random.default_rng(1).normal(size=(2, 6)), mechanism.anchor("hand", np.array([0.1, 0.0, -0.2]))
    found = acceleration_in_body(mechanism, path, base, mounted)
    model = mujoco.MjModel.from_xml_string(mechanism.text)
    data = mujoco.MjData(model)
    for k, shown in enumerate(found):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(model, data)
        axes = data.body("hand").xmat.reshape(3, 3)
        point = data.body("hand").xpos + axes @ [0.1, 0.0, -0.2]
        expected = axes.T @ (base[k, :3] + np.cross(base[k, 3:], point) - 9.0 * point * [1.0, 1.0, 0.0])
        assert shown == pytest.approx(expected, abs=1e-12)
    rows = base_motion.sensor_rows(mechanism, path, mounted, "xyz")
    of_base = found - acceleration_in_body(mechanism, path, np.zeros((2, 6)), mounted)
    assert np.einsum("nij,nj->ni", rows, base) == pytest.approx(of_base, abs=1e-12)
