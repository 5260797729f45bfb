"""Reader of text with delimiters: comma, semicolon, tab, bar or blanks; decimal point or comma."""

from collections.abc import Sequence, Set
from pathlib import Path

from ...findings import Finding, Refusal
from ...recording import Channel, Group, Recording
from .. import origin
from ..registry import ReadOptions
from . import dialect as dialects
from . import header as headers
from . import marks, names, preamble, several, spelling
from . import stated as above
from .dialect import Dialect, UnclearDialect
from .header import Header
from .parse import Form
from .rows import shown
from .sample import Sample, take
from .spelling import Spelled
from .table import Table

_ROWS_AT_END = 100


def open_text(path: Path, options: ReadOptions) -> Recording:
    """Read the first lines of a text; its rows are read when asked for."""
    sample = take(path, options.encoding)
    dialect, header = _understood(path, sample, options)
    spelled = spelling.find(path, sample, dialect, header, options.date_order)
    texts = spelled.texts | _text_fields(spelled, header) - spelled.fields
    kept = _kept(path, header, spelled, texts, options)
    said = tuple(preamble.strip(text) for text in header.preamble)
    stated = above.find(said, dialect.decimal)
    channels = spelled.times.channels(header.channels)
    clock = spelled.times.clock(channels, kept) or stated.clock
    group = Group(path.stem, tuple(channels[i] for i in kept), clock)
    clocks = _several_clocks(group, channels, kept, spelled)
    read = spelled.continued(_table(path, sample, dialect, header, spelled, group, kept).blocks, kept)
    left_out = _texts_left_out([(header.channels[i].name, i) for i in sorted(texts)], spelled.rows)
    return Recording(
        path=path,
        format="CSV",
        reader="testbench.readers.csv",
        groups=clocks.groups if clocks else (group,),
        read=stated.held_against(clocks.apart(read) if clocks else read),
        origin=origin.stated(said),
        settings=_settings(sample, dialect, header, options.date_order),
        metadata=preamble.pairs(said) | spelled.times.zeros(channels),
        comments=said,
        ranges=preamble.ranges(said),
        stated_rate_hz=stated.rate_hz,
        findings=(
            *_said(sample, dialect, header, spelled.fields),
            *spelled.findings,
            *stated.findings,
            *left_out,
            *([clocks.finding] if clocks else []),
        ),
    )


def _kept(path: Path, header: Header, spelled: Spelled, texts: Set[int], options: ReadOptions) -> tuple[int, ...]:
    """The fields that become channels. Raises Refusal if there are none, or the file holds notes."""
    if options.header is None and _are_notes(spelled.rows, header, texts):
        message = "a number behind other words on each line, as in notes; if they are data, say --no-header"
        raise Refusal(path.name, Finding("no_data", None, f"line {header.first_data_line}", message))
    kept = tuple(i for i in range(len(header.channels)) if i not in texts | spelled.times.taken_up)
    if not kept:
        raise Refusal(path.name, Finding("no_data", None, None, "no column of numbers; expected rows of numbers"))
    return kept


def _several_clocks(
    group: Group, channels: Sequence[Channel], kept: Sequence[int], spelled: Spelled
) -> several.Several | None:
    named = [several.named(channel) for channel in channels]
    return several.find(group, spelled.rows, kept, lambda fields: spelled.times.clock(named, fields))


def _table(
    path: Path, sample: Sample, dialect: Dialect, header: Header, spelled: Spelled, group: Group, kept: tuple[int, ...]
) -> Table:
    return Table(
        path,
        sample.encoding,
        spelled.form(Form(dialect, header.fields, padded=_is_padded(sample, header))),
        group,
        kept,
        header.first_data_line,
        names=header.lines[0] if header.lines else None,
        above=(*header.lines[1:], *header.preamble),
    )


def _settings(sample: Sample, dialect: Dialect, header: Header, date_order: str | None) -> dict[str, str]:
    """How the text was read: as detected or stated; of dates only what a person stated."""
    return {
        "encoding": sample.encoding.name,
        "delimiter": dialect.delimiter,
        "decimal": dialect.decimal,
        "first_data_line": str(header.first_data_line),
    } | ({"date_order": f"{date_order}, as stated"} if date_order else {})


