"""SDF files as a Robot: the models nested in each other and those that are included, and loops of joints."""

import math
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..arrays import Floats
from ..errors import ModelError
from .mjcf_compiler import located_file, read_text
from .robot import Link, Placement, Robot, RobotJoint
from .robot_elements import BOUNDED, ENDS, Reader, parsed, rotation_of

_INFINITE = 1e15
"""A limit from here on is none, as SDF writes it; nor are two equal ones [rad, m]."""
_TRUE = ("true", "1")
_DEPTH = 50
"""How deep models may be nested in each other."""


def put_included(root: Element, file: str, folder: Path | None) -> bool:
    """Put the models of <include> in its place, or with ``merge`` what is in them; whether there was one.

    A <uri> is a file, or a folder with a model.sdf, in ``folder``, after model:// or not.
    """
    found = False
    for parent in list(root.iter()):
        for element in parent.findall("include"):
            place, found = list(parent).index(element), True
            uri = element.findtext("uri", "").strip().removeprefix("model://").removeprefix("file://")
            is_folder = folder is not None and (folder / uri).is_dir()
            other = located_file(f"{uri}/model.sdf" if is_folder else uri, "", folder, file)
            models = parsed(read_text(other), other.name).findall("model")
            merged, pose = element.get("merge") in ("true", "1"), element.find("pose")
            if len(models) != 1 or models[0].find(".//include") is not None:
                raise ModelError(f"{file}: <include> of {uri!r}: expected one <model>, without <include>")
            if element.find("placement_frame") is not None or (merged and pose is not None):
                raise ModelError(f"{file}: <include> of {uri!r}: its place is not read; write the model out")
            model = models[0]
            for own in (own for own in (pose, element.find("static")) if own is not None):
                for there in model.findall(own.tag):
                    model.remove(there)
                model.append(own)
            model.set("name", element.findtext("name", model.get("name", "")))
            parent.remove(element)
            for k, one in enumerate([one for one in model if one.tag != "pose"] if merged else [model]):
                parent.insert(place + k, one)
    return found


