"""Driven joints and points: their Jacobian and bias are derivatives of their position."""

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism.forward_kinematics import motion, pose
from balance.mechanism.pinocchio_engine import PinocchioEngine
from balance.mechanism.tape import Symbols
from balance.motion.driven_coordinates import Drive

from .. import models

ARM = models.model(models.skew_arm())
DRIVES = {
    "joints": Drive.of_joints(ARM, ("w1", "turn")),
    "centre of a body": Drive.of_point(ARM, "tool", ("z", "x")),
}


@pytest.mark.parametrize("name", DRIVES)
def test_jacobian_and_bias(name: str) -> None:
    """Central differences along q + v t."""
    drive, tree, step = DRIVES[name], ARM.tree, 1e-4
    q, v = np.random.default_rng(5).normal(size=(2, tree.size, 7))

    def position(time: float) -> np.ndarray:
        return models.evaluated(lambda q: drive.position(pose(tree, q)), q + time * v)

    def bias_of(q: Symbols, v: Symbols) -> Symbols:
        return drive.bias(at := pose(tree, q), motion(tree, at, v))

    rows = models.evaluated(lambda q: drive.jacobian(tree, pose(tree, q)), q)
    rate = np.einsum("nij,jn->ni", rows, v)
    np.testing.assert_allclose((position(step) - position(-step)) / (2 * step), rate, atol=1e-6)
    second = (position(step) - 2 * position(0.0) + position(-step)) / step**2
    np.testing.assert_allclose(second, models.evaluated(bias_of, q, v), atol=1e-5)
    engine = PinocchioEngine(ARM)
    np.testing.assert_allclose(drive.value(engine, q[:, 0]), position(0.0)[0], atol=1e-14)
    np.testing.assert_allclose(drive.rates(engine, q[:, 0]), rows[0], atol=1e-14)


def test_a_body_is_driven_at_its_own_centre() -> None:
    """The manipulator's platform at home is where its keyframe puts it, a counter-mass elsewhere changes nothing."""
    mechanism = models.loaded("parallelogram-6bar")
    drive = Drive.of_point(mechanism, "platform", ("x", "y"))
    assert drive.names == ("platform.x", "platform.y")
    np.testing.assert_allclose(
        drive.value(PinocchioEngine(mechanism), mechanism.home), [0.0, 0.3 * np.sin(np.pi / 4)], atol=1e-15
    )


def test_a_site_is_driven_where_it_is() -> None:
    """The tip of the 2R arm by the printed trigonometry."""
    mechanism = models.load("serial-2r")
    tip = Drive.of_point(mechanism, "tip", ("x", "y"))
    x, y = tip.value(PinocchioEngine(mechanism), np.array([0.4, 0.9]))
    assert complex(x, y) == pytest.approx(0.3 * np.exp(0.4j) + 0.25 * np.exp(1.3j))


def test_unknown_names_are_refused() -> None:
    """A joint or a place that is not there: refused with what there is."""
    with pytest.raises(ModelError, match=r"no joint 'A9': there are A0, A, B0"):
        Drive.of_joints(models.load("four-bar"), ("A9",))
    with pytest.raises(ModelError, match="no site 'nowhere'"):
        Drive.of_point(models.load("four-bar"), "nowhere", ("x",))
    floor = models.model(models.mjcf('<site name="floor"/>' + models.link("", "a")))
    with pytest.raises(ModelError, match="'floor' of test is on the base"):
        Drive.of_point(floor, "floor", ("x",))
