"""Commands, their options and arguments; those that several share: a mechanism, payloads; results of a motion.

Options and arguments are the defaults of a command's parameters, declared once each; a shared one is a constant:

    @command(epilog="...")
    def size(mechanism: str = MECHANISM, best: int = option("Sets to list.", default=1)) -> None:
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

import click

from ..errors import CounterpoiseError
from .framework import Answer, answering, emit_table, label, plain_text, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..dynamics.inverse_dynamics import Response
    from ..mechanism.mechanism import Mechanism
    from ..report.loopback import Loopback


T = TypeVar("T")
_TYPES = {int: int, float: float, Path: click.Path(path_type=Path)}
"""How the text of a parameter of these types is converted, unless it says otherwise."""


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


@dataclass(frozen=True)
class _Declared:
    """An option or argument: what makes the decorator of click that adds it, its names and attributes."""

    make: Callable[..., Decorator]
    names: tuple[str, ...]
    attributes: dict[str, Any]

    def of(self, name: str, kind: Any) -> Decorator:  # noqa: ANN401
        """The decorator, of the parameter ``name`` of the type ``kind``."""
        inferred: dict[str, Any] = next(({"type": _TYPES[one]} for one in (kind, *get_args(kind)) if one in _TYPES), {})
        any_number = get_origin(kind) is tuple and get_args(kind)[-1] is ...
        if self.make is click.argument:
            return self.make(name, **inferred | ({"nargs": -1} if any_number else {}) | self.attributes)
        names = self.names or (f"--{name.replace('_', '-')}",)
        if kind is bool and "/" not in names[0]:
            inferred = {"is_flag": True}
        elif any_number:
            inferred["multiple"] = True
        return self.make(*names, name, **inferred | self.attributes)


def option(text: str, type: Any = None, *names: str, **attributes: Any) -> Any:  # noqa: ANN401
    """An option, ``--name`` of its parameter unless it has ``names``; its help and what ``click.option`` takes.

    A bool is a flag, a tuple of any length is given several times; a default is shown in the help.
    """
    shown = {"show_default": True} if attributes.get("default") is not None else {}
    return _Declared(
        click.option, names, {"help": text} | ({} if type is None else {"type": type}) | shown | attributes
    )


def argument(metavar: str | None = None, **attributes: Any) -> Any:  # noqa: ANN401
    """An argument, shown as ``metavar``, and what ``click.argument`` takes; a tuple takes any number."""
    return _Declared(click.argument, (), {"metavar": metavar, **attributes})


def command(
    name: str | None = None,
    *,
    group: click.Group | None = None,
    file: tuple[str, str] | None = None,
    **attributes: Any,  # noqa: ANN401
) -> Callable[[Callable[..., Any]], click.Command]:
    """A command, one of a ``group`` if given, with the options and arguments that are the defaults of a function.

    ``file``: the kind of input file that it reads and a shipped one, whose keys the help leads to. ``attributes`` are
    those of ``click.command``; a default may also be a decorator of click's.
    """
    if file is not None:
        attributes["epilog"] += (
            f"\n\n\b\nKeys of the file: balance schema {file[0]} --text; a copy to edit: balance files --copy {file[1]}"
        )

    def declared(function: Callable[..., Any]) -> click.Command:
        stated = signature(function)
        if stated.return_annotation is Answer:
            function = answering(function)
        for one in reversed(list(stated.parameters.values())):
            if one.default is not one.empty:
                is_ours = isinstance(one.default, _Declared)
                function = (one.default.of(one.name, one.annotation) if is_ours else one.default)(function)
        made: click.Command = click.command(name, cls=click.Command, **attributes)(function)
        if group is not None:
            group.add_command(made)
        return made

    return declared


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


Masses = tuple[tuple[str, float], ...]
"""Masses [kg] by name, as they are given."""
MECHANISM = argument("MECH")
PAYLOADS = option(
    "Set the mass of a body, such as platform=5kg; its own mass included.",
    NamedQuantity("BODY", "mass", "5kg"), "--payload", "-p", metavar="BODY=M",
)  # fmt: skip
COUNTERS = option(
    "Mount a counter-mass at a site, such as counter_A0A=24.28kg.",
    NamedQuantity("SITE", "mass", "5kg"), "--counter", "-c", metavar="SITE=M",
)  # fmt: skip
SITES = option("A site that may carry a counter-mass [default: those named counter...].", metavar="SITE")
MOTION = option("A motion file, or a shipped one, such as x or four-bar.", required=True, metavar="TOML")
LIMITS = option("Largest counter-mass at a site.", NamedQuantity("SITE", "mass", "5kg"), metavar="SITE=M")
SPEED = option("Speed, such as 3000rpm.", Quantity("angular velocity", positive=True), metavar="SPEED")
SCHEDULER = option(
    "Compute on Dask: local for processes of this machine, or an address such as tcp://host:8786.", metavar="ADDRESS"
)
PORT = option("Port of this machine; a free one unless given.", click.IntRange(0, 65535), default=0, show_default=False)
BROWSER = option(
    "Open the browser, or print the address alone.", None, "--browser/--no-browser", default=True, show_default=False
)
IDLE = option("End after so long without a request [s].", click.FloatRange(min=0.0), metavar="S")


def _drawable(_context: click.Context, _parameter: click.Parameter, path: str | None) -> str | None:
    """The path; an unknown ending is refused before anything is computed."""
    if path is not None:
        from ..figures.mechanism import refuse_unknown_ending

        refuse_unknown_ending(path)
    return path


figure_option = click.option(
    "--figure", type=click.Path(dir_okay=False), metavar="FILE", callback=_drawable,
    help="Also draw it, as .png, .svg or .pdf.",
)  # fmt: skip
FIGURE: Any = figure_option


def load_mechanism_option(mechanism: str, payload: Masses) -> "Mechanism":
    """The mechanism by name or file, with its payload."""
    from ..mechanism.mjcf_parser import load_mechanism

    model = load_mechanism(mechanism).with_payload(distinct(payload, "--payload"))
    if model.of_no_body:
        click.echo(
            f"{model.name}: no body can have the inertia of {', '.join(model.of_no_body)} (a principal moment is below "
            "zero or above the two others together): used as stated; moments and torques depend on it, forces do not",
            err=True,
        )
    if model.loose_base:
        click.echo(
            f"{model.name}: no joint of the SDF file holds link {model.loose_base!r} to the world: taken as a fixed "
            "base; write a fixed joint with the parent world where it is one",
            err=True,
        )
    return model


def draw(path: str | None, function: "str | Callable[[], Figure]", *arguments: Any) -> None:  # noqa: ANN401
    """Draw into a file, if one is named; ``function`` makes the figure, or is one as ``package.module:function``."""
    if path is not None:
        from ..figures.mechanism import save

        if isinstance(function, str):
            module, _, name = function.partition(":")
            function = partial(getattr(import_module(module), name), *arguments)
        save(function(), path)


def distinct(pairs: Masses, option: str) -> dict[str, float]:
    """Pairs as a mapping; a name given twice is a wrong command line."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f"{option} names {name!r} twice")
    return dict(pairs)


