"""Force channels whose sign goes against the load that the motion makes their sensor carry, by the model.

The shaking wrench of the mechanism as mounted, along the motion that the encoders show, is shared among the supports as
their stiffnesses have it. A channel that is turned, or exchanged with one that is loaded the other way, follows its
load with a correlation near -1. Told only where the loads are large and explain the readings, so that size and time
leave no doubt: what a balanced mechanism leaves, and what the base's motion adds, follows no model here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import CounterpoiseError
from balance.mechanism import Mechanism

from ..calibration.applied import crosses
from ..channels import in_si, instants
from ..clocks import stored
from ..findings import Finding
from ..motion.derivatives import low_pass
from ..motion.gaps import reach_of
from ..motion.joint_motion import encoder_gaps, followed, group_of_encoders, loaded
from ..rig.support_loads import shares
from ..wrench import COMPONENTS

if TYPE_CHECKING:
    from ..motion.derivatives import Grid
    from ..rig import Column, Rig
    from ..store import Run

CODE = "force_sign"
BANDWIDTH_HZ = 40.0
"""Of loads and readings alike: most of what the moves excite lies below."""
LARGE = 0.1
"""Of the largest expected load, of forces and of moments each, from which a channel is looked at."""
AGAINST = -0.8
"""Correlation below which a channel goes against its load."""
LEAST_FOLLOWED = 0.8
"""Mean square of the correlations, whatever their signs, from which the model explains the readings at all."""
OF_A_SIZE = 2.0
"""Up to this factor, either way, readings are of the size of their load."""


@dataclass(frozen=True)
class _Loaded:
    """A channel with a large load."""

    column: "Column"
    expected: Floats
    """By the model, less its mean, zero where gaps touch, (n,) [N, N m]."""
    seen: Floats
    """Readings on the same grid, less their mean, (m,) [N, N m]."""


def turned(run: "Run", rig: "Rig", mechanism: Callable[[], Mechanism]) -> list[Finding]:
    """A finding for each force channel that goes against its load; none where signs cannot be told.

    ``mechanism`` gives the model without payload and counter-masses, which the run's conditions put on.
    """
    if not rig.supports:
        return []
    try:
        channels, clock = _channels(run, rig, loaded(run, mechanism()))
    except CounterpoiseError:
        return []
    lag = clock if clock is not None else _lag(channels)
    if lag is None:
        return []
    every = [(one, *_followed(one, lag)) for one in channels]
    found = [each for each in every if 1.0 / OF_A_SIZE < each[2] < OF_A_SIZE]
    if not found or np.mean([correlation**2 for _, correlation, _ in found]) < LEAST_FOLLOWED:
        return []
    return [_finding(run, *each) for each in found if each[1] < AGAINST]


def _channels(run: "Run", rig: "Rig", model: Mechanism) -> tuple[list[_Loaded], int | None]:
    """The channels with large loads, and the samples by which readings are late, where that is known."""
    grid, path = followed(run, rig, model, 2.0 * BANDWIDTH_HZ, bridged=True)
    made = simulate(model, path)
    wrench = np.hstack([made.force, made.moment])
    kept = encoder_gaps(run, rig).sound(grid, reach_of(BANDWIDTH_HZ))
    found: list[_Loaded] = []
    for name, share in shares(rig.supports).items():
        support, columns = rig.supports[name], list(rig.supports[name].columns(name))
        loads = (wrench @ share.T)[:, [COMPONENTS.index(m) for m in support.measured]]
        if support.crosstalk is not None and not crosses(run, columns[0]):
            loads = loads @ np.array(support.crosstalk).T
        smooth = low_pass(loads, BANDWIDTH_HZ, grid.rate)
        found += [_of(run, c, grid, load, kept) for c, load in zip(columns, smooth.T, strict=True)]
    return _large(found), _known_lag(run, rig, grid)


def _of(run: "Run", column: "Column", grid: "Grid", load: Floats, kept: NDArray[np.bool_]) -> _Loaded:
    values, rate = in_si(run, column)
    time = instants(run, column)
    even = np.arange(float(time[0]), float(time[-1]), grid.step)
    seen = np.interp(even, time, low_pass(values, BANDWIDTH_HZ, rate))
    return _Loaded(column, (load - load[kept].mean()) * kept, seen - np.median(seen))


def _large(channels: list[_Loaded]) -> list[_Loaded]:
    """Those whose load is large, among forces and among moments."""
    found = []
    for kind in "FM":
        alike = [one for one in channels if (one.column.component or "F")[0] == kind]
        largest = max((float(one.expected.std()) for one in alike), default=0.0)
        found += [one for one in alike if one.expected.std() > LARGE * largest > 0.0]
    return found


def _known_lag(run: "Run", rig: "Rig", grid: "Grid") -> int | None:
    """By the clocks that the campaign holds, samples from the readings' first to the encoders' first; None: unknown."""
    name, support = next(iter(rig.supports.items()))
    column = next(iter(support.columns(name)))
    group, first = run.find(column.channel)[0].name, instants(run, column)[:1]
    reference = group_of_encoders(run, rig)
    if group != reference:
        maps = stored.read(run.path, reference) if run.path.parent.is_dir() else {}
        if group not in maps:
            return None
        first = maps[group].to_reference(first)
    return round((grid.start - float(first[0])) / grid.step)


def _lag(channels: list[_Loaded]) -> int | None:
    """The samples by which readings are late, at which they follow their loads most, whatever the signs."""
    if not channels:
        return None
    follows = np.sum([_correlations(one) ** 2 for one in channels], axis=0)
    return int(np.argmax(follows)) - (len(channels[0].expected) - 1)


def _correlations(one: _Loaded) -> Floats:
    """Of readings with their load at each lag."""
    from scipy.signal import correlate

    both = correlate(one.seen, one.expected, method="fft")
    return np.asarray(both / max(float(np.linalg.norm(one.seen) * np.linalg.norm(one.expected)), 1e-300))


def _followed(one: _Loaded, lag: int) -> tuple[float, float]:
    """Correlation of the readings with their load, and how many times as large they are, where both are known."""
    place = np.arange(len(one.expected)) + lag
    used = (place >= 0) & (place < len(one.seen)) & (one.expected != 0.0)
    load, seen = one.expected[used], one.seen[place[used]]
    if load.size < 2 or not load.std() > 0.0 or not seen.std() > 0.0:
        return 0.0, 0.0
    return float(np.corrcoef(load, seen)[0, 1]), float(seen.std() / load.std())


def _finding(run: "Run", one: _Loaded, correlation: float, ratio: float) -> Finding:
    column = one.column
    return Finding(
        CODE,
        column.channel,
        run.name,
        f"{run.name}: {column.channel}: goes against the load {column.component} that the motion makes {column.sensor} "
        f"carry: correlation {correlation:.2f}, {ratio:.2f} times its size, expected near 1; is its sign turned in the "
        "rig or the wiring, or is the channel exchanged with another?",
    )
