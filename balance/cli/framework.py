"""What both commands share: subcommands, JSON or tables on stdout, messages on stderr, exit codes, number formats."""

import json
import os
import re
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

import click

from ..errors import CounterpoiseError
from ..results import plain
from ..results import plain_text as plain_text

EXIT_REFUSED = 1
"""Refused or failed once a file or model was read; nothing half-written."""
EXIT_WITH_FINDINGS = 3
"""Done, with findings or losses that the output lists."""

NO_NUMBER = (
    "a result is no finite number: with these masses, lengths or speeds it exceeds double precision; check their units"
)
_HALF_LETTERS = re.compile("[\ud800-\udfff]")
"""Bytes of file names that are no UTF-8, as Python holds them."""

json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON document on stdout, units in the keys."
)


class Word(click.Choice[str]):
    """One of some words; the nearest is suggested for another."""

    def __init__(self, words: Sequence[str]) -> None:
        super().__init__(list(words))

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The word. Fails with the nearest one."""
        if value not in self.choices:
            from ..input_files import suggestion

            self.fail(f"{value!r}: expected {', '.join(self.choices)}{suggestion(value, self.choices)}", param, ctx)
        return value


class LazyGroup(click.Group):
    """A group that imports the module of a subcommand only when it is called, so that ``--help`` is quick.

    ``lazy`` gives, by the subcommand's name, its module in ``package``, as ``module:function`` where the function is
    named otherwise, and the line of help.
    """

    def __init__(self, *args: Any, package: str, lazy: dict[str, tuple[str, str]], **kwargs: Any) -> None:  # noqa: ANN401
        super().__init__(*args, **kwargs)
        self._package, self._lazy = package, lazy

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the subcommands, in the order in which they are used."""
        return list(self._lazy)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The subcommand, its module imported now."""
        if cmd_name not in self._lazy:
            return None
        module, _, function = self._lazy[cmd_name][0].partition(":")
        command = getattr(import_module(f"{self._package}.{module}"), function or cmd_name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands with their one line, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in self._lazy.items()])


def run(group: click.Group, name: str) -> NoReturn:
    """Run a command; errors of the user's input become one message and an exit code, without a traceback.

    Linear algebra runs in one thread unless the environment sets OPENBLAS_NUM_THREADS: on small matrices a second
    thread costs up to forty times what it saves. MuJoCo is asked for no pictures: its renderer takes long to import.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MUJOCO_GL", "disable")
    try:
        refuse_empty(sys.argv[1:])
        code = group.main(prog_name=name, standalone_mode=False)
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except click.Abort:
        click.echo(f"{name}: interrupted", err=True)
        code = 130
    except CounterpoiseError as error:
        click.echo(f"{name}: {error}", err=True)
        code = EXIT_REFUSED
    except OverflowError:
        click.echo(f"{name}: {NO_NUMBER}", err=True)
        code = EXIT_REFUSED
    except BrokenPipeError:
        sys.stderr.close()
        code = 0
    except IsADirectoryError as error:
        click.echo(f"{name}: {error.filename or 'what was given'}: is a folder; expected a file", err=True)
        code = EXIT_REFUSED
    except OSError as error:
        click.echo(": ".join([name, *filter(None, [error.filename]), error.strerror or str(error)]), err=True)
        code = EXIT_REFUSED
    sys.exit(code or 0)


def refuse_empty(arguments: Sequence[str]) -> None:
    """Refuse an empty argument, such as an unset variable of the shell: no name is empty."""
    for i, argument in enumerate(arguments):
        if not argument.strip():
            after = f"after {arguments[i - 1]!r} " if i else ""
            raise click.UsageError(
                f"an empty argument {after}is no name and no value; is a variable of the shell unset?"
            )


def json_text(document: dict[str, Any]) -> str:
    """The one JSON document of a command, results in it by their keys; a number that is not finite is refused."""
    try:
        text = json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise CounterpoiseError(NO_NUMBER) from error
    return _HALF_LETTERS.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def emit_json(document: dict[str, Any]) -> None:
    """Print the one JSON document of a command."""
    click.echo(json_text(document))


def emit_result(document: dict[str, Any], as_json: bool, show: Callable[[], None]) -> None:
    """Print a result as JSON, or as ``show`` prints it for people and then its findings; with findings exit code 3."""
    findings = document["findings"]
    if as_json:
        emit_json(document)
    else:
        show()
        for finding in findings:
            click.echo(f"Finding: {finding}")
    if findings:
        raise click.exceptions.Exit(EXIT_WITH_FINDINGS)


def emit_table(title: str, header: list[str], rows: list[list[str]], note: str = "") -> None:
    """Print a table for people on stdout; columns of numbers are right-aligned, control characters escaped."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=escape(plain_text(title)), title_style="bold", caption=escape(note) or None)
    table.title_justify = table.caption_justify = "left"
    for column, cells in zip(header, zip(*rows, strict=True) if rows else [()] * len(header), strict=True):
        numeric = bool(cells) and all(re.match(r"[+-]?[\d.]|-?$", cell) for cell in cells)
        table.add_column(escape(column), justify="right" if numeric else "left")
    for row in rows:
        table.add_row(*(escape(plain_text(cell)) for cell in row))
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def mass(kilograms: float) -> str:
    """Mass to 0.1 g."""
    return f"{kilograms:.4f}"


def first_moment(value: float) -> str:
    """First moment of mass with its unit."""
    return f"{value:.4g} kg m"


def per_cent(value: float | None) -> str:
    """Per cent, or a dash where there is nothing to compare with."""
    return "-" if value is None else f"{value:.3g} %"
