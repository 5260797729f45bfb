"""Order vectors of a stored run: amplitude and phase of each sensor at a multiple of the speed, by its tachometer.

x = mean + sum over n of Re(X_n exp(i n theta)), theta the rotor's angle since the tachometer's pulse; over whole turns
the least-squares fit gives the Fourier coefficients of the synchronous average. The phase of X is a **lead**, the angle
by which the peak comes before the pulse. Moving a heavy spot on by an angle with the rotation raises it by that angle.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
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
from .order_fit import MAIN_LOBE, MOST_TERMS, SEEN, fit_orders, refit, slower_vibration
from .tachometer import STEADY_WITHIN, Mark, Turns, encoder_mark, give_marks, steady_turns

METRICS: dict[Metric, float] = {"peak": 1.0, "peak_to_peak": 2.0, "rms": 0.5**0.5}
"""Factor from the peak value of an order."""
NO_SENSOR = "no vibration in a unit of length, velocity or acceleration; if it is, the rig needs its calibration."
_ROUNDING = 1e-9
"""Angle that counts as rounding [deg]."""
_COARSE = 0.01
"""Share of an order's amplitude that rounding of the pulses, or powers left out, take, from which a finding says so."""
_LEAST_DAMPING = 0.025
"""Damping ratio of the sharpest resonance that is reckoned with where the record does not show one."""
_BY_SPEED = np.array([2.0 + 0.5 / _LEAST_DAMPING, 1.0 / _LEAST_DAMPING])
"""Largest relative change along and across a vector by that of the speed, by such a resonance and unbalance [-]."""
_MEANS = 32
"""Means of samples in a period of an order that pulses drawn anew are applied to."""
_MAINS = (50.0, 60.0, 100.0, 120.0, 150.0, 180.0)
"""Frequencies of hum [Hz]."""
_MAINS_WITHIN = 2e-3
"""Share by which the mains may be off their frequency."""


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
    several: Mapping[int, str] = field(default_factory=dict)
    """What speaks for so many marks where one a turn was taken for granted."""
    of_clock: tuple[str, ...] = ()
    """What is to be said of the clock that turns are counted by."""

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
        Raises AnalysisError without the speed at which the vectors are to be given, and where phases of other runs may
        count from another mark.
        """
        if not self.asked:
            raise AnalysisError(f"{self.run}: give speed: the vectors of all trial runs must belong to one")
        if alike := self._marks_alike():
            raise AnalysisError(f"{self.run}: {alike[0]}")
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
            "pulses_per_turn": self.turns.marks,
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
        return (
            *self.of_clock,
            *self._several_marks(),
            *self._marks_alike(),
            *pulses,
            *self._on_the_mains(),
            *self._off_the_speed(),
            *each,
        )

    def below(self) -> tuple[str, ...]:
        """The findings: what is printed below the table."""
        return self.findings()

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
                f"it changes so much with the speed that powers up to {MOST_TERMS} do not describe it, as near a "
                "resonance, or by a speed that hunts faster than a resonance follows: its interval is widened; give it "
                "at the mean speed, or cut out a part of less change"
            )

    def _off_the_speed(self) -> tuple[str, ...]:
        at, change = self.turns.off_range(self.speed)
        along, across = _BY_SPEED * change
        widened = [v for v in self.vectors if along * abs(v.value) > 0.5 * v.amplitude_within]
        if not widened:
            return ()
        return (
            f"the run never turns at {self.asked}: its vectors are those at {60 * at:.6g} rpm, their intervals widened "
            f"by {100 * along:.2g} % and {np.degrees(across):.2g} deg, as near a resonance of "
            f"{100 * _LEAST_DAMPING:g} % damping (a sharper one may change them more); run at the speed that is asked, "
            "or give one that all runs pass",
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

    def _several_marks(self) -> Iterator[str]:
        for count, what in self.several.items():
            yield (
                f"{what}, and turns were counted by one pulse each: {give_marks(count)}, then this is order "
                f"{count * self.order} of {60 * self.turns.speed / count:.5g} rpm; if not, state pulses=1 (--pulses 1)"
            )

    def _marks_alike(self) -> tuple[str, ...]:
        marks = self.turns.marks
        between = 360 * math.gcd(self.order, marks) / marks
        if self.turns.is_same_mark or between == 360:
            return ()
        return (
            f"phases count from one of {marks} marks that look alike, in each record from any: between two records "
            f"they may differ by multiples of {between:.4g} deg; to compare phases, as of trial runs, leave one mark "
            "or make one pitch wider than the others",
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
    resolution = MAIN_LOBE * turns.speed / turns.count
    at = order * turns.speed
    return next((f for f in _MAINS if abs(at - f) <= resolution + _MAINS_WITHIN * f), None)


UNITS = {"length": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""What a vibration sensor may read, and the unit in which its vectors are given."""
_BATCHES = 10
_ORDERS = 8
"""Orders that are fitted together, so that strong ones do not disturb the requested one."""
_SAMPLES_AN_ORDER = 2.5
_MOST_UNSTEADY = 0.5
"""Change of speed, as a share, that may count as steady."""


