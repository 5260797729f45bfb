"""One run as its channels show it: reduced in one pass, so that a campaign of hundreds of runs fits into memory."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from balance.arrays import Floats, parabola_peak
from balance.errors import ClosureError, CounterpoiseError, ModelError
from balance.mechanism.mechanism import Mechanism
from balance.motion.motion_files import motion_from_texts

from ..errors import AnalysisError
from ..kinematics.encoder_motion import encoder_gaps, group_of_encoders
from ..kinematics.motion_recognition import (
    NO_GAP,
    REST_SHARE,
    RecognizedMotion,
    Source,
    legs_by_accelerometer,
    legs_by_command,
    legs_of_path,
    name_motions,
)
from ..kinematics.smoothing_and_derivatives import ALMOST, HIGHEST_CUTOFF, block_means, bridge_gaps, grid_of, low_pass
from ..quality.clipping import is_dead, stuck_value
from ..recording import Conditions, mounted_masses, payload_body, with_one_payload
from ..rig import Column, Rig
from ..rig.sensors import Accelerometer, Encoder, Target, Torque
from ..runs.si_run import SIRun
from .model_loads import BAND_HZ, EDGE_S, LEAST_SAMPLES, ModelledRun
from .peak_accelerations import EncoderErrors, Peak

BLOCKS = 8
"""Blocks of a run, for the block jackknife."""
ABOVE_NOISE = 5.0
"""Expected reading over the channel's noise in the band from which the model is a witness [-]."""
RECORD_S = 2.0
"""Start of a record that is kept to compare runs [s]."""
RECORD_SAMPLES = 1 << 14
"""Most samples of it: hundreds of runs fit into a hundred megabytes."""
SPANS = 40
"""Spans of a record of which the quietest tenth shows the noise."""
SPAN_SAMPLES = 512
"""Most samples of each."""
THIN_SAMPLES = 20_000
"""Samples of a record, at least, from which its drift is taken."""
LEAST_RATE_HZ = 1.0
"""Of encoders, below which they show no motion."""
SPEED_RATE_HZ = 100.0
"""At which speeds of encoders are kept [Hz]."""
SPEED_BAND_HZ = 20.0
"""Low pass of these [Hz]."""
VIBRATION_RATE_HZ = 100.0
"""At which vibrations below BAND_HZ are kept [Hz]."""
VIBRATION_SAMPLES = 25.0
"""Samples of a period of BAND_HZ, at least, to which they are averaged before they are filtered: its upper edge is then
0.3 % lower, in all runs alike."""
VIBRATION_S = 30.0
"""Start of them that is kept [s]."""
_CARRIED = ("payload_kg", "payloads", "counter_masses")
"""Of a run's conditions, what does not decide how it moves."""
STORED_RATE_HZ = 1000.0
"""At which a stored motion is sampled [Hz]."""
DRIVE_TERMS = ("offset", "armature", "viscous", "coulomb")
"""Of a drive, beyond what the mechanism's bodies need."""
MOVED = 1e-3
"""Change of a joint's position from which something moves [rad, m]."""
COULOMB_SPEED = 0.05
"""Speed at which dry friction has reached 76 % of its value [rad/s, m/s]."""


def jackknife(estimates: Floats) -> Floats:
    """Standard uncertainty (...) from estimates (b, ...) [any unit] that each leave out one block."""
    count = len(estimates)
    return np.sqrt((count - 1.0) / count * np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0))


@dataclass(frozen=True, eq=False)
class ChannelRecord:
    """One channel of a run."""

    column: Column
    group: str
    start: Floats
    """First RECORD_S of it, (n,) float32 [SI]."""
    rate_hz: float
    dead: bool
    """Whether it shows one value only."""
    stuck: str | None
    """Where it keeps one value after it has moved; None if nowhere."""
    clipped: bool
    """Whether it reached the end of its range, or seems to have."""
    noise: float
    """Standard deviation of what no motion causes: third differences in the quietest spans [SI]."""
    drift: float
    """Change of its level over the record, by a straight line [SI]."""
    span: float
    """Largest less smallest value, that line taken off [SI]."""


