"""Common signals of two loggers by the rig: equal quantities, a moving body's acceleration, the supports' forces.

Encoders of one joint, and accelerometers on one body, record the same. From the encoders follow the accelerations of
the moving bodies and, up to the mechanism's first moments, the forces on its supports. The motion of the base is taken
out by an accelerometer on it, as far as one measures it (``kinematics.base_motion``). What that does not explain has
nuisance columns: the base's accelerations, for inexact sensitivities and rotations that are not measured, and the
second derivative of the loads, for the compliance of a frame below its elastic modes.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from balance.arrays import Floats
from balance.balancing import conditions
from balance.closure import Trajectory
from balance.dynamics.moving_base import acceleration_in_body
from balance.dynamics.regressor import wrench_regressor
from balance.estimation.first_moment_imbalance import condition_columns
from balance.mechanism.forward_kinematics import poses
from balance.mechanism.loop_constraints import Anchor
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..kinematics.encoder_motion import encoder_trajectory, rest_before
from ..kinematics.gaps import gap_spans
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF, Grid, low_pass
from ..rig import Column, Rig
from ..rig.sensors import Accelerometer, Encoder, Trigger
from ..runs.si_run import SIRun
from ..store import Run
from .clock_map import ClockMap
from .signal_preparation import SharedSignals

LEAST_AXIS = 0.05
"""Share of the strongest signal below which a signal has mostly noise."""
CLEAR_RATIO = 10.0
"""Least ratio of a nuisance column to its sensor's noise in the band that is compared: noise in it would bias."""
CUTOFF_HZ = 80.0
"""Bandwidth of what is compared with encoders [Hz]: twice that of the motions, below most of the encoders' noise."""


def restored_base_acceleration(run: SIRun, group: str | None = None) -> base_motion.BaseAcceleration | None:
    """The accelerometers on the base (``base_motion.base_acceleration``), with AC coupling inverted."""
    found = base_motion.base_acceleration(run, group)
    if found is None:
        return None
    rate = (len(found.time) - 1) / float(found.time[-1] - found.time[0])
    corners = [getattr(run.rig.sensors[column.sensor], "high_pass", None) for column in found.columns]
    values = [high_pass_inverted(v, rate, corner) for v, corner in zip(found.values.T, corners, strict=True)]
    return replace(found, values=np.column_stack(values))


def high_pass_inverted(values: Floats, rate_hz: float, corner: float | None) -> Floats:
    """Input of an AC-coupled sensor from its readings (n,), less its level at rest (or mean), (n,) [unit of readings].

    x = y + w int y dt, the inverse of s / (s + w), w = 2 pi times the ``corner`` [Hz] of its data sheet; None: y. The
    filter advances slow signals: by half a millisecond in the forces of a balanced machine, at 0.3 Hz.
    """
    if corner is None:
        return values
    still = rest_before([values], rate_hz)
    passed = values - float(np.mean(values if still is None else values[still]))
    middle = 0.5 * (passed[1:] + passed[:-1])
    return np.asarray(passed + 2.0 * np.pi * corner / rate_hz * np.r_[0.0, np.cumsum(middle)])


@dataclass(frozen=True)
class RunMotion:
    """A run and, where signals follow from its encoders, its mechanism."""

    run: SIRun
    mechanism: Callable[[], Mechanism]
    cutoff: float | None = None
    """Highest frequency that is compared [Hz]; by kind of signal unless given."""

    @cached_property
    def loaded_mechanism(self) -> Mechanism:
        """The mechanism as mounted in this run."""
        return self.mechanism()

    @cached_property
    def trajectory(self) -> tuple[Grid, Trajectory]:
        """Grid and trajectory by the encoders, on their clock."""
        return encoder_trajectory(self.run, self.loaded_mechanism, 2.0 * self.highest_hz)

    @cached_property
    def gaps(self) -> Floats:
        """Start and end of gaps that the trajectory bridges, (g, 2) [s]."""
        return gap_spans(self.run.instants(self.run.rig.columns_of(Encoder)[0]))

    @property
    def highest_hz(self) -> float:
        """Highest frequency that is compared with encoders [Hz]."""
        return self.cutoff or CUTOFF_HZ

    def columns(self, columns: Iterable[Column], group: str) -> list[Column]:
        """The ``columns`` that the run holds in a group."""
        return [column for column in columns if self.run.holds(column, group)]


