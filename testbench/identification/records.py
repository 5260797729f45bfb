"""Positions, torques and forces of stored runs of one mechanism on even grids: what an identification starts from.

What is identified is the mechanism as mounted in the first run. What other runs mounted beyond it, payload and
counter-masses of their conditions, is known and taken off.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from balance.arrays import Floats
from balance.dynamics.regressor import FRICTION_LAWS, wrench_regressor
from balance.mechanism.mechanism import Mechanism
from balance.results import instant_text

from ..errors import AnalysisError
from ..kinematics.gaps import Gaps
from ..kinematics.smoothing_and_derivatives import Grid, Rates, bridge_gaps, grid_of, on_grid
from ..loads.base_motion_in_torque import moves_on_base, root_motion, share_of_unseen_base
from ..loads.shaking_wrench import MeasuredLoads, measured_loads
from ..recording import Finding, Origin
from ..rig import Column
from ..rig.sensors import Encoder, Torque
from ..runs.aligned_run import AlignedRun, trigger_notes

EDGE_S = 0.25
EDGE_SHARE = 0.05
"""Left out at both ends of a record, where low-passes start up: so long [s], of short records this share."""
LONGEST_DELAY_S = 0.02
"""Of torques after or before positions: a few turns of a control loop [s]."""
CUTOFF_HZ = 40.0
"""Of the motion that gives the direction in which forces do not show the base's rotation [Hz]."""
BASE_STILL = "The base is taken for still: the rig says fixed, or has no accelerometer on it."
BASE_MOVES = (
    "The base's motion is taken out of the forces with the mass that MECH has as mounted; moments are left out."
)
ROOT_MOVES = "The base's motion, by its accelerometers, is in the model of the torques."
UNSEEN = 1e-3
"""Share of a drive's torque that a base which the rig states may make by motion that no accelerometer shows."""
BASE_UNSEEN = (
    "{}: the base that the rig's [bench] states makes up to {:.2g} of a drive's torque by motion that no accelerometer "
    "shows; these torques are taken for those on a base at rest, and no interval contains that; record the motion "
    '(in the rig accelerometers attached_to = "base", two where it turns), or state that it does not move ([bench] '
    "fixed = true)"
)
BASE_UNKNOWN = (
    "{}: the rig's [bench] states a base that moves, and no accelerometer on it: the forces hold the mechanism's "
    "inertia against that motion, which is taken for shaking force, and no interval contains that; record it (in the "
    'rig an accelerometer attached_to = "base"), or state that it does not move ([bench] fixed = true)'
)
By = Literal["torque", "wrench", "both"]
UNSEEN_CODE = "base_unseen"
DIFFERS = "mechanism_differs"
"""The finding that a person may accept: the rig is of another mechanism."""


class Law(NamedTuple):
    """Friction of a driven joint by one of the ``FRICTION_LAWS`` that fades over ``size`` [rad/s, rad, m/s, m].

    Or its derivative by the logarithm of the size: with both among the parameters all intervals hold for any size.
    """

    joint: str
    kind: str
    size: float
    by_size: bool = False

    @property
    def name(self) -> str:
        """Of its parameter."""
        fades = f", {self.size:g}" if self.has_size else ""
        return f"{self.kind}{'_slope' * self.by_size}[{self.joint}{fades}]"

    @property
    def has_size(self) -> bool:
        """Whether it fades over a size."""
        return bool(FRICTION_LAWS[self.kind])

    @property
    def terms(self) -> tuple["Law", ...]:
        """Itself and, where it fades over a size, its derivative."""
        return (self, self._replace(by_size=True)) if self.has_size else (self,)


@dataclass(frozen=True)
class JointRecord:
    """What a run recorded of the driven joints."""

    name: str
    origin: Origin
    grid: Grid
    q: Floats
    """Positions as recorded, carried over to the grid, (n, joints) [rad, m]."""
    torque: Floats
    """Torques likewise, (n, joints) [N m, N]; (n, 0) where forces alone count."""
    loads: MeasuredLoads | None = None
    """What force sensors measured, if they count."""
    mounted: Floats = field(default_factory=lambda: np.zeros(0))
    """Inertial parameters that this run is known to have beyond the mechanism's, (10 nb,), or none, (0,)."""
    gaps: Gaps = field(default_factory=Gaps)
    """Where records that count hold no samples, on the grid's clock."""
    sensors: tuple[str, ...] = ()
    """Of the torques, by name in the rig, in the order of the joints."""
    laws: tuple[Law, ...] = ()
    """Of friction beyond Coulomb + viscous, which it is taken to have."""
    root: Floats | None = None
    """Motion of the base, as ``torque_regressor`` has it, (n, 9) [rad/s, m/s2, rad/s2]; None: it is taken for still."""
    of_root: Floats | None = None
    """Inertial parameters that this motion acts on, per bodies' and joints' parameters, (10 nb, p); None: nothing."""

    @property
    def measured(self) -> Floats:
        """All rows: torques, then forces, (n, rows) [N m, N]."""
        return self.torque if self.loads is None else np.hstack([self.torque, self.loads.values])

    @property
    def edge(self) -> int:
        """Samples left out at both ends, where low-passes start up and delays reach beyond the record."""
        seconds = min(EDGE_S, EDGE_SHARE * self.grid.count * self.grid.step)
        return round(max(seconds, LONGEST_DELAY_S) / self.grid.step)

    def rates(self, cutoff: float) -> Rates:
        """Positions smoothed below a cut-off [Hz] and differentiated, between gaps; in gaps straight lines."""
        return self.gaps.derivatives(self.q, cutoff, self.grid)

    def valid(self, reach: float) -> Floats:
        """One where no gap touches positions, or torques that come late or early, else zero, (n, 1)."""
        return self.gaps.valid_samples(self.grid, reach + LONGEST_DELAY_S)[:, None].astype(float)

    def left_out(self, reach: float) -> list[str]:
        """What gaps take of the record."""
        return [f"{self.name}: {text}" for text in self.gaps.texts(reach + LONGEST_DELAY_S)]

    def rows(self, mechanism: Mechanism) -> tuple[str, ...]:
        """Names of the rows: driven joints, then components of force and moment."""
        joints = mechanism.driven if self.torque.shape[1] else ()
        return (*joints, *(() if self.loads is None else self.loads.names))


