"""Offset and drift between two clocks, precisely: least squares at every sample, from a rough offset.

y(t) = c + X(s) b + f(s) at s = p + (1 + d)(t - t0), f known: Newton's method on p, d, c and b, first where the rough
offset was found, then on stretches four times as long until all is used. Noise on both sides leaves p unbiased, but
not the first-order bend of the sum of squares: second derivatives are therefore included. The interval comes from
leaving out stretches of equal information in turn (delete-block jackknife), which counts whatever the model lacks and
its correlation in time.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats, Indices
from balance.identification import student_t

from ..errors import AnalysisError
from .mapping import ASSUMED_DRIFT, PPM, ClockMap
from .search import Flags, Rough
from .shared import Prepared

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

BLOCKS = 20
"""Stretches of equal information that are left out in turn."""
LEAST_BLOCKS = 6
LEAST_PERIODS = 1.0
"""Of the highest frequency compared, that a stretch must last."""
LIVELY = 0.05
"""Share of the largest change, averaged over LIVELY_PERIODS of the cut-off, from which samples are used."""
LIVELY_PERIODS = 5.0
LARGEST_DRIFT = 1e-3
"""A drift that is known no better than this is not determined: no logger's clock is so wrong."""
LAGS = 12
"""Delays of the columns by which what the model lacks is looked for, half a period of the cut-off apart."""
SINGULAR = 1e-2
"""Share of the strongest direction among them below which one is no other."""
_STEPS = 50
_SETTLED = 1e-9


@dataclass(frozen=True)
class Refined:
    """A clock's map, and the share of the energy that it leaves unexplained."""

    clock: ClockMap
    left: float


@dataclass(frozen=True)
class _Place:
    """Where the own clock is thought to run on the reference's: ``at`` + (1 + drift) (own - middle)."""

    middle: float
    at: float
    drift: float = 0.0

    def instants(self, own: Floats) -> Floats:
        return self.at + (1.0 + self.drift) * (own - self.middle)


def refine(content: Prepared, rough: Rough, drift: bool = True, among: Flags | None = None) -> Refined:
    """Offset and drift (or offset alone, the drift taken as about none) with their covariance.

    ``among`` (own samples,) leaves the others out.
    Raises AnalysisError where too little overlaps, the steps do not settle, or the drift is not determined.
    """
    lively = _lively(content)
    among = lively if among is None else lively & among
    begin, end = rough.stretch
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    splines = _splines(content)
    place = _Place(middle, middle + rough.offset)
    while True:
        place, sums = _settled(content, splines, place, half, drift, among)
        if middle - half <= content.own.start and middle + half >= content.own.time[-1]:
            return _refined(content, place, sums)
        half *= 4.0


def _lively(content: Prepared) -> Flags:
    """Own samples about which the signals change; where they rest, noise would pass for information."""
    from scipy.ndimage import uniform_filter1d

    own = content.own
    change = np.sum(np.gradient(content.seen / content.seen.std(axis=0).max(), own.step, axis=0) ** 2, axis=1)
    near = uniform_filter1d(change, max(3, round(LIVELY_PERIODS / content.cutoff / own.step)), mode="constant")
    return np.asarray(near >= LIVELY * near.max())


def _splines(content: Prepared) -> "list[BSpline]":
    """For each signal, its fixed part, then its columns."""
    from scipy.interpolate import make_interp_spline

    both = [np.column_stack([f, c]) for f, c in zip(content.fixed.T, content.columns, strict=True)]
    return [make_interp_spline(content.reference.time, b, 5) for b in both]


def _settled(
    content: Prepared, splines: "list[BSpline]", place: _Place, half: float, drift: bool, among: Flags
) -> "tuple[_Place, list[_Signal]]":
    """Newton's method on the stretch of the own clock within ``half`` [s] of the middle."""
    reach = 0.125 / content.cutoff
    for _ in range(_STEPS):
        own, seen = _inside(content, place, half, among)
        signals = [_Signal(own, s, spline, place, drift) for s, spline in zip(seen.T, splines, strict=True)]
        whole = np.zeros(len(own), dtype=np.intp)
        gradient, bend = (x[0] for x in _joined(signals, whole))
        move = -np.linalg.lstsq(bend, gradient, rcond=1e-13)[0]
        shift = float(np.clip(move[0], -reach, reach))
        turn = float(np.clip(move[1], -LARGEST_DRIFT, LARGEST_DRIFT)) if drift else 0.0
        place = _Place(place.middle, place.at + shift, place.drift + turn)
        if abs(shift) < _SETTLED and abs(turn) * half < _SETTLED:
            return place, signals
    raise AnalysisError(f"{content.name}: the offset does not settle: the two have too little in common")


