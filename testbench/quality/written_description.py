"""The import description of a log as it was detected, for a person to correct."""

import json
import re
from pathlib import Path

from ..readers import ReadOptions
from ..readers.csv.dialect import DELIMITERS
from ..readers.csv.reader import understood
from ..readers.import_description import DECIMALS
from ..recording import TimeColumn, UniformClock
from .log_description import Description


def written_description(path: Path, options: ReadOptions, found: Description) -> str:
    """The import description of a log as it was detected, for a person to correct."""
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
        lines += [f'time = {_toml(time.name)}  # or columns whose sum it is, such as ["Time", "ms"]']
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
    lines += ["", "[channels]  # name as written = name with its unit in brackets"]
    for channel in dict.fromkeys(channel for group in clocked for channel in group.channels):
        unit = "" if channel.unit is None or f"({channel.unit})" in channel.name else f" ({channel.unit})"
        lines += [f"# {_toml(channel.name)} = {_toml(f'{channel.label}{unit}' if unit else channel.name)}"]
    return "\n".join([*lines, ""])


def _toml(value: object) -> str:
    """A text, or a list of texts and numbers, as TOML has it."""
    return json.dumps(value, ensure_ascii=False)
