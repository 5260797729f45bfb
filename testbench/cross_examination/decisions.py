"""Findings that a person accepts, with name and reason: records of a campaign, entered into its ledger.

A decision is about a code in the runs that had it then, by their SHA-256; it holds for no other run. One that was wrong
is taken back as any record is, with name and reason: `testbench remove`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import StoreError
from ..runs.si_run import SIRun
from ..store import Run, append_only_records
from ..store.run import identities

KIND = "accepted"


@dataclass(frozen=True)
class Decision:
    """A finding that was accepted."""

    code: str
    by: str
    reason: str
    written: str
    """When, ISO 8601, UTC."""
    runs: tuple[str, ...]
    """Names of the runs for which it holds, of those asked about."""

    def __str__(self) -> str:
        runs = ", ".join(self.runs) if len(self.runs) < 5 else f"{len(self.runs)} runs"
        return f"accepted by {self.by} on {self.written[:10]} for {runs}: {self.reason}"


def accept(campaign: Path, code: str, runs: Sequence[Run], by: str, reason: str) -> Path:
    """Record that a person accepts a finding in runs that have it. Raises StoreError without a name or a reason."""
    if not runs:
        raise StoreError(f"{code!r}: no finding of these runs; nothing was recorded")
    if not by.strip() or not reason.strip():
        raise StoreError("expected a name and a reason: a finding is accepted by a person, who says why")
    content = {"code": code, "by": by.strip(), "reason": reason.strip()}
    return append_only_records.append_record(campaign, KIND, [run.path for run in runs], content)


def decisions(runs: Iterable[Run | SIRun]) -> list[Decision]:
    """What was accepted of runs as they are stored now, the oldest first."""
    known: dict[Path, list[append_only_records.Record]] = {}
    about: dict[tuple[Path, str], tuple[append_only_records.Record, list[str]]] = {}
    for run in runs:
        folder = run.path.parent
        if folder not in known:
            known[folder] = append_only_records.read_records(folder, KIND) if folder.is_dir() else []
        named = [record for record in known[folder] if run.path.name in record.runs]
        try:
            own = identities(run.path) if named else frozenset()
        except StoreError:  # whose digest is not there: not known to be what was decided about
            continue
        for record in named:
            if record.runs[run.path.name] in own:
                about.setdefault((folder, record.name), (record, []))[1].append(run.name)
    found = []
    for record, names in sorted(about.values(), key=lambda one: one[0].number):
        code, by, reason = (str(record.content.get(key)) for key in ("code", "by", "reason"))
        found.append(Decision(code, by, reason, record.written, tuple(names)))
    return found
