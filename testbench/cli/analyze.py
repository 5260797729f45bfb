"""``testbench analyze``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.cli.options import figure_option

from . import calibrations, measuring

if TYPE_CHECKING:
    from ..reductions import Analysis
    from ..signals import Band


@click.command(
    epilog="""\b
Examples:
  testbench analyze campaign --figure reductions.png
  testbench analyze campaign --metric rms --band 1..100 --json
\b
Exit codes: 0 done, 3 done with findings (no partner, doubtful channels, lower bounds), 1 nothing to compare."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@measuring.measure_options
@figure_option
@json_option
def analyze(campaign: Path, metric: str, band: "Band | None", figure: str | None, as_json: bool) -> int:
    """How much the vibration amplitude of the base fell, runs with counter-masses against runs without.

    Runs of one payload, motion, acceleration and origin are compared. Noise, as the rest before the motion shows it,
    is taken off. Intervals (95 %) come from the scatter of the campaign's repeats, pooled over its conditions, else
    from that noise, propagated. Where what is left is not above the noise, the reduction is a lower bound:
    ">= 97.2 < noise".
    """
    from ..reductions import analyze as analyzed
    from ..store import open_campaign

    measure = measuring.measure(metric, band)
    runs = open_campaign(campaign).runs
    analysis = analyzed(runs, measure)
    if figure:
        measuring.draw(analysis, figure)
    if as_json:
        emit_json({
            "reductions": [reduction.as_dict() for reduction in analysis.reductions],
            "definition": str(measure),
            "notes": analysis.notes,
            "findings": [finding.as_dict() for finding in analysis.findings],
            "calibrations": calibrations.document(runs),
        })  # fmt: skip
    else:
        _print(campaign, analysis, str(measure))
        calibrations.say(runs)
    return EXIT_WITH_FINDINGS if analysis.findings else 0


def _print(campaign: Path, analysis: "Analysis", definition: str) -> None:
    rows = [
        [*map(str, (f"{r.key.payload_kg:g}", r.key.motion, f"{r.key.peak_acceleration_g:g}", r.sensor, r.axis)),
         measuring.fell(r), _pair(r.amplitudes), _pair(r.noise_floor), "/".join(map(str, r.n)), r.method or "-",
         r.key.origin, " ".join(r.runs)]
        for r in analysis.reductions
    ]  # fmt: skip
    header = ["payload kg", "motion", "peak g0", "sensor", "axis", "fell by % [95 %]", "with/without m/s2",
              "noise m/s2", "n", "interval from", "origin", "runs"]  # fmt: skip
    header, rows = measuring.with_sets(header, rows, analysis.reductions)
    emit_table(f"Reduction of the base's vibration, {campaign.name}", header, rows, definition)
    for note in (measuring.origins(analysis.origins), *analysis.notes):
        click.echo(note)
    measuring.print_findings(analysis.findings)


def _pair(values: tuple[float | None, float | None]) -> str:
    """With and without counter-masses."""
    return "/".join("-" if value is None else f"{value:.2g}" for value in values)
