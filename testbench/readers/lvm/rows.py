"""Rows of an LVM segment as blocks of columns, and each part of its channels as a group."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...recording import Block, Group, Report, Samples
from ..csv.irregular_rows import CellFilter, RegularRows, RowFilter
from ..csv.row_parser import RowParser
from .header import Segment


def without_comments(text: bytes, form: RowParser) -> bytes:
    """Rows with what stands behind their last column cut off: a comment, or a separator alone."""
    data = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(data == ord("\n"))
    separators = np.flatnonzero(data == ord(form.separator))
    upto = np.searchsorted(separators, ends)
    before = np.concatenate(([0], upto[:-1]))
    long = np.flatnonzero(upto - before >= form.fields)
    if not len(long):
        return text
    change = np.zeros(len(data) + 1, dtype=np.int8)
    change[separators[before[long] + form.fields - 1]] = 1
    change[ends[long]] = -1
    return data[np.cumsum(change[:-1]) == 0].tobytes()


@dataclass
class SegmentRows:
    """The rows of one segment: parsed, judged, and counted on across blocks.

    After as many rows as the header declares, the next block of them begins: ``part 2``, ``part 3``, ...
    """

    segment: Segment
    encoding: str
    split: bool
    rows: int = 0

    def __post_init__(self) -> None:
        self._odd = RowFilter(self.segment.form, None)
        self._cells = CellFilter(self.segment.form, self.segment.names, self.encoding)

    def blocks(self, text: bytes, first_line: int, bytes_read: int) -> Iterator[Block]:
        """Whole lines of this segment, each with its line feed, as blocks of its groups."""
        form = self.segment.form
        plain = without_comments(form.plain(text), form)
        for piece in self._odd.pieces(plain, first_line):
            columns = form.columns(piece.text)
            if columns is None:
                raise RuntimeError(f"rows from line {piece.lines[0]} on are regular, but do not parse")
            yield from self._cut(piece, [_writable(c) for c in columns], bytes_read)

    def _cut(self, piece: RegularRows, columns: list[Samples], bytes_read: int) -> Iterator[Block]:
        """Judge the cells, then cut at the borders of appended blocks."""
        lines = np.asarray(piece.lines)
        every = self.segment.declared or 0 if self.split else 0
        index = self.rows + np.arange(len(lines))
        within = index % every if every else index
        if every:
            self._fill_ended(columns, within)
        self._cells.judge(piece, columns, sorted({j for part in self.segment.parts for j in part.fields}))
        inner = np.flatnonzero(within == 0) if every else np.empty(0, dtype=np.int64)
        for begin, end in pairwise([0, *inner[inner > 0].tolist(), len(lines)]):
            number, start = (int(index[begin]) // every, int(within[begin])) if every else (0, int(index[begin]))
            for part in self.segment.parts:
                stop = min(end, begin + max(0, (part.declared or every) - start)) if every else end
                if stop > begin:
                    kept = slice(begin, stop)
                    data = tuple(columns[j][kept] for j in part.fields)
                    yield Block(numbered(part.group, number), data, start, lines[kept], bytes_read)
        self.rows += len(lines)

    def _fill_ended(self, columns: list[Samples], within: NDArray[np.int64]) -> None:
        """Channels that have ended before others have empty cells from there on, which are none of theirs."""
        for part in self.segment.parts:
            if part.declared is not None:
                for j in part.fields:
                    columns[j][within >= part.declared] = 0.0

    def report(self, report: Report) -> None:
        """Report what was odd in rows and cells."""
        self._odd.report(report)
        self._cells.report(report)


def numbered(group: Group, number: int) -> Group:
    """The group of the block ``number`` (from 0) that follows under one header."""
    return replace(group, name=f"{group.name} part {number + 1}") if number else group


def _writable(column: Samples) -> Samples:
    return column if column.flags.writeable else column.copy()
