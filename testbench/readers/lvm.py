"""LabVIEW measurement files (``.lvm``): a header of the file, then segments, each with a header and rows of text.

One fast pass finds the headers: lines that begin with a letter or a star. A segment's header states channels, units,
samples, and for each channel start and step of its abscissa, or the abscissae are columns (``X_Columns``). Channels
that share abscissa and number of samples are a group. Rows beyond the declared number are further blocks of a trigger,
appended without a header: each is a group of its own, ``NAME part 2``, ... The keys are those of National
Instruments' "Specification for the LabVIEW Measurement File (.lvm)".
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..recording import (
    Block,
    Channel,
    Clock,
    Finding,
    Group,
    Recording,
    Report,
    TextLog,
    TimeColumn,
    UniformClock,
)
from . import header_claims
from .csv.dialect import Dialect
from .csv.irregular_rows import CellFilter, RowFilter, last_row
from .csv.row_parser import RowParser
from .csv.text_blocks import Encoding, detect_encoding, read_blocks, read_first_lines
from .format_findings import damaged
from .header_claims import clock_of_step, recorded_time
from .registry import ReadOptions

_END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_LETTERS = np.frombuffer(b"*ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz", dtype=np.uint8)
_NUMBER_WORD = re.compile(r"(?:nan|inf)", re.IGNORECASE)
_MOST_HEADER_LINES = 200_000
_COMMENT = "Comment"
_MOST_BLOCKS = 100
"""More blocks without header than this are no triggered recordings, but writes in pieces."""


@dataclass(frozen=True)
class Header:
    """The lines of one header, and the file's lines (from 1) of the data below it: ``first`` to before ``end``."""

    lines: tuple[str, ...]
    first: int
    end: int


def _headers(path: Path, encoding: Encoding) -> list[Header]:
    words, total, skipping = list[tuple[int, str]](), 0, False  # lines that begin with a letter or a star
    name = encoding.name if encoding.keeps_ascii else "latin-1"
    for lines in read_blocks(path, encoding, 1):
        content = lines.text + lines.rest
        data = np.frombuffer(content, dtype=np.uint8)
        ends = np.flatnonzero(data == ord("\n")) + 1
        starts = np.concatenate(([0], ends))[: len(ends) + bool(lines.rest)]
        for i in map(int, np.flatnonzero(np.isin(data[starts], _LETTERS))):
            raw = content[starts[i] : ends[i] if i < len(ends) else len(content)]
            text = raw.decode(name, "replace").rstrip("\r\n")
            if text.startswith(_SPECIAL):
                skipping = text.startswith(_SPECIAL[0])
            elif text and not skipping and not _NUMBER_WORD.match(text):
                words.append((lines.first + i, text))
        total = lines.first + len(starts) - 1
        if len(words) > _MOST_HEADER_LINES:
            raise damaged(path, f"more than {_MOST_HEADER_LINES} lines of header; this is no LVM file")
    words.append((total + 1, ""))
    found, begin = list[Header](), 0
    for i, (number, text) in enumerate(words):
        if text.startswith(_END):
            following, behind = words[i + 1]
            last = i + 2 if following == number + 1 and behind.startswith("X_Value") else i + 1
            found.append(Header(tuple(t for _, t in words[begin:last]), words[last - 1][0] + 1, words[last][0]))
            begin = last
    if not found:
        raise damaged(path, f"no {_END} in it; expected one below the header")
    return found


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

    @property
    def has_recorded_abscissa(self) -> bool:
        """Whether a time column says when each sample was taken, so that further rows are no other recording."""
        return any(isinstance(part.group.clock, TimeColumn) for part in self.parts)


