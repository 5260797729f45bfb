"""Reader of LabVIEW measurement files: both styles of header, several segments, blocks appended without a header.

Rows of an LVM segment as blocks of columns, and each part of its channels as a group.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...recording import Block, Finding, Group, Recording, Report, Samples, TimeColumn
from ..byte_source import damaged
from ..csv.irregular_rows import CellFilter, RegularRows, RowFilter, last_row
from ..csv.row_parser import RowParser
from ..csv.text_blocks import Encoding, detect_encoding, read_blocks, read_first_lines
from ..registry import ReadOptions
from .header import Segment, heads, segment, settings


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


_MAGIC = b"LabVIEW Measurement"
_MOST_BLOCKS = 100
"""More blocks without header than this are no triggered recordings, but writes in pieces."""


def open_lvm(path: Path, options: ReadOptions) -> Recording:
    """Find and read all headers; the rows are read when asked for."""
    encoding = Encoding(options.encoding) if options.encoding else _encoding(path)
    found = heads(path, encoding)
    stated = settings(path, found[0])
    if len(found) == 1:
        raise damaged(path, "the header of the file stands alone: no segment with channels below it")
    names = [path.stem, *(f"{path.stem} segment {i}" for i in range(2, len(found)))]
    segments = [segment(path, head, stated, name) for head, name in zip(found[1:], names, strict=True)]
    file = _File(path, encoding, tuple(map(_in_pieces, segments)))
    metadata = dict(stated.pairs)
    for i, each in enumerate(segments, 1):
        metadata |= {key if len(segments) == 1 else f"segment {i}: {key}": text for key, text in each.pairs.items()}
    return Recording(
        path=path,
        format="LabVIEW LVM",
        reader="testbench.readers.lvm",
        groups=tuple(part.group for each in file.segments for part in each.parts),
        read=file.blocks,
        settings={"encoding": encoding.name, "decimal": stated.dialect.decimal},
        metadata=metadata,
        stated_rate_hz=_stated_rate(segments),
        findings=tuple(finding for each in file.segments for finding in each.findings),
    )


def _stated_rate(segments: Sequence[Segment]) -> float | None:
    """The rate that headers state beside recorded abscissae, if it is one for the whole file [Hz]."""
    rates = {part.stated_rate_hz for each in segments for part in each.parts if part.stated_rate_hz is not None}
    return rates.pop() if len(rates) == 1 else None


def _encoding(path: Path) -> Encoding:
    with path.open("rb") as stream:
        head = stream.read(1 << 16)
    return detect_encoding(head.replace(_MAGIC, b"LVM", 1)) or read_first_lines(path).encoding


def _in_pieces(segment: Segment) -> Segment:
    """A segment with very many blocks under one header was written in pieces: one group, and no rate is known."""
    declared, rows = segment.declared, segment.end - segment.first
    if not declared or rows <= _MOST_BLOCKS * declared or _recorded(segment):
        return segment
    parts = tuple(replace(p, group=replace(p.group, clock=None), declared=None) for p in segment.parts)
    message = (
        f"{declared} samples are declared, about {rows} follow under one header: they were written in pieces, and are "
        "kept as one group; whether time passed between the pieces cannot be told, so that there is no rate"
    )
    finding = Finding("appended_blocks", None, f"line {segment.first}", message)
    return replace(segment, parts=parts, findings=(*segment.findings, finding))


def _recorded(segment: Segment) -> bool:
    return any(isinstance(part.group.clock, TimeColumn) for part in segment.parts)


@dataclass(frozen=True)
class _File:
    """The segments of one file, read in turn."""

    path: Path
    encoding: Encoding
    segments: tuple[Segment, ...]

    def blocks(self, report: Report) -> Iterator[Block]:
        """The rows of all segments in blocks; what is odd in them is reported at the end."""
        todo = [SegmentRows(s, self.encoding.name, not _recorded(s)) for s in self.segments]
        before = b""
        for lines in read_blocks(self.path, self.encoding, self.segments[0].first):
            if lines.rest:
                text, finding = _last_row(todo[-1].segment.form, lines.rest, before, lines.first)
                if finding is not None:
                    report(finding)
            else:
                text, before = lines.text, lines.text[-65536:]
            if text:
                yield from _blocks_of(text, lines.first, todo, lines.bytes_read)
        for rows in todo:
            rows.report(report)
            _report_count(rows, report)


def _last_row(form: RowParser, rest: bytes, before: bytes, line: int) -> tuple[bytes, Finding | None]:
    """A last row without line end; one with a comment is whole, one that ends empty is not."""
    plain, separator = form.plain(rest), form.separator.encode()
    cells = plain.split(separator)
    whole = len(cells) > form.fields
    return last_row(
        form, separator.join(cells[: form.fields]) + b"\r" if whole else plain.rstrip(separator), before, line
    )


def _blocks_of(text: bytes, first: int, todo: Sequence[SegmentRows], bytes_read: int) -> Iterator[Block]:
    """The part of a block of lines that lies in each segment."""
    offsets = np.concatenate(([0], np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")) + 1))
    for rows in todo:
        begin, end = max(rows.segment.first, first), min(rows.segment.end, first + len(offsets) - 1)
        if begin < end:
            yield from rows.blocks(text[offsets[begin - first] : offsets[end - first]], begin, bytes_read)


def _report_count(rows: SegmentRows, report: Report) -> None:
    """The number of rows against the number that the header declares."""
    declared, found = rows.segment.declared, rows.rows
    if not declared or found == declared:
        return
    where = f"line {rows.segment.first}"
    if found % declared or found < declared:
        message = f"declared {declared} samples, found {found}"
        report(Finding("count_contradiction", None, where, message))
    elif rows.split:
        message = (
            f"declared {declared} samples, found {found}: {found // declared} blocks, the later ones appended without "
            "a header; each is a group of its own, the time between them is not known"
        )
        report(Finding("appended_blocks", None, where, message))
    else:
        message = f"declared {declared} samples, found {found}; their abscissae are recorded, so they are one group"
        report(Finding("appended_blocks", None, where, message))
