"""Shaking force and moment at a point, from the force sensors that the mechanism stands on.

F = sum F_i, M = sum M_i + (p_i - P) x F_i over all supports. A component is determined where each of its terms is
measured, or the rig states that a support does not carry it; otherwise it is None, with the reason. A channel that
shows one value all the time measures nothing. Where a sensor is at the limit of its range, what depends on it is NaN.

On the grid of the encoders the base's motion is taken out where accelerometers measure it: P F + m P a = P W pi, with F
the measured loads, a the readings of the base's accelerometers, W the regressor of the shaking wrench, and P the
projection behind which the base's motion does not appear (``kinematics.base_motion``). Without accelerometers the base
is taken to be at rest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..kinematics.encoder_motion import moving_interval
from ..kinematics.gaps import true_segments
from ..recording import Finding
from ..rig import Column
from ..rig.sensors import Support, wrench_transport
from ..runs.aligned_run import AlignedRun
from ..runs.si_run import INTERPOLATED, SIRun

COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
NOTHING = 1e-9
"""Share of the largest component in which a mechanism that does not shake so seems to."""
LEAST_REST_S = 0.02
"""Shortest rest before or after the motion from which a preload is determined [s]."""


@dataclass(frozen=True)
class MeasuredWrench:
    """Force and moment of the mechanism on the base, base axes, moments about ``point``."""

    group: str
    """The group on whose clock ``time`` is."""
    time: Floats
    """(n,) [s]"""
    rate: float
    """[Hz]"""
    point: tuple[float, float, float]
    """In the base frame [m]."""
    values: Mapping[str, Floats | None]
    """By component, (n,) [N, N m]; None where the set of sensors does not determine it."""
    reasons: Mapping[str, str]
    """Why a component is None."""
    findings: tuple[Finding, ...]
    """Sensors at the limit of their range, dead ones, and what is interpolated."""
    tare: str = ""
    """What was taken off as preload and drift."""
    clipped: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    """By component, start and end [s] of where a sensor that it depends on was at the limit of its range: NaN there."""

    def determined(self, components: Sequence[str]) -> list[str]:
        """Those of the components that are determined."""
        return [c for c in components if self.values[c] is not None]


def shaking_wrench(
    run: SIRun,
    point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    preload: bool = False,
    bridged: bool = False,
) -> MeasuredWrench:
    """The wrench of a run about a point of the base frame [m]; with ``preload`` readings at rest are not taken off.

    It has even steps: few samples that the clock left out are interpolated, with a finding; with ``bridged`` any
    number, for who masks gaps (:meth:`SIRun.evenly`). Raises AnalysisError if the clock left out more, the rig has no
    force sensors, or they are on several loggers.
    """
    supports = run.rig.supports
    if not supports:
        raise AnalysisError(
            f"{run.name}: its rig has no force sensors, so that no shaking force is measured: "
            "describe them in the rig (kind wrench or force)"
        )
    columns = {name: list(support.columns(name)) for name, support in supports.items()}
    group = _group(run, [column for some in columns.values() for column in some])
    first = next(iter(columns.values()))[0]
    time, rate = run.even_instants(first), run.rate(first)
    loads, findings, full, dead = {}, run.interpolated(c for some in columns.values() for c in some), {}, {}
    for name, support in supports.items():
        readings = np.array([run.evenly(column, run.values(column), bridged) for column in columns[name]]).T
        has_matrix = run.has_matrix(columns[name][0])
        mixed = support.crosstalk is not None or has_matrix
        dead[name] = _dead(run, support, columns[name], mixed)
        findings += [_of_dead(run, channel, readings) for channel in dict.fromkeys(dead[name].values())]
        findings += [f for column in columns[name] if (f := run.saturation(column)) is not None]
        full[name] = (
            np.column_stack([run.evenly(c, run.clipped(c).astype(float), bridged) for c in columns[name]]) > 0.0
        )
        if mixed:
            full[name][:] = full[name].any(axis=1, keepdims=True)
        loads[name] = readings if has_matrix else _uncrossed(support, readings)
    tare = "nothing is taken off: what the sensors show at rest is in it"
    if not preload:
        still = _at_rest(np.vstack([readings.T for readings in loads.values()]), rate)
        loads, tare = {name: without_preload(values, still) for name, values in loads.items()}, _tare(still, rate)
    loads = {n: np.where(full[n], np.nan, values) if full[n].any() else values for n, values in loads.items()}
    values, reasons = _total(supports, loads, np.array(point), dead)
    clipped = {
        name: tuple((float(time[part.start]), float(time[part.stop - 1])) for part in parts)
        for name, v in values.items()
        if v is not None and (parts := true_segments(np.isnan(v)))
    }
    return MeasuredWrench(group, time, rate, point, values, reasons, tuple(findings), tare, clipped)


def refuse_clipped_base(run: SIRun) -> None:
    """Raise AnalysisError where an accelerometer on the base is at the end of its range."""
    for column in run.rig.base_columns:
        if column.range is not None and run.holds(column) and (full := run.at_range(column)).any():
            raise AnalysisError(
                f"{run.name}: {column.channel}: {int(full.sum())} samples at the end of its range; use gentler runs"
            )


def without_preload(values: Floats, rest: "tuple[slice, slice]") -> Floats:
    """Values (n, k) [N, N m] less the line through their means at rest before and after the motion.

    The line is preload, and drift of a piezoelectric sensor. Where only one rest is long enough, less its mean.
    """
    ends = [(0.5 * (part.start + part.stop - 1), values[part].mean(axis=0)) for part in rest if part.stop > part.start]
    if not ends:
        return values - np.median(values, axis=0)
    if len(ends) == 1:
        return values - ends[0][1]
    (a, before), (b, after) = ends
    line = np.multiply.outer((after - before) / (b - a), np.arange(len(values)) - a)
    line += before[:, None]
    return np.subtract(values.T, line, out=line).T


def _tare(rest: "tuple[slice, slice]", rate: float) -> str:
    """What :func:`without_preload` does with these rests."""
    before, after = ((part.stop - part.start) / rate for part in rest)
    if before and after:
        return (
            f"less the line through the means at rest, {before:.3f} s before and {after:.3f} s after: preload and drift"
        )
    if before or after:
        return (
            f"less the mean at rest, {before or after:.3f} s {'before' if before else 'after'}: preload; drift is in it"
        )
    return "less the median of the record, which holds no rest: preload is a guess, drift is in it"


def _group(run: SIRun, columns: list[Column]) -> str:
    groups = run.groups_of(columns)
    if len(groups) > 1:
        raise AnalysisError(
            f"{run.name}: its force sensors are on several loggers, {', '.join(groups)}: expected one clock"
        )
    return groups[0]


def _dead(run: SIRun, support: Support, columns: list[Column], mixed: bool) -> dict[str, str]:
    """The channel that shows one value only, by each component that depends on it: all of a ``mixed`` sensor."""
    dead = {m: c.channel for m, c in zip(support.measured, columns, strict=True) if run.is_dead(c)}
    return dict.fromkeys(support.measured, next(iter(dead.values()))) if dead and mixed else dead


def _of_dead(run: SIRun, channel: str, readings: Floats) -> Finding:
    message = f"all {len(readings)} samples are one value: dead, stuck or unplugged"
    return Finding("constant_channel", channel, run.name, f"{run.name}: {channel}: {message}")


def _uncrossed(support: Support, readings: Floats) -> Floats:
    """Loads (n, k) from readings: readings = crosstalk @ loads."""
    if support.crosstalk is None:
        return readings
    return np.asarray(np.linalg.solve(np.array(support.crosstalk), readings.T).T)


def _at_rest(channels: Floats, rate: float) -> "tuple[slice, slice]":
    """Samples before the first and after the last movement of channels (k, n) that rest at both ends; else empty.

    A channel that drifts seems to move all the time: the others show when it rests.
    """
    count, least = channels.shape[1], int(np.ceil(LEAST_REST_S * rate))
    spans = [s for s in (moving_interval(v, rate) for v in channels) if s.start >= least and count - s.stop >= least]
    if not spans:
        return slice(0, 0), slice(count, count)
    return slice(0, min(s.start for s in spans)), slice(max(s.stop for s in spans), count)


def _total(
    supports: Mapping[str, Support], loads: Mapping[str, Floats], point: Floats, dead: Mapping[str, dict[str, str]]
) -> tuple[dict[str, Floats | None], dict[str, str]]:
    """The sum over the supports, component by component."""
    count = len(next(iter(loads.values())))
    values: dict[str, Floats | None] = {}
    reasons: dict[str, str] = {}
    for i, component in enumerate(COMPONENTS):
        total = np.zeros(count)
        for name, support in supports.items():
            levers = wrench_transport(np.array(support.position) - point)
            for j, other in enumerate(COMPONENTS):
                lever = levers[i, j]
                if lever == 0.0 or not support.carries(other):
                    continue
                if other not in support.measured:
                    reasons.setdefault(
                        component,
                        f"{name} does not measure {other}, and the rig does not say that it carries none (unloaded)",
                    )
                    continue
                if channel := dead[name].get(other):
                    reasons.setdefault(component, f"{name}: {channel} shows one value only: dead, stuck or unplugged")
                    continue
                total = total + lever * loads[name][:, support.measured.index(other)]
        values[component] = None if component in reasons else total
    return values, reasons


@dataclass(frozen=True)
class MeasuredLoads:
    """Readings of the force sensors with the base's motion taken out."""

    names: tuple[str, ...]
    """Components: Fx ... Mz."""
    forces: Floats
    """As measured, (n, k) [N, N m]."""
    groups: frozenset[str]
    """Groups of the channels that are used."""
    inertial: Floats | None = None
    """Mass times the readings of the base's accelerometers, (n, channels) [N]; None: the base is at rest."""
    projection: Floats | None = None
    """Columns of P for the forces, (n, k, k)."""
    base_projection: Floats | None = None
    """Columns of P for the accelerometers, (n, k, channels)."""
    rates: base_motion.BaseRates | None = None
    """How fast the base turns; None: it is at rest."""

    @property
    def values(self) -> Floats:
        """P F + m P a, (n, k) [N, N m]."""
        found = self.projected(self.forces)
        return found if self.inertial is None else found + self.base_projected(self.inertial)

    def projected(self, rows: Floats) -> Floats:
        """P @ rows, (n, k) or (n, k, p) [N, N m, or per parameter]."""
        if self.projection is None:
            return rows
        return np.asarray(np.einsum("nij,nj...->ni...", self.projection, rows))

    def base_projected(self, readings: Floats) -> Floats:
        """P @ readings (n, channels) of the base's accelerometers times mass [N], (n, k) [N, N m]."""
        if self.base_projection is None:
            return np.zeros_like(self.forces)
        return np.asarray(np.einsum("nij,nj->ni", self.base_projection, readings))

    def projected_regressor(self, wrench: Floats) -> Floats:
        """Rows of these loads in P W of a regressor W (n, 3 or 6, p) [N, N m per parameter], (n, k, p)."""
        return self.projected(wrench[:, [COMPONENTS.index(name) for name in self.names]])


