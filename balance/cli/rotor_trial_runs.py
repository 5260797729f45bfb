"""``balance rotor influence``."""

from typing import TYPE_CHECKING, Any

import click

from . import options
from .framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

if TYPE_CHECKING:
    from ..rotors.influence_coefficients import Solution
    from ..rotors.trial_runs import TrialRuns


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
Intervals (95 %) of the weights come from those of the readings, "170 um ± 2 um @ 112 deg ± 1 deg" (or "+- 1 %";
without the angle's in every direction), or from within = "2 um" in [[sensors]], or else from repeated runs.
An error that all phases of a run share, such as a late pulse: phases_alike."3000 rpm" = "0.9 deg" in [[runs]].
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
    from ..rotors.results import of_solution
    from ..rotors.trial_run_files import load_trial_runs

    sheet = load_trial_runs(runs)
    solution = sheet.solve(method)
    found = of_solution(sheet, solution)
    if figure:
        _draw(sheet, solution, figure)
    if as_json:
        emit_json(found)
    else:
        _print(sheet, found)
    if found["findings"]:
        ctx.exit(EXIT_WITH_FINDINGS)


def _draw(sheet: "TrialRuns", solution: "Solution", path: str) -> None:
    from ..figures.mechanism import save
    from ..figures.rotating import draw_readings
    from ..rotors.results import READING, WEIGHT

    (reading, _, r), (weight, _, w) = READING[sheet.reading], WEIGHT[sheet.weight]
    save(draw_readings(sheet, solution, (reading, r), (weight, w), sheet.uncertainty(solution)), path)


def _print(sheet: "TrialRuns", found: dict[str, Any]) -> None:
    from ..rotors.results import READING, WEIGHT

    (reading, r, _), (weight, w, _) = READING[sheet.reading], WEIGHT[sheet.weight]
    sure = found["intervals"]
    rows = [[p["plane"], *(_vector(p[key], w) for key in ("total", "on_now", "add", "published"))]
            for p in found["planes"]]  # fmt: skip
    header = ["plane", f"all weights [{weight}]", "still on", "to add now", "published"]
    note = "" if sure is None else f"Intervals of 95 %, {_origin(sure)}."
    emit_table(f"Correction weights, {found['name']}, {found['method']}", header, rows, note or found["source"] or "")
    rows = [
        [row["sensor"], row["speed"], _vector(row["before"], r), _vector(row["after"], r)]
        + ([] if sure is None else [f"{row[f'after_within_{r}']:.3g}"])
        for row in found["readings"]
    ]
    header = ["sensor", "speed", f"before [{reading}]", f"predicted after [{reading}]"]
    emit_table("Readings", header + ([] if sure is None else [f"± [{reading}], 95 %"]), rows)
    if sure is None:
        click.echo("No intervals: state those of the readings (170 um ± 2 um @ 112 deg ± 1 deg), or repeat a run.")
    _print_trials(found)
    click.echo(
        f"RMS {found[f'rms_before_{r}']:.4g} -> {found[f'rms_after_{r}']:.4g} {reading}; condition number "
        f"{found['condition']:.3g}; phase counts as {sheet.phase}, weight angles {sheet.angles}, "
        f"amplitude {sheet.amplitude}."
    )
    if sure is not None and found["source"]:
        click.echo(f"Source: {found['source']}")
    if found["note"]:
        click.echo(f"Note: {found['note']}")
    for finding in found["findings"]:
        click.echo(f"Finding: {finding}")


def _origin(sure: dict[str, Any]) -> str:
    """Where intervals come from, for people."""
    how = "from the stated intervals of readings"
    if sure["from"] == "repeats":
        how = f"from what the runs leave over ({sure['degrees_of_freedom_a_row']:.0f} degrees of freedom a row)"
    return how if sure["draws"] is None else f"{how}, {sure['draws']} solutions drawn"


def _vector(value: dict[str, float] | None, unit: str) -> str:
    """A vector of the document for people, with its intervals where it has any."""
    if value is None:
        return "-"
    size, angle = value[f"magnitude_{unit}"], round(value["angle_deg"], 3) % 360.0
    within = value.get(f"magnitude_{unit}_within")
    if within is None:
        return f"{size:.6g} @ {angle:.3f} deg" if size > 1e-9 else "0"
    about = value["angle_deg_within"]
    turned = "any angle" if about >= 180.0 else f"{angle:.2f} ± {about:.2g} deg"
    return f"{size:.5g} ± {within:.2g} @ {turned}"


def _print_trials(found: dict[str, Any]) -> None:
    for run, trial in found["trial_weights"].items():
        effect = trial["largest_effect"]
        said = "a reading that was zero" if effect is None else f"{100 * effect:.3g} % of the reading before"
        click.echo(
            f"Trial weight of run {run!r}: largest effect {said}; it "
            f"{'stayed on' if trial['stayed_on'] else 'was taken off'}."
        )
