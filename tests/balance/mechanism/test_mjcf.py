"""What is read from a MJCF file beside the tree: gravity, loops by name, motors, keyframe, sites of the base."""

import numpy as np
import pytest

from balance.mechanism.mechanism import Mechanism

from .. import models


def three_loops() -> Mechanism:
    """Loops whose names do not sort as they stand in the file, a weld among them, one end each on the base."""
    bodies = models.link('<site name="s" pos="0.3 0 0"/>', "a") + models.link('<site name="t"/>', "b")
    base = '<site name="on_base" pos="0.1 0.2 0" euler="0 0 0.5"/>'
    mount = '<body name="mount" pos="1 0 0" euler="0 0 1.5707963267948966"><site name="far" pos="0.5 0 0"/></body>'
    rest = (
        '<connect name="zebra" site1="s" site2="on_base"/><weld name="mole" site1="t" site2="far"/>'
        '<connect name="ape" site1="s" site2="t"/><connect site1="far" site2="s"/>'
    )
    return models.model(models.mjcf(base + mount + bodies, f"<equality>{rest}</equality>"))


def test_loops_keep_their_names_and_ends() -> None:
    """Connects in the file's order, then welds, whatever the alphabet says; nameless ones are named by their ends."""
    loops = three_loops().loops
    assert [loop.name for loop in loops] == ["zebra", "ape", "connect far-s", "mole"]
    assert [(loop.first.joint, loop.second.joint) for loop in loops] == [(0, -1), (0, 1), (-1, 0), (1, -1)]
    assert [loop.weld for loop in loops] == [False, False, False, True]


def test_sites_of_the_base_are_where_the_file_has_them() -> None:
    """A loop may end on the base itself or on a body fixed to it: position and orientation in the base frame."""
    zebra, _, far, mole = three_loops().loops
    np.testing.assert_allclose(zebra.second.position, [0.1, 0.2, 0.0])
    np.testing.assert_allclose(far.first.position, [1.0, 0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(mole.second.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-15)


def test_loops_of_the_manipulator_are_where_they_are_named() -> None:
    """The complete manipulator's loops D, K, L, H, J end at the sites of those names."""
    mechanism = models.load("parallelogram-6bar-full")
    for loop in mechanism.loops:
        ends = [(e.joint, tuple(e.position)) for e in (loop.first, loop.second)]
        named = [s for s in mechanism.sites.values() if s.name.startswith(f"{loop.name}_")]
        assert sorted(ends) == sorted((mechanism.tree.bodies[s.body], tuple(s.position)) for s in named)


@pytest.mark.parametrize(
    ("options", "gravity"),
    [
        ("", [0.0, 0.0, -9.81]),
        ('<option gravity="0 -9.81 0"/>', [0.0, -9.81, 0.0]),
        ('<option gravity="1 0 0"/><option timestep="0.1"/><option gravity="0 2 0"/>', [0.0, 2.0, 0.0]),
    ],
)
def test_gravity_is_that_of_the_file(options: str, gravity: list[float]) -> None:
    """MuJoCo's default where nothing is said, the last word where it is said twice."""
    mechanism = models.model(models.mjcf(models.link("", "a"), options=options))
    np.testing.assert_array_equal(mechanism.gravity, gravity)


def test_motors_are_read_once_each_in_the_order_of_the_file() -> None:
    """Any kind of actuator on a joint drives it."""
    bodies = models.link(models.link("", "b"), "a")
    actuators = '<actuator><position joint="b" kp="1"/><motor joint="a" gear="50"/><velocity joint="b"/></actuator>'
    assert models.model(models.mjcf(bodies, actuators)).driven == ("b", "a")


@pytest.mark.parametrize(
    ("keys", "home", "branch"),
    [
        ("", 0.0, "zero configuration"),
        ('<key name="up" qpos="0.3"/><key name="a" qpos="0.6"/>', 0.3, "up"),
        ('<key name="up" qpos="0.3"/><key name="home" qpos="0.6"/>', 0.6, "home"),
        ('<key name="rest" time="1"/><key name="up" qpos="0.3"/>', 0.3, "up"),
    ],
)
def test_the_keyframe_to_start_from(keys: str, home: float, branch: str) -> None:
    """``home``, or else the first that gives a configuration, or else zero."""
    mechanism = models.model(models.mjcf(models.link("", "a"), f"<keyframe>{keys}</keyframe>"))
    assert (mechanism.home.tolist(), mechanism.branch) == ([home], branch)


def test_radii_and_payload_come_from_custom() -> None:
    """The manipulator's counter-masses have a size of their own, its platform carries the payload."""
    mechanism = models.load("parallelogram-6bar")
    assert mechanism.site("counter_A0A").radius_of_gyration == 0.06
    assert mechanism.site("C_AC").radius_of_gyration == 0.0
    assert mechanism.payload_bodies == ("platform",)


def test_joints_of_one_body_keep_their_names() -> None:
    """Two slides on the platform are two coordinates, each with its own name."""
    assert models.load("parallelogram-6bar").coordinates == ("A0", "A", "B0", "B", "platform_x", "platform_y")
    assert models.model(models.skew_arm()).coordinates == ("turn", "reach", "w1", "w2")
