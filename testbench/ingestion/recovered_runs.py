"""Acknowledged samples of a stopped ingest into a run that says so: checked like any log, never over another run."""

from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import count, takewhile
from pathlib import Path

from ..errors import StoreError
from ..quality.group_checks import RecordingCheck
from ..recording import Block, Finding, Recording, findings_by_group
from ..store import crash_recovery, open_run
from ..store.atomic_files import SUFFIX, Journal, Leftover, leftovers, unfinished
from ..store.campaign import existing
from ..store.crash_recovery import MARK, Recovery
from ..store.ledger import enter_found, remove_digests_alone
from ..store.writer import RunWriter

_FROM = "recovered_from"
"""Key of the provenance: the unfinished file that a recovered run was saved of."""


def recover(campaign: Path) -> list[Recovery]:
    """Finish or save everything that stopped ingests left in ``campaign``."""
    outcomes = [crash_recovery.finish(leftover, save) for leftover in leftovers(existing(campaign))]
    found = [outcome for outcome in outcomes if outcome is not None]
    try:
        there = sorted(campaign.iterdir())  # before the journals, one of which is made before all else of a run
        with_journal = {leftover.tag for leftover in leftovers(campaign)}
        for path in there:
            if (named := unfinished(path)) is None or named["tag"] in with_journal:
                continue
            if named["name"].endswith(f".h5{SUFFIX}"):
                path.unlink(missing_ok=True)  # a digest on its way, whose run has been taken care of
            else:
                message = f"{path.name} has no journal, which says what it holds; it stays where it is"
                found.append(Recovery(path.name, "failed", message))
        remove_digests_alone(campaign)
        for file in enter_found(campaign):
            found.append(Recovery(file, "entered", "was not in the ledger: it is now, marked as found", file))
    except OSError as error:
        raise StoreError(f"{campaign}: cannot be written ({error.strerror or error}); recover it again") from error
    return found


def save(leftover: Leftover, known: Journal) -> Recovery:
    """Write what was acknowledged as a run of its own."""
    if (stored := _saved_before(leftover)) is not None:
        return Recovery(leftover.run, "superseded", f"was saved before as {stored}", stored)
    intent = known.intent
    if not known.groups:
        return Recovery(leftover.run, "empty", "the unfinished file is gone, and nothing of it; ingest the log again")
    name = next(n for n in _names(leftover) if not leftover.part.with_name(f"{n}.h5").exists())
    whole = ", ".join(f"the first {kept.samples} samples of {kept.group.name!r}" for kept in known.groups)
    logs = ", ".join(source["name"] for source in intent.get("sources", ())) or "the log"
    message = f"the ingest was stopped: {whole} are here; what {logs} had after them is lost unless the log is at hand"
    findings = [Finding("interrupted", None, None, message)]
    with RunWriter(leftover.part.parent, name, {**intent, "run": name}) as writer:
        groups = tuple(kept.group for kept in known.groups)
        recording = Recording(leftover.part, "unfinished run", "recover", groups, lambda _: _blocks(leftover, known))
        check = RecordingCheck(recording)
        for block in recording.blocks(findings.append):
            check.update(block)
            writer.group(block.group).append(block.columns)
        for group in check.groups.values():
            if group.samples:
                writer.group(group.group).finish(group.rate_hz, group.rate_source, group.start_time)
        findings += [f for f in check.findings() if f.code != "no_data"]
        findings = findings_by_group(findings, groups, len(groups) > 1)
        # That of the stopped ingest: its sources without a digest, for the run does not hold all of them.
        writer.describe(
            intent["origin"],
            intent["conditions"],
            findings,
            {
                "software": {name: version(name) for name in ("counterpoise", "h5py", "numpy")},
                "written": datetime.now(UTC).isoformat(timespec="seconds"),
                "accepted_findings": [],
                _FROM: leftover.part.name,
                "sources": [{**source, "sha256": ""} for source in intent.get("sources", ())],
            },
            intent["rig"],
            intent.get("inputs", {}),
        )
        stored = writer.commit().name
    samples = {kept.group.name: kept.samples for kept in known.groups}
    return Recovery(leftover.run, "recovered", findings[0].message, stored, samples)


def _names(leftover: Leftover) -> Iterator[str]:
    return (f"{leftover.run}{MARK}{'' if n == 1 else f'-{n}'}" for n in count(1))


def _saved_before(leftover: Leftover) -> str | None:
    """The run that was saved of these very files, by a recovery that was stopped before it could remove them."""
    stored = (leftover.part.with_name(f"{name}.h5") for name in _names(leftover))
    for path in takewhile(Path.exists, stored):
        if open_run(path).provenance.get(_FROM) == leftover.part.name:
            return path.name
    return None


def _blocks(leftover: Leftover, known: Journal) -> Iterator[Block]:
    for kept in known.groups:
        start = 0
        for columns in crash_recovery.blocks(leftover, kept):
            yield Block(kept.group, columns, start)
            start += len(columns[0])
