"""From MJCF, URDF and SDF files to a Mechanism, through Pinocchio's readers."""

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import datasets, mjcf
from .arrays import Floats
from .constraints import Anchor, Loop
from .errors import ModelError
from .mechanism import Mechanism, Site, _frozen
from .tree import tree_of

if TYPE_CHECKING:
    import pinocchio


_Constraints = tuple[list[Any], list[Any]]
"""Point anchors and frame anchors, as Pinocchio returns them."""


def load(name: str | Path) -> Mechanism:
    """Load a shipped mechanism by name, or a file."""
    path = datasets.find(name, "mechanisms", ".xml")
    if path.suffix.lower() not in {".xml", ".mjcf", ".urdf", ".sdf"}:
        raise ModelError(f"{path.name}: expected a MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf) file")
    model, loops, extras = _read(path)
    return _mechanism(path, model, loops, extras)


def load_text(text: str, name: str) -> Mechanism:
    """Load a mechanism from the text of a MJCF file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{Path(name).name}.xml"
        path.write_text(text, encoding="utf-8")
        return load(path)


def pinocchio_model(mechanism: Mechanism) -> "pinocchio.Model":
    """The Pinocchio model of a mechanism loaded from MJCF, with its present masses."""
    pin = _pinocchio()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{mechanism.name}.xml"
        path.write_text(mechanism.text, encoding="utf-8")
        model = _read(path)[0]
    for i, row in enumerate(mechanism.parameters):
        model.inertias[i + 1] = pin.Inertia.FromDynamicParameters(row)
    model.gravity.linear = mechanism.gravity
    return model


def _pinocchio() -> "Any":  # noqa: ANN401
    try:
        import pinocchio
    except ImportError as error:
        raise ModelError(
            "reading a mechanism needs Pinocchio: install 'pin' with pip (Linux, macOS) or 'pinocchio' from conda-forge"
        ) from error
    return pinocchio


def _read(path: Path) -> "tuple[pinocchio.Model, _Constraints, mjcf.Extras]":
    pin = _pinocchio()
    none: _Constraints = ([], [])
    if path.suffix.lower() == ".urdf":
        return _quietly(pin.buildModelFromUrdf, path), none, _bare(path)
    if path.suffix.lower() == ".sdf":
        model, *_ = _quietly(pin.buildModelFromSdf, path, True)
        return model, none, _bare(path)
    extras = mjcf.read_extras(path)
    model, connects, welds = _quietly(pin.buildModelAndConstraintsFromMJCF, path)
    return model, (list(connects), list(welds)), extras


def _bare(path: Path) -> mjcf.Extras:
    """URDF and SDF say nothing of gravity here, nor of motors: gravity along -z, every joint driven."""
    return mjcf.Extras((0.0, 0.0, -9.81), [], (), ())


def _quietly(reader: object, path: Path, *args: object) -> "pinocchio.Model":
    """Call a reader of Pinocchio; what it throws becomes one message that names the file."""
    try:
        return reader(os.fspath(path), *args)  # type: ignore[operator]
    except (ValueError, RuntimeError, TypeError, IndexError) as error:
        raise ModelError(f"{path.name}: Pinocchio cannot read this mechanism: {str(error).strip()}") from error


def _mechanism(path: Path, model: "pinocchio.Model", constraints: _Constraints, extras: mjcf.Extras) -> Mechanism:
    tree = tree_of(model, path.name)
    if not tree.joints:
        raise ModelError(f"{path.name}: no moving body; joints belong to the bodies under the base")
    coordinates = _coordinates(model, extras)
    bodies = _bodies(model)
    parameters = np.array([model.inertias[i].toDynamicParameters() for i in range(1, model.njoints)])
    home, branch = _home(model)
    unknown = [joint for joint in extras.driven if joint not in coordinates]
    if unknown:
        raise ModelError(f"{path.name}: <actuator> drives joint {unknown[0]!r}: there are {', '.join(coordinates)}")
    return Mechanism(
        name=path.stem,
        text=path.read_text(encoding="utf-8"),
        tree=tree,
        loops=_loops(constraints, tree.bodies, extras),
        bodies=bodies,
        coordinates=coordinates,
        parameters=_frozen(parameters),
        own_mass=_own_masses(model, bodies, parameters),
        sites=_sites(model, extras),
        gravity=_frozen(np.array(extras.gravity)),
        home=_frozen(home),
        branch=branch,
        driven=extras.driven,
        armature=_frozen(np.array(model.armature)),
        viscous=_frozen(np.array(model.damping)),
        coulomb=_frozen(np.array(_dry_friction(model))),
        payload_bodies=extras.payload_bodies,
    )


def _dry_friction(model: "pinocchio.Model") -> Floats:
    upper = getattr(model, "upperDryFrictionLimit", None)
    return np.zeros(model.nv) if upper is None else np.array(upper)


def _coordinates(model: "pinocchio.Model", extras: mjcf.Extras) -> tuple[str, ...]:
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
    """Rows of the bodies that carry a joint, and of those fixed to them, each with its own share of the row."""
    import pinocchio

    own = {name: (i, parameters[i].copy()) for i, name in enumerate(bodies)}
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint > 0 and frame.name not in own:
            share = frame.placement.act(frame.inertia).toDynamicParameters()
            row = frame.parentJoint - 1
            own[frame.name] = (row, share)
            own[bodies[row]] = (row, own[bodies[row]][1] - share)
    return own


def _sites(model: "pinocchio.Model", extras: mjcf.Extras) -> dict[str, Site]:
    import pinocchio

    return {
        frame.name: Site(
            frame.name,
            frame.parentJoint - 1,
            _frozen(frame.placement.translation.copy()),
            extras.radius_of_gyration.get(frame.name, 0.0),
        )
        for frame in model.frames
        if frame.type == pinocchio.FrameType.OP_FRAME
    }


def _home(model: "pinocchio.Model") -> tuple[Floats, str]:
    configurations = {entry.key(): np.array(entry.data()) for entry in model.referenceConfigurations}
    names = [name for name in configurations if name != "qpos0"]
    if "home" in names or names:
        name = "home" if "home" in names else names[0]
        return configurations[name], name
    return configurations.get("qpos0", np.zeros(model.nq)), "zero configuration"


def _loops(constraints: _Constraints, bodies: tuple[int, ...], extras: mjcf.Extras) -> tuple[Loop, ...]:
    connects, welds = constraints
    models = [(c, False) for c in connects] + [(c, True) for c in welds]
    if len(models) != len(extras.loops):
        raise ModelError(f"the file has {len(extras.loops)} loop constraints, Pinocchio read {len(models)}")
    return tuple(
        Loop(
            name,
            Anchor.of(_elementary(c.joint1_id, bodies), c.joint1_placement),
            Anchor.of(_elementary(c.joint2_id, bodies), c.joint2_placement),
            weld,
        )
        for name, (c, weld) in zip(extras.loops, models, strict=True)
    )


def _elementary(joint: int, bodies: tuple[int, ...]) -> int:
    return -1 if joint == 0 else bodies[joint - 1]
