"""Options that several commands share: a mechanism, its payload and counter-masses."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..errors import UnitError

if TYPE_CHECKING:
    from ..mechanism import Mechanism

F = TypeVar("F", bound=Callable[..., Any])


class NamedMass(click.ParamType[tuple[str, float]]):
    """``NAME=MASS`` with a unit, such as ``platform=5kg``, as (name, mass in kg)."""

    def __init__(self, what: str) -> None:
        self.name = f"{what}=mass"

    def convert(
        self, value: str | tuple[str, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        """Read the text; a wrong one fails as a wrong command line."""
        if isinstance(value, tuple):
            return value
        from ..quantities import parse

        name, separator, text = value.partition("=")
        if not separator or not name.strip():
            self.fail(f"{value!r}: expected {self.name.replace('mass', '5kg')}", param, ctx)
        try:
            return name.strip(), parse(text, "mass")
        except UnitError as error:
            self.fail(f"{name}: {error}", param, ctx)


mechanism_argument = click.argument("mechanism", metavar="MECH")
payload_option = click.option(
    "--payload",
    "-p",
    type=NamedMass("BODY"),
    multiple=True,
    metavar="BODY=M",
    help="Set the mass of a body, such as platform=5kg; its own mass included.",
)
counter_option = click.option(
    "--counter",
    "-c",
    type=NamedMass("SITE"),
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
figure_option = click.option(
    "--figure", type=click.Path(dir_okay=False), metavar="FILE", help="Also draw it, as .png, .svg or .pdf."
)


def load(mechanism: str, payload: tuple[tuple[str, float], ...]) -> "Mechanism":
    """The mechanism by name or file, with its payload."""
    from ..loading.loading import load_mechanism

    return load_mechanism(mechanism).with_payload(once(payload, "--payload"))


def once(pairs: tuple[tuple[str, float], ...], option: str) -> dict[str, float]:
    """Pairs as a mapping; a name given twice is a wrong command line."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f"{option} names {name!r} twice")
    return dict(pairs)


def in_turn(pairs: tuple[tuple[str, float], ...]) -> list[tuple[tuple[str, float], ...]]:
    """Payloads of one body, in rising order, each with the payloads of all others; only one body may be named again."""
    names = [name for name, _ in pairs]
    again = sorted({name for name in names if names.count(name) > 1})
    if not again:
        return [pairs]
    if len(again) > 1:
        raise click.UsageError(f"--payload names {' and '.join(again)} again: sets grow with the payload of one body")
    rest = tuple(pair for pair in pairs if pair[0] != again[0])
    masses = sorted(mass for name, mass in pairs if name == again[0])
    if len(set(masses)) < len(masses):
        raise click.UsageError(f"--payload names the same mass of {again[0]!r} twice")
    return [(*rest, (again[0], mass)) for mass in masses]


def payload_bodies(mechanism: "Mechanism", payload: tuple[tuple[str, float], ...]) -> tuple[str, ...]:
    """Bodies whose balanced payload is asked for: those named, or else the mechanism's own."""
    return tuple(name for name, _ in payload) or mechanism.payload_bodies
