"""The offset between two clocks, roughly: the lag at which one side explains most of the other.

The share of energy explained is computed at all lags at once, by fast Fourier transforms of decimated signals, and
within the overlap of each lag, so that a long overlap is not favoured. A match that chance explains, or one of several
equal ones, is refused.
"""

import numpy as np

from balance.arrays import Floats, Mask, parabola_peak
from balance.estimation.estimate import beta_quantile

from ..errors import AnalysisError
from .signal_preparation import PreparedSignals

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


Known = tuple[Floats, Floats]
"""Weights of the samples of the own side (m,) and of the reference (n,): one, or zero where a gap disturbs them."""


def search_lag(content: PreparedSignals) -> tuple[float, tuple[float, float]]:
    """The offset, reference less own [s], that explains most, and the segment of the own clock that was looked at [s].

    Raises AnalysisError if it is no better than chance, or not the only one.
    """
    own, reference = content.own, content.reference
    step = max(own.step, reference.step, max(side.count * side.step for side in (own, reference)) / MOST_SAMPLES)
    begin, end = _chunk(content)
    own_signals = _resampled(own.time, content.own_signals, np.arange(begin, end + 0.5 * step, step))
    instants = np.arange(reference.start, reference.time[-1] + 0.5 * step, step)
    known = (
        (~content.in_own_gap(begin + step * np.arange(len(own_signals)))).astype(float),
        (~content.in_gap(instants)).astype(float),
    )
    own_signals, columns = own_signals * known[0][:, None], []
    for basis, fixed in zip(content.reference_columns, content.fixed.T, strict=True):
        size = float(np.sqrt(np.mean(fixed**2)))  # a fixed part is one more column, of any size, in this search
        basis = np.column_stack([basis, fixed / size]) if size > 0.0 else basis
        columns.append(_resampled(reference.time, basis, instants) * known[1][:, None])
    residual, overlap = _residual_shares(columns, own_signals, content, known)
    best = int(np.argmin(residual))
    independent = _independent(columns, own_signals) * float(overlap[best])
    _refuse_chance(content, residual, independent, sum(c.shape[1] for c in columns))
    whole = best - (len(own_signals) - 1)
    _refuse_ambiguity(content, residual, _scatter(columns, own_signals, whole, known), step)
    lag = whole + parabola_peak(-residual, best)[0]
    return float(reference.start + lag * step - begin), (begin, end)


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
    columns: list[Floats], own_signals: Floats, content: PreparedSignals, known: Known
) -> tuple[Floats, Floats]:
    """Residual share of the energy in the overlap at each lag, (lags,), and the share that is in the overlap."""
    lags = len(own_signals) + len(columns[0]) - 1
    energy, residual, room = np.zeros(lags), np.zeros(lags), np.ones(lags, dtype=bool)
    whole = float(np.linalg.norm(own_signals))
    for signal, basis in zip(own_signals.T, columns, strict=True):
        here, explained, enough = _explained(basis, signal / whole, content.signed, known)
        energy, residual, room = energy + here, residual + here - explained, room & enough
    if not room.any():
        raise AnalysisError(f"{content.name}: no lag has enough overlap: name channels that recorded the same motion")
    share = np.where(room, residual / np.maximum(energy, np.finfo(float).tiny), 1.0)
    return share.clip(0.0, 1.0), energy


def _explained(basis: Floats, signal: Floats, signed: bool, known: Known) -> tuple[Floats, Floats, Mask]:
    """At each lag: energy of the signal in the overlap, the part that the basis explains, and whether that is enough.

    The overlap is where both sides are known.
    """
    (count, (size, width)), complete = (len(signal), basis.shape), bool(known[0].all() and known[1].all())
    lag = np.arange(-(count - 1), size)
    first, last = np.maximum(lag, 0), np.minimum(size, count + lag)

    def overlap_sums(values: Floats, own: bool) -> Floats:
        """Sum over the overlap at each lag of ``values`` of the own side (count,) or of the reference (size,)."""
        if not complete:
            return _correlation(known[1], values).clip(min=0.0) if own else _correlation(values, known[0])
        total, shift = np.concatenate([[0.0], np.cumsum(values)]), lag if own else 0
        return total[last - shift] - total[first - shift]

    energy = overlap_sums(signal**2, own=True)
    gram = np.empty((len(lag), width, width))
    for i in range(width):
        for j in range(i + 1):
            gram[:, i, j] = gram[:, j, i] = overlap_sums(basis[:, i] * basis[:, j], own=False)
    whole = np.sum(basis**2)
    needed = LEAST_OVERLAP * whole * min(1.0, count / size)
    enough = (np.trace(gram, axis1=1, axis2=2) >= needed) & (energy >= LEAST_OVERLAP * energy.max())
    gram += 1e-6 * whole * np.eye(width)
    cross = np.column_stack([_correlation(column, signal) for column in basis.T])
    if signed:
        cross = cross.clip(min=0.0)
    explained = np.einsum("li,li->l", cross, np.linalg.solve(gram, cross[:, :, None])[:, :, 0])
    return energy, explained, enough


