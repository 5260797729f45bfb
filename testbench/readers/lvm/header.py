"""Headers of LVM files: the file's settings, and channels, samples, units and abscissa of each segment.

Where the headers of an LVM file lie, found in one fast pass; all other lines are rows of data.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...recording import Channel, Clock, Finding, Group, TimeColumn, UniformClock
from ...units import seconds_per
from .. import header_claims
from ..byte_source import damaged
from ..csv.dialect import Dialect
from ..csv.row_parser import RowParser
from ..csv.text_blocks import Encoding, read_blocks
from ..header_claims import by_step

END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_LETTERS = np.frombuffer(b"*ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz", dtype=np.uint8)
_NUMBER_WORD = re.compile(r"(?:nan|inf)", re.IGNORECASE)
_MOST_HEADER_LINES = 200_000


@dataclass(frozen=True)
class Head:
    """The lines of one header, and the file's lines (from 1) of the data below it: ``first`` to before ``end``."""

    lines: tuple[str, ...]
    first: int
    end: int


def heads(path: Path, encoding: Encoding) -> list[Head]:
    """The header of the file, then that of each segment with the lines of its data."""
    words, total = _lines_of_words(path, encoding)
    found: list[Head] = []
    begin = 0
    for i, (number, text) in enumerate(words):
        names_follow = i + 1 < len(words) and words[i + 1][0] == number + 1 and words[i + 1][1].startswith("X_Value")
        if not text.startswith(END):
            continue
        last = i + 2 if names_follow else i + 1
        end = words[last][0] if last < len(words) else total + 1
        found.append(Head(tuple(t for _, t in words[begin:last]), words[last - 1][0] + 1, end))
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


def settings(path: Path, head: Head) -> Settings:
    """The settings in the header of the file."""
    separator = "\t" if "\t" in "".join(head.lines) else ","
    pairs = {key: cells[0] for key, *cells in (line.split(separator) for line in head.lines) if cells and cells[0]}
    if pairs.get("Separator", "Tab") not in ("Tab", "Comma"):
        raise damaged(path, f"Separator is {pairs['Separator']!r}; expected Tab or Comma")
    decimal = pairs.get("Decimal_Separator", ".") or "."
    if decimal not in ".,":
        raise damaged(path, f"Decimal_Separator is {decimal!r}; expected a point or a comma")
    return Settings(Dialect(separator, decimal), pairs.get("X_Columns", "No"), pairs)


def segment(path: Path, head: Head, settings: Settings, name: str) -> Segment:
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
    said = {key: "; ".join(filter(None, cells)) for key, cells in rows.items() if any(cells) and key != "X_Value"}
    form = RowParser(settings.dialect, len(names))
    return Segment(form, parts, head.first, head.end, tuple(names), said, tuple(findings))


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
        said = dict(zip(keys, texts, strict=True))
        channels = [Channel(names[columns[i][1]], _cell(rows, "Y_Unit_Label", i) or None) for i in members]
        clock = _clock(path, said, settings.dialect.decimal, x)
        fields = [columns[i][1] for i in members]
        if x is not None:
            channels, fields = [Channel(names[x], said["X_Unit_Label"] or None), *channels], [x, *fields]
        elif isinstance(clock, UniformClock):
            findings += header_claims.step_as_text(said["Delta_X"], "Delta_X")
        title = name if len(gathered) == 1 else f"{name} {names[columns[members[0]][1]]}"
        declared = _count(path, said["Samples"]) if said["Samples"] else None
        rate = None if x is None else _stated_rate(said, settings.dialect.decimal, clock)
        parts.append(Part(Group(title, tuple(channels), clock), tuple(fields), declared, rate))
    return tuple(parts), list(dict.fromkeys(findings))


def _cell(rows: dict[str, list[str]], key: str, i: int) -> str:
    cells = rows.get(key, [])
    return cells[i] if i < len(cells) else ""


def _clock(path: Path, said: dict[str, str], decimal: str, x: int | None) -> Clock | None:
    if said["X_Dimension"] not in ("", "Time"):
        return None
    factor = seconds_per(said["X_Unit_Label"]) if said["X_Unit_Label"] else 1.0
    if x is not None:
        return TimeColumn(0, factor, assumed=not said["X_Unit_Label"])
    start, step = _start_and_step(path, said, decimal)
    return None if factor is None else by_step(step * factor, start * factor)


def _stated_rate(said: dict[str, str], decimal: str, clock: Clock | None) -> float | None:
    """The rate of Delta_X beside recorded abscissae [Hz]; None if it says none."""
    factor = clock.seconds_per_unit if isinstance(clock, TimeColumn) else None
    with suppress(ValueError):
        declared = by_step(float(said["Delta_X"].replace(decimal, ".")) * (factor or 0.0), 0.0)
        return None if declared is None else declared.rate_hz
    return None


def _start_and_step(path: Path, said: dict[str, str], decimal: str) -> tuple[float, float]:
    """X0 and Delta_X, in the unit of the abscissa; 0 where they are not said."""
    try:
        start, step = (float((said[key] or "0").replace(decimal, ".")) for key in ("X0", "Delta_X"))
    except ValueError as error:
        raise damaged(path, f"X0 {said['X0']!r} or Delta_X {said['Delta_X']!r} is no number") from error
    return start, step


def _count(path: Path, text: str) -> int:
    if not text.isascii() or not text.isdecimal() or len(text) > 15:
        raise damaged(path, f"Samples is {text!r}; expected a number of samples")
    return int(text)
