"""URDF and SDF, held against Pinocchio's reader and MuJoCo's, and the loops that lie beside them."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from balance.balancing.conditions import balance_conditions
from balance.closure import Closure
from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text

URDF = """<?xml version="1.0"?>
<robot name="arm"><!-- two -- hyphens --><gazebo reference="upper"/><gazebo><plugin filename="x.so"/></gazebo>
  <link name="ground"/>
  <link name="upper"><inertial><origin xyz="0.14 0 0"/><mass value="1.2"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.009" iyz="0" izz="0.009"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.11 0 0"/><mass value="0.9"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.005" iyz="0" izz="0.005"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="ground"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="10" velocity="10"/><dynamics damping="0.2" friction="0.1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
</robot>
"""
SKEW = """<robot name="skew"><link name="ground"/>
  <link name="a"><inertial><origin xyz="0.1 0.02 0.03" rpy="0.3 -0.2 0.5"/><mass value="1.3"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial>
    <visual><geometry><mesh filename="package://none.stl"/></geometry></visual></link>
  <link name="b"><inertial><mass value="0.7"/>
    <inertia ixx="0.01" iyy="0.011" izz="0.012" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0 0.1 0"/><mass value="0.2"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="counter_a"/><link name="fork"/>
  <joint name="turn" type="continuous"><parent link="ground"/><child link="a"/><axis xyz="0.6 0 0.8"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.1 0.4 -0.6"/></joint>
  <joint name="mount" type="fixed"><parent link="a"/><child link="counter_a"/><origin xyz="-0.2 0 0"/></joint>
  <joint name="swing" type="revolute"><parent link="a"/><child link="fork"/><origin xyz="0.3 0 0" rpy="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="fork"/><child link="b"/><axis xyz="0 3 4"/>
    <limit lower="-0.1" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="hold" type="fixed"><parent link="b"/><child link="tool"/><origin xyz="0 0 0.1" rpy="0 0 0.7"/></joint>
