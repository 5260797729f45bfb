"""Where the header of a text ends and the data begin; its names and units as channels, and which of them is time."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ...recording import Channel, TimeColumn
from ...units import is_unit, seconds_per
from .cell_syntax import decimal_mark, is_missing, is_number_like, read_timestamp
from .dialect import Dialect, UnclearDialect, is_comment, is_data

_LONGEST_UNIT = 20
_NOTATION = re.compile(r"[ymdhsf]+(?:[-/.:, t]+[ymdhsfz]+)+", re.IGNORECASE)
_NAME_AND_UNIT = re.compile(r"[^()[\]]*[^()[\]/·*^]\s*[(\[]([^()[\]]+)[)\]]")
_BRACKETED = re.compile(r"\(.*\)|\[.*\]")
_BEHIND_COMMA = re.compile(r"(.*\S)\s*,\s*([^,\s]+)")
_BRACKETS = re.compile(r"\(([^()]*)\)|\[([^][]*)\]")
_SIGNS_OF_UNITS = re.compile(r"[^\W\d_°%µ‰][^\s]{0,9}(?:\s?[/·⋅*^]\s?[^\s]{1,10}|[²³⁻¹]+)+")
_SCALED = re.compile(r"\s*[x×*·]\s*1(?:0+|0?[\^eE][+-]?\d+)\b")
_BARE_POWER = re.compile(r"(?!\w*m[23]$)[^\W\d]+\d+")
"""A sign and a number as of a channel (``C2``, ``V1``); areas and volumes are written so, too (``mm2``)."""
_TIME_SUFFIX = re.compile(r"(.*?)[_ ](s|sec|ms|us|µs|ns|min)", re.IGNORECASE)
_ONE_OF_SEVERAL = re.compile(r"[ .-]*(?:\d+|(?<=[ .-])[abcxyz])$")
_TIME_NAMES = frozenset({
    "t", "time", "timestamp", "time stamp", "elapsed", "elapsed time", "relative time", "test time",
    "unix", "epoch", "posix", "unix time", "unixtime", "epoch time", "posix time", "unix timestamp", "time unix",
    "timestamp unix", "time epoch",
    "zaman", "süre", "sure", "geçen süre", "zaman damgası", "zeit", "zeitstempel", "messzeit", "zeitpunkt",
    "temps", "tiempo", "tempo",
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
    rows: tuple[int, ...] = ()
    units: int | None = None
    """Lines of the names, and of the units, counted from 1."""


def stated_header(
    lines: Sequence[str], dialect: Dialect, names: Sequence[int], units: int | None = None, data: int | None = None
) -> Header:
    """The header whose lines a person states, counted from 1; cells of several lines of names are joined.

    Raises UnclearDialect for lines that are not there, or have too many cells, LookupError without a row of data.
    """
    rows = [dialect.split(line.lstrip().lstrip("#%/").strip() if is_comment(line) else line) for line in lines]
    last = max([*names, units or 0, 0])
    first = data or next((i for i, cells in enumerate(rows, 1) if i > last and is_data(cells)), 0)
    if not first or max(last, first) > len(rows) or min([*names, units or 1, first]) < 1:
        raise LookupError
    fields = len(rows[first - 1])
    above, below = [rows[i - 1] for i in names], list(rows[units - 1]) if units else []
    if len(above) > 1 and not below:  # a unit below a name of time is its unit
        over = [*_spread(above[-2]), *[""] * len(above[-1])]
        timed = [is_time_name(name) and is_unit(cell) for name, cell in zip(over, above[-1], strict=False)]
        below = [cell if is_units else "" for cell, is_units in zip(above[-1], timed, strict=True)]
        above[-1] = ["" if is_units else cell for cell, is_units in zip(above[-1], timed, strict=True)]
    count = max((len(cells) for cells in above), default=fields)
    if count > fields + 1:
        raise UnclearDialect(f"line {names[0]} has {count} names, the rows of data have {fields} fields")
    parts = [[*cells, *[""] * (fields - len(cells))] for cells in (*map(_spread, above[:-1]), *above[-1:])]
    joined = (" ".join(filter(None, dict.fromkeys(cells))) for cells in zip(*parts, strict=False))
    labels = [label or f"col{i}" for i, label in enumerate(joined)][:fields] or [f"col{i}" for i in range(fields)]
    ends_empty = not any(row[-1] for row in rows[first - 1 :] if row)
    if len(labels) > 1 and labels[-1] == f"col{len(labels) - 1}" and ends_empty:
        labels.pop()
    row_of_units = [*below, *[""] * fields][: len(labels)]
    kept = tuple(lines[i - 1] for i in (*names, *([units] if units else [])))
    preamble = tuple(text for i, text in enumerate(lines[: first - 1], 1) if text.strip() and i not in (*names, units))
    channels = named_channels(labels, row_of_units)
    return Header(channels, fields, first, bool(names), kept, preamble, tuple(names), units)


def _spread(cells: Sequence[str]) -> list[str]:
    """The cells of a row of names over several columns: an empty one is as the one before it."""
    found: list[str] = []
    for cell in cells:
        found.append(cell or (found[-1] if found else ""))
    return found


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
    if named and (over := next((i for i in range(named[0] - 1, -1, -1) if rows[i]), None)) is not None:
        names, below = rows[over], rows[named[0]]  # of names over several columns, above a unit of time below its name
        are_names = len(names) == len(below) and not any(map(is_number_like, names)) and is_time_name(names[0])
        if are_names and seconds_per(below[0]) is not None:
            return stated_header(lines, dialect, (over + 1, named[0] + 1), None, first + 1)
    labels, row_of_units = (in_comment, [""] * fields) if in_comment else _labels(rows, named, fields)
    kept = tuple(lines[i] for i in named)
    preamble = tuple(text for i, text in enumerate(lines[:first]) if text.strip() and i not in named)
    return Header(
        named_channels(labels, row_of_units), fields, first + 1, bool(named or in_comment), kept, preamble,
        rows=(first,) if in_comment else tuple(i + 1 for i in named[:1]),
        units=named[1] + 1 if len(named) > 1 else None,
    )  # fmt: skip


def _first_data(rows: Sequence[Sequence[str]]) -> int:
    """Index of the first row of data: of as many fields as most such rows have, and with no name of time in it.

    Raises LookupError if there is none.
    """
    data = [i for i, cells in enumerate(rows) if is_data(cells)]
    data = [i for i in data if not any(is_time_name(cell) for cell in rows[i] if decimal_mark(cell) is None)]
    lengths = Counter(len(rows[i]) for i in data)
    if not lengths:
        raise LookupError
    fields = lengths.most_common(1)[0][0]
    first = next(i for i in data if len(rows[i]) == fields)
    # rows of words for no value, as a logger writes before its sensors are ready; no row of units such as ``-``
    while first and len(above := rows[first - 1]) == fields and all(map(is_missing, above)):
        if set(above) <= {"", "-"}:
            break
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
    is_full = 2 * sum(map(bool, rows[at])) > len(rows[at])
    found = None if is_full and not any(map(read_timestamp, rows[at])) else _full_row_above(rows, at)
    return at if found is None else found


def _full_row_above(rows: Sequence[Sequence[str]], at: int) -> int | None:
    """The nearest row of as many cells above a row of three or more, if all are names: no number, date or pair."""
    for i in range(at - 1, -1, -1) if len(rows[at]) > 2 else ():
        cells = rows[i]
        may_be_names = (not is_number_like(c) and read_timestamp(c) is None and "=" not in c for c in cells)
        if len(cells) == len(rows[at]) and all(cells) and all(may_be_names):
            return i
    return None


def _are_units(cells: Sequence[str], over: Sequence[str]) -> bool:
    """Whether a row holds units, below a row of names: units in brackets or not, or empty, and not all empty.

    A name with its unit, such as ``F (N)``, is none. Some may be unknown: if all stand in brackets, one of time below
    a name of time, or most are known below names that are no units.
    """
    if any((match := _NAME_AND_UNIT.fullmatch(cell)) and is_unit(match[1]) for cell in cells):
        return False
    texts = [cell.strip().strip("()[]").strip() for cell in cells]
    known = sum(map(is_unit, texts))
    if any(":" in name for name in over) and known < sum(map(bool, texts)):
        return False  # over names, such as of a line Vertical Units,CH1:V
    given = sum(map(bool, texts))
    if not given or known == given:
        return given > 0
    if any(len(text) > _LONGEST_UNIT for text in texts):
        return False
    if all(_BRACKETED.fullmatch(cell.strip()) for cell in cells if cell.strip()):
        return True
    timed = (text for name, text in zip(over, texts, strict=True) if is_time_name(name))
    of_time = any(seconds_per(text) is not None or _NOTATION.fullmatch(text) for text in timed)
    return of_time or (2 * known >= given and 2 * sum(map(is_unit, over)) < given)


def _labels(rows: Sequence[Sequence[str]], named: Sequence[int], fields: int) -> tuple[list[str], list[str]]:
    """Names and second-row units of the columns; a last column without name and values is no column."""
    if not named:
        return [f"col{i}" for i in range(fields)], [""] * fields
    labels, above = list(rows[named[0]]), None if all(rows[named[0]][:-1]) else _full_row_above(rows, named[0])
    if above is not None:  # where some have none, the name above: ``Time, Acc, Acc`` over ``, X, Y``
        labels = [own or over for own, over in zip(labels, rows[above], strict=True)]
    given = list(rows[named[-1]]) if len(named) > 1 else []
    below = [cells for cells in rows[named[-1] + 1 :] if len(cells) == fields]
    ends_empty = fields > 1 and not any(cells[-1] for cells in below)
    if not labels[-1] and (len(labels) > fields or ends_empty):
        labels.pop()
    if len(labels) > fields or (len(labels) < fields and not ends_empty):
        raise UnclearDialect(f"line {named[0] + 1} has {len(labels)} names, the rows below it have {fields} fields")
    return [label or f"col{i}" for i, label in enumerate(labels)], (given + [""] * fields)[: len(labels)]


def _names_in_comment(lines: Sequence[str], dialect: Dialect, fields: int) -> list[str]:
    """Names that stand in the last comment above the data, as ``numpy.savetxt`` writes them."""
    if not lines or not is_comment(lines[-1]) or fields < 2 or re.search("[:=]", lines[-1]):
        return []
    found = dialect.split(lines[-1].lstrip().lstrip("#%/").strip())
    return found if len(found) == fields and not any(map(is_number_like, found)) else []


def named_channels(names: Sequence[str], second_row: Sequence[str]) -> tuple[Channel, ...]:
    """The channels of these header cells, with the units of a second row where there is one.

    Where every name ends with a unit behind a comma (``Force, N``), that is its unit; so is one behind a slash
    (``K1x/V``), where time or most names are written so.
    """
    behind = [_BEHIND_COMMA.fullmatch(name) for name in names]
    if len(names) > 1 and all(match and is_unit(match[2]) for match in behind):
        return tuple(Channel(match[0], match[2], match[1]) for match in behind if match)
    channels = tuple(_channel(name, below) for name, below in zip(names, second_row, strict=True))
    split = [None if channel.unit else _quantity_and_unit(channel.name) for channel in channels]
    timed = any(c.unit and c.label != c.name and c.name.removeprefix(c.label).strip()[:1] == "/" for c in channels)
    if not timed and (sum(map(bool, split)) < 2 or 2 * sum(map(bool, split)) <= len(names)):
        return channels
    return tuple(Channel(c.name, found[1], found[0]) if found else c for c, found in zip(channels, split, strict=True))


def _quantity_and_unit(name: str) -> tuple[str, str] | None:
    """The quantity and the unit of a name such as ``K1x/V``, ``F/N`` (ISO 80000-1:2022, 7.1.4); None of any other name.

    None are units themselves (``km/h``), with a unit before the slash (``v_km/h``, ``acc_m/s^2``), and, but for time,
    what is per time (``events/s``).
    """
    for match in re.finditer("/", name):
        quantity, unit = name[: match.start()].rstrip(), name[match.end() :].strip()
        if not quantity or not is_unit(unit) or _BARE_POWER.fullmatch(unit):
            continue
        if _plain(quantity) in _TIME_NAMES and quantity != "T":  # a temperature
            return (quantity, unit) if seconds_per(unit) is not None else None
        bare = seconds_per(unit.rstrip("²³0123456789^- ")) is not None
        *before, last = re.split(r"[\s_]+", quantity)
        if bare or (is_unit(last) and (before or len(quantity) > 1)):
            return None
        return quantity, unit
    return None


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
        # an unknown text is meant as a unit in square brackets, or with the signs of units
        is_meant = bool(text) if match[2] is not None else _SIGNS_OF_UNITS.fullmatch(text) is not None
        if is_unit(text) or (is_meant and not text.isdecimal()):
            before = name[: match.start()].rstrip().removesuffix("/").rstrip()
            label = f"{before} {name[match.end() :].lstrip()}".strip()
            return Channel(name, text, label or name)
    if (found := _quantity_and_unit(name)) is not None and seconds_per(found[1]) is not None:
        return Channel(name, found[1], found[0])
    suffixed = _TIME_SUFFIX.fullmatch(name)
    if suffixed is not None and _plain(suffixed[1]) in _TIME_NAMES:
        return Channel(name, suffixed[2], suffixed[1])
    return Channel(name, None, name)


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
                return TimeColumn(i, seconds_per(channel.unit))
            bare = _BRACKETS.search(channel.label) is None
            return TimeColumn(i, 1.0, assumed=True) if bare else TimeColumn(i, None)
    return None
