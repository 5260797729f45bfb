"""``testbench identify``, and its tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.errors import DataError

from . import options as calibrations
from . import options as stored_runs

if TYPE_CHECKING:
    from ..identification import Identification, Value
    from ..identification.result import Validation


def print_result(
    result: "Identification", validation: "Validation | None" = None, left_out: Sequence[str] = ()
) -> None:
    """The tables for people."""
    about = f"{result.mechanism.name} from {', '.join(result.runs)} (origin {result.origin})"
    header = ["", "value", "unit", "95 % interval", "in MECH's file"]
    emit_table(f"Identified: {about}", header, [_row(value) for value in result.base_values()])
    emit_table(
        "Friction, drives and offsets" if result.joints else "Offsets",
        header,
        [_row(value) for value in result.joint_values()],
    )
    moments = [value for value in result.first_moments() if value.in_file] or result.first_moments()
    rows = [[value.name, *(f"{other:.4f}" for other in value.variants.values())] for value in moments]
    emit_table("First moments by other choices [kg m]", ["", *result.variants], rows)
    emit_table("Methods on held-out blocks", *_methods(result))
    if result.mechanism.counter_sites and not result.undetermined_moments():
        rows = [
            [found.site, f"{found.position[0] * 1e3:.4g}", *_cells(found.mass, 3), *_cells(found.first_moment, 4)]
            for found in result.counter_masses()
        ]
        columns = ["site", "x [mm]", "mass [kg]", "95 % interval", "first moment [kg m]", "95 % interval"]
        emit_table("Counter-masses that would balance it, beyond what the first run mounted", columns, rows)
    click.echo("\n".join([*_notes(result), *left_out, *_verdict(result, validation)]))


def _methods(result: "Identification") -> tuple[list[str], list[list[str]]]:
    """Header and rows."""
    from ..identification.estimators import NAMES

    rows = [
        [
            f"{one.method}: {NAMES[one.method]}" + (" (used)" if one.method == result.method else ""),
            f"{one.torque_error:.1%}",
            "-" if one.angles is None else f"{one.angles.whole:.4f}",
            *_values(result, one.method),
        ]
        for one in result.comparison
    ]
    return ["", f"{_kind(result)} unexplained", "simulated angle off by, rms [rad]", "first moments [kg m]"], rows


def _kind(result: "Identification") -> str:
    """What was measured: torques, forces and moments, or both."""
    forces = len(result.rows) > len(result.joints)
    return " and ".join([*(["torque"] if result.joints else []), *(["force"] if forces else [])])


def _values(result: "Identification", method: str) -> list[str]:
    moments = [value for value in result.first_moments() if value.in_file] or result.first_moments()
    return [", ".join(f"{value.value if method == result.method else value.variants[method]:.4f}" for value in moments)]


def _notes(result: "Identification") -> list[str]:
    """What stands below the tables: how much is unexplained, how it was chosen, what is determined."""
    chosen, seen = result.chosen, result.identified.identifiability
    shares = zip(result.rows, result.rms_ratio_in_band, result.rms_ratio, strict=True)
    side = "after" if chosen.delay >= 0 else "before"
    delay = f", torques logged {abs(chosen.delay) * 1e3:.3g} ms {side} the motion" if result.joints else ""
    return [
        *(
            f"{_named(result, row)} unexplained on held-out blocks: {below:.1%} below the cut-off, "
            f"{raw:.1%} as recorded"
            for row, below, raw in shares
        ),
        f"Cut-off {chosen.cutoff:.3g} Hz{delay}: chosen by the {_kind(result)} error on held-out blocks.",
        f"{seen.rank} combinations of {len(seen.names)} parameters are observable; excitation {result.excitation}, "
        f"condition {seen.condition:.3g}. Not determined by themselves: {_few(seen.undetermined)}.",
        f"Intervals: delete-block jackknife over {result.identified.fit.blocks} blocks, widened to contain the "
        "other choices.",
        *_scale(result),
        _bodies(result),
        *_one_sided(result),
    ]


def _scale(result: "Identification") -> list[str]:
    """A scale of all torques, where masses that are known to differ tell it; else that it is not told."""
    from ..identification.diagnostics import SCALE_UNKNOWN, Explanation

    if not result.joints:
        return []
    scale = Explanation(result).scale_of_all()
    if scale is None:
        return [f"The scale of the torques is not checked: {SCALE_UNKNOWN}."]
    low, high = scale.interval()
    return [f"Scale of the torques by masses known to differ: {scale.value:.3f}, 95 %: {low:.3f} .. {high:.3f}."]


def _bodies(result: "Identification") -> str:
    try:
        found = result.consistent
    except DataError as error:
        return str(error)
    if found.free_is_feasible:
        return "Bodies exist that have these parameters: pseudo-inertias positive definite, frictions not negative."
    return (
        f"No bodies have exactly these parameters: the nearest that exist are {found.distance:.2g} standard errors "
        "away (--json: consistent)."
    )


def _one_sided(result: "Identification") -> list[str]:
    if not result.joints:
        return []
    listed = "; ".join(f"{value.name} {_listed(value.one_sided)}" for value in result.first_moments() if value.in_file)
    return [f"Smoothing torque and rates but not positions, as is often done, is biased and would have given: {listed}"]


def _verdict(result: "Identification", validation: "Validation | None") -> list[str]:
    lines = []
    doubts = result.doubts()
    if validation is not None:
        shares = zip(result.rows, validation.rms_ratio_in_band, validation.rms_ratio, strict=True)
        lines = [
            f"{_named(result, row)} unexplained in {', '.join(validation.runs)}: {below:.1%} below the cut-off, "
            f"{raw:.1%} as recorded"
            for row, below, raw in shares
        ]
        doubts = [*doubts, *validation.doubts()]
    lost = [*result.left_out, *(validation.evidence.left_out if validation else ())]
    lines += [f"Finding: {text}." for text in lost]
    return [*lines, f"Verdict: {'doubtful' if doubts else 'usable'}", *(f"  {doubt}" for doubt in doubts)]


def _named(result: "Identification", row: str) -> str:
    name = result.named(row)
    return name[0].upper() + name[1:]


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "") or "none"


def _listed(values: Mapping[str, float]) -> str:
    return ", ".join(f"{value:.4f} ({label})" for label, value in values.items())


def _row(value: "Value") -> list[str]:
    number, interval = _cells(value, 4)
    return [value.name, number, value.unit, interval, f"{value.in_file:.4f}"]


def _cells(value: "Value", decimals: int) -> tuple[str, str]:
    low, high = value.interval
    return f"{value.value:.{decimals}f}", f"{low:.{decimals}f} .. {high:.{decimals}f}"


@click.command(
    epilog="""\b
