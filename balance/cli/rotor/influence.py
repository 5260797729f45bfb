"""``balance rotor influence``."""

from typing import TYPE_CHECKING, Any

import click

from .. import options
from ..console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

if TYPE_CHECKING:
    from ...influence import Solution
    from ...rotors.runs import Runs

ILL_CONDITIONED = 30.0
"""Condition number of the coefficients above which planes act so much alike that it is a finding."""
_READING = {
    "length": ("um", "um", 1e6),
    "velocity": ("mm/s", "mm_per_s", 1e3),
    "acceleration": ("m/s2", "m_per_s2", 1.0),
    "mixed": ("SI", "SI", 1.0),
}
_WEIGHT = {"mass": ("g", "g", 1e3), "first moment": ("g mm", "gmm", 1e6)}


@click.command(
    epilog="""\b
Examples:
  balance rotor influence two-plane-maker
  balance rotor influence runs.toml --method min-max --json
\b
A sheet of trial runs (TOML); several speeds are several tables of readings:
  phase = "lag"                       # what the instrument counts: lead or lag
  angles = "with rotation"            # how weight angles count: with rotation or against rotation
  amplitude = "peak_to_peak"          # metric of the readings (optional)
  [[planes]]
  name = "fan end"
  limit = "30 g"                      # optional, largest weight
  [[runs]]                            # first: as found, no weights
  name = "as found"
  readings."3000 rpm" = { A = "170 um @ 112 deg", B = "53 um @ 78 deg" }
  [[runs]]
  name = "trial, fan end"
  weights = { "fan end" = "10 g @ 0 deg" }
  stayed_on = false                   # required: did this trial weight stay on after the run?
  readings."3000 rpm" = { A = "235 um @ 94 deg", B = "58 um @ 68 deg" }
\b
Optional: least_effect = 0.25; speed_weights = { "3000 rpm" = 2.0 }; [[sensors]] with name and weight or scale.
In place of runs: per = "g", initial and coefficients, by speed and sensor, a list over the planes."""
)
@click.argument("runs", metavar="RUNS")
@click.option(
    "--method",
    type=click.Choice(["least-squares", "robust", "min-max"]),
    default="least-squares",
    show_default=True,
    help="Make small the sum of squares, the sum, or the largest of the readings.",
)
@options.figure_option
@json_option
@click.pass_context
def influence(ctx: click.Context, runs: str, method: str, figure: str | None, as_json: bool) -> None:
    """Correction weights from trial runs in RUNS, a sheet (TOML) or a shipped one.

    A trial weight that changed no reading enough is refused by name. Whether each trial weight stayed on must be
    recorded; the weights are given in all, and as what is to be added to those still on.
    """
    from ...rotors.runsheet import load

    sheet = load(runs)
    solution = sheet.solve(method)
    findings = _findings(sheet, solution)
    if figure:
        from ...figures.drawing import save
        from ...figures.vectors import draw_readings

        (reading, _, r), (weight, _, w) = _READING[sheet.reading], _WEIGHT[sheet.weight]
        save(draw_readings(sheet, solution, (reading, r), (weight, w)), figure)
    if as_json:
        emit_json(_document(sheet, solution, findings))
    else:
        _print(sheet, solution, findings)
    if findings:
        ctx.exit(EXIT_WITH_FINDINGS)


def _findings(sheet: "Runs", solution: "Solution") -> list[str]:
    found = []
    condition = solution.coefficients.condition
    if condition > ILL_CONDITIONED:
        found.append(
            f"condition number {condition:.3g}: the planes act so much alike that small errors of reading give large "
            "weights; use fewer planes or more sensors"
        )
    if sheet.reading == "mixed":
        found.append("sensors read different quantities: each was divided by its scale")
    return found