def same_quantity(motion: RunMotion, reference: Column, own: Column, first: ClockMap | None) -> SharedSignals:
    """One quantity that a channel of each logger measures."""
    run = motion.run
    return SharedSignals(
        f"{own.channel} with {reference.channel}",
        run.instants(reference),
        (run.values(reference)[:, None],),
        run.instants(own),
        run.values(own)[:, None],
        signed=True,
        cutoff=motion.cutoff,
    )


def body_accelerations(
    motion: RunMotion, sensor: Accelerometer, columns: list[Column], first: ClockMap | None
) -> SharedSignals:
    """An accelerometer on a moving body, less the base's acceleration where one logger has both, with the encoders."""
    grid, path = motion.trajectory
    mechanism = motion.loaded_mechanism
    mounted = mechanism.anchor(sensor.attached_to, np.array(sensor.position))
    axes = [column.component for column in columns]
    still, at = np.zeros((grid.count, 6)), ["xyz".index(axis) for axis in axes]
    expected = acceleration_in_body(mechanism, path, still, mounted)[:, at]
    own_signals, time = motion.run.stacked(columns), motion.run.instants(columns[0])
    base = restored_base_acceleration(motion.run, motion.run.group_of(columns[0]))
    name, own_nuisance = f"acceleration of {sensor.attached_to} with encoders", None
    if first is not None and base is not None:
        rows = base_motion.sensor_rows(mechanism, path, mounted, axes)
        share = base_motion.projector(rows, base.rows)
        both = np.hstack([own_signals, base.values])
        own_signals = np.einsum("nij,nj->ni", _interpolated(share, grid.time, first.to_reference(time)), both)
        expected = np.einsum("nij,nj->ni", share[:, :, : len(axes)], expected)
        name += ", base motion taken out"
        own_nuisance = base.values[:, _above_noise(base.values, base.noise, time, motion.highest_hz)]
    kept = _significant(expected)
    return SharedSignals(
        name,
        grid.time,
        tuple(expected[:, [i]] for i in kept),
        time,
        own_signals[:, kept],
        signed=True,
        cutoff=motion.highest_hz,
        partial=base is None or first is None,
        own_nuisance=own_nuisance,
        gaps=motion.gaps,
        caution=weight_caution(mechanism, path, sensor.attached_to, mounted),
    )


def weight_caution(mechanism: Mechanism, path: Trajectory, body: str, mounted: Anchor) -> str:
    """What to think of where an accelerometer at an anchor on a ``body`` turns in gravity; nothing elsewhere."""
    axes = poses(mechanism.tree, path.q).rotation[:, mounted.joint] @ mounted.rotation
    if np.ptp(np.einsum("nij,i->nj", axes, mechanism.gravity), axis=0).max() < LEAST_AXIS:
        return ""
    return (
        f"; {body} turns in gravity: an accelerometer there that shows weight (DC-coupled, such as MEMS) shows more "
        "than acceleration: take the weight off its log, or align by a trigger or a tap"
    )


def support_forces(
    motion: RunMotion, columns: list[Column], known: Mapping[str, ClockMap], first: ClockMap | None
) -> SharedSignals:
    """Sums of the supports' forces, with the regressor of the shaking force by the encoders.

    Where the base's acceleration is known on the reference's clock, its part is of fixed size.
    """
    grid, path = motion.trajectory
    mechanism, time = motion.loaded_mechanism, motion.run.instants(columns[0])
    shaking = wrench_regressor(mechanism, path.q, path.v, path.a)[:, :3]
    regressor = condition_columns(conditions.balance_conditions(mechanism), shaking)
    loads, noise = _sums(motion, columns)
    own_signals, fixed, doubt = loads, np.zeros((grid.count, 3)), 0.0
    base = restored_base_acceleration(motion.run)
    own, name, own_nuisance, reference_nuisance = motion.run.group_of(columns[0]), "forces with encoders", None, None
    if base is not None and base.group in {own, *known}:
        share = base_motion.projector(base_motion.force_rows(mechanism, path), base.rows)
        name += ", base motion taken out"
        now = share.mean(axis=0) if first is None else _interpolated(share, grid.time, first.to_reference(time))
        own_signals = np.einsum("...ij,...j->...i", now[..., :3], loads)
        inexact = _above_noise(base.values, base.noise, base.time, motion.highest_hz) if first is not None else []
        own_nuisance = _compliance_columns(loads, noise, time, motion.highest_hz) if first is not None else None
        if base.group == own:
            own_signals = own_signals + mechanism.total_mass * np.einsum("...ij,...j->...i", now[..., 3:], base.values)
            own_nuisance = None if own_nuisance is None else np.hstack([own_nuisance, base.values[:, inexact]])
        else:
            clock = known[base.group]
            smooth = _smooth(base.values, base.time, 2.0 * motion.highest_hz)
            felt, doubt = _interpolated(smooth, clock.to_reference(base.time), grid.time), clock.deviation
            fixed = -mechanism.total_mass * np.einsum("nij,nj->ni", share[:, :, 3:], felt)
            reference_nuisance = felt[:, inexact]
        regressor = np.einsum("nij,njk->nik", share[:, :, :3], regressor)
    kept = _significant(regressor)
    return SharedSignals(
        name,
        grid.time,
        tuple(regressor[:, i] for i in kept),
        time,
        own_signals[:, kept],
        cutoff=motion.highest_hz,
        fixed=fixed[:, kept],
        partial=first is None or "base" not in name,
        fixed_time_deviation=doubt,
        own_nuisance=own_nuisance,
        reference_nuisance=reference_nuisance,
        gaps=motion.gaps,
    )


