"""The named methods of balancing, side by side on one motion: what each costs, and the force and moment that remain.

As it is; springs; counter-masses; with counter-inertias; mirror images; active masses. All act in the
mechanism's plane, here x-y, and in x-z or y-z as well: its first and second axis stand for x and y, its normal for z.

Counter-inertias are wheels on the base that turn against bodies and take up the angular momentum. A serial chain or
four-bar balanced in force has L = sum_b J_b omega_b with constant J_b, the four-bar if its coupler's centre is on its
line; elsewhere J_b are not constant, and wheels leave a stated residual. A wheel of inertia J_b / k geared to turn at
-k omega_b takes up its share; the motors then drive k J_b more.

Mirror images are on the same base, geared to the same motors: an image under the reflection or half turn T about the
base's origin exerts F' = T F and Mz' = det(T) Mz. One image cancels what T reverses and doubles the rest; three images
(both mirrors and the half turn) cancel all.

Active masses are driven along x and y and a disc about z, so that the base feels nothing: the masses keep the first
moment of mass constant, m_a x_a = -(S_x - mean), the disc the angular momentum, J_a w_a = -L. The masses run on lines
through the base's origin. Stroke and force follow; bandwidth does not enter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..arrays import Floats, root_mean_square
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import Response, driven_rates, momentum, simulate
from ..dynamics.regressor import first_moment
from ..errors import ModelError, SizingError
from ..mechanism.forward_kinematics import motions, plane_axes, poses
from ..mechanism.mechanism import Mechanism
from ..results import Shown
from .closed_forms import ConditionComparison
from .conditions import balance_conditions
from .objective import motion_objective, workspace_motions
from .sizing import exact_sizing
from .springs import joint_torques
from .static_balancing import design_springs

COMPLETE = 1e-9
"""Residual share of the angular momentum up to which wheels count as complete."""
_NEGLIGIBLE = 1e-9
"""First moment [kg m] or angular momentum [kg m2/s] below which an axis needs no mass."""


@dataclass(frozen=True)
class Outcome:
    """A method of balancing on a motion: residual force and moment, drive torque, and what was added."""

    name: str
    force: Floats
    """Residual shaking force, base axes, weight excluded, (n, 3) [N]."""
    moment: Floats
    """Residual shaking moment about the base's origin, weight excluded, (n, 3) [N m]."""
    torque: Mapping[str, Floats]
    """Torque of each motor, all that it drives included; of one that slides its force, (n,) [N m, N]."""
    added_mass: float = 0.0
    """[kg]"""
    added_inertia: float = 0.0
    """About the axes of the bodies that carry it [kg m2]."""
    needs: Mapping[str, float] = field(default_factory=dict)
    """What else the method needs, unit in the name."""
    note: str = ""
    """How it is built, or what remains and why."""

    @classmethod
    def from_response(
        cls, name: str, response: Response, mass: float = 0.0, inertia: float = 0.0, note: str = ""
    ) -> "Outcome":
        """A mechanism's own response; added ``mass`` [kg] and ``inertia`` [kg m2]."""
        return cls(name, response.force, response.moment, response.torque, mass, inertia, {}, note)

    @property
    def force_peak(self) -> float:
        """Largest size of the force [N]."""
        return float(np.linalg.norm(self.force, axis=1).max())

    @property
    def moment_rms(self) -> float:
        """Root mean square of the moment's size [N m]."""
        return root_mean_square(np.linalg.norm(self.moment, axis=1))

    @property
    def moment_peak(self) -> float:
        """Largest size of the moment [N m]."""
        return float(np.linalg.norm(self.moment, axis=1).max())

    def torque_rms(self) -> dict[str, float]:
        """Root mean square of each motor's torque or force [N m, N]."""
        return {joint: root_mean_square(values) for joint, values in self.torque.items()}

    def torque_peak(self) -> dict[str, float]:
        """Largest size of each motor's torque or force [N m, N]."""
        return {joint: float(np.abs(values).max()) for joint, values in self.torque.items()}


