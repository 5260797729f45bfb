"""What a log file holds: its groups, clocks and channels in numbers, what is odd in it, and how it was read."""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from balance.results import document, finite

from ..readers import ReadOptions, open_recording
from ..recording import Finding, Recording, TimeColumn, UniformClock, findings_by_group
from .group_checks import GroupCheck, RecordingCheck


@dataclass(frozen=True)
class Description:
    """A recording read to its end."""

    recording: Recording
    groups: tuple[GroupCheck, ...]
    findings: tuple[Finding, ...]

    def document(self, stats: bool = False) -> dict[str, Any]:
        """The JSON object; with ``stats`` the numbers of each channel too."""
        groups = [
            {
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
            for check in self.groups
        ]
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


def clock(check: GroupCheck) -> dict[str, float | int | None] | None:
    """First and last time and the steps between [s], as written if the unit is unknown; None without a clock."""
    declared, recorded = check.group.clock, check.clock
    if declared is None:
        return None
    if isinstance(declared, UniformClock):
        step = 1.0 / declared.rate_hz if check.samples > 1 else math.nan
        last, steps = declared.start_s + (check.samples - 1) / declared.rate_hz, (step, step, step)
        numbers, unit, factor = (declared.start_s, last, *steps), "_s", 1.0
    else:
        numbers = (recorded.first, recorded.last, recorded.dt_min, recorded.steps.quantile(0.5), recorded.dt_max)
        unit, factor = ("", 1.0) if declared.seconds_per_unit is None else ("_s", declared.seconds_per_unit)
    names = ("t_first", "t_last", "dt_min", "dt_median", "dt_max")
    found = {f"{name}{unit}": finite(factor * number) for name, number in zip(names, numbers, strict=True)}
    return {**found, "non_increasing": recorded.non_increasing}


def written_description(path: Path, options: ReadOptions, found: Description) -> str:
    """The import description of a log as it was detected, for a person to correct."""
    from ..readers.csv.dialect import DELIMITERS
    from ..readers.csv.reader import understood
    from ..readers.import_description import DECIMALS

    settings, clocked = found.recording.settings, [check.group for check in found.groups]
    lines = [
        f"# How {path.name} is read ({found.recording.format}), as detected.",
        "# Correct what is wrong, take out what each log shows itself, give it with --as to info, ingest and watch.",
    ]
    if "first_data_line" in settings:
        header = understood(path, options).header
        delimiters, decimals = ({value: name for name, value in known.items()} for known in (DELIMITERS, DECIMALS))
        lines += [f"encoding = {_toml(settings['encoding'])}"]
        lines += [f"delimiter = {_toml(delimiters[settings['delimiter']])}"] if settings["delimiter"] else []
        lines += [f"decimal = {_toml(decimals[settings['decimal']])}"]
        lines += [f"names = {_toml(list(header.rows))}  # lines whose cells are joined, such as [1, 2]; [] for none"]
        lines += [f"units = {header.units}"] if header.units else ["# units = 2  # the line of the units"]
        lines += [f"data = {header.first_data_line}"]
    timed = next((group for group in clocked if isinstance(group.clock, TimeColumn)), None)
    if timed is not None and isinstance(timed.clock, TimeColumn):
        time = timed.channels[timed.clock.index]
        lines += [f'time = {_toml(time.name)}  # or columns whose sum it is, such as ["Time", "ms"]; [] for none']
        known = time.unit if timed.clock.seconds_per_unit is not None and not timed.clock.assumed else None
        lines += [f"time_unit = {_toml(known)}"] if known else ['# time_unit = "us"  # or "day since 1899-12-30"']
    else:
        lines += ['# time = "Time"  # the column of time, or columns whose sum it is', '# time_unit = "us"']
        rate = next((group.clock.rate_hz for group in clocked if isinstance(group.clock, UniformClock)), None)
        lines += [f'# rate = "{rate or 1000:g} Hz"  # where there is no column of time']
    lines += ["# time_wraps = 4294967296  # where a counter starts again from zero"]
    lines += ['# time_zone = "+03:00"  # of times that state none']
    words = {w for f in found.findings if f.code == "not_a_number" for w in re.findall(r"'([^']+)' in line", f.message)}
    codes = {
        c for f in found.findings if f.code == "coded_values" for c in re.findall(r"samples are (\S+),", f.message)
    }
    lines += [f"missing = {_toml(sorted(words | codes))}"]
    normal = list(dict.fromkeys(finding.code for finding in found.findings if finding.severity > 0))
    lines += [f"# normal = {_toml(normal)}  # found here; which of them has each log of this logger?"]
    lines += ["", "[channels]  # below all settings: name as written = name with its unit in brackets"]
    for channel in dict.fromkeys(channel for group in clocked for channel in group.channels):
        unit = "" if channel.unit is None or f"({channel.unit})" in channel.name else f" ({channel.unit})"
        lines += [f"# {_toml(channel.name)} = {_toml(f'{channel.label}{unit}' if unit else channel.name)}"]
    return "\n".join([*lines, ""])


def _toml(value: object) -> str:
    """A text, or a list of texts and numbers, as TOML has it."""
    return json.dumps(value, ensure_ascii=False)
