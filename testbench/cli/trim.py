"""``testbench trim``."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.results import table

from . import options

if TYPE_CHECKING:
    from ..trimming import Source, Trim

COLUMNS = ("site", "first_moment", "interval", "mass", "position")


@click.command(
    epilog="""\b
Examples:
  testbench trim campaign/r021.h5 campaign/r035.h5
  testbench trim parallelogram-6bar campaign/r0*.h5 --stock shelf.csv --json
  testbench trim parallelogram-6bar campaign/r0*.h5 --budget
  testbench trim two-joint-arm-a0 campaign/swing.h5 --from torque --site counter_link_1
  testbench trim parallelogram-6bar built/*.h5 plus-1kg-A0A/*.h5 plus-1kg-B0B/*.h5 --from trials
\b
Exit codes: 0 done, 3 done with findings (gaps left out) or doubts, which are listed, 1 refused: the runs cannot
tell."""
)
@options.mechanism_and_runs
@click.option("--site", multiple=True, help="Where masses may be added; the sites named counter... unless given.")
@click.option("--stock", metavar="CSV", help="Add from these plates: columns name,mass_kg,quantity.")
@click.option(
    "--from",
    "--by",
    "sources",
    multiple=True,
    type=click.Choice(["wrench", "torque", "vibration", "trials"]),
    help="By force sensors, motor torques, the base's vibration with the base that the rig states, or runs with trial "
    "masses; give it again for several.  [default: what the rig has]",
)
@click.option(
    "--cutoff",
    type=float,
    metavar="HZ",
    help="Highest frequency of what was measured and model alike.  [default: as is best for the source]",
)
@click.option("--rig", help="A rig in place of the one stored with the runs.")
@click.option(
    "--figure",
    type=click.Path(path_type=Path),
    help="Draw what is missing and what the plates leave (.png, .svg, .pdf).",
)
@options.accept_option
@options.budget_option
@json_option
def trim(
    words: tuple[str, ...],
    site: tuple[str, ...],
    stock: str | None,
    sources: "tuple[Source, ...]",
    cutoff: float | None,
    rig: str | None,
    figure: Path | None,
    accept: tuple[str, ...],
    budget: bool,
    as_json: bool,
) -> int:
    """What first moment is missing on which arm of MECH, and which mass to add there, from measured runs.

    MECH: that stored with the first run, or shipped under the name in its rig, unless given. RUN: stored runs; payload
    and counter-masses are those of their conditions. Of one mounting: by force sensors, the
    base's motion taken out by its accelerometers, and by motor torques, weighted where both tell, with whether they
    agree; or by the base's vibration, through the mass and mounts that the rig states. Of mountings that differ by
    trial masses: by the base's vibration without any model of the base; what is missing refers to the first run's
    mounting. Intervals are of 95 %, unless the result says otherwise. Runs that cannot tell are refused. A run whose
    sensors contradict the run table or the other runs (testbench doctor) makes the result doubtful, until its CODE is
    accepted.
    """
    from balance.balancing import stock_plates as stocks

    from .. import rig as rigs
    from ..cross_examination import examine
    from ..kinematics.encoder_motion import mechanism_of
    from ..runs.aligned_run import AlignedRun, recorded_clocks
    from ..runs.si_run import SIRun
    from ..trimming import trim_runs
    from ..trimming.result import trim_document

    options.refuse_unknown_codes(accept)
    if cutoff is not None and not cutoff > 0.0:
        raise click.UsageError(f"--cutoff {cutoff:g}: expected a positive frequency")
    mechanism, runs = options.split_words(words)
    opened = options.opened_runs(runs)
    described = rigs.load_rig(rig) if rig else None
    bound = [SIRun.of(run, described) for run in opened]
    plates = stocks.load_stock(stock) if stock else []
    model = mechanism_of(bound[0], mechanism)
    runs_of_it = [AlignedRun(run, model, recorded_clocks(run)) for run in bound]
    result = trim_runs(runs_of_it, site, plates, sources or None, cutoff)
    examination = examine(bound, accept, model)
    result = replace(result, findings=(*result.findings, *examination.open_findings))
    if figure:
        from balance.figures.mechanism import save

        from ..trimming.figure import draw

        save(draw(result), figure)
    accepted = [finding.as_dict() for finding in examination.findings if finding.code in accept]
    if as_json:
        shown = {**trim_document(result), "accepted": accepted, "calibrations": options.calibrations(bound)}
        emit_json(shown | ({"budget": result.budgets} if budget else {}))
    else:
        _print(result, stock)
        options.print_findings(f for f in examination.findings if f.code in accept)
        if budget:
            options.print_budgets(result.mechanism.name, result.budgets)
        options.print_calibrations(options.calibrations(bound))
    return EXIT_WITH_FINDINGS if examination.findings or result.findings or result.doubts() else 0


def _print(result: "Trim", stock: str | None) -> None:
    from balance.estimation.estimate import LEVEL_TEXT
    from balance.estimation.first_moment_imbalance import MissingMass

    level = f"{LEVEL_TEXT} interval" if result.interval_level else f"interval, not of {LEVEL_TEXT}"
    (site, missing, _, *others), rows = table(MissingMass, result.missing, *COLUMNS)
    runs = ", ".join(result.runs[:4]) + (f" and {len(result.runs) - 4} more" if len(result.runs) > 4 else "")
    title = f"Missing on {result.mechanism.name}, {result.origin}, {runs}, by {result.source}"
    emit_table(title, [site, missing, level, *others], rows)
    if (found := result.consensus) is not None:
        each = [[one.source, *row] for one in result.shares for row in table(MissingMass, one.missing, *COLUMNS[:3])[1]]
        emit_table("By source", ["source", site, missing, level], each)
        click.echo(
            f"The sources {'agree' if found.agrees else 'contradict each other'}: chi-square {found.chi_square:.2f} "
            f"with {found.degrees_of_freedom} degrees of freedom, probability {found.probability:.2g}."
        )
    _print_addition(result, stock)
    click.echo("\n".join(result.about))
    helped = any(c.mass > 0.0 for c in result.addition.counter_masses)
    followed = helped or result.verdict != "add"
    verdict = result.verdict if followed else f"add, but not from {stock}"
    click.echo(f"{result.unexplained:.1%} of what was measured stays unexplained. Verdict: {verdict}")
    for doubt in result.doubts():
        click.echo(f"  {doubt}")
    for gap in result.gaps:
        click.echo(f"Finding: {gap}.")
    if result.origin == "simulated":
        click.echo("The runs are simulated.")


def _print_addition(result: "Trim", stock: str | None) -> None:
    added = [c for c in result.addition.counter_masses if c.mass > 0.0]
    for c in added:
        plates = f" = {' + '.join(c.plates)}" if c.plates else ""
        click.echo(f"Add {c.mass:.3f} kg at {c.site}{plates}.")
    lacking = [m for m in result.missing if m.is_significant and m.first_moment.value > 0.0]
    if lacking and not added:
        masses = ", ".join(f"{m.mass.value:.3f} kg at {m.site}" for m in lacking)
        click.echo(f"No plates of {stock} bring it nearer: what is missing stays: {masses}.")
    elif not added and not result.removal:
        click.echo("Add nothing: every interval holds zero.")
    for m in result.removal:
        click.echo(f"{m.site} has {-m.mass.value:.3f} kg too much: remove it.")
    low, high = result.predicted_residual_interval
    click.echo(
        f"First-moment residual predicted{' with that' if added else ''}: {result.predicted_residual:.4f} kg m, "
        f"{low:.4f} .. {high:.4f}."
    )
