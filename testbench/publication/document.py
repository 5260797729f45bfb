"""A forecast as one JSON document: every number, units in the keys."""

from collections.abc import Sequence
from typing import Any

from balance.quantities import G0

from .baselines import BASELINES
from .forecast import Forecast
from .forms import Form
from .model import PARAMETERS, SCATTER, Parameter
from .slide_reading import Reading
from .validation import Group, Score


def document(forecast: Forecast, forms: Sequence[Form] = ()) -> dict[str, Any]:
    """The whole forecast; ``forms`` where they were asked for."""
    model = forecast.scores[0]
    middle, low, high = forecast.residual_share
    return {
        "published": {"name": forecast.published.name, "source": forecast.published.source},
        "calibrated_on": {"payload_kg": forecast.known.payloads[0], "numbers": len(forecast.known.printed)},
        "parameters": [_parameter(forecast, p) for p in (*PARAMETERS, SCATTER)],
        "residual_share_of_what_remains": {"median": middle, "interval": [low, high]},
        "predictions": _predictions(forecast),
        "numbers_predicted": len(forecast.asked.printed),
        "mean_absolute_error_points": model.held_out,
        "within_interval_share": forecast.covered,
        "errors": [_score(score) for score in forecast.scores],
        "by_payload_and_axis": [_group(group) for group in forecast.groups],
        "fails_at": [{"payload_kg": g.payload_kg, "axis": g.axis, "mean_error_points": g.mean} for g in forecast.groups
                     if g.fails],
        "force_sensors": _reading(forecast.reading) if forecast.reading else None,
        **({"forms": [_form(form) for form in forms]} if forms else {}),
        "notes": forecast.notes,
    }  # fmt: skip


def _parameter(forecast: Forecast, parameter: Parameter) -> dict[str, Any]:
    middle, low, high = forecast.posterior.interval(parameter.name)
    fitted = dict(zip(forecast.best.names, forecast.best.values.tolist(), strict=True))
    ends = dict(zip(forecast.best.names, forecast.best.ranges.tolist(), strict=True))
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "meaning": parameter.meaning,
        "bounds": [parameter.low, parameter.high],
        "median": middle,
        "interval": [low, high],
        "best_fit": fitted.get(parameter.name),
        "range_of_equal_fits": ends.get(parameter.name),
    }


def _predictions(forecast: Forecast) -> list[dict[str, Any]]:
    asked = forecast.asked
    beside = {name: baseline(forecast.known, asked) for name, baseline in BASELINES.items()}
    best = forecast.best.predict(asked)
    return [
        {
            "payload_kg": float(asked.payload_kg[i]),
            "motion": str(asked.motion[i]),
            "peak_acceleration_g": round(float(asked.peak_acceleration[i]) / G0, 12),
            "axis": str(asked.axis[i]),
            "predicted_percent": float(forecast.predicted[i]),
            "interval_percent": forecast.interval[i].tolist(),
            "printed_percent": float(asked.printed[i]),
            "error_points": float(forecast.errors[i]),
            "best_fit_alone_percent": float(best[i]),
            "baselines_percent": {name: float(values[i]) for name, values in beside.items()},
        }
        for i in range(len(asked.printed))
    ]


def _score(score: Score) -> dict[str, Any]:
    return {
        "name": score.name,
        "calibration_points": score.calibrated_on,
        "held_out_points": score.held_out,
        "leave_one_payload_out_points": score.left_out,
        "left_out_payloads": [
            {"payload_kg": payload, "points": error} for payload, error in score.leave_one_payload_out.items()
        ],
    }


def _group(group: Group) -> dict[str, Any]:
    return {
        "payload_kg": group.payload_kg,
        "axis": group.axis,
        "numbers": group.count,
        "mean_absolute_error_points": group.mean_absolute,
        "mean_error_points": group.mean,
        "fails": group.fails,
    }


def _reading(reading: Reading) -> dict[str, Any]:
    slide = reading.slide
    return {
        "acceleration_reduction_percent": slide.acceleration_percent,
        "force_reduction_percent": slide.reductions,
        "without_min_max_N": list(slide.without),
        "with_min_max_N": list(slide.balanced),
        "peak_to_peak_N": list(slide.spans),
        "rigid_peak_to_peak_N": [2.0 * reading.force_without, 2.0 * reading.force_left],
        "rigid_moment_peak_Nm": [reading.moment_without, reading.moment_with],
        "would_remain_N": reading.would_remain,
        "unbalanced_mass_kg": reading.unbalanced_mass,
        "cannot_reconcile": list(reading.cannot()),
        "could_reconcile": list(reading.can()),
    }


def _form(form: Form) -> dict[str, Any]:
    return {
        "parameters": list(form.parameters),
        "calibration_points": form.fitted,
        "leave_one_condition_out_points": form.left_out,
    }
