"""Which channels of different loggers saw the same, by the rig: what clocks can be aligned by without asking.

From the encoders follow the accelerations of the moving bodies, seen by accelerometers on them, and, up to the
mechanism's first moments, the forces on its supports. Encoders of one joint, and accelerometers on one body, on several
loggers see the same at once.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING

from balance.arrays import Floats

from ..rig.sensors import Accelerometer, Encoder
from ..runs.si_run import SIRun
from .contents import Scene, forces, moving_body, plain
from .mapping import ClockMap
from .shared import Shared

if TYPE_CHECKING:
    from ..rig import Column, Rig
    from ..store import Run

Making = Callable[[ClockMap | None], Shared]
"""What both saw, once roughly (None), then, where the base's motion is taken out, by a first map of the own clock."""


def candidates(scene: Scene, reference: str, own: str, known: Mapping[str, ClockMap]) -> Iterator[Making]:
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
