"""``testbench compare``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.console import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.cli.options import figure_option

from . import calibrations, measuring

if TYPE_CHECKING:
    from ..comparison import Comparison, Row
    from ..published import Published
    from ..signals import Band


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
@measuring.measure_options
@figure_option
@json_option
def compare(
    campaign: Path,
    table: str,
    mechanism: str | None,
    metric: str,
    band: "Band | None",
    figure: str | None,
    as_json: bool,
) -> int:
    """Reductions in three ways: analysed from the logs, simulated anew, and published.

    The simulation starts from the rig and the conditions that are stored with the runs, without noise.
    """
    from ..comparison import compare as compared
    from ..published import load
    from ..store import open_campaign

    published = load(table)
    measure = measuring.measure(metric, band)
    runs = open_campaign(campaign).runs
    comparison = compared(runs, published, measure, mechanism)
    if figure:
        measuring.draw(comparison, figure)
    if as_json:
        emit_json({**_document(comparison, published, str(measure)), "calibrations": calibrations.document(runs)})
    else:
        _print(campaign, comparison, published, str(measure))
        calibrations.say(runs)
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


def _print(campaign: Path, comparison: "Comparison", published: "Published", definition: str) -> None:
    header = ["payload kg", "motion", "peak g0", "sensor", "axis", "analysed % [95 %]", "simulated %", "published %",
              "simulated shaking force %", "origin"]  # fmt: skip
    title = f"Reduction of the base's vibration, {campaign.name}, beside {published.name}"
    cells = [_cells(row) for row in comparison.rows]
    header, cells = measuring.with_sets(header, cells, [row.analyzed for row in comparison.rows])
    emit_table(title, header, cells, definition)
    printed = f"Published values as printed; amplitudes, says the source: {published.definition}."
    for note in (measuring.origins(comparison.origins), printed, *comparison.notes):
        click.echo(click.wrap_text(note, 110))
    measuring.print_findings(comparison.findings)


def _cells(row: "Row") -> list[str]:
    key = row.analyzed.key
    values = (row.simulated, row.published, row.shaking_force)
    place = [f"{key.payload_kg:g}", key.motion, f"{key.peak_acceleration_g:g}", row.analyzed.sensor, row.analyzed.axis]
    return [*place, measuring.fell(row.analyzed), *map(measuring.per_cent, values), key.origin]