def _document(sheet: "Runs", solution: "Solution", findings: list[str]) -> dict[str, Any]:
    from ...rotors.polar import document

    _, reading, r = _READING[sheet.reading]
    _, weight, w = _WEIGHT[sheet.weight]
    coefficients, effects = solution.coefficients, sheet.effects()
    turned = sheet.in_sheet_sense
    phased = sheet.as_sheet_phase
    rows = []
    for i, (sensor, speed) in enumerate(sheet.rows):
        row: dict[str, Any] = {"sensor": sensor, "speed": speed, "factor": float(solution.factors[i])}
        row["before"] = document(complex(phased(coefficients.initial)[i]), reading, r)
        row["after"] = document(complex(phased(solution.residual)[i]), reading, r)
        row["coefficients_lead_with_rotation"] = {
            plane.name: document(complex(coefficients.matrix[i, j]), f"{reading}_per_{weight}", r / w)
            for j, plane in enumerate(sheet.planes)
        }
        rows.append(row)
    planes = []
    for j, plane in enumerate(sheet.planes):
        printed = sheet.published.get(plane.name)
        planes.append(
            {
                "plane": plane.name,
                "total": document(complex(turned(solution.weights)[j]), weight, w),
                "on_now": document(complex(turned(sheet.on_now)[j]), weight, w),
                "add": document(complex(turned(solution.weights - sheet.on_now)[j]), weight, w),
                "published": None if printed is None else document(printed, weight, w),
            }
        )
    return {
        "name": sheet.name,
        "source": sheet.source or None,
        "note": sheet.note or None,
        "phase": sheet.phase,
        "angles": sheet.angles,
        "amplitude": sheet.amplitude,
        "method": solution.method,
        "trial_weights": {
            run.name: {"stayed_on": run.stayed_on, "largest_effect": _finite(effects[run.name])}
            for run in sheet.runs
            if run.stayed_on is not None
        },
        "planes": planes,
        "readings": rows,
        f"rms_before_{reading}": _rms(coefficients.initial) * r,
        f"rms_after_{reading}": _rms(solution.residual) * r,
        "cost_SI": solution.cost,
        "cost_lower_bound_SI": solution.bound,
        "condition": coefficients.condition,
        f"misfit_of_runs_{reading}": coefficients.misfit * r,
        "findings": findings,
    }


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None


def _rms(readings: Any) -> float:  # noqa: ANN401
    import numpy as np

    return float(np.sqrt(np.mean(np.abs(readings) ** 2)))


def _print(sheet: "Runs", solution: "Solution", findings: list[str]) -> None:
    from ...rotors.polar import polar

    reading, _, r = _READING[sheet.reading]
    weight, _, w = _WEIGHT[sheet.weight]
    turned, phased = sheet.in_sheet_sense, sheet.as_sheet_phase
    total, on, add = (turned(x) for x in (solution.weights, sheet.on_now, solution.weights - sheet.on_now))
    rows = [
        [
            plane.name,
            polar(complex(total[j]), w),
            polar(complex(on[j]), w),
            polar(complex(add[j]), w),
            polar(sheet.published[plane.name], w) if plane.name in sheet.published else "-",
        ]
        for j, plane in enumerate(sheet.planes)
    ]
    header = ["plane", f"all weights [{weight}]", "still on", "to add now", "published"]
    emit_table(f"Correction weights, {sheet.name}, {solution.method}", header, rows, sheet.source)
    before, after = phased(solution.coefficients.initial), phased(solution.residual)
    rows = [
        [sensor, speed, polar(complex(before[i]), r), polar(complex(after[i]), r)]
        for i, (sensor, speed) in enumerate(sheet.rows)
    ]
    emit_table("Readings", ["sensor", "speed", f"before [{reading}]", f"predicted after [{reading}]"], rows)
    for run, effect in sheet.effects().items():
        stayed = next(other.stayed_on for other in sheet.runs if other.name == run)
        click.echo(
            f"Trial weight of run {run!r}: largest effect {100 * effect:.3g} % of the reading before; "
            f"it {'stayed on' if stayed else 'was taken off'}."
        )
    click.echo(
        f"RMS {_rms(before) * r:.4g} -> {_rms(after) * r:.4g} {reading}; condition number "
        f"{solution.coefficients.condition:.3g}; phase counts as {sheet.phase}, weight angles {sheet.angles}, "
        f"amplitude {sheet.amplitude}."
    )
    if sheet.note:
        click.echo(f"Note: {sheet.note}")
    for finding in findings:
        click.echo(f"Finding: {finding}")
