"""MJCF means what MuJoCo says: idioms held against its own dynamics; what is refused, by name, in one line."""

import threading
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest

from balance.errors import ModelError
from balance.mechanism import mjcf_compiler
from balance.mechanism.forward_kinematics import motion, pose
from balance.mechanism.loop_constraints import constraint_bias, constraints_at
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.mechanism.tape import Symbols

from .. import models

HINGE = '<joint name="j" axis="0 0 1"/>'


def pair(equality: str = "", attributes: str = "", hinge: str = HINGE, tail: str = "", options: str = "") -> str:
    """Two bodies, each with a site, and whatever a case puts where."""
    first = f'<body name="a" {attributes}>{hinge}{models.inertial()}<site name="s1" pos="0.3 0 0"/></body>'
    second = models.link('<site name="s2"/>', "b", place='pos="0.5 0 0"')
    return models.mjcf(first + second, f"<equality>{equality}</equality>{tail}", options)


BOX = '<geom type="box" size="0.1 0.02 0.01" pos="0.1 0.01 0"/>'
WEDGE = "<mesh name='w' vertex='0 0 0 0.3 0 0 0 0.1 0 0 0 0.05 0.3 0 0.05' scale='1 1.5 1'/>"
IDIOMS = {
    "several roots, nothing named": f"""<worldbody><body pos='1 0 0'><joint/>{BOX}</body>
        <body><joint/>{BOX}</body></worldbody>""",
    "default mass of geoms": """<default><geom mass='0.3' type='sphere' size='0.05'/>
          <default class='d'><geom density='500'/></default></default>
        <worldbody><body><joint axis='0 0 1'/><geom pos='0.1 0 0'/><geom class='d' pos='0.2 0 0' size='0.02'/></body>
        </worldbody>""",
    "class under childclass": """<default><joint axis='0 0 1'/><geom type='capsule' size='0.01' density='2700'/>
          <default class='arm'><joint axis='0 1 0'/><geom size='0.02'/></default>
          <default class='steel'><geom density='7850' type='box' size='0.03 0.02 0.01'/></default></default>
        <worldbody><body childclass='arm'><joint/><geom fromto='0 0 0 0.25 0 0'/>
          <body pos='0.25 0 0'><joint class='main'/><geom class='steel' pos='0.1 0.01 0'/></body></body></worldbody>""",
    "mass of a mesh": f"""<asset>{WEDGE}</asset><worldbody><body><joint axis='0 0 1'/>
        <geom type='mesh' mesh='w' density='1200' pos='0.01 0.02 0.03'/></body></worldbody>""",
    "mesh of a body with an inertia": f"""<asset>{WEDGE}</asset><worldbody><body><joint axis='0 0 1'/>
        {models.inertial()}<geom type='mesh' mesh='w'/></body></worldbody>""",
    "reference of two joints of a body": f"""<compiler angle='degree'/><worldbody><body>
        <joint axis='0 1 1' pos='0.1 0 0' ref='20'/><joint axis='0 1 0' pos='0 0.1 0.2' ref='-15'/>
        <joint type='slide' axis='1 0 1' ref='0.04'/>{models.inertial()}</body></worldbody>""",
    "two compilers": f"""<compiler angle='radian' eulerseq='XYZ'/><worldbody><body euler='30 20 10'>
        <joint axis='0 0 1'/>{BOX}</body></worldbody><compiler angle='degree' eulerseq='zyx'/>""",
    "frames": f"""<worldbody><frame pos='0.1 0.2 0.3' euler='0 0 90'><body><joint axis='0 0 1'/>
        <frame euler='0 30 0'>{BOX}</frame><frame pos='0.15 0 0'><body><joint axis='0 1 0'/>{BOX}</body></frame>
        </body></frame></worldbody>""",
    "replicate": f"""<worldbody><body><joint axis='0 0 1'/>{BOX}<replicate count='3' euler='0 0 90'>
        <body pos='0.2 0 0'><joint axis='0 1 0'/>{BOX}</body></replicate></body></worldbody>""",
    "fixed bodies": f"""<worldbody><body pos='0 0 1'>{BOX}<body euler='20 0 0'><joint axis='0 0 1'/>{BOX}
        <body euler='0 40 0'>{BOX}</body></body></body></worldbody>""",
    "a least mass": f"""<compiler boundmass='2'/><worldbody><body><joint axis='0 0 1'/>{BOX}</body></worldbody>""",
    "springs, contacts, limits, textures": """<asset><material name='m' texture='t'/>
          <texture type='2d' builtin='checker' width='9' height='9' name='t'/></asset>
        <worldbody><body><joint stiffness='3' range='-9 9' springref='4'/>
          <geom type='box' size='0.1 0.02 0.01' material='m'/></body></worldbody>""",
    "a point mass": """<worldbody><body><joint axis='0 0 1'/>
        <inertial pos='0.1 0 0' mass='1' diaginertia='1e-9 1e-9 1e-9'/></body></worldbody>""",
}


