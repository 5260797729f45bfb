"""Options that several commands share: a mechanism, payloads, counter-masses, quantities; results of a motion."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..errors import UnitError
from .framework import emit_table, plain_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..dynamics.inverse_dynamics import Response
    from ..mechanism.mechanism import Mechanism
    from ..report.loopback import Loopback

F = TypeVar("F", bound=Callable[..., Any])


class Quantity(click.ParamType[float]):
    """A text with a unit, in SI."""

    def __init__(self, *dimensions: str, positive: bool = False) -> None:
        self.dimensions, self.positive = dimensions, positive
        self.name = " or ".join(dimensions)

    def convert(self, value: str | float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Read the text; a wrong one fails as a wrong command line."""
        if not isinstance(value, str):
            return value
        from ..units import dimension_of, parse

        try:
            found = parse(value, dimension_of(value, *self.dimensions))
        except UnitError as error:
            self.fail(str(error), param, ctx)
        if self.positive and not found > 0.0:
            self.fail(f"{value!r}: expected more than zero", param, ctx)
        return found


class NamedQuantity(click.ParamType[tuple[str, float]]):
    """``NAME=VALUE`` with a unit, such as ``platform=5kg``, as a name and a value in SI."""

    def __init__(self, what: str, dimension: str, example: str) -> None:
        self._quantity, self._example = Quantity(dimension), f"{what}={example}"
        self.name = f"{what}={dimension}"

    def convert(
        self, value: str | tuple[str, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        """Read the text; a wrong one fails as a wrong command line."""
        if isinstance(value, tuple):
            return value
        name, separator, text = value.partition("=")
        if not separator or not name.strip():
            self.fail(f"{value!r}: expected {self._example}", param, ctx)
        try:
            return name.strip(), self._quantity.convert(text, param, ctx)
        except click.BadParameter as error:
            self.fail(f"{name}: {error.message}", param, ctx)


mechanism_argument = click.argument("mechanism", metavar="MECH")
payload_option = click.option(
    "--payload",
    "-p",
    type=NamedQuantity("BODY", "mass", "5kg"),
    multiple=True,
    metavar="BODY=M",
    help="Set the mass of a body, such as platform=5kg; its own mass included.",
)
counter_option = click.option(
    "--counter",
    "-c",
    type=NamedQuantity("SITE", "mass", "5kg"),
    multiple=True,
    metavar="SITE=M",
    help="Mount a counter-mass at a site, such as counter_A0A=24.28kg.",
)
site_option = click.option(
    "--site",
    multiple=True,
    metavar="SITE",
    help="A site that may carry a counter-mass [default: those named counter...].",
)
motion_option = click.option(
    "--motion", required=True, metavar="TOML", help="A motion file, or a shipped one: x, y, triangle."
)
limit_option = click.option(
    "--limit",
    type=NamedQuantity("SITE", "mass", "5kg"),
    multiple=True,
    metavar="SITE=M",
    help="Largest counter-mass at a site.",
)


def _drawable(_context: click.Context, _parameter: click.Parameter, path: str | None) -> str | None:
    """The path; an unknown ending is refused before anything is computed."""
    if path is not None:
        from ..figures.mechanism import refuse_unknown_ending

        refuse_unknown_ending(path)
    return path


figure_option = click.option(
    "--figure",
    type=click.Path(dir_okay=False),
    metavar="FILE",
    callback=_drawable,
    help="Also draw it, as .png, .svg or .pdf.",
)
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Compute on Dask: local for processes of this machine, or an address such as tcp://host:8786.",
)


def load_mechanism_option(mechanism: str, payload: tuple[tuple[str, float], ...]) -> "Mechanism":
    """The mechanism by name or file, with its payload."""
    from ..mechanism.mjcf_parser import load_mechanism

    model = load_mechanism(mechanism).with_payload(distinct(payload, "--payload"))
    if model.of_no_body:
        click.echo(
            f"{model.name}: no body can have the inertia of {', '.join(model.of_no_body)} (a principal moment is below "
            "zero or above the two others together): used as stated; moments and torques depend on it, forces do not",
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


def distinct(pairs: tuple[tuple[str, float], ...], option: str) -> dict[str, float]:
    """Pairs as a mapping; a name given twice is a wrong command line."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f"{option} names {name!r} twice")
    return dict(pairs)


def growing_payloads(pairs: tuple[tuple[str, float], ...]) -> list[tuple[tuple[str, float], ...]]:
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


def payload_bodies(mechanism: "Mechanism", payload: tuple[tuple[str, float], ...]) -> tuple[str, ...]:
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
    before, after = responses["before"], responses["after"]
    rows = []
    for name, peak in before.peak().items():
        if max(peak, after.peak()[name]) > 1e-9:
            values = [before.rms()[name], after.rms()[name], peak, after.peak()[name]]
            rows.append([component_label(name), *(f"{value:.4g}" for value in values)])
    emit_table("Simulated motion", ["component", "RMS before", "RMS after", "peak before", "peak after"], rows)


def serve_options(command: F) -> F:
    """Add ``--port``, ``--no-browser`` and ``--idle``."""
    for option in (
        click.option(
            "--idle", type=click.FloatRange(min=0.0), metavar="S", help="End when nothing is asked for so long."
        ),
        click.option("--browser/--no-browser", default=True, help="Open the browser, or print the address alone."),
        click.option(
            "--port", type=click.IntRange(0, 65535), default=0, help="Of this machine; a free one unless given."
        ),
    ):
        command = option(command)
    return command


def serve(server: "Loopback", name: str, browser: bool, idle: float | None) -> None:
    """Answer one browser until Ctrl-C."""
    click.echo(f"{plain_text(name)}: {server.url}")
    click.echo("This address is for this machine and for you; Ctrl-C ends it.")
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


def component_label(name: str) -> str:
    """The name of a component with its unit, such as ``Fx [N]`` of ``Fx_N``."""
    stem, _, unit = name.rpartition("_")
    return f"{stem.replace('_', ' ')} [{unit.replace('Nm', 'N m')}]"


speed_option = click.option(
    "--speed", type=Quantity("angular velocity", positive=True), metavar="SPEED", help="Speed, such as 3000rpm."
)
