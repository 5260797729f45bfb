"""LabVIEW measurement files (``.lvm``): a header of the file, then segments, each with a header and rows of text.

One fast pass finds the headers: lines that begin with a letter or a star. A segment's header states channels, units,
samples, and for each channel start and step of its abscissa, or the abscissae are columns (``X_Columns``). Channels
that share abscissa and number of samples are a group. Rows beyond the declared number are further blocks of a trigger,
appended without a header: each is a group of its own, ``NAME part 2``, ... The keys are those of National
Instruments' "Specification for the LabVIEW Measurement File (.lvm)".
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Channel, Clock, Finding, Group, Recording, Report, Samples, TimeColumn, UniformClock
from . import header_claims
from .csv.dialect import Dialect
from .csv.irregular_rows import CellFilter, RegularRows, RowFilter, last_row
from .csv.row_parser import RowParser
from .csv.text_blocks import Encoding, detect_encoding, read_blocks, read_first_lines
from .format_findings import damaged
from .header_claims import clock_of_step, recorded_time
from .registry import ReadOptions

END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_LETTERS = np.frombuffer(b"*ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz", dtype=np.uint8)
_NUMBER_WORD = re.compile(r"(?:nan|inf)", re.IGNORECASE)
_MOST_HEADER_LINES = 200_000


@dataclass(frozen=True)
class Header:
    """The lines of one header, and the file's lines (from 1) of the data below it: ``first`` to before ``end``."""

    lines: tuple[str, ...]
    first: int
    end: int


def find_headers(path: Path, encoding: Encoding) -> list[Header]:
    """The header of the file, then that of each segment with the lines of its data."""
    words, total = _lines_of_words(path, encoding)
    found: list[Header] = []
    begin = 0
    for i, (number, text) in enumerate(words):
        names_follow = i + 1 < len(words) and words[i + 1][0] == number + 1 and words[i + 1][1].startswith("X_Value")
        if not text.startswith(END):
            continue
        last = i + 2 if names_follow else i + 1
        end = words[last][0] if last < len(words) else total + 1
        found.append(Header(tuple(t for _, t in words[begin:last]), words[last - 1][0] + 1, end))
        begin = last
    if not found:
        raise damaged(path, f"no {END} in it; expected one below the header")
    return found


def _lines_of_words(path: Path, encoding: Encoding) -> tuple[list[tuple[int, str]], int]:
    """The lines that begin with a letter or a star, special blocks left out; and how many lines there are."""
    words: list[tuple[int, str]] = []
    total, skipping = 0, False
    for number, raw in _candidates(path, encoding):
        total = number
        text = raw.decode("latin-1" if not encoding.keeps_ascii else encoding.name, "replace").rstrip("\r\n")
        if text.startswith(_SPECIAL):
            skipping = text.startswith(_SPECIAL[0])
        elif text and not skipping and not _NUMBER_WORD.match(text):
            words.append((number, text))
        if len(words) > _MOST_HEADER_LINES:
            raise damaged(path, f"more than {_MOST_HEADER_LINES} lines of header; this is no LVM file")
    return words, total


def _candidates(path: Path, encoding: Encoding) -> Iterator[tuple[int, bytes]]:
    """Lines that begin with a letter or a star with their number; at last an empty one with the last number."""
    number = 0
    for lines in read_blocks(path, encoding, 1):
        text = lines.text + lines.rest
        data = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(data == ord("\n")) + 1
        starts = np.concatenate(([0], ends))[: len(ends) + bool(lines.rest)]
        for i in np.flatnonzero(np.isin(data[starts], _LETTERS)):
            yield lines.first + int(i), text[starts[i] : ends[i] if i < len(ends) else len(text)]
        number = lines.first + len(starts) - 1
    yield number, b""


_COMMENT = "Comment"


@dataclass(frozen=True)
class Settings:
    """What the file's header says of the text: separator, decimal mark, where the abscissae are."""

    dialect: Dialect
    x_columns: str
    pairs: dict[str, str]


@dataclass(frozen=True)
class Part:
    """Channels of one segment that share abscissa and number of samples; ``fields`` are their fields in a row.

    ``stated_rate_hz`` is the rate that the header states beside recorded abscissae.
    """

    group: Group
    fields: tuple[int, ...]
    declared: int | None
    stated_rate_hz: float | None = None