def _sums(motion: RunMotion, columns: list[Column]) -> tuple[Floats, Floats]:
    """Sums of force channels by axis, less the weight that they show at rest, (n, 3) [N], and their noise, (3,) [N]."""
    time = motion.run.instants(columns[0])
    own_signals, power = np.zeros((len(time), 3)), np.zeros(3)
    for column in columns:
        axis = "xyz".index(column.component[1])
        own_signals[:, axis] += motion.run.values(column)
        power[axis] += column.total_noise**2
    return base_motion.without_rest(own_signals, time), np.sqrt(power)


def _smooth(values: Floats, time: Floats, cutoff: float) -> Floats:
    """Values (n, k) at instants (n,) [s], low-passed where the rate allows, so that a slower grid aliases no noise."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    return low_pass(values, min(cutoff, HIGHEST_CUTOFF * rate), rate)


def _above_noise(values: Floats, noise: Floats, time: Floats, cutoff: float) -> list[int]:
    """Signals (n, k) that exceed their sensors' stated noise (k,) up to a cut-off [Hz] by CLEAR_RATIO, as indices."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    size = _smooth(values - values.mean(axis=0), time, cutoff).std(axis=0)
    return [int(i) for i in np.flatnonzero((noise > 0.0) & (size > CLEAR_RATIO * noise * np.sqrt(2.0 * cutoff / rate)))]


def _compliance_columns(loads: Floats, noise: Floats, time: Floats, cutoff: float) -> Floats:
    """Second derivatives of significant loads (n, 3) [N], (n, k) [N/s2]: e'' = F'' / (m w^2) far below a mode w."""
    smooth, step = _smooth(loads - loads.mean(axis=0), time, cutoff), float(time[-1] - time[0]) / (len(time) - 1)
    kept = [i for i in _above_noise(loads, noise, time, cutoff) if i in _significant(smooth)]
    return np.gradient(np.gradient(smooth[:, kept], step, axis=0), step, axis=0) if kept else smooth[:, :0]


def _interpolated(values: Floats, time: Floats, instants: Floats) -> Floats:
    """Values (n, ...) at ``time`` (n,) interpolated at other instants (m,), (m, ...); constant beyond the ends."""
    flat = values.reshape(len(values), -1)
    return np.column_stack([np.interp(instants, time, v) for v in flat.T]).reshape(-1, *values.shape[1:])


def _significant(columns: Floats) -> list[int]:
    """Signals (n, signals, ...) that change by LEAST_AXIS of what the strongest does, as indices."""
    size = np.ptp(columns, axis=0).reshape(columns.shape[1], -1).max(axis=1)
    if not size.max() > 0.0:
        raise AnalysisError("the encoders do not move: there is nothing to align by")
    return [int(i) for i in np.flatnonzero(size > LEAST_AXIS * size.max())]


SignalBuilder = Callable[[ClockMap | None], SharedSignals]
"""Makes common signals: first without a map of the own clock (None), then by it where base motion is taken out."""


