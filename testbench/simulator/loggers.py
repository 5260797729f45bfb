"""What a logger makes of a signal: anti-alias filter, sampling instants, noise, range, quantization.

Filters are analogue: their exact response to a signal that is linear between its samples, from rest. A clock starts
late, drifts, scatters from sample to sample, and loses samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import linear_response

from ..rig import Column
from ..rig.bench import Logger


def low_pass(signal: Floats, corner: float, step: float) -> Floats:
    """Fourth-order Butterworth filter of a signal (n, ...) [unit], (n, ...) [unit]; ``corner`` [Hz], ``step`` [s].

    Two sections w^2 / (s^2 + s w / Q + w^2); at rest before the first sample.
    """
    omega, rest, passed = 2.0 * np.pi * corner, signal[0], signal - signal[0]
    for angle in (np.pi / 8.0, 3.0 * np.pi / 8.0):
        section = np.array([[0.0, 1.0], [-(omega**2), -2.0 * np.cos(angle) * omega]])
        passed = linear_response(section, np.array([[0.0], [omega**2]]), passed[..., None], step)[..., 0]
    return passed + rest


def high_pass(signal: Floats, corner: float, step: float) -> Floats:
    """First-order high pass s / (s + w) of a signal (n, ...) [unit], as of AC coupling, (n, ...) [unit].

    ``corner`` [Hz], ``step`` [s]; zero at the first sample.
    """
    omega, moved = 2.0 * np.pi * corner, signal - signal[0]
    return moved - linear_response(np.array([[-omega]]), np.array([[omega]]), moved[..., None], step)[..., 0]


@dataclass(frozen=True)
class Sampling:
    """The samples that a logger kept."""

    logged: Floats
    """Time in the log, from its start, (n,) [s]."""
    true_time: Floats
    """True instants from the start of the motion, (n,) [s]."""
    lost: int = 0
    """Samples missing between the first and the last."""


def start_logger(logger: Logger, rng: np.random.Generator) -> Logger:
    """The logger of one run: start and drift drawn about those that the rig states."""
    start = logger.start + logger.start_scatter * float(rng.normal())
    drift = logger.drift_ppm + logger.drift_scatter_ppm * float(rng.normal())
    return logger.model_copy(update={"start": start, "drift_ppm": drift})


def sample_instants(logger: Logger, end: float) -> tuple[Floats, Floats]:
    """Time in the log, from zero, and true time of each sample until ``end`` [s], (n,) [s] each.

    t = start + own / (1 + drift).
    """
    pace = 1.0 + 1e-6 * logger.drift_ppm
    count = int(max(end - logger.start, 0.0) * pace * logger.rate) + 1
    own = np.arange(count) / logger.rate
    return own, logger.start + own / pace


def draw_samples(logger: Logger, end: float, rng: np.random.Generator) -> Sampling:
    """The samples until ``end`` [s]. A recorded clock logs when they were taken; a uniform one counts those kept."""
    own, true = sample_instants(logger, end)
    if not is_irregular(logger):
        return Sampling(own, true)
    scatter = np.clip(rng.normal(0.0, logger.jitter, len(own)), -0.45 / logger.rate, 0.45 / logger.rate)
    scatter[0] = 0.0  # time is counted from the first sample
    # Which samples are kept, (n,); the first always is.
    count = len(own)
    kept = rng.random(count) >= logger.lost
    blocks = rng.poisson(logger.dropouts_per_minute / 60.0 * count / logger.rate)
    for begin in rng.integers(0, count, blocks):
        kept[begin : begin + max(1, round(logger.dropout * logger.rate))] = False
    kept[0] = True
    if logger.clock == "uniform":
        own = own[: int(kept.sum())]
    else:
        own = (own + scatter * (1.0 + 1e-6 * logger.drift_ppm))[kept]
    return Sampling(own, (true + scatter)[kept], int((~kept).sum()))


def is_irregular(logger: Logger) -> bool:
    """Whether its samples are jittered or incomplete."""
    return bool(logger.jitter or logger.lost or logger.dropouts_per_minute)


_CLOCK_STREAM = 1_000_003
"""Number of the clock's stream of random numbers, apart from those of the channels."""


@dataclass(frozen=True)
class Log:
    """What one logger recorded of one run."""

    time: Floats
    """Time in the log, from its start, (n,) [s]."""
    columns: Mapping[str, Floats]
    """By channel, (n,) [unit of the log]."""
    true_time: Floats
    """True instants from the start of the motion, (n,) [s]; no log contains them."""
    lost: int = 0
    """Samples that are missing."""


def record_log(
    logger: Logger,
    columns: Sequence[Column],
    time: Floats,
    signals: Mapping[str, Floats],
    seed: Sequence[int],
) -> Log:
    """Record the channels ``columns`` of ``signals`` (n,) [SI] at ``time`` (n,) [s]; at rest before and after.

    The noise of a channel depends on ``seed`` and its place among the columns, not on other channels.
    """
    taken = draw_samples(logger, float(time[-1]), np.random.default_rng([*seed, _CLOCK_STREAM]))
    passed, read = _anti_aliased(logger, columns, time, signals), {}
    for i, column in enumerate(columns):
        rng = np.random.default_rng([*seed, i])
        read[column.channel] = digitized(column, np.interp(taken.true_time, time, passed[column.channel]), rng)
    return Log(taken.logged, read, taken.true_time, taken.lost)


def _anti_aliased(
    logger: Logger, columns: Sequence[Column], time: Floats, signals: Mapping[str, Floats]
) -> dict[str, Floats]:
    """The signals after the logger's filter, which commanded ones do not pass."""
    found = {column.channel: signals[column.channel] for column in columns}
    through = [column.channel for column in columns if not column.commanded]
    if logger.low_pass is None or not through:
        return found
    passed = low_pass(np.column_stack([found[name] for name in through]), logger.low_pass, float(time[1] - time[0]))
    return found | dict(zip(through, passed.T, strict=True))


def digitized(column: Column, signal: Floats, rng: np.random.Generator) -> Floats:
    """A signal (n,) [SI] with noise, clipped to the range and quantized, (n,) [unit of the log]."""
    values = signal + rng.normal(0.0, column.noise, len(signal)) if column.noise else signal
    if column.range is not None:
        values = np.clip(values, -column.range, column.range)
    if column.resolution:
        values = np.round(values / column.resolution) * column.resolution
    return column.written(values) + 0.0  # a logger writes no negative zero
