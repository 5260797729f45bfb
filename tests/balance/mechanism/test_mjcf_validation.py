"""What is refused in a mechanism file, by name: elements that are not understood, inertias of no rigid body."""

import numpy as np
import pytest

from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.mechanism.mjcf_validation import principal_inertias

from .. import models

HINGE = '<joint name="j" axis="0 0 1"/>'


def pair(equality: str = "", attributes: str = "", hinge: str = HINGE, tail: str = "", options: str = "") -> str:
    """Two bodies, each with a site, and whatever a case puts where."""
    first = f'<body name="a" {attributes}>{hinge}{models.inertial()}<site name="s1" pos="0.3 0 0"/></body>'
    second = models.link('<site name="s2"/>', "b", place='pos="0.5 0 0"')
    return models.mjcf(first + second, f"<equality>{equality}</equality>{tail}", options)


LOOPS = {
    "gears": ('<joint joint1="j" joint2="b" polycoef="0 2 0 0 0"/>', r"joint1='j'.*coupling between joints \(gears\)"),
    "tendon coupling": ('<tendon tendon1="t"/>', "coupling between tendons"),
    "inactive": ('<connect site1="s1" site2="s2" active="false"/>', "connect.*not active"),
    "no such site": ('<connect site1="s1" site2="s9"/>', "no site 's9'"),
    "no such body": ('<weld body1="a" body2="c"/>', "no body 'c'"),
    "one site": ('<connect site1="s1"/>', "expected site1 and site2"),
    "site to body": ('<connect site1="s1" body2="b"/>', "expected site1 and site2, or body1"),
    "no ends": ('<connect name="loose"/>', "loose.*expected site1 and site2"),
    "to itself": ('<connect site1="s1" site2="s1"/>', "ties a site to itself"),
    "pose and anchor": (
        '<weld body1="a" body2="b" relpose="0 0 0 1 0 0 0" anchor="1 0 0"/>', "anchor together with relpose"
    ),
    "anchor of two": ('<connect body1="a" body2="b" anchor="1 0"/>', "expected 3 finite numbers in anchor"),
}  # fmt: skip


@pytest.mark.parametrize("case", LOOPS)
def test_loops_that_are_not_understood(case: str) -> None:
    """A constraint that is not understood is refused, never dropped."""
    equality, message = LOOPS[case]
    with pytest.raises(ModelError, match=rf"test\.xml: .*{message}"):
        models.model(pair(equality))


NUMBERS = {
    "a word": ({"attributes": 'pos="0.2 abc 0.4"'}, "expected 3 finite numbers in pos"),
    "commas": ({"attributes": 'pos="0,2 0,3 0,4"'}, "expected 3 finite numbers in pos"),
    "too few": ({"attributes": 'euler="0.2 0.4"'}, "expected 3 finite numbers in euler"),
    "not a number": ({"attributes": 'pos="nan 0 0"'}, "expected 3 finite numbers in pos"),
    "infinite": ({"hinge": '<joint name="j" axis="inf 0 0"/>'}, "expected 3 finite numbers in axis"),
    "no axis": ({"hinge": '<joint name="j" axis="0 0 0"/>'}, "an axis of some length"),
    "long turn axis": ({"attributes": 'axisangle="1 2 3 0.5"'}, "axis of length 1 in axisangle"),
    "damping law": ({"hinge": '<joint name="j" damping="0.1 0.2 0.3"/>'}, "expected 1 finite number in damping"),
    "gravity": ({"options": '<option gravity="0 inf 0"/>'}, "gravity is '0 inf 0': expected 3 numbers"),
    "spring": ({"hinge": '<joint name="j" stiffness="20"/>'}, "joint 'j' has a spring"),
    "negative mass": ({"hinge": HINGE + '<inertial pos="0 0 0" mass="-1" diaginertia="1 1 1"/>'}, "a mass of zero or"),
}


@pytest.mark.parametrize("case", NUMBERS)
def test_what_is_no_number(case: str) -> None:
    """A text that is no number, or too few of them, would become zero."""
    where, message = NUMBERS[case]
    with pytest.raises(ModelError, match=message):
        models.model(pair(**where))


