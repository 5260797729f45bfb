"""Results of linkages as plain values for JSON, units in the keys."""

from collections.abc import Mapping, Sequence
from math import isfinite
from types import MappingProxyType
from typing import Any

import numpy as np

from .equations import linkage_equations
from .equivalence_method import Built, LinkageBalance
from .linkage import GROUND
from .moment_balance import GearResult
from .published_values import Comparison
from .verification import SimulatedLinkage, Verification, counter_gears_without_mass

HEAVY = 100.0
"""Times what it balances from which a counter-mass is a finding."""


def linkage_document(
    result: LinkageBalance,
    check: Verification | None,
    comparison: Comparison | None,
    built: Mapping[str, Built] = MappingProxyType({}),
    findings: Sequence[str] = (),
    made: LinkageBalance | None = None,
) -> dict[str, Any]:
    """The whole balance: tree, counter-masses, gears, equations, dynamics, as built, and what the source publishes.

    ``made`` is the linkage with what is ``built``.
    """
    return {
        "linkage": result.linkage.name,
        "title": result.linkage.title,
        "reduction": [
            {"body": name, "joint": result.tree[name], "mass_kg": balance.mass, "point_masses_kg": dict(balance.shares)}
            for name, balance in result.force.items()
        ],
        "residual_first_moment_kgm": result.residual(),
        "counter_masses": _counter_masses(result),
        "gears": _gears(result),
        "inertias": [
            {"body": name, "inertia_about_joint_kgm2": body.inertia, "terms": body.terms}
            for name, body in (result.moment.bodies.items() if result.moment else ())
            if body.terms
        ],
        "reshaped_inertia_kgm2": dict(result.moment.reshaped) if result.moment else {},
        "built": {name: text if isinstance(text, str) else list(text) for name, text in built.items()},
        "as_built": made and {"counter_masses": _counter_masses(made), "gears": _gears(made)},
        "findings": [*findings],
        "equations": linkage_equations(result),
        "simulated": None
        if check is None
        else {
            "origin": "simulated",
            "speed_rad_per_s": check.speed,
            "variation_share_of_speed": check.variation,
            "swings": check.swings,
            "constant_speed": _run(check.constant),
            "varying_speed": _run(check.varying),
            "moving_mass_kg": dict(check.mass),
            "counter_gears_without_mass": counter_gears_without_mass(made or result),
            "multiple_of_before": {stage: check.penalty(stage) for stage in check.constant.responses},
        },
        "printed": comparison,
    }


def linkage_findings(result: LinkageBalance) -> list[str]:
    """Numbers that the equations allow and no workshop makes, or no body has; empty where there are none."""
    linkage, values, found = result.linkage, result.values, []
    for name, counter in result.counters():
        balance = result.force[name]
        loads = [*balance.loads, *(result.moment.bodies[name].extra.loads if result.moment else ())]
        carried = sum(load.mass for load in loads)
        if counter.mass > HEAVY * carried:
            far = 1e3 * float(np.linalg.norm(counter.position))
            found.append(
                f"counter-mass {counter.symbol} is {counter.mass / carried:.4g} times what it balances, "
                f"{carried:.4g} kg: its place is {far:.4g} mm from joint {balance.joint}; give one further out"
            )
    for body in linkage.bodies.values():
        joints = [j for j in linkage.joints.values() if j.joins(body.name)]
        points = [p.at(values) for j in joints if (p := j.end(body.name).point) is not None]
        if len(points) < 2 or not all(joint.revolute and not joint.joins(GROUND) for joint in joints):
            continue  # a crank or rocker may carry a flywheel
        length = max(float(np.linalg.norm(p - q)) for p in points for q in points)
        for part in body.parts:
            gyration = float(np.sqrt(values.get(part.inertia, 0.0) / values[part.mass]))
            if gyration > length:
                found.append(
                    f"link {part.link}: inertia {values[part.inertia]:.4g} kg m2 means a radius of gyration of "
                    f"{1e3 * gyration:.4g} mm, and its joints are {1e3 * length:.4g} mm apart: no rod has that; check "
                    "the inertia, about the link's own centre of mass, and its unit"
                )
    return found


def _gears(result: LinkageBalance) -> list[GearResult]:
    return list(result.moment.gears.values()) if result.moment else []


def _counter_masses(result: LinkageBalance) -> list[dict[str, Any]]:
    count = len(result.counters("force"))
    return [
        {
            "symbol": counter.symbol,
            "body": body,
            "against": "gears" if k >= count else "links",
            "mass_kg": counter.mass,
            "position_from_reduction_joint_m": counter.position.tolist(),
            "inertia_kgm2": counter.inertia,
        }
        for k, (body, counter) in enumerate(result.counters())
    ]


def _run(run: SimulatedLinkage) -> dict[str, Any]:
    return {
        "bearing_forces": {  # None where it is statically indeterminate
            stage: None
            if forces is None
            else {f"largest_{name}_N": peaks for name, peaks in forces.peaks().items()}
            | {"undetermined_gears": list(forces.undetermined)}
            for stage, forces in run.bearings.items()
        },
        "rms": {stage: run.rms(stage) for stage in run.responses},
        "share_of_before": {  # None where it was zero before and is not now
            stage: {name: share if isfinite(share) else None for name, share in run.residual(stage).items()}
            for stage in run.responses
        },
        "time_s": run.trajectory.time.tolist(),
        "series": {stage: {k: v.tolist() for k, v in run.series(stage).items()} for stage in run.responses},
    }