@dataclass(frozen=True)
class Segment:
    """One header with the data below it: file lines ``first`` to before ``end``."""

    form: RowParser
    parts: tuple[Part, ...]
    first: int
    end: int
    names: tuple[str, ...]
    pairs: dict[str, str]
    findings: tuple[Finding, ...]

    @property
    def declared(self) -> int | None:
        """Samples that the header declares: the most of any channel; None if it does not say."""
        return max((part.declared for part in self.parts if part.declared is not None), default=None)


def text_settings(path: Path, head: Header) -> Settings:
    """The settings in the header of the file."""
    separator = "\t" if "\t" in "".join(head.lines) else ","
    pairs = {key: cells[0] for key, *cells in (line.split(separator) for line in head.lines) if cells and cells[0]}
    if pairs.get("Separator", "Tab") not in ("Tab", "Comma"):
        raise damaged(path, f"Separator is {pairs['Separator']!r}; expected Tab or Comma")
    decimal = pairs.get("Decimal_Separator", ".") or "."
    if decimal not in ".,":
        raise damaged(path, f"Decimal_Separator is {decimal!r}; expected a point or a comma")
    return Settings(Dialect(separator, decimal), pairs.get("X_Columns", "No"), pairs)


def read_segment(path: Path, head: Header, settings: Settings, name: str) -> Segment:
    """The segment below ``head``; its groups are called ``name``, and by their channel where there are several."""
    split = settings.dialect.delimiter
    rows = {line.split(split)[0]: [cell.strip() for cell in line.split(split)[1:]] for line in head.lines}
    names = [cell.strip() for cell in head.lines[-1].split(split)]
    while names and names[-1] in ("", _COMMENT):
        names.pop()
    if "Channels" not in rows or not head.lines[-1].startswith("X_Value"):
        raise damaged(path, f"line {head.first - 1}: no Channels, or no line of names that begins with X_Value")
    pairs = _columns(settings.x_columns, len(names))
    if str(len(pairs)) != rows["Channels"][0]:
        message = f"{rows['Channels'][0]} channels are declared, {len(pairs)} are named"
        raise damaged(path, f"line {head.first - 1}: {message}")
    parts, findings = _parts(path, name, rows, names, pairs, settings)
    texts = {key: "; ".join(filter(None, cells)) for key, cells in rows.items() if any(cells) and key != "X_Value"}
    form = RowParser(settings.dialect, len(names))
    return Segment(form, parts, head.first, head.end, tuple(names), texts, tuple(findings))


def _columns(x_columns: str, fields: int) -> list[tuple[int | None, int]]:
    """For each channel the field of its abscissa, if it is recorded, and of its value."""
    if x_columns == "Multi":
        return [(i, i + 1) for i in range(0, fields - 1, 2)]
    return [(0 if x_columns == "One" else None, i) for i in range(1, fields)]


def _parts(
    path: Path,
    name: str,
    rows: dict[str, list[str]],
    names: Sequence[str],
    columns: Sequence[tuple[int | None, int]],
    settings: Settings,
) -> tuple[tuple[Part, ...], list[Finding]]:
    """Channels gathered by abscissa and number of samples."""
    gathered: dict[tuple[int | None, tuple[str, ...]], list[int]] = {}
    keys = ("Samples", "X0", "Delta_X", "X_Dimension", "X_Unit_Label")
    for i, (x, _) in enumerate(columns):
        gathered.setdefault((x, tuple(_cell(rows, key, i) for key in keys)), []).append(i)
    parts, findings = [], []
    for (x, texts), members in gathered.items():
        stated = dict(zip(keys, texts, strict=True))
        channels = [Channel(names[columns[i][1]], _cell(rows, "Y_Unit_Label", i) or None) for i in members]
        clock = _clock(path, stated, settings.dialect.decimal, x)
        fields = [columns[i][1] for i in members]
        if x is not None:
            channels, fields = [Channel(names[x], stated["X_Unit_Label"] or None), *channels], [x, *fields]
        elif isinstance(clock, UniformClock):
            findings += header_claims.step_findings(stated["Delta_X"], "Delta_X")
        title = name if len(gathered) == 1 else f"{name} {names[columns[members[0]][1]]}"
        declared = _count(path, stated["Samples"]) if stated["Samples"] else None
        rate = None if x is None else _declared_rate(stated, settings.dialect.decimal, clock)
        parts.append(Part(Group(title, tuple(channels), clock), tuple(fields), declared, rate))
    return tuple(parts), list(dict.fromkeys(findings))


def _cell(rows: dict[str, list[str]], key: str, i: int) -> str:
    cells = rows.get(key, [])
    return cells[i] if i < len(cells) else ""


