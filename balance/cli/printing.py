"""What a command prints: sentences, tables that fit the terminal, findings, one JSON document; messages on stderr."""

import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import click

from ..errors import CounterpoiseError
from ..results import LARGE_INSTANT_S, NO_VALUE, instant_text, name_and_unit, plain
from ..results import plain_text as plain_text

VERSION = {"schema_version": 1}
"""First key of every JSON document: raised where a key changes its meaning or goes; new keys leave it."""
NO_NUMBER = (
    "a result is no finite number: with these masses, lengths or speeds it exceeds double precision; check their units"
)
SHOWN_PER_KIND = 2
"""Findings of one kind that are printed unless all are asked for."""
_HALF_LETTERS = re.compile("[\ud800-\udfff]")
"""Bytes of file names that are no UTF-8, as Python holds them."""


def with_interval(value: float, within: float) -> str:
    """A value and half its interval, which has two digits, with as many decimals: ``8400 ± 360``, ``0.52 ± 0.013``."""
    if not 1e-6 < within < math.inf:
        return f"{value:.5g} ± {within:.2g}"
    decimals = 1 - math.floor(math.log10(float(f"{within:.1e}")))
    return " ± ".join(f"{round(one, decimals):.{max(decimals, 0)}f}" for one in (value, within))


class Detail:
    """How much a command prints: the verdict alone, one table and findings by kind, or everything."""

    everything = quiet = False
    emitted = False
    """Whether the JSON document is printed."""


