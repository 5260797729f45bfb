"""Order vectors of a stored run: amplitude and phase of each sensor at a multiple of the speed, by its tachometer.

x = mean + sum over n of Re(X_n exp(i n theta)), theta the rotor's angle since the tachometer's pulse; over whole turns
the least-squares fit gives the Fourier coefficients of the synchronous average. The phase of X is a **lead**, the angle
by which the peak comes before the pulse. Moving a heavy spot on by an angle with the rotation raises it by that angle.

The record is weighted by a Hann window, whose side lobes fall off fast, so that distant lines (a line is one period a
record) leak little into the order. Tones that do not turn with the rotor are found near the order and fitted with it.
The residual on the lines near the order, away from order and tones, is the noise of the vector.

Where the speed changes the vector is a polynomial of it, fitted with the orders, and given at one speed. A resonance
makes a geometric series of its terms: so the next one is known before it is fitted, and taken where it matters.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.errors import UnitError
from balance.estimation.estimate import LEVEL_TEXT, coverage_factor
from balance.results import Shown, rpm
from balance.units import factor_to_si, si

from ..errors import AnalysisError
from ..runs.si_run import physical
from ..signal import Metric
from ..store import Run, open_run
from ..store.run import StoredGroup
from .tachometer import DITHERED, STEADY_WITHIN, Mark, Turns, encoder_mark, steady_turns

NO_SENSOR = "no vibration in a unit of length, velocity or acceleration; if it is, the rig needs its calibration."
_ROUNDING = 1e-9
"""Angle that counts as rounding [deg]."""
_MOST_TONES = 4
_FALSE_TONE = 1e-3
"""Probability of taking noise for a tone."""
_MAIN_LOBE = 2.0
"""Half width of the main lobe of an order or a tone [lines]."""
_LEAST_LINES, _MOST_LINES = 4, 24
"""Limits of the lines used for noise on each side; else half the way to the next order."""
_COARSE = 0.01
"""Share of an order's amplitude that rounding of the pulses takes, from which a finding says so."""
_REFINED = 2
"""Gauss-Newton iterations on the frequency of a tone."""
_MOST_TERMS = 4
"""Highest power of the speed."""
_NEGLIGIBLE = 0.3
"""Size of a term over the standard deviation of the vector below which it is left out."""
_SEEN = 3.7
"""Standard deviations above which a difference of vectors is seen (0.1 %, two components)."""
_BY_SPEED = 4.0
"""Relative change of a vector by that of the speed, where the record does not show it: 2 by the force of unbalance,
twice that below a resonance at 1.4 times the speed.
"""
_ZEROS = 16
"""Zeros of a converter within a step, over which rounding errors scatter."""
_MAINS = (50.0, 60.0, 100.0, 120.0, 150.0, 180.0)
"""Frequencies of hum [Hz]."""
_MAINS_WITHIN = 2e-3
"""Share by which the mains may be off their frequency."""
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
        if not left or record.terms == _MOST_TERMS:
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
    surely = max(0.0, float(powers[-1] - _SEEN * deviation[-1])) if len(powers) > 1 else 0.0
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
    off = np.array([[abs(abs(tone.line - order) - k) >= _MAIN_LOBE for tone in tones] for k in at]).reshape(len(at), -1)
    chosen = at[off.all(axis=1)] if off.all(axis=1).sum() >= 2 else at
    power = [float(np.mean(np.abs(np.fft.fft(part)[chosen]) ** 2)) for part in (nearby.real, nearby.imag)]
    spare = max(1, 2 * len(chosen) - terms)
    return np.array(power) * (2 * len(chosen) / spare), spare


METRICS: dict[Metric, float] = {"peak": 1.0, "peak_to_peak": 2.0, "rms": 0.5**0.5}
"""Factor from the peak value of an order."""


