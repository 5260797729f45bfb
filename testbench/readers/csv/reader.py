"""Reader of text with delimiters: comma, semicolon, tab, bar or blanks; decimal point or comma."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from ...recording import Block, Clock, Finding, Group, Recording, Refusal, Report, TextLog, TimeColumn
from .. import header_claims
from ..header_claims import comment_text, key_value_pairs, sensor_ranges, stated_sampling
from ..registry import ReadOptions
from .cell_syntax import is_missing, is_number_like
from .dialect import Dialect, UnclearDialect, detect_dialect, settles
from .header import Header, read_header, stated_header, time_name_base, unknown_brackets
from .rewritten_columns import (
    NotationColumn,
    TimeColumns,
    across_midnight,
    find_notations,
    find_time_columns,
    rounded_numbers,
)
from .row_parser import RowParser
from .table import Table, find_multiple_time_columns
from .text_blocks import MOST_LINES, Encoding, first_line, read_first_lines, read_last_lines

_ROWS_AT_END = 100

Rows = Sequence[Sequence[str]]


def open_text(path: Path, options: ReadOptions) -> Recording:
    """Read the first lines of a text; its rows are read when asked for."""
    text = understood(path, options)
    kept, times = text.kept_fields, text.times
    comments = tuple(comment_text(line) for line in text.header.preamble)
    stated, start = stated_sampling(comments, text.dialect.decimal), header_claims.stated_start(comments)
    channels = times.channels(text.header.channels)

    def group_of(name: str, fields: Sequence[int], clock: Clock | None) -> Group:
        """The group of these fields; its time is zero as its column of time says, else as is stated above it."""
        zero = times.zero(channels, fields[clock.index]) if isinstance(clock, TimeColumn) else None
        return Group(name, tuple(channels[i] for i in fields), clock, zero or start)

    def part_of(name: str, fields: Sequence[int]) -> Group:
        """The group of these fields, where ``time 2`` is a name of time too."""
        named = [replace(c, label=time_name_base(c.label) or c.label) for c in channels]
        return group_of(name, fields, times.clock(named, fields))

    declared = header_claims.clock_of_rate(stated.rate_hz) if stated.rate_hz else None
    group = group_of(path.stem, kept, times.clock(channels, kept) or declared)
    multiple = None
    if options.description is None or not options.description.states_time:
        multiple = find_multiple_time_columns(group, text.rows, kept, part_of)
    texts = TextLog()
    table = text.table(group, kept, texts)
    of_day = [kept.index(column.field) for column in times.timestamps if column.is_of_day]

    def read(report: Report) -> Iterator[Block]:
        return across_midnight(table.blocks(report), of_day, report) if of_day else table.blocks(report)

    return Recording(
        path=path,
        format="CSV",
        reader="testbench.readers.csv",
        groups=multiple.groups if multiple else (group,),
        read=stated.checked(multiple.split(read) if multiple else read),
        origin=header_claims.stated_origin(comments),
        settings=text.settings,
        metadata=key_value_pairs(comments) | times.zeros(channels),
        comments=comments,
        ranges=sensor_ranges(comments),
        stated_rate_hz=stated.rate_hz,
        findings=(*text.findings, *stated.findings, *([multiple.finding] if multiple else [])),
        texts=texts,
        content=table.content,
    )


@dataclass(frozen=True)
class _Text:
    """A text as understood from its first ``lines`` and its last ones.

    ``rows`` and ``ends`` are the cells of its first rows and of its last lines. ``times`` and ``notations`` are the
    columns whose numbers are written in another way.
    """

    path: Path
    options: ReadOptions
    encoding: Encoding
    lines: Sequence[str]
    dialect: Dialect
    header: Header
    rows: Rows
    ends: Rows
    times: TimeColumns
    notations: tuple[NotationColumn, ...]

    @cached_property
    def fields_of_text(self) -> frozenset[int]:
        """Columns of text in all first rows that are not mostly numbers in the last ones, and times that stay unclear.

        A logger may write a word until its sensor is ready.
        """
        data = [cells for cells in self.rows if len(cells) == self.header.fields]
        ends = [cells for cells in self.ends if len(cells) == self.header.fields][-_ROWS_AT_END:]
        texts = {
            i
            for i in range(len(self.header.channels))
            if any(not is_missing(cells[i]) for cells in data)
            and not any(is_number_like(cells[i]) for cells in data)
            and 2 * sum(is_number_like(cells[i]) for cells in ends) <= len(ends)
        }
        return self.times.texts | texts - self._fields_of_numbers

    @cached_property
    def _fields_of_numbers(self) -> frozenset[int]:
        """The columns that become numbers, or are taken up by such."""
        return frozenset(column.field for column in (*self.times.columns, *self.notations)) | self.times.dates

    @property
    def kept_fields(self) -> tuple[int, ...]:
        """The fields that become channels. Raises Refusal if there are none, or the file holds notes."""
        words, texts = [cells[0] for cells in self.rows if len(cells) == self.header.fields], self.fields_of_text
        named = self.header.named and not self.header.channels[0].name.endswith((":", "="))
        # lines such as ``Payload 5``: no names above, each with another word before one number
        are_notes = not named and 0 in texts and self.header.fields == len(texts) + 1 and len(set(words)) == len(words)
        if self.options.header is None and are_notes:
            message = "a number behind other words on each line, as in notes; if they are data, say --no-header"
            raise Refusal(self.path.name, Finding("no_data", None, f"line {self.header.first_data_line}", message))
        kept = tuple(i for i in range(len(self.header.channels)) if i not in texts | self.times.dates)
        if not kept:
            message = "no column of numbers; expected rows of numbers"
            raise Refusal(self.path.name, Finding("no_data", None, None, message))
        return kept

    def table(self, group: Group, kept: tuple[int, ...], texts: TextLog) -> Table:
        """The rows below the header."""
        header, stated = self.header, self.options.description
        lines = self.lines[header.first_data_line - 1 :][:20]
        padded = any(line.endswith(" ") or any(text in line for text in (" ,", " ;", " |", " \t")) for line in lines)
        parser = RowParser(
            self.dialect, header.fields, padded, (*self.times.columns, *self.notations), self.times.dates,
            self.encoding.name_in_blocks, frozenset() if stated is None else stated.words,
        )  # fmt: skip
        return Table(
            self.path, self.encoding, parser, group, kept, header.first_data_line,
            names=header.lines[0] if header.lines else None, above=(*header.lines[1:], *header.preamble),
            texts=tuple((i, header.channels[i].name) for i in sorted(self.fields_of_text)), log=texts,
            unnamed=len(header.channels) < header.fields,
        )  # fmt: skip

    @property
    def settings(self) -> dict[str, str]:
        """How the text was read: as detected or stated; of dates only what a person stated."""
        found = {"encoding": self.encoding.name, "delimiter": self.dialect.delimiter, "decimal": self.dialect.decimal}
        found["first_data_line"] = str(self.header.first_data_line)
        order = self.options.date_order
        return found | ({"date_order": f"{order}, as stated"} if order else {})

    @property
    def findings(self) -> list[Finding]:
        """What was detected, and what of it was inferred; of columns in other notations, how they are read."""
        encoding, header = self.encoding, self.header
        row = f"line {header.first_data_line}"
        message = f"{self.dialect}, encoding {encoding.name}, first row of data in {row}"
        if header.named and (unnamed := [c.name for i, c in enumerate(header.channels) if c.name == f"col{i}"]):
            message += f"; columns without a name: {', '.join(unnamed)}"
        found = [Finding("dialect", None, None, message)]
        if encoding.inferred:
            message = f"read as {encoding.name}: {encoding.inferred}; --encoding says it otherwise"
            found.append(Finding("encoding_inferred", None, None, message))
        if self.dialect.doubt:
            message = f"{self.dialect.doubt}: decimals, or thousands? say --decimal"
            found.append(Finding("ambiguous_number", None, row, message))
        for i, channel in enumerate(header.channels):
            if i not in self._fields_of_numbers and (text := unknown_brackets(channel)):
                message = f"{text!r} in brackets is not understood as a unit; "
                message += "the name is kept as written, without a unit"
                found.append(Finding("unit_unknown", channel.name, None, message))
        if not header.named:
            message = "the first row is data: the columns are named col0, col1, ... and have no units"
            found.append(Finding("no_header", None, row, message))
        notations = [finding for column in self.notations for finding in column.findings]
        rounded = rounded_numbers([*self.rows, *self.ends], header, self.times.fields)
        return [*found, *self.times.findings, *notations, *rounded]


def understood(path: Path, options: ReadOptions) -> _Text:
    """The text at ``path``. Raises Refusal where its first lines have several readings, or hold no rows."""
    stated = options.description
    lines_stated = [] if stated is None else [*(stated.names or []), stated.units or 0, stated.data or 0]
    encoding, lines = read_first_lines(path, options.encoding, max([0, *lines_stated]))
    try:
        dialect = detect_dialect(lines, options.delimiter, options.decimal)
        if dialect.doubt:  # the first lines do not tell: perhaps a later one does
            told = first_line(path, encoding, lambda line: settles(line, dialect.delimiter))
            dialect = detect_dialect([*lines, *told], options.delimiter, options.decimal)
        if stated is None or (stated.names is None and stated.units is None and stated.data is None):
            header = read_header(lines, dialect, options.header)
        else:
            below = stated.units or stated.data or 1
            above = [i for i, line in enumerate(lines[: below - 1], 1) if line.strip()]
            names = above[-1:] if stated.names is None else stated.names
            header = stated_header(lines, dialect, names, stated.units, stated.data)
    except UnclearDialect as error:
        raise Refusal(path.name, Finding("unknown_dialect", None, None, str(error))) from error
    except LookupError as error:
        written = sum(bool(line.strip()) for line in lines)
        message = f"no row of numbers in its first {written} {'line' if written == 1 else 'lines'} with text; "
        message += "expected rows of as many numbers each, under a header or not"
        if len(lines) >= MOST_LINES:
            message += "; where they begin further down, state the lines of the names and of the first row of numbers, "
            message += "names = LINE and data = LINE, in an import description (--as)"
        raise Refusal(path.name, Finding("no_data", None, None, message)) from error
    rows = [dialect.split(line) for line in lines[header.first_data_line - 1 :]]
    ends = [dialect.split(line) for line in read_last_lines(path, encoding)]
    times = find_time_columns(rows, ends, header, options.date_order or "")
    notations = find_notations(rows, header, dialect.decimal, times.fields)
    return _Text(path, options, encoding, lines, dialect, header, rows, ends, times, notations)
