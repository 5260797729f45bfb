"""Two clocks aligned by what both loggers saw: a rough lag by correlation, then offset and drift by least squares."""

from dataclasses import dataclass

from .mapping import ClockMap
from .refine import refine
from .search import search
from .shared import Shared, prepare


@dataclass(frozen=True)
class Aligned:
    """A clock's map, how it was found, from what, and how much of the signal it explains (None: edges alone)."""

    clock: ClockMap
    method: str
    content: str
    explained: float | None
    findings: tuple[str, ...] = ()
    """What a person should know of the records."""


def by_correlation(shared: Shared, drift: bool = True) -> Aligned:
    """Align by all of the record. Raises AnalysisError, saying why, where the data do not determine the clock."""
    content = prepare(shared)
    found = refine(content, search(content), drift)
    return Aligned(found.clock, "correlation", shared.name, 1.0 - found.left, content.findings)
