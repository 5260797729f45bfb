"""Which channels of different loggers saw the same, by the rig: what clocks can be aligned by without asking.

From the encoders follow the accelerations of the moving bodies, seen by accelerometers on them, and, up to the
mechanism's first moments, the forces on its supports. Encoders of one joint, and accelerometers on one body, on several
loggers see the same at once.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from balance import conditions
from balance.arrays import Floats
from balance.mechanism import Mechanism
from balance.regressor import wrench_regressor

from .. import base_motion
from ..bench.carried import acceleration_in_body
from ..channels import in_si, instants
from ..errors import AnalysisError
from ..joint_motion import encoders, followed
from ..pairing import rig_of
from ..rig.sensors import Accelerometer
from .mapping import ClockMap
from .shared import Shared

if TYPE_CHECKING:
    from balance.closure import Trajectory

    from ..derivatives import Grid
    from ..rig import Column, Rig
    from ..store import Run

CUTOFF_HZ = 80.0
"""Of what is compared with encoders: twice what the moves need, and little of the encoders' steps [Hz]."""
LEAST_AXIS = 0.05
"""Share of the strongest signal below which one has mostly noise."""


Making = Callable[[ClockMap | None], Shared]
"""What both saw, once roughly (None), then, where the base's motion is taken out, by a first map of the own clock."""


@dataclass(frozen=True)
class Scene:
    """A run with its rig and, where something follows from the encoders, its mechanism."""

    run: "Run"
    rig: "Rig"
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
        return followed(self.run, self.rig, self.loaded, 2.0 * self.highest)

    @property
    def highest(self) -> float:
        """Highest frequency that is compared with encoders [Hz]."""
        return self.cutoff or CUTOFF_HZ

    def columns(self, columns: "Iterable[Column]", group: str) -> "list[Column]":
        """Those of ``columns`` that the run holds in a group."""
        where = self.run.group(group)
        return [column for column in columns if where.index(column.channel) is not None]


def candidates(scene: Scene, reference: str, own: str, known: Mapping[str, ClockMap]) -> Iterator[Making]:
    """What the groups ``reference`` and ``own`` of a run both saw, best first; ``known`` are clocks aligned already."""
    for one, other in _same(scene, reference, own):
        yield partial(_plain, scene, one, other)
    if not scene.columns(encoders(scene.rig), reference):
        return
    for name, sensor in scene.rig.of_kind(Accelerometer).items():
        columns = scene.columns(sensor.columns(name), own)
        if sensor.attached_to != "base" and columns:
            yield partial(_moving_body, scene, sensor, columns)
    supports = scene.rig.supports.items()
    forces = [c for name, s in supports for c in scene.columns(s.columns(name), own) if c.component[0] == "F"]
    if forces:
        yield partial(_forces, scene, forces, known)


def named(run: "Run", reference: str, own: str, cutoff: float | None = None) -> Shared:
    """Two channels that a person names; their units and signs do not matter."""
    return Shared(
        f"{own} with {reference}",
        _happened(run, reference),
        (run.channel(reference)[:, None],),
        _happened(run, own),
        run.channel(own)[:, None],
        cutoff=cutoff,
    )


def delay_of(rig: "Rig", run: "Run", group: str) -> float | None:
    """Of the filter of the logger that wrote a group [s], as the rig states it; None where it states none."""
    where = run.group(group)
    loggers = {column.logger for column in rig.columns() if where.index(column.channel) is not None}
    stated = [rig.loggers[name].delay for name in loggers if rig.loggers[name].low_pass is not None]
    return max(stated, default=None)


def _happened(run: "Run", channel: str) -> Floats:
    """When what a channel's samples show happened, (n,) [s]; the filter is known where the stored rig has both."""
    where, index = run.find(channel)
    for column in rig_of(run).columns() if run.rig is not None else ():
        if where.index(column.channel) == index:
            return instants(run, column)
    return run.time(where.name)


def _same(scene: Scene, reference: str, own: str) -> "Iterator[tuple[Column, Column]]":
    """Pairs of channels of the same quantity, one in each group."""
    seen: dict[object, Column] = {}
    for column in scene.columns(scene.rig.columns(), reference):
        if (quantity := _quantity(scene.rig, column)) is not None:
            seen.setdefault(quantity, column)
    for column in scene.columns(scene.rig.columns(), own):
        if (quantity := _quantity(scene.rig, column)) in seen:
            yield seen[quantity], column


