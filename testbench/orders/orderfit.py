"""One order of a signal by least squares, and its noise from the order's own neighbourhood.

The record is weighted by a Hann window, whose side lobes fall off fast: what is a few lines away leaks little into the
order. A line is one period a record. Tones that do not turn with the rotor are found in the neighbourhood, and fitted
with the orders; what is then left on lines beside the order, where neither order nor tone is, is the noise on it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats

_MOST_TONES = 4
_FALSE_TONE = 1e-3
"""Probability of taking noise for a tone."""
_BESIDE = 2.0
"""Lines nearer to the order or a tone are within its main lobe."""
_LEAST_LINES, _MOST_LINES = 4, 24
"""Lines looked at for noise on each side: half the way to the next order, but within these."""
_REFINED = 2
"""Rounds of Gauss and Newton on the frequency of a tone."""
_BLOCKS = 1024
"""Parts of the record that are summed before its neighbourhood is transformed: far more than lines."""
_CHUNK = 16_384


@dataclass(frozen=True)
class Fitted:
    """An order's vector and its noise."""

    value: complex
    """Peak amplitude and phase of lead."""
    covariance: Floats
    """Of its real and imaginary part, (2, 2)."""
    spare: int
    """Degrees of freedom of the noise."""
    tones: tuple[float, ...]
    """Periods a record of the foreign tones that were fitted."""


@dataclass
class _Tone:
    line: float
    cos: float = 0.0
    sin: float = 0.0


def fit(values: Floats, angle: Floats, turns: int, order: int, orders: int, stepped: float = 0.0) -> Fitted:
    """Vector of an order in a record (n,) of whole turns; ``angle`` (n,) [turns], orders up to ``orders`` together.

    ``stepped`` [rad] is how far the order's phase may jump where the pulses move on by a sample: such a jump shows
    beside the order like tones of up to half its size, so what is weaker is left to the noise.
    """
    record = _Record(values, angle, order, orders)
    lines = int(np.clip(turns // 2, _LEAST_LINES, _MOST_LINES))
    tones: list[_Tone] = []
    while True:
        solved, normal, spread = record.solve(tones)
        beside = record.neighbourhood(solved, tones)
        size = float(np.hypot(solved[order], solved[orders + order]))
        least = 0.5 * record.window.sum() * 0.5 * stepped * size
        found = _tone(beside, lines, order * turns, tones, least) if len(tones) < _MOST_TONES else None
        if found is None:
            break
        tones.append(_Tone(found))
        record.refine(tones)
    value = complex(solved[order], solved[orders + order])
    near = int(np.clip(turns // 4, _LEAST_LINES, _MOST_LINES))
    noise, spare = _noise(beside * np.exp(-1j * np.angle(value)), near, order * turns, tones)
    inverse = np.linalg.inv(normal)
    pick = np.ix_([order, orders + order], [order, orders + order])
    covariance = _turned(noise, np.angle(value), (inverse @ spread @ inverse)[pick]) * 2.0 / record.power
    return Fitted(value, covariance, spare, tuple(t.line for t in tones))


def _turned(noise: Floats, angle: float, shape: Floats) -> Floats:
    """Covariance of the parts: ``shape`` is that for noise of one, ``noise`` the power along and across the vector."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    root = turn @ np.diag(np.sqrt(noise)) @ turn.T
    found: Floats = root @ shape @ root
    return found


class _Record:
    """Values with their window and the columns of the fit, taken in chunks."""

    def __init__(self, values: Floats, angle: Floats, order: int, orders: int) -> None:
        self.values, self.angle, self.order, self.orders = values, angle, order, orders
        self.share = (np.arange(len(values)) + 0.5) / len(values)
        self.window = np.sin(np.pi * self.share) ** 2
        self.power = float((self.window**2).sum())

    def _chunks(self, tones: list[_Tone]) -> Iterator[tuple[slice, Floats]]:
        """Columns: 1; cos, then -sin of the orders; cos, sin of each tone and its change with frequency."""
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
            yield part, np.hstack(columns)

    def solve(self, tones: list[_Tone]) -> tuple[Floats, Floats, Floats]:
        """Coefficients, and the sums of columns times columns times window, and times window squared."""
        count = 1 + 2 * self.orders + 3 * len(tones)
        normal, spread, target = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
        for part, columns in self._chunks(tones):
            weighted = columns * self.window[part, None]
            normal += columns.T @ weighted
            spread += weighted.T @ weighted
            target += weighted.T @ self.values[part]
        for k, tone in enumerate(tones):
            if not tone.cos and not tone.sin:  # a tone of no size yet does not change with its frequency
                last = 2 * self.orders + 3 * k + 3
                normal[last, last] = 1.0
        return np.linalg.solve(normal, target), normal, spread

    def refine(self, tones: list[_Tone]) -> None:
        """Frequency and size of the tones by rounds of linear least squares."""
        for _ in range(_REFINED + 1):
            solved, *_ = self.solve(tones)
            for tone, (c, s, moved) in zip(tones, solved[1 + 2 * self.orders :].reshape(-1, 3), strict=True):
                tone.line += float(np.clip(moved, -0.5, 0.5))
                tone.cos, tone.sin = float(c), float(s)

    def neighbourhood(self, solved: Floats, tones: list[_Tone]) -> NDArray[np.complex128]:
        """What is left, turned back by the order and windowed, summed in blocks of equal length, (blocks,)."""
        left = np.empty(len(self.values))
        for part, columns in self._chunks(tones):
            left[part] = self.values[part] - columns @ solved
        turned = self.window * left * np.exp(-2j * np.pi * self.order * self.angle)
        edges = np.linspace(0, len(left), min(_BLOCKS, len(left)) + 1).astype(int)[:-1]
        return np.asarray(np.add.reduceat(turned, edges))


def _tone(beside: NDArray[np.complex128], lines: int, order: int, tones: list[_Tone], least: float) -> float | None:
    """Periods a record of the strongest tone on fractional lines beside the order; None where all may be noise.

    A tone of amplitude A is A / 2 times the window's sum; what is below ``least`` of that is none.
    """
    fine = 4
    power = np.abs(np.fft.fft(beside, fine * len(beside))) ** 2
    at = np.arange(-fine * lines, fine * lines + 1)
    at = at[(np.abs(at) >= fine * 1.25) & (order + at / fine > 0.5)]
    at = at[[all(abs(order + k / fine - tone.line) > 1.0 for tone in tones) for k in at]]
    if not len(at):
        return None
    usual = float(np.median(power[at])) / np.log(2.0)
    best = int(at[np.argmax(power[at])])
    return order + best / fine if power[best] > max(least**2, usual * np.log(2 * lines / _FALSE_TONE)) else None


def _noise(beside: NDArray[np.complex128], lines: int, order: int, tones: list[_Tone]) -> tuple[Floats, int]:
    """Mean power along and across the vector (2,), on lines beside it and off the tones; degrees of freedom of each.

    Apart, since pulses that jitter disturb the phase alone. Every second line, since a Hann window joins neighbours;
    a part's lines on both sides are one.
    """
    at = np.arange(2, lines + 1, 2)
    off = np.array([[abs(abs(tone.line - order) - k) >= _BESIDE for tone in tones] for k in at]).reshape(len(at), -1)
    chosen = at[off.all(axis=1)] if off.all(axis=1).sum() >= 2 else at
    power = [float(np.mean(np.abs(np.fft.fft(part)[chosen]) ** 2)) for part in (beside.real, beside.imag)]
    return np.array(power), 2 * len(chosen)
