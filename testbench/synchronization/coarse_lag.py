"""The offset between two clocks, roughly: the lag at which one side explains most of the other.

The share of energy explained is computed at all lags at once, by fast Fourier transforms of decimated signals, and
within the overlap of each lag, so that a long overlap is not favoured. A match that chance explains, or one of several
equal ones, is refused.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.estimate import beta_quantile

from ..errors import AnalysisError
from .signal_preparation import Flags, PreparedSignals

MOST_SAMPLES = 1 << 17
"""Of either side in the search; longer signals are decimated further."""
CHUNK_S = 60.0
"""Longest segment of the own clock that is searched for: 100 ppm of drift smear it by 6 ms."""
LEAST_OVERLAP = 0.3
"""Of the energy of each side that must lie in the overlap of a lag."""
CHANCE_PROBABILITY = 1e-6
"""Probability of a match by chance at any lag."""
SURE_SHARE = 0.9
"""Share of the energy that is never explained by chance, however few independent samples there are."""
SIGNIFICANCE = 6.0
"""Standard deviations by which the best lag must exceed the second best."""
CLEAR_RATIO = 5.0
"""A residual so many times that of the best lag is no match, whatever the scatter."""
EQUAL_SHARE = 1e-4
"""Residual share of the energy below which two lags fit equally well."""


@dataclass(frozen=True)
class CoarseLag:
    """An offset with the segment on which it was found."""

    offset: float
    """Reference less own [s]."""
    explained: float
    """Share of the energy."""
    segment: tuple[float, float]
    """On the own clock [s]."""


class _KnownSamples(NamedTuple):
    """Weights of the samples: one, or zero where a gap disturbs them, (m,) and (n,)."""

    own: Floats
    reference: Floats

    @property
    def complete(self) -> bool:
        """Whether neither side has a gap."""
        return bool(self.own.all() and self.reference.all())


def search_lag(content: PreparedSignals) -> CoarseLag:
    """The offset that explains most. Raises AnalysisError if it is no better than chance, or not the only one."""
    step = max(content.own.step, content.reference.step, _span(content) / MOST_SAMPLES)
    begin, end = _chunk(content)
    own_signals = _resampled(content.own.time, content.own_signals, np.arange(begin, end + 0.5 * step, step))
    instants = np.arange(content.reference.start, content.reference.time[-1] + 0.5 * step, step)
    columns = [_resampled(content.reference.time, c, instants) for c in _all_columns(content)]
    known = _known(content, begin + step * np.arange(len(own_signals)), instants)
    own_signals, columns = own_signals * known.own[:, None], [c * known.reference[:, None] for c in columns]
    residual, overlap = _residual_shares(columns, own_signals, content, known)
    best = int(np.argmin(residual))
    independent = _independent(columns, own_signals) * float(overlap[best])
    _refuse_chance(
        content, float(residual[best]), _chance(independent, sum(c.shape[1] for c in columns), len(residual))
    )
    lag = best - (len(own_signals) - 1)
    _refuse_ambiguity(content, residual, best, _scatter(columns, own_signals, lag, known), step)
    lag_s = (lag + _parabola_vertex(residual, best)) * step
    return CoarseLag(content.reference.start + lag_s - begin, 1.0 - float(residual[best]), (begin, end))


def _known(content: PreparedSignals, own: Floats, reference: Floats) -> _KnownSamples:
    return _KnownSamples((~content.in_own_gap(own)).astype(float), (~content.in_gap(reference)).astype(float))


def _all_columns(content: PreparedSignals) -> list[Floats]:
    """The columns of each signal; a fixed part is one more column, of any size, in this search."""
    scale = [float(np.sqrt(np.mean(fixed**2))) for fixed in content.fixed.T]
    return [
        np.column_stack([c, fixed / size]) if size > 0.0 else c
        for c, fixed, size in zip(content.reference_columns, content.fixed.T, scale, strict=True)
    ]


def _span(content: PreparedSignals) -> float:
    return max(content.own.count * content.own.step, content.reference.count * content.reference.step)


def _chunk(content: PreparedSignals) -> tuple[float, float]:
    """The CHUNK_S of the own clock that hold most of the energy."""
    first, last = content.own.start, float(content.own.time[-1])
    if last - first <= CHUNK_S:
        return first, last
    energy = np.cumsum(np.sum((content.own_signals / content.own_signals.std(axis=0)) ** 2, axis=1))
    width = int(CHUNK_S / content.own.step)
    begin = int(np.argmax(energy[width:] - energy[:-width]))
    return float(content.own.time[begin]), float(content.own.time[begin + width])


def _resampled(time: Floats, values: Floats, instants: Floats) -> Floats:
    return np.column_stack([np.interp(instants, time, v) for v in values.T])


def _residual_shares(
    columns: list[Floats], own_signals: Floats, content: PreparedSignals, known: _KnownSamples
) -> tuple[Floats, Floats]:
    """Residual share of the energy in the overlap at each lag, (lags,), and the share that is in the overlap."""
    count, size = len(own_signals), len(columns[0])
    energy, residual, complete = (
        np.zeros(count + size - 1),
        np.zeros(count + size - 1),
        float(np.linalg.norm(own_signals)),
    )
    room = np.ones(count + size - 1, dtype=bool)
    for signal, basis in zip(own_signals.T, columns, strict=True):
        here, explained, enough = _explained(basis, signal / complete, content.signed, known)
        energy, residual, room = energy + here, residual + here - explained, room & enough
    if not room.any():
        raise AnalysisError(f"{content.name}: no lag has enough overlap: name channels that recorded the same motion")
    share = np.where(room, residual / np.maximum(energy, np.finfo(float).tiny), 1.0)
    return share.clip(0.0, 1.0), energy


def _explained(basis: Floats, signal: Floats, signed: bool, known: _KnownSamples) -> tuple[Floats, Floats, Flags]:
    """At each lag: energy of the signal in the overlap, the part that the basis explains, and whether that is enough.

    The overlap is where both sides are known.
    """
    count, size = len(signal), len(basis)
    cross = np.column_stack([_correlation(column, signal) for column in basis.T])
    if known.complete:
        energy = _overlap_sums(signal**2, count, size, own=True)
    else:
        energy = _correlation(known.reference, signal**2).clip(min=0.0)
    pairs = [(i, j) for i in range(basis.shape[1]) for j in range(i + 1)]
    gram = np.empty((len(cross), basis.shape[1], basis.shape[1]))
    for i, j in pairs:
        both = basis[:, i] * basis[:, j]
        summed = _overlap_sums(both, count, size, own=False) if known.complete else _correlation(both, known.own)
        gram[:, i, j] = gram[:, j, i] = summed
    complete = np.sum(basis**2)
    needed = LEAST_OVERLAP * complete * min(1.0, count / size)
    enough = (np.trace(gram, axis1=1, axis2=2) >= needed) & (energy >= LEAST_OVERLAP * energy.max())
    gram += 1e-6 * complete * np.eye(basis.shape[1])
    if signed:
        cross = cross.clip(min=0.0)
    explained = np.einsum("li,li->l", cross, np.linalg.solve(gram, cross[:, :, None])[:, :, 0])
    return energy, explained, enough


def _correlation(column: Floats, signal: Floats) -> Floats:
    """sum_i column[i + lag] signal[i], for lags from -(len(signal) - 1)."""
    from scipy.signal import correlate

    return np.asarray(correlate(column, signal, method="fft"))


def _overlap_sums(values: Floats, count: int, size: int, own: bool) -> Floats:
    """Sum of ``values`` over the overlap at each lag, of the own side (count,) or of the reference (size,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    lag = np.arange(-(count - 1), size)
    first, last = np.maximum(lag, 0), np.minimum(size, count + lag)
    return total[last - lag] - total[first - lag] if own else total[last] - total[first]


def _independent(columns: list[Floats], own_signals: Floats) -> float:
    """Independent samples of both sides: the reciprocal of the variance of a correlation by chance."""
    size = 2 * max(len(own_signals), len(columns[0]))
    own = np.sum(np.abs(np.fft.rfft(own_signals, size, axis=0)) ** 2, axis=1)
    other = np.sum(np.abs(np.fft.rfft(np.hstack(columns), size, axis=0)) ** 2, axis=1)
    return float(own.sum() * other.sum() / max(float((own * other).sum()), 1e-300))


def _chance(independent: float, columns: int, lags: int) -> float:
    """Share of the energy that columns explain by chance at the best of many lags: a quantile of a beta variable."""
    if not independent > columns:
        return 1.0
    return 1.0 - beta_quantile(CHANCE_PROBABILITY / lags, 0.5 * (independent - columns), 0.5 * columns)


def _refuse_chance(content: PreparedSignals, residual: float, chance: float) -> None:
    """Raise AnalysisError where the best lag explains no more than chance does."""
    if 1.0 - residual > min(chance, SURE_SHARE):
        return
    if chance < SURE_SHARE:
        raise AnalysisError(
            f"{content.name}: no common content: the best lag explains {1.0 - residual:.2%} of the signal, and "
            f"{chance:.2%} may be chance; name channels that recorded the same"
        )
    raise AnalysisError(
        f"{content.name}: ambiguous: the best lag explains {1.0 - residual:.1%} of the signal, which is so slow or so "
        f"nearly a pure sine that chance may explain as much; {_cutoff(content)}; else give a tap, or a trigger"
    )


def _scatter(columns: list[Floats], own_signals: Floats, lag: int, known: _KnownSamples) -> float:
    """Standard deviation of the logarithm of the residual at a lag: sqrt(2 / its independent samples)."""
    first, last = max(lag, 0), min(len(columns[0]), len(own_signals) + lag)
    power = np.zeros((last - first) // 2 + 1)
    own, reference = known.own[first - lag : last - lag], known.reference[first:last]
    for column, signal in zip(columns, (own_signals[first - lag : last - lag] * reference[:, None]).T, strict=True):
        basis = column[first:last] * own[:, None]
        power += np.abs(np.fft.rfft(signal - basis @ np.linalg.lstsq(basis, signal, rcond=None)[0])) ** 2
    return float(np.sqrt(np.sum(power**2) / max(float(np.sum(power)) ** 2, 1e-300)))


def _refuse_ambiguity(content: PreparedSignals, residual: Floats, best: int, scatter: float, step: float) -> None:
    """Raise AnalysisError where a lag beyond the slopes of the best one explains about as much."""
    half = 1.0 - 0.5 * (1.0 - residual[best])
    low, high = _slope_end(residual, best, half, -1), _slope_end(residual, best, half, +1)
    troughs = np.flatnonzero((residual[1:-1] <= residual[:-2]) & (residual[1:-1] <= residual[2:])) + 1
    others = troughs[(troughs < low) | (troughs > high)]
    if high - low >= len(residual) - 1:
        raise AnalysisError(
            f"{content.name}: ambiguous: every lag explains about the same: the signals are too slow to align by"
        )
    if not len(others):
        return
    second = int(others[np.argmin(residual[others])])
    margin = float(np.log((residual[second] + EQUAL_SHARE) / (residual[best] + EQUAL_SHARE)))
    if margin < (needed := float(min(SIGNIFICANCE * scatter, np.log(CLEAR_RATIO)))):
        raise AnalysisError(
            f"{content.name}: ambiguous: lags that are {abs(second - best) * step:.4g} s apart explain "
            f"{1.0 - residual[best]:.2%} and {1.0 - residual[second]:.2%} of the signal: the second leaves "
            f"{np.exp(margin):.2g} times what the best leaves unexplained, expected {np.exp(needed):.2g} times; "
            f"{_cutoff(content)}; else name channels that recorded the same (--pair), or record where the motion "
            "begins, a tap, or a trigger"
        )


def _cutoff(content: PreparedSignals) -> str:
    """What to do about what only one side recorded."""
    return f"a --cutoff below {content.cutoff:.3g} Hz leaves out vibration and noise that one side alone holds"


def _slope_end(residual: Floats, best: int, level: float, side: int) -> int:
    """Lag at which the residual first exceeds a level, from the best lag to one side."""
    beyond: Indices = np.flatnonzero(residual[best::side] > level)
    return best + side * int(beyond[0]) if len(beyond) else (0 if side < 0 else len(residual) - 1)


def _parabola_vertex(residual: Floats, best: int) -> float:
    """Vertex of the parabola through the least value and its neighbours, in lags from the least."""
    if not 0 < best < len(residual) - 1:
        return 0.0
    before, least, after = residual[best - 1 : best + 2]
    hessian = before - 2.0 * least + after
    return float(0.5 * (before - after) / hessian) if hessian > 0.0 else 0.0
