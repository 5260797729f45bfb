"""Results of rotors as plain values for JSON, units in the keys: corrections, weights from trial runs, splits."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Complexes, root_mean_square
from ..estimation.estimate import LEVEL_TEXT
from ..results import Shown, document, finite
from ..units import G0
from .correction_uncertainty import CorrectionUncertainty, PolarInterval
from .influence_coefficients import Solution
from .rotor import (
    Correction,
    Rotor,
    Unbalance,
    angle_deg,
    bearing_loads,
    bearing_weights,
    correct_planes,
    correction_findings,
    mass_and_radius,
    polygons,
    unbalance_couple,
    unbalance_force,
    vector_document,
)
from .trial_runs import TrialRuns
from .weight_splitting import Split, hole_directions

ILL_CONDITIONED = 30.0
"""Condition number of the coefficients above which it is a finding."""
READING = {
    "length": ("um", "um", 1e6),
    "velocity": ("mm/s", "mm_per_s", 1e3),
    "acceleration": ("m/s2", "m_per_s2", 1.0),
    "mixed": ("SI", "SI", 1.0),
}
"""Unit of readings by their dimension: for people, in keys, and its factor from SI."""
WEIGHT = {"mass": ("g", "g", 1e3), "first moment": ("g mm", "gmm", 1e6)}
"""Unit of weights, likewise."""
_ROUNDING = 1e-10
"""Share of the largest initial reading below which a predicted one is what rounding and solver leave."""


def correction_document(rotor: Rotor, correction: Correction) -> dict[str, Any]:
    """Corrections in their planes, unbalance and bearing loads before and after, and the polygons."""

    def in_kgmm(vector: complex | None) -> dict[str, float] | None:
        return None if vector is None else vector_document(vector, "kgmm", 1e3)

    def sum_and_couple(unbalances: Sequence[Unbalance]) -> dict[str, Any]:
        couple = vector_document(unbalance_couple(unbalances, about.at), "kgmm2", 1e6)
        return {"force": in_kgmm(unbalance_force(unbalances)), f"couple_about_plane_{about.name}": couple}

    about = correction.planes[0]
    planes = []
    for plane, vector in correction.in_planes:
        mass, radius = mass_and_radius(plane, vector) or (None, None)
        planes.append(
            {"plane": plane.name, "at_mm": 1e3 * plane.at}
            | vector_document(vector, "kgmm", 1e3)
            | {"mass_kg": mass, "radius_mm": None if radius is None else 1e3 * radius}
            | {"published": in_kgmm(rotor.published.get(plane.name))}
        )
    at_rest, loads = None, {}
    if rotor.mass is not None and rotor.centre is not None and len(rotor.bearings) == 2:
        at_rest = list(bearing_weights(rotor.mass, rotor.centre, rotor.bearings, G0))
    if rotor.bearings and rotor.speed is not None:
        states = {"before": rotor.unbalances}
        for plane in rotor.planes if len(rotor.planes) > 1 else ():
            states[f"static balance alone, in {plane.name}"] = correct_planes(rotor.unbalances, [plane]).after
        for name, state in (states | {"after": correction.after}).items():
            loads[name] = [vector_document(each, "N") for each in bearing_loads(state, rotor.bearings, rotor.speed)]
    return {
        "rotor": rotor.name,
        "source": rotor.source or None,
        "unbalances": [
            {"name": u.name, "at_mm": 1e3 * u.at} | vector_document(u.vector, "kgmm", 1e3) for u in rotor.unbalances
        ],
        "before": sum_and_couple(rotor.unbalances),
        "corrections": planes,
        "after": sum_and_couple(correction.after),
        "residual_kgmm": 1e3 * correction.residual(),
        "findings": correction_findings(rotor, correction),
        "speed_rad_per_s": rotor.speed,
        "bearings_mm": [1e3 * z for z in rotor.bearings],
        "bearing_loads": loads,
        "weight_on_bearings_N": at_rest,
        "polygons": [
            {
                "title": polygon.title,
                "sides": [*polygon.names, *polygon.closing_names],
                f"vertices_{unit}": [[factor * v.real, factor * v.imag] for v in polygon.vertices],
                f"gap_{unit}": factor * polygon.gap(),
            }
            for polygon in polygons(correction)
            for unit, factor in [("kgmm", 1e3) if polygon.unit == "kg m" else ("kgmm2", 1e6)]
        ],
    }


def split_document(split: Split, radius: float | None) -> dict[str, Any]:
    """Weights in the holes that are used, and the residual; ``radius`` of the holes [m] where it is stated."""
    rows = zip(split.holes, hole_directions(split.holes), split.weights, split.pieces, strict=True)
    return {
        "correction": vector_document(split.target, "g", 1e3),
        "radius_mm": None if radius is None else 1e3 * radius,
        "holes": [
            {"hole": hole.name, "angle_deg": angle_deg(complex(unit)), "weight_g": 1e3 * weight, "pieces": list(pieces)}
            for hole, unit, weight, pieces in rows
            if weight > 0.0
        ],
        "made": vector_document(split.made, "g", 1e3),
        "residual_g": 1e3 * split.residual(),
        "residual_percent": split.residual_percent(),
        "least_possible_residual_g": 1e3 * split.bound,
        "total_weight_g": 1e3 * sum(split.weights),
    }


def trial_runs_document(runs: TrialRuns, solution: Solution) -> dict[str, Any]:
    """Weights with their intervals, readings before and after, coefficients, findings; senses as in the file."""
    _, reading, r = READING[runs.reading]
    uncertainty = runs.uncertainty(solution)
    before, after = solution.coefficients.initial, predicted_residual(solution)
    return {
        **document(runs),
        **document(solution),
        "trial_weights": {
            name: {"stayed_on": run.stayed_on, "largest_effect": finite(effect)}
            for name, effect in runs.effects().items()
            for run in runs.runs
            if run.name == name
        },
        "planes": _planes(runs, solution, uncertainty),
        "readings": _readings(runs, solution, uncertainty),
        "intervals": None if uncertainty is None else {"level": LEVEL_TEXT, **document(uncertainty)},
        f"rms_before_{reading}": root_mean_square(before) * r,
        f"rms_after_{reading}": root_mean_square(after) * r,
        f"misfit_of_runs_{reading}": solution.coefficients.misfit * r,
        "findings": _findings(runs, solution, uncertainty),
    }


@dataclass(frozen=True)
class Influence(Shown, rows="planes", figure="balance.figures.rotating:draw_readings"):
    """Trial runs and the correction weights that they give."""

    runs: TrialRuns
    solution: Solution

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document of ``balance rotor influence --json``."""
        return trial_runs_document(self.runs, self.solution)

    @property
    def planes(self) -> list[dict[str, Any]]:
        """Of each plane the weights in all, still on and to be added, with their intervals, the unit in the key."""
        return list(self.document["planes"])

    @property
    def findings(self) -> list[str]:
        """What makes the weights doubtful."""
        return list(self.document["findings"])