@dataclass(frozen=True)
class MethodSettings:
    """What the methods are built with, where the mechanism does not state it."""

    sites: tuple[str, ...] = ()
    """Where counter-masses may be mounted; none: the sites named counter..."""
    wheel_ratio: float = 1.0
    """How many times as fast as the bodies counter-inertias turn."""
    wheel_radius: float = 0.1
    """Radius of counter-inertias, as discs [m]."""
    stroke: float = 0.1
    """Stroke of active masses, from end to end [m]."""
    turn: float = 2.0 * np.pi
    """Angle of the active disc, from end to end [rad]."""
    spring_reach: float = 0.0
    """Distance of spring ends from joints [m]; 0: half the mechanism's length."""
    spring_height: float = 0.0
    """Height of spring ends above and below ground pivots [m]; 0: the mechanism's length."""


def compare_methods(
    mechanism: Mechanism, trajectory: Trajectory, settings: MethodSettings | None = None
) -> list[Outcome]:
    """Outcomes of all methods on one motion; first that of the mechanism as it is."""
    settings = settings or MethodSettings()
    plain = Outcome.from_response("as it is", simulate(mechanism, trajectory))
    plane, names = _plane(mechanism)
    out = max(float(np.abs(plain.force @ plane[2]).max()), float(np.abs(plain.moment @ plane[:2].T).max()))
    size = max(plain.force_peak, plain.moment_peak)
    if out > 1e-9 * size:
        raise ModelError(
            f"{mechanism.name} shakes out of the plane {names[0]}-{names[1]}, to which its first hinge is normal "
            f"({out:.3g} N or N m): the methods are for planar mechanisms"
        )
    if np.abs(plane[2]).max() < 1.0 - _OBLIQUE:
        raise ModelError(
            f"{mechanism.name}: its plane has the normal {np.round(plane[2], 4).tolist()}, along no axis of the base: "
            "describe the mechanism in x-y, x-z or y-z, after whose axes images and masses are named"
        )
    return [
        plain,
        _with_springs(mechanism, trajectory, plain, settings),
        *_with_counter_masses(mechanism, trajectory, settings),
        *mirror_outcomes(mechanism, trajectory),
        active_outcome(mechanism, trajectory, settings.stroke, settings.turn),
    ]


def _plane(mechanism: Mechanism) -> tuple[Floats, str]:
    """Of its plane, to which the first hinge is normal: two axes in it and the normal (rows), base axes, (3, 3).

    And their names, by the nearest of the base's axes: ``xyz``, ``xzy`` or ``yzx``.
    """
    hinges = (k for k, joint in enumerate(mechanism.tree.joints) if joint.revolute)
    normal = poses(mechanism.tree, mechanism.home[None]).axis[0, next(hinges, -1)]
    normal = normal if normal.any() else np.eye(3)[2]
    name = "xyz"[int(np.abs(normal).argmax())]
    return plane_axes(normal), "xyz".replace(name, "") + name


def _with_counter_masses(mechanism: Mechanism, trajectory: Trajectory, settings: MethodSettings) -> list[Outcome]:
    """Counter-masses alone, then with counter-inertias; neither where the mechanism has no place for them."""
    if not settings.sites and not mechanism.counter_sites:
        return []
    objective = motion_objective(mechanism, trajectory)
    sized = exact_sizing(balance_conditions(mechanism), mechanism, settings.sites, objective=objective)
    before, after = sized.root_mean_squares()
    note = "force balance of this motion" if sized.is_complete() else f"leaves {after / before:.3%} of the force"
    if sized.is_balanced(1e-9):
        note = "force balance; static balance with it"
    response = simulate(sized.after, trajectory)
    alone = Outcome.from_response("counter-mass", response, sized.added_mass, sized.added_inertia, note)
    wheels = counter_inertia_outcome(
        sized.after, trajectory, settings.wheel_ratio, settings.wheel_radius, sized.added_mass
    )
    return [alone, replace(wheels, added_inertia=wheels.added_inertia + sized.added_inertia)]