class FirstLine:
    """A stream that passes the first line on that is not empty: the verdict."""

    def __init__(self, stream: Any) -> None:  # noqa: ANN401
        self._stream, self._open, self._begun = stream, True, False

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write up to the end of the first line that is not empty."""
        if self._open:
            line, end, _ = (text if self._begun else text.lstrip("\n")).partition("\n")
            self._begun |= bool(line)
            self._stream.write(line + end)
            self._open = not end
        return len(text)


def columns() -> int | None:
    """Characters of a line: of the terminal or COLUMNS; None in a pipe or file, where lines are as long as they are."""
    if Detail.quiet:
        return None
    named = os.environ.get("COLUMNS", "")
    if named.isdigit() and int(named) > 0:
        return max(int(named), 40)
    if not sys.stdout.isatty():
        return None
    import shutil

    return max(shutil.get_terminal_size().columns, 40)


def say(text: str) -> None:
    """Print sentences in lines of the terminal's width, broken between words alone: paths and digests stay whole."""
    width = columns()
    for line in text.split("\n"):
        lines = [line]
        if width is not None and len(line) > width:
            from textwrap import wrap

            indent = line[: len(line) - len(line.lstrip())] + "  "
            lines = wrap(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        click.echo("\n".join(lines))


def complain(*messages: object) -> None:
    """Print messages to stderr, a line each, after the name of the program."""
    for message in messages:
        click.echo(f"{click.get_current_context().find_root().info_name}: {plain_text(str(message))}", err=True)


def emit_findings(findings: Iterable[tuple[str, str]]) -> None:
    """Print findings, each a kind and a message, by kind: how many, and the first few; each by itself with --all."""
    by_kind: dict[str, list[str]] = {}
    for kind, message in findings:
        by_kind.setdefault(kind, []).append(plain_text(message))
    for kind, messages in by_kind.items():
        count, everything = len(messages), Detail.everything or len(messages) <= SHOWN_PER_KIND + 1
        shown = messages if everything else messages[:SHOWN_PER_KIND]
        for message in shown:
            say(f"  {kind}{f' ({count})' if count > len(shown) else ''}: {message}")
        if count > len(shown):
            click.echo(f"    and {count - len(shown)} more like these: --all lists them")


def json_text(document: Mapping[str, Any], version: dict[str, Any] = VERSION) -> str:
    """The one JSON document of a command, results in it by their keys; a number that is not finite is refused."""
    import json

    try:
        text = json.dumps(version | plain(document), indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise CounterpoiseError(NO_NUMBER) from error
    return _HALF_LETTERS.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def emit_json(document: Mapping[str, Any]) -> None:
    """Print the one JSON document of a command."""
    Detail.emitted = True
    click.echo(json_text(document))


def mass(kilograms: float) -> str:
    """Mass to 0.1 g."""
    return f"{kilograms:.4f}"


def cells(rows: Iterable[Mapping[str, Any]], shown: Mapping[str, str]) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table of parts of a document: by heading the key and its format, as ``at_mm:.3f``."""
    keys = [key.partition(":") for key in shown.values()]
    return list(shown), [
        [NO_VALUE if row[key] is None else format(row[key], form) for key, _, form in keys] for row in rows
    ]


_TEXT = (24, 16, 12)
"""Characters from which the cells of a column of words are wrapped: the first with which a table fits."""


def emit_table(title: str, header: list[str], rows: list[list[str]], note: str = "") -> None:
    """Print a table for people on stdout, in lines of the terminal's width."""
    click.echo("\n".join(table_lines(title, header, rows, note, columns())))


def table_lines(title: str, header: list[str], rows: list[list[str]], note: str, width: int | None) -> list[str]:
    """A table for people, numbers to the right, control characters escaped.

    Where it is wider than ``width``, columns of one value go below it, then texts are wrapped between words, the more
    the less there is room, then the last columns go; no number is ever broken.
    """
    table = [[plain_text(cell) for cell in column] for column in zip(header, *rows, strict=True)]
    below, gone = [note] if note else [], list[str]()
    if width is not None and len(rows) > 1 and _least(table) > width:
        same = [(name, cells[0]) for name, *cells in table[1:] if len(set(cells)) == 1]
        table = table[:1] + [column for column in table[1:] if len(set(column[1:])) > 1]
        texts = [f"{name}: {value}".removeprefix(": ") for name, value in same if value not in ("", NO_VALUE)]
        below += [f"In all rows: {'; '.join(texts)}"] if texts else []
    while width is not None and len(table) > 2 and _least(table, _TEXT[-1]) > width:
        gone.insert(0, table.pop()[0])
    if gone := [name for name in gone if name]:
        below.append(f"Too wide for {width} columns: {', '.join(gone)}")
    titles = _wrapped(plain_text(title), width or 1000) if title else []
    if not os.environ.get("NO_COLOR"):
        titles = [click.style(line, bold=True) for line in titles]
    return ["", *titles, *_drawn(table, width), *(line for text in below for line in _wrapped(text, width or 110))]


def _widths(table: list[list[str]], wrapped: int) -> list[int]:
    """The least width of each column: of its numbers or short words; of long texts that of a longest word."""
    from rich.cells import cell_len  # a character may be two wide

    found = []
    for name, *column in table:
        longest = max(map(cell_len, column), default=0)
        if longest > wrapped and not _is_numeric(column):
            longest = max(wrapped, *(cell_len(word) for cell in column for word in cell.split()))
        found.append(max(longest, *(cell_len(word) for word in name.split()), 1))
    return found


def _least(table: list[list[str]], wrapped: int = _TEXT[0]) -> int:
    """Characters that a table needs at least."""
    return sum(_widths(table, wrapped)) + 2 * len(table)


def _is_numeric(column: Sequence[str]) -> bool:
    return bool(column) and all(re.match(r"(>= |<= )?[+-]?[\d.]|-?$", cell) for cell in column)


def _drawn(table: list[list[str]], width: int | None) -> list[str]:
    """The lines of a table of columns, each with its name first."""
    from rich.cells import cell_len

    fitting = (wrapped for wrapped in _TEXT if width is None or _least(table, wrapped) <= width)
    least = _widths(table, next(fitting, _TEXT[-1]))
    sizes = [max(map(cell_len, column)) for column in table]
    while width is not None and sum(sizes) + 2 * len(sizes) > width:
        slack = [max(size - needed, 0) for size, needed in zip(sizes, least, strict=True)]
        taken = slack if any(slack) else sizes
        sizes[taken.index(max(taken))] -= 1
    sides = [str.rjust if _is_numeric(column[1:]) else str.ljust for column in table]
    lines: list[str] = []
    for place, row in enumerate(zip(*table, strict=True)):
        wrapped = [_wrapped(cell, size) for cell, size in zip(row, sizes, strict=True)]
        if place == 0:  # the header's names end at the line below
            wrapped = [[""] * (max(map(len, wrapped)) - len(name)) + name for name in wrapped]
        for line in zip_longest(*wrapped, fillvalue=""):
            fields = (side(cell, size - cell_len(cell) + len(cell))
                      for side, cell, size in zip(sides, line, sizes, strict=True))  # fmt: skip
            lines.append("  ".join(fields).rstrip())
        if place == 0:
            lines.append("\u2500" * (sum(sizes) + 2 * len(sizes) - 2))
    return lines


def _wrapped(cell: str, size: int) -> list[str]:
    """The lines of a text in a column of ``size`` characters, broken between words where it can be."""
    from rich.cells import cell_len, chop_cells

    if cell_len(cell) <= size:
        return [cell]
    lines: list[str] = []
    for word in cell.split():
        if lines and cell_len(lines[-1]) + 1 + cell_len(word) <= size:
            lines[-1] += f" {word}"
        else:
            lines += chop_cells(word, size)
    return lines


_READ = {"is": "", "rms": "RMS", "dof": "degrees of freedom", "mr": "m r"}
"""Parts of keys that are read as other words."""
_TITLES = {
    "": "Further", "over_a_turn_exact": "Largest over a turn, all orders together",
    "left_over_a_turn": "Largest over a turn, before and after balancing",
}  # fmt: skip
"""Titles of parts of a document whose keys do not say enough."""
_ROUNDING = 1e-12
"""Part of the largest number of its unit in a document up to which a number is rounding, and shown as zero."""
_MOST_VALUES = 6
"""Values of a list that are shown in a cell, and results of one that is part of another."""
_LONG_TEXT = 40
"""Characters from which a text is printed below its table."""


def label(key: str) -> str:
    """A key as the heading of a column, its unit in brackets: ``Fx [N]`` of ``Fx_N``; names of joints stay."""
    name, unit = name_and_unit(key)
    kind = next((kind for kind in ("torque_", "drive_force_") if name.startswith(kind)), "")
    return f"{kind.replace('_', ' ')}{name.removeprefix(kind)} [{unit}]" if unit else key


def words(key: str) -> str:
    """A key of a document as a heading: ``placed at [m]`` of ``placed_at_m``, ``crankshaft`` of ``is_crankshaft``."""
    name, bracket, unit = label(key).partition(" [")
    if not name.isidentifier():  # a name such as mcx[rod_1]
        return key
    return " ".join(filter(None, (_READ.get(part, part) for part in name.split("_")))) + bracket + unit


def emit_parts(document: Mapping[str, Any], keys: Iterable[str]) -> None:
    """Print parts of a document as tables, each by its key, inner ones after a dot; after a last dot single values."""
    whole = _without_rounding(plain(document))
    for key in keys:
        part = whole
        for name in key.split("."):
            if isinstance(part, list):
                part = [one for each in part for one in each.get(name) or ()]
            elif name:
                part = (part or {}).get(name)
            else:
                part = {name: one for name, one in (part or {}).items() if not _has_parts(one)}
        if part:
            title = _TITLES.get(key) or ", ".join(words(name) for name in key.split(".") if name)
            _emit_part(title[0].upper() + title[1:], part)


def _without_rounding(part: Any) -> Any:  # noqa: ANN401
    """A document whose numbers are zero where they are rounding of others of their unit; without a unit, of 1."""
    largest = {"": 1.0, "%": 100.0}

    def walk(one: Any, unit: str, found: Callable[[float, str], float]) -> Any:  # noqa: ANN401
        if isinstance(one, dict):
            return {key: walk(value, label(key).partition(" [")[2][:-1] or unit, found) for key, value in one.items()}
        if isinstance(one, list):
            return [walk(value, unit, found) for value in one]
        return found(one, unit) if isinstance(one, float) else one

    def measured(value: float, unit: str) -> float:
        if unit and math.isfinite(value):
            largest[unit] = max(largest.get(unit, 0.0), abs(value))
        return value

    walk(part, "", measured)
    return walk(part, "", lambda value, unit: 0.0 if abs(value) <= _ROUNDING * largest.get(unit, 0.0) else value)


def _has_parts(value: Any) -> bool:  # noqa: ANN401
    """Whether a value of a document is one of several results, or of several named values."""
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(one, dict | list) for one in value))


