"""What a log file holds: its groups, clocks and channels in numbers, and what is odd in it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from balance.results import document

from ..readers import ReadOptions, open_recording
from ..recording import Finding, Recording, UniformClock, findings_by_group
from .group_checks import GroupCheck, RecordingCheck
from .time_column import time_in_seconds


@dataclass(frozen=True)
class Description:
    """A recording read to its end."""

    recording: Recording
    groups: tuple[GroupCheck, ...]
    findings: tuple[Finding, ...]

    def document(self, stats: bool = False) -> dict[str, Any]:
        """The JSON object; with ``stats`` the numbers of each channel too."""
        groups = [_group(check, stats) for check in self.groups]
        texts = self.recording.texts.kept
        shown = {"texts": texts} if texts else {}
        return {"format": self.recording.format, "groups": groups, **shown, "findings": self.findings}


def describe_log(path: str | Path, options: ReadOptions | None = None) -> Description:
    """Read a log file to its end, keeping its numbers only."""
    recording = open_recording(path, options)
    check = RecordingCheck(recording)
    findings = list(recording.findings)
    for block in recording.blocks(findings.append):
        check.update(block)
    groups = [one.group for one in check.groups.values()]
    found = findings_by_group([*findings, *check.findings()], groups, len(groups) > 1)
    if options is not None and options.description is not None:
        found = options.description.with_normal_as_notes(found)
    return Description(recording, tuple(check.groups.values()), tuple(found))


def _group(check: GroupCheck, stats: bool) -> dict[str, Any]:
    return {
        "name": check.group.name,
        "samples": check.samples,
        "rate_hz": check.rate_hz,
        "rate_source": check.rate_source,
        "start_time": check.start_time,
        "clock": clock(check),
        "channels": [
            document(channel) | (document(numbers) if stats else {})
            for channel, numbers in zip(check.group.channels, check.stats, strict=True)
        ],
    }


def clock(check: GroupCheck) -> dict[str, float | int | None] | None:
    """First and last time and the steps between [s]; None without a clock."""
    declared = check.group.clock
    if declared is None:
        return None
    if not isinstance(declared, UniformClock):
        return time_in_seconds(declared, check.clock)
    step = 1.0 / declared.rate_hz if check.samples > 1 else None
    return {
        "t_first_s": declared.start_s,
        "t_last_s": declared.start_s + (check.samples - 1) / declared.rate_hz,
        "dt_min_s": step,
        "dt_median_s": step,
        "dt_max_s": step,
        "non_increasing": 0,
    }