def _with_springs(mechanism: Mechanism, trajectory: Trajectory, plain: Outcome, settings: MethodSettings) -> Outcome:
    """Static balance by springs: they change torques, not momentum."""
    if not mechanism.gravity.any():
        note = "not needed: its file has no gravity"
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=note)
    try:
        found = design_springs(mechanism, (), settings.spring_reach, settings.spring_height)
    except SizingError as error:
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=f"not built: {error}")
    spring_torque = joint_torques(mechanism, found.springs, trajectory.q)
    rates = driven_rates(mechanism, trajectory.per_drive, mechanism.driven or mechanism.coordinates)
    extra = np.einsum("nij,ni->nj", rates, spring_torque)
    torque = {joint: values + extra[:, k] for k, (joint, values) in enumerate(plain.torque.items())}
    needs = {"springs": float(len(found.springs)), "stiffness_N_per_m": sum(s.stiffness for s in found.springs)}
    note = "static balance only: the motors need not carry the weight, the base shakes as before"
    return Outcome("springs", plain.force, plain.moment, torque, 0.0, 0.0, needs, note)


@dataclass(frozen=True)
class Wheel:
    """A wheel on the base, geared to a body."""

    body: int
    """Index of the body against whose rotation in the base frame it turns."""
    momentum: float
    """J_b: what it takes up per angular velocity of the body [kg m2]; negative where it turns with the body."""


@dataclass(frozen=True)
class Wheels:
    """Wheels for a mechanism, and the residual share of its angular momentum."""

    wheels: tuple[Wheel, ...]
    residual_share: float
    """Largest residual angular momentum over the largest without wheels, over the workspace [-]."""

    def is_complete(self, tol: float = COMPLETE) -> bool:
        """Whether the residual share is at most ``tol`` [-]."""
        return self.residual_share <= tol


def fit_wheels(mechanism: Mechanism) -> Wheels:
    """Wheels of least residual angular momentum in the plane, against bodies pivoted on the base if those are enough.

    Least squares over the ``workspace_motions``.
    """
    (q, v), (*_, normal) = workspace_motions(mechanism), _plane(mechanism)[0]
    rotation = motions(mechanism.tree, q, v, np.zeros_like(v)).omega[:, list(mechanism.tree.bodies)] @ normal
    angular, tree = momentum(mechanism, q, v)[:, 3:] @ normal, mechanism.tree
    turning = [b for b, joint in enumerate(tree.bodies) if any(tree.joints[j].revolute for j in tree.path(joint))]
    ground = [b for b in turning if tree.joints[tree.bodies[b]].parent < 0 and tree.joints[tree.bodies[b]].revolute]
    best = _fitted(rotation, angular, ground)
    if best.is_complete() or turning == ground:
        return best
    everywhere = _fitted(rotation, angular, [*ground, *(b for b in turning if b not in ground)])
    return everywhere if everywhere.residual_share < best.residual_share else best


def _fitted(rows: Floats, target: Floats, bodies: Sequence[int]) -> Wheels:
    """Wheels against those of the ``bodies``, in order, whose rotation is no combination of that of those before."""
    chosen = list[int]()
    for body in bodies:
        sizes = np.linalg.svd(rows[:, [*chosen, body]], compute_uv=False)
        chosen += [body] if sizes[-1] > 1e-9 * max(sizes[0], 1e-300) else []
    solved = np.linalg.lstsq(rows[:, chosen], target, rcond=None)[0] if chosen else np.empty(0)
    residual = float(np.abs(target - rows[:, chosen] @ solved).max()) / (float(np.abs(target).max()) or 1.0)
    wheels = [Wheel(b, float(j)) for b, j in zip(chosen, solved, strict=True) if abs(j) > 1e-12 * np.abs(solved).max()]
    return Wheels(tuple(wheels), residual)


