"""A mechanism: rigid bodies on a base, joints, loops, and sites where counter-masses may be mounted."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, frozen
from ..datasets import FileDigest
from ..errors import ModelError, suggestion
from ..results import Brief
from ..units import si
from .forward_kinematics import Joint, Tree
from .loop_constraints import Anchor, Constraint, Loop
from .tape import Symbols

if TYPE_CHECKING:
    import pinocchio

MASS_LIMIT = 1e9
"""A mass from here on is taken for a slip [kg]."""
FAR = 20.0
"""Distance of a centre of mass, in those of joints and sites, from which other units than metres are suspected."""
LIMIT_ROUNDING = 1e-9
"""How far a joint may pass its limit by rounding [rad, m]."""
PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
"""Inertial parameters of a body in Pinocchio's order, first moments and inertia about its joint, along its own axes."""


def mass_at(place: Floats, gyration: float, axis: Floats) -> Floats:
    """PARAMETERS (..., 10) of 1 kg at a ``place`` (3, ...) [m], a disc normal to a unit ``axis`` (3,) [-, m, m2].

    Of radius of ``gyration`` about its own centre and that axis [m].
    """
    x, y, z = place
    xx, xy, xz, yy, yz, zz = (gyration**2 / 2 * (np.eye(3) + np.outer(axis, axis)))[np.triu_indices(3)]
    about = [y * y + z * z + xx, xy - x * y, x * x + z * z + yy, xz - x * z, yz - y * z, x * x + y * y + zz]
    return np.stack([np.ones_like(x), x, y, z, *about], axis=-1)


def inertia_matrix(row: Symbols | Floats) -> NDArray[Any]:
    """Inertia (3, 3) [kg m2] about the origin of a body's frame, of its ten parameters (10,), numbers or nodes."""
    xx, xy, yy, xz, yz, zz = row[4:]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def pseudo_inertia(row: Floats) -> Floats:
    """The 4 x 4 pseudo-inertia of a body's ten parameters, about the origin of its frame [kg m2, kg m, kg]."""
    inertia, first = inertia_matrix(row), row[1:4, None]
    return np.block([[0.5 * np.trace(inertia) * np.eye(3) - inertia, first], [first.T, row[:1, None]]])


@dataclass(frozen=True)
class Site:
    """A point of a body where a counter-mass may be mounted, or two links meet."""

    name: str
    body: int
    """Index of the body, -1 for the base."""
    position: Floats
    """In the frame of the joint that carries the body, (3,) [m]; as in the file: ``Mechanism.place``."""
    radius_of_gyration: float = 0.0
    """Of a counter-mass mounted here, about its own centre and ``axis`` [m]."""
    axis: Floats = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """Normal of a counter-mass mounted here, in that frame, (3,): see ``Tree.normal``."""
    on: str = ""
    """Body of the file in whose frame its place is stated; empty for the base."""

    def unit_mass(self) -> Floats:
        """PARAMETERS of 1 kg mounted here, a disc normal to ``axis``, (10,) [-, m, m2]."""
        return mass_at(self.position, self.radius_of_gyration, self.axis)


