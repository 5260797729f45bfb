"""From MuJoCo's compiled model to a Mechanism: elementary joints, inertial parameters, loops, sites, keyframe."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Floats, frozen
from ..errors import ModelError
from .forward_kinematics import Joint, Tree
from .loop_constraints import Anchor, Constraint, Coupling, Loop
from .mechanism import Mechanism, Site
from .mjcf_compiler import COORDINATE_LIMIT, LOOP_END

_BALL, _SLIDE = 1, 2
_CONNECT, _WELD = 0, 1
_SITE = 6
_JOINT_DRIVES = (0, 1)
_LOOPS_OFF, _SPRINGS_OFF, _DAMPERS_OFF, _GRAVITY_OFF = 1 << 0 | 1 << 1, 1 << 5, 1 << 6, 1 << 7
_RADIUS, _LENGTH = ".radius_of_gyration", ".length"


_PARTS = (
    "qpos0", "key_qpos", "text_adr", "text_size", "numeric_adr", "numeric_data", "numeric_size",
    "body_parentid", "body_jntadr", "body_jntnum", "body_pos", "body_quat", "body_ipos", "body_iquat", "body_mass",
    "body_inertia", "body_gravcomp", "jnt_type", "jnt_bodyid", "jnt_qposadr", "jnt_dofadr", "jnt_pos", "jnt_axis",
    "jnt_limited", "jnt_range", "jnt_stiffness", "jnt_stiffnesspoly", "dof_armature", "dof_damping", "dof_dampingpoly",
    "dof_frictionloss", "site_bodyid", "site_pos", "site_quat", "eq_type", "eq_objtype", "eq_obj1id", "eq_obj2id",
    "eq_data", "actuator_trntype", "actuator_trnid", "actuator_gear", "actuator_armature", "actuator_damping",
    "tendon_stiffness", "tendon_damping", "tendon_frictionloss",
)  # fmt: skip
_OPTIONS = ("gravity", "density", "viscosity", "disableflags")
_NAMED = {"body": "nbody", "joint": "njnt", "site": "nsite", "equality": "neq", "key": "nkey", "actuator": "nactuator",
          "text": "ntext", "numeric": "nnumeric"}  # fmt: skip


@dataclass(frozen=True)
class Compilation:
    """A mechanism as MuJoCo compiled it."""

    model: Any
    """The arrays of MuJoCo's model that are read here and, among them, its options, by MuJoCo's names."""
    names: dict[str, list[str]]
    """Of bodies, joints and so on in their order, empty where they have none."""
    text: str
    """From which it can be compiled again, without other files."""
    files: Mapping[str, str]
    """Other files that it took, from the mechanism's folder: SHA-256; nothing where one needs to be there only."""

    @classmethod
    def of(cls, model: Any, text: str, files: Mapping[str, str]) -> "Compilation":  # noqa: ANN401
        """From MuJoCo's MjModel."""
        import mujoco

        parts = {part: np.array(getattr(model, part)) for part in _PARTS}
        parts["text_data"] = np.frombuffer(model.text_data, np.uint8)
        parts |= {part: np.array(getattr(model.opt, part)) for part in _OPTIONS}
        names = {
            kind: [
                mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), i) or ""
                for i in range(getattr(model, count))
            ]
            for kind, count in _NAMED.items()
        }
        return cls(SimpleNamespace(**parts), names, text, files)


def mechanism_of(compiled: Compilation, file: str, name: str) -> Mechanism:
    """The Mechanism ``name`` of what MuJoCo compiled; ``file`` is what messages call it.

    A ball joint becomes three hinges about one point, their axes x, y and z of its body as it stands in the keyframe:
    the coordinates NAME_x, NAME_y and NAME_z are zero there, and singular where NAME_y is a quarter turn.
    Raises ModelError, naming the file, where nothing moves or has mass, and where a name means nothing.
    """
    if not 0 < (count := len(compiled.model.dof_armature)) <= COORDINATE_LIMIT:
        what = f"{count} coordinates" if count else "no moving body: no joint lets one move"
        raise ModelError(f"{file}: {what}; expected 1 to {COORDINATE_LIMIT} coordinates")
    return _Parts(compiled, file).mechanism(name, compiled.text)


