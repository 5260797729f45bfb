"""A machine is the same however its bodies' frames lie in their bodies: what is mounted is in one place in the world.

MuJoCo tells where a place in the frame of a file's body is: the places that are shown are typed in there.
"""

from itertools import product

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import balance
from balance.balancing.springs import End
from balance.balancing.sweep import Problem
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion import Samples
from balance.results import plain

BODIES = {  # carrier, place of the joint in it, angle there, mass, centre, sites
    "crank": ("", (0, 0, 0), 0.5, 0.6, (0.031, 0.012, 0), {"counter_crank": (-0.06, -0.02, 0.01)}),
    "coupler": ("crank", (0.1, 0, 0), -0.3, 0.9, (0.13, 0.02, 0), {"B_c": (0.3, 0, 0)}),
    "rocker": ("", (0.28, 0.03, 0), 1.4, 0.7, (0.11, -0.03, 0), {"B_r": (0.22, 0, 0), "counter_a": (-0.1, 0.02, 0)}),
    "plate": ("rocker", (0.05, 0.04, 0.02), 0.7, 0.3, (0.02, 0.01, 0), {"counter_b": (-0.07, 0.06, 0)}),
}
"""A four-bar with a plate fixed to its rocker, each body's frame at its joint."""
AXIS = np.array([0.0, 0.0, 1.0])


def described(frames: dict[str, tuple[np.ndarray, np.ndarray]]) -> str:
    """The machine, with the frames of some bodies at an origin and turned, in those of ``BODIES``."""
    still = np.zeros(3), np.eye(3)

    def written(carrier: str) -> str:
        text = ""
        at, turn = frames.get(carrier, still)
        for name, (under, place, angle, mass, centre, sites) in BODIES.items():
            if under != carrier:
                continue
            origin, axes = frames.get(name, still)
            own = Rotation.from_rotvec(angle * AXIS).as_matrix()
            pose = turn.T @ (np.array(place) + own @ origin - at), Rotation.from_matrix(turn.T @ own @ axes)
            points = {site: axes.T @ (np.array(point) - origin) for site, point in sites.items()}
            quat = Rotation.from_matrix(axes.T).as_quat(scalar_first=True)
            text += f'<body name="{name}" pos="{words(pose[0])}" quat="{words(pose[1].as_quat(scalar_first=True))}">'
            if name != "plate":
                text += f'<joint name="j_{name}" axis="{words(axes.T @ AXIS)}" pos="{words(-axes.T @ origin)}"/>'
            text += f'<inertial mass="{mass}" pos="{words(axes.T @ (np.array(centre) - origin))}" quat="{words(quat)}" '
            text += 'diaginertia="0.002 0.003 0.004"/>'
            text += "".join(f'<site name="{site}" pos="{words(point)}"/>' for site, point in points.items())
            text += written(name) + "</body>"
        return text

    return (
        f'<mujoco><option gravity="0 -9.81 0"/><worldbody>{written("")}</worldbody><equality>'
        '<connect site1="B_c" site2="B_r"/></equality><actuator><motor joint="j_crank"/></actuator></mujoco>'
    )


def words(values) -> str:
    """Numbers as an attribute has them."""
    return " ".join(repr(float(x)) for x in values)


SHIFT = {
    "crank": np.array([0.02, -0.03, 0.0]),
    "rocker": np.array([-0.04, 0.025, 0.01]),
    "coupler": np.array([0.1, 0, 0]),
}
TURN = {"crank": [0.4, -1.1, 0.8], "rocker": [0.0, 0.0, 2.0], "coupler": [1.2, 0.1, 0.0], "plate": [0.3, 0.9, -0.5]}
DESCRIPTIONS = {
    "offset": {name: (shift, np.eye(3)) for name, shift in SHIFT.items()},
    "turned": {name: (np.zeros(3), Rotation.from_rotvec(turn).as_matrix()) for name, turn in TURN.items()},
    "both": {n: (SHIFT.get(n, np.full(3, 0.03)), Rotation.from_rotvec(turn).as_matrix()) for n, turn in TURN.items()},
}


