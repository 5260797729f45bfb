"""Where the header of a text ends and the data begin; its names and units as channels, and which of them is time."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ... import units
from ...recording import Channel, TimeColumn
from .cell_syntax import is_missing, is_number_like, read_timestamp
from .dialect import Dialect, UnclearDialect, is_comment, is_data

_LONGEST_UNIT = 20
_NOTATION = re.compile(r"[ymdhsf]+(?:[-/.:, t]+[ymdhsfz]+)+", re.IGNORECASE)
_NAME_AND_UNIT = re.compile(r"[^()[\]]*[^()[\]/·*^]\s*[(\[]([^()[\]]+)[)\]]")
_BRACKETED = re.compile(r"\(.*\)|\[.*\]")
_BRACKETS = re.compile(r"\(([^()]*)\)|\[([^][]*)\]")
_SIGNS_OF_UNITS = re.compile(r"[^\W\d_°%µ‰][^\s]{0,9}(?:\s?[/·⋅*^]\s?[^\s]{1,10}|[²³⁻¹]+)+")
_SCALED = re.compile(r"\s*[x×*·]\s*1(?:0+|0?[\^eE][+-]?\d+)\b")
_TIME_SUFFIX = re.compile(r"(.*?)[_ ](s|sec|ms|us|µs|ns|min)", re.IGNORECASE)
_ONE_OF_SEVERAL = re.compile(r"[ .-]*(?:\d+|(?<=[ .-])[abcxyz])$")
_TIME_NAMES = frozenset({
    "t", "time", "timestamp", "time stamp", "elapsed", "elapsed time", "relative time", "test time",
    "unix", "epoch", "posix", "unix time", "unixtime", "epoch time", "posix time", "unix timestamp", "time unix",
    "timestamp unix", "time epoch",
    "zaman", "süre", "sure", "geçen süre", "zaman damgası", "zeit", "temps", "tiempo", "tempo",
})  # fmt: skip


@dataclass(frozen=True)
class Header:
    """The header: channels, number of fields a row, and the lines (from 1) of names, units and first data.

    ``fields`` is one more than the channels where every row ends with a delimiter. ``lines`` holds the texts
    that may come again inside the file.
    """

    channels: tuple[Channel, ...]
    fields: int
    first_data_line: int
    named: bool
    lines: tuple[str, ...] = ()
    preamble: tuple[str, ...] = ()


def read_header(lines: Sequence[str], dialect: Dialect, has_header: bool | None = None) -> Header:
    """The header of a file that begins with ``lines``.

    Raises UnclearDialect if names and columns do not fit together, LookupError if there is no row of data.
    """
    rows = [[] if is_comment(line) or not line.strip() else dialect.split(line) for line in lines]
    first = _first_data(rows)
    fields = len(rows[first])
    while (end := _end_of_pairs(rows, first)) is not None:
        rows[first:end] = [[] for _ in range(first, end)]
        first = _first_data(rows)
    above = [i for i in range(first) if rows[i]]
    if has_header is False:
        above = []
    elif has_header and not above:
        above, first = [first], first + 1
    in_comment = [] if above else _names_in_comment(lines[:first], dialect, fields)
    named = _name_rows(rows, above, fields)
    labels, row_of_units = (in_comment, [""] * fields) if in_comment else _labels(rows, named, fields)
    kept = tuple(lines[i] for i in named)
    preamble = tuple(text for i, text in enumerate(lines[:first]) if text.strip() and i not in named)
    return Header(named_channels(labels, row_of_units), fields, first + 1, bool(named or in_comment), kept, preamble)


def _first_data(rows: Sequence[Sequence[str]]) -> int:
    """Index of the first row of data: of as many fields as most such rows have, and with no name of time in it.

    Raises LookupError if there is none.
    """
    data = [i for i, cells in enumerate(rows) if is_data(cells) and not any(map(is_time_name, cells))]
    lengths = Counter(len(rows[i]) for i in data)
    if not lengths:
        raise LookupError
    fields = lengths.most_common(1)[0][0]
    first = next(i for i in data if len(rows[i]) == fields)
    while first and len(rows[first - 1]) == fields and _is_all_missing(rows[first - 1]):
        first -= 1
    return first


def _end_of_pairs(rows: Sequence[Sequence[str]], first: int) -> int | None:
    """Where lines such as ``Serial;1234`` end that begin at ``first`` and only look like data; None if they are data.

    They hold text next to numbers, and a blank line or a row of names follows before the first row of numbers alone.
    """
    fields = len(rows[first])
    for i in range(first, len(rows)):
        texts = sum(not (is_number_like(c) or is_missing(c) or read_timestamp(c)) for c in rows[i])
        if rows[i] and len(rows[i]) == fields and not texts:
            return None
        if i > first and (not rows[i] or texts == fields):
            return i if any(map(is_data, rows[i:])) else None
    return None


def _is_all_missing(cells: Sequence[str]) -> bool:
    """A row of words for no value, as a logger writes before its sensors are ready; no row of units such as ``-``."""
    return all(map(is_missing, cells)) and not all(cell in ("", "-") for cell in cells)


def _name_rows(rows: Sequence[Sequence[str]], above: Sequence[int], fields: int) -> list[int]:
    """Which rows above the data are names and units: none, one or two."""
    if not above:
        return []
    last = above[-1]
    if len(rows[last]) == 1 and fields > 1:
        return []
    if not fields - 1 <= len(rows[last]) <= fields + 1:
        raise UnclearDialect(
            f"line {last + 1} has {len(rows[last])} names, the rows below it have {fields} fields; quote names that "
            "hold the delimiter, or say --delimiter and --decimal"
        )
    if len(above) > 1 and len(rows[above[-2]]) == len(rows[last]) and _are_units(rows[last], rows[above[-2]]):
        return [_of_names(rows, above[-2]), last]
    return [_of_names(rows, last)]


def _of_names(rows: Sequence[Sequence[str]], at: int) -> int:
    """The row of names: the one ``at`` this place, or a full one above where it holds dates, or mostly nothing.

    Some loggers write rates, dates and starts of the channels below their names.
    """
    cells = rows[at]
    if 2 * sum(map(bool, cells)) > len(cells) and not any(map(read_timestamp, cells)):
        return at
    found = _full_row_above(rows, at)
    return at if found is None else found


def _full_row_above(rows: Sequence[Sequence[str]], at: int) -> int | None:
    """The nearest row of as many cells above a row of three or more, if all are names: no number, date or pair."""
    for i in range(at - 1, -1, -1) if len(rows[at]) > 2 else ():
        cells = rows[i]
        if len(cells) == len(rows[at]) and all(cells) and all(map(_may_be_name, cells)):
            return i
    return None


def _may_be_name(cell: str) -> bool:
    return not is_number_like(cell) and read_timestamp(cell) is None and "=" not in cell


def _are_units(cells: Sequence[str], over: Sequence[str]) -> bool:
    """Whether a row holds units, below a row of names: units in brackets or not, or empty, and not all empty.

    A name with its unit, such as ``F (N)``, is none. Some may be unknown: if all stand in brackets, one of time below
    a name of time, or most are known below names that are no units.
    """
    if any((match := _NAME_AND_UNIT.fullmatch(cell)) and units.is_unit(match[1]) for cell in cells):
        return False
    texts = [cell.strip().strip("()[]").strip() for cell in cells]
    known = sum(map(units.is_unit, texts))
    if any(":" in name for name in over) and known < sum(map(bool, texts)):
        return False  # over names, such as of a line Vertical Units,CH1:V
    given = sum(map(bool, texts))
    if not given or known == given:
        return given > 0
    if any(len(text) > _LONGEST_UNIT for text in texts):
        return False
    if all(_BRACKETED.fullmatch(cell.strip()) for cell in cells if cell.strip()):
        return True
    of_time = any(is_time_name(name) and _is_of_time(text) for name, text in zip(over, texts, strict=True))
    return of_time or (2 * known >= given and 2 * sum(map(units.is_unit, over)) < given)


def _is_of_time(text: str) -> bool:
    """Whether a text is a unit of time, or how times are written, such as ``hh:mm:ss.fff``."""
    return units.seconds_per(text) is not None or _NOTATION.fullmatch(text) is not None


def _labels(rows: Sequence[Sequence[str]], named: Sequence[int], fields: int) -> tuple[list[str], list[str]]:
    """Names and second-row units of the columns; a last column without name and values is no column."""
    if not named:
        return [f"col{i}" for i in range(fields)], [""] * fields
    labels = _filled(rows, named[0])
    given = list(rows[named[-1]]) if len(named) > 1 else []
    below = [cells for cells in rows[named[-1] + 1 :] if len(cells) == fields]
    ends_empty = fields > 1 and not any(cells[-1] for cells in below)
    if not labels[-1] and (len(labels) > fields or ends_empty):
        labels.pop()
    if len(labels) > fields or (len(labels) < fields and not ends_empty):
        raise UnclearDialect(f"line {named[0] + 1} has {len(labels)} names, the rows below it have {fields} fields")
    return [label or f"col{i}" for i, label in enumerate(labels)], (given + [""] * fields)[: len(labels)]


def _filled(rows: Sequence[Sequence[str]], at: int) -> list[str]:
    """The names of a row; where some have none, the name above: ``Time, Acc, Acc`` over ``, X, Y``."""
    above = None if all(rows[at][:-1]) else _full_row_above(rows, at)
    return list(rows[at]) if above is None else [own or over for own, over in zip(rows[at], rows[above], strict=True)]


def _names_in_comment(lines: Sequence[str], dialect: Dialect, fields: int) -> list[str]:
    """Names that stand in the last comment above the data, as ``numpy.savetxt`` writes them."""
    if not lines or not is_comment(lines[-1]) or fields < 2 or re.search("[:=]", lines[-1]):
        return []
    found = dialect.split(lines[-1].lstrip().lstrip("#%/").strip())
    return found if len(found) == fields and not any(map(is_number_like, found)) else []


def named_channels(names: Sequence[str], second_row: Sequence[str]) -> tuple[Channel, ...]:
    """The channels of these header cells, with the units of a second row where there is one."""
    return tuple(_channel(name, below) for name, below in zip(names, second_row, strict=True))


def _channel(name: str, below: str) -> Channel:
    """A channel of this header cell; its unit from the second row, from brackets, or the suffix of a time.

    Round brackets may hold anything (``Force (filtered)``): what is no known unit is one only if it is written as one.
    """
    if below:
        enclosed = _BRACKETS.fullmatch(below.strip())
        text = below.strip() if enclosed is None else (enclosed[1] or enclosed[2] or "").strip()
        return Channel(name, text or None, name)
    for match in reversed(list(_BRACKETS.finditer(name))):
        text = (match[1] or match[2] or "").strip()
        if _SCALED.match(name[match.end() :]):
            break  # F (N) x10: the numbers are of another unit than the brackets'
        if units.is_unit(text) or _is_written_as_unit(text, square=match[2] is not None):
            label = (name[: match.start()].rstrip() + " " + name[match.end() :].lstrip()).strip()
            return Channel(name, text, label or name)
    suffixed = _TIME_SUFFIX.fullmatch(name)
    if suffixed is not None and _plain(suffixed[1]) in _TIME_NAMES:
        return Channel(name, suffixed[2], suffixed[1])
    return Channel(name, None, name)


def _is_written_as_unit(text: str, square: bool) -> bool:
    """Whether an unknown text in brackets is meant as a unit: in square ones, or with the signs of units."""
    return not text.isdecimal() and (bool(text) if square else _SIGNS_OF_UNITS.fullmatch(text) is not None)


def unknown_brackets(channel: Channel) -> str:
    """What is in brackets at the end of the name of a channel without a unit; empty if nothing does."""
    match = re.search(r"\(([^()]*)\)\s*$|\[([^][]*)\]\s*$", channel.name) if channel.unit is None else None
    text = "" if match is None else (match[1] or match[2] or "").strip()
    return text if any(map(str.isalpha, text)) else ""


def is_time_name(name: str) -> bool:
    """Whether a header cell names time."""
    label = _BRACKETS.sub("", _channel(name, "").label)
    return _plain(label) in _TIME_NAMES


def time_name_base(label: str) -> str | None:
    """The name of time in a label, without the number or letter that tells it from others: ``time`` of ``Time_2``."""
    plain = _plain(_BRACKETS.sub("", label))
    if plain in _TIME_NAMES:
        return plain
    base = _ONE_OF_SEVERAL.sub("", plain)
    return base if len(base) > 1 and base in _TIME_NAMES else None


def _plain(name: str) -> str:
    """A name in small letters, with blanks between its words."""
    return name.strip().replace("İ", "i").casefold().replace("_", " ")


def time_column(channels: Sequence[Channel]) -> TimeColumn | None:
    """The column of time, recognised by its name; seconds are assumed, and marked so, where it has no unit.

    Brackets that hold something else than a unit of time leave the unit unknown.
    """
    for i, channel in enumerate(channels):
        if is_time_name(channel.label):
            if channel.unit is not None:
                return TimeColumn(i, units.seconds_per(channel.unit))
            bare = _BRACKETS.search(channel.label) is None
            return TimeColumn(i, 1.0, assumed=True) if bare else TimeColumn(i, None)
    return None
