"""Elementary joints from Pinocchio's model: composite joints split, depth first, other kinds refused."""

import numpy as np

from .. import models


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