</robot>
"""


def loaded(folder: Path, text: str, sidecar: str = "", name: str = "robot") -> Mechanism:
    """A URDF in a folder, with a YAML beside it."""
    (folder / f"{name}.urdf").write_text(text, encoding="utf-8")
    if sidecar:
        (folder / "robot.yaml").write_text(sidecar, encoding="utf-8")
    return load_mechanism(folder / f"{name}.urdf")


def test_urdf_loads_with_every_joint_driven(tmp_path: Path) -> None:
    """A 2R arm as URDF: gravity along -z, friction and damping read, the printed conditions found."""
    arm = loaded(tmp_path, URDF)
    assert (arm.bodies, arm.coordinates) == (("upper", "fore"), ("shoulder", "elbow"))
    np.testing.assert_array_equal(arm.gravity, [0.0, 0.0, -9.81])
    assert (arm.viscous[0], arm.coulomb[0]) == (0.2, 0.1)
    found = balance_conditions(arm)
    assert found.rank == 4
    assert found.coefficients(0) == pytest.approx({"mcx[upper]": 1.0, "m[fore]": 0.3})
    np.testing.assert_allclose(found.values()[0], 1.2 * 0.14 + 0.9 * 0.3)


def test_urdf_is_what_pinocchio_reads(tmp_path: Path) -> None:
    """Skew axes and turned inertias, a fork without mass, fixed links: mass matrix and centre at random positions."""
    mine = loaded(tmp_path, SKEW).pinocchio_model()
    theirs = pinocchio.buildModelFromUrdf(str(tmp_path / "robot.urdf"))
    own, other, rng = mine.createData(), theirs.createData(), np.random.default_rng(2)
    for q in rng.uniform(-1.0, 1.0, (5, 3)):
        at = pinocchio.integrate(theirs, pinocchio.neutral(theirs), q)
        first, second = pinocchio.crba(mine, own, q), pinocchio.crba(theirs, other, at)
        np.testing.assert_allclose(first, second, atol=1e-14)
        np.testing.assert_allclose(
            pinocchio.centerOfMass(mine, own, q), pinocchio.centerOfMass(theirs, other, at), atol=1e-14
        )


def test_urdf_is_what_mujoco_reads(tmp_path: Path) -> None:
    """Without geometry, and with the bounds that a massless link needs."""
    mine = loaded(tmp_path, SKEW)
    spec = mujoco.MjSpec.from_string(SKEW.replace("<visual>", "<!--").replace("</visual>", "-->"))
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-14
    theirs = spec.compile()
    np.testing.assert_allclose(mine.limits[1:], theirs.jnt_range[1:])
    whole, data, own = np.empty((3, 3)), mujoco.MjData(theirs), mine.pinocchio_model()
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (5, 3)):
        data.qpos[:] = q
        mujoco.mj_forward(theirs, data)
        mujoco.mj_fullM(theirs, data, whole)
        np.testing.assert_allclose(pinocchio.crba(own, own.createData(), q), whole, atol=1e-12)


def test_links_without_mass_are_sites(tmp_path: Path) -> None:
    """A frame of a URDF may carry a counter-mass."""
    arm = loaded(tmp_path, SKEW)
    assert arm.counter_sites == ["counter_a"]
    np.testing.assert_allclose(arm.site("counter_a").position, [-0.2, 0.0, 0.0])
    assert arm.mass("tool") == pytest.approx(0.2)


def test_mimic_is_a_gear(tmp_path: Path) -> None:
    """A joint that follows another takes a freedom."""
    elbow = '<joint name="elbow" type="revolute">'
    arm = loaded(tmp_path, URDF.replace(elbow, elbow + '<mimic joint="shoulder" multiplier="-2" offset="0.1"/>'))
    assert balance_conditions(arm).dof == 1
    assert arm.loops[0].coefficients.tolist() == [0.1, -2.0, 0.0, 0.0, 0.0]


FOUR_BAR = """<robot name="loop"><link name="ground"/>
  <link name="crank"><inertial>
    <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="rod"><inertial>
    <mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="rocker"><inertial>
    <mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="end_A"/><link name="end_B"/>
  <joint name="j1" type="continuous"><parent link="ground"/><child link="crank"/>
    <axis xyz="0 0 1"/><origin rpy="0 0 1"/></joint>
  <joint name="j2" type="continuous"><parent link="crank"/><child link="rod"/>
    <axis xyz="0 0 1"/><origin xyz="0.2 0 0" rpy="0 0 -1"/></joint>
  <joint name="j3" type="continuous"><parent link="ground"/><child link="rocker"/>
    <axis xyz="0 0 1"/><origin xyz="0.5 0 0" rpy="0 0 1"/></joint>
  <joint name="e1" type="fixed"><parent link="rod"/><child link="end_A"/>
    <origin xyz="0.5 0 0"/></joint>
  <joint name="e2" type="fixed"><parent link="rocker"/><child link="end_B"/>
    <origin xyz="0.2 0 0" rpy="0 0 -1"/></joint>
