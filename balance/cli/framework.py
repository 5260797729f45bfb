"""What commands are made of: subcommands that are imported late, options, answers, exit codes.

Options and arguments are the defaults of a command's parameters, declared once each; a shared one is a constant:

    @command(epilog="...")
    def size(mechanism: str = MECHANISM, best: int = option("Sets to list.", default=1)) -> Answer:
"""

import atexit
import gc
import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar, get_args, get_origin

import click

from ..errors import CoarseSamples, CounterpoiseError, suggestion
from .printing import NO_NUMBER, Detail, FirstLine, columns, complain, emit_findings, emit_json, emit_parts

EXIT_REFUSED = 1
"""Refused or failed once a file or model was read; nothing half-written."""
EXIT_WITH_FINDINGS = 3
"""Done, with findings or losses that the output lists."""
T = TypeVar("T")
_TYPES = {int: int, float: float, Path: click.Path(path_type=Path)}
"""How the text of a parameter of these types is converted, unless it says otherwise."""
FILE = click.Path(dir_okay=False)
"""The path of a file, there or to be."""


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
        if ctx.resilient_parsing:  # the shell asks for a completion
            from .completion import completing

            return completing(command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The subcommand that is named; the refusal of an unknown one names the nearest."""
        if args and args[0] not in self._lazy and (near := suggestion(args[0], self._lazy)):
            raise click.UsageError(f"No such command {args[0]!r}{near}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands with their one line, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in self._lazy.items()])


def run(name: str, package: str, lazy: dict[str, tuple[str, str]], text: str) -> NoReturn:
    """Run a program of subcommands; errors of the user's input become one message and an exit code, no traceback.

    Linear algebra runs in one thread unless the environment sets OPENBLAS_NUM_THREADS: on small matrices a second
    thread costs up to forty times what it saves. MuJoCo is asked for no pictures: its renderer takes long to import.
    At its end no garbage is sought: that took a tenth of a small command.
    """
    atexit.register(gc.freeze)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MUJOCO_GL", "disable")
    Detail.everything = Detail.quiet = Detail.emitted = False
    stdout, names = sys.stdout, {"help_option_names": ["-h", "--help"]}
    warnings.showwarning = _shown
    group = LazyGroup(name, package=package, lazy=lazy, help=text, context_settings=names)
    click.version_option(package_name="counterpoise")(group)
    try:
        _refuse_empty(sys.argv[1:])
        width = max(min(columns() or 80, 80) - 2, 50)  # of help, as click has it, which would import shutil
        code = group.main(prog_name=name, standalone_mode=False, terminal_width=width)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        code = error.exit_code
    except click.ClickException as error:
        code = _refused(error, f"{name}: ", error.format_message(), error.exit_code)
        if isinstance(error, click.UsageError):
            click.echo(f"Try '{error.ctx.command_path if error.ctx else name} --help'.", err=True)
    except click.Abort:
        click.echo(f"{name}: interrupted", err=True)
        code = 130
    except BrokenPipeError:
        sys.stderr.close()
        code = 0
    except (CounterpoiseError, OverflowError, OSError) as error:
        code = _refused(error, f"{name}: ", _message(error), EXIT_REFUSED)
    finally:
        sys.stdout = stdout
    sys.exit(code or 0)


def _shown(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: object = None,
) -> None:
    """Say a warning in one line, without the place in the code that has it."""
    click.echo(f"  {'coarse_samples' if category is CoarseSamples else 'warning'}: {message}", err=True)


def _message(error: Exception) -> str:
    """What a person is told of an error."""
    if isinstance(error, OverflowError):
        return NO_NUMBER
    if isinstance(error, IsADirectoryError):
        return f"{error.filename or 'what was given'}: is a folder; expected a file"
    if isinstance(error, OSError):
        return ": ".join([*filter(None, [error.filename]), error.strerror or str(error)])
    return str(error)


def _refused(error: Exception, program: str, message: str, code: int) -> int:
    """The exit code of a refusal, which is said on stderr; with --json in the document too."""
    click.echo(program + message, err=True)
    if "--json" in sys.argv and not Detail.emitted:
        emit_json({"error": {"kind": type(error).__name__, "message": message, "exit_code": code}})
    return code


def _refuse_empty(arguments: Sequence[str]) -> None:
    """Refuse an empty argument, such as an unset variable of the shell: no name is empty."""
    for before, argument in zip(["", *arguments], arguments, strict=False):
        if not argument.strip():
            after = f"after {before!r} " if before else ""
            raise click.UsageError(
                f"an empty argument {after}is no name and no value; is a variable of the shell unset?"
            )


class Answer(NamedTuple):
    """What a command that returns it has found: it has the option --json, and exit code 3 where there is a finding."""

    document: Mapping[str, Any]
    """The JSON document."""
    show: Callable[[], None]
    """Prints it for people."""
    has_finding: bool = False
    findings: Sequence[str] = ()
    """Printed for people below it."""
    refused: Sequence[object] = ()
    """What was refused, as text each with the reason, while the rest was done: printed on stderr; exit code 1."""
    code: int = 0
    """Exit code, where it is another."""
    further: Sequence[str] = ()
    """Parts of the document that are printed with --all, as ``emit_parts`` takes them."""


def _answering(function: Callable[..., Answer]) -> Callable[..., int]:
    """A function that prints what another answers, and returns the exit code."""

    @wraps(function)
    def answered(*, as_json: bool, **given: Any) -> int:  # noqa: ANN401
        heard = list[warnings.WarningMessage]()
        try:
            with warnings.catch_warnings(record=True) as heard:
                warnings.simplefilter("always", CoarseSamples)
                answer = function(**given)
        finally:  # of what is refused, too: a warning may say why
            for one in heard:
                if one.category is not CoarseSamples:
                    warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
        coarse = list(dict.fromkeys(str(one.message) for one in heard if one.category is CoarseSamples))
        if as_json:
            emit_json(({"coarse_samples": coarse} if coarse else {}) | dict(answer.document))
        else:
            answer.show()
            emit_findings(("coarse_samples", said) for said in coarse)
            emit_findings(("Finding", finding) for finding in answer.findings)
            if Detail.everything:
                emit_parts(answer.document, answer.further)
        complain(*answer.refused)
        if answer.code or answer.refused:
            return answer.code or EXIT_REFUSED
        return EXIT_WITH_FINDINGS if answer.has_finding or answer.findings or coarse else 0

    return answered


def _everything(_context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    Detail.everything = wanted


def _quiet(_context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        Detail.quiet, sys.stdout = True, FirstLine(sys.stdout)


_DETAIL = (
    (["--all", "-v", "--verbose"], _everything, "Everything: all tables and notes, each finding by itself."),
    (["-q", "--quiet"], _quiet, "The first line alone: the answer."),
)
"""Options of every command: how much is printed."""


def _is_open(kind: Any) -> bool:  # noqa: ANN401
    """Whether a type is a tuple of any length."""
    return get_origin(kind) is tuple and get_args(kind)[-1] is ...


def _converted(kind: Any) -> dict[str, Any]:  # noqa: ANN401
    return next(({"type": _TYPES[one]} for one in (kind, *get_args(kind)) if one in _TYPES), {})


def option(text: str, type: Any = None, *names: str, **attributes: Any) -> Any:  # noqa: ANN401
    """An option, ``--name`` of its parameter unless it has ``names``; its help and what ``click.option`` takes.

    A bool is a flag, a tuple of any length is given several times; a default is shown in the help.
    """
    stated = {"help": text} | ({} if type is None else {"type": type})
    stated |= {"show_default": True} if attributes.get("default") is not None else {}

    def declared(name: str, kind: Any) -> Any:  # noqa: ANN401
        every = names or (f"--{name.replace('_', '-')}",)
        is_flag = kind is bool and "/" not in every[0]
        inferred = {"is_flag": True} if is_flag else _converted(kind) | ({"multiple": True} if _is_open(kind) else {})
        return click.option(*every, name, **inferred | stated | attributes)

    return declared


def argument(metavar: str | None = None, **attributes: Any) -> Any:  # noqa: ANN401
    """An argument, shown as ``metavar``, and what ``click.argument`` takes; a tuple takes any number."""

    def declared(name: str, kind: Any) -> Any:  # noqa: ANN401
        number = {"nargs": -1} if _is_open(kind) else {}
        return click.argument(name, metavar=metavar, **_converted(kind) | number | attributes)

    return declared


JSON = option("Print one JSON document on stdout, units in the keys.", None, "--json")


def command(
    name: str | None = None,
    *,
    group: click.Group | None = None,
    file: tuple[str, str] | None = None,
    given: Mapping[str, Any] | None = None,
    **attributes: Any,  # noqa: ANN401
) -> Callable[[Callable[..., Any]], click.Command]:
    """A command, one of a ``group`` if given, with the options and arguments that are the defaults of a function.

    ``file``: the kind of input file that it reads and a shipped one, whose keys the help leads to. ``given``: options
    by the names by which the function takes them all together. ``attributes`` are those of ``click.command``. One that
    returns an ``Answer`` has the option --json.
    """
    if file is not None:
        attributes["epilog"] += (
            f"\n\n\b\nKeys of the file: balance schema {file[0]} --text; a copy to edit: balance files --copy {file[1]}"
        )

    def made(function: Callable[..., Any]) -> click.Command:
        stated = signature(function)
        if stated.return_annotation is Answer:
            function = JSON("as_json", bool)(_answering(function))
        declared = {one.name: one.default(one.name, one.annotation)
                    for one in stated.parameters.values() if one.default is not one.empty}  # fmt: skip
        declared |= {name: one(name, str) for name, one in (given or {}).items()}
        for decorator in reversed(declared.values()):
            function = decorator(function)
        command: click.Command = click.command(name, cls=click.Command, **attributes)(function)
        command.params += [
            click.Option(names, is_flag=True, expose_value=False, is_eager=True, callback=callback, help=text)
            for names, callback, text in _DETAIL
        ]
        if group is not None:
            group.add_command(command)
        return command

    return made


class Read(click.ParamType[T]):
    """A text that a function reads; what that raises fails as a wrong command line."""

    def __init__(self, name: str, read: Callable[[str], T]) -> None:
        self.name, self._read = name, read

    def convert(self, value: str | T, param: click.Parameter | None, ctx: click.Context | None) -> T:
        """What the text says; a default that is no text stays."""
        if not isinstance(value, str):
            return value
        try:
            return self._read(value)
        except (CounterpoiseError, ValueError) as error:
            self.fail(str(error), param, ctx)


class Word(click.Choice[str]):
    """One of some words; the nearest is suggested for another."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The word. Fails with the nearest one."""
        if value not in self.choices:
            self.fail(f"{value!r}: expected {', '.join(self.choices)}{suggestion(value, self.choices)}", param, ctx)
        return value


class Quantity(Read[float]):
    """A text with a unit, in SI."""

    def __init__(self, *dimensions: str, positive: bool = False) -> None:
        super().__init__(" or ".join(dimensions), self._parsed)
        self.dimensions, self.positive = dimensions, positive

    def _parsed(self, text: str) -> float:
        from ..units import dimension_of, parse

        found = parse(text, dimension_of(text, *self.dimensions))
        if self.positive and not found > 0.0:
            raise ValueError(f"{text!r}: expected more than zero")
        return found


class NamedQuantity(Read[tuple[str, float]]):
    """``NAME=VALUE`` with a unit, such as ``platform=5kg``, as a name and a value in SI."""

    def __init__(self, what: str, dimension: str, example: str) -> None:
        super().__init__(f"{what}={dimension}", self._parsed)
        self._quantity, self._example = Quantity(dimension), f"{what}={example}"

    def _parsed(self, text: str) -> tuple[str, float]:
        name, separator, value = text.partition("=")
        if not separator or not name.strip():
            raise ValueError(f"{text!r}: expected {self._example}")
        try:
            return name.strip(), self._quantity.convert(value, None, None)
        except click.BadParameter as error:
            raise ValueError(f"{name}: {error.message}") from error
