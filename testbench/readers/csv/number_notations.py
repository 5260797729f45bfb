"""Numbers that a person reads and ``float()`` does not: ``1'234,5``, ``1.5D+03``, a typographic minus, ``0x1F``."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from ...recording import Finding
from .cell_syntax import MINUS, decimal_mark, is_exact, is_missing, is_number_like, is_without_exponent, plain_number
from .header import Header
from .row_parser import RewrittenColumn

_THOUSANDS_MARKS = ".,'\u2019 \u00a0\u202f"
_NEVER_DECIMAL = frozenset("'\u2019 \u00a0\u202f")
_EXACT_DIGITS = 15
"""Digits that float64 holds whatever they are."""

Columns = Mapping[int, Sequence[str]]


@dataclass(frozen=True)
class NotationColumn(RewrittenColumn):
    """A column of numbers in another notation, which ``plain`` turns into what ``float()`` reads."""

    plain: Callable[[str], str | None]
    findings: tuple[Finding, ...] = ()

    def number(self, cells: Sequence[str]) -> str | None:
        """The number of its cell; None if it stays as it is."""
        return self.plain(cells[self.field])


def find_notations(
    rows: Sequence[Sequence[str]], header: Header, decimal: str, passed_over: Collection[int]
) -> tuple[NotationColumn, ...]:
    """The columns of the first ``rows`` in such notations, but for those ``passed_over``."""
    rows = [cells for cells in rows if len(cells) == header.fields]
    fields = [i for i in range(len(header.channels)) if i not in passed_over]
    columns = {i: [cells[i] for cells in rows if not is_missing(cells[i])] for i in fields}
    grouped = list(_grouped_columns(columns, header, decimal))
    done = {column.field for column in grouped}
    others = {i: cells for i, cells in columns.items() if i not in done and cells and all(map(is_number_like, cells))}
    return (*grouped, *_foreign_columns(others, header, decimal))


def rounded_numbers(rows: Sequence[Sequence[str]], header: Header, passed_over: Collection[int]) -> list[Finding]:
    """The columns in which some of these ``rows`` hold whole numbers that float64 rounds, each with the first one."""
    found = []
    for i, channel in enumerate(header.channels):
        cells = (row[i] for row in rows if len(row) == header.fields and len(row[i]) > _EXACT_DIGITS)
        whole = (cell for cell in cells if is_without_exponent(cell) and cell.lstrip("+-").isdigit())
        first = next((cell for cell in whole if not is_exact(cell)), None)
        if first is not None and i not in passed_over:
            message = f"holds whole numbers beyond 2**53, such as {first}, which float64 rounds to {float(first):.0f}"
            found.append(Finding("not_exact", channel.name, None, message))
    return found


def _grouped_columns(columns: Columns, header: Header, decimal: str) -> "list[NotationColumn]":
    """Columns in which every number is grouped by threes, one of them without doubt."""
    found = []
    for i, numbers in columns.items():
        if not any(mark in cell for cell in numbers for mark in _THOUSANDS_MARKS):
            continue
        for mark in _THOUSANDS_MARKS:
            if mark != decimal and _is_surely_grouped(numbers, mark, decimal):
                message = f"every number has {mark!r} between thousands and {decimal!r} before decimals"
                finding = Finding("thousands_marks", header.channels[i].name, None, message)
                found.append(NotationColumn(i, partial(_ungrouped, mark, decimal), (finding,)))
    return found


def _is_surely_grouped(numbers: Sequence[str], mark: str, decimal: str) -> bool:
    """Whether all are grouped by ``mark``, and one by a mark that is never of decimals, or twice, or with both."""
    pattern = _group_pattern(mark, decimal)
    return all(pattern.fullmatch(cell) for cell in numbers) and any(
        mark in cell and (mark in _NEVER_DECIMAL or cell.count(mark) > 1 or decimal in cell) for cell in numbers
    )


def _group_pattern(mark: str, decimal: str) -> "re.Pattern[str]":
    one, point = re.escape(mark), re.escape(decimal)
    return re.compile(rf"[+-]?(?:\d{{1,3}}|[1-9]\d{{0,2}}(?:{one}\d{{3}})+)(?:{point}\d*)?(?:[eE][+-]?\d+)?", re.ASCII)


def _ungrouped(mark: str, decimal: str, cell: str) -> str | None:
    """The number without its marks of thousands; None if it has none, or is not grouped by threes."""
    if mark not in cell or _group_pattern(mark, decimal).fullmatch(cell) is None:
        return None
    return cell.replace(mark, "").replace(decimal, ".")


def _foreign_columns(numbers: Columns, header: Header, decimal: str) -> "list[NotationColumn]":
    """Columns of other notations: all numbers of a column; a typographic minus, all of the file."""
    signs = {cell[0] for cells in numbers.values() for cell in cells} & {"-", MINUS}
    found = []
    for i, cells in numbers.items():
        foreign = [cell for cell in cells if _plain(decimal, cell) is not None]
        if signs == {MINUS} or len(foreign) == len(cells):
            message = f"numbers such as {foreign[0]!r} are read as {plain_number(foreign[0])}" if foreign else ""
            finding = Finding("number_notation", header.channels[i].name, None, message)
            found.append(NotationColumn(i, partial(_plain, decimal), (finding,) if foreign else ()))
    return found


def _plain(decimal: str, cell: str) -> str | None:
    """The number as ``float()`` reads it; None if the cell stays as it is."""
    plain = plain_number(cell)
    if plain == cell or decimal_mark(plain) not in ("", decimal):
        return None
    return plain.replace(decimal, ".")
