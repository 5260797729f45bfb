"""Legs of a motion, each from rest to rest: from the path of a point, or from its acceleration."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

REST_S = 0.03
"""Shortest rest between two legs [s]."""


@dataclass(frozen=True)
class Leg:
    """From rest to rest."""

    start: float
    """[s]"""
    end: float
    chord: Floats
    """From the first place to the last, base axes, (3,) [m]."""
    bend: float
    """Largest distance from the chord, as a share of its length."""


def legs_of_path(time: Floats, place: Floats, speed: Floats, still: float) -> list[Leg]:
    """Legs of a path (n, 3) [m], where its speed (n,) [m/s] leaves ``still`` of the largest."""
    return [_leg(time[part], place[part] - place[part.start]) for part in _spans(speed, still, time)]


def legs_of_acceleration(time: Floats, acceleration: Floats, still: float) -> list[Leg]:
    """Legs of an acceleration (n, 3) [m/s2], integrated twice; speeds are zero at the ends of each."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    size = np.linalg.norm(acceleration, axis=1)
    legs = []
    for part in _spans(size, still, time):
        speed = _integral(acceleration[part], step)
        speed -= np.linspace(0.0, 1.0, len(speed))[:, None] * speed[-1]
        legs.append(_leg(time[part], _integral(speed, step)))
    return legs


def _integral(values: Floats, step: float) -> Floats:
    return np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * step * (values[1:] + values[:-1]), axis=0)])


def _leg(time: Floats, place: Floats) -> Leg:
    chord = place[-1]
    length = float(np.linalg.norm(chord))
    along = chord / length if length > 0.0 else np.zeros(3)
    beside = np.linalg.norm(place - np.outer(place @ along, along), axis=1)
    return Leg(float(time[0]), float(time[-1]), chord, float(beside.max()) / length if length else np.inf)


def _spans(size: Floats, still: float, time: Floats) -> Iterator[slice]:
    """Where something moves; what rests for less than REST_S between is no rest. A margin of one sample."""
    moving = np.flatnonzero(size > still * float(size.max(initial=0.0)))
    if not moving.size or not size.max() > 0.0:
        return
    gaps = np.flatnonzero(np.diff(time[moving]) > REST_S)
    for first, last in zip([0, *(gaps + 1)], [*gaps, len(moving) - 1], strict=True):
        yield slice(max(int(moving[first]) - 1, 0), min(int(moving[last]) + 2, len(time)))
