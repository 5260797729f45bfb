"""From MJCF, URDF and SDF files to a Mechanism, through Pinocchio's readers.

Pinocchio gives the tree, the inertias and the frames of the loops; gravity, loop names, motors, keyframe and payload
are taken from the MJCF file itself.
"""

import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import datasets
from ..arrays import Floats, frozen
from ..errors import ModelError
from .forward_kinematics import Joint, Tree
from .loop_constraints import Anchor, Loop
from .mechanism import Mechanism, Site
from .mjcf_validation import parse_numbers, refuse_impossible_inertias, refuse_mimic_joints, refuse_unsupported

if TYPE_CHECKING:
    import pinocchio


@dataclass(frozen=True)
class MjcfExtras:
    """What is taken from the MJCF file itself, because Pinocchio's model does not have it."""

    gravity: tuple[float, float, float]
    """Gravity from ``<option>``, MuJoCo's default where absent, (3,) [m/s2]."""
    loops: list[str]
    """Names of the loop constraints, in the order in which Pinocchio returns them: connects, then welds."""
    driven: tuple[str, ...]
    """Joints that an ``<actuator>`` drives."""
    payload_bodies: tuple[str, ...]
    """Bodies that ``<custom><text name="payload">`` names."""
    radius_of_gyration: dict[str, float] = field(default_factory=dict)
    """Radius of gyration of a counter-mass about its own centre, by site [m]; a point mass where absent."""
    joints: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the joints of each body, in the order of the file."""
    keyframe: str | None = None
    """The keyframe to start from: ``home``, or else the first that has a configuration."""
    prepared: str = ""
    """The file as Pinocchio is to read it."""


def read_mjcf_extras(path: Path) -> MjcfExtras:
    """Read what Pinocchio's model lacks. Raises ModelError, naming the element, for what is not understood."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ModelError(f"{path.name}: not well-formed XML: {error}") from error
    if root.tag != "mujoco":
        raise ModelError(f"{path.name}: expected a MJCF file with root <mujoco>, found <{root.tag}>")
    refuse_unsupported(root, path.name)
    options = root.findall("option[@gravity]")
    gravity = _numbers(options[-1].get("gravity", ""), 3, path, "gravity") if options else (0.0, 0.0, -9.81)
    return MjcfExtras(
        gravity=(gravity[0], gravity[1], gravity[2]),
        loops=[_loop_name(e) for kind in ("connect", "weld") for e in root.iterfind(f"equality/{kind}")],
        driven=tuple(dict.fromkeys(e.get("joint", "") for e in root.iterfind("actuator/*") if e.get("joint"))),
        payload_bodies=_payload_bodies(root),
        radius_of_gyration=_radii(root, path),
        joints=_joints_by_body(root),
        keyframe=_keyframe(root, path),
        prepared=_prepared(root),  # last: it changes the tree
    )


def _loop_name(element: ElementTree.Element) -> str:
    ends = [element.get(k) or "" for k in ("site1", "site2", "body1", "body2") if element.get(k)]
    return element.get("name") or f"{element.tag} {'-'.join(ends)}"


def _payload_bodies(root: ElementTree.Element) -> tuple[str, ...]:
    text = root.find("custom/text[@name='payload']")
    return () if text is None else tuple(text.get("data", "").split())


def _radii(root: ElementTree.Element, path: Path) -> dict[str, float]:
    ending, radii = ".radius_of_gyration", {}
    for element in root.iterfind("custom/numeric"):
        if (name := element.get("name", "")).endswith(ending):
            (radius,) = _numbers(element.get("data", ""), 1, path, name)
            if radius < 0.0:
                raise ModelError(f"{path.name}: {name} is {radius:g}: expected zero or more")
            radii[name.removesuffix(ending)] = radius
    return radii


def _joints_by_body(root: ElementTree.Element) -> dict[str, tuple[str, ...]]:
    return {
        body.get("name", ""): tuple(joint.get("name", "") for joint in body.findall("joint"))
        for body in root.iter("body")
    }


