"""Mechanisms by name and from MJCF files: names, loops, keyframe, motors, gravity."""

import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from balance import datasets
from balance.closure import Closure
from balance.errors import DataError, ModelError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text

from .. import models, referees


@pytest.mark.parametrize("name", models.BUILT_IN)
def test_shipped_mechanisms_load_by_name(name: str) -> None:
    """Every shipped mechanism loads, closes at its keyframe, and is found by name as by path."""
    mechanism = models.load(name)
    assert mechanism.name == name
    assert Closure(mechanism).residual(mechanism.home[None]).max() < 1e-14
    by_path = load_mechanism(datasets.ROOT / "mechanisms" / f"{name}.xml")
    np.testing.assert_array_equal(by_path.parameters, mechanism.parameters)


def test_every_shipped_mechanism_says_where_it_is_from() -> None:
    """Each file begins with a comment on its geometry, its source or what is assumed, and its units."""
    for name in datasets.dataset_names("mechanisms", ".xml"):
        text = (datasets.ROOT / "mechanisms" / f"{name}.xml").read_text(encoding="utf-8")
        assert text.startswith("<!--")
        assert len(text.split("-->")[0]) > 100


def test_text_and_file_are_the_same_mechanism() -> None:
    """A result can be computed anew from the text that was stored with it."""
    stored = models.load("four-bar")
    again = mechanism_from_text(stored.text, stored.name)
    assert (again.name, again.bodies, again.driven) == (stored.name, stored.bodies, stored.driven)
    np.testing.assert_array_equal(again.pi, stored.pi)


def test_printed_masses_are_in_the_manipulator() -> None:
    """Sheet A: 1.04642 kg at 59.43 mm, 0.58909 kg at 18.70 mm, 1.451 kg of platform; both models weigh the same."""
    reduced, whole = (models.load(name) for name in models.MANIPULATORS)
    assert (reduced.mass("A0A"), reduced.mass("AC"), reduced.mass("platform")) == (1.04642, 0.58909, 1.451)
    np.testing.assert_allclose(reduced.centre("A0A"), [0.05943, 0.0, 0.0])
    assert whole.total_mass == pytest.approx(reduced.total_mass, abs=1e-12)


def test_other_files_are_refused(tmp_path: Path) -> None:
    """An ending that is no mechanism's, and a name that is neither shipped nor a file."""
    (tmp_path / "arm.step").write_text("solid", encoding="utf-8")
    with pytest.raises(ModelError, match=r"arm\.step: expected a MJCF \(\.xml, \.mjcf\), URDF"):
        load_mechanism(tmp_path / "arm.step")
    with pytest.raises(DataError, match=r"six-bar: no such file.*four-bar.*serial-1r"):
        load_mechanism("six-bar")


def test_a_file_in_another_encoding(tmp_path: Path) -> None:
    """A file that is not UTF-8 is refused with its name."""
    text = models.load("serial-1r").text.replace("All values assumed", "Tüm değerler varsayılmış")
    (tmp_path / "arm.xml").write_bytes(text.encode("cp1254"))
    with pytest.raises(ModelError, match=r"arm\.xml: not in UTF-8"):
        load_mechanism(tmp_path / "arm.xml")


def test_a_body_fixed_to_another_has_its_own_mass() -> None:
    """A payload set on a fixed part changes that part, not the body that carries it."""
    arm = models.model(models.skew_arm())
    assert (arm.mass("hand"), arm.mass("tool")) == (pytest.approx(1.3), pytest.approx(0.4))
    heavier = arm.with_payload({"tool": 1.4})
    assert heavier.total_mass - arm.total_mass == pytest.approx(1.0)
    text = models.skew_arm()
    by_file = text.replace(models.inertial(0.4), models.inertial(0.4).replace(
        'mass="0.4" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"',
        'mass="1.4" fullinertia="0.07 0.105 0.14 0.0035 0.007 0.0105"',
    ))  # fmt: skip
    np.testing.assert_allclose(heavier.parameters, models.model(by_file).parameters, atol=1e-12)


def test_the_pinocchio_model_carries_the_loads() -> None:
    """Going on with Pinocchio: total mass and gravity are those of the mechanism with its loads."""
    import pinocchio

    mechanism = models.loaded("parallelogram-6bar")
    model = mechanism.pinocchio_model()
    assert pinocchio.computeTotalMass(model) == pytest.approx(mechanism.total_mass)
    np.testing.assert_array_equal(model.gravity.linear, mechanism.gravity)


def test_without_mujoco_the_message_says_how_to_get_it() -> None:
    """MuJoCo hidden: one message that names the package."""
    code = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from balance.mechanism.mjcf_parser import load_mechanism\nfrom balance.errors import ModelError\n"
        "try: load_mechanism('four-bar')\n"
        "except ModelError as error: print(error)\n"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'mujoco-core' with pip" in shown


def test_joint_references_and_degrees_agree_with_mujoco() -> None:
    """Angles in degrees, a reference position, bodies turned by axis and angle: the same motion as MuJoCo's."""
    from ..dynamics.test_inverse_dynamics import assert_mujoco_agrees

    text = models.skew_arm().replace('<compiler angle="radian"/>', "")
    text = text.replace('euler="0.3 -0.5 0.2"', 'axisangle="0.6 0 0.8 40"').replace(
        'euler="0.1 0.4 -0.6"', 'euler="6 23 -34"'
    )
    text = text.replace('name="turn"', 'name="turn" ref="20"')
    assert_mujoco_agrees(models.model(text), text)
    assert referees.random_motion(models.model(text)).residual == 0.0


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
    """MuJoCo's default where none is stated, the last one where it is stated twice."""
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


@pytest.mark.parametrize(
    ("keyframe", "said"),
    [
        (
            "110 6.2",
            r"m\.xml: in 'start' hinges are more than one turn \(6\.283 rad\) from zero: j = 110 rad \(1\.92 if",
        ),
        ("0.2 -90", r"zero: j2 = -90 rad \(-1\.571 if degrees\); keyframes are in radians, with <compiler angle="),
        ("-6.2 6.2", None),
    ],
)
def test_degrees_in_a_keyframe_are_warned_of(tmp_path, keyframe, said) -> None:
    """MuJoCo takes a keyframe's angles as radians whatever the file's; a slide may go as far as it likes."""
    inner = models.link("", "s", '<joint name="s" type="slide" axis="1 0 0"/>')
    hinges = models.link(models.link(inner, "j2"), "j")
    text = models.mjcf(hinges, models.key([*map(float, keyframe.split()), 50.0], "start"))
    (tmp_path / "m.xml").write_text(text.replace('"radian"', '"degree"'), encoding="utf-8")
    with pytest.warns(UserWarning, match=said) if said else nullcontext():
        mechanism = load_mechanism(tmp_path / "m.xml")
    assert mechanism.home.tolist() == [*map(float, keyframe.split()), 50.0]  # as MuJoCo reads them
