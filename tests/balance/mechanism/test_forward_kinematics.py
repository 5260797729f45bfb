"""Elementary joints and their poses, velocities and accelerations, against Pinocchio and differences."""

import numpy as np
import pinocchio
import pytest

from balance.mechanism.forward_kinematics import (
    angular_jacobian,
    motions,
    point_acceleration,
    point_jacobian,
    pose,
    poses,
)
from balance.mechanism.mechanism import Mechanism

from .. import models

TEXTS = {"skew arm": models.skew_arm(), "spatial four-bar": models.spatial_four_bar(), "Bennett": models.bennett()}
N = 6


@pytest.fixture(scope="module", params=TEXTS)
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    """A spatial mechanism, taken as an open tree."""
    return models.model(TEXTS[request.param])


def states(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random q, v, a (n, nv)."""
    q, v, a = np.random.default_rng(1).normal(size=(3, N, mechanism.tree.size))
    return q, v, a


def test_poses_and_rates_are_pinocchios(mechanism: Mechanism) -> None:
    """Rotation, origin, angular and linear velocity and acceleration of every body, in the base frame."""
    q, v, a = states(mechanism)
    at, moving = poses(mechanism.tree, q), motions(mechanism.tree, q, v, a)
    model = mechanism.pinocchio_model()
    data = model.createData()
    world = pinocchio.LOCAL_WORLD_ALIGNED
    for k in range(N):
        pinocchio.forwardKinematics(model, data, q[k], v[k], a[k])
        for body, joint in enumerate(mechanism.tree.bodies, 1):
            np.testing.assert_allclose(at.rotation[k, joint], data.oMi[body].rotation, atol=1e-13)
            rate = pinocchio.getVelocity(model, data, body, world)
            faster = pinocchio.getClassicalAcceleration(model, data, body, world)
            for mine, other in (
                (at.position, data.oMi[body].translation), (moving.velocity, rate.linear), (moving.omega, rate.angular),
                (moving.acceleration, faster.linear), (moving.alpha, faster.angular),
            ):  # fmt: skip
                np.testing.assert_allclose(mine[k, joint], other, atol=1e-11)


def test_point_jacobian_and_acceleration(mechanism: Mechanism) -> None:
    """A body's point: its Jacobian times v is its velocity, differenced its acceleration is that of the point."""
    q, v, a = states(mechanism)
    tree, joint, offset, step = mechanism.tree, mechanism.tree.size - 1, np.array([0.1, -0.2, 0.3]), 1e-5

    def point(time: float) -> np.ndarray:
        return poses(tree, q + time * v + time**2 / 2 * a).point(joint, offset)

    at = poses(tree, q)
    speed = np.einsum("nij,nj->ni", point_jacobian(tree, at, joint, offset), v)
    np.testing.assert_allclose(speed, (point(step) - point(-step)) / (2 * step), atol=1e-7)
    faster = point_acceleration(at, motions(tree, q, v, a), joint, offset)
    second = (point(step) - 2 * point(0.0) + point(-step)) / step**2
    np.testing.assert_allclose(faster, second, atol=2e-4)


def test_angular_jacobian(mechanism: Mechanism) -> None:
    """The angular Jacobian times v is the angular velocity."""
    q, v, a = states(mechanism)
    tree, joint = mechanism.tree, mechanism.tree.size - 1
    omega = np.einsum("nij,nj->ni", angular_jacobian(tree, poses(tree, q), joint), v)
    np.testing.assert_allclose(omega, motions(tree, q, v, a).omega[:, joint], atol=1e-13)


def test_written_down_and_of_samples_it_is_the_same(mechanism: Mechanism) -> None:
    """A point's Jacobian by symbols of a tape, and from the poses of samples."""
    q, _, _ = states(mechanism)
    tree, place = mechanism.tree, (mechanism.tree.size - 1, np.array([0.1, -0.2, 0.3]))
    written = models.evaluated(lambda q: point_jacobian(tree, pose(tree, q), *place), q.T)
    np.testing.assert_allclose(written, point_jacobian(tree, poses(tree, q), *place), atol=1e-14)


def test_the_base_does_not_move() -> None:
    """A point of the base (joint -1) is where it is, and has no acceleration."""
    tree, states = models.load("serial-1r").tree, np.ones((3, 2, 1))
    at, moving = poses(tree, states[0]), motions(tree, *states)
    assert at.point(-1, np.array([1.0, 2.0, 3.0])).tolist() == [[1.0, 2.0, 3.0]] * 2
    assert not point_acceleration(at, moving, -1, np.ones(3)).any()


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