</robot>
"""


@pytest.mark.parametrize(
    ("sidecar", "dof"),
    [
        ("closed_loop: [['end_A', 'e2']]\ntype: ['3D']\n", 1),
        (
            "closed_loop:\n  - [e1, end_B]\ntype: [3d]\nname_mot: [j1, none]\n"
            "joint_name: [none]\njoint_type: [FIXED]\n",
            1,
        ),
        ("closed_loop: [[end_A, end_B]]\ntype: [3d]\njoint_name: [j3]\njoint_type: [UJOINT_ZX]\n", 2),
        ("closed_loop: [[end_A, end_B]]\ntype: [3d]\njoint_name: [j2]\njoint_type: [SPHERICAL]\n", 2),
    ],
)
def test_loops_beside_a_urdf(tmp_path: Path, sidecar: str, dof: int) -> None:
    """Names of links or of joints, 3d in either case; joints of other kinds; absent joints are passed over."""
    robot = loaded(tmp_path, FOUR_BAR, sidecar)
    assert (len(robot.loops), balance_conditions(robot).dof) == (1, dof)
    again = mechanism_from_text(robot.text, "robot")
    np.testing.assert_array_equal(again.loops[0].first.position, robot.loops[0].first.position)
    assert robot.driven == again.driven == (("j1",) if "name_mot" in sidecar else ())


def test_home_chooses_how_a_urdf_is_put_together(tmp_path: Path) -> None:
    """Each branch of the four-bar, with the same crank, is where loops close from its joints as ``home``."""
    loops = "closed_loop: [[end_A, end_B]]\ntype: [3d]\nname_mot: [j1]\n"
    first, second = Closure(loaded(tmp_path, FOUR_BAR, loops)).configurations()[:2]
    for one in (first, second):
        home = ", ".join(f"{name}: {value}" for name, value in zip(("j1", "j2", "j3"), one.q, strict=True))
        robot = loaded(tmp_path, FOUR_BAR, f"{loops}home: {{{home}}}\n")
        for again in (robot, mechanism_from_text(robot.text, "robot")):
            assert again.branch == "home"
            np.testing.assert_allclose(Closure(again).home, one.q, atol=1e-9)
    assert np.abs(first.q - second.q).max() > 0.1


def test_a_loop_of_six_rows_holds_a_planar_linkage_still(tmp_path: Path) -> None:
    """6d, or no type: the axes coincide too, so that the last hinge is rigid."""
    robot = loaded(tmp_path, FOUR_BAR, "closed_loop: [['end_A', 'end_B']]\n")
    assert [loop.size for loop in robot.loops] == [6]
    assert list(robot.sites) == ["ground", "end_A", "end_B"]  # and none that the loop is tied at


@pytest.mark.parametrize(
    ("sidecar", "name", "message"),
    [
        ("closed_loop: [[end_A, nowhere]]\n", "robot", "names 'nowhere', which is no link and no joint"),
        ("closed_loop: [[end_A]]\n", "robot", "expected pairs"),
        ("closed_loop: {a: 1}\n", "robot", "closed_loop: expected a list"),
        ("closed_loop: [[end_A, end_B]\n", "robot", "no YAML"),
        ("closed_loop: !!timestamp x\n", "robot", "no YAML"),
        ("closed_loop: " + 3000 * "[", "robot", "no YAML"),
        (
            "closed_loop: [[end_A, end_B]]\n",
            "other",
            r"other\.urdf: the YAML file robot\.yaml states loops; name it other\.yaml",
        ),
        ("closed_loop: []\njoint_name: [j1]\njoint_type: [SCREW]\n", "robot", "'SCREW' of 'j1'"),
        (
            "home: {j7: 1.0}\n",
            "robot",
            "home in its YAML file names 'j7': expected joints that turn or slide: j1, j2, j3",
        ),
        ("home: {j1: .inf}\n", "robot", "home.j1: "),
    ],
)
def test_loops_that_are_not_understood(tmp_path: Path, sidecar: str, name: str, message: str) -> None:
    """Never an open tree in place of a loop."""
    with pytest.raises(ModelError, match=message):
        loaded(tmp_path, FOUR_BAR, sidecar, name)


def test_loops_of_another_machine_in_the_folder(tmp_path: Path) -> None:
    """The YAML of a URDF beside it is that one's: an arm in the same folder is an open tree."""
    assert loaded(tmp_path, FOUR_BAR, "closed_loop: [[end_A, end_B]]\ntype: [3d]\n").loops
    assert not loaded(tmp_path, URDF, name="arm").loops


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="revolute"', 'type="floating"', "of type 'floating': expected .*slides and a ball joint"),
        ('<child link="fore"/>', '<child link="none"/>', "joins link 'none'"),
        ('<parent link="ground"/>', '<parent link="fore"/>', "go round without the base"),
        ('xyz="0 0 1"', 'xyz="0 0 0"', "axis of joint 'shoulder'"),
        ('mass value="0.9"', 'mass value="heavy"', "value of the inertial of link 'fore' is 'heavy'"),
        ('name="elbow"', 'name="shoulder"', "'shoulder'.*no other joint"),
        ('<gazebo reference="upper"/>', '<gazebo><joint name="close"/></gazebo>', "<joint> 'close' is a loop.*YAML"),
        ('<gazebo reference="upper"/>', '<loop_joint name="close"/>', "<loop_joint> 'close' is a loop.*YAML"),
        (
            'reference="upper"/>',
            "><plugin><mimicJoint>tip</mimicJoint></plugin></gazebo>",
            "'tip' is a loop or coupling",
        ),
    ],
)
def test_urdf_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """One message that names the file and the element."""
    with pytest.raises(ModelError, match=rf"^robot\.urdf.*{message}"):
        loaded(tmp_path, URDF.replace(old, new))


