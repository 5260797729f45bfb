"""``testbench identify``, and its tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from balance.cli.framework import Answer, Word, emit_findings, emit_further, emit_table, note, say
from balance.cli.options import FIGURE, command, draw, option
from balance.errors import DataError
from balance.results import first_of, table

from . import options

if TYPE_CHECKING:
    from ..identification import Identification, Value
    from ..identification.cross_validation import MethodErrors
    from ..identification.estimators import Method
    from ..identification.records import By
    from ..identification.result import Validation


SCALED = "usable up to a torque scale"
VALUE_COLUMNS = ("name", "value", "unit", "interval", "in_file")
COUNTER_MASS_COLUMNS = ("site", "position", "mass", "mass_interval", "first_moment", "first_moment_interval")


def print_result(result: "Identification") -> None:
    """The verdict, the base parameters, the reasons against it; with --all all other tables and notes."""
    from ..identification.result import CounterMassValue, Value

    moments = [value for value in result.first_moments() if value.in_file] or result.first_moments()
    values = [f"{m.name} = {m.value:.4g} [{m.interval[0]:.4g}, {m.interval[1]:.4g}] {m.unit}" for m in moments]
    verdict = f"Verdict: {result.verdict}; {first_of(values, 3) or 'no first moment is determined'}."
    if result.verdict == SCALED:
        verdict += (
            " The torques' scale is not checked: ratios of first moments hold, first moments and counter-masses are "
            "wrong by as much as the torques read wrong; it takes runs that differ by a mass that is known."
        )
    say(verdict)
    about = f"{result.mechanism.name} from {', '.join(result.runs)} (origin {result.origin})"
    emit_table(f"Identified: {about}", *table(Value, result.base_values(), *VALUE_COLUMNS))
    terms = "Friction, drives and offsets" if result.joints else "Offsets"
    emit_further(terms, *table(Value, result.joint_values(), *VALUE_COLUMNS))
    rows = [[value.name, *(f"{other:.4f}" for other in value.variants.values())] for value in moments]
    others = moments[0].variants if moments else result.variants
    emit_further("First moments by other choices [kg m]", ["", *others], rows)
    header = ["", f"{_kind(result)} unexplained", "simulated angle off by, rms [rad]", "first moments [kg m]"]
    emit_further("Methods on held-out blocks", header, [_method(result, one, moments) for one in result.comparison])
    if result.mechanism.counter_sites and not result.undetermined_moments():
        title = "Counter-masses that would balance it, beyond what the first run mounted"
        if result.verdict != "usable":
            title += f": {result.verdict}"
        emit_further(title, *table(CounterMassValue, result.counter_masses(), *COUNTER_MASS_COLUMNS))
    note("\n".join([*_notes(result, moments), *result.notes]))
    if result.validation is not None:
        say("\n".join(_unexplained(result, result.validation, f"in {', '.join(result.validation.runs)}")))
    emit_findings((doubt.code, doubt.text) for doubt in result.all_doubts)
    emit_findings(("time_gap", text) for text in result.lost)


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
    lacking = first_of(seen.undetermined, 6) or "none"
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


@command(
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
def identify(
    words: tuple[str, ...] = options.MECHANISM_AND_RUNS,
    by: "By | None" = option(
        "Found from motor torques, force sensors, or both, weighted by their noise.  [default: torque, if any]",
        Word(["torque", "wrench", "both"]),
    ),
    method: "Method | None" = option(
        "Least squares, instrumental variables, output error.  [default: iv; ls by force sensors alone]",
        Word(["ls", "iv", "oe"]),
    ),
    separate: tuple[Path, ...] = option(
        "A run, or a campaign, that has no part in it, to hold the result against; give it again for more.",
        None,
        "--validate",
        metavar="RUN",
    ),
    accept: tuple[str, ...] = option(
        "A contradiction that a person accepts, or mechanism_differs: the rig is of another mechanism than MECH.",
        metavar="CODE",
        shell_complete=options.contradiction_codes,
    ),
    rig: str | None = option("A rig in place of the one stored with the runs."),
    figure: str | None = FIGURE,
    budget: bool = options.BUDGET,
) -> Answer:
    """Inertial parameters and friction of MECH from the positions, torques and forces of stored runs.

    What the runs determine is found before solving, and what they do not is named. MECH is the mechanism stored with
    the first run, or shipped under the name in its rig, unless given. It comes bare: payload and
    counter-masses are those of the first run's conditions, what other runs mounted beyond them is taken off. Cut-off
    and delay are chosen by the torque error on held-out blocks. Intervals (95 %) contain the answers at half and
    double that cut-off, without the delay, and by the other methods. A run whose sensors contradict the run table or
    the other runs (testbench doctor) makes the result doubtful, until its CODE is accepted.
    """
    from ..front_door import bound_runs
    from ..front_door import identify as identified
    from ..identification.diagnostics import identification_document
    from ..identification.records import DIFFERS

    options.refuse_unknown_codes(code for code in accept if code != DIFFERS)
    mechanism, runs = options.split_words(words)
    bound = bound_runs(runs, rig)
    result = identified(mechanism, *bound, by=by, method=method, rig=rig, accept=accept, validate=separate)
    draw(figure, result.plot)
    applied, budgets = options.calibrations(bound), [value.budget for value in result.first_moments()]

    def show() -> None:
        print_result(result)
        if budget:
            options.print_budgets(result.mechanism.name, budgets)
        options.print_calibrations(applied)

    found = identification_document(result) | ({"budget": budgets} if budget else {}) | {"calibrations": applied}
    return Answer(found, show, bool(result.lost or result.all_doubts))