def _segment(path: Path, head: Header, dialect: Dialect, file: Mapping[str, str], name: str, encoding: str) -> Segment:
    """The segment below ``head``; its groups are called ``name``, and by their channel where there are several.

    ``file`` are the keys of the file's header that hold for it: of its first segment the start too.
    """
    split = dialect.delimiter
    rows = {line.split(split)[0]: [cell.strip() for cell in line.split(split)[1:]] for line in head.lines}
    names = [cell.strip() for cell in head.lines[-1].split(split)]
    while names and names[-1] in ("", _COMMENT):
        names.pop()
    x_columns = file.get("X_Columns", "No")
    if "Channels" not in rows or not head.lines[-1].startswith("X_Value"):
        raise damaged(path, f"line {head.first - 1}: no Channels, or no line of names that begins with X_Value")
    # for each channel the field of its abscissa, if it is recorded, and of its value
    columns: list[tuple[int | None, int]] = [(0 if x_columns == "One" else None, i) for i in range(1, len(names))]
    if x_columns == "Multi":
        columns = [(i, i + 1) for i in range(0, len(names) - 1, 2)]
    if str(len(columns)) != rows["Channels"][0]:
        message = f"{rows['Channels'][0]} channels are declared, {len(columns)} are named"
        raise damaged(path, f"line {head.first - 1}: {message}")
    parts, findings = _parts(path, name, rows, names, columns, dialect.decimal, file)
    texts = {key: "; ".join(filter(None, cells)) for key, cells in rows.items() if any(cells) and key != "X_Value"}
    form = RowParser(dialect, len(names), encoding=encoding)
    segment = Segment(form, parts, head.first, head.end, tuple(names), texts, tuple(findings))
    declared, count = segment.declared, head.end - head.first
    if not declared or count <= _MOST_BLOCKS * declared or segment.has_recorded_abscissa:
        return segment
    # very many blocks under one header were written in pieces: one group, and no rate is known
    joined = tuple(replace(p, group=replace(p.group, clock=None), declared=None) for p in parts)
    message = f"{declared} samples are declared, about {count} follow under one header: they were written in pieces, "
    message += (
        "and are kept as one group; whether time passed between the pieces cannot be told, so that there is no rate"
    )
    finding = Finding("appended_blocks", None, f"line {head.first}", message)
    return replace(segment, parts=joined, findings=(*findings, finding))


def _parts(
    path: Path,
    name: str,
    rows: Mapping[str, Sequence[str]],
    names: Sequence[str],
    columns: Sequence[tuple[int | None, int]],
    decimal: str,
    file: Mapping[str, str],
) -> tuple[tuple[Part, ...], list[Finding]]:
    """Channels gathered by abscissa and number of samples; ``file`` states the start of its first segment too."""
    keys = ("Samples", "X0", "Delta_X", "X_Dimension", "X_Unit_Label", "Y_Unit_Label", "Date", "Time")
    cells = [rows.get(key, []) for key in keys]
    # a cell above each value's column, blank ones above abscissae counted; some writers leave the blank ones out
    spaced = any(any(row[len(columns) :]) for row in cells)
    places = [y - 1 if spaced else i for i, (_, y) in enumerate(columns)]
    stated = [dict(zip(keys, (row[i] if i < len(row) else "" for row in cells), strict=True)) for i in places]
    gathered: dict[tuple[int | None, str], list[int]] = {}
    for i, (x, _) in enumerate(columns):
        gathered.setdefault((x, "\t".join(stated[i][key] for key in keys[:5])), []).append(i)
    parts, findings = [], []
    for (x, _), members in gathered.items():
        common, fields = stated[members[0]], [columns[i][1] for i in members]
        channels = [Channel(names[columns[i][1]], stated[i]["Y_Unit_Label"] or None) for i in members]
        clock, rate = _clock(path, common, decimal, x)
        if x is not None:
            channels, fields = [Channel(names[x], common["X_Unit_Label"] or None), *channels], [x, *fields]
        elif isinstance(clock, UniformClock):
            findings += header_claims.step_findings(common["Delta_X"], "Delta_X")
        title = name if len(gathered) == 1 else f"{name} {names[columns[members[0]][1]]}"
        count = common["Samples"]
        if count and (not count.isascii() or not count.isdecimal() or len(count) > 15):
            raise damaged(path, f"Samples is {count!r}; expected a number of samples")
        zero = header_claims.start_in(common if common["Date"] else file, "Date", "Time")
        group = Group(title, tuple(channels), clock, zero)
        parts.append(Part(group, tuple(fields), int(count) if count else None, rate))
    return tuple(parts), list(dict.fromkeys(findings))