def signal_pairs(motion: RunMotion, reference: str, own: str, known: Mapping[str, ClockMap]) -> Iterator[SignalBuilder]:
    """Common signals of the groups ``reference`` and ``own``, best first; ``known`` are clocks aligned already."""
    measured: dict[object, Column] = {}
    for column in motion.columns(motion.run.rig.columns(), reference):
        measured.setdefault(_quantity(motion.run.rig, column), column)
    for column in motion.columns(motion.run.rig.columns(), own):
        quantity = _quantity(motion.run.rig, column)
        if quantity is not None and quantity in measured:
            yield partial(same_quantity, motion, measured[quantity], column)
    if not motion.columns(motion.run.rig.columns_of(Encoder), reference):
        return
    for name, sensor in motion.run.rig.of_kind(Accelerometer).items():
        columns = motion.columns(sensor.columns(name), own)
        if sensor.attached_to != "base" and columns:
            yield partial(body_accelerations, motion, sensor, columns)
    supports = motion.run.rig.supports.items()
    loads = [c for name, s in supports for c in motion.columns(s.columns(name), own) if c.component[0] == "F"]
    if loads:
        yield partial(support_forces, motion, loads, known)


SignalPairs = Callable[[RunMotion, str, str, Mapping[str, ClockMap]], Iterator[SignalBuilder]]
"""Finds the common signals of two groups, best first."""


def trigger_pairs(
    motion: RunMotion, reference: str, own: str, _known: Mapping[str, ClockMap]
) -> Iterator[SignalBuilder]:
    """The trigger that the groups ``reference`` and ``own`` recorded, by the rig."""

    def common_trigger(_first: ClockMap | None) -> SharedSignals:
        return named_channels(motion.run.recorded, *common_triggers(motion.run, reference, own)[0])

    yield common_trigger


def common_triggers(run: SIRun, reference: str, own: str) -> list[tuple[str, str]]:
    """Channels of the groups ``reference`` and ``own`` that recorded one trigger line each, by the rig.

    Raises AnalysisError where it names none in one of them, several of one line, or none of one line in both.
    """
    lines: list[dict[str, str]] = []
    for group in (reference, own):
        held: dict[str, str] = {}
        for column in run.rig.columns_of(Trigger):
            line = getattr(run.rig.sensors[column.sensor], "line", "")
            if run.holds(column, group) and held.setdefault(line, column.channel) != column.channel:
                raise AnalysisError(
                    f"{held[line]} and {column.channel} in {group} are triggers of one line, {line!r}: state in "
                    'the rig which line each is, such as line = "start"'
                )
        if not held:
            raise AnalysisError(
                f"the rig has no sensor of kind 'trigger' in {group}: add one for each logger that recorded the "
                "trigger, or name its channels, --pair REFERENCE=OWN"
            )
        lines.append(held)
    there, here = lines
    if not (shared := [(there[line], here[line]) for line in there if line in here]):
        raise AnalysisError(
            f"the triggers of {reference} ({', '.join(there)}) and of {own} ({', '.join(here)}) are of different "
            "lines: state the same `line` in the rig for those of one"
        )
    return shared


def trigger_groups(runs: Iterable[SIRun]) -> list[str]:
    """Groups for which the rig has a sensor of kind ``trigger`` that some run recorded."""
    found = (run.groups_of(filter(run.holds, run.rig.columns_of(Trigger))) for run in runs)
    return list(dict.fromkeys(group for groups in found for group in groups))


def named_channels(run: Run, reference: str, own: str, cutoff: float | None = None) -> SharedSignals:
    """Two channels that the user names; units and signs do not matter, and the run needs no rig.

    The delays of their loggers' filters are taken off where a stored rig states them.
    """
    si = None if run.rig is None else replace(SIRun.of(run), whole=True)

    def instants(channel: str) -> Floats:
        where, index = run.find(channel)
        columns = [] if si is None else [c for c in si.rig.columns() if where.index(c.channel) == index]
        return si.instants(columns[0]) if si and columns else run.time(where.name)

    return SharedSignals(
        f"{own} with {reference}",
        instants(reference),
        (run.channel(reference)[:, None],),
        instants(own),
        run.channel(own)[:, None],
        cutoff=cutoff,
    )


def delay_of(run: SIRun, group: str) -> float | None:
    """Delay of the filter of a group's logger [s] by the rig; None where it states none."""
    loggers = {column.logger for column in run.rig.columns() if run.holds(column, group)}
    stated = [run.rig.loggers[name].delay for name in loggers if run.rig.loggers[name].low_pass is not None]
    return max(stated, default=None)


def _quantity(rig: Rig, column: Column) -> object:
    """Key of what a channel measures, equal for channels that measure the same; None where none can."""
    sensor = rig.sensors[column.sensor]
    if isinstance(sensor, Accelerometer):
        return (sensor.kind, sensor.attached_to, sensor.position, column.component)
    return (sensor.kind, column.component) if sensor.kind in {"encoder", "torque"} else None
