"""The fit of an order to a record: its vector, the noise of it, and tones that do not turn with the rotor.

The record is weighted by a Hann window, whose side lobes fall off fast, so that distant lines (a line is one period a
record) leak little into the order. Tones that do not turn with the rotor are found near the order and fitted with it.
The residual on the lines near the order, away from order and tones, is the noise of the vector.

Where the speed changes the vector is a polynomial of it, fitted with the orders, and given at one speed. A resonance
makes a geometric series of its terms: so the next one is known before it is fitted, and taken where it matters.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from .tachometer import DITHERED

_MOST_TONES = 4
_FALSE_TONE = 1e-3
"""Probability of taking noise for a tone."""
MAIN_LOBE = 2.0
"""Half width of the main lobe of an order or a tone [lines]."""
_LEAST_LINES, _MOST_LINES = 4, 24
"""Limits of the lines used for noise on each side; else half the way to the next order."""
_REFINED = 2
"""Gauss-Newton iterations on the frequency of a tone."""
MOST_TERMS = 4
"""Highest power of the speed."""
_NEGLIGIBLE = 0.3
"""Size of a term over the standard deviation of the vector below which it is left out."""
SEEN = 3.7
"""Standard deviations above which a difference of vectors is seen (0.1 %, two components)."""
_ZEROS = 16
"""Zeros of a converter within a step, over which rounding errors scatter."""
_BLOCKS = 1024
"""Blocks of the record that are summed before the transform near the order: many more than lines."""
_CHUNK = 16_384


@dataclass(frozen=True)
class OrderFit:
    """An order's vector and its noise."""

    value: complex
    """Peak amplitude and phase of lead."""
    covariance: Floats
    """Of the real and imaginary part, (2, 2) [unit^2]."""
    degrees_of_freedom: int
    """Degrees of freedom of the noise."""
    tones: tuple[float, ...]
    """Periods per record of the tones that were fitted."""
    powers: NDArray[np.complex128]
    """Coefficients of the first and higher powers of the shift of speed, (terms,) [unit]."""
    spread: Floats
    """Covariance of the real, as of the imaginary parts of ``powers``, (terms, terms) [unit^2]."""
    left: float
    """Size of the first power that is left out, where it matters [unit]."""


@dataclass
class _Tone:
    line: float
    cos: float = 0.0
    sin: float = 0.0


