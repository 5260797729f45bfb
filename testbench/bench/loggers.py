"""What a logger makes of a signal: its own instants, noise, the sensor's range, steps of the converter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..rig import Column
from ..rig.bench import Logger


@dataclass(frozen=True)
class Log:
    """What one logger recorded of one run."""

    time: Floats
    """On its own clock, from its own start, (n,) [s]."""
    columns: Mapping[str, Floats]
    """By channel, in the unit in which it is written, (n,)."""


def instants(logger: Logger, end: float) -> tuple[Floats, Floats]:
    """Its own time, from zero, and the true time of each sample until ``end``, (n,) [s].

    t = start + own / (1 + drift).
    """
    pace = 1.0 + 1e-6 * logger.drift_ppm
    count = int(max(end - logger.start, 0.0) * pace * logger.rate) + 1
    own = np.arange(count) / logger.rate
    return own, logger.start + own / pace


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
    own, true = instants(logger, float(time[-1]))
    read = {}
    for i, column in enumerate(columns):
        rng = np.random.default_rng([*seed, i])
        read[column.channel] = reading(column, np.interp(true, time, signals[column.channel]), rng)
    return Log(own, read)


def reading(column: Column, signal: Floats, rng: np.random.Generator) -> Floats:
    """A signal (n,) [SI] with noise, clipped to the range, in steps of the resolution, in the unit of the log."""
    values = signal + rng.normal(0.0, column.noise, len(signal)) if column.noise else signal
    if column.range is not None:
        values = np.clip(values, -column.range, column.range)
    if column.resolution:
        values = np.round(values / column.resolution) * column.resolution
    return column.written(values) + 0.0  # a logger writes no negative zero
