"""What a logger makes of a signal: anti-alias filter, instants, noise, the sensor's range, the converter's steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..rig import Column
from ..rig.bench import Logger
from .filters import low_pass
from .sampling import sampled

CLOCK = 1_000_003
"""Which stream of a logger's seed its clock draws from, beside those of the channels."""


@dataclass(frozen=True)
class Log:
    """What one logger recorded of one run."""

    time: Floats
    """On its own clock, from its own start, (n,) [s]."""
    columns: Mapping[str, Floats]
    """By channel, in the unit in which it is written, (n,)."""
    true: Floats
    """When the samples were taken, from the start of the motion, (n,) [s]; no log tells it."""
    lost: int = 0
    """Samples that are missing."""


def record(
    logger: Logger,
    columns: Sequence[Column],
    time: Floats,
    signals: Mapping[str, Floats],
    seed: Sequence[int],
) -> Log:
    """Record the channels ``columns`` of ``signals`` (n,) [SI] at ``time`` (n,) [s]; at rest before and after.

    Every channel draws its noise from ``seed`` and its place among the columns, whatever other channels there are.
    """
    taken = sampled(logger, float(time[-1]), np.random.default_rng([*seed, CLOCK]))
    passed, read = _anti_aliased(logger, columns, time, signals), {}
    for i, column in enumerate(columns):
        rng = np.random.default_rng([*seed, i])
        read[column.channel] = reading(column, np.interp(taken.true, time, passed[column.channel]), rng)
    return Log(taken.own, read, taken.true, taken.lost)


def _anti_aliased(
    logger: Logger, columns: Sequence[Column], time: Floats, signals: Mapping[str, Floats]
) -> dict[str, Floats]:
    """The signals behind the logger's filter; what a controller computes does not pass it."""
    found = {column.channel: signals[column.channel] for column in columns}
    through = [column.channel for column in columns if not column.commanded]
    if logger.low_pass is None or not through:
        return found
    passed = low_pass(np.column_stack([found[name] for name in through]), logger.low_pass, float(time[1] - time[0]))
    return found | dict(zip(through, passed.T, strict=True))


def reading(column: Column, signal: Floats, rng: np.random.Generator) -> Floats:
    """A signal (n,) [SI] with noise, clipped to the range, in steps of the resolution, in the unit of the log."""
    values = signal + rng.normal(0.0, column.noise, len(signal)) if column.noise else signal
    if column.range is not None:
        values = np.clip(values, -column.range, column.range)
    if column.resolution:
        values = np.round(values / column.resolution) * column.resolution
    return column.written(values) + 0.0  # a logger writes no negative zero