@pytest.mark.parametrize("case", IDIOMS)
def test_the_mass_matrix_is_mujocos(case: str) -> None:
    """At random configurations: masses, inertias, axes and frames all enter it."""
    text = f"<mujoco>{IDIOMS[case]}</mujoco>"
    mine, theirs = models.model(text), mujoco.MjModel.from_xml_string(text)
    model, data = mine.pinocchio_model(), mujoco.MjData(theirs)
    own, whole, rng = model.createData(), np.empty((theirs.nv, theirs.nv)), np.random.default_rng(3)
    for q in rng.uniform(-2.0, 2.0, (5, theirs.nq)):
        data.qpos[:] = q
        mujoco.mj_forward(theirs, data)
        mujoco.mj_fullM(theirs, data, whole)
        other = pinocchio.crba(model, own, q)
        np.testing.assert_allclose(other, whole, atol=1e-13 * np.abs(whole).max())
        np.testing.assert_allclose(
            pinocchio.centerOfMass(model, own, q) * mine.total_mass, moving_moment(theirs, data), atol=1e-13
        )


def moving_moment(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """First moment of the bodies that move, (3,) [kg m]."""
    moving = model.body_weldid != 0
    return model.body_mass[moving] @ data.xipos[moving]


def test_a_ball_joint_is_three_hinges_about_one_point() -> None:
    """Any orientation up to a quarter turn from the keyframe: centre of mass and energy as MuJoCo has them."""
    body = f"<body pos='0.1 0.2 0'><joint name='k' type='ball' pos='0.05 0 0.1'/>{models.inertial()}</body>"
    text = (
        f"<mujoco><worldbody>{body}</worldbody><keyframe><key name='home' qpos='0.5 0.5 -0.5 0.5'/></keyframe></mujoco>"
    )
    mine, theirs = models.model(text), mujoco.MjModel.from_xml_string(text)
    assert mine.coordinates == ("k_x", "k_y", "k_z")
    model, data = mine.pinocchio_model(), mujoco.MjData(theirs)
    own, whole = model.createData(), np.empty((3, 3))
    for q in np.random.default_rng(5).uniform(-1.2, 1.2, (5, 3)):
        quaternion, turn = np.array([0.5, 0.5, -0.5, 0.5]), np.empty(4)
        rates = np.empty((3, 3))
        after = np.array([1.0, 0.0, 0.0, 0.0])
        for k in (2, 1, 0):
            inverse, rates[:, k] = np.empty(4), np.eye(3)[k]
            mujoco.mju_negQuat(inverse, after)
            mujoco.mju_rotVecQuat(rates[:, k].copy(), np.eye(3)[k], inverse)
            axis = np.empty(3)
            mujoco.mju_rotVecQuat(axis, np.eye(3)[k], inverse)
            rates[:, k] = axis
            mujoco.mju_axisAngle2Quat(turn, np.eye(3)[k], q[k])
            mujoco.mju_mulQuat(after, turn, after.copy())
        mujoco.mju_mulQuat(data.qpos, quaternion, after)
        mujoco.mj_forward(theirs, data)
        mujoco.mj_fullM(theirs, data, whole)
        np.testing.assert_allclose(pinocchio.crba(model, own, q), rates.T @ whole @ rates, atol=1e-13)
        np.testing.assert_allclose(pinocchio.centerOfMass(model, own, q) * 1.3, moving_moment(theirs, data), atol=1e-13)


def test_limits_of_slides_are_metres() -> None:
    """Degrees are for hinges alone."""
    body = f"<joint name='x' type='slide' range='-0.1 0.2'/><joint name='y' range='-90 90'/>{models.inertial()}"
    limits = models.model(f"<mujoco><worldbody><body>{body}</body></worldbody></mujoco>").limits
    np.testing.assert_allclose(limits, [[-0.1, 0.2], [-np.pi / 2, np.pi / 2]])


def test_a_massless_body_stays_massless() -> None:
    """MuJoCo takes none: it is given the least and rid of it."""
    inner = f"<body name='rod'><joint name='k' axis='0 1 0'/>{models.inertial()}</body>"
    fork = models.model(f"<mujoco><worldbody><body name='fork'><joint name='j'/>{inner}</body></worldbody></mujoco>")
    assert (fork.parameters[0] == 0.0).all()
    assert fork.total_mass == pytest.approx(1.3)


@pytest.mark.parametrize("other", ["1e-18", "1e-7"])
def test_a_mechanism_too_small_for_mujoco_is_refused(other: str) -> None:
    """An inertia of 1e-18 kg m2 would be read as zero: refused, unless another is so large that it does not count."""
    bodies = "".join(
        f"<body name='{name}'><joint axis='0 0 1'/><inertial pos='1e-4 0 0' mass='1e-9' diaginertia='{i} {i} {i}'/>"
        "</body>"
        for name, i in (("small", "1e-18"), ("large", other))
    )
    text = f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
    if other == "1e-7":
        assert models.model(text).total_mass == pytest.approx(2e-9)
    else:
        with pytest.raises(ModelError, match="body 'small' has an inertia of 1e-18 kg m2, which MuJoCo takes for none"):
            models.model(text)


def test_gears_of_a_file_are_couplings() -> None:
    """A joint equality with a polynomial: MuJoCo's residual and Jacobian, and one freedom less."""
    text = pair('<joint joint1="j" joint2="b" polycoef="0.1 2 0.3 -0.2 0.05"/>', hinge='<joint name="j" ref="0.3"/>')
    mine, theirs = models.model(text), mujoco.MjModel.from_xml_string(text)
    assert mine.loops[0].name == "joint j-b"
    data, q, v = mujoco.MjData(theirs), np.array([0.4, 0.7]), np.array([0.3, -1.1])
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(theirs, data)
    row = np.empty((1, 2))
    mujoco.mju_copy(row[0], data.efc_J[:2])

    def bias_of(q: Symbols, v: Symbols) -> Symbols:
        return constraint_bias(mine.loops, at := pose(mine.tree, q), motion(mine.tree, at, v))

    h = 1e-5
    gaps, jacobians = constraints_at(mine.tree, mine.loops, np.array([q, q + h * v, q - h * v]))
    np.testing.assert_allclose(gaps[0], data.efc_pos[:1], atol=1e-15)
    np.testing.assert_allclose(jacobians[0], row, atol=1e-15)
    rate = jacobians[1:, 0] @ v
    bias = float(models.evaluated(bias_of, q[:, None], v[:, None])[0, 0])
    assert bias == pytest.approx((rate[0] - rate[1]) / (2 * h), rel=1e-8)


def test_what_a_torque_leaves_out_is_known() -> None:
    """Springs, media, actuators that drive no joint: said, not refused."""
    found = models.model(pair(hinge='<joint name="j" stiffness="2"/>', options='<option density="1"/>')).left_out
    assert found == ("springs of joints j", "the medium (<option density, viscosity, wind>)")


REFUSED = {
    "tendon coupling": ({"equality": '<tendon tendon1="t"/>'}, "<tendon name=''> of 't'.*not understood"),
    "inactive": ({"equality": '<connect site1="s1" site2="s2" active="false"/>'}, "connect.*not active"),
    "no such site": ({"equality": '<connect site1="s1" site2="s9"/>'}, "'s9'"),
    "one site": ({"equality": '<connect site1="s1"/>'}, "Schema violation.*'connect'"),
    "to itself": ({"equality": '<connect site1="s1" site2="s1"/>'}, "'s1' is repeated"),
    "a word": ({"attributes": 'pos="0.2 abc 0.4"'}, "bad format in attribute 'pos'"),
    "too few": ({"attributes": 'euler="0.2 0.4"'}, "'euler' does not have enough data"),
    "not a number": ({"attributes": 'pos="nan 0 0"'}, "<body name='a' pos='nan 0 0'> holds 'nan'"),
    "infinite": ({"attributes": 'pos="1e999 0 0"'}, "pos|infinite"),
    "infinite weight": ({"options": '<option gravity="0 inf 0"/>'}, "of gravity is infinite"),
    "no axis": ({"hinge": '<joint name="j" axis="0 0 0"/>'}, "axis too small in joint Element name 'j'"),
    "impossible": ({"hinge": '<joint name="j"/><body name="c"><joint name="k"/><inertial pos="0 0 0" mass="1" '
                    'diaginertia="0.001 0.001 0.05"/></body>'}, "'c': the principal moments .*of no body"),
    "below zero": ({"hinge": '<joint name="j"/><body name="c"><joint name="k"/><inertial pos="0 0 0" mass="1" '
                    'diaginertia="-0.01 0.01 0.01"/></body>'}, "'c': the principal moments .*none is below zero"),
    "impossible, and its mean": (
        {"options": '<compiler balanceinertia="true"/>', "hinge": '<joint name="j"/><body name="c"><joint name="k"/>'
         '<inertial pos="0 0 0" mass="1" diaginertia="0.001 0.001 0.05"/></body>'}, "'c': the principal moments"),
    "free joint": ({"hinge": '<freejoint name="j"/>'}, "'a' floats .*give the body slides and a ball joint"),
    "mocap": ({"tail": '<worldbody><body name="m" mocap="true"/></worldbody>'}, "'m' is moved from outside"),
    "flexible": ({"tail": "<deformable><flex name='f'/></deformable>"}, "<flex name='f'> is a flexible body"),
    "plugin": ({"tail": "<extension><plugin plugin='x'/></extension>"}, "<extension> is code of its own"),
    "attached": ({"hinge": "<attach model='m' prefix='p'/>"}, "<attach.*another model"),
    "copies": ({"tail": "<worldbody><replicate count='1000'><replicate count='9999'><site/></replicate></replicate>"
                "</worldbody>"}, "more than 50000 elements"),
    "joints without end": (
        {"tail": "<worldbody>" + "<body><joint/></body>" * 700 + "</worldbody>"}, "702 joints; at most"
    ),
    "keyframes without end": ({"tail": "<size nkey='20000000'/>"}, "nkey is 20000000; at most"),
    "a field without end": ({"tail": "<asset><hfield name='h' nrow='99999' ncol='99999' size='1 1 1 1'/></asset>"},
                            "needs more than 1.5 GB of memory"),
    "comments without end": ({"tail": "<!--" * 99999}, "PARSING_COMMENT"),
    "loops off": ({"equality": '<connect site1="s1" site2="s2"/>',
                   "options": '<option><flag equality="disable"/></option>'}, "remove the flag"),
    "unknown joint": ({"hinge": '<joint name="j" type="hing"/>'}, "invalid keyword: 'hing'"),
    "twice a body": ({"hinge": HINGE + '<body name="b"><joint name="k"/></body>'}, "repeated name 'b' in body"),
    "unknown motor": ({"tail": '<actuator><motor joint="x"/></actuator>'}, "'x'"),
    "unknown payload": ({"tail": '<custom><text name="payload" data="x"/></custom>'}, "body 'x': there are a, b"),
    "unknown radius": (
        {"tail": '<custom><numeric name="x.radius_of_gyration" data="0.1"/></custom>'}, "site 'x': there are s1, s2"
    ),
    "negative mass": ({"hinge": '<joint name="j"/><body name="c"><joint name="k"/><inertial pos="0 0 0" mass="-2.4" '
                       'diaginertia="1 1 1"/></body>'}, "body 'c': mass is -2.4 kg: expected zero or a positive mass"),
    "negative radius": (
        {"tail": '<custom><numeric name="s1.radius_of_gyration" data="-1"/></custom>'}, "s1.*one number, zero or more"
    ),
    "wordy keyframe": ({"tail": '<keyframe><key name="home" qpos="1 up"/></keyframe>'}, "attribute 'qpos'"),
    "a file": ({"tail": '<include file="other.xml"/>'}, "read from a text without a folder"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case: str) -> None:
    """One line that names the file and the element; nothing is dropped."""
    where, message = REFUSED[case]
    with pytest.raises(ModelError, match=rf"^test\.xml: .*{message}") as error:
        models.model(pair(**where))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty file"),
        ("<mujoco><worldbody>", "XML parse error"),
        ("<html/>", "'html'"),
        (models.mjcf('<body name="wall"/>'), "no moving body"),
        (models.mjcf('<body name="a"><joint/></body>'), "no moving body has mass"),
        ("<mujoco><worldbody>" + "<body>" * 3000 + "</body>" * 3000 + "</worldbody></mujoco>", "nesting is too deep"),
    ],
)
def test_what_is_no_mechanism(text: str, message: str) -> None:
    """Broken XML, other XML, and what has no joint or no mass."""
    with pytest.raises(ModelError, match=message):
        models.model(text)