def predicted_residual(solution: Solution) -> Complexes:
    """Predicted readings, (rows,) [m, m/s or m/s2]; what is rounding error is zero."""
    size = float(np.abs(solution.coefficients.initial).max(initial=0.0))
    return np.where(np.abs(solution.residual) < _ROUNDING * size, 0.0, solution.residual)


def _planes(runs: TrialRuns, solution: Solution, uncertainty: CorrectionUncertainty | None) -> list[dict[str, Any]]:
    _, unit, w = WEIGHT[runs.weight]

    def vector(weight: complex, interval: PolarInterval | None) -> dict[str, float | None]:
        return {
            **vector_document(weight, unit, w),
            f"magnitude_{unit}_within": None if interval is None else w * interval.magnitude,
            "angle_deg_within": None if interval is None else math.degrees(interval.angle),
        }

    total, on = runs.in_file_sense(solution.weights), runs.in_file_sense(runs.mounted)
    rows = []
    for j, plane in enumerate(runs.planes):
        published, region, within, within_added = runs.published.get(plane.name), None, None, None
        if uncertainty is not None:
            within, within_added = (
                uncertainty.about(weights)[j] for weights in (solution.weights, solution.weights - runs.mounted)
            )
            ellipse = uncertainty.regions[j]  # about the weight that the figure shows
            turned = ellipse.angle if runs.angles == "with rotation" else -ellipse.angle
            region = {
                f"half_axes_{unit}": [w * half for half in ellipse.half_axes],
                "long_axis_deg": math.degrees(turned) % 180.0,
            }
        rows.append(
            {
                "plane": plane.name,
                "total": vector(complex(total[j]), within),
                "on_now": vector_document(complex(on[j]), unit, w),
                "add": vector(complex(total[j] - on[j]), within_added),
                "region": region,
                "published": None if published is None else vector_document(published, unit, w),
            }
        )
    return rows


def _readings(runs: TrialRuns, solution: Solution, uncertainty: CorrectionUncertainty | None) -> list[dict[str, Any]]:
    (_, unit, r), (_, weight, w) = READING[runs.reading], WEIGHT[runs.weight]
    coefficients = solution.coefficients
    before, after = runs.in_file_phase(coefficients.initial), runs.in_file_phase(predicted_residual(solution))
    return [
        {
            "sensor": sensor,
            "speed": speed,
            "factor": float(solution.factors[i]),
            "before": vector_document(complex(before[i]), unit, r),
            "after": vector_document(complex(after[i]), unit, r),
            f"after_within_{unit}": None if uncertainty is None else float(uncertainty.after[i]) * r,
            "coefficients_lead_with_rotation": {
                plane.name: vector_document(complex(coefficients.matrix[i, j]), f"{unit}_per_{weight}", r / w)
                for j, plane in enumerate(runs.planes)
            },
        }
        for i, (sensor, speed) in enumerate(runs.rows)
    ]


def _findings(runs: TrialRuns, solution: Solution, uncertainty: CorrectionUncertainty | None) -> list[str]:
    findings = []
    condition = solution.coefficients.condition
    if condition > ILL_CONDITIONED:
        findings.append(
            f"condition number {condition:.3g}: the effects of the planes are nearly proportional, so that small "
            "errors of reading give large weights; use fewer planes or more sensors"
        )
    if runs.reading == "mixed":
        findings.append("sensors read different quantities: each was divided by its scale")
    if uncertainty is None:
        return findings
    widened = uncertainty.coefficients.widened
    if widened > 1.0:
        findings.append(
            f"the runs scatter {widened:.2g} times more than the stated intervals of readings allow: intervals are "
            "widened by that; look for a weight, speed or temperature that differed between runs"
        )
    for plane, interval in zip(runs.planes, uncertainty.weights, strict=True):
        if interval.angle >= math.pi:
            findings.append(
                f"the weight in plane {plane.name!r} is not distinguished from zero: its angle means nothing; use "
                "larger trial weights, more runs, or leave the plane out"
            )
    return findings
