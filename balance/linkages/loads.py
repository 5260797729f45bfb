"""Point masses on a body, and what they leave of it: a counter-massed body stands as point masses at joints."""

from collections.abc import Mapping
from dataclasses import dataclass

from ..arrays import Floats
from ..errors import ModelError
from .description import Linkage, Place
from .expressions import Point

ROUNDING = 1e-13
"""A first moment this small beside those that it is the sum of is zero."""


@dataclass(frozen=True)
class Load:
    """A point mass on a body, or one of its parts."""

    symbols: tuple[str, ...]
    """Symbols whose sum is its mass, such as m3, m3*."""
    mass: float
    """[kg]."""
    at: Point
    """From the body's reduction joint, in the body's frame."""
    source: str = ""
    """What puts it there: a link, a body received, a gear."""

    @property
    def text(self) -> str:
        """Its mass in symbols."""
        return self.symbols[0] if len(self.symbols) == 1 else f"({' + '.join(self.symbols)})"


@dataclass(frozen=True)
class CounterMass:
    """A counter-mass: the place, its mass and where it came to lie."""

    place: Place
    mass: float
    """[kg]."""
    position: Floats
    """From the body's reduction joint, in the body's frame, (2,) [m]."""
    inertia: float
    """About its own centre [kg m2]."""

    @property
    def symbol(self) -> str:
        """Such as m3*."""
        return f"m{self.place.name}*"


@dataclass(frozen=True)
class ForceBalance:
    """A body whose centre of mass, with what it carries, is at its reduction joint."""

    body: str
    joint: str
    loads: tuple[Load, ...]
    counters: tuple[CounterMass, ...]
    shares: Mapping[str, float]
    """Point masses that stand for it, by joint: one, or two of a two-point body [kg]."""
    residual: Floats
    """First moment left about the reduction joint, (2,) [kg m]."""

    @property
    def mass(self) -> float:
        """Of the body with all that it carries [kg]."""
        return sum(self.shares.values())

    @property
    def symbols(self) -> tuple[str, ...]:
        """Symbols whose sum is its mass."""
        counters = {counter.symbol: counter.symbol for counter in self.counters}
        found: list[str] = []
        for load in self.loads:
            found += load.symbols
            found += [counters.pop(f"{load.text}*")] if f"{load.text}*" in counters else []
        return (*found, *counters)


def pin(linkage: Linkage, joint: str, body: str) -> Point:
    """A joint's place in a body's frame; the ground's own places need not be known."""
    point = linkage.joints[joint].end(body).point
    if point is None:
        raise ModelError(f"joint {joint} of {linkage.name}: its place on {body} is not given")
    return point
