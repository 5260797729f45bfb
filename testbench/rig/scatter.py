"""How far a sensor's sensitivity matrix may be from one, as the rig states it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats

from ..errors import RigError

if TYPE_CHECKING:
    from .columns import Column
    from .effects import SensorErrors


def scatter(name: str, columns: "Sequence[Column]", errors: "SensorErrors") -> Floats:
    """Standard deviation of the entries of a sensor's sensitivity matrix, in SI, (k, k).

    Raises RigError where channels of unlike units talk and one has no range.
    """
    own: Floats = np.diag(np.full(len(columns), errors.sensitivity))
    if not errors.cross:
        return own
    return own + errors.cross * _between(name, columns) * (1.0 - np.eye(len(columns)))


def _between(name: str, columns: "Sequence[Column]") -> Floats:
    """What a cross-talk of one means between channels: one, and between unlike units the ratio of the ranges."""
    like = np.array([[a.dimensions == b.dimensions for b in columns] for a in columns])
    if like.all():
        return np.ones(like.shape)
    ranges = np.array([range_of(name, column) for column in columns])
    return np.where(like, 1.0, ranges[:, None] / ranges[None, :])


def range_of(name: str, column: "Column") -> float:
    """Of a channel of a sensor [SI], of which the rig states shares. Raises RigError where it states no range."""
    if column.range is None:
        raise RigError(
            f"bench.errors.{name}: channel {column.channel!r} has no range, of which offset, drift and cross-talk "
            f"between unlike units are shares: state sensors.{name}.range"
        )
    return column.range