def _keyframe(root: ElementTree.Element, path: Path) -> str | None:
    keys = [key for key in root.iterfind("keyframe/key") if "qpos" in key.attrib]
    for key in keys:
        if not key.get("name") or not parse_numbers(key.get("qpos", "")):
            raise ModelError(f"{path.name}: <key name={key.get('name')!r}>: expected a name, and numbers in qpos")
    names = [key.get("name") for key in keys]
    return "home" if "home" in names else next(iter(names), None)


def _prepared(root: ElementTree.Element) -> str:
    """The file with two bodies round those of the world: Pinocchio drops the pose and the sites of the outermost.

    Loops get names that sort in the order of the file: Pinocchio returns them by name.
    """
    world = root.find("worldbody")
    assert world is not None  # refuse_unsupported() found the tree in it
    children = list(world)
    for child in children:
        world.remove(child)
    inner = ElementTree.SubElement(
        ElementTree.SubElement(world, "body", name="world_frame"), "body", name="world_sites"
    )
    inner.extend(children)
    for number, loop in enumerate(root.iterfind("equality/*")):
        loop.set("name", f"{number:06d}")
    return ElementTree.tostring(root, encoding="unicode")


def _numbers(text: str, count: int, path: Path, name: str) -> list[float]:
    values = parse_numbers(text)
    if len(values) != count:
        raise ModelError(f"{path.name}: {name} is {text!r}: expected {count} number{'s' * (count > 1)}")
    return values


_Constraints = tuple[list[Any], list[Any]]
"""Point anchors and frame anchors, as Pinocchio returns them."""


def load_mechanism(name: str | Path) -> Mechanism:
    """Load a shipped mechanism by name, or a file: MJCF (.xml), URDF (.urdf) or SDF (.sdf).

    Raises DataError for a name that is neither, ModelError for a file that cannot be understood.
    """
    path = datasets.find_dataset(name, "mechanisms", ".xml")
    if path.suffix.lower() not in {".xml", ".mjcf", ".urdf", ".sdf"}:
        raise ModelError(f"{path.name}: expected a MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf) file")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ModelError(f"{path.name}: not in UTF-8: {error}") from error
    model, loops, extras = _read(path)
    return _mechanism(path, text, model, loops, extras)


def mechanism_from_text(text: str, name: str) -> Mechanism:
    """Load a mechanism from the text of a MJCF, URDF or SDF file, such as one stored with a run."""
    with _temporary_file(text, name) as path:
        return load_mechanism(path)


@contextmanager
def _temporary_file(text: str, name: str) -> Iterator[Path]:
    """A file of this text for as long as it is read, with the ending that its root element asks for."""
    ending = ".urdf" if "<robot" in text else ".sdf" if "<sdf" in text else ".xml"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{Path(name).name}{ending}"
        path.write_text(text, encoding="utf-8")
        yield path


def _pinocchio() -> "Any":  # noqa: ANN401
    try:
        import pinocchio
    except ImportError as error:
        raise ModelError(
            "reading a mechanism needs Pinocchio: install 'pin' with pip (Linux, macOS) or 'pinocchio' from "
            "conda-forge; without it, balance size parallelogram-6bar --closed-form works"
        ) from error
    return pinocchio


def _read(path: Path) -> "tuple[pinocchio.Model, _Constraints, MjcfExtras]":
    pin = _pinocchio()
    none: _Constraints = ([], [])
    if path.suffix.lower() == ".urdf":
        refuse_mimic_joints(path)
        return _read_with_pinocchio(pin.buildModelFromUrdf, path), none, _default_extras(path)
    if path.suffix.lower() == ".sdf":
        if not hasattr(pin, "buildModelFromSdf"):
            raise ModelError(f"{path.name}: this Pinocchio was built without SDF; convert the file to MJCF or URDF")
        model, *_ = _read_with_pinocchio(pin.buildModelFromSdf, path, True)
        return model, none, _default_extras(path)
    extras = read_mjcf_extras(path)
    with _temporary_file(extras.prepared, path.stem) as prepared:
        model, connects, welds = _read_with_pinocchio(pin.buildModelAndConstraintsFromMJCF, prepared)
    return model, (list(connects), list(welds)), extras


def _default_extras(path: Path) -> MjcfExtras:
    """URDF and SDF state neither gravity nor motors: gravity along -z, every joint driven."""
    return MjcfExtras((0.0, 0.0, -9.81), [], (), ())


