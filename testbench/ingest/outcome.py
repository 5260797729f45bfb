"""What became of a log file that was to be ingested."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..findings import Finding, Refusal, refused
from ..recording import Origin
from .runsheet import PlannedRun
from .source import Source


@dataclass(frozen=True)
class Outcome:
    """What became of one log file: ``stored``, ``already_stored``, ``refused``, ``waiting``; and the run's file."""

    file: str | None
    source: str
    sha256: str | None
    origin: Origin
    status: str
    findings: tuple[Finding, ...]
    message: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The outcome as it is printed."""
        return {
            "file": self.file,
            "source": self.source,
            "sha256": self.sha256,
            "origin": self.origin,
            "status": self.status,
            "findings": [finding.as_dict() for finding in self.findings],
        }


def already_there(source: Source, run: str, differing: Sequence[Finding]) -> Outcome:
    """The outcome of a log that the campaign holds, in ``run``; ``differing`` is what the sheet says otherwise now."""
    finding = Finding("already_stored", None, None, f"is stored already as {run}; nothing was written")
    origin = source.recording.origin
    found = (finding, *differing)
    return Outcome(run, source.path.name, source.sha256, origin, "already_stored", found, finding.message)


def not_stored(planned: PlannedRun, sources: Sequence[Source], error: Exception) -> list[Outcome]:
    """One outcome for each file of a run that was not stored; the reason stands with the file that it names."""
    outcomes = []
    for i, path in enumerate(planned.files):
        findings = tuple(sources[i].findings) if i < len(sources) else ()
        if isinstance(error, Refusal) and str(error).startswith(path.name):
            findings = (*findings, error.finding)
        elif not refused(findings):
            findings = (*findings, Finding("not_stored", None, None, str(error)))
        sha256 = sources[i].sha256 or None if i < len(sources) else None
        said = any(source.recording.origin == "simulated" for source in sources)
        origin = "simulated" if said else planned.origin or "unstated"
        outcomes.append(Outcome(None, path.name, sha256, origin, "refused", findings, str(error)))
    return outcomes