@dataclass(frozen=True)
class OrderVector:
    """One sensor's vector; its 95 % intervals come from the noise on lines near the order."""

    sensor: str
    dimension: str
    value: complex
    """Peak amplitude and phase of lead [m, m/s or m/s2]."""
    amplitude_within: float
    """Half the interval of the amplitude [m, m/s or m/s2]."""
    phase_within: float
    """Half the interval of the phase, at most pi, the common timing error of the pulses included [rad]."""
    own_phase_within: float
    """The same without the timing error that is common to all sensors [rad]."""
    coherence: float
    """|sum of the parts' vectors|^2 over the number of parts times the sum of their squares [-]; 1 where all agree."""
    share: float
    """Power of the order over that of the whole signal without its mean [-]."""
    tones: tuple[float, ...] = ()
    """Frequencies of tones near the order that do not turn with the rotor, fitted with it [Hz]."""
    at_ends: tuple[complex, complex] | None = None
    """Vectors at the lowest and highest speed of the record; None where it is steady, or shows no difference."""
    is_described: bool = True
    """Whether the powers of the speed that are fitted describe the vector over the record."""

    @property
    def is_significant(self) -> bool:
        """Whether the amplitude exceeds its scatter; else the phase means nothing."""
        return self.phase_within < np.pi / 2


