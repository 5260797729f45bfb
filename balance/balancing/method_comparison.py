"""All named methods on one motion.

The named ways of balancing, side by side on one motion.

The named methods as one document: every number of their tables and figure, units in the keys.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import balancing
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import driven_rates, simulate
from ..errors import ModelError, SizingError
from ..mechanism.mechanism import Mechanism
from . import counter_inertia, mirror_and_active
from . import static_balancing as springs
from .closed_forms import ConditionComparison
from .conditions import balance_conditions
from .outcome import Outcome
from .springs import joint_torques


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


def compare_methods(mechanism: Mechanism, trajectory: Trajectory, settings: Settings | None = None) -> list[Outcome]:
    """Outcomes of all methods on one motion, the mechanism as it is first."""
    asked = settings or Settings()
    plain = Outcome.of("as it is", simulate(mechanism, trajectory))
    _refuse_spatial(mechanism, plain)
    return [
        plain,
        _with_springs(mechanism, trajectory, plain, asked),
        *_with_counter_masses(mechanism, trajectory, asked),
        *mirror_and_active.mirror_outcome(mechanism, trajectory),
        mirror_and_active.active_outcome(mechanism, trajectory, asked.stroke, asked.turn),
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
    sized = balancing.exact_sizing(balance_conditions(mechanism), mechanism, asked.sites)
    percent = sized.residual_percent()
    note = "force balance; static balance with it" if sized.is_balanced(1e-9) else f"leaves {percent:.3g} %"
    alone = Outcome.of("counter-mass", simulate(sized.after, trajectory), sized.added_mass, sized.added_inertia, note)
    wheels = counter_inertia.counter_inertia_outcome(
        sized.after, trajectory, asked.wheel_ratio, asked.wheel_radius, sized.added_mass
    )
    return [alone, replace(wheels, added_inertia=wheels.added_inertia + sized.added_inertia)]


def _with_springs(mechanism: Mechanism, trajectory: Trajectory, plain: Outcome, asked: Settings) -> Outcome:
    """Static balance by springs: they change torques, not momentum."""
    if not mechanism.gravity.any():
        note = "not needed: its file has no gravity"
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=note)
    try:
        found = springs.design_springs(mechanism, (), asked.spring_reach, asked.spring_height)
    except SizingError as error:
        return Outcome("springs", plain.force, plain.moment, plain.torque, note=f"not built: {error}")
    needed = joint_torques(mechanism, found.springs, trajectory.q)
    rates = driven_rates(mechanism, trajectory.per_drive, mechanism.driven or mechanism.coordinates)
    extra = np.einsum("nij,ni->nj", rates, needed)
    torque = {joint: values + extra[:, k] for k, (joint, values) in enumerate(plain.torque.items())}
    needs = {"springs": float(len(found.springs)), "stiffness_N_per_m": sum(s.stiffness for s in found.springs)}
    note = "static balance only: weight asks nothing of the motors, the base shakes as before"
    return Outcome("springs", plain.force, plain.moment, torque, 0.0, 0.0, needs, note)


def methods_document(
    name: str, motion: str, outcomes: Sequence[Outcome], comparisons: Sequence[ConditionComparison]
) -> dict[str, Any]:
    """Outcomes side by side, and printed conditions beside the derived ones."""
    return {
        "mechanism": name,
        "motion": motion,
        "methods": [_outcome(outcome) for outcome in outcomes],
        "printed_conditions": [_comparison(comparison) for comparison in comparisons],
    }


def _outcome(outcome: Outcome) -> dict[str, Any]:
    return {
        "method": outcome.name,
        "added_mass_kg": outcome.added_mass,
        "added_inertia_kgm2": outcome.added_inertia,
        "force_rms_N": outcome.force_rms,
        "force_peak_N": outcome.force_peak,
        "moment_rms_Nm": outcome.moment_rms,
        "moment_peak_Nm": outcome.moment_peak,
        "torque_rms_Nm": outcome.torque_rms(),
        "torque_peak_Nm": outcome.torque_peak(),
        "needs": dict(outcome.needs),
        "note": outcome.note,
    }


def _comparison(comparison: ConditionComparison) -> dict[str, Any]:
    return {
        "method": comparison.method,
        "verdict": comparison.verdict(),
        "printed_rank": comparison.rank[0],
        "derived_rank": comparison.rank[1],
        "distance_of_derived_from_printed": comparison.sufficient,
        "distance_of_printed_from_derived": comparison.necessary,
        "distance_once_given": comparison.equal_given,
        "printed": [dict(row) for row in comparison.printed],
        "given": [dict(row) for row in comparison.given],
    }
