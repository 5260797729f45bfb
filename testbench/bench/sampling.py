"""When a logger really takes its samples: a clock that drifts, scatter of the instants, lost samples."""

from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..rig.bench import Logger


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
