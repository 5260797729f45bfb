"""``testbench info`` and ``testbench formats``: what a log holds, and which logs can be read."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from balance.cli.framework import Answer, argument, command, option
from balance.cli.printing import emit_table, plain_text, say
from balance.results import instant_text, table

from . import options

if TYPE_CHECKING:
    from ..quality.log_description import Description
    from ..readers import ReadOptions

STATS = ("n", "not_finite", "min", "max", "mean", "first", "last")
SHOWN_GROUPS, SHOWN_CHANNELS = 50, 500
"""Groups of a file, and channels of a group, that are printed for people."""


@command(
    epilog="""\b
Examples:
  testbench info run_001.csv
  testbench info run_001.csv --stats
  testbench info olcum.txt --encoding cp1254 --decimal comma --json
\b
Exit codes: 0 nothing odd, 3 findings, 1 would be refused or cannot be read."""
)
@options.text_options
def info(
    file: Path = argument(),
    stats: bool = option("Also count, min, max, mean, first and last of each channel."),
    *,
    reading: "ReadOptions",
) -> Answer:
    """What a log file holds, and what is odd in it. Reads the whole file, keeps nothing."""
    from ..quality.log_description import describe_log
    from ..recording import Refusal, refusing_findings

    try:
        found = describe_log(file, reading)
    except Refusal as refusal:
        unread = {"format": None, "groups": [], "findings": [refusal.finding]}
        return Answer(unread, lambda: None, refused=[str(refusal)])
    refused = []
    if codes := dict.fromkeys(finding.code for finding in refusing_findings(found.findings)):
        refused = [
            f"{file.name}: would be refused for {', '.join(codes)}: correct what the findings name, or store it as it "
            f"is with testbench ingest {' '.join(f'--accept {code}' for code in codes)}"
        ]
    code = options.exit_code(found.findings)
    return Answer(found.document(stats), lambda: print_description(found, stats), refused=refused, code=code)


@command(
    epilog="""\b
Examples:
  testbench describe run_001.csv -o logger.toml
  testbench info run_001.csv --as logger.toml
  testbench ingest logs/*.csv --as arduino-micros -o campaign
\b
Shipped descriptions: `testbench files`."""
)
@options.text_options
def describe(
    file: Path = argument(),
    output: Path | None = option("The file to write; else it is printed.", None, "-o", "--output"),
    *,
    reading: "ReadOptions",
) -> None:
    """Write how a log is read, as detected: an import description, to be corrected and given with --as."""
    from ..errors import RecordingError
    from ..quality.log_description import describe_log, written_description

    written = written_description(file, reading, describe_log(file, reading))
    if output is None:
        click.echo(written, nl=False)
        return
    try:
        with output.open("x", encoding="utf-8") as stream:
            stream.write(written)
    except FileExistsError:
        raise RecordingError(f"{output}: is there already; nothing was written") from None


def print_description(found: "Description", stats: bool) -> None:
    """Print what a log holds, channel by channel, and its findings."""
    from ..quality.group_checks import ChannelStats
    from ..quality.log_description import clock
    from ..recording import Channel

    recording = found.recording
    marked = " - SIMULATED" if recording.origin == "simulated" else ""
    channels, odd = sum(len(check.stats) for check in found.groups), sum(one.severity > 0 for one in found.findings)
    name = plain_text(recording.path.name)
    say(f"{name}: {recording.format}{marked}, {channels} channels, {odd} findings")
    for check in found.groups[:SHOWN_GROUPS]:
        header, rows = table(Channel, check.group.channels[:SHOWN_CHANNELS])
        if stats:
            more, numbers = table(ChannelStats, check.stats[:SHOWN_CHANNELS], *STATS)
            header, rows = header + more, [row + cells for row, cells in zip(rows, numbers, strict=True)]
        rate = f", {check.rate_hz:.6g} Hz ({check.rate_source})" if check.rate_hz else ", no rate"
        times = clock(check) or {}  # in seconds where the unit of time is known
        unit = next((end for end in ("_s", "") if times.get(f"t_last{end}") is not None), None)
        first, last = ("" if unit is None else instant_text(times[f"{t}{unit}"] or 0.0) for t in ("t_first", "t_last"))
        span = "" if unit is None else f", {first} to {last} {unit[1:]}".rstrip()
        start = f"\n  started {plain_text(str(check.start_time))}" if check.start_time else ""
        say(f"{plain_text(check.group.name)}: {check.samples} samples{rate}{span}{start}")
        emit_table("", header, rows)
        _say_more(len(check.stats) - SHOWN_CHANNELS, "channels")
    _say_more(len(found.groups) - SHOWN_GROUPS, "groups")
    for series in recording.texts.kept[:SHOWN_GROUPS]:
        several = f", group {series.group}" if len(found.groups) > 1 else ""
        say(plain_text(f"{series.channel}{several}: text, begins or changes at {len(series.texts)} samples"))
    options.print_reading_findings("Findings", (("", finding) for finding in found.findings))


def _say_more(number: int, of: str) -> None:
    if number > 0:
        say(f"and {number} more {of}; --json lists all")


@command(
    epilog="""\b
Example:
  testbench formats
\b
A package adds a format by an entry point of the group counterpoise.readers."""
)
def formats() -> Answer:
    """Which formats can be read, and what each needs installed."""
    from ..readers import readers

    known = readers()
    rows = [[r.name, " ".join(r.extensions), r.needs or "nothing more"] for r in known]
    document = [{"name": r.name, "extensions": list(r.extensions), "needs": r.needs or None} for r in known]
    header = ["format", "extensions", "needs"]
    return Answer({"formats": document}, lambda: emit_table(f"Formats: {len(rows)}", header, rows))