def _clock(path: Path, stated: dict[str, str], decimal: str, x: int | None) -> Clock | None:
    if stated["X_Dimension"] not in ("", "Time"):
        return None
    recorded = recorded_time(0, stated["X_Unit_Label"])
    if x is not None:
        return recorded
    start, step = _start_and_step(path, stated, decimal)
    factor = recorded.seconds_per_unit
    return None if factor is None else clock_of_step(step * factor, start * factor)


def _declared_rate(stated: dict[str, str], decimal: str, clock: Clock | None) -> float | None:
    """The rate of Delta_X with recorded abscissae [Hz]; None if it states none."""
    factor = clock.seconds_per_unit if isinstance(clock, TimeColumn) else None
    with suppress(ValueError):
        declared = clock_of_step(float(stated["Delta_X"].replace(decimal, ".")) * (factor or 0.0), 0.0)
        return None if declared is None else declared.rate_hz
    return None


def _start_and_step(path: Path, stated: dict[str, str], decimal: str) -> tuple[float, float]:
    """X0 and Delta_X, in the unit of the abscissa; 0 where they are not stated."""
    try:
        start, step = (float((stated[key] or "0").replace(decimal, ".")) for key in ("X0", "Delta_X"))
    except ValueError as error:
        raise damaged(path, f"X0 {stated['X0']!r} or Delta_X {stated['Delta_X']!r} is no number") from error
    return start, step


def _count(path: Path, text: str) -> int:
    if not text.isascii() or not text.isdecimal() or len(text) > 15:
        raise damaged(path, f"Samples is {text!r}; expected a number of samples")
    return int(text)


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
    """The rows of one segment: parsed, checked, and counted on across blocks.

    After as many rows as the header declares, the next block of them begins: ``part 2``, ``part 3``, ...
    """

    segment: Segment
    encoding: str
    split: bool
    rows: int = 0

    def __post_init__(self) -> None:
        self._rows = RowFilter(self.segment.form, None)
        self._cells = CellFilter(self.segment.form, self.segment.names, self.encoding)

    def blocks(self, text: bytes, first_line: int, bytes_read: int) -> Iterator[Block]:
        """Whole lines of this segment, each with its line feed, as blocks of its groups."""
        form = self.segment.form
        plain = without_comments(form.plain(text), form)
        for piece in self._rows.pieces(plain, first_line):
            columns = form.columns(piece.text)
            if columns is None:
                raise RuntimeError(f"rows from line {piece.lines[0]} on are regular, but do not parse")
            yield from self._cut(piece, [_writable(c) for c in columns], bytes_read)

    def _cut(self, piece: RegularRows, columns: list[Samples], bytes_read: int) -> Iterator[Block]:
        """Check the cells, then split at the borders of appended blocks."""
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
        self._rows.report(report)
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
    found = find_headers(path, encoding)
    stated = text_settings(path, found[0])
    if len(found) == 1:
        raise damaged(path, "the header of the file stands alone: no segment with channels below it")
    names = [path.stem, *(f"{path.stem} segment {i}" for i in range(2, len(found)))]
    segments = [read_segment(path, head, stated, name) for head, name in zip(found[1:], names, strict=True)]
    file = _File(path, encoding, tuple(map(_joined_writes, segments)))
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


def _joined_writes(segment: Segment) -> Segment:
    """A segment with very many blocks under one header was written in pieces: one group, and no rate is known."""
    declared, rows = segment.declared, segment.end - segment.first
    if not declared or rows <= _MOST_BLOCKS * declared or _has_recorded_abscissa(segment):
        return segment
    parts = tuple(replace(p, group=replace(p.group, clock=None), declared=None) for p in segment.parts)
    message = (
        f"{declared} samples are declared, about {rows} follow under one header: they were written in pieces, and are "
        "kept as one group; whether time passed between the pieces cannot be told, so that there is no rate"
    )
    finding = Finding("appended_blocks", None, f"line {segment.first}", message)
    return replace(segment, parts=parts, findings=(*segment.findings, finding))


def _has_recorded_abscissa(segment: Segment) -> bool:
    return any(isinstance(part.group.clock, TimeColumn) for part in segment.parts)


@dataclass(frozen=True)
class _File:
    """The segments of one file, read in turn."""

    path: Path
    encoding: Encoding
    segments: tuple[Segment, ...]

    def blocks(self, report: Report) -> Iterator[Block]:
        """The rows of all segments in blocks; what is odd in them is reported at the end."""
        todo = [SegmentRows(s, self.encoding.name, not _has_recorded_abscissa(s)) for s in self.segments]
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
