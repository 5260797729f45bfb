"""What two loggers both saw of a bench, made of its channels: equal quantities, a moving body's acceleration, forces.

The motion of the base is taken out by an accelerometer on it, as far as one tells it (``base_motion``). What that
leaves goes beside: the base's accelerations, for sensors' inexact factors and rotations that they do not tell, and the
second derivative of the loads, for a frame that gives way below its elastic modes.

The base's acceleration as clocks need it: what an AC-coupled accelerometer was exposed to, and its noise.

Which channels of different loggers saw the same, by the rig: what clocks can be aligned by without asking.

From the encoders follow the accelerations of the moving bodies, seen by accelerometers on them, and, up to the
mechanism's first moments, the forces on its supports. Encoders of one joint, and accelerometers on one body, on several
loggers see the same at once.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.balancing import conditions
from balance.dynamics.moving_base import acceleration_in_body
from balance.dynamics.regressor import wrench_regressor
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..kinematics.encoder_motion import encoder_trajectory
from ..kinematics.motion_onset import rest_before
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF, LARGEST_STEP, low_pass
from ..rig.sensors import Accelerometer, Encoder
from ..runs.si_run import SIRun
from .clock_map import ClockMap
from .signal_preparation import Shared, gaps

if TYPE_CHECKING:
    from balance.closure import Trajectory

    from ..kinematics.smoothing_and_derivatives import Grid
    from ..rig import Column, Rig
    from ..store import Run


@dataclass(frozen=True)
class Base:
    """What the accelerometers on the base recorded in one group."""

    group: str
    rows: Floats
    """What each channel sees of the base's accelerations, (k, 6)."""
    time: Floats
    """On the group's clock, (m,) [s]."""
    values: Floats
    """(m, k) [m/s2]"""
    noise: Floats
    """Standard deviation of a sample by the rig, (k,) [m/s2]; zero where it states none."""


def recorded(run: "SIRun", group: str | None = None) -> Base | None:
    """The accelerometers on the base that a group holds; of any group, the one with most channels. None: no such."""
    found = base_motion.base_acceleration(run, group)
    if found is None:
        return None
    rate = (len(found.time) - 1) / float(found.time[-1] - found.time[0])
    corners = [getattr(run.rig.sensors[column.sensor], "high_pass", None) for column in found.columns]
    values = [restored(v, rate, corner) for v, corner in zip(found.values.T, corners, strict=True)]
    noise = np.array([stated_noise(column) for column in found.columns])
    return Base(found.group, found.rows, found.time, np.column_stack(values), noise)


def stated_noise(column: "Column") -> float:
    """Standard deviation of one sample as the rig states it, steps of q as noise of q^2 / 12 [SI]."""
    return float(np.hypot(column.noise, column.resolution / np.sqrt(12.0)))


def restored(values: Floats, rate_hz: float, corner: float | None) -> Floats:
    """What an AC-coupled sensor was exposed to, less its level at rest (or its mean): x = y + w int y dt, (n,).

    The inverse of s / (s + w), w = 2 pi times the ``corner`` [Hz] that its data sheet states; None: as it is. Without
    it, what is slow comes early: by half a millisecond in the forces of a balanced machine, at 0.3 Hz.
    """
    if corner is None:
        return values
    still = rest_before([values], rate_hz)
    passed = values - float(np.mean(values if still is None else values[still]))
    middle = 0.5 * (passed[1:] + passed[:-1])
    return np.asarray(passed + 2.0 * np.pi * corner / rate_hz * np.r_[0.0, np.cumsum(middle)])


LEAST_AXIS = 0.05
"""Share of the strongest signal below which one has mostly noise."""
CLEAR = 10.0
"""So many times its sensor's noise, in the band that is compared, is what goes beside: noise in it would bias."""


CUTOFF_HZ = 80.0
"""Of what is compared with encoders: twice what the moves need, and little of the encoders' steps [Hz]."""


@dataclass(frozen=True)
class Scene:
    """A run and, where something follows from the encoders, its mechanism."""

    run: "SIRun"
    mechanism: Callable[[], Mechanism]
    cutoff: float | None = None
    """Highest frequency that is compared [Hz]; by kind unless given."""

    @cached_property
    def loaded(self) -> Mechanism:
        """The mechanism as it was mounted in this run."""
        return self.mechanism()

    @cached_property
    def followed(self) -> "tuple[Grid, Trajectory]":
        """The trajectory by the encoders, on their clock."""
        return encoder_trajectory(self.run, self.loaded, 2.0 * self.highest)

    @cached_property
    def gaps(self) -> Floats:
        """Where the trajectory bridges gaps of the encoders' record, from and to, (g, 2) [s]."""
        return gaps(self.run.instants(self.run.rig.columns_of(Encoder)[0]), LARGEST_STEP)

    @property
    def highest(self) -> float:
        """Highest frequency that is compared with encoders [Hz]."""
        return self.cutoff or CUTOFF_HZ

    def columns(self, columns: "Iterable[Column]", group: str) -> "list[Column]":
        """Those of ``columns`` that the run holds in a group."""
        return [column for column in columns if self.run.holds(column, group)]