def growing_payloads(pairs: Masses) -> list[Masses]:
    """Payloads in rising order of the one body that is named more than once, each with those of all other bodies."""
    names = [name for name, _ in pairs]
    again = sorted({name for name in names if names.count(name) > 1})
    if not again:
        return [pairs]
    if len(again) > 1:
        raise click.UsageError(
            f"--payload names {' and '.join(again)} more than once: give several payloads of one body only"
        )
    rest = tuple(pair for pair in pairs if pair[0] != again[0])
    masses = sorted(mass for name, mass in pairs if name == again[0])
    if len(set(masses)) < len(masses):
        raise click.UsageError(f"--payload names the same mass of {again[0]!r} twice")
    return [(*rest, (again[0], mass)) for mass in masses]


def payload_bodies(mechanism: "Mechanism", payload: Masses) -> tuple[str, ...]:
    """Bodies whose balanced payload is computed: those named, or else the mechanism's own."""
    return tuple(name for name, _ in payload if name in mechanism.own_mass) or mechanism.payload_bodies


def response_summary(response: "Response") -> dict[str, Any]:
    """RMS and peak values for JSON; torques [N m] and forces of sliding drives [N] by joint."""
    return {"rms": _grouped(response.rms()), "peak": _grouped(response.peak())}


def _grouped(values: dict[str, float]) -> dict[str, Any]:
    groups: dict[str, Any] = {"torque_Nm": {}}
    for name, value in values.items():
        if name.startswith("torque_"):
            groups["torque_Nm"][name.removeprefix("torque_").removesuffix("_Nm")] = value
        elif name.startswith("drive_force_"):
            groups.setdefault("drive_force_N", {})[name.removeprefix("drive_force_").removesuffix("_N")] = value
        else:
            groups[name] = value
    return groups


def print_responses(responses: "dict[str, Response]") -> None:
    """Print a motion before and after balancing, components that are not zero throughout."""
    from ..dynamics.inverse_dynamics import compared

    rows = [
        [label(name), *(f"{value:.4g}" for value in sizes)] for name, *sizes in map(dict.values, compared(responses))
    ]
    emit_table("Simulated motion", ["component", "RMS before", "RMS after", "peak before", "peak after"], rows)


def tell_idle(names: Sequence[str]) -> None:
    """What idle freedoms there are, and what is made of them."""
    if names:
        say(
            f"Idle: {', '.join(names)}: bodies turn about a line through their centres of mass while the motors stand "
            "still. The shaking force does not depend on it; moments and torques are as if they were fixed as at home."
        )


def serve(server: "Loopback", name: str, browser: bool, idle: float | None) -> None:
    """Answer one browser until Ctrl-C."""
    say(f"{plain_text(name)}: {server.url}")
    say("This address is for this machine and for you; Ctrl-C ends it.")
    import webbrowser
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="counterpoise-") as folder, suppress(KeyboardInterrupt):  # read by this user alone
        if browser:
            webbrowser.open(_way_to(server.url, Path(folder)))
        server.serve(float("inf") if idle is None else idle)


def _way_to(url: str, folder: Path) -> str:
    """The address of a page in a private folder that leads on: arguments of processes are read by all users."""
    page = folder / "open.html"
    page.write_text(f'<!DOCTYPE html><title>Opening</title><meta http-equiv="refresh" content="0; url={url}">', "utf-8")
    page.chmod(0o600)
    return page.as_uri()


@contextmanager
def progress(what: str, total: int, *, in_bytes: bool = True) -> Iterator[Callable[[int], None]]:
    """A bar on stderr, on a terminal only; gives a function that takes what was done since its last call."""
    if not sys.stderr.isatty() or (in_bytes and total < LEAST_PROGRESS):
        yield lambda count: None
        return
    from rich import progress as parts
    from rich.console import Console

    counts = (parts.DownloadColumn(), parts.TransferSpeedColumn()) if in_bytes else (parts.MofNCompleteColumn(),)
    columns = (parts.TextColumn("{task.description}"), parts.BarColumn(), *counts, parts.TimeRemainingColumn())
    with parts.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda count: bar.advance(task, count)


LEAST_PROGRESS = 20 << 20
"""Work from which a progress bar is shown [bytes]."""
