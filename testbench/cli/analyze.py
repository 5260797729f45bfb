"""``testbench analyze``, ``compare`` and ``doctor``: what the runs of a campaign tell together."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from balance.cli.framework import Answer, Word, argument, command, option
from balance.cli.options import FIGURE, SCHEDULER, draw
from balance.cli.printing import Detail, emit_table, plain_text, say
from balance.results import document, first_of, plain, table

from ..signal import METRIC_NAMES
from . import options

if TYPE_CHECKING:
    from ..cross_examination import Examination
    from ..signal import Metric
    from ..signal.filters import Band
    from ..vibration.comparison import Comparison
    from ..vibration.reduction import Analysis, Reduction


METRIC = option("What an amplitude is; rms is of the whole record.", Word(METRIC_NAMES), default="peak_to_peak")
BAND = option(
    "Frequencies that count [Hz], by a Butterworth filter of order 4, forwards and backwards; none: all. Above a lower "
    "end of zero, an offset and a ramp are removed first: they are no vibration.",
    options.BAND_TEXT, default="1..200",
)  # fmt: skip


def _origins_text(counts: dict[str, int]) -> str:
    """``52 of 52 runs are simulated.``"""
    total = sum(counts.values())
    return "; ".join(f"{count} of {total} runs are {origin}" for origin, count in counts.items()) + "."


@command(
    epilog="""\b
Examples:
  testbench analyze campaign --figure reductions.png
  testbench analyze campaign --metric rms --band 1..100 --json
  testbench analyze campaign --budget
\b
Exit codes: 0 done, 3 done with findings (no partner, doubtful channels, lower bounds), 1 nothing to compare."""
)
def analyze(
    campaign: Path = argument(),
    metric: "Metric" = METRIC,
    band: "Band | None" = BAND,
    accept: tuple[str, ...] = options.ACCEPT,
    scheduler: str | None = SCHEDULER,
    budget: bool = options.BUDGET,
    figure: str | None = FIGURE,
) -> Answer:
    """By how much counter-masses reduce the vibration amplitude of the base: runs with them against runs without.

    Runs of one payload, motion, acceleration and origin are compared. The noise that the campaign's
    rests and repeats show is subtracted, and propagated to intervals (95 %); repeats that differ beyond it widen them.
    Where nothing recorded shows the noise there is no interval. Where the residual vibration is not above the noise,
    the reduction is a lower bound:
    ">= 97.2 < noise". The calibration of a sensor cancels in a reduction unless it was calibrated anew in between;
    the intervals of the amplitudes themselves hold it.

    Every run is cross-examined first (testbench doctor): a number of which sensors, run table or other runs contradict
    each other is withheld or marked, until its CODE is accepted.
    """
    from balance.task_pool import task_pool

    from ..front_door import analyze as analyzed
    from ..store import open_campaign

    runs = open_campaign(campaign).runs
    with task_pool(scheduler, tasks=len(runs)) as pool:
        analysis = analyzed(runs, metric, band, accept, pool=pool)
    draw(figure, analysis.plot)
    shown = document(analysis) | options.provenance(runs)
    for row, one in zip(shown["reductions"], analysis.reductions if budget else (), strict=budget):
        row["budget"] = plain(one.uncertainty.budgets if one.uncertainty else [])

    def show() -> None:
        print_reductions(campaign, analysis)
        for one in analysis.reductions if budget else ():
            of = f"{one.key}, {one.sensor} along {one.axis}"
            options.print_budgets(of, one.uncertainty.budgets if one.uncertainty else ())
        options.print_provenance(runs)

    return Answer(shown, show, bool(analysis.findings))


def print_reductions(campaign: Path, analysis: "Analysis") -> None:
    """Print reductions with their origin, notes and findings."""
    from ..vibration.reduction import Reduction, verdict

    say(verdict(analysis.reductions, analysis.examination))
    doubts = ("doubts",) if any(r.doubts for r in analysis.reductions) else ()
    place = _place(analysis.reductions)
    columns = (*place, "text", *doubts, "amplitudes", "noise_floor", "n", "method", "origin", "runs")
    title = f"Reduction of the base's vibration, {campaign.name}"
    emit_table(title, *table(Reduction, analysis.reductions, *columns), analysis.definition)
    for note in (_origins_text(analysis.origins), *analysis.notes):
        say(note)
    options.print_findings(analysis.findings)


def _place(reductions: "Sequence[Reduction]") -> tuple[str, ...]:
    """Columns of place and of what any condition states, with the counter-masses where one has several sets."""
    from ..vibration.reduction import sets_differ

    names = ("payload_kg", "payloads_kg", "motion", "peak_acceleration_g", "peak_acceleration_rad_s2")
    stated = [name for name in names if any(getattr(r.key, name) not in (None, {}) for r in reductions)]
    masses = ("counter_masses",) if sets_differ(reductions) else ()
    return (*stated, *masses, "sensor", "axis")


@command(
    epilog="""\b
