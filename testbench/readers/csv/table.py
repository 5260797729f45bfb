"""The rows of a text as blocks of columns, the same for every format whose data are rows of numbers.

Where a table has several columns of time, each is the clock of those behind it, which are a group of their own.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...recording import Block, ContentDigest, Finding, Group, Report, Samples, TextLog, TimeColumn
from ..byte_source import in_order
from ..header_claims import Read
from .cell_syntax import is_missing
from .header import time_name_base
from .irregular_rows import CellFilter, LateDecimalMark, RegularRows, RowFilter, last_row
from .row_parser import FastParser, RowParser
from .text_blocks import Encoding, TextBlock, count_lines, read_blocks

LONG_BYTES = 50_000_000
"""Size of a file from which the compiled loop saves more than its start costs [bytes]."""
_MOST_ROWS = 1 << 16
_COMPARED = 64
"""Bytes by which the texts of successive rows are compared all at once; longer ones are compared one by one."""

Columns = list[Samples]


@dataclass(frozen=True)
class Table:
    """Rows of numbers below a header.

    ``kept`` holds the field of each channel of ``group``; ``above`` the lines over the data, ``names`` the one of
    names among them.
    """

    path: Path
    encoding: Encoding
    parser: RowParser
    group: Group
    kept: tuple[int, ...]
    first_data_line: int
    names: str | None = None
    above: tuple[str, ...] = ()
    texts: tuple[tuple[int, str], ...] = ()
    """Fields of text and their names."""
    log: TextLog = field(default_factory=TextLog)
    content: ContentDigest = field(default_factory=ContentDigest)
    unnamed: bool = False
    """Whether the last field has no name and no value in the first lines: one further down is text."""

    def blocks(self, report: Report) -> Iterator[Block]:
        """The rows in blocks; what is odd in them is reported at the end."""
        above, clock = frozenset(filter(None, map(self._plain, self.above))), self.group.clock
        time = self.kept[clock.index] if isinstance(clock, TimeColumn) else None
        rows = RowFilter(self.parser, self._plain(self.names), above, time)
        names = dict(zip(self.kept, (channel.name for channel in self.group.channels), strict=True))
        named = tuple(names.get(j, f"col{j}") for j in range(self.parser.fields))
        cells = CellFilter(self.parser, named, self.encoding.name)
        points = LateDecimalMark(self.parser, self.kept)
        ends_given = re.compile(rb"[^%b\s][ \t\r]*$" % re.escape(self.parser.separator.encode()), re.MULTILINE)
        group, part, start = self.group, 1, 0
        for piece in self._pieces(rows, report):
            columns = piece.columns
            if columns is None:
                columns = piece.parsed(self.parser)
                cells.judge(piece, columns, self.kept)
            points.look(piece)
            if piece.header_line:
                part, start = part + 1, 0
                group = replace(group, name=f"{self.group.name} part {part}")
                goes_on = "" if time is None else f"; time starts again at {columns[time][0]:g}"
                message = f"the header comes again{goes_on}; what follows is kept as a recording of its own"
                place = f"line {piece.header_line}"
                report(Finding("repeated_header", None, place, f"{message}, {group.name!r}"))
            last = self.parser.fields - 1
            behind = [(last, f"col{last}")] if self.unnamed and ends_given.search(piece.text) else []
            for i, name in (*self.texts, *behind):
                self._take_texts(piece.text, i, group.name, name, start)
            yield Block(group, tuple(columns[j] for j in self.kept), start, piece.lines, piece.bytes_read)
            start += len(columns[0])
        for judge in (rows, cells, points):
            judge.report(report)

    def _take_texts(self, text: bytes, field_of_text: int, group: str, name: str, start: int) -> None:
        """Note the texts of a field of regular rows where they change; ``start`` is the first row's sample."""
        data = np.frombuffer(text, dtype=np.uint8)
        begins, ends = (places[field_of_text :: self.parser.fields] for places in self.parser.cells(text))
        widths = np.minimum(ends - begins, _COMPARED)
        places = begins[:, None] + np.arange(widths.max())
        shown = np.where(places < ends[:, None], data[np.minimum(places, len(data) - 1)], 0)
        changes = (shown[1:] != shown[:-1]).any(axis=1) | (widths[1:] == _COMPARED)
        encoding = self.encoding.name_in_blocks
        for row in map(int, np.flatnonzero(np.concatenate(([True], changes)))):
            cell = text[begins[row] : ends[row]].strip(b" \t\r").decode(encoding, "backslashreplace")
            if not self.log.take(group, name, start + row, cell):
                return

    def _pieces(self, rows: RowFilter, report: Report) -> Iterator[RegularRows]:
        """Regular rows: as they are where the whole block parses to finite numbers, else made regular."""
        before, line = b"", self.first_data_line
        blocks = read_blocks(self.path, self.encoding, self.first_data_line, counted=False, content=self.content)
        known = self.parser.separator != " " and self.parser.dialect.decimal in (".", ",")
        is_long = known and self.path.stat().st_size >= LONG_BYTES  # worth the start of the compiled loop
        loop = FastParser(self.parser, self.kept).columns if is_long else lambda plain: None
        for block, plain, columns in in_order(partial(self._parse, loop), blocks):
            if block.rest:
                plain, finding = last_row(self.parser, self.parser.plain(block.rest), before, line, rows.time)
                columns = None
                if finding is not None:
                    report(finding)
            before = plain or before
            if columns is not None:
                yield RegularRows(plain, range(line, line + len(columns[0])), 0, (), columns, block.bytes_read)
            elif plain:
                for piece in rows.pieces(plain, line):
                    yield replace(piece, bytes_read=block.bytes_read)
            line += count_lines(block.text) if columns is None else len(columns[0])

    def _parse(
        self, fast_columns: Callable[[bytes], Columns | None], block: TextBlock
    ) -> tuple[TextBlock, bytes, Columns | None]:
        """The block as plain text, and its columns if every cell that is kept is a finite number."""
        plain = self.parser.plain(block.text)
        columns = fast_columns(plain) if plain else None
        if plain and columns is None:
            columns = self.parser.columns(plain)
            if columns is not None and not all(_finite(columns[j]) for j in self.kept):
                columns = None
        return block, plain, columns

    def _plain(self, line: str | None) -> bytes | None:
        if line is None:
            return None
        return self.parser.plain(line.encode(self.encoding.name_in_blocks, "replace") + b"\n").strip()


