"""``testbench analyze`` and ``testbench compare``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.cli.options import figure_option

from . import options

if TYPE_CHECKING:
    from ..published_tables import Published
    from ..signal.filters import Band
    from ..vibration.comparison import Comparison, Row
    from ..vibration.metrics import Metric
    from ..vibration.reduction import Analysis


@click.command(
    epilog="""\b
Examples:
  testbench analyze campaign --figure reductions.png
  testbench analyze campaign --metric rms --band 1..100 --json
\b
Exit codes: 0 done, 3 done with findings (no partner, doubtful channels, lower bounds), 1 nothing to compare."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@options.measure_options
@figure_option
@json_option
def analyze(campaign: Path, metric: "Metric", band: "Band | None", figure: str | None, as_json: bool) -> int:
    """By how much counter-masses reduce the vibration amplitude of the base: runs with them against runs without.

    Runs of one payload, motion, acceleration and origin are compared. The noise of the rest before the motion is
    subtracted. Intervals (95 %) come from the scatter of the campaign's repeats, pooled over its conditions, else from
    that noise, propagated. Where the residual vibration is not above the noise, the reduction is a lower bound:
    ">= 97.2 < noise".
    """
    from ..store import open_campaign
    from ..vibration.metrics import Measure
    from ..vibration.reduction import analyze as analyzed

    measure = Measure(metric, band)
    runs = open_campaign(campaign).runs
    analysis = analyzed(runs, measure)
    if figure:
        options.draw_figures(analysis, figure)
    if as_json:
        emit_json({
            "reductions": [reduction.as_dict() for reduction in analysis.reductions],
            "definition": str(measure),
            "notes": analysis.notes,
            "findings": [finding.as_dict() for finding in analysis.findings],
            "calibrations": options.calibrations_document(runs),
        })  # fmt: skip
    else:
        _print_reductions(campaign, analysis, str(measure))
        options.print_calibrations(runs)
    return EXIT_WITH_FINDINGS if analysis.findings else 0


def _print_reductions(campaign: Path, analysis: "Analysis", definition: str) -> None:
    rows = [
        [*map(str, (f"{r.key.payload_kg:g}", r.key.motion, f"{r.key.peak_acceleration_g:g}", r.sensor, r.axis)),
         options.reduction_text(r), _pair(r.amplitudes), _pair(r.noise_floor), "/".join(map(str, r.n)), r.method or "-",
         r.key.origin, " ".join(r.runs)]
        for r in analysis.reductions
    ]  # fmt: skip
    header = ["payload kg", "motion", "peak g0", "sensor", "axis", "reduction % [95 %]", "with/without m/s2",
              "noise m/s2", "n", "interval from", "origin", "runs"]  # fmt: skip
    header, rows = options.with_counter_masses(header, rows, analysis.reductions)
    emit_table(f"Reduction of the base's vibration, {campaign.name}", header, rows, definition)
    for note in (options.origins_text(analysis.origins), *analysis.notes):
        click.echo(note)
    options.print_findings(analysis.findings)


def _pair(values: tuple[float | None, float | None]) -> str:
    """With and without counter-masses."""
    return "/".join("-" if value is None else f"{value:.2g}" for value in values)


@click.command(
    epilog="""\b
Examples:
  testbench compare campaign --published kiper2019 --figure reductions.png
  testbench compare campaign --published kiper2019 --metric peak --json
\b
Exit codes: 0 done, 3 done with findings (runs without a partner, what cannot be simulated), 1 nothing to compare."""
)
@click.argument("campaign", type=click.Path(path_type=Path))
@click.option("--published", "table", required=True, metavar="NAME", help="A shipped table, kiper2019, or a file.")
@click.option("--mechanism", metavar="MECH", help="The mechanism, where the stored rig names one that is not shipped.")
@options.measure_options
@figure_option
@json_option
def compare(
    campaign: Path,
    table: str,
    mechanism: str | None,
    metric: "Metric",
    band: "Band | None",
    figure: str | None,
    as_json: bool,
) -> int:
    """Reductions by three sources: analysed from the logs, simulated anew, and published.

    The simulation starts from the rig and the conditions that are stored with the runs, without noise.
    """
    from ..published_tables import load_published
    from ..store import open_campaign
    from ..vibration.comparison import compare_campaign
    from ..vibration.metrics import Measure

    published = load_published(table)
    measure = Measure(metric, band)
    runs = open_campaign(campaign).runs
    comparison = compare_campaign(runs, published, measure, mechanism)
    if figure:
        options.draw_figures(comparison, figure)
    if as_json:
        emit_json(
            {**_document(comparison, published, str(measure)), "calibrations": options.calibrations_document(runs)}
        )
    else:
        _print_comparison(campaign, comparison, published, str(measure))
        options.print_calibrations(runs)
    return EXIT_WITH_FINDINGS if comparison.findings else 0


def _document(comparison: "Comparison", published: "Published", definition: str) -> dict[str, Any]:
    return {
        "rows": [row.as_dict() for row in comparison.rows],
        "definition": definition,
        "runs_by_origin": comparison.origins,
        "published": {"name": published.name, "source": published.source, "definition": published.definition},
        "notes": comparison.notes,
        "findings": [finding.as_dict() for finding in comparison.findings],
    }


def _print_comparison(campaign: Path, comparison: "Comparison", published: "Published", definition: str) -> None:
    header = ["payload kg", "motion", "peak g0", "sensor", "axis", "analysed % [95 %]", "simulated %", "published %",
              "simulated shaking force %", "origin"]  # fmt: skip
    title = f"Reduction of the base's vibration, {campaign.name}, and of {published.name}"
    cells = [_cells(row) for row in comparison.rows]
    header, cells = options.with_counter_masses(header, cells, [row.analyzed for row in comparison.rows])
    emit_table(title, header, cells, definition)
    printed = f"Published values as printed; amplitudes, according to the source: {published.definition}."
    for note in (options.origins_text(comparison.origins), printed, *comparison.notes):
        click.echo(click.wrap_text(note, 110))
    options.print_findings(comparison.findings)


def _cells(row: "Row") -> list[str]:
    key = row.analyzed.key
    values = (row.simulated, row.published, row.shaking_force)
    place = [f"{key.payload_kg:g}", key.motion, f"{key.peak_acceleration_g:g}", row.analyzed.sensor, row.analyzed.axis]
    return [*place, options.reduction_text(row.analyzed), *map(options.per_cent, values), key.origin]
