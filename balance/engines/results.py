"""Results of engines as plain values for JSON, units in the keys: one cylinder, and a whole engine by orders."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import degrees
from typing import Any

import numpy as np

from ..results import document
from ..rotors.rotor import vector_document
from . import slider_crank
from .engine import Engine, dead_centres, firing
from .free_forces import (
    FreeForces,
    ResidualForces,
    ResidualOverTurn,
    RotatingVector,
    Shaft,
    cylinder_sums,
    free_forces,
)
from .slider_crank import SliderCrank, largest_over_turn, replacements, rod_findings

_POLAR = 24
"""Crank angles of the polar diagram in the document."""


def cylinder_document(
    engine: Engine, cases: Mapping[str, float], omega: float, radius: float | None, mass: float | None
) -> dict[str, Any]:
    """One cylinder of an engine at a speed [rad/s], by counterweight m_b r_b [kg m] of each case.

    ``radius`` [m] chooses r_b, ``mass`` [kg] m_b; the other follows.
    """
    crank = engine.cylinders[0].crank
    inline = crank.reciprocating_mass * crank.radius * omega**2
    best = {model: slider_crank.best_fraction(crank, model) for model in slider_crank.MODELS}
    theta = slider_crank.crank_angles(3600)
    exact, rough = (slider_crank.reciprocating_force(crank, theta, model) for model in ("exact", "order2"))
    error = float(np.abs(exact - rough).max())
    units = {key: {"mass": "kg", "inertia": "kgm2"}.get(key.rpartition("_")[2], "m") for key in asdict(crank)}
    return {
        "engine": engine.name,
        "cylinders": len(engine.cylinders),
        "speed_rad_per_s": omega,
        "ratio_r_over_l": crank.ratio,
        "slider_crank": {f"{key}_{unit}": getattr(crank, key) for key, unit in units.items()},
        "rotating_mass_at_r_kg": crank.rotating_unbalance / crank.radius,
        "rotating_unbalance_kgm": crank.rotating_unbalance,
        "reciprocating_mass_kg": crank.reciprocating_mass,
        "rotating_force_N": crank.rotating_unbalance * omega**2,
        "first_order_force_N": inline * abs(slider_crank.second_order(crank)[1]),
        "second_order_force_N": inline * abs(slider_crank.second_order(crank)[2]),
        "exact_orders_of_reciprocating_force": {
            str(k): [c.real, c.imag] for k, c in slider_crank.exact_series(crank).items() if abs(c) > 1e-12
        },
        "rod": [document(each) for each in replacements(crank)],
        "findings": rod_findings(crank),
        "cases": {name: _case(crank, weight, omega, radius, mass) for name, weight in cases.items()},
        "best_fraction": {
            model: {"fraction": b.fraction, "largest_force_N": b.largest * inline} for model, b in best.items()
        },
        "least_rms_fraction": slider_crank.LEAST_RMS_FRACTION,
        "second_order_error_largest_N": error * inline,
        "second_order_error_of_first_order_percent": 100.0 * error,
    }


def _case(crank: SliderCrank, weight: float, omega: float, radius: float | None, mass: float | None) -> dict[str, Any]:
    found: dict[str, Any] = {
        "counterweight_kgm": weight,
        "counterweight_at_crank_radius_kg": weight / crank.radius,
        "counterweight_mass_kg": weight / radius if radius else mass if mass and weight else None,
        "counterweight_radius_mm": 1e3 * radius if radius else 1e3 * weight / mass if mass and weight else None,
    }
    theta = slider_crank.crank_angles(_POLAR)
    polar = {}
    for model in slider_crank.MODELS:
        found[model] = document(slider_crank.residual_extremes(crank, weight, omega, model))
        polar[model] = [
            {"theta_deg": 360.0 * i / _POLAR, "Fx_N": float(f.real), "Fy_N": float(f.imag)}
            for i, f in enumerate(slider_crank.residual_force(crank, weight, theta, omega, model))
        ]
    return found | {"polar": polar}


def engine_document(
    engine: Engine, free: Sequence[FreeForces], balancing: Sequence[Shaft], residual: ResidualOverTurn, omega: float
) -> dict[str, Any]:
    """Orders, balance shafts, residual forces over a turn, firing; of a layout in m r omega^2 and m r omega^2 a."""
    force, moment = ("mrw2", "mrw2a") if engine.normalised else ("N", "Nm")
    length, unbalance = ("a", "mr") if engine.normalised else ("m", "kgm")
    rolling, _ = largest_over_turn(lambda theta: abs(engine.rolling(theta, omega)))
    return {
        "engine": engine.name,
        "source": engine.source or None,
        "normalised": engine.normalised,
        "ratio_r_over_l": engine.cylinders[0].crank.ratio,
        "speed_rad_per_s": None if engine.normalised else omega,
        f"moments_about_{length}": free[0].about,
        "orders": [
            {
                "order": f.force.order,
                "force": _rotating(f.force, force, omega),
                "moment": _rotating(f.moment, moment, omega),
                f"place_{length}": f.place,
            }
            for f in free
        ],
        "textbook_sums": {str(k): cylinder_sums(engine, k) for k in (1, 2)} if engine.in_line else None,
        "balance_shafts": [
            {
                "order": shaft.order,
                "turns": "forward" if shaft.forward else "backward",
                "is_crankshaft": shaft.is_crankshaft,
                "unbalances": [{f"at_{length}": u.at} | vector_document(u.vector, unbalance) for u in shaft.unbalances],
            }
            for shaft in balancing
        ],
        "over_a_turn_exact": {
            f"force_{force}": residual.stages["before"].largest_force,
            f"moment_{moment}": residual.stages["before"].largest_moment,
            f"rolling_moment_{moment.replace('a', 'r')}": rolling,
        },
        "left_over_a_turn": {
            "theta_deg": [degrees(angle) for angle in residual.theta],
            **{stage: _residual(each, force, moment) for stage, each in residual.stages.items()},
        },
        "firing": {"strokes": engine.strokes, **document(firing(engine)), "dead_centres_deg": dead_centres(engine)},
    }


def _rotating(part: RotatingVector, unit: str, omega: float) -> dict[str, Any]:
    scale = omega**2
    return {
        f"largest_{unit}": scale * part.largest,
        f"least_{unit}": scale * part.least,
        "direction_of_largest_deg": degrees(part.direction) % 180.0,
        "forward": vector_document(scale * part.forward, unit),
        "backward": vector_document(scale * part.backward, unit),
    }


def _residual(residual: ResidualForces, force: str, moment: str) -> dict[str, Any]:
    return {
        f"largest_force_{force}": residual.largest_force,
        f"largest_moment_{moment}": residual.largest_moment,
        f"force_x_{force}": residual.force.real.tolist(),
        f"force_y_{force}": residual.force.imag.tolist(),
        f"moment_x_{moment}": residual.moment.real.tolist(),
        f"moment_y_{moment}": residual.moment.imag.tolist(),
    }


def comparison_row(engine: Engine) -> dict[str, Any]:
    """First and second order of a layout, in m r omega^2 and m r omega^2 a, and how it fires."""
    first, second = free_forces(engine, 2)
    fired = firing(engine)
    return {
        "engine": engine.name,
        "F1_mrw2": first.force.largest,
        "F1_with_counterweights_mrw2": abs(first.force.backward),
        "M1_mrw2a": first.moment.largest,
        "M1_with_counterweights_mrw2a": abs(first.moment.backward),
        "F2_mrw2": second.force.largest,
        "M2_mrw2a": second.moment.largest,
        "place_of_F2_a": second.place,
        "firing_order": list(fired.order),
        "firing_intervals_deg": list(fired.intervals_deg),
        "firing_even": fired.even,
    }
