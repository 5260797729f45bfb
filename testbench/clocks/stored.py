"""Alignments as records of a campaign: what was found for each run, by when, to be used by what comes after."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..store import records
from .mapping import ClockMap, same_clock

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .run import RunClocks

KIND = "alignment"


def write(campaign: Path, runs: "Sequence[tuple[Path, RunClocks]]") -> Path:
    """Add a record of the alignments of stored runs; returns its file."""
    rows = [row for _, clocks in runs for row in clocks.as_rows()]
    return records.append(campaign, KIND, [path for path, _ in runs], {"alignments": rows})


def read(run: Path, reference: str) -> dict[str, ClockMap]:
    """The newest stored map of each clock of a run onto that of ``reference``; empty where there is none."""
    found: dict[str, ClockMap] = {}
    for record in records.about(run.parent, KIND, run):
        for row in record.content.get("alignments", []):
            if row["run"] == run.stem and row["reference"] == reference:
                found[row["group"]] = ClockMap.from_dict(row)
    return found | {reference: same_clock((0.0, 0.0))} if found else {}