def fit_orders(
    values: Floats,
    angle: Floats,
    turns: int,
    order: int,
    orders: int,
    stepped: float = 0.0,
    jitter: float = 0.0,
    shift: Floats | None = None,
) -> OrderFit:
    """Vector of an order in ``values`` (n,) [unit] over whole turns, at the rotor's ``angle`` (n,) [turns].

    Orders up to ``orders`` are fitted together. ``stepped`` [rad] is the jump of the order's phase where pulses move by
    one sample: it causes lines near the order of up to half its size, so weaker tones are left to the noise.
    ``jitter`` [rad] is the standard deviation of its phase at single pulses by that: few lines, or lines between which
    such errors repeat, may show less of it. ``shift`` (n,) [-] is the speed less that at which the vector is given, at
    most 1; None where it is steady.
    """
    record = _Record(values, angle, order, orders, shift)
    lines = int(np.clip(turns // 2, _LEAST_LINES, _MOST_LINES))
    near = int(np.clip(turns // 4, _LEAST_LINES, _MOST_LINES))
    tones: list[_Tone] = []
    while True:
        solved, normal, spread = record.solve(tones)
        nearby = record.neighbourhood(solved, tones)
        size = float(np.hypot(solved[order], solved[orders + order]))
        least = 0.5 * record.window.sum() * 0.5 * stepped * size
        found = _tone(nearby, lines, order * turns, tones, least) if len(tones) < _MOST_TONES else None
        if found is not None:
            tones.append(_Tone(found))
            record.refine(tones)
            continue
        value, powers = complex(solved[order], solved[orders + order]), record.powers(solved)
        noise, spare = _noise(nearby * np.exp(-1j * np.angle(value)), near, order * turns, tones, record.terms)
        inverse, real = np.linalg.inv(normal), 1 + 2 * orders + 2 * np.arange(record.terms)
        shape = inverse @ spread @ inverse * 2.0 / record.power
        scatter = float(noise.max()) * shape[np.ix_(real, real)]
        left = _next_power(size, np.abs(powers), np.sqrt(np.diag(scatter)))
        left *= left > _NEGLIGIBLE * float(noise.max() * shape[order, order]) ** 0.5
        if not left or record.terms == MOST_TERMS:
            break
        record.terms, tones = record.terms + 1, []  # of sidebands some may have been taken for tones
    rounding = record.rounding(solved, tones)
    if jitter:
        known = 0.5 * jitter * size * coverage_factor() / coverage_factor(spare)  # its size is no estimate
        noise[1] = max(noise[1], noise[0] + known**2 * len(values) / turns * record.power)
    pick = [order, orders + order]
    covariance = _turned_phase(noise, np.angle(value), shape[np.ix_(pick, pick)]) + rounding * np.eye(2)
    return OrderFit(value, covariance, spare, tuple(t.line for t in tones), powers, scatter, left)


def _turned_phase(noise: Floats, angle: float, shape: Floats) -> Floats:
    """Covariance of both parts: ``shape`` (2, 2) for unit noise, ``noise`` (2,) the power along and across."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    root = turn @ np.diag(np.sqrt(noise)) @ turn.T
    found: Floats = root @ shape @ root
    return found


class _Record:
    """A record with its window and the regressor of the fit, in chunks."""

    def __init__(self, values: Floats, angle: Floats, order: int, orders: int, shift: Floats | None) -> None:
        self.values, self.angle, self.order, self.orders = values, angle, order, orders
        self.shift, self.terms = shift, 0 if shift is None else 1
        self.share = (np.arange(len(values)) + 0.5) / len(values)
        self.window = np.sin(np.pi * self.share) ** 2
        self.power = float((self.window**2).sum())

    def _chunks(self, tones: list[_Tone]) -> Iterator[tuple[slice, Floats]]:
        """Columns: 1; cos, then -sin of the orders; both by each power of the shift; cos, sin of each tone and its
        derivative by frequency.
        """
        for begin in range(0, len(self.values), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            turned = np.exp(2j * np.pi * self.angle[part, None])
            powers = np.cumprod(np.broadcast_to(turned, (len(turned), self.orders)), axis=1)
            columns = [np.ones((len(turned), 1)), powers.real, -powers.imag]
            if self.shift is not None:
                by = self.shift[part, None] ** np.arange(1, self.terms + 1) * powers[:, [self.order - 1]]
                columns.append(np.stack([by.real, -by.imag], axis=2).reshape(len(by), -1))
            for tone in tones:
                phi = 2.0 * np.pi * tone.line * self.share[part]
                c, s = np.cos(phi), np.sin(phi)
                change = 2.0 * np.pi * (self.share[part] - 0.5) * (tone.sin * c - tone.cos * s)
                columns.append(np.stack([c, s, change], axis=1))
            yield part, np.hstack(columns)

    def solve(self, tones: list[_Tone]) -> tuple[Floats, Floats, Floats]:
        """Coefficients (p,), and the products of the columns weighted by the window and by its square, (p, p)."""
        first = 1 + 2 * self.orders + 2 * self.terms
        count = first + 3 * len(tones)
        normal, spread, target = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
        for part, columns in self._chunks(tones):
            weighted = columns * self.window[part, None]
            normal += columns.T @ weighted
            spread += weighted.T @ weighted
            target += weighted.T @ self.values[part]
        for k, tone in enumerate(tones):
            if not tone.cos and not tone.sin:  # the derivative of a tone of amplitude zero is zero
                last = first + 3 * k + 2
                normal[last, last] = 1.0
        return np.linalg.solve(normal, target), normal, spread

    def refine(self, tones: list[_Tone]) -> None:
        """Frequency and amplitude of the tones by Gauss-Newton iterations."""
        for _ in range(_REFINED + 1):
            solved, *_ = self.solve(tones)
            for tone, (c, s, moved) in zip(tones, solved[-3 * len(tones) :].reshape(-1, 3), strict=True):
                tone.line += float(np.clip(moved, -0.5, 0.5))
                tone.cos, tone.sin = float(c), float(s)

    def powers(self, solved: Floats) -> NDArray[np.complex128]:
        """Coefficients of the powers of the shift, (terms,) [unit]."""
        pairs = solved[1 + 2 * self.orders :][: 2 * self.terms].reshape(-1, 2)
        return np.asarray(pairs @ [1.0, 1.0j])

    def _explained(self, solved: Floats, tones: list[_Tone]) -> Floats:
        """What the coefficients (p,) make of the record, (n,) [unit]."""
        return np.concatenate([columns @ solved for _, columns in self._chunks(tones)])

    def rounding(self, solved: Floats, tones: list[_Tone]) -> float:
        """Variance of each part of the vector by the steps of the readings [unit^2]; zero where noise is their dither.

        Rounding errors of a steady signal repeat with the turns, so no noise near the order shows them. The converter's
        zero may lie anywhere within a step: the scatter of the vector over such zeros (Type B).
        """
        step = float(np.diff(np.unique(self.values)).min(initial=np.inf))
        explained = self._explained(solved, tones)
        noise = float(np.std(self.values - explained)) / step
        if noise > DITHERED:
            return 0.0
        added = np.random.default_rng(0).normal(0.0, max(noise**2 - 1.0 / 12.0, 0.0) ** 0.5, len(explained))
        exact, turned = explained / step + added, self.window * np.exp(-2j * np.pi * self.order * self.angle)
        zeros = (np.arange(_ZEROS) + 0.5) / _ZEROS
        errors = np.array([2.0 * turned @ (np.round(exact + zero) - zero - exact) for zero in zeros])
        return float(np.mean(np.abs(errors) ** 2)) * (step / self.window.sum()) ** 2 / 2.0

    def neighbourhood(self, solved: Floats, tones: list[_Tone]) -> NDArray[np.complex128]:
        """The windowed residual demodulated by the order, summed in blocks of equal length, (blocks,) [unit]."""
        residual = self.values - self._explained(solved, tones)
        turned = self.window * residual * np.exp(-2j * np.pi * self.order * self.angle)
        edges = np.linspace(0, len(residual), min(_BLOCKS, len(residual)) + 1).astype(int)[:-1]
        return np.asarray(np.add.reduceat(turned, edges))


def _next_power(size: float, powers: Floats, deviation: Floats) -> float:
    """Size of the power after ``powers`` (terms,) of the geometric series of ``size`` and the first, or of the last."""
    if not len(powers) or not size:
        return 0.0
    ratio = float(powers[0]) / size
    surely = max(0.0, float(powers[-1] - SEEN * deviation[-1])) if len(powers) > 1 else 0.0
    return float(max(size * ratio ** (len(powers) + 1), surely * ratio))


def _tone(nearby: NDArray[np.complex128], lines: int, order: int, tones: list[_Tone], least: float) -> float | None:
    """Periods per record of the strongest tone on quarter lines near the order; None where all may be noise.

    A tone of amplitude A reads A / 2 times the window's sum; below ``least`` in these units it counts as none.
    """
    fine = 4
    power = np.abs(np.fft.fft(nearby, fine * len(nearby))) ** 2
    at = np.arange(-fine * lines, fine * lines + 1)
    at = at[(np.abs(at) >= fine * 1.25) & (order + at / fine > 0.5)]
    at = at[[all(abs(order + k / fine - tone.line) > 1.0 for tone in tones) for k in at]]
    if not len(at):
        return None
    usual = float(np.median(power[at])) / np.log(2.0)
    best = int(at[np.argmax(power[at])])
    return order + best / fine if power[best] > max(least**2, usual * np.log(2 * lines / _FALSE_TONE)) else None


def _noise(
    nearby: NDArray[np.complex128], lines: int, order: int, tones: list[_Tone], terms: int
) -> tuple[Floats, int]:
    """Mean power along and across the vector, (2,), on lines near it and off the tones; degrees of freedom of each.

    They are separate, since jitter of the pulses disturbs the phase alone. Only every second line counts, since a Hann
    window correlates neighbours, and the lines of a part on both sides are one. Each power of the shift takes one.
    """
    at = np.arange(2, lines + 1, 2)
    off = np.array([[abs(abs(tone.line - order) - k) >= MAIN_LOBE for tone in tones] for k in at]).reshape(len(at), -1)
    chosen = at[off.all(axis=1)] if off.all(axis=1).sum() >= 2 else at
    power = [float(np.mean(np.abs(np.fft.fft(part)[chosen]) ** 2)) for part in (nearby.real, nearby.imag)]
    spare = max(1, 2 * len(chosen) - terms)
    return np.array(power) * (2 * len(chosen) / spare), spare
