"""A forecast as a JSON document, as tables for people and as a figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from balance.arrays import Floats
from balance.cli.printing import emit_table, say
from balance.units import G0
from testbench.figures import style

from .force_slide import Reading
from .model import AXES, DISCREPANCY, PARAMETERS, SCATTER, Parameter
from .validation import BASELINES, Forecast, Form, Group, Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PREDICTED: dict[str, Any] = {"marker": "o", "color": style.ANALYSED, "ms": 5.0, "ls": "none"}
_PRINTED: dict[str, Any] = {"marker": "D", "color": style.PUBLISHED, "ms": 5.5, "mfc": "none", "ls": "none"}
_BASELINES = ((style.WITHOUT, "--"), (style.ENCODERS, "-."), (style.ACCELEROMETER, ":"))


def document(forecast: Forecast, forms: Sequence[Form] = ()) -> dict[str, Any]:
    """The whole forecast; ``forms`` where they were asked for."""
    model = forecast.scores[0]
    middle, low, high = forecast.residual_share
    return {
        "published": {"name": forecast.published.name, "source": forecast.published.source},
        "calibrated_on": {"payload_kg": forecast.known.payloads[0], "numbers": len(forecast.known.printed)},
        "parameters": [_parameter(forecast, p) for p in (*PARAMETERS, SCATTER, DISCREPANCY)],
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
    extremes = reading.extremes
    return {
        "acceleration_reduction_percent": extremes.acceleration_percent,
        "force_reduction_percent": extremes.reductions,
        "without_min_max_N": list(extremes.without),
        "with_min_max_N": list(extremes.balanced),
        "peak_to_peak_N": list(extremes.spans),
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


def emit_tables(made: Forecast, compared: Sequence[Form]) -> None:
    """Print predictions, parameters, errors, the forms where they were asked for, and notes."""
    asked = len(made.asked.printed)
    say(
        f"Of {asked} reductions predicted, {round(made.covered * asked)} lie within their intervals; mean absolute "
        f"error {_points(made.scores[0].held_out)} points (nearest acceleration of the lightest payload: "
        f"{_points(made.scores[-1].held_out)})."
    )
    _print_predictions(made)
    _print_parameters(made)
    header = ["mean absolute error, percentage points", "calibrated on", "predicted", "each payload left out",
              *(f"{p:g} kg left out" for p in made.scores[0].leave_one_payload_out)]  # fmt: skip
    rows = [[s.name, *map(_points, (s.calibrated_on, s.held_out, s.left_out, *s.leave_one_payload_out.values()))]
            for s in made.scores]  # fmt: skip
    emit_table("How far off", header, rows)
    header = ["payload kg", "axis", "mean absolute", "mean", ""]
    rows = [[f"{g.payload_kg:g}", g.axis, _points(g.mean_absolute), f"{g.mean:+.1f}", "fails" if g.fails else ""]
            for g in made.groups]  # fmt: skip
    emit_table("Where, percentage points", header, rows)
    if compared:
        _print_forms(made, compared)
    for note in made.notes:
        say(note)


def _print_predictions(made: Forecast) -> None:
    asked = made.asked
    cells = [f"{middle:.0f} ({low:.0f} .. {high:.0f})  {printed:.1f}" for middle, (low, high), printed in
             zip(made.predicted, made.interval, asked.printed, strict=True)]  # fmt: skip
    axes = len(AXES)
    rows = [
        [f"{asked.payload_kg[i]:g}", str(asked.motion[i]), f"{asked.peak_acceleration[i] / G0:g}", *cells[i : i + axes]]
        for i in range(0, len(cells), axes)
    ]
    header = ["payload kg", "motion", "peak g0", *(f"{axis}: predicted (95 %)  printed" for axis in AXES)]
    emit_table(f"Reduction of the base's acceleration, %, {made.published.name}", header, rows)


def _print_parameters(made: Forecast) -> None:
    rows = []
    for p in (*PARAMETERS, SCATTER, DISCREPANCY):
        middle, low, high = made.posterior.interval(p.name)
        rows.append([p.key, f"{middle:.3g}", f"{low:.3g} .. {high:.3g}", f"{p.low:g} .. {p.high:g}", p.meaning])
    emit_table("Calibrated", ["parameter", "median", "95 %", "bounds", "meaning"], rows)


def _print_forms(made: Forecast, compared: Sequence[Form]) -> None:
    rows = [[" ".join(f.parameters), _points(f.fitted), _points(f.left_out)] for f in compared]
    title = f"Which terms the {made.known.payloads[0]:g} kg table asks for, percentage points"
    emit_table(title, ["free parameters", "fitted", "each condition left out"], rows)


def _points(value: float) -> str:
    return f"{value:.1f}"


def prediction(forecast: Forecast) -> "Figure":
    """A row of panels for each payload and motion, a panel an axis."""
    asked = forecast.asked
    lines = [(p, m) for p in asked.payloads for m in dict.fromkeys(asked.motion.tolist())]
    beside = {name: baseline(forecast.known, asked) for name, baseline in BASELINES.items()}
    with style.styled():
        figure, panels = style.light_grid(len(lines), len(AXES), 1.9, sharey=True, sharex=True)
        for line, (payload, motion) in zip(panels, lines, strict=True):
            for panel, axis in zip(line, AXES, strict=True):
                at = (asked.payload_kg == payload) & (asked.motion == motion) & (asked.axis == axis)
                _panel(panel, forecast, at, beside)
                panel.set_title(f"{payload:g} kg, motion {motion}, along {axis}")
            line[0].set_ylabel("falls by [%]")
        for panel in panels[-1]:
            panel.set_xlabel("peak acceleration [g0]")
        style.legend(figure, panels[0, 0])
        model, *others = forecast.scores
        rivals = ", ".join(f"{s.name} {s.held_out:.1f}" for s in others if s.name in BASELINES)
        style.headline(
            figure,
            f"Printed reductions of base acceleration, predicted from those of {forecast.known.payloads[0]:g} kg\n"
            f"mean absolute error {model.held_out:.1f} points; {rivals}",
        )
    return figure


def _panel(panel: "Axes", forecast: Forecast, at: Floats, beside: dict[str, Floats]) -> None:
    x = forecast.asked.peak_acceleration[at] / G0
    order = np.argsort(x)
    low, high = forecast.interval[at][order].T
    panel.fill_between(x[order], low, high, color=style.ANALYSED, alpha=0.15, lw=0, label="95 % for a printed number")
    panel.plot(x, forecast.predicted[at], label="predicted", **_PREDICTED)
    panel.plot(x, forecast.asked.printed[at], label="printed", **_PRINTED)
    for (name, values), (color, dashes) in zip(beside.items(), _BASELINES, strict=True):
        panel.plot(x[order], values[at][order], color=color, ls=dashes, lw=1.0, label=name)
    panel.set_ylim(0.0, 100.0)