def test_inertia_of_no_body(tmp_path: Path) -> None:
    """Is used as stated: izz of the forearm about the elbow is 0.5 + 0.9 0.11^2 kg m2, and the body is named."""
    model = loaded(tmp_path, URDF.replace('izz="0.005"', 'izz="0.5"'))
    _, row = model.own_mass["fore"]
    np.testing.assert_allclose(row[4:], [0.001, 0.0, 0.005 + 0.9 * 0.11**2, 0.0, 0.0, 0.5 + 0.9 * 0.11**2], atol=1e-12)
    assert (model.of_no_body, loaded(tmp_path, URDF).of_no_body) == (("fore",), ())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<robot/>",
        "<robot><link/>",
        "no xml",
        "<mujoco/>",
        '<robot name="a"><link name="g"/><!-- counterpoise loops: [1] --></robot>',
        '<robot name="a"><link name="g"/><!-- counterpoise loops: {bad} --></robot>',
    ],
)
def test_broken_urdf_is_refused(tmp_path: Path, text: str) -> None:
    """One message that names the file."""
    with pytest.raises(ModelError, match=r"^broken\.urdf"):
        loaded(tmp_path, text, name="broken")


SDF = """<sdf version="1.7"><world name="w"><gravity>0 -9.81 0</gravity><model name="m"><pose>0.1 0 0 0 0 0</pose>
  <frame name="far"><pose>0.3 0 0 0 0 0.5</pose></frame>
  <link name="upper"><inertial><pose>0.14 0 0 0 0 0</pose><mass>1.2</mass>
    <inertia><ixx>0.001</ixx><iyy>0.009</iyy><izz>0.009</izz></inertia></inertial></link>
  <link name="fore"><pose relative_to="elbow"/><inertial><mass>0.9</mass>
    <inertia><ixx>0.001</ixx><iyy>0.005</iyy><izz>0.005</izz></inertia></inertial></link>
  <joint name="shoulder" type="revolute"><parent>world</parent><child>upper</child>
    <axis><xyz>0 0 1</xyz><dynamics><damping>0.2</damping></dynamics></axis></joint>
  <joint name="elbow" type="revolute"><pose relative_to="far"/><parent>upper</parent><child>fore</child>
    <axis><xyz expressed_in="__model__">0 0 2</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
</model></world></sdf>
"""


def loaded_sdf(folder: Path, text: str) -> Mechanism:
    """An SDF in a folder."""
    (folder / "arm.sdf").write_text(text, encoding="utf-8")
    return load_mechanism(folder / "arm.sdf")


def test_sdf_frames_are_resolved(tmp_path: Path) -> None:
    """A link placed at its joint, the joint at a frame, an axis in the model: the 2R arm by its conditions."""
    arm = loaded_sdf(tmp_path, SDF)
    assert (arm.bodies, arm.coordinates) == (("upper", "fore"), ("shoulder", "elbow"))
    np.testing.assert_array_equal(arm.gravity, [0.0, -9.81, 0.0])
    np.testing.assert_allclose(arm.tree.joints[0].position, [0.1, 0.0, 0.0])
    np.testing.assert_allclose(arm.tree.joints[1].position, [0.3, 0.0, 0.0])
    np.testing.assert_allclose(arm.tree.joints[1].rotation[:, 0], [np.cos(0.5), np.sin(0.5), 0.0])
    np.testing.assert_array_equal(arm.limits, [[-np.inf, np.inf], [-1.0, 1.0]])
    assert balance_conditions(arm).coefficients(0) == pytest.approx({"mcx[upper]": 1.0, "m[fore]": 0.3})


