"""Where steep pulses lie between the samples that saw them, and what the samples leave open of it.

A pulse that rises within one step is known to lie between two samples. Where its places within a step cover it evenly,
the errors average out; where sampling keeps step with the rotor, all pulses are early or late alike. Instants are
taken as an even motion with normal scatter, seen in steps; what every scatter and motion leaves likely is the answer.
"""

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor, log_normal_probability

DITHERED = 0.6
"""Scatter of instants, in steps, above which each is off on its own: two neighbouring samples explain at most 0.5."""
_DEGREE = 3
_MOST_PULSES = 400
_SHARPNESS = (0.2, 100.0)
"""One over the scatter of single pulses, in steps: a hundredth is always allowed for."""
_LIKELY = coverage_factor() ** 2
"""Twice the logarithm of likelihood, below its largest, that an interval of 95 % reaches down to (chi2, one)."""
_PLACES = np.linspace(-1.0, 1.0, 81)
_ROUNDS, _HALVINGS, _ENOUGH = 40, 6, 1e-3


def open_offset(before: Floats, after: Floats, found: Floats) -> tuple[float, float]:
    """How much later all of ``found`` (n,) lie, and half the interval of that, in the unit of the samples' instants.

    ``before`` and ``after`` (n,) are the samples on both sides of each pulse. Scatter of single pulses about an even
    motion is not in the interval. Zero, zero where it is large enough to cover the steps.
    """
    step = float(np.median(after - before))
    if len(found) > _MOST_PULSES:
        chosen = np.linspace(0, len(found) - 1, _MOST_PULSES).astype(int)
        before, after, found = before[chosen], after[chosen], found[chosen]
    number = np.linspace(-1.0, 1.0, len(found))
    motion = np.polynomial.Polynomial.fit(number, found, _DEGREE)(number)
    scatter = float(np.std(found - motion)) / step
    if scatter > DITHERED:
        return 0.0, 0.0
    off = motion - motion.mean() + found.mean()
    low, high = _likely(_shapes(number), (before - off) / step, (after - off) / step)
    own = coverage_factor() * scatter / np.sqrt(len(found))
    left = float(np.sqrt(max(0.0, (0.5 * (high - low)) ** 2 - own**2)))
    return 0.5 * (low + high) * step, left * step


def _shapes(number: Floats) -> Floats:
    """Changes of an even motion that leave its mean alone, (n, degree)."""
    shapes = np.polynomial.legendre.legvander(number, _DEGREE)[:, 1:]
    return shapes - shapes.mean(axis=0)


def _likely(shapes: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Ends of the likely places of the mean, in steps from the mean of what was found."""
    profile = _profile(_PLACES[:, None], shapes, low, high)
    likely = _PLACES[profile >= profile.max() - 0.5 * _LIKELY]
    half = 0.5 * (_PLACES[1] - _PLACES[0])
    return float(likely[0]) - half, float(likely[-1]) + half


def _profile(place: Floats, shapes: Floats, low: Floats, high: Floats) -> Floats:
    """Largest logarithm of likelihood at each place (places, 1), by Newton's method.

    It is concave in the shape over the scatter and in one over the scatter.
    """
    columns = [np.stack([np.broadcast_to(-shape, (len(place), len(low))) for shape in shapes.T], axis=2)] * 2
    ends = [np.concatenate([c, (end - place)[..., None]], axis=2) for c, end in zip(columns, (low, high), strict=True)]
    x = np.tile(np.r_[np.zeros(shapes.shape[1]), 4.0], (len(place), 1))
    best = _log_between(*(_times(end, x) for end in ends))[0].sum(axis=1)
    for _ in range(_ROUNDS):
        step = _newton(x, ends)
        moved = np.zeros(len(place), dtype=bool)
        for share in 0.5 ** np.arange(_HALVINGS):
            tried = x + share * step
            tried[:, -1] = tried[:, -1].clip(*_SHARPNESS)
            value = _log_between(*(_times(end, tried) for end in ends))[0].sum(axis=1)
            better = (value > best + _ENOUGH) & ~moved
            x[better], best[better] = tried[better], value[better]
            moved |= better
        if not moved.any():
            break
    return best


def _times(end: Floats, x: Floats) -> Floats:
    return np.einsum("pnk,pk->pn", end, x)


def _newton(x: Floats, ends: list[Floats]) -> Floats:
    """Newton's step, (places, parameters); the sharpness rests where it would leave its bounds."""
    at = [_times(end, x) for end in ends]
    slopes = _log_between(*at)[1]
    gradient = sum(np.einsum("pn,pnk->pk", s, end) for s, end in zip(slopes, ends, strict=True))
    curve = np.zeros((*x.shape, x.shape[1]))
    for i in (0, 1):
        for j in (0, 1):
            second = -slopes[i] * slopes[j] - (at[i] * slopes[i] if i == j else 0.0)
            curve += np.einsum("pn,pnk,pnl->pkl", second, ends[i], ends[j])
    sharp = x[:, -1]
    rests = ((sharp <= _SHARPNESS[0]) & (gradient[:, -1] < 0)) | ((sharp >= _SHARPNESS[1]) & (gradient[:, -1] > 0))
    gradient[rests, -1] = 0.0
    curve[rests, -1, :] = curve[rests, :, -1] = 0.0
    ridge = 1e-9 * (1.0 + np.abs(curve).max(axis=(1, 2)))[:, None, None] * np.eye(x.shape[1])
    curve[rests, -1, -1] = -1.0
    return np.linalg.solve(ridge - curve, gradient[..., None])[..., 0]


def _log_between(low: Floats, high: Floats) -> tuple[Floats, tuple[Floats, Floats]]:
    """log(Phi(high) - Phi(low)) of the normal distribution, and its derivatives by low and high."""
    flip = low + high > 0.0  # the lower tail is the one that floating point resolves
    a, b = log_normal_probability(np.where(flip, -high, low)), log_normal_probability(np.where(flip, -low, high))
    log = b + np.log1p(-np.exp(np.minimum(a - b, -1e-12)))
    slopes = [np.exp(-0.5 * end**2 - 0.5 * np.log(2.0 * np.pi) - log) for end in (low, high)]
    return log, (-slopes[0], slopes[1])
