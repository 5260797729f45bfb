"""``testbench identify``, and its tables."""

from pathlib import Path
from typing import TYPE_CHECKING

from balance.cli.framework import Answer, Word, command, option
from balance.cli.options import FIGURE, draw, progress
from balance.cli.printing import emit_findings, emit_table, say
from balance.results import first_of, table

from . import options

if TYPE_CHECKING:
    from ..identification import Identification
    from ..identification.estimators import Method
    from ..identification.records import By


SCALED = "usable up to a torque scale"
_TESTED, _TOLD = 8, 4
"""Steps of the bar that tests and the document take."""
VALUE_COLUMNS = ("name", "value", "unit", "interval", "in_file")
FURTHER = (
    "counter_masses", "first_moments", "first_moment_ratios", "validation", "method.compared", "cutoff.held_out_error",
    "consistent.", "identifiability.", "evidence.scale_of_all", "model_tests.laws", "model_tests.motion",
)  # fmt: skip
"""What else of the document is printed for who asks for everything."""


def print_result(result: "Identification") -> None:
    """The verdict, the base parameters, what separate runs leave unexplained, the reasons against the verdict."""
    from ..identification.result import FRICTION_FINDING, Value

    moments = [value for value in result.first_moments() if value.in_file] or result.first_moments()
    values = [f"{m.name} = {m.value:.4g} [{m.interval[0]:.4g}, {m.interval[1]:.4g}] {m.unit}" for m in moments]
    verdict = f"Verdict: {result.verdict}; {first_of(values, 3) or 'no first moment is determined'}."
    if result.verdict == "doubtful":
        verdict += (
            " Do not build on it: mend what is named below the tables, or record anew (testbench doctor CAMPAIGN RUN)."
        )
    if result.verdict == SCALED:
        verdict += (
            " The torques' scale is not checked: ratios of first moments hold, first moments and counter-masses are "
            "wrong by as much as the torques read wrong; it takes runs that differ by a mass that is known."
        )
    say(verdict)
    for text in (*scale_texts(result), *result.inseparable.values()):
        say(text)
    about = f"{result.mechanism.name} from {', '.join(result.runs)} (origin {result.origin})"
    if len(result.runs) > 1:
        about += f"; offsets that name no run are those of {result.runs[0]}"
    emit_table(f"Identified: {about}", *table(Value, [*result.base_values(), *result.joint_values()], *VALUE_COLUMNS))
    if (separate := result.validation) is not None:
        for row, below, raw in zip(result.rows, separate.rms_ratio_in_band, separate.rms_ratio, strict=True):
            say(
                f"In {', '.join(separate.runs)} {result.named(row)} stays unexplained by {below:.1%} below the "
                f"cut-off, by {raw:.1%} as recorded"
            )
    emit_findings((doubt.code, doubt.text) for doubt in result.all_doubts)
    emit_findings((FRICTION_FINDING, text) for text in result.other_friction)
    emit_findings(("time_gap", text) for text in result.lost)


def scale_texts(result: "Identification") -> list[str]:
    """On which scales of the torques the verdict rests, and what of that the mechanism's file could state."""
    scales = result.tests.scales
    if not scales.each:
        return []
    shown = {name: "{:.4f} [{:.4f}, {:.4f}]".format(one.value, *one.interval()) for name, one in scales.each.items()}
    one = scales.common is not None
    listed = [shown[scales.names[0]]] if one else [f"{name} {text}" for name, text in shown.items()]
    texts = [f"Torques read {', '.join(listed)} times what they should, by masses that differ between the runs."]
    values = [value for value in result.values if value.is_of_scale]
    if values:
        texts.append(
            f"That this is not known better makes most of the intervals of {first_of([v.name for v in values], 4)}: "
            "a larger known mass, or a calibration of the torque sensors, narrows them."
        )
    if scales.by_statement:
        texts.append("That takes what is mounted to have the radius of gyration that MECH states; no weight tells it.")
    for body, (low, high) in scales.radii_of_gyration.items():
        if low > 0.0:
            texts.append(
                f"What is mounted on {body} has, squared, a radius of gyration {low * 1e6:.4g} .. {high * 1e6:.4g} "
                "mm^2 larger than MECH states, and inertias are as wide as that: state it in MECH "
                "(SITE.radius_of_gyration)."
            )
    return texts


@command(
    epilog="""\b
Examples:
  testbench ingest 09_double_pendulum_A0_061705.csv --rig two-joint-arm-a0 -o campaign
  testbench identify two-joint-arm-a0 campaign/09_double_pendulum_A0_061705.h5 --figure torque.png
  testbench identify campaign/first.h5 --budget
  testbench identify two-joint-arm-a0 campaign/first.h5 --validate campaign/second.h5 --json
  testbench identify campaign/r0*.h5 --by both
\b
Exit codes: 0 done, 3 done with findings (gaps, other friction) or doubts, which are listed, 1 refused."""
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
    accept: tuple[str, ...] = options.contradictions(
        "A contradiction that a person accepts, or mechanism_differs: the rig is of another mechanism than MECH.",
        "mechanism_differs",
    ),
    rig: str | None = options.RIG,
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
    from ..identification import STEPS
    from ..identification.diagnostics import identification_document

    mechanism, runs = options.split_words(words)
    bound = bound_runs(runs, rig)
    with progress("identifying", STEPS + _TESTED + _TOLD, in_bytes=False) as done:
        result = identified(
            mechanism, *bound, by=by, method=method, rig=rig, accept=accept, validate=separate, done=done
        )
        result.verdict  # noqa: B018  its tests take as long
        done(_TESTED)
        told = identification_document(result)
        done(_TOLD)
    draw(figure, result.plot)
    applied, budgets = options.calibrations(bound), [value.budget for value in result.first_moments()]

    def show() -> None:
        print_result(result)
        if budget:
            options.print_budgets(result.mechanism.name, budgets)
        options.print_calibrations(applied)

    found = told | ({"budget": budgets} if budget else {}) | {"calibrations": applied}
    return Answer(found, show, bool(result.lost or result.other_friction or result.all_doubts), further=FURTHER)
