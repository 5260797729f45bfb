"""What a logger makes of a signal: anti-alias filter, instants, noise, the sensor's range, the converter's steps.

Analogue filters, as they answer a signal that is linear between its samples; at rest before the first.

When a logger really takes its samples: a clock that drifts, scatter of the instants, lost samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import linear_response

from ..rig import Column
from ..rig.bench import Logger


def low_pass(signal: Floats, corner: float, step: float) -> Floats:
    """Butterworth of fourth order, two sections w^2 / (s^2 + s w / Q + w^2), (n, ...); ``corner`` [Hz]."""
    omega, rest, passed = 2.0 * np.pi * corner, signal[0], signal - signal[0]
    for angle in (np.pi / 8.0, 3.0 * np.pi / 8.0):
        section = np.array([[0.0, 1.0], [-(omega**2), -2.0 * np.cos(angle) * omega]])
        passed = linear_response(section, np.array([[0.0], [omega**2]]), passed[..., None], step)[..., 0]
    return passed + rest


def high_pass(signal: Floats, corner: float, step: float) -> Floats:
    """First order, as of AC coupling or a charge amplifier: s / (s + w), (n, ...); zero at the first sample."""
    omega, moved = 2.0 * np.pi * corner, signal - signal[0]
    return moved - linear_response(np.array([[-omega]]), np.array([[omega]]), moved[..., None], step)[..., 0]


@dataclass(frozen=True)
class Sampling:
    """The samples that a logger kept."""

    own: Floats
    """Time that its log gives them, from its start, (n,) [s]."""
    true: Floats
    """When they were taken, from the start of the motion, (n,) [s]."""
    lost: int = 0
    """How many are missing between the first and the last."""


def started(logger: Logger, rng: np.random.Generator) -> Logger:
    """The logger as it is started for one run: start and drift drawn about what the rig states."""
    start = logger.start + logger.start_scatter * float(rng.normal())
    drift = logger.drift_ppm + logger.drift_scatter_ppm * float(rng.normal())
    return logger.model_copy(update={"start": start, "drift_ppm": drift})


def instants(logger: Logger, end: float) -> tuple[Floats, Floats]:
    """Its own time, from zero, and the true time of each sample until ``end``, (n,) [s].

    t = start + own / (1 + drift).
    """
    pace = 1.0 + 1e-6 * logger.drift_ppm
    count = int(max(end - logger.start, 0.0) * pace * logger.rate) + 1
    own = np.arange(count) / logger.rate
    return own, logger.start + own / pace


def sampled(logger: Logger, end: float, rng: np.random.Generator) -> Sampling:
    """The samples until ``end`` [s]. A recorded clock knows when they were taken; a uniform one counts what it kept."""
    own, true = instants(logger, end)
    if not is_irregular(logger):
        return Sampling(own, true)
    scatter = np.clip(rng.normal(0.0, logger.jitter, len(own)), -0.45 / logger.rate, 0.45 / logger.rate)
    scatter[0] = 0.0  # time is counted from the first sample
    kept = _kept(logger, len(own), rng)
    if logger.clock == "uniform":
        own = own[: int(kept.sum())]
    else:
        own = (own + scatter * (1.0 + 1e-6 * logger.drift_ppm))[kept]
    return Sampling(own, (true + scatter)[kept], int((~kept).sum()))


def is_irregular(logger: Logger) -> bool:
    """Whether its samples are not all there at even distances."""
    return bool(logger.jitter or logger.lost or logger.dropouts_per_minute)


def _kept(logger: Logger, count: int, rng: np.random.Generator) -> np.ndarray:
    """Which samples are kept, (n,); the first always is."""
    kept = rng.random(count) >= logger.lost
    blocks = rng.poisson(logger.dropouts_per_minute / 60.0 * count / logger.rate)
    for begin in rng.integers(0, count, blocks):
        kept[begin : begin + max(1, round(logger.dropout * logger.rate))] = False
    kept[0] = True
    return kept


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