def _inside(content: Prepared, place: _Place, half: float, among: Flags) -> tuple[Floats, Floats]:
    """Own instants and signals near the middle that the reference's record covers."""
    own, grid = content.own.time, content.reference
    instants = place.instants(own)
    used = among & (np.abs(own - place.middle) <= half) & (instants >= grid.start) & (instants <= grid.time[-1])
    if np.count_nonzero(used) < 2 * sum(c.shape[1] + 1 for c in content.columns) + 4:
        raise AnalysisError(f"{content.name}: the two records hardly overlap: {np.count_nonzero(used)} samples")
    return own[used], content.seen[used]


class _Signal:
    """One signal of the own clock against its columns at a place, constant and factors solved for."""

    def __init__(self, own: Floats, seen: Floats, spline: "BSpline", place: _Place, drift: bool) -> None:
        at = place.instants(own)
        self.own, self.seen = own, seen
        self.lever = np.column_stack([np.ones_like(own), own - place.middle][: 2 if drift else 1])
        value, rate, bow = (np.asarray(spline(at, order)) for order in (0, 1, 2))
        self.columns = np.column_stack([np.ones_like(own), value[:, 1:]])
        factors = np.linalg.lstsq(self.columns, seen - value[:, 0], rcond=None)[0]
        self.residual = seen - value[:, 0] - self.columns @ factors
        self.rates, self.fixed_rate = rate[:, 1:], rate[:, 0]
        share = np.r_[1.0, factors[1:]]
        self.speed, self.bow = rate @ share, bow @ share

    @property
    def moves(self) -> int:
        """How many of the parameters move the clock."""
        return self.lever.shape[1]

    @cached_property
    def weight(self) -> float:
        """1 / mean square of the residual."""
        return 1.0 / max(float(np.mean(self.residual**2)), 1e-12 * float(np.mean(self.seen**2)))

    def equations(self, blocks: Indices) -> tuple[Floats, Floats]:
        """Gradient (blocks, p) and bend (blocks, p, p) of half the weighted sum of squares, by stretch."""
        moves = self.moves
        design = np.column_stack([self.lever * self.speed[:, None], self.columns])
        bow = self.lever * (self.residual * self.bow)[:, None]
        slope = self.lever[:, :, None] * (self.residual[:, None] * self.rates)[:, None, :]
        starts = np.flatnonzero(np.diff(blocks, prepend=-1))
        ends = np.r_[starts[1:], len(blocks)]
        bend = np.array([design[a:b].T @ design[a:b] for a, b in zip(starts, ends, strict=True)])
        first_order = bend.copy()
        for k, (a, b) in enumerate(zip(starts, ends, strict=True)):
            bend[k, :moves, :moves] -= bow[a:b].T @ self.lever[a:b]
            crossed = slope[a:b].sum(axis=0)
            bend[k, :moves, moves + 1 :] -= crossed
            bend[k, moves + 1 :, :moves] -= crossed.T
        if np.linalg.eigvalsh(bend.sum(axis=0)).min() <= 0.0:
            bend = first_order
        gradient = np.array([-design[a:b].T @ self.residual[a:b] for a, b in zip(starts, ends, strict=True)])
        return self.weight * gradient, self.weight * bend


def _joined(signals: list[_Signal], blocks: Indices) -> tuple[Floats, Floats]:
    """The equations of all signals: the clock's parameters are shared, constants and factors each signal's own."""
    moves = signals[0].moves
    parts = [signal.equations(blocks) for signal in signals]
    size = moves + sum(gradient.shape[1] - moves for gradient, _ in parts)
    total_gradient, total_bend = np.zeros((len(parts[0][0]), size)), np.zeros((len(parts[0][0]), size, size))
    at = moves
    for gradient, bend in parts:
        index = np.r_[0:moves, at : at + gradient.shape[1] - moves]
        total_gradient[:, index] += gradient
        total_bend[:, index[:, None], index] += bend
        at += gradient.shape[1] - moves
    return total_gradient, total_bend


