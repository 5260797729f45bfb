"""The mechanism on a page: to scale, along the trajectory, with the model's force."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.forward_kinematics import poses
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion
from balance.report.moving import FRAMES, drawn_points, moving, pictures

from .. import models


@pytest.mark.parametrize(("name", "planar"), [("five-bar", True), ("delta", False)])
def test_links_keep_their_length(name, planar):
    """Of a planar mechanism every link is as long as its scale says in every picture; of others never longer."""
    mechanism = load_mechanism(name)
    trajectory = Closure(mechanism).follow(load_motion(name).sample(1000.0))
    drawn = moving("motion", trajectory, {"as it is": (mechanism, {})})
    panel, frames = drawn["panels"][0], len(drawn["time"])
    assert frames <= FRAMES
    assert ("along z" in drawn["view"]) == planar
    scale = drawn["scale_bar"] / drawn["scale_bar_m"]
    points = pictures(panel)
    assert points.min() >= 0.0
    assert (points <= [drawn["width"], drawn["height"] + 0.1]).all()
    step = -(-len(trajectory.time) // FRAMES)
    positions = poses(mechanism.tree, trajectory.q[::step]).position
    pivots = [s["points"][0] for s in panel["shapes"] if s["kind"] in ("pivot", "ground")]
    tree = mechanism.tree.joints
    joints = [
        i
        for i, one in enumerate(tree)
        if one.revolute and (one.parent < 0 or not tree[one.parent].revolute or np.abs(one.position).max() > 1e-9)
    ]
    places = positions[:, joints].transpose(1, 0, 2)
    for (a, pa), (b, pb) in zip(
        list(zip(pivots, places, strict=False))[:-1], list(zip(pivots, places, strict=False))[1:], strict=True
    ):
        seen = np.linalg.norm(points[:, a] - points[:, b], axis=1)
        true = scale * np.linalg.norm(pa - pb, axis=1)
        assert (seen <= true + 0.3).all()  # coordinates are rounded to a tenth
        assert not planar or seen == pytest.approx(true, abs=0.3)


def _chain(*steps: str, gravity: str = "0 0 -9.81"):
    """Joints of which each is a step from the last."""
    text = ""
    for k, step in reversed([*enumerate(("0 0 0", *steps))]):
        text = (
            f"<body pos='{step}'><joint name='{k}'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>{text}</body>"
        )
    return models.model(f"<mujoco><option gravity='{gravity}'/><worldbody>{text}</worldbody></mujoco>")


def _steps_seen(mechanism, seen_from):
    """Of its pivots, to the right and upwards (k, 2) [m]."""
    q = np.zeros((1, len(mechanism.coordinates)))
    return np.diff(drawn_points(mechanism, {}, seen_from, q)(q)[0, -len(mechanism.coordinates) - 1 : -1], axis=0)


@pytest.mark.parametrize(("azimuth", "elevation"), [(30.0, 20.0), (-60.0, 30.0), (200.0, -40.0)])
def test_azimuth_and_elevation_are_those_of_matplotlib(azimuth, elevation):
    """A step along x, y and z goes where ``view_init`` of a cube drawn without perspective has it."""
    from matplotlib.figure import Figure

    axes = Figure().add_subplot(projection="3d", proj_type="ortho", box_aspect=(1, 1, 1))
    axes.set(xlim=(0, 1), ylim=(0, 1), zlim=(0, 1))
    axes.view_init(elevation, azimuth)
    rows = axes.get_proj()[:2, :3]
    seen = _steps_seen(_chain("0.3 0 0", "0 0.3 0", "0 0 0.3"), np.radians((azimuth, elevation)))
    np.testing.assert_allclose(seen, 0.3 * (rows / np.linalg.norm(rows, axis=1, keepdims=True)).T, atol=1e-12)


@pytest.mark.parametrize(
    ("steps", "gravity", "seen"),
    [
        (("0.3 0 0", "0 0.2 0"), "-9.81 0 0", [[0.3, 0], [0, 0.2]]),
        (("0.3 0 0", "0 0 0.2"), "0 0 -9.81", [[0.3, 0], [0, 0.2]]),
        (("0 0.3 0", "0 0 0.2"), "0 0 -9.81", [[0.3, 0], [0, 0.2]]),
        (("0.3 0 0", "0 0.2 0", "0 0 0.1"), "0 -9.81 0", [[0, 0], [0, 0.2], [-0.1, 0]]),
        (("0.3 0 0", "0 0.2 0", "0 0 0.1"), "-9.81 0 0", [[0, 0.3], [0, 0], [0.1, 0]]),
    ],
)
def test_the_view_without_a_wish(steps, gravity, seen):
    """Planar mechanisms face-on; others from azimuth zero on the side of x, or of y where x is upright."""
    np.testing.assert_allclose(_steps_seen(_chain(*steps, gravity=gravity), (0.0, 0.0)), seen, atol=1e-12)


def test_arrows_are_the_models_force():
    """In all panels to one scale: the arrow's length over the largest is the force over the largest."""
    bare = load_mechanism("parallelogram-6bar").with_payload({"platform": 5.0})
    masses = {"counter_A0A": 12.0, "counter_B0B": 12.0}
    heavy = bare.with_counter_mass(masses)
    trajectory = Closure(bare).follow(load_motion("x").sample(1000.0))
    drawn = moving("x", trajectory, {"without": (bare, {}), "with": (heavy, masses)})
    largest = np.linalg.norm(simulate(bare, trajectory).force, axis=1).max()
    assert drawn["arrow_N"] == pytest.approx(largest)
    step, units = -(-len(trajectory.time) // FRAMES), None
    for panel, mechanism in zip(drawn["panels"], (bare, heavy), strict=True):
        force = simulate(mechanism, trajectory).force[::step, :2]
        points = pictures(panel)
        tail, tip, *_ = next(s["points"] for s in panel["shapes"] if s["kind"] == "force")
        arrow = (points[:, tip] - points[:, tail]) * [1.0, -1.0]
        k = int(np.argmax(np.abs(force[:, 0])))
        units = units or arrow[k, 0] / force[k, 0]
        assert arrow == pytest.approx(units * force, abs=0.3)
    assert [s["label"] for s in drawn["panels"][1]["shapes"] if s["kind"] == "counter"] == [
        "12 kg at counter_A0A",
        "12 kg at counter_B0B",
    ]
