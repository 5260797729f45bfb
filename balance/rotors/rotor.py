"""A rigid rotor: its unbalances, its correction planes, its bearings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Unbalance:
    """A mass out of the axis, in one transverse plane of the rotor."""

    name: str
    vector: complex
    """Mass times radius, at its angle from the rotor's mark [kg m]."""
    at: float
    """Where along the axis [m]."""


@dataclass(frozen=True)
class Plane:
    """A plane in which correction masses may be mounted."""

    name: str
    at: float
    """Where along the axis [m]."""
    radius: float | None = None
    """Radius of the correction mass, where that is chosen [m]."""
    mass: float | None = None
    """Correction mass, where that is chosen [kg]."""


@dataclass(frozen=True)
class Rotor:
    """A rigid rotor as read from a sheet."""

    name: str
    unbalances: tuple[Unbalance, ...]
    planes: tuple[Plane, ...] = ()
    bearings: tuple[float, ...] = ()
    """Where the two bearings are along the axis [m]; empty where that is not known."""
    speed: float | None = None
    """Speed of rotation [rad/s]."""
    mass: float | None = None
    """Mass of the whole rotor [kg]."""
    centre: float | None = None
    """Where its centre of mass is along the axis [m]."""
    published: Mapping[str, complex] = field(default_factory=dict)
    """Corrections by plane that the source prints [kg m], to be shown beside."""
    source: str = ""


def force(unbalances: Sequence[Unbalance]) -> complex:
    """Sum of the unbalances: the static unbalance [kg m]. Times omega^2 it is the rotating force [N]."""
    return sum((u.vector for u in unbalances), 0j)


def couple(unbalances: Sequence[Unbalance], about: float) -> complex:
    """Sum of unbalance times distance from ``about`` [kg m2]: the couple's unbalance, in the plane of the forces.

    The moment vector itself is a quarter turn ahead: axis x force.
    """
    return sum((u.vector * (u.at - about) for u in unbalances), 0j)