def _clock(path: Path, stated: Mapping[str, str], decimal: str, x: int | None) -> tuple[Clock | None, float | None]:
    """The clock of X0 and Delta_X, or of recorded abscissae with the rate that Delta_X states beside them [Hz]."""
    recorded = recorded_time(0, stated["X_Unit_Label"]) if stated["X_Dimension"] in ("", "Time") else None
    factor = None if recorded is None else recorded.seconds_per_unit
    numbers = [stated[key].replace(decimal, ".") for key in ("X0", "Delta_X")]
    if x is not None:
        with suppress(ValueError):
            if (declared := clock_of_step(float(numbers[1]) * (factor or 0.0), 0.0)) is not None:
                return recorded, declared.rate_hz
        return recorded, None
    if recorded is None:
        return None, None
    try:
        start, step = (float(number or "0") for number in numbers)
    except ValueError as error:
        raise damaged(path, f"X0 {stated['X0']!r} or Delta_X {stated['Delta_X']!r} is no number") from error
    return None if factor is None else clock_of_step(step * factor, start * factor), None


def _without_comments(text: bytes, form: RowParser) -> tuple[bytes, dict[int, str]]:
    """Rows with what stands behind their last column cut off: a comment, or a separator alone.

    Comments that say something are given too, by the index of their row.
    """
    data = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(data == ord("\n"))
    separators = np.flatnonzero(data == ord(form.separator))
    upto = np.searchsorted(separators, ends)
    before = np.concatenate(([0], upto[:-1]))
    long = np.flatnonzero(upto - before >= form.fields)
    if not len(long):
        return text, {}
    begins = separators[before[long] + form.fields - 1]
    change = np.zeros(len(data) + 1, dtype=np.int8)
    change[begins] = 1
    change[ends[long]] = -1
    places = zip(long.tolist(), begins, ends[long], strict=True)
    said = {row: text[begin:end].strip(b"\t, \r").decode(form.encoding, "replace") for row, begin, end in places}
    return data[np.cumsum(change[:-1]) == 0].tobytes(), {row: words for row, words in said.items() if words}