def _correlation(column: Floats, signal: Floats) -> Floats:
    """sum_i column[i + lag] signal[i], for lags from -(len(signal) - 1)."""
    from scipy.signal import correlate

    return np.asarray(correlate(column, signal, method="fft"))


def _independent(columns: list[Floats], own_signals: Floats) -> float:
    """Independent samples of both sides: the reciprocal of the variance of a correlation by chance."""
    size = 2 * max(len(own_signals), len(columns[0]))
    own = np.sum(np.abs(np.fft.rfft(own_signals, size, axis=0)) ** 2, axis=1)
    other = np.sum(np.abs(np.fft.rfft(np.hstack(columns), size, axis=0)) ** 2, axis=1)
    return float(own.sum() * other.sum() / max(float((own * other).sum()), 1e-300))


def _refuse_chance(content: PreparedSignals, residual: Floats, independent: float, columns: int) -> None:
    """Raise AnalysisError where the best of the lags explains no more than chance does: a quantile of a beta variable.

    ``independent`` samples are explained by so many ``columns``.
    """
    explained, chance = 1.0 - float(residual.min()), 1.0
    if independent > columns:
        probability = CHANCE_PROBABILITY / len(residual)
        chance -= beta_quantile(probability, 0.5 * (independent - columns), 0.5 * columns)
    if explained > min(chance, SURE_SHARE):
        return
    if chance < SURE_SHARE:
        raise AnalysisError(
            f"{content.name}: no common content: the best lag explains {explained:.2%} of the signal, and "
            f"{chance:.2%} may be chance; name channels that recorded the same (forces of a balanced mechanism show "
            "nothing of its motion), or give a tap, or a trigger"
        )
    raise AnalysisError(
        f"{content.name}: ambiguous: the best lag explains {explained:.1%} of the signal, which is so slow or so "
        f"nearly a pure sine that chance may explain as much; {_cutoff(content)}; else give a tap, or a trigger"
    )


def _scatter(columns: list[Floats], own_signals: Floats, lag: int, known: Known) -> float:
    """Standard deviation of the logarithm of the residual at a lag: sqrt(2 / its independent samples)."""
    first, last = max(lag, 0), min(len(columns[0]), len(own_signals) + lag)
    power = np.zeros((last - first) // 2 + 1)
    own, reference = known[0][first - lag : last - lag], known[1][first:last]
    for column, signal in zip(columns, (own_signals[first - lag : last - lag] * reference[:, None]).T, strict=True):
        basis = column[first:last] * own[:, None]
        power += np.abs(np.fft.rfft(signal - basis @ np.linalg.lstsq(basis, signal, rcond=None)[0])) ** 2
    return float(np.sqrt(np.sum(power**2) / max(float(np.sum(power)) ** 2, 1e-300)))


def _refuse_ambiguity(content: PreparedSignals, residual: Floats, scatter: float, step: float) -> None:
    """Raise AnalysisError where a lag beyond the slopes of the best one explains about as much."""
    best = int(np.argmin(residual))
    beyond = np.flatnonzero(residual > 1.0 - 0.5 * (1.0 - residual[best]))
    low, high = beyond[beyond < best].max(initial=0), beyond[beyond > best].min(initial=len(residual) - 1)
    if high - low >= len(residual) - 1:
        raise AnalysisError(
            f"{content.name}: ambiguous: every lag explains about the same: the signals are too slow to align by"
        )
    troughs = np.flatnonzero((residual[1:-1] <= residual[:-2]) & (residual[1:-1] <= residual[2:])) + 1
    others = troughs[(troughs < low) | (troughs > high)]
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