@dataclass(frozen=True)
class Vectors(Shown, rows="rows", figure="testbench.figures.rotating:draw_vectors"):
    """Order vectors of a run, and how they are stated: metric of amplitudes, whether phase is a lead or a lag."""

    order: int
    turns: Turns
    vectors: tuple[OrderVector, ...]
    left_out: tuple[str, ...] = ()
    """Channels of the tachometer's logger in no unit of a vibration sensor, with their unit."""
    run: str = ""
    origin: str = ""
    asked: str = ""
    """Speed at which the vectors are given, such as ``3000rpm``; empty for the mean."""
    amplitude: Metric = "peak"
    phase: str = "lead"

    @property
    def speed(self) -> float:
        """Speed at which the vectors are given [turns/s]."""
        return turns_a_second(self.asked) if self.asked else self.turns.speed

    @property
    def common_phase_within(self) -> float:
        """Half the 95 % interval of the phase error common to all sensors, by the timing of the pulses [rad]."""
        return 2.0 * np.pi * self.order * self.turns.speed * self.turns.timing

    @property
    def common_phase_normal_within(self) -> float:
        """The same for a normal error of equal standard deviation, for sums with other errors [rad]."""
        return 2.0 * np.pi * self.order * self.turns.speed * self.turns.timing_normal_within

    def size(self, value: complex | float, vector: OrderVector) -> str:
        """An amplitude in the metric, with its unit."""
        return f"{METRICS[self.amplitude] * abs(value):.4g} {UNITS[vector.dimension]}"

    def degrees(self, value: complex) -> float:
        """The phase of a vector as it is stated [deg]."""
        return float(np.degrees(np.angle(value))) * (1.0 if self.phase == "lead" else -1.0)

    def reading(self, vector: OrderVector) -> str:
        """A vector as a reading of a file of trial runs; one within the scatter has no interval of the phase."""
        factor, unit = METRICS[self.amplitude], UNITS[vector.dimension]
        about = f" ± {np.degrees(vector.own_phase_within):.3g} deg" if vector.is_significant else ""
        size, within = factor * abs(vector.value), factor * vector.amplitude_within
        return f"{size:.9g} {unit} ± {within:.3g} {unit} @ {self.degrees(vector.value):.6f} deg{about}"

    def to_toml(self, name: str, weights: Mapping[str, str] | None = None, stayed_on: bool | None = None) -> str:
        """This run, called ``name``, as text of a file of trial runs, for ``balance.influence``.

        ``weights``: trial weights by plane (``{"fan end": "10 g @ 0 deg"}``); ``stayed_on``: whether they did after it.
        Raises AnalysisError without the speed at which the vectors are to be given.
        """
        if not self.asked:
            raise AnalysisError(f"{self.run}: give speed: the vectors of all trial runs must belong to one")
        lines = [
            f'# from {self.run}, {self.origin}: phase = "{self.phase}", amplitude = "{self.amplitude}"',
            *(f"# finding: {finding}" for finding in self.findings()),
            *(f"# left out: {one}: {NO_SENSOR}" for one in self.left_out),
            "[[runs]]",
            f"name = {_quoted(name)}",
        ]
        if weights:
            mounted = ", ".join(f"{_quoted(plane)} = {_quoted(weight)}" for plane, weight in weights.items())
            lines += [f"weights = {{ {mounted} }}", f"stayed_on = {str(bool(stayed_on)).lower()}"]
        readings = ", ".join(f"{_quoted(v.sensor)} = {_quoted(self.reading(v))}" for v in self.vectors)
        lines.append(f"readings.{_quoted(self.asked)} = {{ {readings} }}")
        if (alike := np.degrees(self.common_phase_normal_within)) > _ROUNDING:
            lines.append(f'phases_alike.{_quoted(self.asked)} = "{alike:.3g} deg"')
        return "\n".join([*lines, ""])

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Amplitude and phase of each sensor, with half widths of their intervals, the unit in the key."""
        rows, suffix, factor = [], {"m": "m", "m/s": "m_s", "m/s^2": "m_s2"}, METRICS[self.amplitude]
        for v in self.vectors:
            key, ends = f"amplitude_{suffix[UNITS[v.dimension]]}", v.at_ends or ()
            row: dict[str, Any] = {"sensor": v.sensor, "reading": v.dimension, key: factor * abs(v.value)}
            row |= {f"{key}_within": factor * v.amplitude_within, "phase_deg": self.degrees(v.value)}
            row |= {"phase_deg_within": float(np.degrees(v.phase_within)), "coherence": v.coherence}
            row |= {"share_of_power": v.share, "told": v.is_significant, "foreign_tones_Hz": list(v.tones)}
            row |= {f"{key}_at_range": [factor * abs(one) for one in ends]}
            rows.append(row | {"phase_deg_at_range": [self.degrees(one) for one in ends]})
        return rows

    def document(self) -> dict[str, Any]:
        """The document of ``testbench vectors --json``."""
        return {
            "run": self.run,
            "origin": self.origin,
            "order": self.order,
            "amplitude": self.amplitude,
            "phase": self.phase,
            "turns": self.turns.count,
            "speed_rpm": 60.0 * self.turns.speed,
            "given_at_rpm": 60.0 * self.speed,
            "speed_range_rpm": [60.0 * one for one in self.turns.speed_range],
            "speed_change_percent": 100.0 * self.turns.change,
            "interval": LEVEL_TEXT,
            "phases_off_alike_deg_within": float(np.degrees(self.common_phase_within)),
            "findings": list(self.findings()),
            "vectors": self.rows,
            "left_out": list(self.left_out),
        }

    def findings(self) -> tuple[str, ...]:
        """Findings about the run and each vector."""
        each = (f"{v.sensor}: {text}" for v in self.vectors for text in self._of(v))
        pulses = (*self._synchronous_sampling(), *self._coarse_pulses(), *self._unfollowed_speed())
        return (*pulses, *self._on_the_mains(), *self._off_the_speed(), *each)

    def course(self, vector: OrderVector) -> str:
        """How a vector goes over the speeds of the record, in words; empty where it shows no difference."""
        if vector.at_ends is None:
            return ""
        low, high = vector.at_ends
        (lowest, highest), degrees = self.turns.speed_range, [f"{self.degrees(one):.4g}" for one in vector.at_ends]
        return (
            f"over {60 * lowest:.5g} to {60 * highest:.5g} rpm the amplitude goes from {self.size(low, vector)} to "
            f"{self.size(high, vector)}, the phase from {degrees[0]} to {degrees[1]} deg"
        )

    def _of(self, vector: OrderVector) -> Iterator[str]:
        if not vector.is_significant:
            yield f"order {self.order} does not exceed the scatter, so its phase means nothing"
        moved = max((abs(end - vector.value) for end in vector.at_ends or ()), default=0.0)
        if not self.asked and moved > vector.amplitude_within:
            yield (
                f"{self.course(vector)}, more than the interval; it is given at the mean, {60 * self.speed:.5g} rpm: "
                "to compare runs, give all at one speed, --speed"
            )
        if not vector.is_described:
            yield (
                f"it changes so much with the speed that powers up to {_MOST_TERMS} do not describe it, as near a "
                "resonance: its interval is widened; cut out a part of less change"
            )

    def _off_the_speed(self) -> tuple[str, ...]:
        at, change = self.turns.off_range(self.speed)
        widened = [v for v in self.vectors if _BY_SPEED * change * abs(v.value) > 0.5 * v.amplitude_within]
        if not widened:
            return ()
        return (
            f"the run never turns at {self.asked}: its vectors are those at {60 * at:.6g} rpm, their intervals widened "
            f"by {100 * _BY_SPEED * change:.2g} % of the amplitude, as the force of unbalance and a resonance at 1.4 "
            "times the speed would change them; run at one speed, or give one that all runs pass",
        )

    def _on_the_mains(self) -> tuple[str, ...]:
        mains = mains_near(self.turns, self.order)
        if mains is None:
            return ()
        return (
            f"order {self.order} at {self.order * self.turns.speed:.5g} Hz lies within the record's resolution of "
            f"{mains:g} Hz, the mains: hum would be part of the vectors, and is in no interval; take a longer record, "
            "or another speed",
        )

    def _synchronous_sampling(self) -> tuple[str, ...]:
        if not self.turns.is_synchronous:
            return ()
        samples = 1.0 / (self.turns.resolution * self.turns.speed)
        return (
            f"the sampling is synchronous with the speed ({samples:.6g} samples a turn): timing errors of the pulses "
            f"do not average out, and shift all phases by up to {np.degrees(self.common_phase_within):.2g} deg; their "
            "intervals contain it; sample faster, or at a rate that is no multiple of the speed",
        )

    def _unfollowed_speed(self) -> tuple[str, ...]:
        if self.turns.unfollowed < STEADY_WITHIN:
            return ()
        return (
            f"from turn to turn the speed seems to change by {100.0 * self.turns.unfollowed:.2g} %: the vectors are "
            "not fitted over that, and what it does to them is in no interval; look for play of the mark or noise on "
            "it, or record while the speed holds",
        )

    def _coarse_pulses(self) -> tuple[str, ...]:
        shrunk, _ = self.turns.shrinking(self.order)
        if 1.0 - shrunk < _COARSE:
            return ()
        samples = 1.0 / (self.turns.resolution * self.turns.speed)
        return (
            f"the mark is timed to a sample, {samples:.3g} samples a turn: order {self.order} reads "
            f"{100.0 * (1.0 - shrunk):.2g} % too little by that, which is made up for, and its doubt in the intervals; "
            "log the mark faster, or use a wider mark whose pulse rises over several samples",
        )


def mains_near(turns: Turns, order: int) -> float | None:
    """The frequency of hum that the record does not separate from an order [Hz]; None where there is none."""
    resolution = _MAIN_LOBE * turns.speed / turns.count
    at = order * turns.speed
    return next((f for f in _MAINS if abs(at - f) <= resolution + _MAINS_WITHIN * f), None)


UNITS = {"length": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""What a vibration sensor may read, and the unit in which its vectors are given."""
_BATCHES = 10
_ORDERS = 8
"""Orders that are fitted together, so that strong ones do not disturb the requested one."""
_SAMPLES_AN_ORDER = 2.5


