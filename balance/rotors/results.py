"""What correction weights from trial runs have to say, as one document: units in the keys, senses as in the sheet."""

import math
from typing import Any

import numpy as np

from ..arrays import Complexes
from ..estimation.estimate import Region
from .correction_uncertainty import CoefficientCovariance, CorrectionUncertainty, PolarInterval
from .influence_coefficients import Solution
from .rotor import vector_document as vector
from .trial_runs import TrialRuns

ILL_CONDITIONED = 30.0
"""Condition number of the coefficients above which planes act so much alike that it is a finding."""
READING = {
    "length": ("um", "um", 1e6),
    "velocity": ("mm/s", "mm_per_s", 1e3),
    "acceleration": ("m/s2", "m_per_s2", 1.0),
    "mixed": ("SI", "SI", 1.0),
}
"""Unit of readings by their dimension: for people, in keys, and its factor from SI."""
WEIGHT = {"mass": ("g", "g", 1e3), "first moment": ("g mm", "gmm", 1e6)}
"""Unit of weights, likewise."""
_EXACT = 1e-12
"""Share of the reading before below which a predicted one is rounding alone."""


def of_solution(sheet: TrialRuns, solution: Solution) -> dict[str, Any]:
    """Weights with their intervals, readings before and after, coefficients, findings."""
    _, reading, r = READING[sheet.reading]
    sure = sheet.uncertainty(solution)
    before, after = solution.coefficients.initial, predicted_residual(solution)
    return {
        "name": sheet.name,
        "source": sheet.source or None,
        "note": sheet.note or None,
        "phase": sheet.phase,
        "angles": sheet.angles,
        "amplitude": sheet.amplitude,
        "method": solution.method,
        "trial_weights": _trials(sheet),
        "planes": _planes(sheet, solution, sure),
        "readings": _readings(sheet, solution, sure),
        "intervals": None if sure is None else _intervals(sure),
        f"rms_before_{reading}": _rms(before) * r,
        f"rms_after_{reading}": _rms(after) * r,
        "cost_SI": solution.cost,
        "cost_lower_bound_SI": solution.bound,
        "condition": solution.coefficients.condition,
        f"misfit_of_runs_{reading}": solution.coefficients.misfit * r,
        "findings": _findings(sheet, solution, sure),
    }


def predicted_residual(solution: Solution) -> Complexes:
    """Predicted readings, what is rounding alone as zero, (rows,)."""
    size = float(np.abs(solution.coefficients.initial).max(initial=0.0))
    return np.where(np.abs(solution.residual) < _EXACT * size, 0.0, solution.residual)


def _trials(sheet: TrialRuns) -> dict[str, Any]:
    effects = sheet.effects()
    return {
        run.name: {"stayed_on": run.stayed_on, "largest_effect": _finite(effects[run.name])}
        for run in sheet.runs
        if run.stayed_on is not None
    }


def _planes(sheet: TrialRuns, solution: Solution, sure: CorrectionUncertainty | None) -> list[dict[str, Any]]:
    _, unit, w = WEIGHT[sheet.weight]
    total, on = sheet.in_sheet_sense(solution.weights), sheet.in_sheet_sense(sheet.on_now)
    none: list[PolarInterval | None] = [None] * len(total)
    sums = none if sure is None else [*sure.weights]
    adding = none if sure is None else [*sure.about(solution.weights - sheet.on_now)]
    found = []
    for j, plane in enumerate(sheet.planes):
        printed = sheet.published.get(plane.name)
        found.append(
            {
                "plane": plane.name,
                "total": {**vector(complex(total[j]), unit, w), **_within(sums[j], unit, w)},
                "on_now": vector(complex(on[j]), unit, w),
                "add": {**vector(complex(total[j] - on[j]), unit, w), **_within(adding[j], unit, w)},
                "region": None if sure is None else _region(sheet, sure.regions[j], unit, w),
                "published": None if printed is None else vector(printed, unit, w),
            }
        )
    return found


def _readings(sheet: TrialRuns, solution: Solution, sure: CorrectionUncertainty | None) -> list[dict[str, Any]]:
    (_, unit, r), (_, weight, w) = READING[sheet.reading], WEIGHT[sheet.weight]
    coefficients = solution.coefficients
    before, after = sheet.as_sheet_phase(coefficients.initial), sheet.as_sheet_phase(predicted_residual(solution))
    return [
        {
            "sensor": sensor,
            "speed": speed,
            "factor": float(solution.factors[i]),
            "before": vector(complex(before[i]), unit, r),
            "after": vector(complex(after[i]), unit, r),
            f"after_within_{unit}": None if sure is None else float(sure.after[i]) * r,
            "coefficients_lead_with_rotation": {
                plane.name: vector(complex(coefficients.matrix[i, j]), f"{unit}_per_{weight}", r / w)
                for j, plane in enumerate(sheet.planes)
            },
        }
        for i, (sensor, speed) in enumerate(sheet.rows)
    ]


def _within(interval: PolarInterval | None, unit: str, factor: float) -> dict[str, float | None]:
    return {
        f"magnitude_{unit}_within": None if interval is None else factor * interval.magnitude,
        "angle_deg_within": None if interval is None else math.degrees(interval.angle),
    }


def _region(sheet: TrialRuns, region: Region, unit: str, factor: float) -> dict[str, Any]:
    """The ellipse about the weight that the figure shows."""
    turned = region.angle if sheet.angles == "with rotation" else -region.angle
    return {
        f"half_axes_{unit}": [factor * half for half in region.half_axes],
        "long_axis_deg": math.degrees(turned) % 180.0,
    }


def _intervals(sure: CorrectionUncertainty) -> dict[str, Any]:
    scatter = sure.scatter
    return {
        "level": "95 %",
        "from": scatter.source,
        "degrees_of_freedom_a_row": _finite(scatter.degrees_of_freedom),
        "stated_errors_widened_by": scatter.widened,
        "draws": sure.draws,
    }


def _findings(sheet: TrialRuns, solution: Solution, sure: CorrectionUncertainty | None) -> list[str]:
    found = []
    condition = solution.coefficients.condition
    if condition > ILL_CONDITIONED:
        found.append(
            f"condition number {condition:.3g}: the planes act so much alike that small errors of reading give large "
            "weights; use fewer planes or more sensors"
        )
    if sheet.reading == "mixed":
        found.append("sensors read different quantities: each was divided by its scale")
    if sure is not None:
        found += _doubts(sheet, sure.scatter, sure)
    return found


def _doubts(sheet: TrialRuns, scatter: CoefficientCovariance, sure: CorrectionUncertainty) -> list[str]:
    found = []
    if scatter.widened > 1.0:
        found.append(
            f"the runs scatter {scatter.widened:.2g} times more than the stated intervals of readings allow: intervals "
            "are widened by that; look for a weight, speed or temperature that was not alike in all runs"
        )
    for plane, interval in zip(sheet.planes, sure.weights, strict=True):
        if interval.angle >= math.pi:
            found.append(
                f"the weight in plane {plane.name!r} is not told from none: its angle means nothing; use larger trial "
                "weights, more runs, or leave the plane out"
            )
    return found


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _rms(readings: Complexes) -> float:
    return float(np.sqrt(np.mean(np.abs(readings) ** 2)))
