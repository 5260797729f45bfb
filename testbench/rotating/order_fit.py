"""The fit of an order to a record: its vector, the noise of it, and tones that do not turn with the rotor.

The record is weighted by a Hann window, whose side lobes fall off fast, so that distant lines (a line is one period a
record) leak little into the order. Tones that do not turn with the rotor are found near the order and fitted with it.
The residual on the lines near the order, away from order and tones, is the noise of the vector.

Where the speed changes the vector is a polynomial of it, fitted with the orders, and given at one speed. What the
sensor reads of the rotor is e(t) = exp(i n theta) through a linear system, so the powers are those of the operator
D = -i d/dt - n w on e, w the speed at which the vector is given: D e = n (speed - w) e, and D^2 e has the change of
speed too, which a resonance does not follow at once. A resonance makes
a geometric series of the terms: so the next ones are known before they are fitted, and one is taken where what they do
to the vector matters.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from .tachometer import DITHERED, LEAST_TURNS, MOST_MARKS

_MOST_TONES = 4
_FALSE_TONE = 1e-3
"""Probability of taking noise for a tone."""
MAIN_LOBE = 2.0
"""Half width of the main lobe of an order or a tone [lines]."""
_LEAST_LINES, _MOST_LINES = 4, 24
"""Limits of the lines used for noise on each side; else half the way to the next order."""
_APART = 1.25
"""Least distance of a tone from the order, at which a fit still tells them apart [lines]."""
_FINE = 4
"""Parts of a line on which tones are looked for."""
_SIDEBAND = 1e-3
"""Share of a power of the speed on a line from which that is no place of a tone."""
_REFINED = 2
"""Gauss-Newton iterations on the frequency of a tone."""
MOST_TERMS = 4
"""Highest power of the speed."""
_AHEAD = 2
"""Powers looked at beyond the fitted ones: of even or odd ones one may do nothing."""
_FAST = 0.05
"""Changes of speed a radian of turning above which a resonance may not follow: a period of 20 turns."""
_HUNTING = 0.065
"""The same above which lines of the speed are farther apart than a resonance is wide: a period of 15 turns."""
_NEGLIGIBLE = 0.3
"""Size of a term over the standard deviation of the vector below which it is left out."""
SEEN = 3.7
"""Standard deviations above which a difference of vectors is seen (0.1 %, two components)."""
_ZEROS = 16
"""Zeros of a converter within a step, over which rounding errors scatter."""
_BLOCKS = 1024
"""Blocks of the record that are summed before the transform near the order: many more than lines."""
_CHUNK = 16_384
_CELLS = 16
"""Parts of a turn whose means tell vibration below order 1."""
_STRONG = 0.2
"""Amplitude at a part of order 1, over the largest of these and order 1, from which it may be the turn of the rotor."""
_FALSE_PART = 1e-5
"""Probability of taking noise for vibration at a part of order 1."""


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
    """Coefficients of the first and higher powers of the shift, (terms,) [unit]."""
    spread: Floats
    """Covariance of the real, as of the imaginary parts of ``powers``, (terms, terms) [unit^2]."""
    left: float
    """What the powers that are left out do to the vector [unit]."""
    is_hunting: bool
    """Whether the speed changes so fast that the record has lines of the order beside the mean, and none between."""


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
    such errors repeat, may show less of it. ``shift`` (m,) [-] is the speed over that at which the vector is given,
    less one, on even steps of the angle over the turns; None where it is steady.
    """
    record = _Record(values, angle, turns, order, orders, shift)
    lines = int(np.clip(turns // 2, _LEAST_LINES, _MOST_LINES))
    near = int(np.clip(turns // 4, _LEAST_LINES, _MOST_LINES))
    tones: list[_Tone] = []
    while True:
        solved, normal, spread, ahead = record.solve(tones)
        nearby = record.neighbourhood(solved, tones)
        size = float(np.hypot(solved[order], solved[orders + order]))
        least = 0.5 * record.window.sum() * 0.5 * stepped * size
        found = None
        if len(tones) < _MOST_TONES:
            found = _tone(nearby, lines, order * turns, tones, least, record.sidebands())
        if found is not None and (refined := record.refined([*tones, _Tone(found)], order * turns)):
            tones = refined
            continue
        value, powers = complex(solved[order], solved[orders + order]), record.powers(solved)
        noise, spare = _noise(nearby * np.exp(-1j * np.angle(value)), near, order * turns, tones, record.terms)
        inverse, real = np.linalg.inv(normal), len(solved) - 2 * record.terms + 2 * np.arange(record.terms)
        shape = inverse @ spread @ inverse * 2.0 / record.power
        scale = record.scale[: record.terms]
        scatter = float(noise.max()) * shape[np.ix_(real, real)] / np.outer(scale, scale)
        left = float(np.abs(ahead) @ _next_powers(size, np.abs(powers), np.sqrt(np.diag(scatter))))
        if left < _NEGLIGIBLE * float(noise.max() * shape[order, order]) ** 0.5 or record.terms == MOST_TERMS:
            break
        record.terms, tones = record.terms + 1, []  # of sidebands some may have been taken for tones
    rounding = record.rounding(solved, tones)
    if jitter:
        known = 0.5 * jitter * size * coverage_factor() / coverage_factor(spare)  # its size is no estimate
        noise[1] = max(noise[1], noise[0] + known**2 * len(values) / turns * record.power)
    pick = [order, orders + order]
    covariance = _turned_phase(noise, np.angle(value), shape[np.ix_(pick, pick)]) + rounding * np.eye(2)
    return OrderFit(
        value, covariance, spare, tuple(t.line for t in tones), powers, scatter, left, record.hunting > _HUNTING
    )


def slower_vibration(values: Floats, angle: Floats, turns: int) -> int:
    """Largest number of ``turns``, 2 to 12, in which ``values`` (n,) [unit] at ``angle`` (n,) [turns] strongly vibrate
    once; 1 where there is none. Of several pulses in a turn these are the turns of the rotor.
    """
    area = np.r_[0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(angle))]
    means = np.diff(np.interp(np.arange(turns * _CELLS + 1) / _CELLS, angle, area))
    strong, seen = 0.0, dict[int, float]()
    for n in range(min(MOST_MARKS, turns // LEAST_TURNS), 1, -1):
        line, whole = turns // n, means[: turns // n * n * _CELLS]
        share = (np.arange(len(whole)) + 0.5) / len(whole)
        power = np.abs(np.fft.rfft((whole - whole.mean()) * np.sin(np.pi * share) ** 2)) ** 2 / len(whole) ** 2
        near = power[max(0, line - _MOST_LINES) : line + _MOST_LINES + 1]
        strong = max(strong, _STRONG**2 * float(power[[line, n * line]].max()))
        if power[line] > float(np.median(near)) / np.log(2.0) * np.log(1.0 / _FALSE_PART) and power[line] == near.max():
            seen[n] = float(power[line])
    return next((n for n, power in seen.items() if power >= strong), 1)


def refit(values: Floats, angle: Floats, turns: int, order: int, shift: Floats | None, terms: int) -> complex:
    """The vector of an order in ``values`` (n,) [unit], as of ``fit_orders``, by so many powers of the shift alone."""
    record = _Record(values, angle, turns, order, order, shift)
    record.terms = terms if shift is not None else 0
    solved, *_ = record.solve([])
    return complex(solved[order], solved[2 * order])


def _turned_phase(noise: Floats, angle: float, shape: Floats) -> Floats:
    """Covariance of both parts: ``shape`` (2, 2) for unit noise, ``noise`` (2,) the power along and across."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    root = turn @ np.diag(np.sqrt(noise)) @ turn.T
    found: Floats = root @ shape @ root
    return found


class _Record:
    """A record with its window and the regressor of the fit, in chunks."""

    def __init__(
        self, values: Floats, angle: Floats, turns: int, order: int, orders: int, shift: Floats | None
    ) -> None:
        self.values, self.angle, self.order, self.orders = values, angle, order, orders
        self.share = (np.arange(len(values)) + 0.5) / len(values)
        self.window = np.sin(np.pi * self.share) ** 2
        self.power = float((self.window**2).sum())
        self.terms, self.scale, self.hunting = 0, np.ones(0), 0.0
        if shift is not None:
            self.grid = np.linspace(0.0, turns, len(shift))
            by = [np.ones(len(shift), dtype=complex)]
            for _ in range(MOST_TERMS + _AHEAD):  # D (m e) = (shift m - i (1 + shift) dm/dtheta / n) e
                by.append(shift * by[-1] - 1j * (1.0 + shift) * np.gradient(by[-1], self.grid) / (2 * np.pi * order))
            self.scale = np.array([np.sqrt(np.mean(np.abs(m) ** 2)) for m in by[1:]])
            self.by = [m / scale for m, scale in zip(by[1:], self.scale, strict=True)]
            self.hunting = float(self.scale[1] / self.scale[0])
            self.terms = 2 if self.hunting > _FAST else 1

    def _chunks(self, tones: list[_Tone]) -> Iterator[tuple[slice, Floats]]:
        """Columns: 1; cos, then -sin of the orders; cos, sin of each tone and its derivative by frequency; cos, -sin of
        the order by each power of the shift that is fitted, and of those ahead.
        """
        for begin in range(0, len(self.values), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            turned = np.exp(2j * np.pi * self.angle[part, None])
            powers = np.cumprod(np.broadcast_to(turned, (len(turned), self.orders)), axis=1)
            columns = [np.ones((len(turned), 1)), powers.real, -powers.imag]
            for tone in tones:
                phi = 2.0 * np.pi * tone.line * self.share[part]
                c, s = np.cos(phi), np.sin(phi)
                change = 2.0 * np.pi * (self.share[part] - 0.5) * (tone.sin * c - tone.cos * s)
                columns.append(np.stack([c, s, change], axis=1))
            for m in self.by[: self.terms + _AHEAD] if self.terms else ():
                by = np.interp(self.angle[part], self.grid, m) * powers[:, self.order - 1]
                columns.append(np.stack([by.real, -by.imag], axis=1))
            yield part, np.hstack(columns)

    def solve(self, tones: list[_Tone]) -> tuple[Floats, Floats, Floats, NDArray[np.complex128]]:
        """Coefficients (p,), the products of the columns weighted by the window and by its square, (p, p), and what one
        unit of each of the powers ahead does to the vector, (ahead,) [-].
        """
        first, ahead = 1 + 2 * self.orders, 2 * _AHEAD * (self.terms > 0)
        kept = first + 3 * len(tones) + 2 * self.terms
        normal, spread, target = (np.zeros((kept + ahead, n)) for n in (kept + ahead, kept + ahead, 1))
        for part, columns in self._chunks(tones):
            weighted = columns * self.window[part, None]
            normal += columns.T @ weighted
            spread += weighted.T @ weighted
            target += weighted.T @ self.values[part, None]
        for k, tone in enumerate(tones):
            if not tone.cos and not tone.sin:  # the derivative of a tone of amplitude zero is zero
                last = first + 3 * k + 2
                normal[last, last] = 1.0
        found = np.linalg.solve(normal[:kept, :kept], np.hstack([target, normal[:, kept:]])[:kept])
        moved = (found[self.order] + 1j * found[self.orders + self.order])[1::2] * self.scale[self.terms :][
            : ahead // 2
        ]
        return found[:, 0], normal[:kept, :kept], spread[:kept, :kept], moved

    def refined(self, tones: list[_Tone], order: float) -> list[_Tone] | None:
        """The tones, their frequency and amplitude by Gauss-Newton iterations; None where one ends so near to the
        ``order`` [lines] or to another tone that a fit does not tell them apart.
        """
        for _ in range(_REFINED + 1):
            solved, *_ = self.solve(tones)
            each = solved[1 + 2 * self.orders :][: 3 * len(tones)].reshape(-1, 3)
            lines = [tone.line + float(np.clip(m, -0.5, 0.5)) for tone, m in zip(tones, each[:, 2], strict=True)]
            near = np.diff(sorted(lines)).min(initial=np.inf) < 1.0
            if near or min(abs(line - order) for line in lines) < _APART:
                return None
            tones = [_Tone(line, float(c), float(s)) for line, (c, s, _) in zip(lines, each, strict=True)]
        return tones

    def powers(self, solved: Floats) -> NDArray[np.complex128]:
        """Coefficients of the powers of the shift, (terms,) [unit]."""
        pairs = solved[len(solved) - 2 * self.terms :].reshape(-1, 2)
        return np.asarray(pairs @ [1.0, 1.0j] / self.scale[: self.terms], dtype=np.complex128)

    def _explained(self, solved: Floats, tones: list[_Tone]) -> Floats:
        """What the coefficients (p,) make of the record, (n,) [unit]."""
        return np.concatenate([columns[:, : len(solved)] @ solved for _, columns in self._chunks(tones)])

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
        return self._blocks(residual * np.exp(-2j * np.pi * self.order * self.angle))

    def _blocks(self, turned: Floats | NDArray[np.complex128]) -> NDArray[np.complex128]:
        edges = np.linspace(0, len(turned), min(_BLOCKS, len(turned)) + 1).astype(int)[:-1]
        return np.asarray(np.add.reduceat(self.window * turned, edges))

    def sidebands(self) -> Floats:
        """Size of the powers ahead on fine lines about the order, over that of one power on its line, (lines,) [-];
        empty at a steady speed.
        """
        if not self.terms:
            return np.zeros(0)
        ahead = [self._blocks(np.interp(self.angle, self.grid, m)) for m in self.by[: self.terms + _AHEAD]]
        spectra = np.abs(np.fft.fft(ahead, _FINE * len(ahead[0])))
        return np.asarray(spectra.max(axis=0) / self.window.sum())


def _next_powers(size: float, powers: Floats, deviation: Floats) -> Floats:
    """Sizes of the powers after ``powers`` (terms,), (ahead,): of a geometric series with the last that is seen, else
    with the first, which a resonance that does not follow the speed makes small.
    """
    count = len(powers)
    if not count or not size:
        return np.zeros(_AHEAD * min(1, count))
    ratio = float(powers[0]) / size
    last, sure = size * ratio**count, float(powers[-1] - SEEN * deviation[-1])
    if count > 1 and sure > 0.0:
        last = float(powers[-1])
        ratio = max((last / size) ** (1.0 / count), sure / float(powers[-2] + SEEN * deviation[-2]))
    return np.asarray(last * ratio ** np.arange(1, _AHEAD + 1))


def _tone(
    nearby: NDArray[np.complex128], lines: int, order: int, tones: list[_Tone], least: float, sidebands: Floats
) -> float | None:
    """Periods per record of the strongest tone on quarter lines near the order; None where all may be noise.

    A tone of amplitude A reads A / 2 times the window's sum; below ``least`` in these units it counts as none, as where
    ``sidebands`` (fine lines,) [-] of the order are.
    """
    fine = _FINE
    power = np.abs(np.fft.fft(nearby, fine * len(nearby))) ** 2
    at = np.arange(-fine * lines, fine * lines + 1)
    at = at[sidebands[at] < _SIDEBAND] if len(sidebands) else at
    at = at[(np.abs(at) >= fine * _APART) & (order + at / fine > 0.5)]
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