def _understood(path: Path, sample: Sample, options: ReadOptions) -> tuple[Dialect, Header]:
    try:
        dialect = dialects.detect(sample.lines, options.delimiter, options.decimal)
        return dialect, headers.parse(sample.lines, dialect, options.header)
    except UnclearDialect as error:
        raise Refusal(path.name, Finding("unknown_dialect", None, None, str(error))) from error
    except LookupError as error:
        written = sum(bool(line.strip()) for line in sample.lines)
        message = (
            f"no row of numbers in its first {written} {'line' if written == 1 else 'lines'} with text; expected "
            "rows of numbers alike, under a header or not"
        )
        raise Refusal(path.name, Finding("no_data", None, None, message)) from error


def _text_fields(spelled: Spelled, header: Header) -> set[int]:
    """Columns that hold text in every one of the first rows, and are not mostly numbers in the last ones.

    A logger may write a word until its sensor is ready.
    """
    data = [cells for cells in spelled.rows if len(cells) == header.fields]
    ends = [cells for cells in spelled.ends if len(cells) == header.fields][-_ROWS_AT_END:]
    return {
        i
        for i in range(len(header.channels))
        if any(not marks.is_missing(cells[i]) for cells in data)
        and not any(marks.is_numberish(cells[i]) for cells in data)
        and 2 * sum(marks.is_numberish(cells[i]) for cells in ends) <= len(ends)
    }


def _are_notes(rows: Sequence[Sequence[str]], header: Header, texts: Set[int]) -> bool:
    """Whether the rows are lines such as ``Payload 5``: no names above, and each has another word before one number."""
    words = [cells[0] for cells in rows if len(cells) == header.fields]
    named = header.named and not header.channels[0].name.endswith((":", "="))
    return not named and 0 in texts and header.fields == len(texts) + 1 and len(set(words)) == len(words)


def _is_padded(sample: Sample, header: Header) -> bool:
    """Whether blanks fill up the cells, before a delimiter or at a line's end."""
    lines = sample.lines[header.first_data_line - 1 :][:20]
    return any(text in line for line in lines for text in (" ,", " ;", " |", " \t")) or any(
        line.endswith(" ") for line in lines
    )


def _said(sample: Sample, dialect: Dialect, header: Header, known: Set[int]) -> list[Finding]:
    """What was detected, and what of it was inferred; the units of ``known`` columns are."""
    message = f"{dialect}, encoding {sample.encoding.name}, first row of data in line {header.first_data_line}"
    if header.named and (unnamed := [c.name for i, c in enumerate(header.channels) if c.name == f"col{i}"]):
        message += f"; columns without a name: {', '.join(unnamed)}"
    findings = [Finding("dialect", None, None, message)]
    if sample.encoding.inferred:
        message = f"read as {sample.encoding.name}: {sample.encoding.inferred}; --encoding says it otherwise"
        findings.append(Finding("encoding_inferred", None, None, message))
    if dialect.doubt:
        message = f"{dialect.doubt}: decimals, or thousands? say --decimal"
        findings.append(Finding("ambiguous_number", None, f"line {header.first_data_line}", message))
    for i, channel in enumerate(header.channels):
        if i not in known and (text := names.unknown_brackets(channel)):
            message = f"{text!r} in brackets is not understood as a unit; the name is kept as written, without a unit"
            findings.append(Finding("unit_unknown", channel.name, None, message))
    if not header.named:
        message = "the first row is data: the columns are named col0, col1, ... and have no units"
        findings.append(Finding("no_header", None, f"line {header.first_data_line}", message))
    return findings


def _texts_left_out(fields: Sequence[tuple[str, int]], rows: Sequence[Sequence[str]]) -> list[Finding]:
    """Columns of text by name, with the first of their texts."""
    found = []
    for name, i in fields:
        texts = list(dict.fromkeys(cells[i] for cells in rows if len(cells) > i and cells[i]))
        listed = ", ".join(shown(text) for text in texts[:3]) + (", ..." if len(texts) > 3 else "")
        found.append(Finding("text_channel", name, None, f"holds text ({listed}), not numbers; it is not kept"))
    return found