Examples:
  testbench ingest 09_double_pendulum_A0_061705.csv --rig two-joint-arm-a0 -o campaign
  testbench identify two-joint-arm-a0 campaign/09_double_pendulum_A0_061705.h5 --figure torque.png
  testbench identify two-joint-arm-a0 campaign/first.h5 --validate campaign/second.h5 --json
  testbench identify parallelogram-6bar campaign/r0*.h5 --by both
\b
Exit codes: 0 done, 3 done with findings (gaps left out) or doubts, which are listed, 1 refused."""
)
@click.argument("mechanism", metavar="MECH")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--by",
    type=click.Choice(["torque", "wrench", "both"]),
    help="What tells: motor torques, force sensors, or both, weighted by their noise.  [default: torque, if any]",
)
@click.option(
    "--method",
    type=click.Choice(["ls", "iv", "oe"]),
    help="Least squares, instrumental variables, output error.  [default: iv; ls by force sensors alone]",
)
@click.option(
    "--validate",
    "separate",
    metavar="RUN",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A run, or a campaign, that has no part in it, to hold the result against; give it again for more.",
)
@click.option(
    "--accept",
    multiple=True,
    type=click.Choice(["mechanism_differs"]),
    help="Identify though the rig of the runs is of another mechanism than MECH.",
)
@click.option("--rig", help="A rig in place of the one stored with the runs.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Draw measured and predicted torque (.png, .svg, .pdf)."
)
@json_option
def identify(mechanism: str, runs: tuple[Path, ...], figure: Path | None, as_json: bool, **options: Any) -> int:  # noqa: ANN401
    """Inertial parameters and friction of MECH from the positions, torques and forces of stored runs.

    What the runs determine is found before solving, and what they do not is named. MECH comes bare: payload and
    counter-masses are those of the first run's conditions, what other runs mounted beyond them is taken off. Cut-off
    and delay are chosen by the torque error on held-out blocks. Intervals (95 %) contain the answers at half and
    double that cut-off, without the delay, and by the other methods.
    """

    from balance.mechanism.mjcf_parser import load_mechanism

    from .. import rig as rigs
    from ..identification import identify as identified
    from ..identification.records import assemble
    from ..identification.result import validate
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun

    model = load_mechanism(mechanism)
    described = rigs.load_rig(options["rig"]) if options["rig"] else None
    opened = stored_runs.opened_runs(runs)
    bound = [AlignedRun(SIRun.of(run, described), model) for run in opened]
    taken = assemble(bound, options["by"], options["accept"])
    result = identified(taken.records, taken.mechanism, options["method"])
    others = stored_runs.opened_runs(options["separate"])
    validation = None
    if others:
        separate = [AlignedRun(SIRun.of(run, described), model) for run in others]
        records = assemble([bound[0], *separate], taken.by, options["accept"]).records[1:]
        validation = validate(result, records)
    if figure is not None:
        _draw(result, figure)
    if as_json:
        from ..identification.document import identification_document

        found = {**identification_document(result, validation), "by": taken.by, "left_out": list(taken.notes)}
        emit_json({**found, "calibrations": calibrations.calibrations(run.run for run in bound)})
    else:
        print_result(result, validation, taken.notes)
        calibrations.print_calibrations(calibrations.calibrations(run.run for run in bound))
    odd = result.left_out or result.doubts()
    if validation is not None:
        odd = odd or validation.evidence.left_out or validation.doubts()
    return EXIT_WITH_FINDINGS if odd else 0


def _draw(result: "Identification", path: Path) -> None:
    from balance.figures.mechanism import save

    from ..identification.figure import draw

    save(draw(result), path)
