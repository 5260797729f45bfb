"""Draws of what a record has beyond its signal, and the largest values that signals have in them.

Runs of one noise share the draws. Only samples near the extremes of a signal are looked at: where noise is small they
are few, and where it is not, few of each draw can become its extreme for any of the signals.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal
from zlib import crc32

import numpy as np

from balance.arrays import Floats

from .metrics import Measure, gain_of_record
from .noise_floor import Noise

DRAWS = 400
"""Simulated records of noise: a quantile of 2.5 % is known to 0.8 %."""
FEWEST = 60
"""Of long records."""
_MOST = 8_000_000
"""Samples that are simulated, unless of the fewest draws."""
_REACH = 7.0
"""Standard deviations of noise below the largest value of a signal from which a sample is never the largest."""
_FEW = 4
"""Signals whose samples are compared one and all."""
_AT_ONCE = 1 << 18
"""Samples that are compared at a time: they stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Records of noise in the band, in parts that follow each other."""

    parts: tuple[Floats, ...]
    """(m, draws) each [unit]"""
    powers: Floats
    """Mean square of the noise that each was drawn from: what runs in one noise share, (draws,) [unit^2]."""

    @cached_property
    def mean_squares(self) -> Floats:
        """(draws,) [unit^2]"""
        total = sum(np.einsum("ij,ij->j", part, part) for part in self.parts)
        return np.asarray(total / sum(len(part) for part in self.parts), dtype=float)

    @cached_property
    def ends(self) -> tuple[Floats, Floats]:
        """Largest and smallest values, (draws,) each [unit]."""
        high, low = ([end(part, axis=0) for part in self.parts] for end in (np.max, np.min))
        return np.max(high, axis=0).astype(float), np.min(low, axis=0).astype(float)

    def with_signals(self, signals: Floats) -> list[tuple[Floats, Floats]]:
        """Each part with that of signals (k, n)."""
        cuts = np.cumsum([len(part) for part in self.parts])[:-1]
        return list(zip(self.parts, np.split(signals, cuts, axis=1), strict=True))


@dataclass(frozen=True)
class NoiseRecords:
    """Noise and what else is not known of one record; the noise in multiples of ``scale``."""

    draws: Draws
    rounding: Floats
    """What a step that is not dithered adds to a reading, (draws,) [unit, or its square]."""
    scale: float = 1.0
    largest: float = 1.0
    """Of the noise's standard deviation over time [-]."""

    @property
    def powers(self) -> Floats:
        """Of the noise that each was drawn from, (draws,) [unit^2]."""
        return self.scale**2 * self.draws.powers

    @property
    def mean_squares(self) -> Floats:
        """Of the noise alone, (draws,) [unit^2]."""
        return self.scale**2 * self.draws.mean_squares

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Largest and smallest values of the noise alone, (draws,) each [unit]."""
        high, low = self.draws.ends
        return self.scale * high, self.scale * low

    def products(self, signal: Floats) -> Floats:
        """Mean of a signal (n,) [-] times each draw, (draws,) [unit]."""
        parts = self.draws.with_signals(signal[None])
        return np.asarray(self.scale * sum(some[0].astype(part.dtype) @ part for part, some in parts) / len(signal))

    def highest(self, signals: Floats, sign: Literal[1, -1] = 1) -> Floats:
        """Largest value of signals (k, n) [unit] in each draw times ``sign``, (draws, k) [unit]."""
        tops = signals.max(axis=1, keepdims=True)
        below = ((signals - tops) / self.scale).astype(np.float32)
        reach = _REACH * self.largest * float(self.draws.powers.max()) ** 0.5
        chosen = []
        for part, levels in self.draws.with_signals(below):
            near = np.flatnonzero(levels.max(axis=0) >= -reach)
            blocks = np.array_split(near, near.size * part.shape[1] // _AT_ONCE + 1)
            chosen += [(sign * part[rows], levels[:, rows]) for rows in blocks if rows.size]
        return np.asarray((self.scale * _highest(chosen) + tops).T)


def _highest(chosen: Sequence[tuple[Floats, Floats]]) -> Floats:
    """Largest values of levels (k, m) in noise (m, draws), over blocks of both, (k, draws)."""
    if len(chosen[0][1]) <= _FEW:
        return np.max([[(noise + row[:, None]).max(axis=0) for row in levels] for noise, levels in chosen], axis=0)
    least = np.max([(noise + levels.min(axis=0)[:, None]).max(axis=0) for noise, levels in chosen], axis=0)
    draws, values, rows = [], [], []
    for noise, levels in chosen:
        sample, draw = np.nonzero(noise + levels.max(axis=0)[:, None] >= least)
        draws.append(draw)
        values.append(noise[sample, draw])
        rows.append(levels[:, sample])
    draw = np.concatenate(draws)
    order = np.argsort(draw, kind="stable")
    starts = np.searchsorted(draw[order], np.arange(len(least)))
    return np.maximum.reduceat((np.concatenate(values) + np.concatenate(rows, axis=1))[:, order], starts, axis=1)


@lru_cache(maxsize=2)
def noise_draws(noise: Noise, measure: Measure, count: int, rate_hz: float) -> Draws:
    """Draws of ``count`` samples in the band of a measure.

    Records of about the same length share them: of longer ones they take what is next to both ends.
    """
    coarse = 1 << max(count.bit_length() - 5, 0)
    drawn, powers = _drawn(noise, measure, -(-count // coarse) * coarse, float(f"{rate_hz:.4g}"))
    first, excess = count // 2, len(drawn) - count
    return Draws((drawn[:first], drawn[first + excess :]), powers)


@lru_cache(maxsize=2)
def _drawn(noise: Noise, measure: Measure, count: int, rate_hz: float) -> tuple[Floats, Floats]:
    """Draws (n, draws) and powers (draws,), seeded by the noise: the same noise gives the same draws.

    They are made of cosines at multiples of half a period a record, which are even about both ends, like noise that
    the band's filter mirrors there.
    """
    from scipy.fft import idct

    seconds, number = count / rate_hz, int(np.clip(_MOST // count, FEWEST, DRAWS))
    rng = np.random.default_rng(crc32(np.ascontiguousarray(noise.density).tobytes()))
    gain = gain_of_record(measure, count, seconds)
    used = int(np.flatnonzero(gain > 1e-3)[-1]) + 1
    sizes = noise.draws(np.arange(used) / (2.0 * seconds), gain[:used], number, rng) / np.float32(seconds**0.5)
    sizes[:, 0] = 0.0
    powers = 0.5 * np.einsum("ij,ij->i", sizes, sizes).astype(float)
    sizes *= rng.standard_normal(sizes.shape, dtype=np.float32)
    sizes *= np.float32((count / 2.0) ** 0.5)
    return np.ascontiguousarray(idct(sizes, n=count, norm="ortho").T), powers