@dataclass(frozen=True)
class Mechanism(Brief):
    """A mechanism as read from a file, with the payload and counter-masses that it carries.

    >>> import balance
    >>> mechanism = balance.load("four-bar").with_counter_mass(counter_A0A="1 kg")
    >>> mechanism.bodies
    ('A0A', 'AB', 'B0B')
    """

    name: str
    text: str
    """The file's text, so that a result can be computed anew from what was stored with it."""
    tree: Tree
    loops: tuple[Constraint, ...]
    bodies: tuple[str, ...]
    coordinates: tuple[str, ...]
    """Names of the joint coordinates, in the order of q, v and a."""
    parameters: Floats
    """Inertial parameters, a body a row, (nb, 10) [kg, kg m, kg m2]: see PARAMETERS."""
    own_mass: Mapping[str, tuple[int, Floats]]
    """For each body of the file, its row in ``parameters`` and the share of that row that is its own, (10,)."""
    sites: Mapping[str, Site]
    gravity: Floats
    """Acceleration of gravity in the base frame, (3,) [m/s2]."""
    home: Floats
    """A configuration from which closing the loops starts; it chooses the assembly branch, (nv,) [rad, m]."""
    branch: str
    """Name of the keyframe that ``home`` is from."""
    driven: tuple[str, ...]
    """Coordinates that a motor drives; all of an open chain that names no motor, as a robot's description has none."""
    armature: Floats
    """Inertia of the drive reflected to each joint, (nv,) [kg m2, kg]."""
    viscous: Floats
    """Viscous friction of each joint, (nv,) [N m s, N s/m]."""
    coulomb: Floats
    """Dry friction of each joint, (nv,) [N m, N]."""
    payload_bodies: tuple[str, ...]
    """Bodies that carry the payload when none is named."""
    limits: Floats
    """Lower and upper limit of each coordinate that the file states, else infinite, (nv, 2) [rad, m]. Not enforced."""
    lengths: Mapping[str, float] = field(default_factory=dict)
    """Lengths that the file names [m], for people to read conditions in."""
    left_out: tuple[str, ...] = ()
    """Forces that the file has and no torque computed from it, such as springs; balance does not depend on them."""
    loose_base: str = ""
    """The link that is taken as the base, fixed to the world, though the SDF file leaves it free to move."""
    frames: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)
    """Of the file's bodies: axes (3, 3) and origin (3,) [m] in the frame of the joint that carries them."""
    files: tuple[FileDigest, ...] = ()
    """Those that it was read from."""
    payload: Mapping[str, float] = field(default_factory=dict)
    """Payload that :meth:`with_payload` stated, by body or site [kg]."""

    def beyond_limits(self, q: Floats) -> dict[str, tuple[float, float]]:
        """For each joint beyond its limits at the configurations ``q`` (n, nv): its least and largest [rad, m]."""
        low, high = q.min(axis=0), q.max(axis=0)
        out = (low < self.limits[:, 0] - LIMIT_ROUNDING) | (high > self.limits[:, 1] + LIMIT_ROUNDING)
        return {self.coordinates[i]: (float(low[i]), float(high[i])) for i in np.flatnonzero(out)}

    def limits_exceeded(self, q: Floats) -> list[str]:
        """What is said of each joint beyond its limits at the configurations ``q`` (n, nv) [rad, m]."""
        return [
            f"Joint {joint} goes from {low:.4g} to {high:.4g}, beyond the file's limits, {{:.4g}} to {{:.4g}}".format(
                *self.limits[self.coordinate_index(joint)]
            )
            for joint, (low, high) in self.beyond_limits(q).items()
        ]

    @cached_property
    def pi(self) -> Floats:
        """All inertial parameters in one vector, (nb * 10,) [kg, kg m, kg m2]: what the regressors multiply."""
        return self.parameters.ravel()

    def pinocchio_model(self) -> "pinocchio.Model":
        """Pinocchio's model with the present masses: joint i + 1 carries body i, by several axes where it has them."""
        import pinocchio

        def kind(joint: Joint) -> Any:  # noqa: ANN401
            units = zip("XYZ", np.eye(3), strict=True)
            letter = next((letter for letter, unit in units if np.array_equal(joint.axis, unit)), "")
            if letter:
                return getattr(pinocchio, f"JointModel{'R' if joint.revolute else 'P'}{letter}")()
            name = f"JointModel{'Revolute' if joint.revolute else 'Prismatic'}Unaligned"
            return getattr(pinocchio, name)(joint.axis)

        model, numbers, here = pinocchio.Model(), {-1: 0}, pinocchio.SE3.Identity()
        model.name, model.gravity.linear = self.name, self.gravity
        for row, body, joint in zip(self.parameters, self.bodies, self.tree.bodies, strict=True):
            path = self.tree.path(joint)
            axes = path[max((k + 1 for k, other in enumerate(path[:-1]) if other in numbers), default=0) :]
            first, *others = [self.tree.joints[k] for k in axes]
            whole = kind(first)
            if others:
                whole = pinocchio.JointModelComposite()
                whole.addJoint(kind(first), here)
                for other in others:
                    whole.addJoint(kind(other), pinocchio.SE3(other.rotation, other.position))
            at = pinocchio.SE3(first.rotation, first.position)
            number = model.addJoint(numbers[first.parent], whole, at, "+".join(self.coordinates[k] for k in axes))
            inertia = pinocchio.Inertia
            mass = inertia.FromDynamicParameters(row) if row[0] > 0.0 else inertia.Zero()
            model.appendBodyToJoint(number, mass, here)
            model.addBodyFrame(body, number, here, 0)
            numbers[joint] = number
        for site in self.sites.values():
            at = pinocchio.SE3(np.eye(3), site.position)
            model.addFrame(pinocchio.Frame(site.name, site.body + 1, 0, at, pinocchio.FrameType.OP_FRAME))
        model.armature, model.damping, model.upperDryFrictionLimit = self.armature, self.viscous, self.coulomb
        model.lowerPositionLimit, model.upperPositionLimit = self.limits[:, 0], self.limits[:, 1]
        return model

    @property
    def parameter_names(self) -> list[str]:
        """Names of ``pi``: ``m[A0A]``, ``mcx[A0A]``, ..."""
        return [f"{parameter}[{body}]" for body in self.bodies for parameter in PARAMETERS]

    @property
    def closed_loops(self) -> tuple[Loop, ...]:
        """The constraints between two frames, those between two joints left out."""
        return tuple(loop for loop in self.loops if isinstance(loop, Loop))

    @property
    def total_mass(self) -> float:
        """Mass of all moving bodies [kg]."""
        return float(self.parameters[:, 0].sum())

    @property
    def counter_sites(self) -> list[str]:
        """Sites meant for counter-masses: those named ``counter...``."""
        return [name for name in self.sites if name.startswith("counter")]

    def body_index(self, body: str) -> int:
        """Row of a body in ``parameters``. Raises ModelError, listing the bodies, if there is none."""
        if body not in self.own_mass:
            raise ModelError(f"{self.name} has no moving body {body!r}: there are {', '.join(self.own_mass)}")
        return self.own_mass[body][0]

    def anchor(self, body: str, position: Floats) -> Anchor:
        """A frame at a ``position`` (3,) [m] in a body's frame as in the file, along its axes, fixed in its joint's.

        Raises ModelError, listing the bodies, if there is none.
        """
        joint = self.tree.bodies[self.body_index(body)]
        rotation, origin = self._frame(body)
        return Anchor(joint, rotation, origin + rotation @ position)

    def in_file(self, body: str, position: Floats) -> Floats:
        """A ``position`` (3,) [m] in the frame of a body's joint, in the body's frame as in the file, (3,) [m].

        Turns ``anchor`` round: every place that is shown comes from here, every one that is read goes there.
        """
        rotation, origin = self._frame(body)
        return np.asarray(rotation.T @ (position - origin))

    def place(self, site: str) -> Floats:
        """A site in the frame of the file's body that it is on, (3,) [m]. Raises ModelError as ``site`` does."""
        return self.in_file(self.site(site).on, self.site(site).position)

    def from_joint(self, site: str) -> Floats:
        """From the joint to a site, along the axes of the file's body that it is on, (3,) [m]."""
        return np.asarray(self._frame(self.site(site).on)[0].T @ self.site(site).position)

    def _frame(self, body: str) -> tuple[Floats, Floats]:
        return self.frames.get(body, (np.eye(3), np.zeros(3)))

    def coordinate_index(self, joint: str) -> int:
        """Position of a joint in q. Raises ModelError, listing the joints, if there is none."""
        if joint not in self.coordinates:
            raise ModelError(f"{self.name} has no joint {joint!r}: there are {', '.join(self.coordinates)}")
        return self.coordinates.index(joint)

    def drives_by_unit(self, values: Mapping[str, float], turning: str, sliding: str) -> dict[str, dict[str, float]]:
        """Values of motors by joint under two keys: ``turning`` [N m] and ``sliding`` [N]."""
        found: dict[str, dict[str, float]] = {turning: {}, sliding: {}}
        for joint, value in values.items():
            found[sliding if self.drive_unit(joint) == "N" else turning][joint] = value
        return found

    def drive_unit(self, joint: str) -> str:
        """Unit of the load of a drive: ``N m`` on a joint that turns, ``N`` on one that slides."""
        return "N m" if self.tree.joints[self.coordinate_index(joint)].revolute else "N"

    def site(self, name: str) -> Site:
        """A site by name. Raises ModelError, listing the sites on moving bodies, if there is none."""
        if name not in self.sites:
            known = [n for n, site in self.sites.items() if site.body >= 0]
            on_body = sorted(
                (n for n in known if self.bodies[self.sites[n].body] == name), key=lambda n: not n.startswith("counter")
            )
            meant = f"; that body has {', '.join(on_body)}" if on_body else suggestion(name, self.sites)
            raise ModelError(f"{self.name} has no site {name!r}: there are {', '.join(known) or 'none'}{meant}")
        return self.sites[name]

    def lever_arm(self, site: str) -> float:
        """Distance of a site from its body's joint axis; on a body that slides, from the joint's origin [m]."""
        found = self.site(site)
        joint = self.tree.joints[self.tree.bodies[found.body]]
        along = joint.axis * (joint.axis @ found.position) if joint.revolute else 0.0
        return float(np.linalg.norm(found.position - along))

    @property
    def of_no_body(self) -> tuple[str, ...]:
        """Bodies whose inertia no body can have: a principal moment below zero, or above the two others together.

        It is used as stated: moments and torques depend on it, forces and first moments do not.
        """
        found = []
        for name, (_, row) in self.own_mass.items():
            m, c, about = row[0], row[1:4], inertia_matrix(row)
            moved = (c @ c * np.eye(3) - np.outer(c, c)) / m if m else np.zeros((3, 3))
            size = np.linalg.eigvalsh(about - moved)
            if min(size[0], size[0] + size[1] - size[2]) < -1e-9 * np.abs(about).max():
                found.append(name)
        return tuple(found)

    @property
    def far_centres(self) -> dict[str, float]:
        """Bodies whose centre of mass is FAR times as far from their joint as any joint or site from its parent [m]."""
        places = [*(joint.position for joint in self.tree.joints), *(site.position for site in self.sites.values())]
        reach = max((float(np.linalg.norm(place)) for place in places), default=0.0)
        apart = {
            name: float(np.linalg.norm(self.centre(name))) for name, (_, row) in self.own_mass.items() if row[0] > 0.0
        }
        return {name: distance for name, distance in apart.items() if distance > FAR * reach > 0.0}

    def mass(self, body: str) -> float:
        """Own mass of a body [kg], without what is mounted on it."""
        self.body_index(body)
        return float(self.own_mass[body][1][0])

    def centre(self, body: str) -> Floats:
        """Own centre of mass of a body in the frame of the joint that carries it, (3,) [m]."""
        self.body_index(body)
        own = self.own_mass[body][1]
        if own[0] <= 0.0:
            raise ModelError(f"body {body!r} of {self.name} has no mass of its own, so no centre")
        return own[1:4] / own[0]

    @property
    def payload_body(self) -> str:
        """The one body that carries the payload. Raises ModelError where the file names none, or several."""
        if len(self.payload_bodies) != 1:
            raise ModelError(
                f"{self.name} names {len(self.payload_bodies)} payload bodies: expected one; name it in the file by "
                '<custom><text name="payload" data="BODY"/></custom>, or state the payload by body or site: '
                f"payload_{next(iter(self.own_mass))}_kg in a run table, payloads in a plan (bodies: "
                f"{', '.join(self.own_mass)}; sites: {', '.join(self.sites) or 'none'})"
            )
        return self.payload_bodies[0]

    def with_payload(
        self, masses: Mapping[str, float | str] | None = None, stated: float | None = None, /, **named: float | str
    ) -> "Mechanism":
        """Set masses of bodies [kg], at their own centres and with their own radii of gyration; add masses at sites.

        Numbers in kg or texts with a unit, by a mapping or by name: ``with_payload(platform="5 kg")``.
        A name that both have is the body's, unless that has no mass. ``stated`` is the mass of the one body that
        carries the payload [kg]. Raises ModelError for an unknown name, and for a body that is named twice.
        """
        every: dict[str, float | str] = {**(masses or {}), **named}
        whole = [] if stated is None else [(self.payload_body, stated)]
        mechanism, each = self, [*((name, si(mass, "mass")) for name, mass in every.items()), *whole]
        known = [*self.own_mass, *self.sites]
        for name, mass in each:
            if [other for other, _ in each].count(name) > 1:
                raise ModelError(f"the payload of body {name!r} is stated twice: once by its name, once as that of all")
            if name in self.own_mass and (self.mass(name) > 0.0 or name not in self.sites):
                mechanism = mechanism._with_body_mass(name, mass)
            elif name in self.sites:
                mechanism = mechanism.with_counter_mass({name: mass})
                mass += mechanism.payload.get(name, 0.0)
            else:
                raise ModelError(
                    f"{self.name} has no body or site {name!r}{suggestion(name, known)}: bodies are "
                    f"{', '.join(self.own_mass)}, sites {', '.join(self.sites) or 'none'}"
                )
            mechanism = replace(mechanism, payload={**mechanism.payload, name: mass})
        return mechanism

    @property
    def carried(self) -> dict[str, float]:
        """Payload by body or site: that stated, and what the file gives to bodies that carry it [kg]."""
        return {body: self.mass(body) for body in self.payload_bodies if self.mass(body)} | dict(self.payload)

    def _with_body_mass(self, body: str, mass: float) -> "Mechanism":
        index = self.body_index(body)
        if not 0.0 < mass < MASS_LIMIT:
            raise ModelError(
                f"payload of body {body!r} is {mass:g} kg: expected a positive mass below {MASS_LIMIT:g} kg"
            )
        own = self.own_mass[body][1]
        if own[0] <= 0.0:
            raise ModelError(f"body {body!r} of {self.name} has no mass of its own to set: give it one in the file")
        changed = own * (mass / own[0])
        parameters = self.parameters.copy()
        parameters[index] += changed - own
        return replace(self, parameters=frozen(parameters), own_mass={**self.own_mass, body: (index, changed)})

    def with_counter_mass(
        self, masses: Mapping[str, float | str] | None = None, /, **named: float | str
    ) -> "Mechanism":
        """Mount counter-masses at sites [kg, or texts with a unit]; zero mounts nothing, what is mounted stays."""
        parameters = self.parameters.copy()
        for name, given in {**(masses or {}), **named}.items():
            site, mass = self.site(name), si(given, "mass")
            if site.body < 0:
                raise ModelError(f"site {name!r} of {self.name} is on the base: a counter-mass there moves nothing")
            if not 0.0 <= mass < MASS_LIMIT:
                raise ModelError(
                    f"counter-mass at {name!r} is {mass:g} kg: expected zero or a positive mass below {MASS_LIMIT:g} kg"
                )
            parameters[site.body] += mass * site.unit_mass()
        return replace(self, parameters=frozen(parameters))