Examples:
  testbench compare campaign --figure reductions.png
  testbench compare campaign --published kiper2019 --figure reductions.png
  testbench compare campaign --published kiper2019 --metric peak --json
\b
Exit codes: 0 done, 3 done with findings (runs without a partner, what cannot be simulated), 1 nothing to compare."""
)
def compare(
    campaign: Path = argument(),
    published: str | None = option("Published reductions: a shipped table, kiper2019, or a file.", metavar="NAME"),
    mechanism: str | None = option("A mechanism in place of the one that is stored with the runs.", metavar="MECH"),
    metric: "Metric" = METRIC,
    band: "Band | None" = BAND,
    accept: tuple[str, ...] = options.ACCEPT,
    figure: str | None = FIGURE,
) -> Answer:
    """Reductions by several sources: analysed from the logs, simulated anew, and published where a table is given.

    The simulation starts from the rig, the mechanism, the motion and the conditions that are stored with the runs,
    without noise.
    """
    from ..front_door import compare as compared
    from ..store import open_campaign

    runs = open_campaign(campaign).runs
    comparison = compared(runs, published, metric, band, accept, mechanism)
    draw(figure, comparison.plot)

    def show() -> None:
        _print_comparison(campaign, comparison)
        options.print_provenance(runs)

    return Answer(document(comparison) | options.provenance(runs), show, bool(comparison.findings))


def _print_comparison(campaign: Path, comparison: "Comparison") -> None:
    from ..vibration.comparison import Row
    from ..vibration.reduction import verdict

    say(verdict([row.analyzed for row in comparison.rows], comparison.examination))
    source, place = comparison.published, _place([row.analyzed for row in comparison.rows])
    columns = (*place, "text", "simulated", "bench", *(["published"] if source else []), "shaking_force", "origin")
    title = f"Reduction of the base's vibration, {campaign.name}{f', and of {source.name}' if source else ''}"
    emit_table(title, *table(Row, comparison.rows, *columns), comparison.definition)
    say(_origins_text(comparison.origins))
    if source:
        say(f"Published values as printed; amplitudes, according to the source: {source.definition}.")
    for note in comparison.notes:
        say(note)
    options.print_findings(comparison.findings)


@command(
    epilog="""\b
Examples:
  testbench doctor campaign
  testbench doctor campaign r003 r004 --json