def plain(scene: Scene, reference: "Column", own: "Column", first: ClockMap | None) -> Shared:
    """A quantity that a channel of each logger measures."""
    run = scene.run
    return Shared(
        f"{own.channel} with {reference.channel}",
        run.instants(reference),
        (run.values(reference)[:, None],),
        run.instants(own),
        run.values(own)[:, None],
        signed=True,
        cutoff=scene.cutoff,
    )


def moving_body(scene: Scene, sensor: "Accelerometer", columns: "list[Column]", first: ClockMap | None) -> Shared:
    """An accelerometer on a moving body, less the base's acceleration where one logger has both, with the encoders."""
    grid, path = scene.followed
    mechanism, position = scene.loaded, np.array(sensor.position)
    axes = [column.component for column in columns]
    still, at = np.zeros((grid.count, 6)), ["xyz".index(axis) for axis in axes]
    expected = acceleration_in_body(mechanism, path, still, sensor.attached_to, position)[:, at]
    seen, time = scene.run.stacked(columns), scene.run.instants(columns[0])
    base = recorded(scene.run, scene.run.group_of(columns[0]))
    name, beside = f"acceleration of {sensor.attached_to} with encoders", None
    if first is not None and base is not None:
        rows = base_motion.sensor_rows(mechanism, path, sensor.attached_to, position, axes)
        share = base_motion.projector(rows, base.rows)
        both = np.hstack([seen, base.values])
        seen = np.einsum("nij,nj->ni", _carried(share, grid.time, first.to_reference(time)), both)
        expected = np.einsum("nij,nj->ni", share[:, :, : len(axes)], expected)
        name += ", base motion taken out"
        beside = base.values[:, _clear(base.values, base.noise, time, scene.highest)]
    kept = _strong(expected)
    return Shared(
        name,
        grid.time,
        tuple(expected[:, [i]] for i in kept),
        time,
        seen[:, kept],
        signed=True,
        cutoff=scene.highest,
        partial=base is None or first is None,
        beside=beside,
        gaps=scene.gaps,
    )


def forces(scene: Scene, columns: "list[Column]", known: Mapping[str, ClockMap], first: ClockMap | None) -> Shared:
    """Sums of the forces of the supports, with what the encoders allow a shaking force of this mechanism to be.

    Where the base's acceleration is known on the reference's clock, its part is fixed.
    """
    grid, path = scene.followed
    mechanism, time = scene.loaded, scene.run.instants(columns[0])
    pivots = [int(np.flatnonzero(row)[0]) for row in conditions.balance_conditions(mechanism).matrix]
    regressor = wrench_regressor(mechanism, path.q, path.v, path.a)[:, :3, pivots]
    loads, noise = _sums(scene, columns)
    seen, fixed, doubt = loads, np.zeros((grid.count, 3)), 0.0
    base = recorded(scene.run)
    own, name, beside, along = scene.run.group_of(columns[0]), "forces with encoders", None, None
    if base is not None and base.group in {own, *known}:
        share = base_motion.projector(base_motion.force_rows(mechanism, path), base.rows)
        name += ", base motion taken out"
        now = share.mean(axis=0) if first is None else _carried(share, grid.time, first.to_reference(time))
        seen = np.einsum("...ij,...j->...i", now[..., :3], loads)
        inexact = _clear(base.values, base.noise, base.time, scene.highest) if first is not None else []
        beside = _yielding(loads, noise, time, scene.highest) if first is not None else None
        if base.group == own:
            seen = seen + mechanism.total_mass * np.einsum("...ij,...j->...i", now[..., 3:], base.values)
            beside = None if beside is None else np.hstack([beside, base.values[:, inexact]])
        else:
            clock = known[base.group]
            smooth = _smooth(base.values, base.time, 2.0 * scene.highest)
            felt, doubt = _carried(smooth, clock.to_reference(base.time), grid.time), clock.deviation
            fixed = -mechanism.total_mass * np.einsum("nij,nj->ni", share[:, :, 3:], felt)
            along = felt[:, inexact]
        regressor = np.einsum("nij,njk->nik", share[:, :, :3], regressor)
    kept = _strong(regressor)
    return Shared(
        name,
        grid.time,
        tuple(regressor[:, i] for i in kept),
        time,
        seen[:, kept],
        cutoff=scene.highest,
        fixed=fixed[:, kept],
        partial=first is None or "base" not in name,
        fixed_doubt=doubt,
        beside=beside,
        along=along,
        gaps=scene.gaps,
    )


def _sums(scene: Scene, columns: "list[Column]") -> tuple[Floats, Floats]:
    """Sums of force channels by axis, (n, 3) [N], and their noise by the rig, (3,) [N]."""
    seen, power = np.zeros((len(scene.run.instants(columns[0])), 3)), np.zeros(3)
    for column in columns:
        axis = "xyz".index(column.component[1])
        seen[:, axis] += scene.run.values(column)
        power[axis] += stated_noise(column) ** 2
    return seen, np.sqrt(power)


