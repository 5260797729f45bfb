"""Inverse dynamics: momentum, shaking wrench and drive torque of a mechanism along a trajectory, as sums over bodies.

The same quantities as ``regressor.W @ pi``, without building W: for one design at many instants. One body is linear in
its ten parameters ``row``, (10,) in the order of ``mechanism.PARAMETERS`` [kg, kg m, kg m2], inertia about the origin
of the joint's frame: a unit row gives a column of a regressor, the body's own row its load.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, parallel_blocks, root_mean_square
from ..closure import Closure, Trajectory
from ..errors import ClosureError, ModelError
from ..mechanism.forward_kinematics import Motion, Pose, Tree, motion, pose
from ..mechanism.mechanism import Mechanism, inertia_matrix
from ..mechanism.pinocchio_engine import PinocchioEngine, refuse_other_than_pinocchio
from ..mechanism.tape import Operand, Program, Symbols, Tape, cross, numbers
from ..motion import Samples
from ..motion.driven_coordinates import Drive
from ..results import Shown, with_units

if TYPE_CHECKING:
    import pandas

NOTHING = 1e-9
"""Peak up to which a component counts as zero throughout [N, N m]."""
_DEAD_CENTRE = 1e-6
"""Share of their largest effect on the mechanism at which driven joints count as having none."""


def along_axis(wrench: Symbols, at: Pose, tree: Tree, joint: int) -> Operand:
    """Share of a ``wrench`` (6,) about the base origin along a joint's axis: torque [N m] or force [N]."""
    force, moment = wrench[:3], wrench[3:]
    if tree.joints[joint].revolute:
        return at.axis[joint] @ (moment - cross(at.position[joint], force))
    return at.axis[joint] @ force


def body_momentum(row: Symbols | Floats, at: Pose, moving: Motion, joint: int) -> Symbols:
    """Linear [kg m/s] and angular momentum about the base origin [kg m2/s] of a body ``row`` (10,), (6,):

    p = m v_o + w x h,   L = o x p + h x v_o + I w,   o the joint's origin, h the first moment about it.
    """
    first, omega, velocity = at.arm(joint, row[1:4]), moving.omega[joint], moving.velocity[joint]
    linear = row[0] * velocity + cross(omega, first)
    spin = _inertia_times(at.rotation[joint], row, omega)
    return np.concatenate([linear, cross(at.position[joint], linear) + cross(first, velocity) + spin])


def body_force(row: Symbols | Floats, at: Pose, moving: Motion, joint: int) -> Symbols:
    """Force [N] and moment about the base origin [N m] that move a body of parameters ``row`` (10,), (6,).

    Newton-Euler about the joint's origin o:

    F = m a_o + al x h + w x (w x h),   M = o x F + h x a_o + I al + w x (I w).
    """
    first, acceleration = at.arm(joint, row[1:4]), moving.acceleration[joint]
    omega, alpha = moving.omega[joint], moving.alpha[joint]
    force = row[0] * acceleration + (cross(alpha, first) + cross(omega, cross(omega, first)))
    spin = _inertia_times(at.rotation[joint], row, alpha)
    gyroscopic = cross(omega, _inertia_times(at.rotation[joint], row, omega))
    moment = cross(at.position[joint], force) + cross(first, acceleration) + (spin + gyroscopic)
    return np.concatenate([force, moment])


def body_weight(row: Symbols | Floats, at: Pose, gravity: Symbols | Floats, joint: int) -> Symbols:
    """Weight [N] and its moment about the base origin [N m] of a body ``row`` (10,) in ``gravity`` (3,), (6,)."""
    centre = row[0] * at.position[joint] + at.arm(joint, row[1:4])
    return np.concatenate([row[0] * gravity, cross(centre, gravity)])


def _inertia_times(rotation: Symbols, row: Symbols | Floats, angular: Symbols) -> Symbols:
    """Inertia about the joint's origin times a base-frame vector."""
    return rotation @ (inertia_matrix(row) @ (rotation.T @ angular))