\b
Exit codes: 0 no contradiction, 3 done with findings, 1 no campaign or no such run."""
)
def doctor(
    campaign: Path = argument(),
    runs: tuple[str, ...] = argument("[RUN]..."),
    mechanism: str | None = option(
        "The mechanism, where the stored rig names one that is not shipped.", metavar="MECH"
    ),
    accept: tuple[str, ...] = options.ACCEPT,
    by: str | None = options.BY,
    reason: str | None = options.REASON,
) -> Answer:
    """Cross-examine a campaign, run by run, worst first: does what its sensors show fit the run table and each other?

    Encoders, commands, torques, forces, accelerometers and the model witness payload, counter-masses, peak
    acceleration, motion, and of each sensor the axis, sign and gain; dead channels, levels that drift, and copies of
    runs are found; what ingest found, such as a clipped sensor or a run that it could not store, is repeated. All runs
    of the campaign are heard; those named are shown. With --by and --reason, what is accepted is entered into the
    ledger for the runs that are shown: other commands then take it as accepted too.
    """
    from ..cross_examination.statement import accept as enter
    from ..cross_examination.statement import decisions
    from ..errors import StoreError
    from ..front_door import doctor as examined
    from ..recording import Severity
    from ..store import open_campaign
    from ..store.ledger import read_ledger

    stored = open_campaign(campaign).runs
    names = [run.name for run in stored]
    if wrong := [run for run in runs if run not in names]:
        raise StoreError(f"{campaign}: no run {wrong[0]!r}: expected some of {', '.join(names[:12])}")
    examination = examined(stored, accept, mechanism)
    shown = sorted(runs or names, key=lambda run: -len(examination.about(run)))
    if person := options.acceptance(accept, by, reason):
        about = {code: {s.run for run in shown for s in examination.about(run) if s.code == code} for code in accept}
        if absent := [code for code, some in about.items() if not some]:
            raise StoreError(f"--accept {', '.join(absent)}: no finding of {first_of(shown, 4)}; nothing was recorded")
        for code, some in about.items():
            enter(campaign, code, [run for run in stored if run.name in some], **person)
    recorded = decisions(run for run in stored if run.name in shown)
    as_read = [] if runs else read_ledger(campaign).lacking
    as_read += [
        replace(finding, message=": ".join(filter(None, (run.name, finding.channel, finding.message))))
        for run in stored
        for finding in (run.findings if run.name in shown else ())
        if finding.severity is not Severity.NOTE
    ]

    def show() -> None:
        codes = ", ".join(sorted({finding.code for finding in as_read}))
        beside = f" Found by ingest: {codes}." if codes else ""
        say(f"{campaign.name}: {examination.verdict(shown)}{beside}")
        _print_examination(examination, shown)
        options.print_findings(as_read)
        for one in recorded:
            say(plain_text(f"{one.code}: {one}"))

    doubtful = not shown or any(examination.about(run) or run in examination.unexamined for run in shown)
    told = {"accepted": [plain(vars(one)) for one in recorded], "as_read": as_read}
    return Answer(examination.document(shown) | told, show, doubtful or bool(as_read))


def _print_examination(examination: "Examination", shown: list[str]) -> None:
    from ..cross_examination import Statement

    each = [[run] for run in shown] if Detail.everything else [shown]
    found = (one for runs in each for one in examination.by_contradiction(runs).items())
    if rows := [[first_of(runs, 6), subject, channels or "-", code] for (subject, channels, code), runs in found]:
        emit_table("Contradictions", ["run", "about", "channel", "finding"], rows)
    causes: dict[tuple[str | None, ...], list[Statement]] = {}
    for one in (s for run in shown for s in examination.about(run)):
        alone = one.run if Detail.everything else one.stated if one.channel is None else None
        cause = (one.subject, one.channel, one.witness, one.code, alone)
        causes.setdefault(cause, []).append(one)
    named = {cause: first_of(dict.fromkeys(one.run for one in some), 6) for cause, some in causes.items()}
    options.print_findings(replace(some[0], run=named[cause]).finding for cause, some in causes.items())
    if len(causes) < sum(map(len, causes.values())):
        say("Values are of the first run; --all: of each.")
    sharing: dict[str, dict[str, list[str]]] = {}
    for run in shown:
        if run in examination.unexamined:
            text = f"not examined: {examination.unexamined[run].removeprefix(f'{run}: ')}"
            sharing.setdefault("", {}).setdefault(text, []).append(run)
        elif missing := examination.unwitnessed(run):
            text = f"not confirmed by another signal: {', '.join(missing)}"
            sharing.setdefault(examination.why_unwitnessed(run), {}).setdefault(text, []).append(run)
    for why, by_text in sharing.items():
        said = "; ".join(f"{', '.join(runs)}: {text}" for text, runs in by_text.items())
        say(f"{said}{f' ({why})' if why else ''}")