def turns_a_second(speed: float | str) -> float:
    """A speed, a text with its unit or a number [rad/s], in turns/s. Raises AnalysisError for none above zero."""
    found = si(speed, "angular velocity") / (2.0 * np.pi)
    if not 0.0 < found < np.inf:
        raise AnalysisError(f"speed: {speed}: expected more than zero")
    return found


def _share(steady_within: float | str) -> float:
    text = str(steady_within).strip()
    with suppress(ValueError):
        found = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
        if 0.0 < found <= _MOST_UNSTEADY:
            return found
    raise AnalysisError(
        f"steady_within: {text}: expected a share above zero, at most {_MOST_UNSTEADY:g}, such as 0.05 or '5 %'"
    )


def vectors(
    run: Run | str | Path,
    tacho: str = "tacho",
    sensors: Sequence[str] = (),
    order: int = 1,
    speed: float | str | None = None,
    *,
    level: float | None = None,
    falling: bool = False,
    steady_within: float | str = STEADY_WITHIN,
    pulses: int | None = None,
    begin: float | str | None = None,
    end: float | str | None = None,
    amplitude: Metric = "peak",
    phase: str = "lead",
) -> Vectors:
    """Amplitude and phase of each vibration sensor of a stored run at an order of its speed, with 95 % intervals.

    ``tacho``: channel with one pulse a turn, which begins where it rises (``falling``: falls) through ``level`` [its
    unit; half the swing], or an encoder's angle, whose zero is the mark. ``sensors``: by default all of length,
    velocity or acceleration timed with it; those of the rig are read in SI by the calibration in force. ``speed`` at
    which the vectors are given (``"3000rpm"`` or [rad/s]), by default the mean; ``steady_within``: largest change
    of speed, and distance of the mean from ``speed``: a share, at most 0.5, or per cent (``"5 %"``). ``pulses``: marks
    a turn [1], of which the one after the widest pitch is the mark. ``begin``, ``end``: part of the record that is used
    (``"2 s"`` or [s]). ``amplitude``:
    ``peak``, ``peak_to_peak`` or ``rms``; ``phase``: ``lead`` or ``lag`` of the pulse. Raises AnalysisError for lost or
    spurious pulses, too few turns, an unsteady speed, an order that the samples do not resolve.

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
    within = _share(steady_within)
    run = run if isinstance(run, Run) else open_run(run)
    group, index = run.find(tacho)
    read = run if run.rig is None else physical(run)
    in_si, where = read.group(group.name), f"{run.name}: channel {tacho!r}"
    time, pulse, mark = run.time(group.name), _finite(run, group, index), Mark(level, falling)
    ends = [at if instant is None else si(instant, "time") for instant, at in ((begin, -np.inf), (end, np.inf))]
    part = slice(*np.searchsorted(time, ends))
    if len(time[part]) < 2:
        asked = f"from {ends[0]:g} s on" if np.isinf(ends[1]) else f"from {ends[0]:g} to {ends[1]:g} s"
        ends_first = ", which ends before it begins" if ends[1] <= ends[0] else ""
        raise AnalysisError(f"{where}: no samples {asked}{ends_first}: it has {time[0]:g} to {time[-1]:g} s")
    unit = in_si.channels[index].unit
    marks = 1 if pulses is None else pulses
    if is_encoder := bool(unit and _dimension(unit, ["angle"])):
        pulse, mark = encoder_mark(factor_to_si(unit, "angle") * _finite(read, in_si, index))
    if marks < 1 or (is_encoder and marks > 1):
        raise AnalysisError(
            f"{where}: {marks} pulses a turn: expected 1 or more; an encoder's angle has one zero a turn"
        )
    time, pulse = time[part], pulse[part]
    turns = steady_turns(where, time, pulse, mark.level, mark.falling, within, mark.doubt, mark.in_step, marks)
    asked = speed if isinstance(speed, str) else "" if speed is None else f"{rpm(speed):.10g} rpm"
    if asked and abs(turns.speed / turns_a_second(asked) - 1.0) > within:
        count = turns.speed * marks / turns_a_second(asked)
        fits = not is_encoder and round(count) > 0 and abs(count / round(count) - 1.0) <= within
        raise AnalysisError(
            f"{run.name}: turns at {60 * turns.speed:.5g} rpm by {marks} pulse{'s' * (marks > 1)} a turn, not at "
            f"{asked} within {100 * within:g} %{f': {give_marks(round(count))}' if fits else ''}"
        )
    samples = 1.0 / (turns.resolution * turns.speed)
    if samples < _SAMPLES_AN_ORDER * order:
        raise AnalysisError(
            f"{run.name}: {samples:.3g} samples a turn do not resolve order {order}: expected at least "
            f"{_SAMPLES_AN_ORDER * order:g}; sample faster"
        )
    orders, found = max(order, min(_ORDERS, int(samples / _SAMPLES_AN_ORDER))), []
    unstated = pulses is None and not asked and not is_encoder
    several = {turns.repeats: "the intervals between pulses repeat"} if unstated and turns.repeats > 1 else {}
    chosen, at = _chosen(run, group, in_si, index, sensors), turns_a_second(asked) if asked else None
    for i in chosen:
        dimension, factor = _reading(read, in_si, i)
        values, label = factor * _alive(read, in_si, i)[part], group.channels[i].label
        found.append(order_vector(label, dimension, values, turns, time, order, orders, at))
        inside = turns.contain(time)
        if unstated and (n := slower_vibration(values[inside], turns.angle(time[inside]), turns.count)) > 1:
            several[n] = (
                f"{several[n]}, {label}"
                if n in several
                else f"there is strong vibration at 1/{n} of the speed in {label}"
            )
    others = [] if sensors else [group.channels[i] for i in group.measured if i != index and i not in chosen]
    left_out = tuple(f"{c.label} ({c.unit or 'no unit'})" for c in others)
    clock = tuple(f"speeds and orders are by its time, which {one.message}" for one in run.findings
                  if one.code == "time_unit_assumed" and one.group in {None, group.name})  # fmt: skip
    return Vectors(order, turns, tuple(found), left_out, run.name, run.origin, asked, amplitude, phase, several, clock)


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
    inside = turns.contain(time)
    samples = 1.0 / (turns.resolution * turns.speed)
    stepped = 2.0 * np.pi * order / samples if turns.steep else 0.0
    jitter = 2.0 * np.pi * order * turns.speed * turns.rounding
    shrunk, shrunk_within = turns.shrinking(order)
    at, off = turns.off_range(speed or turns.speed)
    shift = None if turns.speeds is None else turns.speeds / at - 1.0
    found = fit_orders(values[inside], turns.angle(time[inside]), turns.count, order, orders, stepped, jitter, shift)
    value, reach = found.value / shrunk, coverage_factor(found.degrees_of_freedom)
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    along, across = (reach * float(np.sqrt(x @ found.covariance @ x)) for x in (u, np.array([-u[1], u[0]])))
    is_described = found.left < max(along, _COARSE * abs(value))
    off = max(off, abs(at / turns.speed - 1.0)) if found.is_hunting else off
    elsewhere = _BY_SPEED * off * abs(value)
    is_described &= not found.is_hunting or bool(elsewhere[0] < max(along, _COARSE * abs(value)))
    along, across = np.sqrt(np.square([along, across]) + found.left**2 + elsewhere**2).tolist()
    if shift is not None and turns.is_coarse:  # errors of the pulses move angle, speed and so the vector
        every = max(1, int(samples / (_MEANS * order)))  # the means of so many samples show what moves alike
        whole = slice(len(time) // every * every)
        mean, at_mean = (x[whole].reshape(-1, every).mean(axis=1) for x in (values, time))
        again = [_again(mean, at_mean, redrawn, order, at, len(found.powers)) for redrawn in turns.redrawn]
        moves = np.conj(u @ [1.0, 1.0j]) * np.array(again)
        spread = coverage_factor(len(again) - 1) * np.array([moves.real.std(ddof=1), moves.imag.std(ddof=1)])
        along, across = (float(np.hypot(*one)) for one in zip((along, across), spread, strict=True))
    along = float(np.hypot(along, coverage_factor() * abs(value) * shrunk_within))
    if turns.is_synchronous:  # one jump of the phase reduces the mean vector by up to 1 - cos(stepped / 2)
        along = float(np.hypot(along, abs(value) * (1.0 - np.cos(min(np.pi, 0.5 * stepped)))))
    significant = max(along, across) < abs(value)
    both = float(np.hypot(across, abs(value) * 2.0 * np.pi * order * turns.speed * turns.timing))
    ends = None
    if shift is not None:
        powers = np.array([shift.min(), shift.max()])[:, None] ** np.arange(1, len(found.powers) + 1)
        moved, scatter = powers @ found.powers / shrunk, np.einsum("ei,ij,ej->e", powers, found.spread, powers)
        if (np.abs(moved) > SEEN * np.sqrt(scatter)).any():
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
        is_described,
    )


def _again(values: Floats, time: Floats, turns: Turns, order: int, at: float, terms: int) -> complex:
    """The vector by other pulses of the same motion; what other orders leak into it is alike for all pulses."""
    inside = turns.contain(time)
    shift = None if turns.speeds is None else turns.speeds / at - 1.0
    return refit(values[inside], turns.angle(time[inside]), turns.count, order, shift, terms)


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