def _smooth(values: Floats, time: Floats, cutoff: float) -> Floats:
    """Values (n, k) at instants (n,) [s], low-passed where the rate allows, so that a slower grid aliases no noise."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    return low_pass(values, min(cutoff, HIGHEST_CUTOFF * rate), rate)


def _clear(values: Floats, noise: Floats, time: Floats, cutoff: float) -> list[int]:
    """Which signals (n, k) are CLEAR times as large as their sensors' noise (k,) up to a cut-off [Hz], where stated."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    size = _smooth(values - values.mean(axis=0), time, cutoff).std(axis=0)
    return [int(i) for i in np.flatnonzero((noise > 0.0) & (size > CLEAR * noise * np.sqrt(2.0 * cutoff / rate)))]


def _yielding(loads: Floats, noise: Floats, time: Floats, cutoff: float) -> Floats:
    """Second derivatives of those loads (n, 3) that stand out, (n, k) [N/s2]: e'' = F'' / (m w^2) far below w."""
    smooth, step = _smooth(loads - loads.mean(axis=0), time, cutoff), float(time[-1] - time[0]) / (len(time) - 1)
    kept = [i for i in _clear(loads, noise, time, cutoff) if i in _strong(smooth)]
    return np.gradient(np.gradient(smooth[:, kept], step, axis=0), step, axis=0) if kept else smooth[:, :0]


def _carried(values: Floats, time: Floats, instants_: Floats) -> Floats:
    """Values (n, ...) at the instants ``time`` (n,) carried over to others (m,), (m, ...); held beyond the ends."""
    flat = values.reshape(len(values), -1)
    return np.column_stack([np.interp(instants_, time, v) for v in flat.T]).reshape(-1, *values.shape[1:])


def _strong(columns: Floats) -> list[int]:
    """Which signals (n, signals, ...) stand out: those that change by LEAST_AXIS of what the strongest does."""
    size = np.ptp(columns, axis=0).reshape(columns.shape[1], -1).max(axis=1)
    if not size.max() > 0.0:
        raise AnalysisError("the encoders do not move: there is nothing to align by")
    return [int(i) for i in np.flatnonzero(size > LEAST_AXIS * size.max())]


Making = Callable[[ClockMap | None], Shared]
"""What both saw, once roughly (None), then, where the base's motion is taken out, by a first map of the own clock."""


def signal_pairs(scene: Scene, reference: str, own: str, known: Mapping[str, ClockMap]) -> Iterator[Making]:
    """What the groups ``reference`` and ``own`` of a run both saw, best first; ``known`` are clocks aligned already."""
    for one, other in _same(scene, reference, own):
        yield partial(plain, scene, one, other)
    if not scene.columns(scene.run.rig.columns_of(Encoder), reference):
        return
    for name, sensor in scene.run.rig.of_kind(Accelerometer).items():
        columns = scene.columns(sensor.columns(name), own)
        if sensor.attached_to != "base" and columns:
            yield partial(moving_body, scene, sensor, columns)
    supports = scene.run.rig.supports.items()
    loads = [c for name, s in supports for c in scene.columns(s.columns(name), own) if c.component[0] == "F"]
    if loads:
        yield partial(forces, scene, loads, known)


def named(run: "Run", reference: str, own: str, cutoff: float | None = None) -> Shared:
    """Two channels that a person names; their units and signs do not matter, nor need the run have a rig."""
    return Shared(
        f"{own} with {reference}",
        _happened(run, reference),
        (run.channel(reference)[:, None],),
        _happened(run, own),
        run.channel(own)[:, None],
        cutoff=cutoff,
    )


def delay_of(run: "SIRun", group: str) -> float | None:
    """Of the filter of the logger that wrote a group [s], as the rig states it; None where it states none."""
    loggers = {column.logger for column in run.rig.columns() if run.holds(column, group)}
    stated = [run.rig.loggers[name].delay for name in loggers if run.rig.loggers[name].low_pass is not None]
    return max(stated, default=None)


def _happened(run: "Run", channel: str) -> Floats:
    """When what a channel's samples show happened, (n,) [s]; the filter is known where the stored rig has both."""
    where, index = run.find(channel)
    if run.rig is not None:
        si = SIRun.of(run)
        for column in si.rig.columns():
            if where.index(column.channel) == index:
                return si.instants(column)
    return run.time(where.name)


def _same(scene: Scene, reference: str, own: str) -> "Iterator[tuple[Column, Column]]":
    """Pairs of channels of the same quantity, one in each group."""
    seen: dict[object, Column] = {}
    for column in scene.columns(scene.run.rig.columns(), reference):
        if (quantity := _quantity(scene.run.rig, column)) is not None:
            seen.setdefault(quantity, column)
    for column in scene.columns(scene.run.rig.columns(), own):
        if (quantity := _quantity(scene.run.rig, column)) in seen:
            yield seen[quantity], column


def _quantity(rig: "Rig", column: "Column") -> object:
    """What a channel measures, where two of them measure the same."""
    sensor = rig.sensors[column.sensor]
    if isinstance(sensor, Accelerometer):
        return (sensor.kind, sensor.attached_to, sensor.position, column.component)
    return (sensor.kind, column.component) if sensor.kind in {"encoder", "torque"} else None
