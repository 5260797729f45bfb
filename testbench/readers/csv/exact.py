"""Whole numbers of a text that float64 does not hold to the last digit."""

from collections.abc import Collection, Sequence

from ...findings import Finding
from .header import Header
from .stamps import is_plain

_SIGNIFICANT = 15
"""Digits that float64 holds whatever they are."""


def is_exact(written: str) -> bool:
    """Whether float64 holds a whole number to its last digit."""
    return int(float(written)) == int(written)


def rounded(rows: Sequence[Sequence[str]], header: Header, passed_over: Collection[int]) -> list[Finding]:
    """The columns in which some of these ``rows`` hold whole numbers that float64 rounds, each with the first one."""
    found = []
    for i, channel in enumerate(header.channels):
        cells = (row[i] for row in rows if len(row) == header.fields and len(row[i]) > _SIGNIFICANT)
        first = next((cell for cell in cells if _is_whole(cell) and not is_exact(cell)), None)
        if first is not None and i not in passed_over:
            message = f"holds whole numbers beyond 2**53, such as {first}, which float64 rounds to {float(first):.0f}"
            found.append(Finding("not_exact", channel.name, None, message))
    return found


def _is_whole(cell: str) -> bool:
    return is_plain(cell) and cell.lstrip("+-").isdigit()
