"""``balance rotor influence``: correction weights from trial runs."""

from typing import TYPE_CHECKING, Any

import click

from . import options
from .framework import emit_result, emit_table, json_option

if TYPE_CHECKING:
    from ..rotors.trial_runs import TrialRuns


@click.command(
    short_help="Correction weights from trial runs: influence coefficients, any planes, sensors and speeds.",
    epilog="""\b
Examples:
  balance rotor influence two-plane-maker
  balance rotor influence runs.toml --method min-max --json
\b
A file of trial runs (TOML); several speeds are several tables of readings:
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
A common-mode error of all phases of a run, such as a late pulse: phases_alike."3000 rpm" = "0.9 deg" in [[runs]].
Optional: least_effect = 0.25; speed_weights = { "3000 rpm" = 2.0 }; [[sensors]] with name and weight or scale.
In place of runs: per = "g", initial and coefficients, by speed and sensor, a list over the planes.""",
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
def influence(runs: str, method: str, figure: str | None, as_json: bool) -> None:
    """Correction weights from trial runs in RUNS, a file (TOML) or a shipped one.

    A trial weight that changed no reading enough is refused by name. Whether each trial weight stayed on must be
    recorded; the weights are shown as totals, and as the weights to add to those still on.
    """
    from ..rotors.results import READING, WEIGHT, trial_runs_document
    from ..rotors.trial_run_files import load_trial_runs

    trial_runs = load_trial_runs(runs)
    solution = trial_runs.solve(method)
    document = trial_runs_document(trial_runs, solution)
    if figure:
        from ..figures.mechanism import save
        from ..figures.rotating import draw_readings

        (reading, _, r), (weight, _, w) = READING[trial_runs.reading], WEIGHT[trial_runs.weight]
        uncertainty = trial_runs.uncertainty(solution)
        save(draw_readings(trial_runs, solution, (reading, r), (weight, w), uncertainty), figure)
    emit_result(document, as_json, lambda: _print(trial_runs, document))


def _print(runs: "TrialRuns", document: dict[str, Any]) -> None:
    from ..rotors.results import READING, WEIGHT

    (reading, r, _), (weight, w, _) = READING[runs.reading], WEIGHT[runs.weight]
    intervals = document["intervals"]
    rows = [[p["plane"], *(vector_text(p[key], w) for key in ("total", "on_now", "add", "published"))]
            for p in document["planes"]]  # fmt: skip
    header = ["plane", f"all weights [{weight}]", "still on", "to add now", "published"]
    note = (
        document["source"] or "" if intervals is None else f"Intervals of {intervals['level']}, {_origin(intervals)}."
    )
    emit_table(f"Correction weights, {document['name']}, {document['method']}", header, rows, note)
    rows = [
        [row["sensor"], row["speed"], vector_text(row["before"], r), vector_text(row["after"], r)]
        + ([] if intervals is None else [f"{row[f'after_within_{r}']:.3g}"])
        for row in document["readings"]
    ]
    header = ["sensor", "speed", f"before [{reading}]", f"predicted after [{reading}]"]
    emit_table("Readings", header + ([] if intervals is None else [f"± [{reading}], {intervals['level']}"]), rows)
    if intervals is None:
        click.echo("No intervals: state those of the readings (170 um ± 2 um @ 112 deg ± 1 deg), or repeat a run.")
    for run, trial in document["trial_weights"].items():
        effect = trial["largest_effect"]
        change = "a reading that was zero" if effect is None else f"{100 * effect:.3g} % of the reading before"
        stayed = "stayed on" if trial["stayed_on"] else "was taken off"
        click.echo(f"Trial weight of run {run!r}: largest effect {change}; it {stayed}.")
    click.echo(
        f"RMS {document[f'rms_before_{r}']:.4g} -> {document[f'rms_after_{r}']:.4g} {reading}; condition number "
        f"{document['condition']:.3g}; phase counts as {runs.phase}, weight angles {runs.angles}, "
        f"amplitude {runs.amplitude}."
    )
    if intervals is not None and document["source"]:
        click.echo(f"Source: {document['source']}")
    if document["note"]:
        click.echo(f"Note: {document['note']}")


def _origin(intervals: dict[str, Any]) -> str:
    """Where intervals come from, for people."""
    how = "from the stated intervals of readings"
    if intervals["from"] == "repeats":
        how = f"from the residual of the runs ({intervals['degrees_of_freedom_a_row']:.0f} degrees of freedom a row)"
    return how if intervals["draws"] is None else f"{how}, {intervals['draws']} solutions drawn"


def vector_text(value: dict[str, float] | None, unit: str) -> str:
    """A vector of a document for people, with its intervals where it has any; a dash for none."""
    if value is None:
        return "-"
    size, angle = value[f"magnitude_{unit}"], round(value["angle_deg"], 3) % 360.0
    within = value.get(f"magnitude_{unit}_within")
    if within is None:
        return f"{size:.6g} @ {angle:.3f} deg" if size >= 1e-9 else "0"
    about = value["angle_deg_within"]
    turned = "any angle" if about >= 180.0 else f"{angle:.2f} ± {about:.2g} deg"
    return f"{size:.5g} ± {within:.2g} @ {turned}"
