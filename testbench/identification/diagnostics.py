"""What may explain a difference to values that others give, each by a fit of its own; and the document of all findings.

* A joint alone: the first moments from each joint's torque by itself. Where they differ, a torque is scaled, or a joint
  has friction that the model lacks.
* Scale between joints: tau_k = s W_k pi with tau_1 = W_1 pi. Bodies that both torques move tie them together. A scale
  common to all of them cannot be distinguished from heavier bodies: every parameter scales in the same way.
* Scales of torques: determined where runs differ by masses that are known (``torque_scales.py``).
* Friction: none, dry alone, dry and viscous, dry that differs by direction, and that of the mechanism's file.
* Delay and cut-off: no delay between torque and motion, from low to high cut-offs. Noise of the motion that a high
  cut-off lets in pulls least squares towards zero.
* The file's own parameters: what they leave of the same torques.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.dynamics.regressor import FRICTION_LAWS
from balance.errors import DataError
from balance.estimation.base_parameters import BaseParameters
from balance.estimation.estimate import LEVEL, Estimate
from balance.estimation.identifiability import identifiability
from balance.results import document, plain

from ..kinematics.gaps import GAP_FINDING
from ..recording import Finding
from .cross_validation import RULE, unexplained
from .estimators import NAMES
from .model_tests import FALSE_ALARM, FREE_ALARM
from .regression_equations import RegressionEquations, regression_equations
from .result import FRICTION_FINDING, Identification, Validation

SCALE_UNKNOWN = (
    "a scale common to all torques and heavier bodies look alike: it takes runs that differ by a mass that is known "
    "(conditions payload_kg or counter_masses)"
)
_ROUNDS = 20
_SETTLED = 1e-9
_FRICTION = {
    "no friction": ("coulomb[", "viscous["),
    "dry friction": ("viscous[",),
    "viscous friction": ("coulomb[",),
    "dry and viscous friction": (),
}
"""Models of friction, with the terms that each lacks."""


def _shown(found: Estimate) -> dict[str, Any]:
    return {"value": found.value, "interval": found.interval()}


def evidence(result: Identification) -> dict[str, Any]:
    """First moments by other fits, all of least squares at the cut-off and delay of an identification."""
    equations, joints = result.choice.equations, result.joints
    names, rows = equations.names, equations.low_passed_torque(result.chosen.delay)
    columns = equations.low_passed_columns(range(len(names)))
    places, everything = range(len(names)), list(range(len(result.rows)))
    alone = [
        _fit(result, f"{result.named(row)} alone", equations, columns, names, rows, [k])
        for k, row in enumerate(result.rows)
    ]
    friction, file_friction, without_delay = [], None, []
    if joints:
        for name, lacking in _FRICTION.items():
            kept = [k for k in places if not names[k].startswith((*lacking, *FRICTION_LAWS))]
            own = [names[k] for k in kept]
            friction.append(_fit(result, name, equations, columns[:, :, kept], own, rows, everything))
        dry = [names.index(f"coulomb[{joint}]") for joint in joints]
        squares = equations.joined(lambda part: part.low_passed(part.whole[:, :, dry] ** 2))  # of the direction
        both = np.concatenate([columns, squares], axis=2), [*names, *(f"uneven[{joint}]" for joint in joints)]
        friction.append(_fit(result, "dry and viscous friction, dry by direction", equations, *both, rows, everything))
        kept = [k for k in places if not names[k].startswith(("coulomb[", "viscous[", *FRICTION_LAWS))]
        fixed = np.setdiff1d(places, kept)
        known = columns[:, :, fixed] @ result.in_file[fixed]
        others = columns[:, :, kept], [names[k] for k in kept]
        file_friction = _fit(result, "friction of MECH's file", equations, *others, rows, everything, known)
        for one in result.choice.best_of_each:
            at = regression_equations(equations.records, result.mechanism, one.cutoff)
            name, low = f"no delay, {one.cutoff:.3g} Hz", at.low_passed_columns(places)
            without_delay.append(_fit(result, name, at, low, names, at.low_passed_torque(0.0), everything))
    left = unexplained(rows, columns @ result.in_file, equations.moving)
    base = result.identified.identifiability.base_columns(columns)
    scales = {k: _scale_between(equations, base, rows, k) for k in range(1, len(joints))}
    return {
        "fits_by": "least squares at the chosen cut-off and delay",
        "rows_alone": alone,
        "friction": friction,
        "friction_of_file": file_friction,
        "without_delay": without_delay,
        "file_rms_ratio_below_cutoff": dict(zip(result.rows, left.tolist(), strict=True)),
        "torque_scale_between_joints": {f"{joints[k]} / {joints[0]}": one and _shown(one) for k, one in scales.items()},
        "scale_of_all": _scale_of_all(result),
        "torque_scales": {name: _shown(one) for name, one in result.tests.scales.each.items()},
        "radii_of_gyration_squared_m2": {
            body: {"beyond_stated": interval} for body, interval in result.tests.scales.radii_of_gyration.items()
        },
    }


def _scale_of_all(result: Identification) -> dict[str, Any]:
    """One scale where all agree, else why there is none."""
    scales = result.tests.scales
    if scales.common is not None:
        told = "from masses that are known to differ between the runs"
        return {"identifiable": True, "reason": told, **_shown(scales.common)}
    apart = "the torques' scales differ, or not each is determined: see torque_scales"
    return {"identifiable": False, "reason": apart if scales.each else SCALE_UNKNOWN}


def _fit(
    result: Identification,
    name: str,
    equations: RegressionEquations,
    columns: Floats,
    names: Sequence[str],
    rows: Floats,
    chosen: list[int],
    known: Floats | float = 0.0,
) -> dict[str, Any]:
    """First moments from the ``chosen`` rows, of which ``known`` is taken off; None where these do not determine one.

    And the part of each row below the cut-off that the fit does not explain.
    """
    moving, measured = equations.moving[:, chosen], (rows - known)[:, chosen]
    seen = identifiability(columns[:, chosen] * moving[:, :, None], names)
    base = seen.base_columns(columns[:, chosen])
    found = BaseParameters(seen, equations.fitted(base, measured, moving))
    left = unexplained(rows[:, chosen], rows[:, chosen] - measured + base @ found.values, moving)
    moments = {}
    for text, row in result.moment_rows():
        determined = set(row) <= set(seen.names) and seen.is_identifiable(seen.vector(row))
        moments[text] = _shown(found.estimate(row)) if determined else None
    shares = {result.rows[k]: float(share) for k, share in zip(chosen, left, strict=True)}
    return {"fit": name, "first_moments_kgm": moments, "rms_ratio_below_cutoff": shares}


def _scale_between(equations: RegressionEquations, base: Floats, rows: Floats, joint: int) -> Estimate | None:
    """Scale of a joint's torque against the first joint's; None where no body makes both, as a lift's along gravity.

    Gauss-Newton on tau_k = s W_k pi: columns s W_k, and W_k pi for the change of s.
    """
    scale, pi = 1.0, equations.fitted(base, rows).values
    for _ in range(_ROUNDS):
        columns = base.copy()
        columns[:, joint] *= scale
        made = np.zeros((*base.shape[:2], 1))
        made[:, joint, 0] = base[:, joint] @ pi
        found = equations.fitted(np.concatenate([columns, made], axis=2), rows)
        pi, step = found.values[:-1], float(found.values[-1])
        scale += step
        if abs(step) < _SETTLED:
            break
    last = np.eye(len(found.values))[-1]
    return replace(found.estimate(last), values=np.array([scale])) if found.determines(last) else None


def identification_document(result: Identification) -> dict[str, Any]:
    """All that was found."""
    determined = bool(result.mechanism.counter_sites) and not result.undetermined_moments()
    found = {
        "mechanism": result.mechanism.name,
        "runs": list(result.runs),
        "origin": result.origin,
        "rows": list(result.rows),
        "method": {"name": result.method, "what": NAMES[result.method], "compared": result.comparison},
        "parameters": [
            {"name": name, "value": one and one.value, "interval": one and one.interval, "observable": one is not None}
            for name, one in result.parameters()
        ],
        "base_parameters": [*result.base_values(), *result.joint_values()],
        "first_moments": result.first_moments(),
        "first_moment_ratios": result.moment_ratios(),
        "counter_masses": result.counter_masses() if determined else None,
        "consistent": _consistent(result),
        "identifiability": {**document(result.identified.identifiability), "excitation": result.excitation},
        "cutoff": {"chosen_Hz": result.chosen.cutoff, "rule": RULE, "held_out_error": result.choice.best_of_each},
        "torque_delay_s": result.chosen.delay,
        "interval": {
            "confidence": LEVEL,
            "statistical": f"delete-block jackknife over {result.identified.fit.blocks} blocks",
            "method": f"widened to contain: {', '.join(result.variants)}",
        },
        "evidence": evidence(result),
        "model_tests": {
            "false_alarm_rate": FALSE_ALARM,
            "false_alarm_rate_free": FREE_ALARM,
            "laws": result.tests.laws,
            "free": result.tests.free,
            "friction": result.friction,
            "motion": result.tests.motion,
        },
        "validation": _validation(result, result.validation),
        "verdict": result.verdict,
        "findings": [
            *(Finding(GAP_FINDING, None, text.partition(":")[0], text).as_dict() for text in result.lost),
            *(finding.as_dict() for finding in result.contradictions),
            *(Finding(FRICTION_FINDING, None, None, text).as_dict() for text in result.other_friction),
        ],
        "doubts": [doubt.text for doubt in result.all_doubts],
        "doubt_codes": [doubt.code for doubt in result.all_doubts],
        "by": result.by,
        "left_out": list(result.notes),
        "inseparable": list(result.inseparable.values()),
    }
    return dict(plain(found))


def _consistent(result: Identification) -> dict[str, Any]:
    """The nearest bodies that can exist, a member of the set that the record determines; or why there are none."""
    try:
        found = result.consistent
    except DataError as error:
        return {"free_estimate_feasible": None, "reason": str(error)}
    seen = result.identified.identifiability
    return {
        "free_estimate_feasible": found.free_is_feasible,
        "distance_in_standard_errors": found.distance,
        "what": "one of those that the record leaves, nearest to the mechanism's file where it does not tell",
        "parameters": [
            {"name": name, "value": float(value), "determined": name not in seen.undetermined}
            for name, value in zip(seen.names, found.parameters, strict=True)
        ],
    }


def _validation(result: Identification, validation: Validation | None) -> dict[str, Any]:
    def ratios(of: Identification | Validation, prefix: str = "") -> dict[str, Any]:
        as_recorded, below = (
            dict(zip(result.rows, shares.tolist(), strict=True)) for shares in (of.rms_ratio, of.rms_ratio_in_band)
        )
        return {f"{prefix}rms_ratio": as_recorded, f"{prefix}rms_ratio_below_cutoff": below}

    if validation is None:
        return {"on": "held-out blocks", **ratios(result)}
    angles = validation.angles and {k: v for k, v in document(validation.angles).items() if k != "all_rms"}
    return {
        "on": "separate runs",
        "runs": list(validation.runs),
        **ratios(validation),
        "simulated_angle_error_rad": angles,
        **ratios(result, "held_out_"),
    }