class _Parts:
    """The compiled model taken apart, body by body."""

    def __init__(self, compiled: Compilation, file: str) -> None:
        self.model, self.file = compiled.model, file
        self.names = {kind: list(names) for kind, names in compiled.names.items()}
        self._name_all("body", ["body"] * len(self.names["body"]))
        self._name_all("joint", [f"{self.names['body'][body]}_joint" for body in self.model.jnt_bodyid])
        self.qpos, self.branch = self._keyframe()
        self.joints: list[Joint] = []
        self.coordinates: list[str] = []
        self.home: list[float] = []
        self.limits: list[tuple[float, float]] = []
        self.rows: list[int] = []
        """The elementary joint that carries each row of the inertial parameters."""
        self.placed, self.row_of = [Anchor(-1, np.eye(3), np.zeros(3))], [-1]
        """Of each of the file's bodies: where it is fixed, and its row."""
        for body in range(1, len(self.model.body_mass)):
            self._place(body)

    def mechanism(self, name: str, text: str) -> Mechanism:
        """All of it."""
        model, bodies = self.model, self.names["body"]
        parameters = np.zeros((len(self.rows), 10))
        own_mass: dict[str, tuple[int, Floats]] = {}
        for body, row in enumerate(self.row_of):
            if row >= 0:
                own_mass[bodies[body]] = row, self._inertia(body)
                parameters[row] += own_mass[bodies[body]][1]
        if not np.any(parameters[:, 0] > 0.0):
            raise ModelError(
                f"{self.file}: no moving body has mass; give each an <inertial>, or geometry with a density"
            )
        heads = [next(b for b, r in enumerate(self.row_of) if r == row) for row in range(len(self.rows))]
        payload, radii = self._payload(), self._numerics(_RADIUS)
        tree = Tree(tuple(self.joints), tuple(self.rows))
        sites = {
            name: Site(
                name,
                self.row_of[(body := model.site_bodyid[i])],
                frozen(self._site(i).position),
                radii.get(name, 0.0),
                frozen(tree.normal(self.placed[body].joint, self.placed[body].rotation)),
                bodies[self._stated_on(i)] if body else "",
            )
            for i, name in enumerate(self.names["site"])
            if name and not name.startswith(LOOP_END)
        }
        self._refuse_unknown("<text name='payload'> names body", payload, own_mass)
        self._refuse_unknown(f"<numeric name='...{_RADIUS}'> names site", radii, sites)
        driven, reflected, notes = self._drives()
        if len(model.eq_type) and model.disableflags & _LOOPS_OFF:
            raise ModelError(f"{self.file}: <flag> switches <equality> off; remove the flag, or the <equality>")
        # connects in the order of the file, then welds, then couplings
        loops = tuple(self._loop(k) for k in sorted(range(len(model.eq_type)), key=lambda k: int(model.eq_type[k])))
        return Mechanism(
            name=name,
            text=text,
            tree=tree,
            loops=loops,
            bodies=tuple(bodies[head] for head in heads),
            coordinates=tuple(self.coordinates),
            parameters=frozen(parameters),
            own_mass=own_mass,
            sites=sites,
            gravity=frozen(np.zeros(3) if model.disableflags & _GRAVITY_OFF else model.gravity.copy()),
            home=frozen(np.array(self.home)),
            branch=self.branch,
            driven=driven or (() if loops else tuple(self.coordinates)),
            armature=frozen(model.dof_armature + reflected),
            viscous=frozen(model.dof_damping * (0.0 if model.disableflags & _DAMPERS_OFF else 1.0)),
            coulomb=frozen(model.dof_frictionloss.copy()),
            payload_bodies=payload,
            limits=frozen(np.array(self.limits)),
            lengths=self._numerics(_LENGTH),
            left_out=(*self._left_out(), *notes),
            frames={
                name: (frozen(at.rotation), frozen(at.position))
                for name, at in zip(bodies, self.placed, strict=True)
                if name in own_mass
            },
        )

    def _name_all(self, kind: str, stems: list[str]) -> None:
        """Give those without a name one that no other has."""
        names = self.names[kind]
        for i, stem in enumerate(stems):
            k = i
            while not names[i]:
                k, candidate = k + 1, f"{stem}_{k}"
                names[i] = "" if candidate in names else candidate

    def _keyframe(self) -> tuple[Floats, str]:
        """``home``, or else the first that differs from the configuration in which the file is written."""
        model = self.model
        moved = [k for k in range(len(model.key_qpos)) if np.any(model.key_qpos[k] != model.qpos0)]
        named = [k for k, name in enumerate(self.names["key"]) if name == "home"]
        for k in named or moved:
            return model.key_qpos[k], self.names["key"][k] or f"keyframe {k + 1}"
        return model.qpos0, "zero configuration"

    def _place(self, body: int) -> None:
        """Add the joints of a body, and where they leave it."""
        model = self.model
        frame = _moved(self.placed[model.body_parentid[body]], _rotation(model.body_quat[body]), model.body_pos[body])
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        for joint in range(first, first + count):
            frame = self._add_joint(frame, joint)
        self.placed.append(frame)
        self.row_of.append(len(self.rows) if count else self.row_of[model.body_parentid[body]])
        if count:
            self.rows.append(frame.joint)

    def _add_joint(self, frame: Anchor, joint: int) -> Anchor:
        """A joint on a body at ``frame``: where the body is fixed then."""
        model, address, name = self.model, self.model.jnt_qposadr[joint], self.names["joint"][joint]
        axis, kind, point = model.jnt_axis[joint], model.jnt_type[joint], model.jnt_pos[joint]
        limits = tuple(model.jnt_range[joint]) if model.jnt_limited[joint] else (-np.inf, np.inf)
        reference = model.qpos0[address]
        if kind == _SLIDE:
            start = _moved(frame, np.eye(3), -reference * axis if reference else np.zeros(3))
            return self._add_axis(start, axis, False, name, self.qpos[address], limits)
        if kind == _BALL:
            at = _moved(frame, _rotation(self.qpos[address : address + 4]), point)
            for letter, unit in zip("xyz", np.eye(3), strict=True):
                at = self._add_axis(at, unit, True, f"{name}_{letter}", 0.0, (-np.inf, np.inf))
        else:
            at = _moved(frame, _turn(axis, -reference), point)
            at = self._add_axis(at, axis, True, name, self.qpos[address], limits)
        return _moved(at, np.eye(3), 0.0 - point)

    def _add_axis(
        self, at: Anchor, axis: Floats, revolute: bool, name: str, home: float, limits: tuple[float, float]
    ) -> Anchor:
        self.joints.append(Joint(at.joint, at.rotation, at.position, axis.copy(), revolute))
        self.coordinates.append(name)
        self.home.append(float(home))
        self.limits.append(limits)
        return Anchor(len(self.joints) - 1, np.eye(3), np.zeros(3))

    def _inertia(self, body: int) -> Floats:
        """Inertial parameters of a body's own mass in the frame of the joint that carries it, (10,)."""
        model = self.model
        centre = _moved(self.placed[body], _rotation(model.body_iquat[body]), model.body_ipos[body])
        mass, c, turn = model.body_mass[body], centre.position, centre.rotation
        i = turn @ np.diag(model.body_inertia[body]) @ turn.T + mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.array([mass, *(mass * c), i[0, 0], i[0, 1], i[1, 1], i[0, 2], i[1, 2], i[2, 2]])

    def _site(self, site: int) -> Anchor:
        model = self.model
        return _moved(self.placed[model.site_bodyid[site]], _rotation(model.site_quat[site]), model.site_pos[site])

    def _stated_on(self, site: int) -> int:
        """The body in whose frame the file states a site's place: what a robot's link that is a site is fixed to."""
        model, body = self.model, self.model.site_bodyid[site]
        is_link = self.names["site"][site] == self.names["body"][body] and not model.body_mass[body]
        return int(model.body_parentid[body] if is_link and not model.body_jntnum[body] else body)

    def _loop(self, k: int) -> Constraint:
        model, data, kind = self.model, self.model.eq_data[k], self.model.eq_type[k]
        ends = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        given = self.names["equality"][k]
        if kind not in (_CONNECT, _WELD):
            names = [self.names["joint"][end] for end in ends if end >= 0]
            dofs = [int(model.jnt_dofadr[end]) if end >= 0 else None for end in ends]
            zeros = [float(model.qpos0[model.jnt_qposadr[end]]) if end >= 0 else 0.0 for end in ends]
            label = given or f"joint {'-'.join(names)}"
            return Coupling(label, dofs[0] or 0, dofs[1], frozen(data[:5].copy()), (zeros[0], zeros[1]))
        by_site = model.eq_objtype[k] == _SITE
        bodies = "-".join(self.names["site" if by_site else "body"][end] for end in ends if by_site or end > 0)
        if by_site:
            first, second = (self._site(end) for end in ends)
        else:
            of_first, of_second = (data[3:6], data[:3]) if kind == _WELD else (data[:3], data[3:6])
            turn = _rotation(data[6:10]) if kind == _WELD else np.eye(3)
            first = _moved(self.placed[ends[0]], turn, of_first)
            second = _moved(self.placed[ends[1]], np.eye(3), of_second)
        label = given or f"{'weld' if kind == _WELD else 'connect'} {bodies}"
        return Loop(label, first, second, bool(kind == _WELD and data[10] != 0.0))

    def _payload(self) -> tuple[str, ...]:
        """Bodies that ``<custom><text name="payload">`` names."""
        model = self.model
        for k, name in enumerate(self.names["text"]):
            if name == "payload":
                start = model.text_adr[k]
                return tuple(bytes(model.text_data[start : start + model.text_size[k]]).decode().rstrip("\0").split())
        return ()

    def _numerics(self, ending: str) -> dict[str, float]:
        """Numbers of ``<custom><numeric name="SITE.radius_of_gyration">`` by what is before the ``ending`` [m]."""
        model, found = self.model, {}
        for k, name in enumerate(self.names["numeric"]):
            if name.endswith(ending):
                number = float(model.numeric_data[model.numeric_adr[k]])
                if model.numeric_size[k] != 1 or not number >= 0.0:
                    raise ModelError(f"{self.file}: {name}: expected one number, zero or more")
                found[name.removesuffix(ending)] = number
        return found

    def _drives(self) -> tuple[tuple[str, ...], Floats, list[str]]:
        """Coordinates that a motor drives, the inertia of its rotor reflected to each, and what is left out."""
        model, reflected = self.model, np.zeros(len(self.coordinates))
        driven: dict[str, None] = {}
        others: list[str] = []
        for k, name in enumerate(self.names["actuator"]):
            joint = model.actuator_trnid[k, 0]
            if model.actuator_trntype[k] not in _JOINT_DRIVES or model.jnt_type[joint] == _BALL:
                others.append(repr(name))
                continue
            dof, gear = model.jnt_dofadr[joint], model.actuator_gear[k, 0]
            driven[self.coordinates[dof]] = None
            reflected[dof] += gear**2 * model.actuator_armature[k]
        notes = [f"what actuators {', '.join(others)} do: they drive no single hinge or slide"] if others else []
        return tuple(driven), reflected, notes

    def _left_out(self) -> list[str]:
        """Forces of the file that no force or torque computed here has."""
        model = self.model
        springs = not model.disableflags & _SPRINGS_OFF
        sprung = model.jnt_stiffness.astype(bool) | np.any(model.jnt_stiffnesspoly, axis=1)
        stiff = [self.names["joint"][i] for i in np.flatnonzero(sprung)]
        pulled = np.any(model.tendon_stiffness) or np.any(model.tendon_damping) or np.any(model.tendon_frictionloss)
        found = {
            f"springs of joints {', '.join(stiff)}": springs and stiff,
            "springs, damping and friction of tendons": pulled,
            "damping that grows with speed": np.any(model.dof_dampingpoly),
            "damping of actuators": np.any(model.actuator_damping),
            "the medium (<option density, viscosity, wind>)": model.density or model.viscosity,
            "weight taken off bodies (gravcomp)": np.any(model.body_gravcomp),
        }
        return [what for what, present in found.items() if present]

    def _refuse_unknown(self, what: str, names: Iterable[str], known: Collection[str]) -> None:
        """Raise ModelError for the first of ``names`` that is not among the known."""
        for name in names:
            if name not in known:
                raise ModelError(f"{self.file}: {what} {name!r}: there are {', '.join(known) or 'none'}")


def _moved(at: Anchor, rotation: Floats, position: Floats) -> Anchor:
    """A frame at ``rotation`` (3, 3) and ``position`` (3,) [m] in the frame ``at``."""
    return Anchor(at.joint, at.rotation @ rotation, at.position + at.rotation @ position)


def _rotation(quaternion: Floats) -> Floats:
    """Rotation matrix (3, 3) of a unit quaternion (4,), scalar first."""
    w, x, y, z = quaternion
    return np.array([
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ])  # fmt: skip


def _turn(axis: Floats, angle: float) -> Floats:
    """Rotation matrix (3, 3) by ``angle`` [rad] about a unit ``axis`` (3,)."""
    return _rotation(np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * axis)]))
