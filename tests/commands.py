"""Commands as a person calls them, in this process: exit code, standard output, standard error."""

import contextlib
import io
import json
import re
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import click
import pytest
from click.testing import CliRunner
from rich.cells import cell_len

from balance.cli import printing


class Outcome(NamedTuple):
    """What a call of a command left."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The document on standard output."""
        return json.loads(self.out)


def call(main: Callable[[], None], name: str, *words: object) -> Outcome:
    """Call the main function of a command with words."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv, code = [name, *map(str, words)], 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    finally:
        sys.argv = before
    return Outcome(code, out.getvalue(), err.getvalue())


def invoke(command: click.Command, *words: object, code: int = 0) -> Outcome:
    """Call a command by itself, which ends with this code; what it refuses is raised."""
    done = CliRunner().invoke(command, [*map(str, words)], standalone_mode=False, catch_exceptions=False)
    assert done.return_value == code, done.output
    return Outcome(code, done.stdout, done.stderr)


def held_to_widths(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """From now on every table that is printed is drawn at 80 and 200 columns too; gives their titles.

    No line is wider, no number broken, nothing cut short. What is printed is as wide as 80 columns.
    """
    drawn, titles = printing.table_lines, list[str]()

    def lines_at(title: str, header: list[str], rows: list[list[str]], note: str, width: int | None) -> list[str]:
        titles.append(title)
        for wide in (80, 200):
            lines = list(map(click.unstyle, drawn(title, header, rows, note, wide)))
            text = "\n".join(lines)
            assert max(map(cell_len, lines)) <= wide
            assert "…" not in text
            numbers = {cell for row in rows for cell in row if re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?", cell)}
            assert "Too wide" in text or all(number in text for number in numbers)
        return drawn(title, header, rows, note, width)

    monkeypatch.setattr(printing, "table_lines", lines_at)
    monkeypatch.setenv("COLUMNS", "80")
    return titles


def assert_fits(printed: str) -> None:
    """The first line has the answer's number; no line is wider than 80 columns, unless one word alone is."""
    lines = [line for line in click.unstyle(printed).splitlines() if line]
    assert re.search(r"\d", lines[0]), "the first line, which -q prints alone, is the answer"
    assert [line for line in lines if cell_len(line) > 80 and len(line.split()) > 1] == []