def turns_a_second(speed: float | str) -> float:
    """A speed, a text with its unit or a number [rad/s], in turns/s. Raises AnalysisError for none above zero."""
    found = si(speed, "angular velocity") / (2.0 * np.pi)
    if not 0.0 < found < np.inf:
        raise AnalysisError(f"speed: {speed}: expected more than zero")
    return found


def vectors(
    run: Run | str | Path,
    tacho: str = "tacho",
    sensors: Sequence[str] = (),
    order: int = 1,
    speed: float | str | None = None,
    *,
    level: float | None = None,
    falling: bool = False,
    steady_within: float = STEADY_WITHIN,
    amplitude: Metric = "peak",
    phase: str = "lead",
) -> Vectors:
    """Amplitude and phase of each vibration sensor of a stored run at an order of its speed, with 95 % intervals.

    ``tacho``: channel with one pulse a turn, which begins where it rises (``falling``: falls) through ``level`` [its
    unit; half the swing], or an encoder's angle, whose zero is the mark. ``sensors``: by default all of length,
    velocity or acceleration timed with it; those of the rig are read in SI by the calibration in force. ``speed`` at
    which the vectors are given (``"3000rpm"`` or [rad/s]), by default the mean; ``steady_within``: largest change
    of speed, and distance of the mean from ``speed``, as a share. ``amplitude``: ``peak``, ``peak_to_peak`` or ``rms``;
    ``phase``: ``lead`` or ``lag`` of the pulse. Raises AnalysisError for lost or spurious pulses, too few turns, an
    unsteady speed, an order that the samples do not resolve.

    >>> import testbench
    >>> found = testbench.rotating.vectors("rotor/run.h5", tacho="tacho", speed="2400rpm")
    >>> found.table()[["sensor", "amplitude_m_s2", "phase_deg"]].round(1).values.tolist()
    [['A', 4.0, 40.0]]
    >>> print(found.to_toml("as found").splitlines()[1])
    [[runs]]
    """
    for given, known in ((amplitude, tuple(METRICS)), (phase, ("lead", "lag"))):
        if given not in known:
            raise AnalysisError(f"{given!r}: expected {' or '.join(known)}")
    run = run if isinstance(run, Run) else open_run(run)
    group, index = run.find(tacho)
    read = run if run.rig is None else physical(run)
    in_si, where = read.group(group.name), f"{run.name}: channel {tacho!r}"
    time, pulse, mark = run.time(group.name), _finite(run, group, index), Mark(level, falling)
    unit = in_si.channels[index].unit
    if unit and _dimension(unit, ["angle"]):
        pulse, mark = encoder_mark(factor_to_si(unit, "angle") * _finite(read, in_si, index))
    turns = steady_turns(where, time, pulse, mark.level, mark.falling, steady_within, mark.doubt)
    asked = speed if isinstance(speed, str) else "" if speed is None else f"{rpm(speed):.10g} rpm"
    if asked and abs(turns.speed / turns_a_second(asked) - 1.0) > steady_within:
        raise AnalysisError(
            f"{run.name}: turns at {60 * turns.speed:.5g} rpm, not at {asked} within {100 * steady_within:g} %"
        )
    samples = 1.0 / (turns.resolution * turns.speed)
    if samples < _SAMPLES_AN_ORDER * order:
        raise AnalysisError(
            f"{run.name}: {samples:.3g} samples a turn do not resolve order {order}: expected at least "
            f"{_SAMPLES_AN_ORDER * order:g}; sample faster"
        )
    orders, found = max(order, min(_ORDERS, int(samples / _SAMPLES_AN_ORDER))), []
    chosen, at = _chosen(run, group, in_si, index, sensors), turns_a_second(asked) if asked else None
    for i in chosen:
        dimension, factor = _reading(read, in_si, i)
        values = factor * _alive(read, in_si, i)
        found.append(order_vector(group.channels[i].label, dimension, values, turns, time, order, orders, at))
    others = [] if sensors else [group.channels[i] for i in group.measured if i != index and i not in chosen]
    left_out = tuple(f"{c.label} ({c.unit or 'no unit'})" for c in others)
    return Vectors(order, turns, tuple(found), left_out, run.name, run.origin, asked, amplitude, phase)


