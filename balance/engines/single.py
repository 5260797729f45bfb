"""One cylinder of an engine as plain values for JSON, units in the keys: rod, forces, partial balance."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from . import partial, peak, series, survey
from .engine import Engine
from .rod import replacements
from .slidercrank import SliderCrank

_POLAR = 24
"""Crank angles of the polar diagram in the document."""


def document(
    engine: Engine, cases: Mapping[str, float], omega: float, radius: float | None, mass: float | None
) -> dict[str, Any]:
    """One cylinder of an engine at a speed [rad/s], by counterweight m_b r_b [kg m] of each case.

    ``radius`` [m] chooses r_b, ``mass`` [kg] m_b; the other follows.
    """
    crank = engine.cylinders[0].crank
    inline = crank.reciprocating_mass * crank.radius * omega**2
    best = {model: partial.best_fraction(crank, model) for model in partial.MODELS}
    return {
        "engine": engine.name,
        "cylinders": len(engine.cylinders),
        "speed_rad_per_s": omega,
        "ratio_r_over_l": crank.ratio,
        "slider_crank": {f"{key}_{_unit(key)}": value for key, value in asdict(crank).items()},
        "rotating_mass_at_r_kg": crank.rotating / crank.radius,
        "rotating_unbalance_kgm": crank.rotating,
        "reciprocating_mass_kg": crank.reciprocating_mass,
        "rotating_force_N": crank.rotating * omega**2,
        "first_order_force_N": inline * abs(series.second_order(crank)[1]),
        "second_order_force_N": inline * abs(series.second_order(crank)[2]),
        "exact_orders_of_reciprocating_force": {
            str(k): [c.real, c.imag] for k, c in series.exact(crank).items() if abs(c) > 1e-12
        },
        "rod": _rod(crank),
        "cases": {name: _case(crank, weight, omega, radius, mass) for name, weight in cases.items()},
        "best_fraction": {
            model: {"fraction": b.fraction, "largest_force_N": b.largest * inline} for model, b in best.items()
        },
        "least_rms_fraction": partial.least_rms_fraction(crank),
        "second_order_error_largest_N": _truncation(crank) * inline,
        "second_order_error_of_first_order_percent": 100.0 * _truncation(crank),
    }


def _unit(key: str) -> str:
    return "kg" if key.endswith("mass") else "kgm2" if key.endswith("inertia") else "m"


def _rod(crank: SliderCrank) -> list[dict[str, Any]]:
    if not 0.0 < crank.rod_centre < crank.rod_length or crank.rod_mass == 0.0:
        return []
    return [
        {
            "replacement": found.name,
            "masses": [{"place": m.place, "mass_kg": m.mass, "at_mm": 1e3 * m.at} for m in found.masses],
            "missing_inertia_kgm2": found.missing_inertia,
        }
        for found in replacements(crank)
    ]


def _case(crank: SliderCrank, weight: float, omega: float, radius: float | None, mass: float | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "counterweight_kgm": weight,
        "counterweight_at_crank_radius_kg": weight / crank.radius,
        "counterweight_mass_kg": weight / radius if radius else mass if mass and weight else None,
        "counterweight_radius_mm": 1e3 * radius if radius else 1e3 * weight / mass if mass and weight else None,
    }
    for model in partial.MODELS:
        turn = survey.over_a_turn(crank, weight, omega, model)
        found[model] = {
            "F_max_N": turn.largest,
            "F_max_at_deg": turn.at_deg,
            "F_min_N": turn.least,
            "F_rms_N": turn.rms,
            "Fx_N": list(turn.x),
            "Fy_N": list(turn.y),
        }
    theta = peak.turn(_POLAR)
    found["polar"] = {
        model: [
            {"theta_deg": 360.0 * i / _POLAR, "Fx_N": float(f.real), "Fy_N": float(f.imag)}
            for i, f in enumerate(partial.remaining(crank, weight, theta, omega, model))
        ]
        for model in partial.MODELS
    }
    return found


def _truncation(crank: SliderCrank) -> float:
    """Largest difference of the exact motion and first with second order, of m r omega^2."""
    theta = peak.turn(3600)
    difference = partial.reciprocation(crank, theta, "exact") - partial.reciprocation(crank, theta, "order2")
    return float(np.abs(difference).max())