SETTINGS = {
    "total mass": ({"options": '<compiler settotalmass="10"/>'}, "settotalmass is not read"),
    "repaired inertia": ({"options": '<compiler balanceinertia="true"/>'}, "balanceinertia is not read"),
    "no gravity": ({"options": '<option><flag gravity="disable"/></option>'}, "gravity is not read"),
    "fixed axes": ({"options": '<compiler eulerseq="ZYX"/>'}, "turns about fixed axes"),
    "weight taken off": ({"attributes": 'gravcomp="1"'}, "gravcomp is not read"),
    "include": ({"tail": '<include file="other.xml"/>'}, "<include> is not read"),
    "default off": (
        {"equality": '<connect site1="s1" site2="s2"/>', "tail": '<default><equality active="false"/></default>'},
        "not active",
    ),
    "default spring": ({"tail": '<default><joint stiffness="1"/></default>'}, "spring"),
    "ball joint": ({"hinge": '<joint name="j" type="ball"/>'}, "'j' is of kind Spherical"),
    "free joint": ({"hinge": '<freejoint name="j"/>'}, "kind FreeFlyer|Unknown|free"),
    "unknown joint": ({"hinge": '<joint name="j" type="hing"/>'}, r"cannot read this mechanism: Unknown joint type$"),
    "nameless body": ({"attributes": "", "hinge": HINGE + '<body><joint name="k"/></body>'}, "give every body a name"),
    "nameless joint": ({"hinge": "<joint/>"}, "give every joint a name"),
    "twice a body": ({"hinge": HINGE + '<body name="b"><joint name="k"/></body>'}, "two of <body> have the name 'b'"),
    "twice a joint": ({"hinge": '<joint name="b"/>'}, "two of <joint> have the name 'b'"),
    "unknown motor": ({"tail": '<actuator><motor joint="x"/></actuator>'}, "drives joint 'x': there are j, b"),
    "unknown payload": ({"tail": '<custom><text name="payload" data="x"/></custom>'}, "body 'x': there are a, b"),
    "unknown radius": (
        {"tail": '<custom><numeric name="x.radius_of_gyration" data="0.1"/></custom>'}, "site 'x': there are s1, s2"
    ),
    "negative radius": (
        {"tail": '<custom><numeric name="s1.radius_of_gyration" data="-1"/></custom>'}, "s1.*expected zero or more"
    ),
    "no radius": (
        {"tail": '<custom><numeric name="s1.radius_of_gyration" data="wide"/></custom>'}, "'wide': expected 1 number"
    ),
    "short keyframe": ({"tail": '<keyframe><key name="home" qpos="1"/></keyframe>'}, "Keyframe size"),
    "wordy keyframe": ({"tail": '<keyframe><key name="home" qpos="1 up"/></keyframe>'}, "numbers in qpos"),
    "nameless keyframe": ({"tail": '<keyframe><key qpos="1 2"/></keyframe>'}, "expected a name"),
}  # fmt: skip


@pytest.mark.parametrize("case", SETTINGS)
def test_settings_that_change_the_motion(case: str) -> None:
    """Settings that are not read, names that are missing or twice, and what refers to nothing."""
    where, message = SETTINGS[case]
    with pytest.raises(ModelError, match=message):
        models.model(pair(**where))


HARMLESS = {
    "spring of none": {"hinge": '<joint name="j" stiffness="0.0"/>'},
    "local coordinates": {"options": '<compiler coordinate="local" eulerseq="xyz"/>'},
    "active": {"equality": '<connect site1="s1" site2="s2" active="true"/>'},
    "geometry": {"hinge": HINGE + '<geom type="sphere" size="0.1"/>', "tail": "<visual/><asset/>"},
    "comments": {"tail": "<!-- <equality><joint/></equality> -->"},
}


@pytest.mark.parametrize("case", HARMLESS)
def test_what_changes_nothing_is_accepted(case: str) -> None:
    """Switches in their neutral position, geometry and comments do not stand in the way."""
    assert models.model(pair(**HARMLESS[case])).bodies == ("a", "b")


def test_the_base_is_the_world() -> None:
    """A pose of the base would move the origin of all moments: refused; of a body in it, it is read."""
    text = pair()
    with pytest.raises(ModelError, match=r"name='base' pos='1 0 0'.*pose"):
        models.model(text.replace('name="base"', 'name="base" pos="1 0 0"'))


@pytest.mark.parametrize("bodies", ["", '<body name="one"/><body name="two"/>'])
def test_one_tree_under_the_world(bodies: str) -> None:
    """Two trees, or none: refused, naming what was found."""
    with pytest.raises(ModelError, match=r"expected one <body name='base'>.*found (0: none|2: one, two)"):
        models.model(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")


def test_a_base_without_joints_moves_nothing() -> None:
    """No joint, no mechanism."""
    with pytest.raises(ModelError, match="no moving body"):
        models.model(models.mjcf('<body name="wall"/>'))


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "not well-formed"), ("<mujoco><worldbody>", "not well-formed"), ("<html/>", "root <mujoco>, found <html>")],
)
def test_what_is_no_mjcf(text: str, message: str) -> None:
    """Broken XML and other XML."""
    with pytest.raises(ModelError, match=message):
        models.model(text)


_ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><body name="arm">
<joint name="J" type="hinge" axis="0 0 1"/><inertial pos="0.1 0 0" mass="{mass}" diaginertia="{inertia}"/>
</body></body></worldbody></mujoco>"""


def arm(mass: str, inertia: str) -> Mechanism:
    """One body that turns about z."""
    return mechanism_from_text(_ARM.format(mass=mass, inertia=inertia), "arm")


def test_a_rod_a_disc_and_a_point_are_bodies() -> None:
    """Limits of what is possible: equality in A + B >= C for a flat body, zero for a point."""
    for inertia in ("0 0.01 0.01", "0.01 0.01 0.02", "0 0 0"):
        assert arm("1", inertia).mass("arm") == 1.0


def test_an_inertia_larger_than_the_sum_of_the_others_is_refused() -> None:
    """MuJoCo refuses it too."""
    import mujoco

    with pytest.raises(ModelError, match=r"'arm'.*sum of the other two"):
        arm("1", "0.001 0.001 0.05")
    with pytest.raises(ValueError, match="inertia must satisfy"):
        mujoco.MjModel.from_xml_string(_ARM.format(mass="1", inertia="0.001 0.001 0.05"))


def test_a_mechanism_without_mass_is_refused() -> None:
    """Nothing to balance is not balanced."""
    with pytest.raises(ModelError, match="no moving body has mass"):
        arm("0", "0 0 0")


def test_principal_inertias_are_about_the_centre_of_mass() -> None:
    """Steiner: the parameters are about the joint, 0.1 m from the centre."""
    assert principal_inertias(arm("2", "0.01 0.02 0.025").parameters[0]) == pytest.approx(
        np.array([0.01, 0.02, 0.025]), rel=1e-12
    )