@dataclass(frozen=True, eq=False)
class TorqueEquations:
    """Torques of a run's drives as sums of columns, as products of columns: block by block, drive by drive."""

    joints: tuple[str, ...]
    names: tuple[str, ...]
    """``torque``, ``model``, ``payload``, sites of counter-masses, then DRIVE_TERMS."""
    products: Floats
    """(blocks, joints, columns, columns)."""


class Response:
    """Readings y (n, k) of a sensor's channels against what the model expects of them, p, as mean products [SI].

    By channel, (k,): sizes of ``readings`` and ``expected`` ones, ``noise`` below BAND_HZ; whether more than that is
    expected, ``witnessed``; ``correlation`` and ``gain`` of the readings, its standard uncertainty ``gain_deviation``;
    ``quadrature``, mean products with what is expected a quarter period earlier [SI].
    """

    def __init__(self, columns: tuple[Column, ...], noise: Floats, y: Floats, p: Floats) -> None:
        from scipy.signal import hilbert

        self.columns, self.noise = columns, noise
        self.quadrature = np.mean(y * np.imag(hilbert(p, axis=0)), axis=0)
        blocks = [np.array_split(values, BLOCKS) for values in (y, p)]
        yp, pp = (np.array([a.T @ b / len(y) for a, b in zip(one, blocks[1], strict=True)]) for one in blocks)
        self.yy, self.yp, self.pp = y.T @ y / len(y), yp.sum(axis=0), pp.sum(axis=0)
        self.readings, self.expected = np.sqrt(np.diag(self.yy)), np.sqrt(np.diag(self.pp))
        self.witnessed = (self.expected > ABOVE_NOISE * noise) & (self.expected > 0.0)
        self.correlation = np.diag(self.yp) / np.maximum(self.readings * self.expected, 1e-300)
        self.gain = np.diag(self.yp) / np.maximum(self.expected**2, 1e-300)
        rest_yp, rest_pp = (np.diagonal(m.sum(axis=0) - m, axis1=1, axis2=2) for m in (yp, pp))
        self.gain_deviation = jackknife(rest_yp / np.maximum(rest_pp, 1e-300))


@dataclass(eq=False)
class Observation:
    """What one run shows."""

    name: str
    conditions: Conditions
    """By the run table; of the one body that carries the payload it is ``payload_kg``."""
    rig: Rig
    logs: dict[str, str] = field(default_factory=dict)
    """By channel, the file of its log; its group where that is not known."""
    records: dict[str, ChannelRecord] = field(default_factory=dict)
    """By channel."""
    peak_acceleration: dict[str, Peak] = field(default_factory=dict)
    """Of what is driven, by ``command`` and ``encoders`` [m/s2]."""
    peak_joint_acceleration: tuple[Peak, ...] = ()
    """Of joints that turn and have an encoder: largest of one joint, and of the norm over all [rad/s2]."""
    encoders: tuple[str, ...] = ()
    """Channels of the encoders."""
    encoder_speeds: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    """Of each, every 1 / SPEED_RATE_HZ, (n, k) float32 [rad/s, m/s]."""
    wanted_peaks: tuple[float, ...] = ()
    """Peak accelerations of the stored motion of joints, of one joint and along a leg [rad/s2, m/s2]."""
    commanded_speeds: dict[str, Floats] = field(default_factory=dict)
    """By channel of an encoder whose joint the stored motion drives, likewise, (n,) [rad/s, m/s]."""
    vibrations: dict[tuple[str, ...], Floats] = field(default_factory=dict)
    """By the channels of an accelerometer, every 1 / VIBRATION_RATE_HZ below BAND_HZ, (n, k) float32 [m/s2]."""
    motions: dict[Source, list[RecognizedMotion]] = field(default_factory=dict)
    """By ``command``, ``encoders`` and ``acceleration``."""
    torque: TorqueEquations | None = None
    responses: list[Response] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    """Why a witness is silent, by its name."""
    moves: bool = False
    """Whether the encoders or the command move."""
    unclosed: str | None = None
    """Why the mechanism's loops do not follow the encoders; None where they do, or there are none."""
    mechanism_kg: float = 0.0
    """Mass of all that moves, without payload and counter-masses; 0 where that is not known [kg]."""
    unread: str | None = None
    """Why the stored mechanism cannot be read; None where it can, or there are no encoders."""

    def without_encoders(self) -> "Observation":
        """The same less what is made of its encoders, which are contradicted."""
        peaks = {witness: peak for witness, peak in self.peak_acceleration.items() if witness != "encoders"}
        motions = self.motions | {"encoders": []}
        return replace(self, peak_acceleration=peaks, motions=motions, peak_joint_acceleration=(), torque=None,
                       responses=[], unclosed=None)  # fmt: skip

    @cached_property
    def commanded(self) -> dict[str, object]:
        """What the run table states of how a run moves, whatever it carries."""
        return {key: value for key, value in self.condition.items() if key not in _CARRIED}

    @cached_property
    def condition(self) -> dict[str, object]:
        """What the run table states of a run and all its repeats."""
        return {key: value for key, value in self.conditions.items() if key != "repeat"}

    @cached_property
    def unmounted_condition(self) -> dict[str, object]:
        """The same less counter-masses: of runs with and without them."""
        return {key: value for key, value in self.condition.items() if key != "counter_masses"}

    @property
    def counter_masses(self) -> dict[str, float]:
        """Counter-masses above zero by site, by the run table [kg]."""
        return mounted_masses(self.conditions, "counter_masses")

    @contextmanager
    def witness(self, name: str) -> Iterator[None]:
        """Where something is read of the run: a witness that fails leaves its reason."""
        try:
            yield
        except CounterpoiseError as error:
            self.reasons[name] = str(error)
            self.unclosed = str(error) if isinstance(error, ClosureError) else self.unclosed
        except np.linalg.LinAlgError:  # a dead centre
            self.reasons[name] = "the drives do not determine the motion everywhere"