def in_world(text: str, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Masses, places and first moments that sizing shows, further sites too, in the world as the file stands."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    study = balance.size(mechanism)
    shown = {one.site: (model.body(model.site(one.site).bodyid[0]).id, one) for one in study.counter_masses}
    for equals in study.verdict.needed:
        for one in equals:
            shown |= {f"on {body}": (model.body(body).id, mass) for body, mass in study.further(one)}
    assert {"on coupler"} < set(shown)
    found = {}
    for name, (body, one) in shown.items():
        axes, document = data.xmat[body].reshape(3, 3), plain(one)
        place = data.xpos[body] + axes @ document["position_m"]
        if not name.startswith("on "):
            np.testing.assert_allclose(place, data.site(name).xpos, atol=1e-12)
        found[name] = np.concatenate([[one.mass], place, axes @ document["first_moment_kgm"]])
    for one in study.best.first_moments():
        axes = data.body(one.body).xmat.reshape(3, 3)
        found |= {f"moments of {one.body}": np.concatenate([axes @ one.given, axes @ one.missing])}
    return found


@pytest.fixture(scope="module")
def reference() -> dict[str, np.ndarray]:
    """As each frame is at its joint."""
    return in_world(described({}), mechanism_from_text(described({}), "m"))


@pytest.mark.parametrize("case", DESCRIPTIONS)
def test_a_mounting_is_the_same_however_frames_lie(reference, case) -> None:
    """Places of further sites are rounded to 0.1 mm in the body's frame; all else to rounding of the programme."""
    text = described(DESCRIPTIONS[case])
    found = in_world(text, mechanism_from_text(text, "m"))
    assert set(found) == set(reference)
    for name, values in found.items():
        np.testing.assert_allclose(values, reference[name], atol=2e-3 if name.startswith("on ") else 1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("case", "site", "axis"), [*product(DESCRIPTIONS, ("counter_a", "counter_b", "B_c"), range(3))]
)
def test_what_is_shown_is_what_is_written(case, site, axis) -> None:
    """Sweeps and tolerances write the file's numbers; sizing shows them; a spring's end typed anew is where it was."""
    mechanism = mechanism_from_text(described(DESCRIPTIONS[case]), "m")
    still = Samples(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), ("j_crank",))
    place = mechanism.place(site)
    assert Problem(mechanism, still).place(site, "xyz"[axis]) == pytest.approx(place[axis], abs=1e-12)
    found, body = mechanism.site(site), mechanism.site(site).on
    np.testing.assert_allclose(mechanism.anchor(body, place).position, found.position, atol=1e-12)
    end = End(found.body, found.position)
    np.testing.assert_allclose(
        mechanism.anchor(mechanism.bodies[found.body], end.place(mechanism)).position, found.position, atol=1e-12
    )


URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="counter"/>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
<joint name="c" type="fixed"><origin xyz="-0.1 0.02 0" rpy="0 0 1"/><parent link="arm"/><child link="counter"/></joint>
</robot>"""
SDF = """<sdf version="1.7"><model name="r"><link name="arm"><pose>0.6 0.1 0 0 0 0</pose><inertial><mass>1</mass>
<pose>0.1 -0.1 0 0 0 0</pose></inertial></link><link name="counter"><pose relative_to="arm">-0.2 -0.08 0 0 0 1</pose>
<inertial><mass>0</mass></inertial></link>
<joint name="j" type="revolute"><pose>-0.1 -0.1 0 0 0 0</pose><parent>world</parent><child>arm</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<joint name="c" type="fixed"><parent>arm</parent><child>counter</child></joint></model></sdf>"""


@pytest.mark.parametrize(
    ("name", "text", "place", "from_joint"),
    [("r.urdf", URDF, (-0.1, 0.02, 0.0), (-0.1, 0.02, 0.0)), ("r.sdf", SDF, (-0.2, -0.08, 0.0), (-0.1, 0.02, 0.0))],
)
def test_a_link_that_is_a_site_is_placed_in_the_link_that_carries_it(tmp_path, name, text, place, from_joint) -> None:
    """In the link's own frame, which of an SDF link need not be at its joint: there the first moment is about."""
    (tmp_path / name).write_text(text, encoding="utf-8")
    one = balance.check(load_mechanism(str(tmp_path / name)), {"counter": "2 kg"}).counter_masses[0]
    np.testing.assert_allclose(one.position, place, atol=1e-12)
    np.testing.assert_allclose(one.first_moment, 2.0 * np.array(from_joint), atol=1e-12)