FOREIGN = {
    "another encoding": ("Tüm değerler varsayılmış".encode("cp1254"), "not in UTF-8"),
    "two bytes a letter": ("<mujoco/>".encode("utf-16"), "not in UTF-8"),
    "NUL": (b"<mujoco>\0</mujoco>", "a NUL character"),
    "entities": (b"<!DOCTYPE m [<!ENTITY a 'aa'><!ENTITY b '&a;&a;'>]><mujoco>&b;</mujoco>", "entities"),
}


@pytest.mark.parametrize("case", FOREIGN)
def test_foreign_text(tmp_path: Path, case: str) -> None:
    """Refused before anything parses it."""
    text, message = FOREIGN[case]
    (tmp_path / "arm.xml").write_bytes(text)
    with pytest.raises(ModelError, match=rf"arm\.xml: .*{message}"):
        load_mechanism(tmp_path / "arm.xml")


ARM = "<mujoco><worldbody><body name='arm'><joint name='j' axis='0 0 1'/>{}</body></worldbody>{}</mujoco>"


def with_files(folder: Path, inner: str, tail: str = "") -> Mechanism:
    """An arm in a folder of its own, beside a folder that is not its own."""
    (folder / "own").mkdir(exist_ok=True)
    (folder / "own" / "arm.xml").write_text(ARM.format(inner, tail), encoding="utf-8")
    return load_mechanism(folder / "own" / "arm.xml")