def _quantity(rig: "Rig", column: "Column") -> object:
    """What a channel measures, where two of them measure the same."""
    sensor = rig.sensors[column.sensor]
    if isinstance(sensor, Accelerometer):
        return (sensor.kind, sensor.attached_to, sensor.position, column.component)
    return (sensor.kind, column.component) if sensor.kind in {"encoder", "torque"} else None


def _plain(scene: Scene, reference: "Column", own: "Column", first: ClockMap | None) -> Shared:
    run = scene.run
    return Shared(
        f"{own.channel} with {reference.channel}",
        instants(run, reference),
        (in_si(run, reference)[0][:, None],),
        instants(run, own),
        in_si(run, own)[0][:, None],
        signed=True,
        cutoff=scene.cutoff,
    )


def _moving_body(scene: Scene, sensor: Accelerometer, columns: "list[Column]", first: ClockMap | None) -> Shared:
    """An accelerometer on a moving body, less the base's acceleration where one logger has both, with the encoders."""
    grid, path = scene.followed
    mechanism, position = scene.loaded, np.array(sensor.position)
    axes = [column.component for column in columns]
    still = np.zeros((grid.count, 6))
    expected = acceleration_in_body(mechanism, path, still, sensor.attached_to, position)[
        :, ["xyz".index(a) for a in axes]
    ]
    seen, time = np.column_stack([in_si(scene.run, column)[0] for column in columns]), instants(scene.run, columns[0])
    base = base_motion.recorded(scene.run, scene.rig, scene.run.find(columns[0].channel)[0].name)
    name = f"acceleration of {sensor.attached_to} with encoders"
    if first is not None and base is not None:
        rows = base_motion.sensor_rows(mechanism, path, sensor.attached_to, position, axes)
        share = base_motion.projector(rows, base.rows)
        k = len(axes)
        both = np.hstack([seen, base.values])
        seen = np.einsum("nij,nj->ni", _carried(share, grid.time, first.to_reference(time)), both)
        expected = np.einsum("nij,nj->ni", share[:, :, :k], expected)
        name += ", base motion taken out"
    kept = _strong(expected)
    made = tuple(expected[:, [i]] for i in kept)
    partial_ = base is None or first is None
    return Shared(name, grid.time, made, time, seen[:, kept], True, scene.highest, partial=partial_, modelled=True)


def _forces(scene: Scene, columns: "list[Column]", known: Mapping[str, ClockMap], first: ClockMap | None) -> Shared:
    """Sums of the forces of the supports, with what the encoders allow a shaking force of this mechanism to be.

    Where the base's acceleration is known on the reference's clock, it is among the columns.
    """
    grid, path = scene.followed
    mechanism, time = scene.loaded, instants(scene.run, columns[0])
    pivots = [int(np.flatnonzero(row)[0]) for row in conditions.find(mechanism).matrix]
    regressor = wrench_regressor(mechanism, path.q, path.v, path.a)[:, :3, pivots]
    seen = np.zeros((len(time), 3))
    for column in columns:
        seen[:, "xyz".index(column.component[1])] += in_si(scene.run, column)[0]
    base = base_motion.recorded(scene.run, scene.rig)
    own, name = scene.run.find(columns[0].channel)[0].name, "forces with encoders"
    fixed, doubt = np.zeros((grid.count, 3)), 0.0
    if base is not None and base.group in {own, *known}:
        share = base_motion.projector(base_motion.force_rows(mechanism, path), base.rows)
        name += ", base motion taken out"
        now = share.mean(axis=0) if first is None else _carried(share, grid.time, first.to_reference(time))
        seen = np.einsum("...ij,...j->...i", now[..., :3], seen)
        if base.group == own:
            seen += mechanism.total_mass * np.einsum("...ij,...j->...i", now[..., 3:], base.values)
        else:
            clock = known[base.group]
            felt, doubt = _carried(base.values, clock.to_reference(base.time), grid.time), clock.deviation
            fixed = -mechanism.total_mass * np.einsum("nij,nj->ni", share[:, :, 3:], felt)
        regressor = np.einsum("nij,njk->nik", share[:, :, :3], regressor)
    kept = _strong(regressor)
    made = tuple(regressor[:, i] for i in kept)
    partial_ = first is None or "base" not in name
    return Shared(
        name, grid.time, made, time, seen[:, kept], False, scene.highest, fixed[:, kept], partial_, True, doubt
    )


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
