"""All named methods on one motion."""

from dataclasses import dataclass, replace

import numpy as np

from .. import sizing
from ..closure import Trajectory
from ..conditions import find
from ..dynamics.inverse_dynamics import driven_rates, simulate
from ..errors import ModelError, SizingError
from ..mechanism import Mechanism
from ..static import design as springs
from ..static.springs import joint_torques
from . import active, counterinertia, mirror
from .outcome import Outcome


@dataclass(frozen=True)
class Settings:
    """What the methods are built with, where the mechanism does not say."""

    sites: tuple[str, ...] = ()
    """Where counter-masses may go; none: the sites named counter..."""
    wheel_ratio: float = 1.0
    """How many times as fast as the bodies counter-inertias turn."""
    wheel_radius: float = 0.1
    """Of counter-inertias, as discs [m]."""
    stroke: float = 0.1
    """Of active masses, from end to end [m]."""
    turn: float = 2.0 * np.pi
    """Of the active disc, from end to end [rad]."""
    spring_reach: float = 0.0
    """Of spring ends from joints [m]; 0: half the mechanism's length."""
    spring_height: float = 0.0
    """Of spring ends above and below ground pivots [m]; 0: the mechanism's length."""


def compare(mechanism: Mechanism, trajectory: Trajectory, settings: Settings | None = None) -> list[Outcome]:
    """Outcomes of all methods on one motion, the mechanism as it is first."""
    asked = settings or Settings()
    plain = Outcome.of("as it is", simulate(mechanism, trajectory))
    _refuse_spatial(mechanism, plain)
    return [
        plain,
        _with_springs(mechanism, trajectory, plain, asked),
        *_with_counter_masses(mechanism, trajectory, asked),
        *mirror.applied(mechanism, trajectory),
        active.applied(mechanism, trajectory, asked.stroke, asked.turn),
    ]


def _refuse_spatial(mechanism: Mechanism, plain: Outcome) -> None:
    """Wheels, images and active masses act in the plane x-y; what shakes out of it they would leave unsaid."""
    out = max(float(np.abs(plain.force[:, 2]).max()), float(np.abs(plain.moment[:, :2]).max()))
    size = max(plain.force_peak, plain.moment_peak)
    if out > 1e-9 * size:
        raise ModelError(
            f"{mechanism.name} shakes out of the plane x-y ({out:.3g} N or N m): the methods are for planar ones"
        )


def _with_counter_masses(mechanism: Mechanism, trajectory: Trajectory, asked: Settings) -> list[Outcome]:
    """Counter-masses alone, then with counter-inertias; neither where the mechanism has no place for them."""
    if not asked.sites and not mechanism.counter_sites:
        return []
    sized = sizing.exact(find(mechanism), mechanism, asked.sites)
    percent = sized.residual_percent()
    note = "force balance; static balance with it" if sized.is_balanced(1e-9) else f"leaves {percent:.3g} %"
    alone = Outcome.of("counter-mass", simulate(sized.after, trajectory), sized.added_mass, sized.added_inertia, note)
    wheels = counterinertia.applied(sized.after, trajectory, asked.wheel_ratio, asked.wheel_radius, sized.added_mass)
    return [alone, replace(wheels, added_inertia=wheels.added_inertia + sized.added_inertia)]


def _with_springs(mechanism: Mechanism, trajectory: Trajectory, plain: Outcome, asked: Settings) -> Outcome:
    """Static balance by springs: they change torques, not momentum."""
    if not mechanism.gravity.any():
        note = "not needed: its file has no gravity"
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=note)
    try:
        found = springs.design(mechanism, (), asked.spring_reach, asked.spring_height)
    except SizingError as error:
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=f"not built: {error}")
    needed = joint_torques(mechanism, found.springs, trajectory.q)
    rates = driven_rates(mechanism, trajectory.per_drive, mechanism.driven or mechanism.coordinates)
    extra = np.einsum("nij,ni->nj", rates, needed)
    torque = {joint: values + extra[:, k] for k, (joint, values) in enumerate(plain.torque.items())}
    needs = {"springs": float(len(found.springs)), "stiffness_N_per_m": sum(s.stiffness for s in found.springs)}
    note = "static balance only: weight asks nothing of the motors, the base shakes as before"
    return Outcome("springs", plain.force, plain.moment, torque, 0.0, 0.0, needs, note)
