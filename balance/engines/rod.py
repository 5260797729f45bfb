"""The connecting rod as point masses: what each replacement keeps.

Equal to the rod are masses with the same mass, the same centre of mass, and (third condition) the same inertia. Two
masses at the pins keep the first two: the shaking force is true, the moment is off by the couple -dI chi''.
"""

from dataclasses import dataclass

from ..errors import DataError
from .slidercrank import SliderCrank


@dataclass(frozen=True)
class PointMass:
    """A mass on the rod's line."""

    place: str
    mass: float
    """[kg]"""
    at: float
    """Distance from the crank pin, towards the piston pin [m]."""


@dataclass(frozen=True)
class Replacement:
    """Point masses in the rod's place."""

    name: str
    masses: tuple[PointMass, ...]
    missing_inertia: float
    """Inertia of the rod minus that of the masses, about the rod's centre of mass [kg m2]; zero keeps the third
    condition."""


def replacements(crank: SliderCrank) -> list[Replacement]:
    """Two masses at the pins; two masses of which one at the crank pin, exact; three masses, exact.

    The two at the pins: m_B = m l_C / l, m_C = m l_B / l. Exact with one at the pin: the other at the centre of
    percussion, I / (m l_B) beyond the centre. Three: m_B = I / (l_B l), m_C = I / (l_C l), the rest at the centre.
    """
    if not 0.0 < crank.rod_centre < crank.rod_length:
        raise DataError(
            f"centre of the rod at {crank.rod_centre:g} m of {crank.rod_length:g} m: expected it between the two pins"
        )
    return [_at_pins(crank), _percussion(crank), _three(crank)]


def _at_pins(crank: SliderCrank) -> Replacement:
    l_b, l_c = crank.rod_centre, crank.rod_length - crank.rod_centre
    masses = (
        PointMass("crank pin", crank.rod_mass * l_c / crank.rod_length, 0.0),
        PointMass("piston pin", crank.rod_mass * l_b / crank.rod_length, crank.rod_length),
    )
    return _replacement("two masses at the pins", crank, masses)


def _percussion(crank: SliderCrank) -> Replacement:
    beyond = crank.rod_inertia / (crank.rod_mass * crank.rod_centre)
    whole = crank.rod_centre + beyond
    masses = (
        PointMass("crank pin", crank.rod_mass * beyond / whole, 0.0),
        PointMass("centre of percussion", crank.rod_mass * crank.rod_centre / whole, whole),
    )
    return _replacement("two masses, one at the centre of percussion", crank, masses)


def _three(crank: SliderCrank) -> Replacement:
    l_b, l_c, length = crank.rod_centre, crank.rod_length - crank.rod_centre, crank.rod_length
    first, last = crank.rod_inertia / (l_b * length), crank.rod_inertia / (l_c * length)
    masses = (
        PointMass("crank pin", first, 0.0),
        PointMass("centre of mass", crank.rod_mass - first - last, l_b),
        PointMass("piston pin", last, length),
    )
    return _replacement("three masses", crank, masses)


def _replacement(name: str, crank: SliderCrank, masses: tuple[PointMass, ...]) -> Replacement:
    inertia = sum(m.mass * (m.at - crank.rod_centre) ** 2 for m in masses)
    missing = crank.rod_inertia - inertia
    return Replacement(name, masses, missing if abs(missing) > 1e-12 * crank.rod_inertia else 0.0)
