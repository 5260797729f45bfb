"""Order vectors of a stored run: amplitude and phase of each sensor at a multiple of the speed, by its tachometer.

x = mean + sum over n of Re(X_n exp(i n theta)), theta the rotor's angle since the tachometer's pulse; over whole turns
these least squares are the synchronous average's Fourier coefficients. So the phase of X is a **lead**: the angle by
which the peak comes before the pulse; a heavy spot turned on with the rotation raises it alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

from ..errors import AnalysisError
from .orderfit import fit
from .tacho import STEADY_WITHIN, Turns, steady_turns
from .vector import OrderVector, Vectors

if TYPE_CHECKING:
    from ..store import Run
    from ..store.run import StoredGroup

UNITS = {"length": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""What a vibration sensor may read, and the unit in which its vectors are given."""
_BATCHES = 10
_ORDERS = 8
"""Orders that are fitted together, so that strong ones do not disturb the one that is asked for."""
_SAMPLES_AN_ORDER = 2.5


@dataclass(frozen=True)
class Tachometer:
    """Channel of the tachometer, one pulse a turn, and how its pulses are told."""

    channel: str = "tacho"
    level: float | None = None
    """In the channel's unit; None for half its swing."""
    falling: bool = False
    steady_within: float = STEADY_WITHIN


def of_run(run: "Run", tachometer: Tachometer, sensors: Sequence[str] = (), order: int = 1) -> Vectors:
    """Order vectors of ``sensors``, by default all of length, velocity or acceleration timed with the tachometer.

    Raises AnalysisError for an order that the samples or turns do not resolve, and as ``tacho.steady_turns``.
    """
    group, index = run.find(tachometer.channel)
    where = f"{run.name}: channel {tachometer.channel!r}"
    time, pulse = run.time(group.name), _finite(run, group, index)
    turns = steady_turns(where, time, pulse, tachometer.level, tachometer.falling, tachometer.steady_within)
    samples = 1.0 / (turns.resolution * turns.speed)
    if samples < _SAMPLES_AN_ORDER * order:
        raise AnalysisError(
            f"{run.name}: {samples:.3g} samples a turn do not resolve order {order}: expected at least "
            f"{_SAMPLES_AN_ORDER * order:g}; sample faster"
        )
    orders = max(order, min(_ORDERS, int(samples / _SAMPLES_AN_ORDER)))
    found = []
    for i in _chosen(run, group, index, sensors):
        dimension, factor = _reading(run, group, i)
        values = factor * _alive(run, group, i)
        found.append(order_vector(group.channels[i].label, dimension, values, turns, time, order, orders))
    return Vectors(order, turns, tuple(found))


def _chosen(run: "Run", group: "StoredGroup", tacho: int, sensors: Sequence[str]) -> list[int]:
    if not sensors:
        found = [i for i, c in enumerate(group.channels) if i != tacho and c.unit and _dimension(c.unit)]
        if not found:
            raise AnalysisError(
                f"{run.name}: no channel beside {group.channels[tacho].name!r} in a unit of length, velocity or "
                "acceleration: name the sensors"
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


def _dimension(unit: str) -> str | None:
    from balance.errors import UnitError
    from balance.quantities import factor_to_si

    for dimension in UNITS:
        try:
            factor_to_si(unit, dimension)
        except UnitError:
            continue
        return dimension
    return None


def _reading(run: "Run", group: "StoredGroup", index: int) -> tuple[str, float]:
    from balance.quantities import factor_to_si

    channel = group.channels[index]
    dimension = _dimension(channel.unit) if channel.unit else None
    if channel.unit is None or dimension is None:
        raise AnalysisError(
            f"{run.name}: channel {channel.name!r} is in {channel.unit or 'no unit'}: expected one of length, velocity "
            "or acceleration"
        )
    return dimension, factor_to_si(channel.unit, dimension)


def _finite(run: "Run", group: "StoredGroup", index: int) -> Floats:
    values = run.channel_at(group.name, index)
    odd = np.flatnonzero(~np.isfinite(values))
    if odd.size:
        raise AnalysisError(
            f"{run.name}: channel {group.channels[index].name!r} holds no number at sample {odd[0]}; repair it first"
        )
    return values


def _alive(run: "Run", group: "StoredGroup", index: int) -> Floats:
    """Values of a channel that moves: of one that does not, rounding errors would be given as a vector."""
    values = _finite(run, group, index)
    if np.ptp(values) == 0.0:
        channel = group.channels[index]
        raise AnalysisError(
            f"{run.name}: channel {channel.name!r} is {values[0]:g} {channel.unit} throughout: dead, stuck or not "
            "connected; name the others with --sensor"
        )
    return values


def order_vector(
    sensor: str, dimension: str, values: Floats, turns: Turns, time: Floats, order: int, orders: int
) -> OrderVector:
    """Vector of ``values`` (n,) [SI] sampled at ``time`` (n,) [s]; orders up to ``orders`` are fitted together."""
    inside = (time >= turns.pulses[0]) & (time < turns.pulses[-1])
    stepped = 2.0 * np.pi * order * turns.speed * turns.resolution if turns.steep else 0.0
    found = fit(values[inside], turns.angle(time[inside]), turns.count, order, orders, stepped)
    value, reach = found.value, coverage_factor(found.spare)
    u = np.array([value.real, value.imag]) / abs(value) if value else np.array([1.0, 0.0])
    along, across = (reach * float(np.sqrt(x @ found.covariance @ x)) for x in (u, np.array([-u[1], u[0]])))
    if turns.keeps_step:  # a phase that jumps once takes up to 1 - cos(stepped / 2) off the mean of the turned vectors
        along = float(np.hypot(along, abs(value) * (1.0 - np.cos(min(np.pi, 0.5 * stepped)))))
    told = max(along, across) < abs(value)
    both = float(np.hypot(across, abs(value) * 2.0 * np.pi * order * turns.speed * turns.timing))
    parts = _parts(values, turns, time, order, orders)
    squares = float((np.abs(parts) ** 2).mean())
    power = float(np.var(values[inside]))
    return OrderVector(
        sensor,
        dimension,
        value,
        along,
        _turned(both, abs(value)) if told else np.pi,
        _turned(across, abs(value)) if told else np.pi,
        abs(parts.mean()) ** 2 / squares if squares else 0.0,
        abs(value) ** 2 / 2.0 / power if power else 0.0,
        tuple(tone / turns.count * turns.speed for tone in found.tones),
    )


def _turned(across: float, size: float) -> float:
    """Angle by which so much across turns a vector at most [rad]."""
    return float(np.arcsin(min(1.0, across / size)))


def _parts(values: Floats, turns: Turns, time: Floats, order: int, orders: int) -> NDArray[np.complex128]:
    """Vectors of parts of whole turns, as many as batches, so that slow beats between turns count as scatter."""
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
