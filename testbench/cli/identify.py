"""``testbench identify``, and its tables."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from balance.cli.framework import EXIT_WITH_FINDINGS, emit_json, emit_table, json_option
from balance.errors import DataError
from balance.results import table

from . import options as calibrations
from . import options as stored_runs

if TYPE_CHECKING:
    from ..identification import Identification, Value
    from ..identification.cross_validation import MethodErrors
    from ..identification.result import Validation


SCALED = "usable up to a torque scale"
VALUE_COLUMNS = ("name", "value", "unit", "interval", "in_file")
COUNTER_MASS_COLUMNS = ("site", "position", "mass", "mass_interval", "first_moment", "first_moment_interval")


def print_result(
    result: "Identification", validation: "Validation | None" = None, left_out: Sequence[str] = ()
) -> None:
    """The tables for people."""
    from ..identification.result import CounterMassValue, Value

    click.echo("\n".join(_verdict(result, validation)))
    about = f"{result.mechanism.name} from {', '.join(result.runs)} (origin {result.origin})"
    emit_table(f"Identified: {about}", *table(Value, result.base_values(), *VALUE_COLUMNS))
    terms = "Friction, drives and offsets" if result.joints else "Offsets"
    emit_table(terms, *table(Value, result.joint_values(), *VALUE_COLUMNS))
    moments = [value for value in result.first_moments() if value.in_file] or result.first_moments()
    rows = [[value.name, *(f"{other:.4f}" for other in value.variants.values())] for value in moments]
    others = moments[0].variants if moments else result.variants
    emit_table("First moments by other choices [kg m]", ["", *others], rows)
    header = ["", f"{_kind(result)} unexplained", "simulated angle off by, rms [rad]", "first moments [kg m]"]
    emit_table("Methods on held-out blocks", header, [_method(result, one, moments) for one in result.comparison])
    if result.mechanism.counter_sites and not result.undetermined_moments():
        title = "Counter-masses that would balance it, beyond what the first run mounted"
        if result.verdict != "usable":
            title += f": {result.verdict}"
        emit_table(title, *table(CounterMassValue, result.counter_masses(), *COUNTER_MASS_COLUMNS))
    click.echo("\n".join([*_notes(result, moments), *left_out, *_separate(result, validation)]))


def _method(result: "Identification", one: "MethodErrors", moments: "Sequence[Value]") -> list[str]:
    used = one.method == result.method
    values = [value.value if used else value.variants.get(one.method) for value in moments]
    return [
        f"{one.method}: {one.name}{' (used)' if used else ''}",
        f"{one.torque_error:.1%}",
        "-" if one.angles is None else f"{one.angles.all_rms:.4f}",
        ", ".join("-" if value is None else f"{value:.4f}" for value in values),
    ]


def _kind(result: "Identification") -> str:
    """What was measured: torques, forces and moments, or both."""
    forces = len(result.rows) > len(result.joints)
    return " and ".join([*(["torque"] if result.joints else []), *(["force"] if forces else [])])


def _notes(result: "Identification", moments: "Sequence[Value]") -> list[str]:
    """Below the tables: how much is unexplained, how it was chosen, what is determined."""
    chosen, seen = result.chosen, result.identified.identifiability
    side = "after" if chosen.delay >= 0 else "before"
    delay = f", torques logged {abs(chosen.delay) * 1e3:.3g} ms {side} the motion" if result.joints else ""
    lacking = ", ".join(seen.undetermined[:6]) or "none"
    lacking += f" and {len(seen.undetermined) - 6} more" if len(seen.undetermined) > 6 else ""
    return [
        *_unexplained(result, result, "on held-out blocks"),
        f"Cut-off {chosen.cutoff:.3g} Hz{delay}: chosen by the {_kind(result)} error on held-out blocks.",
        f"{seen.rank} combinations of {len(seen.names)} parameters are observable; excitation {result.excitation}, "
        f"condition {seen.condition:.3g}. Not determined by themselves: {lacking}.",
        f"Intervals: delete-block jackknife over {result.identified.fit.blocks} blocks, widened to contain the "
        "other choices.",
        *(_torque_notes(result, moments) if result.joints else []),
        _bodies(result),
    ]


def _unexplained(result: "Identification", of: "Identification | Validation", where: str) -> list[str]:
    shares = zip(result.rows, of.rms_ratio_in_band, of.rms_ratio, strict=True)
    names = {row: result.named(row) for row in result.rows}
    return [
        f"{names[row][0].upper()}{names[row][1:]} unexplained {where}: {below:.1%} below the cut-off, "
        f"{raw:.1%} as recorded"
        for row, below, raw in shares
    ]


def _torque_notes(result: "Identification", moments: "Sequence[Value]") -> list[str]:
    """A scale of all torques, where masses that are known to differ determine it; and what is often done instead."""
    from balance.estimation.estimate import LEVEL_TEXT

    from ..identification.diagnostics import SCALE_UNKNOWN

    scale, text = result.tests.scale, f"The scale of the torques is not checked: {SCALE_UNKNOWN}."
    if scale is not None:
        low, high = scale.interval()
        text = (
            f"Scale of the torques by masses known to differ: {scale.value:.3f}, {LEVEL_TEXT}: {low:.3f} .. {high:.3f}."
        )
    listed = [f"{one.name} " + ", ".join(f"{x:.4f} ({label})" for label, x in one.one_sided.items()) for one in moments]
    motion = result.tests.motion
    simulated = []
    if motion is not None:
        wider = f"the intervals are {motion.factor**0.5:.2f} times as wide for it"
        chance = f"{motion.expected:.2g} were what the torques lack independent"
        simulated = [f"The simulated motion deviates by {motion.error:.2g} rms (rad, m), by {chance}: {wider}."]
    return [
        text,
        *simulated,
        "Smoothing torque and rates but not positions, as is often done, is biased and would have given: "
        + "; ".join(listed),
    ]


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


def _separate(result: "Identification", validation: "Validation | None") -> list[str]:
    """What gaps took, and how separate runs are predicted."""
    lost, lines = [*result.left_out], []
    if validation is not None:
        lines = _unexplained(result, validation, f"in {', '.join(validation.runs)}")
        lost = [*lost, *validation.equations.left_out]
    return [*lines, *(f"Finding: {text}." for text in lost)]


def _verdict(result: "Identification", validation: "Validation | None") -> list[str]:
    """The verdict, then every reason against it."""
    doubts = [*result.doubts, *(validation.doubts if validation else [])]
    verdict = result.verdict_with(validation.doubts if validation else ())
    lines = [f"Verdict: {verdict}", *(f"  {doubt.code}: {doubt.text}" for doubt in doubts)]
    if verdict == SCALED:
        lines.append(
            "  the torques' scale is not checked: ratios of first moments hold, first moments and counter-masses are "
            "wrong by as much as the torques read wrong; it takes runs that differ by a mass that is known"
        )
    return lines


@click.command(
    epilog="""\b