def test_a_loop_of_an_sdf_is_closed(tmp_path: Path) -> None:
    """A link that two joints carry: a parallelogram of three links has one freedom, as an open tree it has three."""
    inertia = "<inertial><mass>1</mass></inertial>"
    links = "".join(
        f"<link name='{name}'><pose>{pose} 0 0 0</pose>{inertia}</link>"
        for name, pose in (("a", "0 0 0"), ("b", "0.5 0 0"), ("rod", "0 0.2 0"))
    )
    ends = (("world", "a", "a", "0"), ("world", "b", "b", "0"), ("a", "rod", "rod", "0"), ("b", "rod", "rod", "0.5"))
    joints = "".join(
        f"<joint name='{parent}-{child}' type='revolute'><pose relative_to='{at}'>{pose} 0 0 0 0 0</pose>"
        f"<parent>{parent}</parent><child>{child}</child><axis><xyz>0 0 1</xyz></axis></joint>"
        for parent, child, at, pose in ends
    )
    found = balance_conditions(
        loaded_sdf(tmp_path, f"<sdf version='1.7'><model name='m'>{links}{joints}</model></sdf>")
    )
    assert (found.dof, len(found.mechanism.loops), found.mechanism.total_mass) == (1, 1, pytest.approx(3.0))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</model>", "</model><model name='n'/>", "expected one <model> that moves, found 2"),
        ("</model>", "</model><include><uri>model://sun</uri></include>", "names the file 'sun', which is not there"),
        ("</model>", "</model><include><uri>../x.sdf</uri></include>", "outside the folder"),
        ("<link name=\"upper\">", "<link name=\"u\"/><link name=\"upper\">", "links u are joined to nothing"),
        ("relative_to=\"far\"", "relative_to=\"fore\"", "goes round"),
        ('type="revolute"><parent>', 'type="screw"><parent>', "of type 'screw'"),
        ("<limit>", "<mimic joint='none'/><limit>", "<mimic>: expected two joints of one axis each"),
        ("<child>fore<", "<child>upper<", "joins link 'upper' to itself"),
        ("version=\"1.7\"", "version='one'", "a version such as"),
        ("<inertial><mass>", "<inertial auto='true'><mass>", "'fore' is to be found from geometry"),
        ("</model>", "<drake:ball_constraint name='tie'/></model>", "<ball_constraint> 'tie' is a loop"),
        ("</inertia></inertial></link>", "</inertia><fluid_added_mass/></inertial></link>", "<fluid_added_mass> is"),
        ("</model>", "</model><joint name='j' type='fixed'/>", "joint 'j' of the <world>"),
        ('<model name="m">', '<model name="m"><static>1</static>', "found 0 .and 1 static"),
        ("</model>", "<model name='n'>" * 60 + "</model>" * 61, "models are nested more than 50 deep"),
        ('<model name="m">', '<model name="m" placement_frame="far">', "a placement_frame is not read"),
    ],
)  # fmt: skip
def test_sdf_that_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    """One message that names the file and the element."""
    with pytest.raises(ModelError, match=rf"^arm\.sdf.*{message}"):
        loaded_sdf(tmp_path, SDF.replace(old, new))


def test_mimic_in_an_sdf_is_a_gear(tmp_path: Path) -> None:
    """elbow = 2 (shoulder - 0.1) + 0.3, as the format defines it."""
    gear = "<mimic joint='shoulder'><multiplier>2</multiplier><offset>0.3</offset><reference>0.1</reference></mimic>"
    closure = Closure(loaded_sdf(tmp_path, SDF.replace("<limit>", f"{gear}<limit>")))
    assert closure.dof == 1
    q = closure.states(5)
    np.testing.assert_allclose(q[:, 1], 2.0 * (q[:, 0] - 0.1) + 0.3, atol=1e-12)


