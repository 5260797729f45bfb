"""Numbers that a person reads and ``float()`` does not: ``1.5D+03`` of Fortran, a typographic minus, ``0x1F``."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ...findings import Finding
from . import marks
from .header import Header


@dataclass(frozen=True)
class Noted:
    """The column ``field`` of such numbers, with ``decimal`` before decimals; ``example`` is the first one."""

    field: int
    decimal: str
    example: str = ""

    def number(self, cells: Sequence[str]) -> str | None:
        """The number as ``float()`` reads it; None if the cell stays as it is."""
        usual = marks.usual(cells[self.field])
        if usual == cells[self.field] or marks.mark_of(usual) not in ("", self.decimal):
            return None
        return usual.replace(self.decimal, ".")


def find(rows: Sequence[Sequence[str]], header: Header, decimal: str, passed_over: Collection[int]) -> list[Noted]:
    """The columns of numbers that the first ``rows`` write so: all numbers of a column; a minus, all of the file."""
    rows = [cells for cells in rows if len(cells) == header.fields]
    columns = {i: [cells[i] for cells in rows if not marks.is_missing(cells[i])] for i in range(len(header.channels))}
    numbers = {
        i: cells
        for i, cells in columns.items()
        if i not in passed_over and cells and all(map(marks.is_numberish, cells))
    }
    signs = {cell[0] for cells in numbers.values() for cell in cells} & {"-", marks.MINUS}
    return [
        Noted(i, decimal, next((cell for cell in cells if Noted(0, decimal).number([cell]) is not None), ""))
        for i, cells in numbers.items()
        if signs == {marks.MINUS} or all(Noted(0, decimal).number([cell]) is not None for cell in cells)
    ]


def said(columns: Sequence[Noted], header: Header) -> list[Finding]:
    """How such numbers were read, by channel."""
    return [
        Finding(
            "number_notation",
            header.channels[column.field].name,
            None,
            f"numbers such as {column.example!r} are read as {marks.usual(column.example)}",
        )
        for column in columns
        if column.example
    ]