def _chosen(run: Run, group: StoredGroup, in_si: StoredGroup, tacho: int, sensors: Sequence[str]) -> list[int]:
    if not sensors:
        found = [i for i, c in enumerate(in_si.channels) if i != tacho and c.unit and _dimension(c.unit)]
        if not found:
            raise AnalysisError(
                f"{run.name}: no channel but {group.channels[tacho].name!r} in a unit of length, velocity or "
                "acceleration: ingest with a rig that states their unit, or their calibration"
            )
        return found
    indices = []
    for sensor in sensors:
        where, i = run.find(sensor)
        if where.name != group.name:
            raise AnalysisError(
                f"{run.name}: channel {sensor!r} is in group {where.name!r}, the tachometer in {group.name!r}, each "
                "with its own clock: phases need one clock"
            )
        indices.append(i)
    return indices


def _dimension(unit: str, dimensions: Iterable[str] = UNITS) -> str | None:
    for dimension in dimensions:
        with suppress(UnitError):
            factor_to_si(unit, dimension)
            return dimension
    return None


def _reading(run: Run, group: StoredGroup, index: int) -> tuple[str, float]:
    channel = group.channels[index]
    dimension = _dimension(channel.unit) if channel.unit else None
    if channel.unit is None or dimension is None:
        raise AnalysisError(
            f"{run.name}: channel {channel.name!r} is in {channel.unit or 'no unit'}: expected one of length, velocity "
            "or acceleration; state its calibration in the rig (kind accelerometer), or correct it: testbench calibrate"
        )
    return dimension, factor_to_si(channel.unit, dimension)


def _finite(run: Run, group: StoredGroup, index: int) -> Floats:
    values = run.channel_at(group.name, index)
    odd = np.flatnonzero(~np.isfinite(values))
    if odd.size:
        raise AnalysisError(
            f"{run.name}: channel {group.channels[index].name!r} holds no number at sample {odd[0]}: "
            "correct the log and ingest it into another folder, or leave the run out"
        )
    return values


def _alive(run: Run, group: StoredGroup, index: int) -> Floats:
    """Values (n,) of a channel. Raises AnalysisError for a constant one, whose vector would be rounding errors."""
    values = _finite(run, group, index)
    if np.ptp(values) == 0.0:
        channel = group.channels[index]
        raise AnalysisError(
            f"{run.name}: channel {channel.name!r} is {values[0]:g} {channel.unit} throughout: dead, stuck or not "
            "connected; name the others with --sensor"
        )
    return values