def _read_with_pinocchio(reader: object, path: Path, *args: object) -> "pinocchio.Model":
    """Call a reader of Pinocchio. Raises ModelError, naming the file, for what it raises."""
    try:
        return reader(os.fspath(path), *args)  # type: ignore[operator]
    except (ValueError, RuntimeError, TypeError, IndexError) as error:
        what = str(error).split("message:")[-1].strip()
        raise ModelError(f"{path.name}: Pinocchio cannot read this mechanism: {what}") from error


def _mechanism(
    path: Path, text: str, model: "pinocchio.Model", constraints: _Constraints, extras: MjcfExtras
) -> Mechanism:
    tree = _tree(model, path.name)
    if not tree.joints:
        raise ModelError(f"{path.name}: no moving body; joints belong to the bodies under the base")
    coordinates = _coordinates(model, extras)
    bodies = _bodies(model)
    parameters = np.array([model.inertias[i].toDynamicParameters() for i in range(1, model.njoints)])
    refuse_impossible_inertias(path.name, bodies, parameters)
    home, branch = _home(model, extras)
    sites, own_mass = _sites(model, extras), _own_masses(model, bodies, parameters)
    _refuse_unknown(path, "<actuator> drives joint", extras.driven, coordinates)
    _refuse_unknown(path, "<text name='payload'> names body", extras.payload_bodies, own_mass)
    _refuse_unknown(path, "<numeric name='....radius_of_gyration'> names site", extras.radius_of_gyration, sites)
    return Mechanism(
        name=path.stem,
        text=text,
        tree=tree,
        loops=_loops(constraints, tree.bodies, extras),
        bodies=bodies,
        coordinates=coordinates,
        parameters=frozen(parameters),
        own_mass=own_mass,
        sites=sites,
        gravity=frozen(np.array(extras.gravity)),
        home=frozen(home),
        branch=branch,
        driven=extras.driven,
        armature=frozen(np.array(model.armature)),
        viscous=frozen(np.array(model.damping)),
        coulomb=frozen(np.array(_dry_friction(model))),
        payload_bodies=extras.payload_bodies,
        limits=frozen(np.array([model.lowerPositionLimit, model.upperPositionLimit]).T.copy()),
        model=model,
    )


def _refuse_unknown(path: Path, what: str, names: Iterable[str], known: Collection[str]) -> None:
    """Raise ModelError for the first of ``names`` that is not among the known."""
    for name in names:
        if name not in known:
            raise ModelError(f"{path.name}: {what} {name!r}: there are {', '.join(known) or 'none'}")


def _dry_friction(model: "pinocchio.Model") -> Floats:
    upper = getattr(model, "upperDryFrictionLimit", None)
    return np.zeros(model.nv) if upper is None else np.array(upper)


def _coordinates(model: "pinocchio.Model", extras: MjcfExtras) -> tuple[str, ...]:
    """Names of coordinates. Pinocchio keeps one name for a composite joint: the file has the others."""
    names: list[str] = []
    for i in range(1, model.njoints):
        width = model.joints[i].nv
        own = next((joints for joints in extras.joints.values() if model.names[i] in _names_of(joints)), ())
        names.extend(own if len(own) == width else [model.names[i]])
    return tuple(names)


def _names_of(joints: tuple[str, ...]) -> tuple[str, ...]:
    return joints if len(joints) < 2 else (f"Composite_{joints[0]}",)


def _bodies(model: "pinocchio.Model") -> tuple[str, ...]:
    import pinocchio

    names: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint > 0:
            names.setdefault(frame.parentJoint, frame.name)
    return tuple(names.get(i, model.names[i]) for i in range(1, model.njoints))


def _own_masses(model: "pinocchio.Model", bodies: tuple[str, ...], parameters: Floats) -> dict[str, tuple[int, Floats]]:
    """For each body, also those fixed to another: its row in ``parameters`` and its own share of that row, (10,)."""
    import pinocchio

    own = {name: (i, parameters[i].copy()) for i, name in enumerate(bodies)}
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint > 0 and frame.name not in own:
            fixed = model.frames[frame.parentFrame]  # of the fixed joint: it keeps the inertia, the body's own is zero
            share = fixed.placement.act(fixed.inertia).toDynamicParameters()
            row = frame.parentJoint - 1
            own[frame.name] = (row, share)
            own[bodies[row]] = (row, own[bodies[row]][1] - share)
    return own


