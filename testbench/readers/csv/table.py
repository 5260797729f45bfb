"""The rows of a text as blocks of columns, the same for every format whose data are rows of numbers."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ...findings import Finding
from ...recording import Block, Group, Report, Samples, TimeColumn
from ..ahead import in_order
from .cells import CellFilter
from .encoding import Encoding
from .latemarks import LateMarks
from .lines import Lines, count_lines, in_blocks
from .parse import Form
from .rows import Piece, RowFilter
from .swift import Swift
from .tail import last_row


@dataclass(frozen=True)
class Table:
    """Rows of numbers below a header.

    ``kept`` holds the field of each channel of ``group``; ``above`` the lines over the data, ``names`` the one of
    names among them.
    """

    path: Path
    encoding: Encoding
    form: Form
    group: Group
    kept: tuple[int, ...]
    first_data_line: int
    names: str | None = None
    above: tuple[str, ...] = ()

    def blocks(self, report: Report) -> Iterator[Block]:
        """The rows in blocks; what is odd in them is reported at the end."""
        above = frozenset(filter(None, map(self._plain, self.above)))
        rows = RowFilter(self.form, self._plain(self.names), above, self._field_of_time())
        cells = CellFilter(self.form, self._field_names(), self.encoding.name)
        points = LateMarks(self.form, self.kept)
        group, start = self.group, 0
        for piece in self._pieces(rows, report):
            columns = self._columns(piece, cells)
            points.look(piece)
            if piece.header_line:
                group, start = self._next(group), 0
                report(self._repeated(group, piece.header_line, columns))
            yield Block(group, tuple(columns[j] for j in self.kept), start, piece.lines, piece.bytes_read)
            start += len(columns[0])
        rows.report(report)
        cells.report(report)
        points.report(report)

    def _pieces(self, rows: RowFilter, report: Report) -> Iterator[Piece]:
        """Regular rows: as they stand where the whole block parses to finite numbers, else made regular."""
        before, line = b"", self.first_data_line
        blocks = in_blocks(self.path, self.encoding, self.first_data_line, counted=False)
        parse = partial(self._parse, Swift.of(self.path, self.form, self.kept))
        for block, plain, columns in in_order(parse, blocks):
            if block.rest:
                plain, finding = last_row(self.form, self.form.plain(block.rest), before, line)
                columns = None
                if finding is not None:
                    report(finding)
            before = plain or before
            if columns is not None:
                yield Piece(plain, range(line, line + len(columns[0])), columns=columns, bytes_read=block.bytes_read)
            elif plain:
                for piece in rows.pieces(plain, line):
                    yield replace(piece, bytes_read=block.bytes_read)
            line += count_lines(block.text) if columns is None else len(columns[0])

    def _parse(self, swift: Swift | None, block: Lines) -> tuple[Lines, bytes, list[Samples] | None]:
        """The block as plain text, and its columns if every cell that is kept is a finite number."""
        plain = self.form.plain(block.text)
        if swift is not None and plain and (swiftly := swift.columns(plain)) is not None:
            return block, plain, swiftly
        columns = self.form.columns(plain) if plain else None
        regular = columns is not None and all(_finite(columns[j]) for j in self.kept)
        return block, plain, columns if regular else None

    def _columns(self, piece: Piece, cells: CellFilter) -> list[Samples]:
        if piece.columns is not None:
            return piece.columns
        columns = self.form.columns(piece.text)
        if columns is None:
            raise RuntimeError(f"{self.path.name}: rows from line {piece.lines[0]} on are regular, but do not parse")
        cells.judge(piece, columns, list(self.kept))
        return columns

    def _next(self, group: Group) -> Group:
        """The group of the next recording in this file: ``NAME part 2``, ``NAME part 3``, ..."""
        number = int(group.name.rpartition(" part ")[2]) + 1 if group is not self.group else 2
        return replace(group, name=f"{self.group.name} part {number}")

    def _repeated(self, group: Group, line: int, columns: list[Samples]) -> Finding:
        """That the header came again in ``line``, and where time goes on."""
        clock = group.clock
        time = f"; time starts again at {columns[self.kept[clock.index]][0]:g}" if isinstance(clock, TimeColumn) else ""
        message = f"the header comes again{time}; what follows is kept as a recording of its own, {group.name!r}"
        return Finding("repeated_header", None, f"line {line}", message)

    def _field_of_time(self) -> int | None:
        clock = self.group.clock
        return self.kept[clock.index] if isinstance(clock, TimeColumn) else None

    def _field_names(self) -> tuple[str, ...]:
        names = [f"col{i}" for i in range(self.form.fields)]
        for j, channel in zip(self.kept, self.group.channels, strict=True):
            names[j] = channel.name
        return tuple(names)

    def _plain(self, line: str | None) -> bytes | None:
        if line is None:
            return None
        name = self.encoding.name if self.encoding.keeps_ascii else "utf-8"
        return self.form.plain(line.encode(name, "replace") + b"\n").strip()


def _finite(column: Samples) -> bool:
    """Whether all values are finite; a sum that overflows is looked at closer."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = column.sum()
    return bool(np.isfinite(total) or np.isfinite(column).all())