@dataclass(frozen=True)
class Response(Shown, figure="balance.figures.balancing:draw_response"):
    """What a mechanism does to its base and asks of its motors along a trajectory.

    >>> import balance
    >>> balance.simulate("four-bar", "four-bar", rate="1 kHz").table().columns[0]
    'Fx_N'
    """

    time: Floats
    """Time, (n,) [s]."""
    force: Floats
    """Shaking force, base axes: what the mechanism exerts on its base, weight excluded, (n, 3) [N]."""
    moment: Floats
    """Shaking moment about the origin of the base frame, weight excluded, (n, 3) [N m]."""
    torque: Mapping[str, Floats]
    """Torque of each driven joint on its body, gravity and joint friction included, (n,) [N m, N]."""
    weight_moment: Floats
    """Moment of the moving weight about the origin of the base frame, (n, 3) [N m]."""
    sliding: frozenset[str] = frozenset()
    """Driven joints that slide: their entry in ``torque`` is a force [N], in ``speed`` [m/s]."""
    speed: Mapping[str, Floats] = field(default_factory=dict)
    """Speed of each driven joint, (n,) [rad/s, m/s]."""

    def rms(self) -> dict[str, float]:
        """Root mean square of each component [N, N m]."""
        return {name: root_mean_square(values) for name, values in self.columns().items()}

    def peak(self) -> dict[str, float]:
        """Largest absolute value of each component [N, N m]."""
        return {name: float(np.abs(values).max()) for name, values in self.columns().items()}

    def columns(self) -> dict[str, Floats]:
        """Components (n,) [N, N m] by name: ``Fx_N`` ... ``Mz_Nm``, ``torque_A0_Nm``, ``drive_force_P_N``."""
        names = [f"F{axis}_N" for axis in "xyz"] + [f"M{axis}_Nm" for axis in "xyz"]
        wrench = dict(zip(names, np.hstack([self.force, self.moment]).T, strict=True))
        drives = {
            f"drive_force_{joint}_N" if joint in self.sliding else f"torque_{joint}_Nm": values
            for joint, values in self.torque.items()
        }
        return wrench | drives

    def drives(self) -> dict[str, dict[str, float]]:
        """By driven joint what a motor is chosen by: peak and RMS torque [N m], of slides force [N], RMS over the whole
        motion, rests included; largest speed [rad/s, m/s]; power at the joint [W], largest and least: braking.
        """
        found = {}
        for joint, speed in self.speed.items():
            load, power = self.torque[joint], self.torque[joint] * speed
            name, of_speed = ("force_N", "m_per_s") if joint in self.sliding else ("torque_Nm", "rad_per_s")
            found[joint] = {
                f"peak_{name}": float(np.abs(load).max()), f"rms_{name}": root_mean_square(load),
                f"peak_speed_{of_speed}": float(np.abs(speed).max()),
                "peak_power_W": float(power.max()), "least_power_W": float(power.min()),
            }  # fmt: skip
        return found

    def table(self) -> "pandas.DataFrame":
        """The components over time [s]."""
        import pandas

        return with_units(pandas.DataFrame(self.columns(), index=pandas.Index(self.time, name="time_s")))


def compared(responses: Mapping[str, Response]) -> list[dict[str, Any]]:
    """A row for each component that is not zero throughout in all ``responses``: ``rms_before``, ``peak_before`` ...

    The first, ``F_N``, is of the force vector: its magnitude over time.
    """
    vectors = {name: np.linalg.norm(one.force, axis=1) for name, one in responses.items()}
    sizes = dict[str, dict[str, float]]()
    for name, one in responses.items():
        sizes[f"rms_{name}"] = {"F_N": root_mean_square(vectors[name])} | one.rms()
    for name, one in responses.items():
        sizes[f"peak_{name}"] = {"F_N": float(vectors[name].max(initial=0.0))} | one.peak()
    rows: list[dict[str, Any]] = [
        {"component": name, **{key: size[name] for key, size in sizes.items()}} for name in next(iter(sizes.values()))
    ]
    return [row for row in rows if max(row[f"peak_{name}"] for name in responses) > NOTHING]


