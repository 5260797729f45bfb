"""Force channels of reversed polarity: their readings oppose the load that the model gives their sensor.

The shaking wrench of the mechanism along the motion of the encoders is shared among the supports by their stiffnesses.
A reversed channel, or one exchanged with a channel that is loaded the other way, correlates with its load near -1. It
is a finding only where loads are large and explain the readings: the residual load of a balanced mechanism, and the
part that the base's motion adds, are not in this model.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import CounterpoiseError

from ..kinematics.smoothing_and_derivatives import low_pass
from ..loads.shaking_wrench import COMPONENTS
from ..recording import Finding
from ..rig.support_loads import support_wrenches
from ..runs.aligned_run import AlignedRun, recorded_clocks

if TYPE_CHECKING:
    from ..kinematics.smoothing_and_derivatives import Grid
    from ..rig import Column
    from ..runs.si_run import SIRun

CODE = "force_sign"
BANDWIDTH_HZ = 40.0
"""Low pass of loads and readings: the motions excite little above [Hz]."""
LARGE = 0.1
"""Least load of a channel that is checked, over the largest load of forces or of moments [-]."""
REVERSED = -0.8
"""Correlation below which a channel counts as reversed."""
LEAST_EXPLAINED = 0.8
"""Mean square of the correlations from which the model explains the readings."""
SIMILAR_SIZE = 2.0
"""Largest factor, either way, between readings and load of a channel that is checked."""


@dataclass(frozen=True)
class _Loaded:
    """A channel with a large load."""

    column: "Column"
    expected: Floats
    """Load by the model less its mean, zero at gaps, (n,) [N, N m]."""
    seen: Floats
    """Readings on the same grid, less their mean, (m,) [N, N m]."""


def reversed_polarity(run: "SIRun", aligned: Callable[[], AlignedRun]) -> list[Finding]:
    """A finding for each reversed force channel; none where that cannot be decided."""
    if not run.rig.supports:
        return []
    try:
        channels, clock = _channels(aligned())
    except CounterpoiseError:
        return []
    lag = clock if clock is not None else _lag(channels)
    if lag is None:
        return []
    every = [(one, *_correlation(one, lag)) for one in channels]
    found = [each for each in every if 1.0 / SIMILAR_SIZE < each[2] < SIMILAR_SIZE]
    if not found or np.mean([correlation**2 for _, correlation, _ in found]) < LEAST_EXPLAINED:
        return []
    return [_finding(run, *each) for each in found if each[1] < REVERSED]


def _channels(run: AlignedRun) -> tuple[list[_Loaded], int | None]:
    """The channels with large loads, and the lag of the readings [samples] where clocks give it."""
    grid, rig = run.grid, run.run.rig
    made = simulate(run.mechanism, run.trajectory(2.0 * BANDWIDTH_HZ))
    wrench = np.hstack([made.force, made.moment])
    kept = run.valid_samples(BANDWIDTH_HZ)
    found: list[_Loaded] = []
    for name, share in support_wrenches(rig.supports).items():
        support, columns = rig.supports[name], list(rig.supports[name].columns(name))
        loads = (wrench @ share.T)[:, [COMPONENTS.index(m) for m in support.measured]]
        if support.crosstalk is not None and not run.run.has_matrix(columns[0]):
            loads = loads @ np.array(support.crosstalk).T
        smooth = low_pass(loads, BANDWIDTH_HZ, grid.rate)
        found += [_loaded(run.run, c, grid, load, kept) for c, load in zip(columns, smooth.T, strict=True)]
    return _large(found), _known_lag(run)


def _loaded(run: "SIRun", column: "Column", grid: "Grid", load: Floats, kept: NDArray[np.bool_]) -> _Loaded:
    values, rate = run.signal(column)
    time = run.instants(column)
    even = np.arange(float(time[0]), float(time[-1]), grid.step)
    seen = np.interp(even, time, low_pass(values, BANDWIDTH_HZ, rate))
    return _Loaded(column, (load - load[kept].mean()) * kept, seen - np.median(seen))


def _large(channels: list[_Loaded]) -> list[_Loaded]:
    """Those whose load is large, among forces and among moments."""
    found = []
    for kind in "FM":
        same_kind = [one for one in channels if (one.column.component or "F")[0] == kind]
        largest = max((float(one.expected.std()) for one in same_kind), default=0.0)
        found += [one for one in same_kind if one.expected.std() > LARGE * largest > 0.0]
    return found


def _known_lag(aligned: AlignedRun) -> int | None:
    """Samples from the first reading to the first of the encoders by the stored clocks; None if unknown."""
    run, grid = aligned.run, aligned.grid
    name, support = next(iter(run.rig.supports.items()))
    column = next(iter(support.columns(name)))
    group, first = run.group_of(column), run.instants(column)[:1]
    if group != aligned.reference:
        maps = recorded_clocks(run)
        if group not in maps:
            return None
        first = maps[group].to_reference(first)
    return round((grid.start - float(first[0])) / grid.step)


def _lag(channels: list[_Loaded]) -> int | None:
    """The lag [samples] at which readings correlate best with their loads, of either sign; None without channels."""
    if not channels:
        return None
    total = np.sum([_correlations(one) ** 2 for one in channels], axis=0)
    return int(np.argmax(total)) - (len(channels[0].expected) - 1)


def _correlations(one: _Loaded) -> Floats:
    """Correlation of the readings with their load at each lag, (n + m - 1,) [-]."""
    from scipy.signal import correlate

    both = correlate(one.seen, one.expected, method="fft")
    return np.asarray(both / max(float(np.linalg.norm(one.seen) * np.linalg.norm(one.expected)), 1e-300))


def _correlation(one: _Loaded, lag: int) -> tuple[float, float]:
    """Correlation of the readings with their load, and the ratio of their standard deviations."""
    place = np.arange(len(one.expected)) + lag
    used = (place >= 0) & (place < len(one.seen)) & (one.expected != 0.0)
    load, seen = one.expected[used], one.seen[place[used]]
    if load.size < 2 or not load.std() > 0.0 or not seen.std() > 0.0:
        return 0.0, 0.0
    return float(np.corrcoef(load, seen)[0, 1]), float(seen.std() / load.std())


def _finding(run: "SIRun", one: _Loaded, correlation: float, ratio: float) -> Finding:
    column = one.column
    return Finding(
        CODE,
        column.channel,
        run.name,
        f"{run.name}: {column.channel}: reversed polarity: it opposes the load {column.component} that the motion puts "
        f"on {column.sensor}: correlation {correlation:.2f}, expected near 1, at {ratio:.2f} times the load's size; "
        "check its sign in the rig and the wiring, and whether it is exchanged with another channel",
    )