def _sites(model: "pinocchio.Model", extras: MjcfExtras) -> dict[str, Site]:
    import pinocchio

    return {
        frame.name: Site(
            frame.name,
            frame.parentJoint - 1,
            frozen(frame.placement.translation.copy()),
            extras.radius_of_gyration.get(frame.name, 0.0),
        )
        for frame in model.frames
        if frame.type == pinocchio.FrameType.OP_FRAME
    }


def _home(model: "pinocchio.Model", extras: MjcfExtras) -> tuple[Floats, str]:
    configurations = {entry.key(): np.array(entry.data()) for entry in model.referenceConfigurations}
    if extras.keyframe is not None:
        return configurations[extras.keyframe], extras.keyframe
    return configurations.get("qpos0", np.zeros(model.nv)), "zero configuration"


def _loops(constraints: _Constraints, bodies: tuple[int, ...], extras: MjcfExtras) -> tuple[Loop, ...]:
    connects, welds = constraints
    models = [(c, False) for c in connects] + [(c, True) for c in welds]
    if len(models) != len(extras.loops):
        raise ModelError(f"the file has {len(extras.loops)} loop constraints, Pinocchio read {len(models)}")
    return tuple(
        Loop(
            name,
            Anchor.from_placement(_elementary_joint(c.joint1_id, bodies), c.joint1_placement),
            Anchor.from_placement(_elementary_joint(c.joint2_id, bodies), c.joint2_placement),
            weld,
        )
        for name, (c, weld) in zip(extras.loops, models, strict=True)
    )


def _elementary_joint(joint: int, bodies: tuple[int, ...]) -> int:
    return -1 if joint == 0 else bodies[joint - 1]


def _tree(model: "pinocchio.Model", name: str) -> Tree:
    """The elementary joints of a Pinocchio model. Raises ModelError for a joint of another kind."""
    joints: list[Joint] = []
    last: dict[int, int] = {0: -1}
    for i in range(1, model.njoints):
        placement = model.jointPlacements[i]
        parent = last[model.parents[i]]
        for kind, offset in _parts_of(model.joints[i].extract()):
            revolute, axis = _kind_and_axis(kind, model.names[i], name)
            frame = placement * offset
            joints.append(Joint(parent, frame.rotation.copy(), frame.translation.copy(), axis, revolute))
            parent, placement = len(joints) - 1, frame.Identity()
        last[i] = parent
    return Tree(tuple(joints), tuple(last[i] for i in range(1, model.njoints)))


def _parts_of(joint: object) -> list[tuple[object, "pinocchio.SE3"]]:
    import pinocchio

    if isinstance(joint, pinocchio.JointModelComposite):
        return [
            (part.extract(), placement) for part, placement in zip(joint.joints, joint.jointPlacements, strict=True)
        ]
    return [(joint, pinocchio.SE3.Identity())]


def _kind_and_axis(joint: object, label: str, name: str) -> tuple[bool, Floats]:
    """Kind and axis of a joint, from Pinocchio's class names: RX, RY, RZ, PX, ..., or with an axis of its own.

    A joint without limits (RUB..., URDF's continuous) is a revolute one: its angle is the coordinate here.
    """
    kind = type(joint).__name__.removeprefix("JointModel").replace("RUB", "R").replace("Unbounded", "")
    letters = {"X": 0, "Y": 1, "Z": 2}
    if kind in {"RX", "RY", "RZ", "PX", "PY", "PZ"}:
        return kind[0] == "R", np.eye(3)[letters[kind[1]]]
    if kind in {"RevoluteUnaligned", "PrismaticUnaligned"}:
        return kind.startswith("R"), np.asarray(joint.axis, dtype=np.float64)  # type: ignore[attr-defined]
    raise ModelError(f"{name}: joint {label!r} is of kind {kind}; supported are revolute and prismatic joints")
