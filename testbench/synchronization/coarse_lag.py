"""The offset between two clocks, roughly: the lag at which the one side explains most of the other.

All lags at once, on thinned signals, by fast Fourier transforms; explained within the overlap of each lag, so that a
match is not favoured by a long overlap. What comes out of noise, or fits at several lags, is refused.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.estimate import beta_quantile

from ..errors import AnalysisError
from .signal_preparation import Flags, Prepared

MOST_SAMPLES = 1 << 17
"""Of either side in the search; beyond, signals are thinned further."""
CHUNK_S = 60.0
"""Longest stretch of the own clock that is searched for: 100 ppm of drift smear it by 6 ms."""
LEAST_OVERLAP = 0.3
"""Of the energy of each side that must lie in the overlap of a lag."""
UNLIKELY = 1e-6
"""Probability of a match by chance at any lag that is taken for none."""
PLAIN = 0.9
"""Share of the energy that is explained by no chance, however few independent samples there are."""
SIGNIFICANCE = 6.0
"""Standard deviations by which the best lag must stand out of the second best."""
CLEAR = 5.0
"""So many times more left unexplained than at the best lag is no match, whatever the scatter."""
EQUAL = 1e-4
"""Share of the energy left unexplained below which two lags fit equally well."""


@dataclass(frozen=True)
class CoarseLag:
    """An offset with the stretch that it was found on."""

    offset: float
    """Reference less own [s]."""
    explained: float
    """Share of the energy."""
    stretch: tuple[float, float]
    """On the own clock [s]."""


class _Known(NamedTuple):
    """One where a side is known, zero where a gap disturbs it, (m,) and (n,)."""

    own: Floats
    reference: Floats

    @property
    def whole(self) -> bool:
        """Whether neither side has a gap."""
        return bool(self.own.all() and self.reference.all())


def search_lag(content: Prepared) -> CoarseLag:
    """The offset that explains most. Raises AnalysisError if it is no better than chance, or not the only one."""
    step = max(content.own.step, content.reference.step, _span(content) / MOST_SAMPLES)
    begin, end = _chunk(content)
    seen = _resampled(content.own.time, content.seen, np.arange(begin, end + 0.5 * step, step))
    instants = np.arange(content.reference.start, content.reference.time[-1] + 0.5 * step, step)
    columns = [_resampled(content.reference.time, c, instants) for c in _all_columns(content)]
    known = _known(content, begin + step * np.arange(len(seen)), instants)
    seen, columns = seen * known.own[:, None], [c * known.reference[:, None] for c in columns]
    left, overlap = _left(columns, seen, content, known)
    best = int(np.argmin(left))
    independent = _independent(columns, seen) * float(overlap[best])
    _refuse_chance(content, float(left[best]), _chance(independent, sum(c.shape[1] for c in columns), len(left)))
    lag = best - (len(seen) - 1)
    _refuse_ambiguity(content.name, left, best, _scatter(columns, seen, lag, known), step)
    lag_s = (lag + _between(left, best)) * step
    return CoarseLag(content.reference.start + lag_s - begin, 1.0 - float(left[best]), (begin, end))


def _known(content: Prepared, own: Floats, reference: Floats) -> _Known:
    return _Known((~content.in_own_gap(own)).astype(float), (~content.in_gap(reference)).astype(float))


def _all_columns(content: Prepared) -> list[Floats]:
    """The columns of each signal; a fixed part is one more, of any size, while the lag is sought."""
    scale = [float(np.sqrt(np.mean(fixed**2))) for fixed in content.fixed.T]
    return [
        np.column_stack([c, fixed / size]) if size > 0.0 else c
        for c, fixed, size in zip(content.columns, content.fixed.T, scale, strict=True)
    ]


def _span(content: Prepared) -> float:
    return max(content.own.count * content.own.step, content.reference.count * content.reference.step)


def _chunk(content: Prepared) -> tuple[float, float]:
    """The CHUNK_S of the own clock that hold most of the energy."""
    first, last = content.own.start, float(content.own.time[-1])
    if last - first <= CHUNK_S:
        return first, last
    energy = np.cumsum(np.sum((content.seen / content.seen.std(axis=0)) ** 2, axis=1))
    width = int(CHUNK_S / content.own.step)
    begin = int(np.argmax(energy[width:] - energy[:-width]))
    return float(content.own.time[begin]), float(content.own.time[begin + width])


def _resampled(time: Floats, values: Floats, instants: Floats) -> Floats:
    return np.column_stack([np.interp(instants, time, v) for v in values.T])


def _left(columns: list[Floats], seen: Floats, content: Prepared, known: _Known) -> tuple[Floats, Floats]:
    """Share of the energy in the overlap that is left at each lag, (lags,), and the share that is in the overlap."""
    count, size = len(seen), len(columns[0])
    energy, left, whole = np.zeros(count + size - 1), np.zeros(count + size - 1), float(np.linalg.norm(seen))
    room = np.ones(count + size - 1, dtype=bool)
    for signal, basis in zip(seen.T, columns, strict=True):
        here, explained, held = _explained(basis, signal / whole, content.signed, known)
        energy, left, room = energy + here, left + here - explained, room & held
    if not room.any():
        raise AnalysisError(f"{content.name}: no lag has enough overlap")
    share = np.where(room, left / np.maximum(energy, np.finfo(float).tiny), 1.0)
    return share.clip(0.0, 1.0), energy


def _explained(basis: Floats, signal: Floats, signed: bool, known: _Known) -> tuple[Floats, Floats, Flags]:
    """At each lag: energy of the signal in the overlap, what of it the basis explains, and whether it holds enough.

    The overlap is where both sides are known.
    """
    count, size = len(signal), len(basis)
    cross = np.column_stack([_correlation(column, signal) for column in basis.T])
    if known.whole:
        energy = _sums(signal**2, count, size, own=True)
    else:
        energy = _correlation(known.reference, signal**2).clip(min=0.0)
    pairs = [(i, j) for i in range(basis.shape[1]) for j in range(i + 1)]
    gram = np.empty((len(cross), basis.shape[1], basis.shape[1]))
    for i, j in pairs:
        both = basis[:, i] * basis[:, j]
        summed = _sums(both, count, size, own=False) if known.whole else _correlation(both, known.own)
        gram[:, i, j] = gram[:, j, i] = summed
    whole = np.sum(basis**2)
    needed = LEAST_OVERLAP * whole * min(1.0, count / size)
    held = (np.trace(gram, axis1=1, axis2=2) >= needed) & (energy >= LEAST_OVERLAP * energy.max())
    gram += 1e-6 * whole * np.eye(basis.shape[1])
    if signed:
        cross = cross.clip(min=0.0)
    explained = np.einsum("li,li->l", cross, np.linalg.solve(gram, cross[:, :, None])[:, :, 0])
    return energy, explained, held


def _correlation(column: Floats, signal: Floats) -> Floats:
    """sum_i column[i + lag] signal[i], for lags from -(len(signal) - 1)."""
    from scipy.signal import correlate

    return np.asarray(correlate(column, signal, method="fft"))


def _sums(values: Floats, count: int, size: int, own: bool) -> Floats:
    """Sum of ``values`` over the overlap at each lag, of the own side (count,) or of the reference (size,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    lag = np.arange(-(count - 1), size)
    first, last = np.maximum(lag, 0), np.minimum(size, count + lag)
    return total[last - lag] - total[first - lag] if own else total[last] - total[first]


def _independent(columns: list[Floats], seen: Floats) -> float:
    """Independent samples in the product of both sides: the reciprocal of the variance of a chance correlation."""
    size = 2 * max(len(seen), len(columns[0]))
    own = np.sum(np.abs(np.fft.rfft(seen, size, axis=0)) ** 2, axis=1)
    other = np.sum(np.abs(np.fft.rfft(np.hstack(columns), size, axis=0)) ** 2, axis=1)
    return float(own.sum() * other.sum() / max(float((own * other).sum()), 1e-300))


def _chance(independent: float, columns: int, lags: int) -> float:
    """Share of the energy that so many columns explain by chance at the best of so many lags: a beta variable."""
    if not independent > columns:
        return 1.0
    return 1.0 - beta_quantile(UNLIKELY / lags, 0.5 * (independent - columns), 0.5 * columns)


def _refuse_chance(content: Prepared, left: float, chance: float) -> None:
    """A best lag that is none: it explains what chance explains."""
    if 1.0 - left > min(chance, PLAIN):
        return
    if chance < PLAIN:
        raise AnalysisError(
            f"{content.name}: no common content: the best lag explains {1.0 - left:.2%} of the signal, and "
            f"{chance:.2%} may be chance; name channels that saw the same"
        )
    raise AnalysisError(
        f"{content.name}: ambiguous: the best lag explains {1.0 - left:.1%} of the signal, which is so slow or so "
        "nearly a pure sine that chance may explain as much; give a tap, or a trigger"
    )


def _scatter(columns: list[Floats], seen: Floats, lag: int, known: _Known) -> float:
    """Standard deviation of the logarithm of what is left at a lag: sqrt(2 / its independent samples)."""
    first, last = max(lag, 0), min(len(columns[0]), len(seen) + lag)
    power = np.zeros((last - first) // 2 + 1)
    own, reference = known.own[first - lag : last - lag], known.reference[first:last]
    for column, signal in zip(columns, (seen[first - lag : last - lag] * reference[:, None]).T, strict=True):
        basis = column[first:last] * own[:, None]
        power += np.abs(np.fft.rfft(signal - basis @ np.linalg.lstsq(basis, signal, rcond=None)[0])) ** 2
    return float(np.sqrt(np.sum(power**2) / max(float(np.sum(power)) ** 2, 1e-300)))


def _refuse_ambiguity(name: str, left: Floats, best: int, scatter: float, step: float) -> None:
    """Another lag, beyond the slope of the best one, that explains about as much."""
    half = 1.0 - 0.5 * (1.0 - left[best])
    low, high = _edge(left, best, half, -1), _edge(left, best, half, +1)
    troughs = np.flatnonzero((left[1:-1] <= left[:-2]) & (left[1:-1] <= left[2:])) + 1
    others = troughs[(troughs < low) | (troughs > high)]
    if high - low >= len(left) - 1:
        raise AnalysisError(
            f"{name}: ambiguous: every lag explains about the same: the signals are too slow to align by"
        )
    if not len(others):
        return
    second = int(others[np.argmin(left[others])])
    margin = float(np.log((left[second] + EQUAL) / (left[best] + EQUAL)))
    if margin < min(SIGNIFICANCE * scatter, np.log(CLEAR)):
        raise AnalysisError(
            f"{name}: ambiguous: lags that are {abs(second - best) * step:.4g} s apart explain "
            f"{1.0 - left[best]:.2%} and {1.0 - left[second]:.2%} of the signal, as a periodic one lets them; give a "
            "record with its beginning, a tap, or a trigger"
        )


def _edge(left: Floats, best: int, level: float, side: int) -> int:
    """Where the share left first rises above a level, from the best lag to one side."""
    beyond: Indices = np.flatnonzero(left[best::side] > level)
    return best + side * int(beyond[0]) if len(beyond) else (0 if side < 0 else len(left) - 1)


def _between(left: Floats, best: int) -> float:
    """Where between lags the parabola through the least value and its neighbours has its vertex."""
    if not 0 < best < len(left) - 1:
        return 0.0
    before, least, after = left[best - 1 : best + 2]
    bend = before - 2.0 * least + after
    return float(0.5 * (before - after) / bend) if bend > 0.0 else 0.0