def counter_inertia_outcome(
    mechanism: Mechanism, trajectory: Trajectory, ratio: float, radius: float, mounted: float
) -> Outcome:
    """The outcome of wheels that turn ``ratio`` times as fast as the bodies, discs of ``radius`` [m].

    ``mechanism`` has its counter-masses, ``mounted`` is their mass [kg].
    """
    found, response, bodies = fit_wheels(mechanism), simulate(mechanism, trajectory), list(mechanism.tree.bodies)
    *_, normal = _plane(mechanism)[0]
    alpha = motions(mechanism.tree, trajectory.q, trajectory.v, trajectory.a).alpha[:, bodies] @ normal
    rates = driven_rates(mechanism, trajectory.per_drive, mechanism.driven or mechanism.coordinates)
    still = np.zeros_like(trajectory.v)
    turned = [
        motions(mechanism.tree, trajectory.q, rate, still).omega[:, bodies] @ normal
        for rate in np.moveaxis(rates, 2, 0)
    ]
    moment = response.moment.copy()
    torque = {joint: values.copy() for joint, values in response.torque.items()}
    inertia = 0.0
    for wheel in found.wheels:
        moment += wheel.momentum * np.outer(alpha[:, wheel.body], normal)
        inertia += abs(wheel.momentum) / ratio
        for k, joint in enumerate(torque):
            torque[joint] += abs(wheel.momentum) * ratio * alpha[:, wheel.body] * turned[k][:, wheel.body]
    needs = {
        f"wheel_{mechanism.bodies[w.body]}_kgm2": abs(w.momentum) / ratio * (1.0 if w.momentum > 0.0 else -1.0)
        for w in found.wheels
    }
    return Outcome(
        "counter-inertia", response.force, moment, torque, mounted + 2.0 * inertia / radius**2, inertia,
        needs | {"wheel_speed_ratio": ratio, "angular_momentum_left_percent": 100.0 * found.residual_share},
        _wheels_note(found, mechanism.bodies),
    )  # fmt: skip


def _wheels_note(found: Wheels, bodies: Sequence[str]) -> str:
    along = [bodies[wheel.body] for wheel in found.wheels if wheel.momentum < 0.0]
    turned = f"; negative: the wheel of {' and '.join(along)} turns with the body, not against it" if along else ""
    if found.is_complete():
        return f"with the counter-masses; wheels on the base, geared against the bodies' rotation: complete{turned}"
    return (
        "with the counter-masses; wheels on the base: the angular momentum is no constant mixture of the bodies' "
        f"rotations, up to {100 * found.residual_share:.2g} % of it remain{turned}"
    )


_OBLIQUE = 1e-9
"""By how much a component of a unit normal may be below one."""
IMAGES = {
    "mirror image, left-right": ((-1.0, 1.0),),
    "mirror image, up-down": ((1.0, -1.0),),
    "image turned by 180 deg": ((-1.0, -1.0),),
    "three images": ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)),
}
"""Signs of the plane's two axes for each image of a method."""


def mirror_outcomes(mechanism: Mechanism, trajectory: Trajectory) -> list[Outcome]:
    """The outcome of each set of images, none of them balanced otherwise."""
    own, found, (plane, names) = simulate(mechanism, trajectory), [], _plane(mechanism)
    at = poses(mechanism.tree, trajectory.q[:1])
    x, y, z = (plane[2] @ at.rotation[0, list(mechanism.tree.bodies)]).T  # the normal in each body's frame
    about_z = np.stack([x * x, 2 * x * y, y * y, 2 * x * z, 2 * y * z, z * z], axis=1)
    inertia = float(np.sum(mechanism.parameters[:, 4:] * about_z))
    for name, images in IMAGES.items():
        force, moment, torque = own.force.copy(), own.moment.copy(), dict(own.torque)
        for sx, sy in images:
            flip = plane.T @ np.diag([sx, sy, 1.0]) @ plane
            # An image under gravity g needs the torque of the mechanism itself under T g.
            image = simulate(replace(mechanism, gravity=flip @ mechanism.gravity), trajectory)
            force += own.force @ flip
            moment += sx * sy * own.moment @ flip
            torque = {joint: values + image.torque[joint] for joint, values in torque.items()}
        count = len(images)
        note = f"{count} more mechanism{'s' * (count > 1)}, driven by the same motors; "
        note += "cancels all" if count == 3 else _image_note(images[0], names)
        found.append(Outcome(name, force, moment, torque, count * mechanism.total_mass, count * inertia, {}, note))
    return found


def _image_note(signs: tuple[float, float], names: str) -> str:
    found = {f"{of}{axis}": sign for of, axis, sign in zip("FFM", names, (*signs, signs[0] * signs[1]), strict=True)}
    cancelled, doubled = ([what for what, sign in found.items() if (sign < 0.0) == wanted] for wanted in (True, False))
    return f"cancels {' and '.join(cancelled)}, doubles {' and '.join(doubled)}"


