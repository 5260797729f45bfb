"""A run on one clock, that of its encoders, with the motion of its mechanism.

Channels are interpolated on an even grid of the encoders' clock; gaps are masks, for nothing was measured there.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.mechanism.mechanism import Mechanism
from balance.results import first_of

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..kinematics.encoder_motion import (
    encoder_gaps,
    encoder_trajectory,
    group_of_encoders,
    loaded_mechanism,
    moving_interval,
)
from ..kinematics.gaps import Gaps, ValidSamples, gap_reach
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF, Grid, grid_of, low_pass
from ..recording import Conditions
from ..rig import Column, Rig
from ..rig.sensors import Encoder
from ..synchronization.clock_map import DRIFT_FROM_S, ClockMap, same_clock
from .si_run import SIRun

if TYPE_CHECKING:
    from ..synchronization.known_clocks import KnownClocks
    from ..synchronization.offset_and_drift import AlignedClock


@dataclass(frozen=True, eq=False)
class AlignedRun:
    """A run with its mechanism, on the clock of its encoders.

    Errors (no encoders, a clock that cannot be aligned, loops that do not close) are raised where the value is read.

    >>> import balance, testbench
    >>> run = testbench.SIRun.of(testbench.open_run("campaign/r001.h5"))
    >>> testbench.AlignedRun(run, balance.load("parallelogram-6bar")).run.name
    'r001'
    """

    run: SIRun
    unloaded: Mechanism
    """Without payload and counter-masses."""
    known_clocks: Mapping[str, ClockMap] = field(default_factory=dict)
    """Maps of groups onto the encoders' clock that are known, such as :func:`recorded_clocks`; others are found."""
    _trajectories: dict[float, Trajectory] = field(default_factory=dict, init=False, repr=False)
    _found: dict[str, ClockMap] = field(default_factory=dict, init=False, repr=False)

    @property
    def name(self) -> str:
        """The run's name."""
        return self.run.name

    @property
    def rig(self) -> Rig:
        """The rig that it is bound to."""
        return self.run.rig

    @property
    def conditions(self) -> Conditions:
        """Payload, counter-masses and motion, by the run table."""
        return self.run.conditions

    @cached_property
    def mechanism(self) -> Mechanism:
        """As it was mounted in this run. Raises AnalysisError where payload and mechanism do not fit."""
        return loaded_mechanism(self.run, self.unloaded)

    @cached_property
    def reference(self) -> str:
        """The group of the encoders, whose clock counts. Raises AnalysisError where it has none, or several."""
        return group_of_encoders(self.run)

    @cached_property
    def encoders(self) -> list[Column]:
        """Their channels."""
        return self.run.rig.columns_of(Encoder)

    @cached_property
    def grid(self) -> Grid:
        """Even instants of the encoders' clock, gaps bridged."""
        self.reference  # noqa: B018  raises where there is none
        return grid_of(self.run.instants(self.encoders[0]), f"{self.run.name}: encoders", bridged=True)

    def trajectory(self, bandwidth_hz: float) -> Trajectory:
        """Of all joints on the grid, positions smoothed below ``bandwidth_hz``; in gaps straight lines."""
        if bandwidth_hz not in self._trajectories:
            self._trajectories[bandwidth_hz] = encoder_trajectory(self.run, self.unloaded, bandwidth_hz)[1]
        return self._trajectories[bandwidth_hz]

    def motion_span(self, bandwidth_hz: float, margin_s: float) -> slice:
        """Samples of the grid from the first to the last motion of any joint, with a margin [s]."""
        speeds = (v for v in self.trajectory(bandwidth_hz).v.T if np.ptp(v) > 0.0)
        spans = [moving_interval(v, self.grid.rate, margin_s) for v in speeds]
        return slice(min(s.start for s in spans), max(s.stop for s in spans))

    @cached_property
    def base(self) -> base_motion.BaseAcceleration | None:
        """Readings of the accelerometers on the base, on their own clock; None where there is none, or it is fixed."""
        return None if self.rig.bench.fixed else base_motion.base_acceleration(self.run)

    def clock(self, group: str) -> ClockMap:
        """The map of a group's clock onto the encoders': the one that is known, else found in the records.

        By a trigger that the rig names instead where that is surer than either. Raises AnalysisError where the two
        cannot be aligned.
        """
        if group == self.reference:
            return same_clock((0.0, 0.0))
        if group not in self._found:
            self._find_clock(group)
        return self._found[group]

    def _find_clock(self, group: str) -> None:
        from ..synchronization import known_clocks, run_alignment  # runs of one logger need none of it

        related = self.related_clock(group)
        if related is not None and group in self.known_clocks:
            self._found[group] = related
            return
        times = self.run.time(self.reference)
        drift = bool(times[-1] - times[0] >= DRIFT_FROM_S)
        found = run_alignment.align_run(self.run, lambda: self.mechanism, self.reference, drift=drift, among={group})
        clocks = [found.aligned[group].clock] if group in found.aligned else []
        clocks += [] if related is None else [related]
        if not clocks:
            why = "; ".join(self._related.refused)
            refused = f"; nor by the trigger that the rig names: {why}" if why else ""
            raise AnalysisError(f"{found.refusal(group)}{refused}")
        self._found[group] = min(clocks, key=lambda one: known_clocks.within(self.run, group, one))

    @cached_property
    def _related(self) -> "KnownClocks":
        from ..synchronization.known_clocks import related_clocks

        return related_clocks(self.run, self.reference, self.known_clocks)

    def related_clock(self, group: str) -> ClockMap | None:
        """The map of a group's clock onto the encoders' that is known or that a trigger tells, the surer; or None."""
        return self._related.maps.get(group) or self.known_clocks.get(group)

    @property
    def by_trigger(self) -> "dict[str, AlignedClock]":
        """By group, the clocks that were asked for and that a trigger related."""
        told = self._related.by_trigger.items() if self._found else ()
        return {group: edges for group, edges in told if self._found.get(group) is self._related.maps[group]}

    def gaps(self, groups: Collection[str] = ()) -> Gaps:
        """Gaps of the encoders and other groups, on the encoders' clock."""
        others = sorted(set(groups) - {self.reference})
        if not others:
            return encoder_gaps(self.run)
        times = {group: self.clock(group).to_reference(self.run.time(group)) for group in others}
        return Gaps.of({self.reference: self.run.instants(self.encoders[0])} | times)

    def valid_samples(self, bandwidth_hz: float, groups: Collection[str] = ()) -> ValidSamples:
        """Samples of the grid that no gap of encoders and ``groups`` touches, positions smoothed below a bandwidth."""
        return ValidSamples(self.name, self.grid, self.gaps(groups), gap_reach(bandwidth_hz))

    def on_grid(self, group: str, time: Floats, values: Floats) -> Floats:
        """Values (m, k) at instants (m,) [s] of a group's clock interpolated on the grid, (n, k); low-passed first."""
        at = time if group == self.reference else self.clock(group).to_reference(time)
        rate = (len(time) - 1) / float(time[-1] - time[0])
        if rate > self.grid.rate:
            values = low_pass(values, HIGHEST_CUTOFF * self.grid.rate, rate)
        return np.column_stack([np.interp(self.grid.time, at, v) for v in values.T])

    def channels(self, columns: Sequence[Column]) -> Floats:
        """Channels of one logger on the grid, (n, k) [SI]."""
        time = self.run.instants(columns[0])
        return self.on_grid(self.run.group_of(columns[0]), time, self.run.stacked(columns))


def trigger_notes(runs: Iterable[AlignedRun]) -> list[str]:
    """A sentence on the clocks of runs that a trigger related, for people; none where it related none."""
    from ..synchronization.known_clocks import within

    found = [(run.run, group, one) for run in runs for group, one in run.by_trigger.items()]
    if not found:
        return []
    groups = first_of([group for _, group, _ in found], 4)
    contents = first_of(list(dict.fromkeys(one.content for *_, one in found)), 3)
    widest = max(within(run, group, one.clock) for run, group, one in found)
    return [f"Clocks of {groups} by the trigger that the rig names ({contents}), within {1e3 * widest:.3g} ms."]


def recorded_clocks(run: SIRun) -> dict[str, ClockMap]:
    """The newest recorded maps of a run's clocks onto that of its encoders; empty where there is none."""
    from ..synchronization.run_alignment import stored_clock_maps

    return stored_clock_maps(run.path, group_of_encoders(run)) if run.path.parent.is_dir() else {}