@dataclass(frozen=True)
class Assembled:
    """What an identification starts from."""

    mechanism: Mechanism
    """As mounted in the first run."""
    records: tuple[JointRecord, ...]
    by: By
    notes: tuple[str, ...] = ()
    """What was left out, and why."""
    findings: tuple[Finding, ...] = ()
    """What of the base is not known."""


def assemble(runs: Sequence[AlignedRun], by: By | None = None, accept: Sequence[str] = ()) -> Assembled:
    """Records of runs of a mechanism, as it was mounted in the first of them.

    ``by`` torque where the drives' torques are measured, else by wrench, unless named. Raises AnalysisError where a rig
    is of another mechanism, unless that is accepted, and where sensors lack.
    """
    for run in runs:
        if DIFFERS not in accept and Path(run.rig.mechanism).stem != run.unloaded.name:
            raise AnalysisError(
                f"{run.name}: mechanism: its rig is of {run.rig.mechanism!r}, expected {run.unloaded.name!r}: give the "
                f"mechanism that was on the bench, or --accept {DIFFERS} if it is the same machine by another name"
            )
    chosen = by or ("torque" if runs[0].rig.of_kind(Torque) else "wrench")
    records: list[JointRecord] = []
    notes: dict[str, None] = {}
    findings: list[Finding] = []
    for run in runs:
        record = joint_record(run, torque=chosen != "wrench")
        if chosen != "wrench":
            if (root := root_motion(run)) is not None and run.base is not None:
                record = replace(record, root=root, gaps=run.gaps({run.base.group}))
                notes[ROOT_MOVES] = None
            if (share := share_of_unseen_base(run, CUTOFF_HZ)) > UNSEEN:
                findings.append(Finding(UNSEEN_CODE, None, run.name, BASE_UNSEEN.format(run.name, share)))
        elif run.base is None and run.rig.bench.is_stated and moves_on_base(run):
            findings.append(Finding(UNSEEN_CODE, None, run.name, BASE_UNKNOWN.format(run.name)))
        if chosen != "torque":
            path = run.trajectory(CUTOFF_HZ)
            loads, missing = measured_loads(run, wrench_regressor(run.mechanism, path.q, path.v, path.a), CUTOFF_HZ)
            record = replace(record, loads=loads, gaps=run.gaps(loads.groups))
            notes |= dict.fromkeys((*missing, BASE_STILL if run.base is None else BASE_MOVES))
        beyond = run.mechanism.pi - runs[0].mechanism.pi
        records.append(replace(record, mounted=beyond) if np.any(beyond) else record)
    if len({() if record.loads is None else record.loads.names for record in records}) > 1:
        listed = "; ".join(f"{r.name}: {', '.join(r.loads.names)}" for r in records if r.loads is not None)
        raise AnalysisError(f"runs whose force sensors determine different components: {listed}: identify them apart")
    return Assembled(runs[0].mechanism, tuple(records), chosen, (*notes, *trigger_notes(runs)), tuple(findings))


def joint_record(run: AlignedRun, *, torque: bool = True) -> JointRecord:
    """Positions and, unless asked not to, torques of the driven joints from a run.

    Raises AnalysisError if a driven joint has no encoder or torque, or they are on several clocks.
    """
    channels = _channels(run, Encoder) + (_channels(run, Torque) if torque else [])
    groups = run.run.groups_of(channels)
    if len(groups) > 1:
        raise AnalysisError(
            f"{run.name}: positions and torques are in several groups, {', '.join(groups)}: "
            "expected one clock for all of them"
        )
    time = run.run.time(groups[0])
    values = np.stack([run.run.readings(column) for column in channels], axis=1)
    lost = ~np.isfinite(values)
    if lost.any():
        sample, column = (int(i) for i in np.argwhere(lost)[0])
        raise AnalysisError(
            f"{run.name}: channel {channels[column].channel!r} holds {int(lost[:, column].sum())} samples that are no "
            f"numbers, the first at {instant_text(time[sample])} s: expected none; cut the log there"
        )
    grid, gaps = grid_of(time, run.name, bridged=True), Gaps.of({groups[0]: time})
    even = on_grid(*bridge_gaps(time, values, grid.step), grid) if gaps else on_grid(time, values, grid)
    joints = len(run.unloaded.driven)
    sensors = tuple(column.sensor for column in channels[joints:])
    return JointRecord(run.name, run.run.origin, grid, even[:, :joints], even[:, joints:], gaps=gaps, sensors=sensors)


def _channels(run: AlignedRun, kind: type[Encoder] | type[Torque]) -> list[Column]:
    """The channel of the one sensor of a kind on each driven joint."""
    columns = run.rig.columns_of(kind)
    for joint in run.unloaded.driven:
        if (count := sum(column.component == joint for column in columns)) != 1:
            known = ", ".join(column.component for column in columns) or "none"
            raise AnalysisError(
                f"{run.name}: its rig has {count} sensors of kind {kind.__name__.lower()!r} on joint {joint!r}, "
                f"expected one; it has them on: {known}"
            )
    by_joint = {column.component: column for column in columns}
    return [by_joint[joint] for joint in run.unloaded.driven]