@dataclass
class SegmentRows:
    """The rows of one segment: parsed, checked, and counted on across blocks.

    After as many rows as the header declares, the next block of them begins: ``part 2``, ``part 3``, ...
    """

    segment: Segment
    encoding: str
    texts: TextLog
    rows: int = 0

    def __post_init__(self) -> None:
        self._rows = RowFilter(self.segment.form, None)
        self._cells = CellFilter(self.segment.form, self.segment.names, self.encoding)

    def blocks(self, text: bytes, first_line: int, bytes_read: int) -> Iterator[Block]:
        """Whole lines of this segment, each with its line feed, as blocks of its groups, parted where others begin."""
        form, parts = self.segment.form, self.segment.parts
        every = 0 if self.segment.has_recorded_abscissa else self.segment.declared or 0
        plain, comments = _without_comments(form.plain(text), form)
        said = {first_line + row: words for row, words in comments.items()}
        for piece in self._rows.pieces(plain, first_line):
            columns = [c if c.flags.writeable else c.copy() for c in piece.parsed(form)]
            lines = np.asarray(piece.lines)
            index = self.rows + np.arange(len(lines))
            within = index % every if every else index
            for part in parts:  # channels that have ended before others have empty cells, which are none of theirs
                if every and part.declared is not None:
                    for j in part.fields:
                        columns[j][within >= part.declared] = 0.0
            self._cells.judge(piece, columns, sorted({j for part in parts for j in part.fields}))
            inner = np.flatnonzero(within == 0).tolist() if every else []
            for begin, end in pairwise([0, *(i for i in inner if i), len(lines)]):
                number, start = (int(index[begin]) // every, int(within[begin])) if every else (0, int(index[begin]))
                for part in parts:
                    stop = min(end, begin + max(0, (part.declared or every) - start)) if every else end
                    if stop <= begin:
                        continue
                    name = f"{part.group.name} part {number + 1}" if number else part.group.name
                    group = replace(part.group, name=name, zero=None if number else part.group.zero)
                    for i, line in enumerate(lines[begin:stop].tolist() if said and part is parts[0] else ()):
                        if line in said or line - 1 in said:
                            self.texts.take(name, _COMMENT, start + i, said.get(line, ""))
                    data = tuple(columns[j][begin:stop] for j in part.fields)
                    yield Block(group, data, start, lines[begin:stop], bytes_read)
            self.rows += len(lines)

    def report(self, report: Report) -> None:
        """Report what was odd in rows and cells, and in the number of rows against the declared one."""
        self._rows.report(report)
        self._cells.report(report)
        declared, found = self.segment.declared, self.rows
        if not declared or found == declared:
            return
        code, message = "appended_blocks", f"declared {declared} samples, found {found}"
        if self.segment.has_recorded_abscissa and not found % declared and found > declared:
            message += "; their abscissae are recorded, so they are one group"
        elif not found % declared and found > declared:
            message += f": {found // declared} blocks, the later ones appended without a header; each is a group of "
            message += "its own, the time between them is not known"
        else:
            code = "count_contradiction"
        report(Finding(code, None, f"line {self.segment.first}", message))


def open_lvm(path: Path, options: ReadOptions) -> Recording:
    """Find and read all headers; the rows are read when asked for."""
    with path.open("rb") as stream:
        start = stream.read(1 << 16).replace(b"LabVIEW Measurement", b"LVM", 1)
    stated = options.encoding
    encoding = Encoding(stated) if stated else detect_encoding(start) or read_first_lines(path)[0]
    head, *found = _headers(path, encoding)
    separator = "\t" if "\t" in "".join(head.lines) else ","
    metadata = {key: cells[0] for key, *cells in (line.split(separator) for line in head.lines) if cells and cells[0]}
    if metadata.get("Separator", "Tab") not in ("Tab", "Comma"):
        raise damaged(path, f"Separator is {metadata['Separator']!r}; expected Tab or Comma")
    decimal = metadata.get("Decimal_Separator", ".") or "."
    if decimal not in ".,":
        raise damaged(path, f"Decimal_Separator is {decimal!r}; expected a point or a comma")
    if not found:
        raise damaged(path, "the header of the file stands alone: no segment with channels below it")
    names = [path.stem, *(f"{path.stem} segment {i}" for i in range(2, len(found) + 1))]
    files = [dict(metadata), *[{"X_Columns": metadata.get("X_Columns", "No")}] * (len(found) - 1)]
    segments = [
        _segment(path, each, Dialect(separator, decimal), file, name, encoding.name_in_blocks)
        for each, file, name in zip(found, files, names, strict=True)
    ]
    for i, segment in enumerate(segments, 1):
        metadata |= {key if len(found) == 1 else f"segment {i}: {key}": text for key, text in segment.pairs.items()}
    texts = TextLog()
    rates = {part.stated_rate_hz for each in segments for part in each.parts if part.stated_rate_hz is not None}
    return Recording(
        path=path,
        format="LabVIEW LVM",
        reader="testbench.readers.lvm",
        groups=tuple(part.group for each in segments for part in each.parts),
        read=lambda report: _blocks(path, encoding, segments, texts, report),
        texts=texts,
        settings={"encoding": encoding.name, "decimal": decimal},
        metadata=metadata,
        stated_rate_hz=rates.pop() if len(rates) == 1 else None,
        findings=tuple(finding for each in segments for finding in each.findings),
    )


def _blocks(
    path: Path, encoding: Encoding, segments: Sequence[Segment], texts: TextLog, report: Report
) -> Iterator[Block]:
    """The rows of all segments in blocks; what is odd in them is reported at the end."""
    todo, before = [SegmentRows(segment, encoding.name, texts) for segment in segments], b""
    for lines in read_blocks(path, encoding, segments[0].first):
        text = lines.text
        if lines.rest:
            # A last row without line end; one with a comment is whole, one that ends empty is not.
            form = segments[-1].form
            plain, separator = form.plain(lines.rest), form.separator.encode()
            cells = plain.split(separator)
            whole = separator.join(cells[: form.fields]) + b"\r"
            text, finding = last_row(
                form, whole if len(cells) > form.fields else plain.rstrip(separator), before, lines.first
            )
            if finding is not None:
                report(finding)
        before = text[-65536:]
        offsets = np.concatenate(([0], np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")) + 1))
        for rows in todo:  # the part of these lines that lies in each segment
            begin = max(rows.segment.first, lines.first)
            end = min(rows.segment.end, lines.first + len(offsets) - 1)
            if begin < end:
                piece = text[offsets[begin - lines.first] : offsets[end - lines.first]]
                yield from rows.blocks(piece, begin, lines.bytes_read)
    for rows in todo:
        rows.report(report)