def observe(run: SIRun, mechanism: Callable[[], Mechanism]) -> Observation:
    """Read a run once; ``mechanism`` is that of its rig, unloaded. A witness that fails leaves its reason."""
    stated = with_one_payload(run.conditions, payload_body(run.recorded.inputs))
    seen = Observation(run.name, stated, run.rig)
    run = run.preloaded(columns := observed_columns(run))
    files = {
        group: one["name"] for one in run.recorded.provenance.get("sources", ()) for group in one.get("groups", ())
    }
    seen.logs = {column.channel: files.get(group := run.group_of(column), group) for column in columns}
    for column in filter(_is_recorded, columns):
        with seen.witness(column.channel):
            seen.records[column.channel] = _record(run, column)
    with seen.witness("command"):
        if not (target := run.rig.columns_of(Target)):
            raise AnalysisError("the rig has no target")
        seen.peak_acceleration["command"] = Peak(float(np.linalg.norm(run.stacked(target), axis=1).max()))
        seen.moves |= seen.peak_acceleration["command"].value > 0.0
        group, legs, gaps = legs_by_command(run)
        seen.motions["command"] = name_motions(legs, "command", group, gaps)
    with seen.witness("acceleration"):
        group, legs, gaps = legs_by_accelerometer(run)
        seen.motions["acceleration"] = name_motions(legs, "acceleration", group, gaps)
    if encoders := run.rig.columns_of(Encoder):
        with seen.witness("paths"):
            _keep_speeds(seen, run, encoders)
    for name in run.rig.of_kind(Accelerometer):
        of_sensor = [column for column in columns if column.sensor == name]
        if len(of_sensor) > 1:
            with seen.witness(name):
                time, values = _smooth(run, of_sensor, 1.0 / VIBRATION_RATE_HZ, bridged=True, averaged=True)
                at = np.arange(time[0], min(time[-1], time[0] + VIBRATION_S), 1.0 / VIBRATION_RATE_HZ)
                values = np.column_stack([np.interp(at, time, v) for v in (values - np.median(values, axis=0)).T])
                seen.vibrations[tuple(column.channel for column in of_sensor)] = values.astype(np.float32)
    with seen.witness("encoders"):
        if not encoders:
            raise AnalysisError("the rig has no encoder")
        try:
            unloaded = mechanism()
        except ModelError as error:
            seen.unread = str(error)
            raise
        seen.mechanism_kg = unloaded.total_mass
        if len(unloaded.payload_bodies) == 1:
            seen.conditions = with_one_payload(run.conditions, unloaded.payload_body)
        _by_model(seen, ModelledRun.of(run, unloaded))
    return seen


