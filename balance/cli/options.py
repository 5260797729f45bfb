"""What several commands share: options of a mechanism, masses and motions, figures, a page's server, a progress bar."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import click

from .framework import FILE, NamedQuantity, Quantity, argument, option
from .printing import emit_table, label, plain_text, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..dynamics.inverse_dynamics import Response
    from ..mechanism.mechanism import Mechanism
    from ..report.loopback import Loopback

LENGTH, MASS, ANGULAR_VELOCITY = (Quantity(one, positive=True) for one in ("length", "mass", "angular velocity"))
Pairs = tuple[tuple[str, float], ...]
"""Masses [kg] by name, as they are given."""
Masses = dict[str, float]
"""The same where each name is given once."""


def distinct(_context: click.Context, parameter: click.Parameter, pairs: Pairs) -> Masses:
    """Pairs as a mapping; a name given twice is a wrong command line."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f"{parameter.opts[0]} names {name!r} twice")
    return dict(pairs)


class _MassOf(NamedQuantity):
    """``NAME=M``; of a mass alone, the names that the mechanism has are said."""

    def convert(
        self, value: str | tuple[str, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        """Name and mass [kg]."""
        file = ctx and ctx.params.get("mechanism")
        if isinstance(value, str) and value[:1].isdigit() and "=" not in value and isinstance(file, str):
            from ..mechanism.mjcf_parser import load_mechanism

            model = load_mechanism(file)
            of_site = self.name.startswith("SITE")
            names = (model.counter_sites or list(model.sites)) if of_site else model.payload_bodies or model.bodies
            what = "sites" if of_site else "bodies"
            meant = f"did you mean {names[0]}={value}?" if len(names) == 1 else f"{what} are {', '.join(names)}"
            self.fail(f"{value!r}: expected {self.name.partition('=')[0]}=5kg; {meant}", param, ctx)
        return super().convert(value, param, ctx)


def _masses(text: str, what: str, *names: str, **attributes: Any) -> Any:  # noqa: ANN401
    """An option of masses at sites or of bodies."""
    kind = _MassOf(what, "mass", "5kg")
    return option(text, kind, *names, metavar=f"{what}=M", multiple=True, **attributes)


def _drawable(_context: click.Context, _parameter: click.Parameter, path: str | None) -> str | None:
    """The path; an unknown ending is refused before anything is computed."""
    if path is not None:
        from ..figures.mechanism import refuse_unknown_ending

        refuse_unknown_ending(path)
    return path


MECHANISM = argument("MECH", is_eager=True)  # known where a mass without a name is refused
PAYLOADS_OF_ONE_BODY, PAYLOADS = (
    _masses(
        "Set the mass of a body, such as platform=5kg; its own mass included.", "BODY", "--payload", "-p",
        callback=callback,
    )
    for callback in (None, distinct)
)  # fmt: skip
"""The first may name one body several times: it is sized for each of its payloads."""
COUNTERS = _masses(
    "Mount a counter-mass at a site, such as counter_A0A=24.28kg.", "SITE", "--counter", "-c", callback=distinct
)
SITES = option("A site that may carry a counter-mass [default: those named counter...].", metavar="SITE")
MOTION = option("A motion file, or a shipped one, such as x or four-bar.", required=True, metavar="TOML")
LIMITS = _masses("Largest counter-mass at a site.", "SITE", callback=distinct)
ADDED = option("Mass that may be added in all, such as 2.5kg.", Quantity("mass"), metavar="M")
SPEED = option("Speed, such as 3000rpm.", ANGULAR_VELOCITY, metavar="SPEED")
SCHEDULER = option(
    "Compute on Dask: local for processes of this machine, or an address such as tcp://host:8786.", metavar="ADDRESS"
)
PORT = option("Port of this machine; a free one unless given.", click.IntRange(0, 65535), default=0, show_default=False)
BROWSER = option(
    "Open the browser, or print the address alone.", None, "--browser/--no-browser", default=True, show_default=False
)
IDLE = option("End after so long without a request [s].", click.FloatRange(min=0.0), metavar="S")
FIGURE = option("Also draw it, as .png, .svg or .pdf.", FILE, metavar="FILE", callback=_drawable)


def load_mechanism_option(mechanism: str, payload: Masses) -> "Mechanism":
    """The mechanism by name or file, with its payload."""
    from ..mechanism.mjcf_parser import load_mechanism

    as_filed = load_mechanism(mechanism)
    model = as_filed.with_payload(payload)
    for name in payload:
        if name in as_filed.own_mass and model.mass(name) < as_filed.mass(name):
            stated, filed = model.mass(name), as_filed.mass(name)
            click.echo(
                f"--payload {name}={stated:.4g}kg: less than the {filed:.4g} kg of {name} in the file; a payload is "
                "the mass of the body with all that it carries, its own included",
                err=True,
            )
    for name, distance in model.far_centres.items():
        click.echo(
            f"{model.name}: the centre of mass of {name} is {distance:.3g} m from its joint, far beyond all joints and "
            "sites: a file's numbers are in m, kg and kg m2; correct them where they are in other units",
            err=True,
        )
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


def payload_bodies(mechanism: "Mechanism", payload: Masses) -> tuple[str, ...]:
    """Bodies whose balanced payload is computed: those named, or else the mechanism's own."""
    return tuple(name for name in payload if name in mechanism.own_mass) or mechanism.payload_bodies


def response_summary(response: "Response") -> dict[str, Any]:
    """RMS and peak values for JSON; torques [N m] and forces of sliding drives [N] by joint."""
    summary = {}
    for what, values in (("rms", response.rms()), ("peak", response.peak())):
        wrench = {name: values[name] for name in list(values)[:6]}
        torques = {joint: values[f"torque_{joint}_Nm"] for joint in response.torque if joint not in response.sliding}
        forces = {joint: values[f"drive_force_{joint}_N"] for joint in response.torque if joint in response.sliding}
        summary[what] = {"torque_Nm": torques, **wrench} | ({"drive_force_N": forces} if forces else {})
    return summary


def print_responses(responses: "dict[str, Response]") -> None:
    """Print a motion before and after balancing, components that are not zero throughout."""
    from ..dynamics.inverse_dynamics import compared

    rows = [[label(name), *(f"{size:.4g}" for size in sizes)] for name, *sizes in map(dict.values, compared(responses))]
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
    from pathlib import Path
    from tempfile import TemporaryDirectory

    with TemporaryDirectory(prefix="counterpoise-") as folder, suppress(KeyboardInterrupt):
        if browser:  # by a page that leads on, which this user alone can read: arguments of processes are read by all
            page = Path(folder) / "open.html"
            refresh = f'<meta http-equiv="refresh" content="0; url={server.url}">'
            page.write_text(f"<!DOCTYPE html><title>Opening</title>{refresh}", "utf-8")
            page.chmod(0o600)
            webbrowser.open(page.as_uri())
        server.serve(float("inf") if idle is None else idle)


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
