"""Bearing and tooth forces of a linkage with its gears, from the equilibrium of every body along a motion.

Each body and each counter-gear is cut free: forces at its pins, across its slides, at its teeth, and the drive torque
give it the acceleration that it has. A gear of Z teeth on a body and its counter-gear of Z* touch on the line of their
axes, at the pitch radii a Z / (Z + Z*) and a Z* / (Z + Z*), a the distance of the axes. Tooth forces are tangential
there; on straight teeth they also press the axes apart, by the tangent of the pressure angle. (The source's equations
3.14 to 3.17 are these for a pair on the ground and on a carrier: F r* = I* alpha*.)
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..dynamics.reactions import body_loads
from ..errors import ModelError
from ..mechanism.forward_kinematics import poses
from ..mechanism.mechanism import Mechanism
from .equivalence_method import LinkageBalance
from .linkage import GROUND
from .mjcf_writer import skeleton
from .moment_balance import GearResult

PRESSURE_ANGLE = np.radians(20.0)
"""Of the teeth, by the basic rack of ISO 53 [rad]."""
_ACCURACY = 1e-7
"""Share of the largest load that equilibrium may leave over."""
_WELL_CONDITIONED = 1e6
"""Condition number up to which an inverse has ten digits."""


@dataclass(frozen=True)
class BearingForces:
    """Forces over time, base axes; each acts on the second body, the first is what exerts it."""

    joints: Mapping[str, Floats]
    """At every joint but those that ``undetermined`` gears load, (n, 2) [N]; across the line of a slide."""
    counter_gears: Mapping[str, Floats]
    """Of the carrier on every counter-gear at its pivot, (n, 2) [N]."""
    teeth: Mapping[str, Floats]
    """Tangential, of the gear on the counter-gear, (n,) [N]: positive turns the counter-gear forwards."""
    torque: Floats
    """Drive torque, (n,) [N m]."""
    ground: Floats
    """Force on the ground (Fx, Fy) and its moment about the base origin, (n, 3) [N, N m]."""
    undetermined: tuple[str, ...]
    """Gears whose counter-gear has no pivot given apart from their own axis: only their couple is known."""

    def peaks(self) -> dict[str, dict[str, float]]:
        """Largest force of each joint, pivot of a counter-gear, and tooth [N]."""
        return {
            "joints": {name: float(np.linalg.norm(f, axis=1).max()) for name, f in self.joints.items()},
            "counter_gears": {name: float(np.linalg.norm(f, axis=1).max()) for name, f in self.counter_gears.items()},
            "teeth": {name: float(np.abs(f).max()) for name, f in self.teeth.items()},
        }


def bearing_forces(result: LinkageBalance, mechanism: Mechanism, path: Trajectory) -> BearingForces:
    """Forces of a linkage, as its ``mechanism`` of one stage with or without counter-gears, along its trajectory.

    Raises ModelError where it is statically indeterminate: equilibrium does not determine the forces.
    """
    return _FreeBodies(result, mechanism, path).solved()


class _FreeBodies:
    """Equations, three a body (force along x, y, moment about the base origin), and unknowns, one a column."""

    def __init__(self, result: LinkageBalance, mechanism: Mechanism, path: Trajectory) -> None:
        self.result, self.mechanism, self.count = result, mechanism, len(path.time)
        self.tree = skeleton(result)
        self.at = poses(mechanism.tree, path.q)
        loads = body_loads(mechanism, path.q, path.v, path.a)
        self.load = loads[:, list(mechanism.tree.bodies)][:, :, [0, 1, 5]]
        self.columns: list[Floats] = []
        self.gears = {name: gear for name, gear in result.gears.items() if f"{name}*" in mechanism.bodies}
        for name, gear in self.gears.items():
            if gear.counter_mass is None:  # on a pivot at rest, of a mass that is not known: its inertia alone
                load, at = self.load[:, mechanism.body_index(f"{name}*")], self._axes(gear)[0]
                load[:, 2] -= at[:, 0] * load[:, 1] - at[:, 1] * load[:, 0]
                load[:, :2] = 0.0

    def solved(self) -> BearingForces:
        """Forces of all joints, pivots and teeth."""
        linkage = self.result.linkage
        pins, slides, pivots, teeth, directions = {}, {}, {}, {}, {}
        for joint in linkage.joints.values():
            first, second = (end.body for end in joint.ends)
            place = self._point(second, self.result.joint_point(joint.name, second).at(self.result.values))
            if joint.revolute:
                pins[joint.name] = self._pin(first, second, place)
            else:
                along = joint.ends[1].along
                line = self._arm(second, np.array([np.cos(along), np.sin(along)]))
                across = np.stack([-line[:, 1], line[:, 0]], axis=1)
                slides[joint.name] = self._push(first, second, place, across), across
                self._couple(first, second)
        for name, gear in self.gears.items():
            pivot, axis = self._axes(gear)
            pivots[name] = self._pin(gear.carrier, f"{name}*", pivot)
            if name in self.undetermined:
                self._couple(gear.gear.body, f"{name}*", gear)
                continue
            line = pivot - axis
            distance = np.linalg.norm(line, axis=1, keepdims=True)
            line = directions[name] = line / distance
            mesh = axis + distance * line * gear.gear.teeth[0] / sum(gear.gear.teeth)
            forwards = np.stack([line[:, 1], -line[:, 0]], axis=1)
            teeth[name] = self._push(gear.gear.body, f"{name}*", mesh, forwards)
        drive = linkage.joints[str(linkage.drive)]
        torque = self._couple(GROUND, drive.other(GROUND))
        found = self._found()
        joints = {name: found[:, k : k + 2] for name, k in pins.items()}
        joints |= {name: found[:, [k]] * across for name, (k, across) in slides.items()}
        bearings = {name: found[:, k : k + 2] for name, k in pivots.items()}
        for name, k in teeth.items():  # what presses the axes apart
            gear, apart = self.gears[name], np.tan(PRESSURE_ANGLE) * np.abs(found[:, [k]]) * directions[name]
            bearings[name] = bearings[name] - apart
            sign = 1.0 if linkage.joints[gear.joint].ends[1].body == gear.gear.body else -1.0
            joints[gear.joint] = joints[gear.joint] + sign * apart
        unknown = {self.gears[name].joint for name in self.undetermined}
        return BearingForces(
            {name: force for name, force in joints.items() if name not in unknown},
            {name: force for name, force in bearings.items() if name not in self.undetermined},
            {name: found[:, k] for name, k in teeth.items()},
            found[:, torque],
            np.einsum("nij,nj->ni", self.on_ground, found),
            self.undetermined,
        )

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Gears whose counter-gear turns about their own axis, as far as is given."""
        apart = {name: np.linalg.norm(np.subtract(*self._axes(gear)), axis=1) for name, gear in self.gears.items()}
        return tuple(name for name, distance in apart.items() if not distance.min() > 0.0)

    def _found(self) -> Floats:
        """The unknowns, (n, unknowns) [N, N m]."""
        whole = np.stack(self.columns, axis=-1)
        self.on_ground = whole[:, -3:]
        equations, load = whole[:, :-3], self.load.reshape(self.count, -1)
        if equations.shape[1] != equations.shape[2]:
            raise ModelError(
                f"{self.result.linkage.name}: {equations.shape[2]} bearing and tooth forces, {equations.shape[1]} "
                "conditions of equilibrium: it is statically indeterminate, forces depend on its stiffness"
            )
        # Inverses, (n, k, k); pseudo-inverses of those that are nearly singular, as at a dead position.
        try:
            inverses = np.linalg.inv(equations)
            condition = np.linalg.norm(equations, 1, (1, 2)) * np.linalg.norm(inverses, 1, (1, 2))
            doubtful = ~(condition < _WELL_CONDITIONED)
        except np.linalg.LinAlgError:
            inverses, doubtful = equations.copy(), np.ones(len(equations), dtype=bool)
        inverses[doubtful] = np.linalg.pinv(equations[doubtful], rcond=1e-12)
        found: Floats = np.einsum("nij,nj->ni", inverses, load)
        left = np.abs(np.einsum("nij,nj->ni", equations, found) - load).max()
        if not left <= _ACCURACY * max(float(np.abs(load).max()), 1e-300):
            raise ModelError(
                f"{self.result.linkage.name}: bearing forces are not determined: it passes a dead position"
            )
        return found

    def _axes(self, gear: GearResult) -> tuple[Floats, Floats]:
        """Pivot of the counter-gear and axis of the gear on the body, in the base, (n, 2) [m]."""
        pivot, axis = (self._point(gear.carrier, at) for at in gear.centres(self.result))
        return pivot, axis

    def _point(self, body: str, place: Floats) -> Floats:
        """A point (2,) [m] of a body's described frame in the base, (n, 2) [m]."""
        if body == GROUND:
            return np.tile(place, (self.count, 1))
        corner = self.at.position[:, self._frame(body), :2]
        return corner + self._arm(body, place - self.tree.origin(body).at(self.result.values))

    def _arm(self, body: str, vector: Floats) -> Floats:
        """A vector of a body's frame (2,) in base axes, (n, 2)."""
        if body == GROUND:
            return np.tile(vector, (self.count, 1))
        return self.at.arm(self._frame(body), np.r_[vector, 0.0])[:, :2]

    def _frame(self, body: str) -> int:
        return self.mechanism.tree.bodies[self.mechanism.body_index(body)]

    def _pin(self, first: str, second: str, place: Floats) -> int:
        """A force of any direction on the second body: the first of its two columns."""
        column = self._push(first, second, place, np.tile([1.0, 0.0], (self.count, 1)))
        self._push(first, second, place, np.tile([0.0, 1.0], (self.count, 1)))
        return column

    def _push(self, first: str, second: str, place: Floats, direction: Floats) -> int:
        moment = place[:, 0] * direction[:, 1] - place[:, 1] * direction[:, 0]
        return self._column({second: 1.0, first: -1.0}, np.column_stack([direction, moment]))

    def _couple(self, first: str, second: str, gear: GearResult | None = None) -> int:
        """A couple on the second body; of a ``gear`` on both its gears, its carrier takes up the sum."""
        shares = {second: 1.0, first: -1.0}
        if gear is not None:
            ratio = gear.gear.ratio
            shares = {second: 1.0, first: ratio, gear.carrier: -1.0 - ratio}
        return self._column(shares, np.tile([0.0, 0.0, 1.0], (self.count, 1)))

    def _column(self, shares: Mapping[str, float], wrench: Floats) -> int:
        bodies = len(self.mechanism.bodies)
        column = np.zeros((self.count, bodies + 1, 3))
        for body, share in shares.items():
            column[:, bodies if body == GROUND else self.mechanism.body_index(body)] += share * wrench
        self.columns.append(column.reshape(self.count, -1))
        return len(self.columns) - 1