def simulate(mechanism: Mechanism, trajectory: Trajectory) -> Response:
    """Shaking wrench and drive torque along a trajectory.

    F = -d(linear momentum)/dt, M = -d(angular momentum)/dt about the base frame's origin.
    """
    count, joints = len(trajectory.time), mechanism.tree.joints
    losses = (mechanism.armature, mechanism.viscous, mechanism.coulomb)
    parameters = np.concatenate([mechanism.pi, mechanism.gravity, *losses])
    key, states = ("loads", (parameters != 0.0).tobytes()), (trajectory.q, trajectory.v, trajectory.a)
    program = mechanism.tree.once(key, lambda: _loads_program(mechanism))
    wrench, weight, joint_torque = np.empty((6, count)), np.empty((3, count)), np.empty((len(joints), count))

    def load(part: slice) -> None:
        program.run([x[part].T for x in states], [x[:, part] for x in (wrench, weight, joint_torque)], parameters)

    for _ in parallel_blocks(count, load):
        pass

    def found(k: int) -> Floats:
        return np.concatenate([wrench[:, k], joint_torque[:, k]])

    def expected(engine: PinocchioEngine, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        regressor = np.concatenate([engine.wrench_regressor(q, v, a), engine.torque_regressor(q, v, a)])
        lost = mechanism.armature * a + mechanism.viscous * v + mechanism.coulomb * np.sign(v)
        lost = np.concatenate([np.zeros(6), lost])
        weight = np.linalg.norm(mechanism.gravity) * mechanism.total_mass  # at rest it may be all that is added up
        return regressor @ mechanism.pi + lost, np.abs(regressor) @ np.abs(mechanism.pi) + np.abs(lost) + weight

    refuse_other_than_pinocchio(mechanism, "wrench or torque", key, states, found, expected)
    torque = _drive_torque(mechanism, trajectory, joint_torque.T)
    index = {joint: mechanism.coordinate_index(joint) for joint in torque}
    sliding = frozenset(joint for joint, k in index.items() if not joints[k].revolute)
    speed = {joint: trajectory.v[:, k] for joint, k in index.items()}
    return Response(trajectory.time, wrench[:3].T, wrench[3:].T, torque, weight.T, sliding, speed)


def _loads_program(mechanism: Mechanism) -> Program:
    """From (q, v, a) to shaking force and moment, moment of the weight, and the torque of every joint."""
    tree, tape = mechanism.tree, Tape()
    q, v, a = (tape.rows(tree.size) for _ in range(3))
    at = pose(tree, q)
    moving = motion(tree, at, v, a)
    rows, gravity = tape.parameters(mechanism.parameters), tape.parameters(mechanism.gravity)
    armature, viscous, coulomb = map(tape.parameters, (mechanism.armature, mechanism.viscous, mechanism.coulomb))
    inertial, weight = numbers(np.zeros((2, tree.size + 1, 6)))
    for row, joint in zip(rows, tree.bodies, strict=True):
        inertial[joint] = body_force(row, at, moving, joint)
        weight[joint] = body_weight(row, at, gravity, joint)
    torque = numbers(np.zeros(tree.size))
    for i in reversed(range(tree.size)):
        lost = armature[i] * a[i] + viscous[i] * v[i] + coulomb[i] * v[i].sign()
        torque[i] = along_axis(inertial[i] - weight[i], at, tree, i) + lost
        for loads in (inertial, weight):  # those of the base are last: the total
            loads[tree.joints[i].parent] += loads[i]
    return tape.program([*(0.0 - inertial[-1]), *weight[-1, 3:], *torque])


def momentum(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """Linear momentum [kg m/s], then angular about the base frame's origin [kg m2/s], for (n, nv) states, (n, 6)."""
    tree = mechanism.tree

    def write() -> Program:
        tape = Tape()
        at = pose(tree, tape.rows(tree.size))
        moving = motion(tree, at, tape.rows(tree.size))
        bodies = zip(tape.parameters(mechanism.parameters), tree.bodies, strict=True)
        return tape.program(np.sum([body_momentum(row, at, moving, joint) for row, joint in bodies], axis=0))

    program = tree.once(("momentum", (mechanism.parameters != 0.0).tobytes()), write)
    return program.values(q.T, v.T, parameters=mechanism.pi).T


def _drive_torque(mechanism: Mechanism, trajectory: Trajectory, joint_torque: Floats) -> dict[str, Floats]:
    """Torques of the driven joints: those of the open tree, projected on what the loops allow."""
    driven = mechanism.driven
    if not driven:
        return {}
    if not mechanism.loops and len(driven) == len(mechanism.coordinates):
        return {joint: joint_torque[:, mechanism.coordinate_index(joint)] for joint in driven}
    _refuse_undetermined(mechanism, trajectory.per_drive, driven)
    rows = [mechanism.coordinate_index(joint) for joint in driven]
    torque = np.einsum("jin,in->jn", trajectory.per_drive.T, joint_torque.T).T
    if not _are_driven(trajectory.per_drive, rows):
        _refuse_dead_centre(mechanism, trajectory, driven, rows)
        per_motor = trajectory.per_drive[:, rows].transpose(0, 2, 1)
        torque = np.linalg.solve(per_motor, torque[:, :, None])[:, :, 0]
    return {joint: torque[:, i] for i, joint in enumerate(driven)}


def _are_driven(per_drive: Floats, rows: list[int]) -> bool:
    """Whether the coordinates in ``rows`` are what the motion drives, in that order."""
    return bool((per_drive.T[:, rows] == np.eye(len(rows))[:, :, None]).all())


def _refuse_dead_centre(mechanism: Mechanism, trajectory: Trajectory, driven: tuple[str, ...], rows: list[int]) -> None:
    """Raise ClosureError where the driven joints do not move the mechanism: their torque has no bound there."""
    size = np.linalg.det(trajectory.per_drive[:, rows])
    dead = np.abs(size) <= _DEAD_CENTRE * np.abs(size).max()
    dead[1:] |= np.sign(size[1:]) != np.sign(size[:-1])
    if dead.any():
        time = trajectory.time[int(np.argmax(dead))]
        raise ClosureError(
            f"{mechanism.name} is at a dead centre of {', '.join(driven)} at t = {time:.6g} s of this motion: the "
            "torque of its motors has no bound there; drive other joints in <actuator>"
        )


def driven_rates(mechanism: Mechanism, per_drive: Floats, driven: tuple[str, ...]) -> Floats:
    """Rates of all coordinates per rate of the driven joints, (n, nv, dof) [-, m, 1/m].

    ``per_drive`` (n, nv, dof) are the trajectory's rates per driven coordinate.

    Raises ModelError where the number of driven joints is not that of the degrees of freedom.
    """
    _refuse_undetermined(mechanism, per_drive, driven)
    rows = [mechanism.coordinate_index(joint) for joint in driven]
    if _are_driven(per_drive, rows):
        return per_drive
    return np.einsum("nij,njk->nik", per_drive, np.linalg.inv(per_drive[:, rows]))


def _refuse_undetermined(mechanism: Mechanism, per_drive: Floats, driven: tuple[str, ...]) -> None:
    if len(driven) != per_drive.shape[2]:
        raise ModelError(
            f"{mechanism.name} has {per_drive.shape[2]} degrees of freedom and {len(driven)} driven joints "
            f"({', '.join(driven)}): their torques are not determined; name others in <actuator>, or leave it out: "
            "force and moment do not depend on it"
        )


def shaking_force_per_acceleration(mechanism: Mechanism, body: str) -> float | None:
    """Largest shaking force per acceleration of a body's centre in the plane x-y, whatever its direction [N/(m/s2)].

    None where the position of that body does not determine the mechanism, so that there is no such number.
    """
    closure = Closure(mechanism).without_idle()
    drive = Drive.of_point(mechanism, body, ("x", "y"))
    if drive.size != closure.dof:
        return None
    at = drive.value(closure.engine, closure.home)
    rest = Samples(np.zeros(1), at[None], np.zeros((1, 2)), np.zeros((1, 2)), point=body)
    try:
        columns = [
            simulate(replace(mechanism, driven=()), closure.follow(replace(rest, acceleration=unit[None]))).force[0]
            for unit in np.eye(2)
        ]
    except ClosureError:
        return None
    return float(np.linalg.svd(np.array(columns), compute_uv=False)[0])