def measured_loads(run: AlignedRun, regressor: Floats, bandwidth_hz: float) -> tuple[MeasuredLoads, tuple[str, ...]]:
    """What force sensors measure of the components in which a run shakes, on its grid; and why others are left out.

    ``regressor`` (n, 3 or 6, p) [N, N m per parameter] says which components shake; where the base moves, of forces
    alone. P follows from positions smoothed below ``bandwidth_hz``. Raises AnalysisError where none is determined, a
    sensor is at the end of its range or carries the base as well, or clocks cannot be aligned.
    """
    if below := run.rig.under_base:
        raise AnalysisError(f"{run.name}: {below}")
    wrench = shaking_wrench(run.run, bridged=True)
    for finding in wrench.findings:
        if finding.code not in {"constant_channel", *INTERPOLATED}:
            raise AnalysisError(f"{finding.message}: a clipped force determines nothing here; use gentler runs")
    refuse_clipped_base(run.run)
    size = np.abs(regressor).max(axis=(0, 2))
    possible = COMPONENTS[: len(size) if run.base is None else 3]
    shaking = [name for name, one in zip(possible, size, strict=False) if one > NOTHING * size.max()]
    names = wrench.determined(shaking)
    if not names:
        reasons = "; ".join(f"{name}: {wrench.reasons[name]}" for name in shaking) or "the encoders stand still"
        raise AnalysisError(
            f"{run.name}: the force sensors determine no component in which this mechanism shakes: {reasons}"
        )
    left_out = tuple(f"{name} left out: {wrench.reasons[name]}" for name in shaking if name not in names)
    return _on_grid(run, wrench, names, bandwidth_hz), left_out


def _on_grid(run: AlignedRun, wrench: MeasuredWrench, names: Sequence[str], bandwidth_hz: float) -> MeasuredLoads:
    base = run.base
    groups = frozenset({wrench.group} | ({base.group} if base else set()))
    measured = np.column_stack([v for name in names if (v := wrench.values[name]) is not None])
    forces = run.on_grid(wrench.group, wrench.time, measured)
    if base is None:
        return MeasuredLoads(tuple(names), forces, groups)
    axes = [COMPONENTS.index(name) for name in names]
    rows = base_motion.force_rows(run.mechanism, run.trajectory(bandwidth_hz))[:, axes]
    share = base_motion.projector(rows, base.rows)
    mass, readings = run.mechanism.total_mass, run.on_grid(base.group, base.time, base.values)
    rates = base_motion.BaseRates.of(rows, mass, forces, base.rows, readings, run.grid.step)
    own, others = share[:, :, : len(axes)], share[:, :, len(axes) :]
    return MeasuredLoads(tuple(names), forces, groups, mass * readings, own, others, rates)