def test_included_files_are_part_of_the_text(tmp_path: Path) -> None:
    """One file includes another; the text that is stored is whole."""
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "mass.xml").write_text(f"<?xml version='1.0'?>\n<m>{models.inertial()}</m>", encoding="utf-8")
    (tmp_path / "own" / "part.xml").write_text(
        "<mujocoinclude><include file='mass.xml'/></mujocoinclude>", encoding="utf-8"
    )
    arm = with_files(tmp_path, "<!-- <include file='none.xml'/> --><include file='part.xml'></include>")
    assert arm.total_mass == pytest.approx(1.3)
    assert mechanism_from_text(arm.text, "arm").total_mass == arm.total_mass


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ("<include file='../secret.xml'/>", "outside the folder"),
        ("<include file='link.xml'/>", "outside the folder"),
        ("<include file='absent.xml'/>", "not there"),
        ("<include file='arm.xml'/>", "once"),
        ("<geom type='mesh' mesh='m'/>", "outside the folder"),
    ],
)
def test_files_outside_the_folder(tmp_path: Path, inner: str, message: str) -> None:
    """Neither by a path, nor by a link, nor round in a circle."""
    (tmp_path / "secret.xml").write_text(f"<m>{models.inertial()}</m>", encoding="utf-8")
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", encoding="utf-8")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "link.xml").symlink_to(tmp_path / "secret.xml")
    with pytest.raises(ModelError, match=message):
        with_files(tmp_path, inner, "<asset><mesh name='m' file='../m.obj'/></asset>")


