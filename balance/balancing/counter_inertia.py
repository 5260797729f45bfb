"""Counter-inertia: wheels on the base that turn against bodies and take up the angular momentum.

A serial chain or four-bar balanced in force has L = sum_b J_b omega_b with constant J_b, the four-bar if its coupler's
centre lies on its line; where J_b are not constant, wheels leave a rest, which is said. A wheel of inertia J_b / k
geared to turn at -k omega_b takes its share up; it asks k J_b of the motors.

How the bodies of a planar mechanism turn in the base frame, along a trajectory and per motor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import driven_rates, momentum, simulate
from ..mechanism import forward_kinematics
from ..mechanism.mechanism import Mechanism
from ..mechanism.sparse_components import dense
from .outcome import Outcome


@dataclass(frozen=True)
class Rotation:
    """Rotation of every body about the base's z axis."""

    omega: Floats
    """Angular velocity, (n, bodies) [rad/s]."""
    alpha: Floats
    """Angular acceleration, (n, bodies) [rad/s2]."""
    per_motor: Floats
    """Angular velocity per motor speed, (n, bodies, motors)."""


def angular_velocity(mechanism: Mechanism, q: Floats, v: Floats) -> Floats:
    """Angular velocity of the bodies about z at (n, nv) states, (n, bodies) [rad/s]."""
    return _turning(mechanism, q, v, np.zeros_like(v))[0]


def rotation(mechanism: Mechanism, trajectory: Trajectory) -> Rotation:
    """Rotation of the bodies along a trajectory."""
    omega, alpha = _turning(mechanism, trajectory.q, trajectory.v, trajectory.a)
    motors = mechanism.driven or mechanism.coordinates
    rates = driven_rates(mechanism, trajectory.per_drive, motors)
    each = [angular_velocity(mechanism, trajectory.q, rates[:, :, k]) for k in range(rates.shape[2])]
    return Rotation(omega, alpha, np.stack(each, axis=2))


def _turning(mechanism: Mechanism, q: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
    q, v, a = (np.ascontiguousarray(x.T) for x in (q, v, a))
    at = forward_kinematics.pose(mechanism.tree, q)
    moving = forward_kinematics.motion(mechanism.tree, at, v, a)
    joints = mechanism.tree.bodies
    omega = np.array([dense(moving.omega[j], at.count)[2] for j in joints]).T
    alpha = np.array([dense(moving.alpha[j], at.count)[2] for j in joints]).T
    return omega, alpha


_STATES = 60
COMPLETE = 1e-9
"""Share of the angular momentum left over below which wheels are called complete."""


@dataclass(frozen=True)
class Wheel:
    """A wheel on the base, geared to a body."""

    body: int
    """Index of the body against whose rotation in the base frame it turns."""
    momentum: float
    """J_b: what it takes up per angular velocity of the body [kg m2]; negative where it turns with the body."""


@dataclass(frozen=True)
class Wheels:
    """Wheels for a mechanism, and the share of its angular momentum that they leave."""

    wheels: tuple[Wheel, ...]
    left_over: float
    """Largest angular momentum left over the largest without wheels, at other states than those of the fit."""

    def is_complete(self, tol: float = COMPLETE) -> bool:
        """Whether nothing is left over in any motion."""
        return self.left_over <= tol


def fit_wheels(mechanism: Mechanism) -> Wheels:
    """Wheels that leave the least angular momentum about z, on bodies pivoted on the base if those are enough."""
    closure = Closure(mechanism)
    ground = [b for b, j in enumerate(mechanism.tree.bodies) if _on_the_base(mechanism, j)]
    turning = [b for b in range(len(mechanism.bodies)) if _turns(mechanism, b)]
    best = _fitted(mechanism, closure, [b for b in ground if b in turning])
    if best.is_complete() or set(turning) <= set(ground):
        return best
    everywhere = _fitted(mechanism, closure, [*ground, *(b for b in turning if b not in ground)])
    return everywhere if everywhere.left_over < best.left_over else best


def counter_inertia_outcome(
    mechanism: Mechanism, trajectory: Trajectory, ratio: float, radius: float, before: float
) -> Outcome:
    """The outcome of wheels that turn ``ratio`` times as fast as the bodies, discs of ``radius`` [m].

    ``mechanism`` has its counter-masses; ``before`` is their mass [kg].
    """
    found, response, turning = fit_wheels(mechanism), simulate(mechanism, trajectory), rotation(mechanism, trajectory)
    moment = response.moment.copy()
    torque = {joint: values.copy() for joint, values in response.torque.items()}
    inertia = 0.0
    for wheel in found.wheels:
        taken = wheel.momentum * turning.alpha[:, wheel.body]
        moment[:, 2] += taken
        inertia += abs(wheel.momentum) / ratio
        for k, joint in enumerate(torque):
            asked = abs(wheel.momentum) * ratio * turning.alpha[:, wheel.body]
            torque[joint] += asked * turning.per_motor[:, wheel.body, k]
    needs = {
        f"wheel_{mechanism.bodies[w.body]}_kgm2": abs(w.momentum) / ratio * (1.0 if w.momentum > 0.0 else -1.0)
        for w in found.wheels
    }
    return Outcome(
        "counter-inertia", response.force, moment, torque, before + 2.0 * inertia / radius**2, inertia,
        needs | {"wheel_speed_ratio": ratio, "angular_momentum_left_percent": 100.0 * found.left_over},
        _note(found),
    )  # fmt: skip


def _note(found: Wheels) -> str:
    if found.is_complete():
        return "with the counter-masses; wheels on the base, geared against the bodies' rotation: complete"
    return (
        "with the counter-masses; wheels on the base: the angular momentum is no constant mixture of the bodies' "
        f"rotations, up to {100 * found.left_over:.2g} % of it is left"
    )


def _fitted(mechanism: Mechanism, closure: Closure, bodies: Sequence[int]) -> Wheels:
    rows, target = _states(mechanism, closure, 0)
    columns = _independent(rows, bodies)
    solved = np.linalg.lstsq(rows[:, columns], target, rcond=None)[0] if columns else np.empty(0)
    rows, target = _states(mechanism, closure, 1)
    size = float(np.abs(target).max()) or 1.0
    left = float(np.abs(target - rows[:, columns] @ solved).max()) / size
    wheels = [Wheel(b, float(j)) for b, j in zip(columns, solved, strict=True) if abs(j) > 1e-12 * np.abs(solved).max()]
    return Wheels(tuple(wheels), left)


def _states(mechanism: Mechanism, closure: Closure, seed: int) -> tuple[Floats, Floats]:
    """Angular velocities of all bodies (n, bodies), and the angular momentum about z (n,)."""
    q = closure.states(_STATES, seed)
    v = closure.velocities(q, seed)
    return angular_velocity(mechanism, q, v), momentum(mechanism, q, v)[:, 5]


def _independent(rows: Floats, bodies: Sequence[int]) -> list[int]:
    """Bodies, in order, that do not turn as others before them do together."""
    chosen: list[int] = []
    for body in bodies:
        trial = rows[:, [*chosen, body]]
        size = np.linalg.svd(trial, compute_uv=False)
        if size[-1] > 1e-9 * max(size[0], 1e-300):
            chosen.append(body)
    return chosen


def _on_the_base(mechanism: Mechanism, joint: int) -> bool:
    return mechanism.tree.joints[joint].parent < 0 and mechanism.tree.joints[joint].revolute


def _turns(mechanism: Mechanism, body: int) -> bool:
    return any(mechanism.tree.joints[j].revolute for j in mechanism.tree.path(mechanism.tree.bodies[body]))