def _finite(column: Samples) -> bool:
    """Whether all values are finite; a sum that overflows is looked at closer."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = column.sum()
    return bool(np.isfinite(total) or np.isfinite(column).all())


@dataclass(frozen=True)
class MultipleTimeColumns:
    """The ``groups`` of one table, and the places of each one's columns in it."""

    groups: tuple[Group, ...]
    places: tuple[tuple[int, ...], ...]

    @property
    def finding(self) -> Finding:
        """That there are several clocks."""
        listed = ", ".join(repr(group.channels[0].name) for group in self.groups)
        message = f"columns of time: {listed}; each is taken as the clock of those behind it, in a group of its own"
        return Finding("several_clocks", None, None, message)

    def split(self, read: Read) -> Read:
        """``read`` with the columns of each group for itself, up to the last row in which one of them holds a value."""

        def blocks(report: Report) -> Iterator[Block]:
            parts: list[_Part] = []
            seen: Counter[str] = Counter()
            table = ""

            def report_values(finding: Finding) -> None:
                """Cells behind the end of a shorter group are no values that are missing."""
                if finding.code != "not_a_number" or seen[finding.channel or ""]:
                    report(finding)

            for block in read(report_values):
                if block.group.name != table:
                    table = block.group.name
                    parts = [
                        _Part(replace(group, name=f"{table} {number}"), places, seen)
                        for number, (group, places) in enumerate(zip(self.groups, self.places, strict=True), 1)
                    ]
                for part in parts:
                    yield from part.blocks(block)

        return blocks


def find_multiple_time_columns(
    group: Group, rows: Sequence[Sequence[str]], kept: Sequence[int], part_of: Callable[[str, Sequence[int]], Group]
) -> MultipleTimeColumns | None:
    """The groups in a table of these ``rows``, if it begins with a time, and others of this name have columns behind.

    ``kept`` are the fields of the channels of ``group``; ``part_of`` makes the group of a name and fields.
    """
    bases = [time_name_base(channel.label) for channel in group.channels]
    begins = [i for i, base in enumerate(bases) if base and base == bases[0]]
    if len(begins) < 2 or begins[0] or any(b - a < 2 for a, b in pairwise([*begins, len(bases)])):
        return None
    if any(all(len(row) <= kept[i] or is_missing(row[kept[i]]) for row in rows) for i in begins):
        return None
    places = tuple(tuple(range(a, b)) for a, b in pairwise([*begins, len(bases)]))
    parts = (part_of(f"{group.name} {n}", [kept[i] for i in own]) for n, own in enumerate(places, 1))
    return MultipleTimeColumns(tuple(parts), places)


@dataclass
class _Part:
    """One group as it is read: samples so far, and rows without a value that wait for one behind them.

    ``not_finite`` counts the cells of each channel that are no finite number.
    """

    group: Group
    places: tuple[int, ...]
    not_finite: Counter[str]
    samples: int = 0
    waiting: int = 0

    def blocks(self, block: Block) -> Iterator[Block]:
        """The group's share of a block of the table."""
        columns = [block.columns[i] for i in self.places]
        given = np.flatnonzero(~np.isnan(columns).all(axis=0))
        if not len(given):
            self.waiting += len(block)
            return
        while self.waiting:
            count = min(self.waiting, _MOST_ROWS)
            self.waiting -= count
            yield self._next([np.full(count, np.nan) for _ in columns], None, block.bytes_read)
        end = int(given[-1]) + 1
        self.waiting = len(block) - end
        lines = None if block.lines is None else block.lines[:end]
        yield self._next([column[:end] for column in columns], lines, block.bytes_read)

    def _next(self, columns: list[Samples], lines: "range | NDArray[np.int64] | None", bytes_read: int) -> Block:
        start, self.samples = self.samples, self.samples + len(columns[0])
        for channel, column in zip(self.group.channels, columns, strict=True):
            self.not_finite[channel.name] += int((~np.isfinite(column)).sum())
        return Block(self.group, tuple(columns), start, lines, bytes_read)