def _emit_part(title: str, part: Any) -> None:  # noqa: ANN401
    """Print a part of a document: results in rows, or in columns where they have more values; long texts below."""
    rows = {str(k): one for k, one in enumerate(part, 1)} if isinstance(part, list) else part
    if not all(isinstance(one, dict | list) for one in rows.values()):
        rows = {"value": rows}
    cells = {name: found for name, one in rows.items() if (found := dict(_flat(one)))}
    long = [(name, key) for name, one in cells.items() for key, text in one.items() if len(text) > _LONG_TEXT]
    texts = {(name, key): cells[name].pop(key) for name, key in long}
    keys = list(dict.fromkeys(key for one in cells.values() for key in one))
    header, rows = ["", *keys], [[name, *(one.get(key, NO_VALUE) for key in keys)] for name, one in cells.items()]
    if len(keys) > len(cells):
        header, *rows = map(list, zip(header, *rows, strict=True))
    if keys:
        emit_table(title, header, rows)
    for (name, key), text in texts.items():
        say(f"{key}: {text}" if name == "value" else f"{name}, {key}: {text}")


def _flat(part: Any, above: str = "") -> Iterable[tuple[str, str]]:  # noqa: ANN401
    """Headings and texts of the single values in a part of a document; of a long list none.

    Keys of a mapping with a unit, and those without one of several results of one kind, are names: they stay.
    """
    if isinstance(part, dict):
        kinds = {tuple(one) if isinstance(one, dict) else None for one in part.values()}
        alike = len(kinds) == 1 and None not in kinds
        for name, one in part.items():
            named = above.endswith("]") or (alike and label(name) == name)
            yield from _flat(one, f"{above} {_READ.get(name, name) if named else words(name)}".strip())
    elif _has_parts(part):
        one_of = above[:-2] if above.endswith("sses") else above.removesuffix("s")
        for k, one in enumerate(part if len(part) <= _MOST_VALUES else (), 1):
            yield from _flat(one, f"{one_of} {k}".strip())
    elif not isinstance(part, list) or 0 < len(part) <= _MOST_VALUES:
        every = part if isinstance(part, list) else [part]
        yield above or "value", ", ".join(_value_text(one, above.endswith("[s]")) for one in every)


def _value_text(value: Any, is_time: bool) -> str:  # noqa: ANN401
    if is_time and isinstance(value, float) and abs(value) >= LARGE_INSTANT_S:
        return instant_text(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.5g}" if isinstance(value, float) else NO_VALUE if value is None else str(value)