Examples:
  testbench ingest 09_double_pendulum_A0_061705.csv --rig two-joint-arm-a0 -o campaign
  testbench identify two-joint-arm-a0 campaign/09_double_pendulum_A0_061705.h5 --figure torque.png
  testbench identify campaign/first.h5 --budget
  testbench identify two-joint-arm-a0 campaign/first.h5 --validate campaign/second.h5 --json
  testbench identify campaign/r0*.h5 --by both
\b
Exit codes: 0 done, 3 done with findings (gaps left out) or doubts, which are listed, 1 refused."""
)
@stored_runs.mechanism_and_runs
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
    metavar="CODE",
    shell_complete=stored_runs.contradiction_codes,
    help="A contradiction that a person accepts, or mechanism_differs: the rig is of another mechanism than MECH.",
)
@click.option("--rig", help="A rig in place of the one stored with the runs.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Draw measured and predicted torque (.png, .svg, .pdf)."
)
@stored_runs.budget_option
@json_option
def identify(words: tuple[str, ...], figure: Path | None, budget: bool, as_json: bool, **options: Any) -> int:  # noqa: ANN401
    """Inertial parameters and friction of MECH from the positions, torques and forces of stored runs.

    What the runs determine is found before solving, and what they do not is named. MECH is the mechanism stored with
    the first run, or shipped under the name in its rig, unless given. It comes bare: payload and
    counter-masses are those of the first run's conditions, what other runs mounted beyond them is taken off. Cut-off
    and delay are chosen by the torque error on held-out blocks. Intervals (95 %) contain the answers at half and
    double that cut-off, without the delay, and by the other methods. A run whose sensors contradict the run table or
    the other runs (testbench doctor) makes the result doubtful, until its CODE is accepted.
    """
    from .. import rig as rigs
    from ..identification import identify as identified
    from ..identification.records import DIFFERS, assemble
    from ..identification.result import validate
    from ..kinematics.encoder_motion import mechanism_of
    from ..runs.aligned_run import AlignedRun
    from ..runs.si_run import SIRun

    stored_runs.refuse_unknown_codes(code for code in options["accept"] if code != DIFFERS)
    mechanism, runs = stored_runs.split_words(words)
    described = rigs.load_rig(options["rig"]) if options["rig"] else None
    opened = [SIRun.of(run, described) for run in stored_runs.opened_runs(runs)]
    model = mechanism_of(opened[0], mechanism)
    bound = [AlignedRun(run, model) for run in opened]
    taken = assemble(bound, options["by"], options["accept"])
    result = identified(taken.records, taken.mechanism, options["method"])
    others = stored_runs.opened_runs(options["separate"])
    contradictions = stored_runs.contradictions(opened, options["accept"], model)
    result = replace(result, contradictions=contradictions)
    validation = None
    if others:
        separate = [AlignedRun(SIRun.of(run, described), model) for run in others]
        records = assemble([bound[0], *separate], taken.by, options["accept"]).records[1:]
        validation = validate(result, records)
    if figure is not None:
        from balance.figures.mechanism import save

        from ..identification.figure import draw

        save(draw(result), figure)
    if as_json:
        from ..identification.diagnostics import identification_document

        found = {**identification_document(result, validation), "by": taken.by, "left_out": list(taken.notes)}
        found |= {"budget": [value.budget for value in result.first_moments()]} if budget else {}
        emit_json({**found, "calibrations": calibrations.calibrations(opened)})
    else:
        print_result(result, validation, taken.notes)
        if budget:
            stored_runs.print_budgets(result.mechanism.name, [value.budget for value in result.first_moments()])
        calibrations.print_calibrations(calibrations.calibrations(opened))
    odd = bool(result.left_out or result.doubts)
    if validation is not None:
        odd = odd or bool(validation.equations.left_out or validation.doubts)
    return EXIT_WITH_FINDINGS if odd else 0
