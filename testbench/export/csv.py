"""CSV: comments with the origin, a header with units, numbers that read back to the same bits."""

import csv
from pathlib import Path

from balance.table_files import write_csv

from ..recording import UniformClock
from ..store import Run
from .columns import columns, line, provenance, unlisted_findings


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write one group. Each number is the shortest text that reads back to it."""
    (group,) = groups
    found = columns(run, group)
    headers = [" ".join(column.header.splitlines()) for column in found]
    clock = run.group(group).clock
    with target.open("w", encoding="utf-8", newline="") as text:
        text.write(f"# origin: {run.origin}\n")
        for key, value in provenance(run).items():
            if key not in ("origin", "findings"):
                text.write(f"# {key} = {line(value)}\n")
        if isinstance(clock, UniformClock):
            text.write(f"# rate: {clock.rate_hz!r} Hz\n")
        comment = any("#" in header for header in headers)  # unless it is quoted
        csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if comment else csv.QUOTE_MINIMAL).writerow(headers)
    with target.open("ab") as stream:
        write_csv(stream, [column.values for column in found])
    losses = [
        f"name {column.header!r} is written on one line"
        for column, header in zip(found, headers, strict=True)
        if column.header != header
    ]
    if all(map(_is_number, headers)):
        losses.append(f"names of group {group!r} are all numbers: some readers take them for the first sample")
    return losses + unlisted_findings(run, "CSV")


def _is_number(header: str) -> bool:
    try:
        float(header)
    except ValueError:
        return False
    return True
