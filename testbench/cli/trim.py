"""``testbench trim``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option

from . import options

if TYPE_CHECKING:
    from balance.estimation.first_moment_imbalance import MissingMass

    from ..runs.si_run import SIRun
    from ..synchronization.clock_map import ClockMap
    from ..trim import Source, Trim


@click.command(
    epilog="""\b
Examples:
  testbench trim parallelogram-6bar campaign/r021.h5 campaign/r035.h5
  testbench trim parallelogram-6bar campaign/r0*.h5 --stock shelf.csv --json
  testbench trim two-joint-arm-a0 campaign/swing.h5 --from torque --site counter_link_1
  testbench trim parallelogram-6bar built/*.h5 plus-1kg-A0A/*.h5 plus-1kg-B0B/*.h5 --from trials
\b
Exit codes: 0 done, 3 done with findings (gaps left out) or doubts, which are listed, 1 refused: the runs cannot
tell."""
)
@click.argument("mechanism", metavar="MECH")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
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
@json_option
def trim(
    mechanism: str,
    runs: tuple[Path, ...],
    site: tuple[str, ...],
    stock: str | None,
    sources: "tuple[Source, ...]",
    cutoff: float | None,
    rig: str | None,
    figure: Path | None,
    as_json: bool,
) -> int:
    """What first moment is missing on which arm of MECH, and which mass to add there, from measured runs.

    RUN: stored runs; payload and counter-masses are those of their conditions. Of one mounting: by force sensors, the
    base's motion taken out by its accelerometers, and by motor torques, weighted where both tell, with whether they
    agree; or by the base's vibration, through the mass and mounts that the rig states. Of mountings that differ by
    trial masses: by the base's vibration without any model of the base; what is missing is said of the first run's
    mounting. Intervals are of 95 %, or said not to be. Runs that cannot tell are refused.
    """
    from balance.balancing import stock_plates as stocks
    from balance.mechanism.mjcf_parser import load_mechanism

    from .. import rig as rigs
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun
    from ..trim import trim_runs
    from ..trim.result import trim_document

    if cutoff is not None and not cutoff > 0.0:
        raise click.UsageError(f"--cutoff {cutoff:g}: expected a positive frequency")
    opened = options.opened_runs(runs)
    described = rigs.load_rig(rig) if rig else None
    bound = [SIRun.of(run, described) for run in opened]
    plates = stocks.load_stock(stock) if stock else []
    model = load_mechanism(mechanism)
    runs_of_it = [AlignedRun(run, model, _recorded(run)) for run in bound]
    result = trim_runs(runs_of_it, site, plates, sources or None, cutoff)
    if figure:
        from balance.figures.mechanism import save

        from ..trim.figure import draw

        save(draw(result), figure)
    if as_json:
        emit_json({**trim_document(result), "calibrations": options.calibrations(bound)})
    else:
        _print(result, stock)
        options.print_calibrations(options.calibrations(bound))
    return EXIT_WITH_FINDINGS if result.findings or result.doubts() else 0


def _recorded(run: "SIRun") -> "dict[str, ClockMap]":
    """Alignments that the campaign holds; what it does not hold is found anew."""
    from ..errors import AnalysisError
    from ..runs.aligned_run import recorded_clocks

    try:
        return recorded_clocks(run)
    except AnalysisError:
        return {}


def _level(result: "Trim") -> str:
    return "95 % interval" if result.interval_level else "interval, not of 95 %"


def _print(result: "Trim", stock: str | None) -> None:
    header = ["site", "missing [kg m]", _level(result), "that is [kg]", "site at x [mm]"]
    title = f"Missing on {result.mechanism.name}, {result.origin}, {_few(result.runs)}, by {result.source}"
    emit_table(title, header, [_row(m) for m in result.missing])
    if result.consensus is not None:
        _print_sources(result)
    _print_addition(result, stock)
    click.echo("\n".join(result.about))
    click.echo(f"{result.unexplained:.1%} of what was measured stays unexplained. Verdict: {_verdict(result, stock)}")
    for doubt in result.doubts():
        click.echo(f"  {doubt}")
    for gap in result.gaps:
        click.echo(f"Finding: {gap}.")
    if result.origin == "simulated":
        click.echo("The runs are simulated.")


def _row(m: "MissingMass") -> list[str]:
    low, high = m.interval
    return [
        m.site,
        f"{m.first_moment.value:.4f}",
        f"{low:.4f} .. {high:.4f}",
        f"{m.mass.value:.3f}",
        f"{m.position[0] * 1e3:.2f}",
    ]


def _print_sources(result: "Trim") -> None:
    rows = [[share.source, *_row(m)[:3]] for share in result.shares for m in share.missing]
    emit_table("By source", ["source", "site", "missing [kg m]", _level(result)], rows)
    if (found := result.consensus) is not None:
        says = "agree" if found.agrees else "contradict each other"
        click.echo(
            f"The sources {says}: chi-square {found.chi_square:.2f} with {found.degrees_of_freedom} degrees of "
            f"freedom, probability {found.probability:.2g}."
        )


def _print_addition(result: "Trim", stock: str | None) -> None:
    added = [c for c in result.addition.counter_masses if c.mass > 0.0]
    for c in added:
        plates = f" = {' + '.join(c.plates)}" if c.plates else ""
        click.echo(f"Add {c.mass:.3f} kg at {c.site}{plates}.")
    if not added:
        _print_nothing(result, stock)
    for m in result.removal:
        click.echo(f"{m.site} has {-m.mass.value:.3f} kg too much: remove it.")
    low, high = result.predicted_residual_interval
    click.echo(
        f"First-moment residual predicted{' with that' if added else ''}: {result.predicted_residual:.4f} kg m, "
        f"{low:.4f} .. {high:.4f}."
    )


def _print_nothing(result: "Trim", stock: str | None) -> None:
    """Why nothing is to be added: plates that do not help, or nothing that is told to be missing."""
    lacking = [
        f"{m.mass.value:.3f} kg at {m.site}" for m in result.missing if m.is_significant and m.first_moment.value > 0.0
    ]
    if lacking:
        click.echo(f"No plates of {stock} bring it nearer: what is missing stays: {', '.join(lacking)}.")
    elif not result.removal:
        click.echo("Add nothing: every interval holds zero.")


def _verdict(result: "Trim", stock: str | None) -> str:
    """The verdict, and that it cannot be followed where the plates do not help."""
    helped = any(c.mass > 0.0 for c in result.addition.counter_masses)
    return result.verdict if helped or result.verdict != "add" else f"add, but not from {stock}"


def _few(names: tuple[str, ...]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