def order_vector(
    sensor: str,
    dimension: str,
    values: Floats,
    turns: Turns,
    time: Floats,
    order: int,
    orders: int,
    speed: float | None = None,
) -> OrderVector:
    """Vector of ``values`` (n,) [m, m/s or m/s2] at ``time`` (n,) [s]; orders up to ``orders`` are fitted together.

    It is given at ``speed`` [turns/s], by default the mean; beyond the speeds of the record its intervals are widened.
    """
    inside = (time >= turns.pulses[0]) & (time < turns.pulses[-1])
    stepped = 2.0 * np.pi * order * turns.speed * turns.resolution if turns.steep else 0.0
    jitter = 2.0 * np.pi * order * turns.speed * turns.rounding
    shrunk, shrunk_within = turns.shrinking(order)
    given_at, speeds, shift = speed or turns.speed, turns.speeds(time[inside]), None
    at, off = turns.off_range(given_at)
    if speeds is not None:
        lowest, highest = turns.speed_range
        shift = (speeds - at) / max(at - lowest, highest - at)
    angle = turns.angle(time[inside])
    found = fit_orders(values[inside], angle, turns.count, order, orders, stepped, jitter, shift)
    value, reach = found.value / shrunk, coverage_factor(found.degrees_of_freedom)
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    along, across = (reach * float(np.sqrt(x @ found.covariance @ x)) for x in (u, np.array([-u[1], u[0]])))
    elsewhere = float(np.hypot(found.left, _BY_SPEED * off * abs(value)))
    along, across = (float(np.hypot(one, elsewhere)) for one in (along, across))
    along = float(np.hypot(along, coverage_factor() * abs(value) * shrunk_within))
    if turns.is_synchronous:  # one jump of the phase reduces the mean vector by up to 1 - cos(stepped / 2)
        along = float(np.hypot(along, abs(value) * (1.0 - np.cos(min(np.pi, 0.5 * stepped)))))
    significant = max(along, across) < abs(value)
    both = float(np.hypot(across, abs(value) * 2.0 * np.pi * order * turns.speed * turns.timing))
    ends = None
    if shift is not None:
        powers = np.array([shift.min(), shift.max()])[:, None] ** np.arange(1, len(found.powers) + 1)
        moved, scatter = powers @ found.powers / shrunk, np.einsum("ei,ij,ej->e", powers, found.spread, powers)
        if (np.abs(moved) > _SEEN * np.sqrt(scatter)).any():
            ends = (complex(value + moved[0]), complex(value + moved[1]))
    parts = _parts(values, turns, time, order, orders)
    squares = float((np.abs(parts) ** 2).mean())
    power = float(np.var(values[inside]))
    return OrderVector(
        sensor,
        dimension,
        value,
        along,
        _turned(both, abs(value)) if significant else np.pi,
        _turned(across, abs(value)) if significant else np.pi,
        abs(parts.mean()) ** 2 / squares if squares else 0.0,
        abs(value) ** 2 / 2.0 / power if power else 0.0,
        tuple(tone / turns.count * turns.speed for tone in found.tones),
        ends,
        found.left < along,
    )


def _quoted(text: str) -> str:
    """A basic string of TOML."""
    return json.dumps(text, ensure_ascii=False)


def _turned(across: float, size: float) -> float:
    """Largest angle between a vector and one that differs by ``across`` [rad]."""
    return float(np.arcsin(min(1.0, across / size)))


def _parts(values: Floats, turns: Turns, time: Floats, order: int, orders: int) -> NDArray[np.complex128]:
    """Vectors of _BATCHES parts of whole turns, (parts,) [unit]."""
    angle = 2.0 * np.pi * turns.angle(time)
    edges = np.linspace(0, turns.count, min(_BATCHES, turns.count // 2) + 1).astype(int)
    bounds = np.searchsorted(time, turns.pulses[edges])
    found = []
    for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
        theta = angle[begin:end, None] * np.arange(1, orders + 1)
        fit = np.hstack([np.ones((end - begin, 1)), np.cos(theta), -np.sin(theta)])
        solved = np.linalg.solve(fit.T @ fit, fit.T @ values[begin:end])
        found.append(complex(solved[order], solved[orders + order]))
    return np.array(found)
