"""CSV: comments with the origin, a header with units, numbers that read back to the same bits."""

import csv
from pathlib import Path

from ..recording import UniformClock
from ..store import Run
from .columns import columns, line, provenance, unlisted_findings

_AT_ONCE = 1 << 17


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write one group. Each number is the shortest text that reads back to it."""
    import polars

    (group,) = groups
    found = columns(run, group)
    clock = run.group(group).clock
    with target.open("w", encoding="utf-8", newline="") as text:
        text.write(f"# origin: {run.origin}\n")
        for key, value in provenance(run).items():
            if key not in ("origin", "findings"):
                text.write(f"# {key} = {line(value)}\n")
        if isinstance(clock, UniformClock):
            text.write(f"# rate: {clock.rate_hz!r} Hz\n")
        csv.writer(text, lineterminator="\n").writerow([column.header for column in found])
    table = polars.DataFrame({str(i): column.values for i, column in enumerate(found)})
    with target.open("ab") as stream:
        table.write_csv(stream, include_header=False, batch_size=_AT_ONCE)
    return unlisted_findings(run, "CSV")
