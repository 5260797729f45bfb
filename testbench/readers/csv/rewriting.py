"""Cells that are numbers to a person and not to a parser, as numbers: in plain rows, before these are parsed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from . import blockwise
from .stamps import Stamps


class Spelled(Protocol):
    """A column whose cells spell a number in another way."""

    @property
    def field(self) -> int:
        """Its place in a row."""

    def number(self, cells: Sequence[str]) -> str | None:
        """The number of its cell with a decimal point; None if the cell stays as it is."""


@dataclass(frozen=True)
class Rewriting:
    """Plain rows of ``fields`` cells, with the cells of ``columns`` as numbers; other lines stay as they are.

    The cells of ``taken_up`` fields say nothing beside them and become 0.
    """

    columns: tuple[Spelled, ...]
    separator: str
    fields: int
    decimal: str
    encoding: str = "utf-8"
    taken_up: frozenset[int] = frozenset()

    def __call__(self, plain: bytes) -> bytes:
        """The same lines; each has its line end, and the number of lines does not change."""
        column = self.columns[0] if len(self.columns) == 1 else None
        if isinstance(column, Stamps):
            quick = blockwise.rewritten(plain, column, self.separator, self.fields, self.decimal)
            if quick is not None:
                return quick
        lines = plain.decode(self.encoding, "surrogateescape").split("\n")
        return "\n".join(map(self._line, lines)).encode(self.encoding, "surrogateescape")

    def _line(self, line: str) -> str:
        cells = line.removesuffix("\r").split(self.separator)
        if len(cells) != self.fields:
            return line
        stripped = [cell.strip() for cell in cells]
        numbers = [column.number(stripped) for column in self.columns]
        for column, number in zip(self.columns, numbers, strict=True):
            if number is not None:
                cells[column.field] = number.replace(".", self.decimal)
        if all(number is not None for number in numbers):
            for field in self.taken_up:
                cells[field] = "0"
        return self.separator.join(cells) + ("\r" if line.endswith("\r") else "")