def test_a_mesh_file_that_is_only_drawn(tmp_path: Path) -> None:
    """It is not opened, so it may be broken or lie beside the folder; a missing one is refused, as MuJoCo does."""
    (tmp_path / "m.stl").write_text("no mesh", encoding="utf-8")
    drawn = models.inertial() + "<geom type='mesh' mesh='m'/>"
    asset = "<asset><mesh name='m' file='../m.stl'/></asset>"
    assert with_files(tmp_path, drawn, asset).total_mass == pytest.approx(1.3)
    with pytest.raises(ModelError, match=r"'n\.stl', which is not there"):
        with_files(tmp_path, drawn, asset.replace("../m.stl", "n.stl"))


def test_a_mesh_file_that_has_mass(tmp_path: Path) -> None:
    """A tetrahedron of 1/6 m3."""
    (tmp_path / "own" / "parts").mkdir(parents=True)
    faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "own" / "parts" / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + faces, encoding="utf-8")
    tail = "<compiler meshdir='parts'/><asset><mesh file='m.obj' inertia='exact'/></asset>"
    arm = with_files(tmp_path, "<geom type='mesh' mesh='m' density='600'/>", tail)
    assert arm.total_mass == pytest.approx(100.0)
    again = mechanism_from_text(arm.text, "arm")  # as a run stores it: without its meshes, the same to the last digit
    np.testing.assert_array_equal(again.parameters, arm.parameters)
    assert mechanism_from_text(again.text, "arm").text == again.text
    with pytest.raises(ModelError, match="11 numbers for each body"):
        mechanism_from_text(arm.text.replace('data="[[', 'data="[[1.0, '), "arm")


def test_the_limit_of_memory_does_not_stay_when_two_threads_compile():
    """It is of the process: the second one began within the first one's limit, ended after it, and put that back."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    inside, overlapping = threading.Event(), threading.Event()

    def first() -> None:
        with mjcf_compiler._bounded_memory():
            inside.set()
            overlapping.wait(0.2)

    def second() -> None:
        inside.wait(5.0)
        with mjcf_compiler._bounded_memory():
            overlapping.set()
            one.join()

    one, two = threading.Thread(target=first), threading.Thread(target=second)
    for thread in (one, two):
        thread.start()
    for thread in (one, two):
        thread.join(5.0)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_a_warning_after_memory_ended_ends():
    """A mechanism too large for memory is refused as such, and what MuJoCo warns of later is said and not for ever."""
    pytest.importorskip("resource")
    where, message = REFUSED["a field without end"]
    with pytest.raises(ModelError, match=message):
        models.model(pair(**where))
    with pytest.raises(ModelError, match="holds 'nan'"):
        models.model(pair(attributes='pos="nan 0 0"'))
