"""Bearing reactions of a rotor that turns at constant speed."""

from collections.abc import Sequence

from ..errors import DataError
from .rotor import Unbalance


def loads(unbalances: Sequence[Unbalance], bearings: Sequence[float], speed: float) -> tuple[complex, complex]:
    """Rotating force of the unbalances on the two bearings, at angles from the rotor's mark [N].

    F_B = omega^2 sum U_i (z_i - z_A) / (z_B - z_A), F_A the rest: the couple is in it. Bearings at [m], speed [rad/s].
    Raises DataError where there are not two bearings in two places.
    """
    if len(bearings) != 2 or bearings[0] == bearings[1]:
        raise DataError(f"bearings: expected two, in two places, found {', '.join(f'{z:g} m' for z in bearings)}")
    first, second = bearings
    share = [(u.at - first) / (second - first) for u in unbalances]
    right = speed**2 * sum((u.vector * s for u, s in zip(unbalances, share, strict=True)), 0j)
    left = speed**2 * sum((u.vector * (1.0 - s) for u, s in zip(unbalances, share, strict=True)), 0j)
    return left, right


def weights(mass: float, centre: float, bearings: Sequence[float], gravity: float) -> tuple[float, float]:
    """What the weight of a horizontal rotor lays on the two bearings, standing still in space [N]."""
    first, second = bearings
    right = mass * gravity * (centre - first) / (second - first)
    return mass * gravity - right, right
