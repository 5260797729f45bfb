"""Elementary joints and their poses, velocities and accelerations, against Pinocchio and differences."""

import numpy as np
import pinocchio
import pytest

from balance.mechanism import forward_kinematics
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.sparse_components import dense, dense_rows, zeros

from .. import models

TEXTS = {"skew arm": models.skew_arm(), "spatial four-bar": models.spatial_four_bar(), "Bennett": models.bennett()}
N = 6


@pytest.fixture(scope="module", params=TEXTS)
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    """A spatial mechanism, taken as an open tree."""
    return models.model(TEXTS[request.param])


def states(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random q, v, a (nv, n)."""
    q, v, a = np.random.default_rng(1).normal(size=(3, mechanism.tree.size, N))
    return q, v, a


def test_poses_and_rates_are_pinocchios(mechanism: Mechanism) -> None:
    """Rotation, origin, angular and linear velocity and acceleration of every body, in the base frame."""
    q, v, a = states(mechanism)
    at = forward_kinematics.pose(mechanism.tree, q)
    moving = forward_kinematics.motion(mechanism.tree, at, v, a)
    model = mechanism.pinocchio_model()
    data = model.createData()
    world = pinocchio.LOCAL_WORLD_ALIGNED
    for k in range(N):
        pinocchio.forwardKinematics(model, data, q[:, k], v[:, k], a[:, k])
        for body, joint in enumerate(mechanism.tree.bodies, 1):
            rotation = np.stack([dense(column, N)[:, k] for column in at.rotation[joint]], axis=1)
            np.testing.assert_allclose(rotation, data.oMi[body].rotation, atol=1e-13)
            rate = pinocchio.getVelocity(model, data, body, world)
            faster = pinocchio.getClassicalAcceleration(model, data, body, world)
            for mine, other in (
                (at.position, data.oMi[body].translation), (moving.velocity, rate.linear), (moving.omega, rate.angular),
                (moving.acceleration, faster.linear), (moving.alpha, faster.angular),
            ):  # fmt: skip
                np.testing.assert_allclose(dense(mine[joint], N)[:, k], other, atol=1e-11)


def test_point_jacobian_and_acceleration(mechanism: Mechanism) -> None:
    """A body's point: its Jacobian times v is its velocity, differenced its acceleration is that of the point."""
    q, v, a = states(mechanism)
    tree, joint, offset, step = mechanism.tree, mechanism.tree.size - 1, np.array([0.1, -0.2, 0.3]), 1e-5

    def point(at_time: float) -> np.ndarray:
        at = forward_kinematics.pose(tree, q + at_time * v + at_time**2 / 2 * a)
        return dense(at.point(joint, offset), N)

    at = forward_kinematics.pose(tree, q)
    rows = zeros(3, tree.size)
    forward_kinematics.add_point_jacobian(tree, at, joint, at.point(joint, offset), rows)
    speed = np.einsum("ijn,jn->in", dense_rows(rows, tree.size, N), v)
    np.testing.assert_allclose(speed, (point(step) - point(-step)) / (2 * step), atol=1e-7)
    faster = forward_kinematics.point_acceleration(at, forward_kinematics.motion(tree, at, v, a), joint, offset)
    second = (point(step) - 2 * point(0.0) + point(-step)) / step**2
    np.testing.assert_allclose(dense(faster, N), second, atol=2e-4)


def test_angular_jacobian(mechanism: Mechanism) -> None:
    """The angular Jacobian times v is the angular velocity; with the sign -1 it is taken off."""
    q, v, _ = states(mechanism)
    tree, joint = mechanism.tree, mechanism.tree.size - 1
    at = forward_kinematics.pose(tree, q)
    rows = zeros(3, tree.size)
    forward_kinematics.add_angular_jacobian(tree, at, joint, rows)
    omega = dense(forward_kinematics.motion(tree, at, v).omega[joint], N)
    np.testing.assert_allclose(np.einsum("ijn,jn->in", dense_rows(rows, tree.size, N), v), omega, atol=1e-13)
    forward_kinematics.add_angular_jacobian(tree, at, joint, rows, -1.0)
    np.testing.assert_allclose(dense_rows(rows, tree.size, N), 0.0, atol=1e-15)


def test_the_base_does_not_move() -> None:
    """A point of the base (joint -1) is where it is, and has no acceleration."""
    mechanism = models.load("serial-1r")
    at = forward_kinematics.pose(mechanism.tree, np.ones((1, 2)))
    moving = forward_kinematics.motion(mechanism.tree, at, np.ones((1, 2)))
    assert at.point(-1, np.array([1.0, 2.0, 3.0])) == (1.0, 2.0, 3.0)
    assert forward_kinematics.point_acceleration(at, moving, -1, np.ones(3)) == (0.0, 0.0, 0.0)


def test_composite_joints_become_elementary_ones() -> None:
    """The platform's two slides: two prismatic joints, the body on the second."""
    tree = models.load("parallelogram-6bar").tree
    slides = [joint for joint in tree.joints if not joint.revolute]
    assert [joint.axis.tolist() for joint in slides] == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert tree.bodies == (0, 1, 2, 3, 5)
    assert tree.path(5) == [4, 5]


def test_parents_come_first() -> None:
    """Every joint stands after its parent, its axis has length one."""
    for name in models.BUILT_IN:
        for i, joint in enumerate(models.load(name).tree.joints):
            assert joint.parent < i
            assert np.linalg.norm(joint.axis) == 1.0


def test_paths_lead_from_the_base() -> None:
    """Joints from the base to the platform of the complete manipulator: A0, A, C."""
    mechanism = models.load("parallelogram-6bar-full")
    path = mechanism.tree.path(mechanism.coordinate_index("C"))
    assert [mechanism.coordinates[i] for i in path] == ["A0", "A", "C"]
    assert mechanism.tree.path(-1) == []