def observed_columns(run: SIRun) -> list[Column]:
    """The channels that are read: all where there are encoders, else those that are compared and the command."""
    columns = [column for column in run.rig.columns() if run.holds(column)]
    every = bool(run.rig.columns_of(Encoder))
    return [column for column in columns if every or _is_recorded(column) or column.commanded]


def _is_recorded(column: Column) -> bool:
    """Whether a channel is compared between runs: each of an accelerometer, the first of another sensor with noise."""
    if column.commanded or column.component == "trigger" or "angle" in column.dimensions:
        return False
    return column.dimensions[0] == "acceleration" or column.index == 0


def _record(run: SIRun, column: Column) -> ChannelRecord:
    values, rate = run.signal(column)
    count = len(values)
    if count < SPANS:
        raise AnalysisError(f"{run.name}: {column.channel}: {count} samples are too few to compare")
    length = min(SPAN_SAMPLES, max(count // SPANS, 4))
    starts = np.linspace(0, count - length, SPANS).astype(int)
    rough = np.diff(values[starts[:, None] + np.arange(length)], 3, axis=1)
    noise = float(np.interp(0.1 * (SPANS - 1), np.arange(SPANS), np.sort(rough.std(axis=1)))) / 20.0**0.5
    thin = values[:: max(count // THIN_SAMPLES, 1)]
    x, square = _line(len(thin))
    slope = float(np.sum(x * thin)) / square
    kept = np.asarray(values[: min(round(RECORD_S * rate), RECORD_SAMPLES)], dtype=np.float32)
    span = float(np.ptp(thin - slope * x))
    clipped = column.dimensions[0] == "acceleration" and run.saturation(column) is not None
    stuck = stuck_value(values, rate) if not rough.any(axis=1).all() else None
    return ChannelRecord(column, run.group_of(column), kept, rate, is_dead(values), stuck, clipped, noise, slope, span)


@lru_cache(maxsize=8)
def _line(count: int) -> tuple[Floats, float]:
    """From -1/2 to 1/2, (count,) [-], and the sum of its squares."""
    x = np.linspace(-0.5, 0.5, count)
    return x, max(float(np.sum(x * x)), 1e-300)


def _keep_speeds(seen: Observation, run: SIRun, columns: list[Column]) -> None:
    """Of the encoders, and of the stored motion if there is one."""
    group_of_encoders(run)
    time = run.instants(columns[0])
    grid = grid_of(time, f"{run.name}: encoders", bridged=True)
    if grid.rate < LEAST_RATE_HZ:
        raise AnalysisError(
            f"{run.name}: encoders at {grid.rate:.3g} samples per second: expected {LEAST_RATE_HZ:g} or more to show a "
            "motion; check the unit of the time"
        )
    time, position = bridge_gaps(time, run.stacked(columns), grid.step)
    smooth = low_pass(position, min(SPEED_BAND_HZ, HIGHEST_CUTOFF * grid.rate), grid.rate)
    at = np.arange(time[0], time[-1], 1.0 / SPEED_RATE_HZ)
    path = np.column_stack([np.interp(at, time, values) for values in smooth.T])
    speeds = np.gradient(path, 1.0 / SPEED_RATE_HZ, axis=0) if len(path) > 1 else np.zeros_like(path)
    seen.encoder_speeds = speeds.astype(np.float32)
    seen.encoders = tuple(column.channel for column in columns)
    if stored := run.recorded.inputs.get("motion"):
        motion = motion_from_texts(*stored)
        if peak := seen.conditions.get("peak_acceleration_rad_s2"):
            motion = motion.with_peak_acceleration(peak)
        wanted = motion.sample(STORED_RATE_HZ)
        at = np.arange(wanted.time[0], wanted.time[-1], 1.0 / SPEED_RATE_HZ)
        if wanted.joints and not (motion.recorded and motion.recorded.coarse):
            sizes = np.abs(wanted.acceleration)
            seen.wanted_peaks = (float(sizes.max()), float(np.linalg.norm(sizes, axis=1).max()))
        speeds = {j: np.interp(at, wanted.time, v) for j, v in zip(wanted.joints, wanted.velocity.T, strict=False)}
        seen.commanded_speeds = {c.channel: speeds[c.component] for c in columns if c.component in speeds}


def _by_model(seen: Observation, run: ModelledRun) -> None:
    """What the encoders show, and the readings of all sensors against the model along their motion."""
    grid, tree = run.grid, run.unloaded.tree
    columns = run.run.rig.columns_of(Encoder)
    joints = [run.unloaded.coordinate_index(column.component) for column in columns]
    errors = EncoderErrors(run, columns)
    if turning := [n for n, joint in enumerate(joints) if tree.joints[joint].revolute]:
        own, each = run.path.a[:, joints], np.eye(len(joints))
        single = max((errors.peak(own[:, [n]], each[n]) for n in turning), key=lambda peak: peak.value)
        seen.peak_joint_acceleration = (single, errors.peak(own[:, turning], each[turning].sum(axis=0)))
    seen.moves |= bool(np.ptp(run.path.q, axis=0).max() > MOVED)
    with seen.witness("place"):
        speed = np.gradient(run.place, grid.step, axis=0)
        rates = np.abs(run.path.v[run.valid][:, joints]).max(axis=0, initial=0.0)
        ratio = float(np.linalg.norm(speed[run.valid], axis=1).max(initial=0.0) / max(np.linalg.norm(rates), 1e-300))
        acceleration = np.gradient(speed, grid.step, axis=0)
        seen.peak_acceleration["encoders"] = errors.peak(acceleration, np.full(len(joints), ratio))
        legs = legs_of_path(grid.time, run.place, np.linalg.norm(speed, axis=1), REST_SHARE["encoders"])
        gaps = next(iter(encoder_gaps(run.run).spans.values()), NO_GAP)
        seen.motions["encoders"] = name_motions(legs, "encoders", run.group, gaps)
    base = None
    for group in dict.fromkeys(record.group for record in seen.records.values()):
        with seen.witness(f"model of {group}"):
            responses, moved = _responses(seen, run, group)
            seen.responses += responses
            base = base if moved is None else moved
    with seen.witness("torque"):
        seen.torque = _torque_equations(run, base)


def _responses(seen: Observation, run: ModelledRun, group: str) -> tuple[list[Response], Floats | None]:
    """Readings of all sensors of a group against expectations; and the acceleration of the base on the grid, (n, 3)
    [m/s2], where the group shows it.
    """
    found, base, own = [], None, group == run.group
    if not (expected := run.expected_readings(group)):
        return [], None
    smooth = [_smooth(run.run, columns, run.grid.step, own) for columns, _ in expected]
    lag = 0.0 if own else _lag(smooth, [p for _, p in expected], run.grid.step)
    for (columns, p), (time, values) in zip(expected, smooth, strict=True):
        at = run.grid.time if own else run.grid.time - run.grid.start + lag + time[0]
        inside = run.valid & (at >= time[0] + EDGE_S) & (at <= time[-1] - EDGE_S)
        if np.count_nonzero(inside) < 8 * BLOCKS:
            continue
        y = np.column_stack([np.interp(at, time, v) for v in values.T])
        if columns[0].sensor in run.run.rig.base_accelerometers and len(columns) == 3:
            base = np.where(inside[:, None], y - np.median(y, axis=0), 0.0)
        records = (seen.records.get(column.channel) for column in columns)
        noise = [r.noise * min(2.0 * BAND_HZ / r.rate_hz, 1.0) ** 0.5 if r else 0.0 for r in records]  # white, in band
        y, p = y[inside], p[inside]
        found.append(Response(tuple(columns), np.array(noise), y - y.mean(axis=0), p - p.mean(axis=0)))
    return found, base


def _torque_equations(run: ModelledRun, base: Floats | None) -> TorqueEquations:
    """Of the driven joints that have a torque sensor on the encoders' logger."""
    grid, driven = run.grid, run.unloaded.driven
    columns = {column.component: column for column in run.run.rig.columns_of(Torque)}
    by_mass = run.torque_columns(base)
    joints = tuple(j for j in driven if j in columns and run.run.group_of(columns[j]) == run.group)
    if not joints:
        raise AnalysisError("no torque sensor of a driven joint is on the encoders' logger")
    names = ("torque", *by_mass, *DRIVE_TERMS)
    parts = np.array_split(np.flatnonzero(run.valid), BLOCKS)
    products = np.zeros((BLOCKS, len(joints), len(names), len(names)))
    for j, joint in enumerate(joints):
        time, values = _smooth(run.run, [columns[joint]], grid.step, bridged=True)
        if not np.ptp(values) > 0.0:
            raise AnalysisError(f"{run.run.name}: {columns[joint].channel} shows one value only")
        k, i = run.unloaded.coordinate_index(joint), driven.index(joint)
        v, a = run.path.v[:, k], run.path.a[:, k]
        terms = (np.ones(grid.count), *run.smooth(np.column_stack([a, v, np.tanh(v / COULOMB_SPEED)])).T)
        modelled = run.smooth(np.column_stack([by_mass[name][:, i] for name in by_mass]))
        whole = np.column_stack([np.interp(grid.time, time, values[:, 0]), modelled, *terms])
        products[:, j] = [whole[part].T @ whole[part] for part in parts]
    return TorqueEquations(joints, names, products)


def _smooth(
    run: SIRun, columns: list[Column], step: float, bridged: bool = False, averaged: bool = False
) -> tuple[Floats, Floats]:
    """Instants (n,) [s] and readings (n, k) [SI] below BAND_HZ, on a grid of their clock near ``step`` [s]; first
    ``averaged`` to VIBRATION_SAMPLES a period.
    """
    values, time = run.stacked(columns), run.instants(columns[0])
    grid = grid_of(time, f"{run.name}: {columns[0].channel}", bridged)
    if bridged:
        time, values = bridge_gaps(time, values, grid.step)
    if grid.count < LEAST_SAMPLES:
        raise AnalysisError(f"{run.name}: {columns[0].channel}: {grid.count} samples are too few to compare")
    rate = grid.rate
    if averaged and (count := int(rate / ALMOST // (VIBRATION_SAMPLES * BAND_HZ))) > 1:
        time, values, rate = block_means(time, count), block_means(values.T, count).T, rate / count
    smooth = low_pass(values, min(BAND_HZ, HIGHEST_CUTOFF * rate), rate)
    every = max(int(step * rate / ALMOST), 1)
    return time[::every], smooth[::every]


def _lag(readings: list[tuple[Floats, Floats]], expected: list[Floats], step: float) -> float:
    """Time in the record at which the grid of the expectations starts, by correlation of either sign [s].

    Every channel of a sensor is compared with every expectation of it: exchanged channels and signs do not matter.
    """
    from scipy.signal import correlate

    count = max(int((time[-1] - time[0]) / step) for time, _ in readings)
    total: Floats | float = 0.0
    for (time, values), wanted in zip(readings, expected, strict=True):
        at = time[0] + step * np.arange(count)
        even = np.column_stack([np.interp(at, time, v) for v in values.T])
        even, wanted = even - np.median(even, axis=0), wanted - np.median(wanted, axis=0)
        scale = float(np.linalg.norm(even) * np.linalg.norm(wanted))
        if not scale > 0.0:
            continue
        pairs = ((y, p) for y in even.T for p in wanted.T)
        total = total + sum(correlate(y, p, method="fft") ** 2 for y, p in pairs) / scale**2
    if not isinstance(total, np.ndarray):
        return 0.0
    k = int(np.argmax(total))
    return (k - (len(expected[0]) - 1) + parabola_peak(total, k)[0]) * step