class SdfModel:
    """The model of an SDF file and those nested in it, with names as in SDF: ``arm::link`` of a nested model ``arm``.

    Frames are resolved at zero, as SDF 1.7 and later define them. A model that is static stands still, and is left out.
    """

    def __init__(self, root: Element, file: str) -> None:
        self.file, self.read = file, Reader(file)
        version = root.get("version", "1.7").split(".")[:2]
        if not all(part.isdigit() for part in version):
            raise ModelError(f"{file}: <sdf version={root.get('version')!r}>: expected a version such as 1.7")
        self.axes_of_model = tuple(map(int, version)) < (1, 5)
        for joint in root.iterfind("world/joint"):
            raise ModelError(f"{file}: joint {joint.get('name')!r} of the <world>: put it into the <model>")
        models = [*root.iterfind("model"), *root.iterfind("world/model")]
        moving = [model for model in models if model.findtext("static", "").strip() not in _TRUE]
        if len(moving) != 1:
            raise ModelError(
                f"{file}: expected one <model> that moves, found {len(moving)} (and "
                f"{len(models) - len(moving)} static); put the others into it, or leave them out"
            )
        self.elements: dict[str, dict[str, tuple[str, Element]]] = {tag: {} for tag in ("link", "joint", "frame")}
        """Of each kind by name: the scope, and the element."""
        self.stated: dict[str, tuple[str, Placement]] = {"": ("", Placement()), "world": ("", Placement())}
        """Frames by name, the model's own the empty one: the frame that it is in, and where."""
        self.carrier = {"": ""}
        """Of each model's frame the name of the link that carries it."""
        self.base = self._pose(moving[0], "model")
        self._collect(moving[0], "")

    def robot(self, gravity: str | None) -> Robot:
        """With ``gravity`` as the file writes it, earth's where it does not."""
        weight = np.array([0.0, 0.0, -9.81]) if gravity is None else self.read.numbers(gravity, 3, "<gravity>")
        links = {name: self._link(name, element) for name, (_, element) in self.elements["link"].items()}
        joints = {name: self._joint(name, scope, element) for name, (scope, element) in self.elements["joint"].items()}
        return Robot(self.file, links, joints, self.base, weight)

    def _collect(self, model: Element, scope: str) -> None:
        """Elements and frames of a model, ``scope`` before their names, and of the models in it."""
        own = scope.removesuffix("::")
        if own.count("::") >= _DEPTH:
            raise ModelError(f"{self.file}: models are nested more than {_DEPTH} deep; write them out in one")
        if model.get("placement_frame"):
            raise ModelError(
                f"{self.file}: <model> {own!r}: a placement_frame is not read; state the pose of the model"
            )
        for tag, found in self.elements.items():
            for name, element in self.read.named(model, tag).items():
                found[scope + name] = scope, element
                default = {"link": "", "joint": element.findtext("child", "")}.get(tag, element.get("attached_to", ""))
                self.stated[scope + name] = (
                    self._relative(element, scope, default),
                    self._pose(element, f"{tag} {name!r}"),
                )
        for name, inner in self.read.named(model, "model").items():
            self.stated[scope + name] = self._relative(inner, scope, ""), self._pose(inner, f"model {name!r}")
            self._collect(inner, f"{scope}{name}::")
        first = model.get("canonical_link") or next((link.get("name", "") for link in model.iterfind("link")), "")
        nested = next((one.get("name", "") for one in model.iterfind("model")), "")
        self.carrier[own] = scope + first if first else self.carrier.get(scope + nested, "")

    def _relative(self, element: Element, scope: str, default: str) -> str:
        found = element.find("pose")
        stated = "" if found is None else found.get("relative_to") or found.get("frame", "")
        return self._name(stated or default, scope)

    def _name(self, name: str, scope: str) -> str:
        """The whole name of a frame as it is called in a ``scope``."""
        name = name.strip()
        own = name in ("", "__model__")
        return (
            name if name == "world" else scope.removesuffix("::") if own else scope + name.removesuffix("::__model__")
        )

    def _pose(self, element: Element, where: str) -> Placement:
        found = element.find("pose")
        if found is None or not (found.text or "").split():
            return Placement()
        quaternion = found.get("rotation_format") == "quat_xyzw"
        values = self.read.numbers(found.text, 7 if quaternion else 6, f"<pose> of {where}")
        angles = np.radians(values[3:]) if found.get("degrees") in _TRUE else values[3:]
        if not quaternion:
            return Placement(values[:3], rotation_of(*angles))
        x, y, z, w = values[3:] / np.linalg.norm(values[3:])
        skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return Placement(values[:3], np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)

    def _placed(self, name: str) -> Placement:
        """A frame in that of the outermost model."""
        at, seen = Placement(), set()
        while name not in ("", "world"):
            if name not in self.stated or name in seen:
                raise ModelError(f"{self.file}: <pose> is relative to {name!r}, which is no frame of it or goes round")
            seen.add(name)
            name, own = self.stated[name]
            at = own @ at
        return self.base.inverse() @ at if name == "world" else at

    def _link_of(self, name: str) -> str:
        """The link that carries a frame; a name that is none stays."""
        for _ in self.stated:
            if name in self.elements["frame"]:
                scope, element = self.elements["frame"][name]
                name = self._name(element.get("attached_to", ""), scope)
            elif name in self.elements["joint"]:
                scope, element = self.elements["joint"][name]
                name = self._name(element.findtext("child", ""), scope)
            else:
                return self.carrier.get(name, name)
        return name

    def _link(self, name: str, element: Element) -> Link:
        own, where = element.find("inertial"), f"the inertial of link {name!r}"
        if own is not None and own.get("auto") in _TRUE:
            raise ModelError(f"{self.file}: {where} is to be found from geometry (auto): write out mass and inertia")
        at = Placement() if own is None else self._pose(own, where)
        tensor = self.read.inertia(None if own is None else own.find("inertia"), where, 1.0, 0.0)
        weightless = element.findtext("gravity", "").strip() in ("false", "0")
        return Link(self.read.number(own, "mass", 1.0, where), at, tensor, weightless)

    def _joint(self, name: str, scope: str, element: Element) -> RobotJoint:
        read, where, at = self.read, f"joint {name!r}", self._placed(name)
        parent, child = (self._link_of(self._name(element.findtext(end, ""), scope)) for end in ENDS)
        in_parent, in_child = (
            self._placed(end).inverse() @ at if end in self.stated else Placement() for end in (parent, child)
        )
        joint = RobotJoint(read.joint_type(element, name), parent, child, in_parent, in_child)
        tags = {"universal": ("axis", "axis2"), "fixed": (), "ball": (), "spherical": ()}.get(joint.kind, ("axis",))
        axes: dict[str, Floats] = {}
        for tag in tags:
            axis = element.find(tag)
            xyz = None if axis is None else axis.find("xyz")
            direction = read.axis("0 0 1" if xyz is None else xyz.text, name)
            frame = "" if xyz is None else xyz.get("expressed_in", "")
            if axis is not None and (axis.findtext("use_parent_model_frame", "") in _TRUE or self.axes_of_model):
                frame = "__model__"
            if frame:
                direction = at.rotation.T @ self._placed(self._name(frame, scope)).rotation @ direction
            axes[f"_{len(axes) + 1}" if len(tags) > 1 else ""] = direction
            mimic = element.find("mimic") if axis is None or axis.find("mimic") is None else axis.find("mimic")
            if mimic is not None:
                leader = self._name(mimic.get("joint", ""), scope)
                kind = self.elements["joint"][leader][1].get("type") if leader in self.elements["joint"] else None
                if len(tags) > 1 or kind in (None, "universal"):
                    raise ModelError(f"{self.file}: {where}: <mimic>: expected two joints of one axis each")
                ratio, start, zero = (
                    read.number(mimic, key, default, where)
                    for key, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
                )
                joint = replace(joint, follows=(leader, ratio, start - ratio * zero))
            limit, losses = (None if axis is None else axis.find(part) for part in ("limit", "dynamics"))
            bounds = [read.number(limit, key, math.inf, where) for key in ("lower", "upper")]
            if joint.kind in BOUNDED and max(map(abs, bounds)) < _INFINITE and bounds[0] < bounds[1]:
                joint = replace(joint, limits=(bounds[0], bounds[1]))
            joint = replace(
                joint,
                damping=read.number(losses, "damping", 0.0, where),
                friction=read.number(losses, "friction", 0.0, where),
                stiffness=read.number(losses, "spring_stiffness", 0.0, where),
            )
        reflected = read.armature(element.find("gear_ratio"), element.find("rotor_inertia"), where)
        return replace(joint, axes=axes, armature=reflected)