def active_outcome(mechanism: Mechanism, trajectory: Trajectory, stroke: float, turn: float) -> Outcome:
    """The outcome of masses that move ``stroke`` [m] and a disc that turns ``turn`` [rad], both from end to end."""
    response, needs, mass, inertia = simulate(mechanism, trajectory), dict[str, float](), 0.0, 0.0
    moment, momenta = first_moment(mechanism, trajectory.q), momentum(mechanism, trajectory.q, trajectory.v)
    plane, names = _plane(mechanism)
    for name, axis in zip(names, plane[:2], strict=False):
        swing = float(np.ptp(moment @ axis))
        if swing < _NEGLIGIBLE:
            continue
        speed, force = -momenta[:, :3] @ axis * stroke / swing, response.force @ axis
        needs |= {
            f"mass_{name}_kg": swing / stroke,
            f"stroke_{name}_m": stroke,
            f"force_{name}_peak_N": float(np.abs(force).max()),
            f"speed_{name}_peak_m_per_s": float(np.abs(speed).max()),
            f"power_{name}_peak_W": float(np.abs(force * speed).max()),
        }
        mass += swing / stroke
    angular = momenta[:, 3:] @ plane[2]
    swept = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(trajectory.time) * (angular[1:] + angular[:-1]))])
    swing = float(np.ptp(swept))
    if float(np.abs(angular).max()) >= _NEGLIGIBLE and swing > 0.0:
        inertia = swing / turn
        speed, torque = -angular / inertia, response.moment @ plane[2]
        needs |= {
            "disc_kgm2": inertia,
            "disc_turn_rad": turn,
            "disc_drift_rad": -float(swept[-1]) / inertia,
            "disc_torque_peak_Nm": float(np.abs(torque).max()),
            "disc_speed_peak_rad_per_s": float(np.abs(speed).max()),
            "disc_power_peak_W": float(np.abs(torque * speed).max()),
        }
    still = np.zeros_like(response.force)
    note = "masses on lines through the base's origin and a disc, each with its own motor; ideal control"
    return Outcome("active", still, still, response.torque, mass, inertia, needs, note)


@dataclass(frozen=True)
class Methods(Shown, rows="compared", figure="balance.figures.balancing:draw_methods"):
    """The named methods of balancing on one motion, and published conditions with the derived ones.

    >>> import balance
    >>> balance.methods("serial-1r", "serial-1r").rows[0]["method"]
    'as it is'

    ``table()`` has what all methods have: masses, force, moment, torques. What one of them needs besides, and its note,
    are in ``rows``, by ``["needs"]`` and ``["note"]``.
    """

    mechanism: Mechanism
    motion: str
    outcomes: tuple[Outcome, ...]
    comparisons: tuple[ConditionComparison, ...]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A method each, units in the keys."""
        by_unit = self.mechanism.drives_by_unit
        return [
            {
                "method": outcome.name,
                "added_mass_kg": outcome.added_mass,
                "added_inertia_kgm2": outcome.added_inertia,
                "force_rms_N": root_mean_square(np.linalg.norm(outcome.force, axis=1)),
                "force_peak_N": outcome.force_peak,
                "moment_rms_Nm": outcome.moment_rms,
                "moment_peak_Nm": outcome.moment_peak,
                **by_unit(outcome.torque_rms(), "torque_rms_Nm", "drive_force_rms_N"),
                **by_unit(outcome.torque_peak(), "torque_peak_Nm", "drive_force_peak_N"),
                "needs": dict(outcome.needs),
                "note": outcome.note,
            }
            for outcome in self.outcomes
        ]

    @property
    def compared(self) -> list[dict[str, Any]]:
        """The rows without what a method needs of its own, and without notes."""
        return [{key: value for key, value in row.items() if key not in ("needs", "note")} for row in self.rows]

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "mechanism": self.mechanism.name,
            "motion": self.motion,
            "methods": self.rows,
            "printed_conditions": [
                {
                    "method": comparison.method,
                    "verdict": comparison.verdict(),
                    "printed_rank": comparison.rank[0],
                    "derived_rank": comparison.rank[1],
                    "distance_of_derived_from_printed": comparison.sufficient,
                    "distance_of_printed_from_derived": comparison.necessary,
                    "distance_once_given": comparison.equal_given,
                    "printed": [dict(row) for row in comparison.published],
                    "given": [dict(row) for row in comparison.given],
                }
                for comparison in self.comparisons
            ],
        }
