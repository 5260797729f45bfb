"""Driven joints and points: their Jacobian and bias are derivatives of their position."""

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism import forward_kinematics
from balance.mechanism.pinocchio_engine import PinocchioEngine
from balance.mechanism.sparse_components import dense_columns, dense_rows
from balance.motion.driven_coordinates import Drive, JointDrive, PointDrive

from .. import models

ARM = models.model(models.skew_arm())
DRIVES = {
    "joints": JointDrive.from_names(ARM, ("w1", "turn")),
    "centre of a body": PointDrive.from_place(ARM, "tool", ("z", "x")),
}


@pytest.mark.parametrize("name", DRIVES)
def test_jacobian_and_bias(name: str) -> None:
    """Central differences along q + v t."""
    drive: Drive = DRIVES[name]
    q, v = np.random.default_rng(5).normal(size=(2, ARM.tree.size, 7))
    step, at = 1e-4, forward_kinematics.pose(ARM.tree, q)

    def position(time: float) -> np.ndarray:
        moved = q + time * v
        return np.array(drive.position(forward_kinematics.pose(ARM.tree, moved)))

    rows = dense_rows(drive.jacobian(ARM.tree, at), ARM.tree.size, 7)
    rate = np.einsum("ijn,jn->in", rows, v)
    np.testing.assert_allclose((position(step) - position(-step)) / (2 * step), rate, atol=1e-6)
    bias = dense_columns(drive.bias(at, forward_kinematics.motion(ARM.tree, at, v)), 7)
    second = (position(step) - 2 * position(0.0) + position(-step)) / step**2
    np.testing.assert_allclose(second, bias, atol=1e-5)
    engine = PinocchioEngine(ARM)
    np.testing.assert_allclose(drive.value(engine, q[:, 0]), position(0.0)[:, 0], atol=1e-14)
    np.testing.assert_allclose(drive.rates(engine, q[:, 0]), rows[:, :, 0], atol=1e-14)


def test_a_body_is_driven_at_its_own_centre() -> None:
    """The manipulator's platform at home is where its keyframe puts it, a counter-mass elsewhere changes nothing."""
    mechanism = models.loaded("parallelogram-6bar")
    drive = PointDrive.from_place(mechanism, "platform", ("x", "y"))
    assert drive.names == ("platform.x", "platform.y")
    np.testing.assert_allclose(
        drive.value(PinocchioEngine(mechanism), mechanism.home), [0.0, 0.3 * np.sin(np.pi / 4)], atol=1e-15
    )


def test_a_site_is_driven_where_it_is() -> None:
    """The tip of the 2R arm by the printed trigonometry."""
    mechanism = models.load("serial-2r")
    tip = PointDrive.from_place(mechanism, "tip", ("x", "y"))
    x, y = tip.value(PinocchioEngine(mechanism), np.array([0.4, 0.9]))
    assert complex(x, y) == pytest.approx(0.3 * np.exp(0.4j) + 0.25 * np.exp(1.3j))


def test_unknown_names_are_refused() -> None:
    """A joint or a place that is not there: refused with what there is."""
    with pytest.raises(ModelError, match=r"no joint 'A9': there are A0, A, B0"):
        JointDrive.from_names(models.load("four-bar"), ("A9",))
    with pytest.raises(ModelError, match="no site 'nowhere'"):
        PointDrive.from_place(models.load("four-bar"), "nowhere", ("x",))
    floor = models.model(models.mjcf('<site name="floor"/>' + models.link("", "a")))
    with pytest.raises(ModelError, match="'floor' of test is on the base"):
        PointDrive.from_place(floor, "floor", ("x",))
