"""``testbench trim``."""

from typing import TYPE_CHECKING

from balance.cli.framework import Answer, Word, command, option
from balance.cli.options import FIGURE, draw
from balance.cli.printing import emit_findings, emit_table, say
from balance.results import counted, first_of, table

from . import options

if TYPE_CHECKING:
    from balance.balancing.sizing import CounterMass, Sizing

    from ..trimming import Source, Trim

GAP = "time_gap"
COLUMNS = ("site", "first_moment", "interval", "mass", "position")


@command(
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
def trim(
    words: tuple[str, ...] = options.MECHANISM_AND_RUNS,
    site: tuple[str, ...] = option("Where masses may be added; the sites named counter... unless given."),
    stock: str | None = option("Add from these plates: columns name,mass_kg,quantity.", metavar="CSV"),
    sources: "tuple[Source, ...]" = option(
        "By force sensors, motor torques, the base's vibration with the base that the rig states, or runs with trial "
        "masses; give it again for several.  [default: what the rig has]",
        Word(["wrench", "torque", "vibration", "trials"]),
        "--from",
        "--by",
        multiple=True,
    ),
    cutoff: float | None = options.frequency(
        "Highest frequency of what was measured and model alike.  [default: as is best for the source]"
    ),
    rig: str | None = options.RIG,
    figure: str | None = FIGURE,
    accept: tuple[str, ...] = options.ACCEPT,
    budget: bool = options.BUDGET,
) -> Answer:
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
    from ..front_door import bound_runs
    from ..front_door import trim as trimmed
    from ..trimming.result import trim_document

    mechanism, runs = options.split_words(words)
    bound = bound_runs(runs, rig)
    result = trimmed(mechanism, *bound, sites=site, stock=stock, by=sources, cutoff_hz=cutoff, accept=accept)
    draw(figure, result.plot)
    applied = options.calibrations(bound)

    def show() -> None:
        _print(result, stock)
        if budget:
            options.print_budgets(result.mechanism.name, result.budgets)
        options.print_calibrations(applied)

    shown = {**trim_document(result), "calibrations": applied} | ({"budget": result.budgets} if budget else {})
    doubtful = bool(result.accepted or result.findings or result.doubts())
    return Answer(shown, show, doubtful, further=("sources", "conditions", "about"))


def _print(result: "Trim", stock: str | None) -> None:
    """The verdict with what to add, what is missing, whether the sources agree, why it is doubted."""
    from balance.estimation.estimate import LEVEL_TEXT
    from balance.estimation.first_moment_imbalance import MissingMass

    from ..trimming.estimators import FIXED
    from ..trimming.missing_masses import COMPROMISE, SLIDES

    say(_verdict(result, stock))
    level = f"{LEVEL_TEXT} interval" if result.interval_level else "interval, level not known"
    (site, missing, _, *others), rows = table(MissingMass, result.missing, *COLUMNS)
    title = f"Missing on {result.mechanism.name}, {result.origin}, {first_of(result.runs, 4)}, by {result.source}"
    emit_table(title, [site, missing, level, *others], rows)
    if (found := result.consensus) is not None:
        say(
            f"The sources {'agree' if found.agrees else 'contradict each other'}: chi-square {found.chi_square:.2f} "
            f"with {found.degrees_of_freedom} degrees of freedom, probability {found.probability:.2g}."
        )
    left = "is noise: hardly anything else is measured" if result.verdict == "balanced" else "stays unexplained"
    if result.verdict != "balanced" and any(share.is_noise for share in result.shares):
        left += ", no more than the sensors read at rest"
    say(f"{result.unexplained:.1%} of what was measured {left}.")
    for text in result.about:  # of one source among several it begins with "By ..."
        if text in {COMPROMISE, SLIDES} or FIXED[1:] in text:
            say(text)
    emit_findings(("doubtful", doubt) for doubt in result.doubts())
    emit_findings((GAP, gap) for gap in result.gaps)
    options.print_findings(result.accepted)


def _verdict(result: "Trim", stock: str | None) -> str:
    """What to add or remove, and the first-moment residual that is predicted then; why it is doubtful comes first."""
    from ..trimming.problem import SOURCES

    if result.verdict == "balanced":
        simulated = ", of simulated runs" if result.origin == "simulated" else ""
        return (
            f"Balanced: at most {100.0 * result.residual_share:.2g} % of the first moment missing without "
            f"counter-masses is left{simulated}; nothing need be added. Verdict: balanced."
        )
    added = [c for c in result.addition.counter_masses if c.mass > 0.0]
    lacking = [m for m in result.missing if m.is_significant and m.mass.value > 0.0]
    together = {m.site: m.mass.value for m in result.missing}
    untouched = first_of([site for site in together if site not in result.changes], 3)
    simulated = ", of simulated runs" if result.origin == "simulated" else ""

    def why(site: str, mass: float, plates: object) -> str:
        apart = untouched and not plates and f"{mass:.3f}" != f"{together[site]:.3f}"
        text = f" (the table's {together[site]:.3f} kg only together with its change at {untouched})"
        return text if apart else ""

    parts = []
    if lacking and not added:
        masses = ", ".join(f"{m.mass.value:.3f} kg at {m.site}" for m in lacking)
        parts.append(f"No plates of {stock} bring it nearer: what is missing stays: {masses}.")
    elif not added and not result.removal:
        parts.append("Nothing to add: every interval holds zero.")
    residual = f"{_residual_text(result, result.addition)} (now {result.residual:z.4f}){simulated}"
    if result.removal:
        more = [f"at {c.site} {c.mass:.3f} kg more{_plates(c)}{why(c.site, c.mass, c.plates)}" for c in added]
        less = [f"at {m.site} {-m.mass.value:.3f} kg less{why(m.site, m.mass.value, ())}" for m in result.removal]
        changes = ", ".join([*more, *less])
        parts.append(f"{changes[0].upper()}{changes[1:]}: first-moment residual predicted {residual}.")
        if (only := result.only_adding) is not None:
            masses = ", ".join(f"{c.mass:.3f} kg at {c.site}{_plates(c)}" for c in only.counter_masses if c.mass > 0.0)
            parts.append(f"If only adding is possible: {masses}, residual {_residual_text(result, only)}.")
    else:
        word = "Missing" if result.verdict == "doubtful" else "Add"
        parts += [f"{word} {c.mass:.3f} kg at {c.site}{_plates(c)}{why(c.site, c.mass, c.plates)}." for c in added]
        parts.append(f"First-moment residual predicted{' with that' * bool(added)}: {residual}.")
    if result.verdict == "doubtful":
        doubtful = [one for one in result.shares if one.doubtful]
        reasons = [f"{one.unexplained:.0%} of the {SOURCES[one.source].measured} unexplained" for one in doubtful]
        contradicted = any(finding.code != GAP for finding in result.findings)
        reasons += ["testbench doctor CAMPAIGN RUN names a contradiction"] * contradicted
        return f"Doubtful ({'; '.join(reasons) or 'see below'}): mount nothing yet. Estimate: {' '.join(parts)}"
    verdict = result.verdict if added or result.verdict != "add" else f"add, but not from {stock}"
    return " ".join([*parts, f"Verdict: {verdict}."])


def _plates(added: "CounterMass") -> str:
    return f" = {counted(added.plates)}" if added.plates else ""


def _residual_text(result: "Trim", mounting: "Sizing") -> str:
    """First-moment residual of a mounting with its interval."""
    value, (low, high) = result.residual_with(mounting)
    return f"{value:z.4f} kg m, {low:z.4f} .. {high:z.4f}"
