"""Marks of thousands: columns in which they are beyond doubt."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ...findings import Finding
from . import marks
from .header import Header

_MARKS = ".,'\u2019 \u00a0\u202f"
_OF_NO_DECIMALS = frozenset("'\u2019 \u00a0\u202f")


@dataclass(frozen=True)
class Grouped:
    """The column ``field``, whose numbers have ``mark`` between their thousands and ``decimal`` before decimals."""

    field: int
    mark: str
    decimal: str

    def number(self, cells: Sequence[str]) -> str | None:
        """The number without its marks; None if it has none, or is not grouped by threes."""
        cell = cells[self.field]
        if self.mark not in cell or _pattern(self.mark, self.decimal).fullmatch(cell) is None:
            return None
        return cell.replace(self.mark, "").replace(self.decimal, ".")


def find(rows: Sequence[Sequence[str]], header: Header, decimal: str) -> tuple[Grouped, ...]:
    """The columns of the first ``rows`` in which every number is grouped alike, and one of them without doubt."""
    rows = [cells for cells in rows if len(cells) == header.fields]
    found = []
    for i in range(len(header.channels)):
        numbers = [cells[i] for cells in rows if not marks.is_missing(cells[i])]
        if any(mark in cell for cell in numbers for mark in _MARKS):
            found += [Grouped(i, mark, decimal) for mark in _MARKS if _is_sure(numbers, mark, decimal)]
    return tuple(found)


def said(columns: Sequence[Grouped], header: Header) -> list[Finding]:
    """That marks of thousands were taken off, by channel."""
    return [
        Finding(
            "thousands_marks",
            header.channels[column.field].name,
            None,
            f"every number has {column.mark!r} between thousands and {column.decimal!r} before decimals",
        )
        for column in columns
    ]


def _is_sure(numbers: Sequence[str], mark: str, decimal: str) -> bool:
    """Whether all are grouped by ``mark``, and one by a mark that is never of decimals, or twice, or with both."""
    if mark == decimal:
        return False
    pattern = _pattern(mark, decimal)
    if not all(pattern.fullmatch(cell) for cell in numbers):
        return False
    return any(
        mark in cell and (mark in _OF_NO_DECIMALS or cell.count(mark) > 1 or decimal in cell) for cell in numbers
    )


def _pattern(mark: str, decimal: str) -> "re.Pattern[str]":
    one, point = re.escape(mark), re.escape(decimal)
    return re.compile(rf"[+-]?(?:\d{{1,3}}|[1-9]\d{{0,2}}(?:{one}\d{{3}})+)(?:{point}\d*)?(?:[eE][+-]?\d+)?", re.ASCII)