def _refined(content: Prepared, place: _Place, signals: list[_Signal]) -> Refined:
    """The map with its covariance from the stretches."""
    moves, own = signals[0].moves, signals[0].own
    blocks = _stretches(content, signals)
    gradient, bend = _joined(signals, blocks)
    count, whole = len(bend), bend.sum(axis=0)
    left_out = np.array([np.linalg.solve(whole - b, g) for g, b in zip(gradient, bend, strict=True)])
    spread = (left_out - left_out.mean(axis=0))[:, :moves]
    covariance = np.zeros((2, 2))
    covariance[:moves, :moves] = (count - 1) / count * spread.T @ spread
    share, slope = _misfit(signals)
    if content.partial:
        covariance[0, 0] += (np.sqrt(share) / slope / student_t(count - moves)) ** 2
    elif content.modelled:
        covariance[0, 0] += share * _coherent(content, place, signals) / (0.5 * LAGS) / slope**2
    if content.fixed_doubt:
        covariance[0, 0] += (content.fixed_doubt * _led(signals, whole)) ** 2
    if moves == 1:
        covariance[1, 1] = (0.5 * ASSUMED_DRIFT) ** 2
    span = float(own[0]), float(own[-1])
    clock = ClockMap(place.middle, place.at, place.drift, covariance, count - moves, span)
    low, high = clock.drift_interval
    if moves == 2 and 0.5 * (high - low) > LARGEST_DRIFT:
        raise AnalysisError(
            f"{content.name}: too short for a drift: {span[1] - span[0]:.3g} s tell it to "
            f"{0.5 * (high - low) / PPM:.3g} ppm; align the offset alone, which takes the drift to "
            f"be within {ASSUMED_DRIFT / PPM:g} ppm"
        )
    return Refined(clock, share)


def _misfit(signals: list[_Signal]) -> tuple[float, float]:
    """Share of the energy that stays unexplained, and the rms rate of the signals relative to their rms [1/s]."""
    seen = sum(float(s.seen @ s.seen) for s in signals)
    rate = sum(float(s.speed @ s.speed) for s in signals)
    return sum(float(s.residual @ s.residual) for s in signals) / seen, float(np.sqrt(rate / seen))


def _led(signals: list[_Signal], whole: Floats) -> float:
    """How much later the answer is, by how much later the fixed part came; ``whole`` is the bend of all, (p, p)."""
    moves, gradient = signals[0].moves, []
    for signal in signals:
        design = np.column_stack([signal.lever * signal.speed[:, None], signal.columns])
        gradient.append(signal.weight * (design.T @ signal.fixed_rate))
    joined = np.r_[sum(g[:moves] for g in gradient), np.concatenate([g[moves:] for g in gradient])]
    return float(np.linalg.solve(whole, joined)[0])


def _coherent(content: Prepared, place: _Place, signals: list[_Signal]) -> float:
    """Share of the residual's energy that follows the columns LAGS times delayed, beyond what chance explains.

    It is what the model lacks: how the base, its modes and the sensors' couplings answer. Noise does not follow. Such
    an error is taken to be as large along the signals' rate, where it shifts the answer, as along each direction that
    the delays open: half of them, for signals that lie mostly below half of the cut-off.
    """
    delays = (np.arange(LAGS) - LAGS // 4) / (2.0 * content.cutoff)
    whole = explained = 0.0
    for signal, spline in zip(signals, _splines(content), strict=True):
        at = place.instants(signal.own)[:, None] - delays
        inside = at.clip(content.reference.start, float(content.reference.time[-1]))
        delayed = spline(inside)[:, :, 1:].reshape(len(at), -1)
        known = np.column_stack([signal.columns, signal.speed])
        delayed -= known @ np.linalg.lstsq(known, delayed, rcond=None)[0]
        left, size, _ = np.linalg.svd(delayed, full_matrices=False)
        basis = left[:, size > SINGULAR * size[0]]
        energy = float(signal.residual @ signal.residual)
        independent = max(2.0 * content.cutoff * content.own.step * len(at), basis.shape[1] + 1.0)
        found = float(np.sum((basis.T @ signal.residual) ** 2)) / max(energy, 1e-300)
        chance = (1.0 - found) * basis.shape[1] / (independent - basis.shape[1])
        whole += signal.weight * energy
        explained += signal.weight * energy * max(0.0, found - chance)
    return explained / whole


def _stretches(content: Prepared, signals: list[_Signal]) -> Indices:
    """Numbers of stretches of equal information on the offset, each at least LEAST_PERIODS long, (n,)."""
    information = sum((s.weight * s.speed**2 for s in signals), np.zeros(len(signals[0].own)))
    done = np.cumsum(information) / np.sum(information)
    numbers = np.minimum((done * BLOCKS).astype(np.intp), BLOCKS - 1)
    shortest = LEAST_PERIODS / content.cutoff
    own, merged = signals[0].own, np.zeros(len(numbers), dtype=np.intp)
    starts, current, begun = np.flatnonzero(np.diff(numbers, prepend=-1)), -1, -np.inf
    for a, b in zip(starts, np.r_[starts[1:], len(numbers)], strict=True):
        if own[a] - begun >= shortest:
            current, begun = current + 1, float(own[a])
        merged[a:b] = current
    if current + 1 < LEAST_BLOCKS:
        raise AnalysisError(
            f"{content.name}: too short: {current + 1} independent stretches at {content.cutoff:.3g} Hz, expected at "
            f"least {LEAST_BLOCKS}"
        )
    return merged