@pytest.mark.parametrize(
    ("place", "include"),
    [
        ("arm/model.sdf", "<world name='w'><include><uri>model://arm</uri></include></world>"),
        ("own.sdf", "<include><uri>own.sdf</uri><pose>0.1 0 0 0 0 0</pose></include>"),
        ("own.sdf", "<model name='m'><pose>0.1 0 0 0 0 0</pose><include merge='true'><uri>own.sdf</uri>"
         "</include></model>"),
    ],
)  # fmt: skip
def test_a_model_that_an_sdf_includes(tmp_path: Path, place: str, include: str) -> None:
    """As if written there; the text that is stored is whole."""
    alone = loaded_sdf(tmp_path, SDF)
    start, end = SDF.index("<model"), SDF.index("</model>")
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).write_text(f"<sdf version='1.7'>{SDF[start:end]}</model></sdf>", encoding="utf-8")
    text = f"<sdf version='1.7'>{include}</sdf>"
    arm = loaded_sdf(tmp_path, text)
    for one in (arm, mechanism_from_text(arm.text, "arm")):
        np.testing.assert_array_equal(one.parameters, alone.parameters)
        np.testing.assert_allclose(one.tree.joints[0].position, [0.1, 0.0, 0.0])


def test_models_nested_in_an_sdf(tmp_path: Path) -> None:
    """The arm whose forearm is a model of its own, joined by frames: the same arm; a static model stands still."""
    flat = loaded_sdf(tmp_path, SDF)
    start, end = SDF.index('<link name="fore">'), SDF.index('<joint name="shoulder"')
    fore = SDF[start:end].replace('<pose relative_to="elbow"/>', "<pose>0 0 0 0 0 0.2</pose>")
    nested = (
        f"<model name='tip'><pose relative_to='far'>0 0 0 0 0 -0.2</pose>{fore}"
        "<frame name='grip' attached_to='fore'/></model>"
    )
    text = SDF[:start] + nested + SDF[end:].replace("<child>fore<", "<child>tip::grip<")
    ground = "</model><model name='ground'><static>true</static><link name='plane'/></model>"
    arm = loaded_sdf(tmp_path, text.replace("</model></world>", f"{ground}</world>"))
    assert arm.bodies == ("upper", "tip::fore")
    np.testing.assert_allclose(arm.parameters, flat.parameters, atol=1e-15)
    for one, other in zip(arm.tree.joints, flat.tree.joints, strict=True):
        np.testing.assert_allclose(one.position, other.position, atol=1e-15)
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-15)


def test_what_simulators_add_to_joints(tmp_path: Path) -> None:
    """Drake's rotor, gear and mimic, without their namespace declared; springs and links without weight are said."""
    motor = "<drake:gear_ratio value='10'/><drake:rotor_inertia value='2e-4'/>"
    text = SDF.replace("</axis></joint>\n  <joint", f"</axis>{motor}</joint>\n  <joint")
    text = text.replace("<limit>", "<dynamics><spring_stiffness>3</spring_stiffness></dynamics><limit>")
    text = text.replace('<link name="fore">', '<link name="fore"><gravity>false</gravity>')
    arm = loaded_sdf(tmp_path, text)
    np.testing.assert_allclose(arm.armature, [0.02, 0.0])
    assert arm.left_out == ("springs of joints elbow", "weight taken off bodies (gravcomp)")
    gear = "<drake:mimic joint='shoulder' multiplier='2' offset='0.1'/>"
    (coupling,) = loaded_sdf(tmp_path, SDF.replace("<child>fore</child>", f"<child>fore</child>{gear}")).loops
    assert coupling.coefficients[:2].tolist() == [0.1, 2.0]
    motor = "<transmission><joint name='elbow'/><actuator name='m'>{}</actuator></transmission></robot>"
    urdf = URDF.replace("</robot>", motor.format("<drake:gear_ratio value='10'/><drake:rotor_inertia value='2e-4'/>"))
    np.testing.assert_allclose(loaded(tmp_path, urdf).armature, [0.0, 0.02])


def test_inertia_below_what_mujoco_takes(tmp_path: Path) -> None:
    """A point mass that a file gives 1e-20 kg m2, since others refuse none, has it."""
    text = SDF.replace(
        "<ixx>0.001</ixx><iyy>0.009</iyy><izz>0.009</izz>", "<ixx>1e-20</ixx><iyy>1e-20</iyy><izz>1e-20</izz>"
    )
    arm = loaded_sdf(tmp_path, text)
    np.testing.assert_allclose(arm.parameters[0, 4:], [1e-20, 0.0, 1.2 * 0.14**2, 0.0, 0.0, 1.2 * 0.14**2], rtol=1e-12)
