"""``testbench align``."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import EXIT_REFUSED, Answer, Word, argument, command, option
from balance.cli.printing import emit_findings, emit_table, say
from balance.results import first_of, table

from . import options

if TYPE_CHECKING:
    from ..store import Run
    from ..synchronization.run_alignment import RunClocks


COLUMNS = (
    "run", "group", "offset", "offset_interval", "drift", "drift_interval", "uncertainty", "content",
)  # fmt: skip


@command(
    epilog="""\b
Examples:
  testbench align campaign/r001.h5
  testbench align campaign --no-drift --json
  testbench align campaign/r001.h5 --pair theta1=AccX --dry-run
  testbench align campaign --by trigger                               (sensors of kind "trigger" in the rig)
  testbench align campaign/r001.h5 --by trigger --pair Sync1=Sync2
\b
Exit codes: 0 done, 3 done but some clocks are not determined, or records have gaps, as listed, 1 none is
determined, or some run cannot be opened (the others are aligned)."""
)
def align(
    runs: tuple[Path, ...] = argument("RUN...", required=True),
    by: str = option(
        "By common signals (else by the trigger that the rig names), by taps on what both are fixed to, or by the "
        "edges of a trigger that both recorded.",
        Word(["correlation", "tap", "trigger"]),
        default="correlation",
    ),
    pair: str | None = option(
        "A channel of each logger, in place of those that the rig suggests.", metavar="REFERENCE=OWN"
    ),
    reference: str | None = option("The group whose clock is the reference; that of the encoders.", metavar="GROUP"),
    cutoff: float | None = options.frequency("Highest frequency that is compared."),
    no_drift: bool = option("The offset alone, the drift taken to be within 100 ppm: short records."),
    mechanism: str | None = option("A mechanism in place of the one that the rig names.", metavar="MECH"),
    rig: str | None = options.RIG,
    dry_run: bool = option("Print the result only; store no record in the campaign."),
) -> Answer:
    """Align the clocks of the loggers of each RUN (a stored run, or a campaign): offset and drift, with intervals.

    reference time = offset + (1 + drift) own time. Intervals are of 95 %. What the data do not determine is refused.
    Gaps in a record are not used, with a finding.
    The delays of the loggers' filters are taken off where the rig states them (low_pass), else they are in the offsets.
    The result is added to the campaign as a dated record; runs never change.
    """
    from .. import rig as rigs
    from ..kinematics.encoder_motion import loaded_mechanism, mechanism_of
    from ..runs.si_run import SIRun
    from ..synchronization import common_signals
    from ..synchronization import run_alignment as clocks
    from ..synchronization.event_alignment import METHODS
    from ..synchronization.known_clocks import align_by

    described = rigs.load_rig(rig) if rig else None
    opened, unopened = options.openable_runs(runs)
    if not dry_run:
        _refuse_read_only({run.path.parent for run in opened})

    def aligned(run: "Run") -> "RunClocks":
        if pair:
            one, equals, other = pair.partition("=")
            if not equals or not one.strip() or not other.strip():
                raise click.UsageError(f"--pair {pair!r}: expected REFERENCE=OWN, a channel of each logger")
            return clocks.align_named(run, one.strip(), other.strip(), not no_drift, cutoff, METHODS[by])
        si = SIRun.of(run, described)
        mounted = lambda: loaded_mechanism(si, mechanism_of(si, mechanism))  # noqa: E731
        return align_by(by, si, mounted, reference, not no_drift, cutoff)

    done, refused = _aligned_runs(opened, aligned)
    bound = [SIRun.of(run, described) for run in opened if described or run.rig]
    records, unrecorded = ([], []) if dry_run else _store(done)
    applied, messages = options.calibrations(bound), [*map(str, unopened), *unrecorded]

    def show() -> None:
        _print_clocks([found for _, found in done], refused, records)
        options.print_calibrations(applied)
        otherwise = any(one.aligned.method != "trigger" for _, found in done for one in found.rows)
        triggers = common_signals.trigger_groups(bound) if otherwise and not pair else []
        if len(triggers) > 1:
            say(f"The rig has a trigger in {first_of(triggers, 4)}: --by trigger aligns the clocks by its edges.")

    document = {
        "alignments": [row for _, found in done for row in found.rows],
        "refused": [*map(str, unopened), *refused, *unrecorded],
        "records": records,
        "calibrations": applied,
    }
    doubtful = bool(refused or any(found.findings for _, found in done))
    return Answer(document, show, doubtful, refused=messages, code=0 if done else EXIT_REFUSED)


def _aligned_runs(
    runs: "Iterable[Run]", aligned: "Callable[[Run], RunClocks]"
) -> "tuple[list[tuple[Path, RunClocks]], list[str]]":
    """Clocks of the runs in which some logger could be aligned; what was refused, and why."""
    from ..errors import AnalysisError

    done, refused = [], []
    for run in runs:
        try:
            found = aligned(run)
        except AnalysisError as error:
            refused.append(str(error))
            continue
        refused += [f"{run.name}: {group}: {reason}" for group, reason in found.refused.items()]
        if found.aligned:
            done.append((run.path, found))
    return done, refused


def _refuse_read_only(campaigns: set[Path]) -> None:
    """Before anything is computed that could not be recorded."""
    from ..errors import StoreError
    from ..store import append_only_records

    for folder in sorted(campaigns):
        try:
            append_only_records.refuse_read_only(folder)
        except StoreError as error:
            raise StoreError(f"{error}, or print the result only: --dry-run") from error


def _store(done: "list[tuple[Path, RunClocks]]") -> tuple[list[Path], list[str]]:
    """Add a record to each campaign: their files, and why there are not more."""
    from ..errors import StoreError
    from ..synchronization import run_alignment

    written, failed = [], []
    for folder in dict.fromkeys(path.parent for path, _ in done):
        try:
            written.append(run_alignment.write_alignments(folder, [one for one in done if one[0].parent == folder]))
        except StoreError as error:
            failed.append(str(error))
    return written, failed


def _print_clocks(found: "list[RunClocks]", refused: list[str], records: list[Path]) -> None:
    from ..synchronization.run_alignment import GroupClock

    references = sorted({clocks.reference for clocks in found})
    rows = [row for clocks in found for row in clocks.rows]
    if found or refused:
        say(f"Clocks: {len(rows)} aligned, {len(refused)} not.")
    if found:
        title = f"Clocks against {', '.join(references[:3])}{' ...' if len(references) > 3 else ''}"
        emit_table(title, *table(GroupClock, rows, *COLUMNS), "reference time = offset + (1 + drift) own time")
        origins = sorted({clocks.origin for clocks in found})
        say(f"Origin of the runs: {', '.join(origins)}.")
        _print_filters(found)
    for path in records:
        say(f"Recorded in {path}.")
    emit_findings(("Finding", f"{text}.") for clocks in found for text in clocks.findings)
    for reason in refused:
        click.echo(f"Not aligned: {reason}", err=not found)


def _print_filters(found: "list[RunClocks]") -> None:
    """Which delays of filters are taken off, and whose may be in the offsets."""
    delays = {group: delay for clocks in found for group, delay in clocks.delays.items()}
    stated = sorted({delay for delay in delays.values() if delay is not None})
    if texts := [f"{1e3 * d:.3f} ms of {first_of([g for g, own in delays.items() if own == d], 3)}" for d in stated]:
        say(f"Delays of the loggers' filters, taken off: {'; '.join(texts)}.")
    if unstated := [group for group, delay in delays.items() if delay is None]:
        say(f"The rig states no filter (low_pass) of {first_of(unstated, 3)}: a delay of one is in the offsets.")
