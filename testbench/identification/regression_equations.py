"""The matrix W of a record, for any motion of its driven joints: what each parameter brings to each row.

The equations that records give at one cut-off: W pi = tau, as recorded, and low-passed alike on both sides.

A low-pass is linear: run over the columns of W and over tau alike it changes nothing in W pi = tau, whatever its
cut-off. What does distort W is the smoothing of the positions that W is made of, so these keep twice the bandwidth of
the comparison; on simulated records with known parameters that leaves a bias below 1 % (see the tests).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats, Indices
from balance.closure import Closure, Trajectory
from balance.dynamics.regressor import JOINT_TERMS, driven_torque_regressor, joint_friction_regressor, wrench_regressor
from balance.estimation.regression import equal_blocks
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples

from ..errors import AnalysisError
from ..kinematics.gaps import gap_reach
from ..kinematics.smoothing_and_derivatives import Rates
from .records import JointRecord


def names_of(mechanism: Mechanism, rows: Sequence[str]) -> tuple[str, ...]:
    """Parameters that rows can tell of: inertial ones of the bodies, terms of the joints, offsets of forces."""
    terms = [f"{term}[{joint}]" for joint in mechanism.driven if joint in rows for term in JOINT_TERMS]
    return (*mechanism.parameter_names, *terms, *(f"offset[{row}]" for row in rows if row not in mechanism.driven))


def path_of(record: JointRecord, mechanism: Mechanism, motion: Rates, near: Trajectory | None = None) -> Trajectory:
    """The mechanism closed along any motion of the record's driven joints; quicker from a path ``near`` by."""
    samples = Samples(record.grid.time, motion.q, motion.v, motion.a, joints=mechanism.driven)
    return Closure(mechanism).follow(samples, near=near)


def regressor(record: JointRecord, mechanism: Mechanism, motion: Rates, path: Trajectory) -> Floats:
    """W of a record's rows for any motion of its driven joints, (samples, rows, p): columns as ``names_of`` says."""
    bodies: list[Floats] = []
    own: list[Floats] = []
    if record.torque.shape[1]:
        bodies.append(driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive))
        own.append(joint_friction_regressor(mechanism.driven, motion.v, motion.a)[0])
    if record.loads is not None:
        bodies.append(record.loads.projected_regressor(wrench_regressor(mechanism, path.q, path.v, path.a)))
        own.append(np.broadcast_to(np.eye(len(record.loads.names)), (len(path.q), *[len(record.loads.names)] * 2)))
    return np.concatenate([np.concatenate(bodies, axis=1), _diagonal(own)], axis=2)


def model_torque(mechanism: Mechanism, motion: Rates, path: Trajectory, parameters: Floats) -> Floats:
    """Torques of the driven joints by parameters in the order of ``names_of``, (samples, joints) [N m, N]."""
    count = len(mechanism.parameter_names)
    bodies = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive) @ parameters[:count]
    terms = joint_friction_regressor(mechanism.driven, motion.v, motion.a)[0]
    return np.asarray(bodies + terms @ parameters[count : count + terms.shape[2]])


def _diagonal(blocks: Sequence[Floats]) -> Floats:
    """Blocks (n, rows, columns) side by side, each for its own rows alone."""
    rows, columns = (sum(block.shape[axis] for block in blocks) for axis in (1, 2))
    whole = np.zeros((len(blocks[0]), rows, columns))
    row = column = 0
    for block in blocks:
        whole[:, row : row + block.shape[1], column : column + block.shape[2]] = block
        row, column = row + block.shape[1], column + block.shape[2]
    return whole


POSITION_BANDWIDTH = 2.0
"""Cut-off for the positions, in cut-offs of the comparison."""
REST_SPEED = 0.1
"""A joint slower than this is at rest, where dry friction may hold any torque: it says nothing [rad/s, m/s]."""


@dataclass(frozen=True)
class RecordEquations:
    """The equations of one record at one cut-off."""

    record: JointRecord
    cutoff: float
    """Of the comparison [Hz]."""
    names: tuple[str, ...]
    """Of the parameters: inertial ones of the bodies, then terms of the joints, (p)."""
    motion: Rates
    """Of the driven joints, positions smoothed, over the whole record."""
    path: Trajectory
    """Of all joints along it."""
    whole: Floats
    """W of the whole record, positions smoothed, (samples, rows, p)."""
    moving: Floats
    """One where a joint moves, zero where it rests or a gap touches, (samples, rows)."""

    def late(self, values: Floats, delay: float) -> Floats:
        """Rows (samples, rows) of the whole record, those of torques as they stand ``delay`` [s] later."""
        joints = self.record.torque.shape[1]
        shift = round(delay / self.record.grid.step)
        place = np.clip(np.arange(len(values)) + shift, 0, len(values) - 1)
        return np.concatenate([values[place, :joints], values[:, joints:]], axis=1)

    @cached_property
    def known(self) -> Floats:
        """What masses that are known to be mounted in this run alone take of each row, (samples, rows) [N m, N]."""
        return np.asarray(self.whole[:, :, : len(self.record.mounted)] @ self.record.mounted)

    def measured(self, delay: float) -> Floats:
        """What was measured of the whole record less what is known, (samples, rows) [N m, N]."""
        return self.late(self.record.measured, delay) - self.known

    def low_passed_measured(self, delay: float) -> Floats:
        """The same, low-passed at the cut-off, (samples, rows) [N m, N]."""
        return self.late(self._smooth, delay) - self.low_passed(self.known)

    @cached_property
    def _smooth(self) -> Floats:
        return self.low_passed(self.record.measured)

    def low_passed_columns(self, pivots: Sequence[int]) -> Floats:
        """Columns of the whole record's W, low-passed at the cut-off, (samples, rows, pivots)."""
        return self.low_passed(self.whole[:, :, list(pivots)])

    def low_passed(self, values: Floats) -> Floats:
        """``values`` of the whole record, low-passed at the cut-off between gaps."""
        return self.record.low_pass(values, self.cutoff, self.reach)

    @property
    def reach(self) -> float:
        """How far a gap disturbs the positions [s]."""
        return gap_reach(POSITION_BANDWIDTH * self.cutoff)

    @cached_property
    def sound(self) -> Floats:
        """One where no gap touches, else zero, (samples, 1)."""
        return self.record.sound(self.reach)

    def inside(self, values: Floats) -> Floats:
        """``values`` of the whole record without its ends."""
        edge = self.record.edge
        return values[edge : len(values) - edge]


@dataclass(frozen=True)
class RegressionEquations:
    """The equations of all records at one cut-off, one record after the other."""

    parts: tuple[RecordEquations, ...]

    @property
    def cutoff(self) -> float:
        """Of the comparison [Hz]."""
        return self.parts[0].cutoff

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, (p)."""
        return self.parts[0].names

    @cached_property
    def time(self) -> Floats:
        """Instants of the equations on their record's clock, (n,) [s]."""
        return self._joined(lambda part: part.inside(part.record.grid.time))

    @cached_property
    def columns(self) -> Floats:
        """W of smoothed positions, (n, rows, p)."""
        return self._joined(lambda part: part.inside(part.whole))

    @cached_property
    def moving(self) -> Floats:
        """One where a joint moves, zero where it rests, (n, rows)."""
        return self._joined(lambda part: part.inside(part.moving))

    @cached_property
    def sound(self) -> Floats:
        """One where no gap touches, else zero, (n, 1)."""
        return self._joined(lambda part: part.inside(part.sound))

    def low_passed_columns(self, pivots: Sequence[int]) -> Floats:
        """Columns of W low-passed at the cut-off, (n, rows, pivots)."""
        return self._joined(lambda part: part.inside(part.low_passed_columns(pivots)))

    def torque(self, delay: float) -> Floats:
        """Rows as recorded, torques ``delay`` [s] after the motion, less what is known, (n, rows) [N m, N]."""
        return self._joined(lambda part: part.inside(part.measured(delay)))

    def low_passed_torque(self, delay: float) -> Floats:
        """The same, low-passed at the cut-off, (n, rows) [N m, N]."""
        return self._joined(lambda part: part.inside(part.low_passed_measured(delay)))

    def blocks(self, seconds: float) -> Indices:
        """Numbers of blocks with equal motion, at least so long, none over two records, (n,)."""
        numbers = np.zeros(0, dtype=np.intp)
        for part in self.parts:
            moves = part.inside(part.moving).any(axis=1).astype(float)
            own = equal_blocks(moves, seconds / part.record.grid.step)
            numbers = np.r_[numbers, own + numbers.max(initial=-1) + 1]
        return numbers

    @property
    def left_out(self) -> list[str]:
        """What gaps take of the records."""
        return [text for part in self.parts for text in part.record.left_out(part.reach)]

    def _joined(self, of: Callable[[RecordEquations], Floats]) -> Floats:
        return np.concatenate([of(part) for part in self.parts])


def regression_equations(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> RegressionEquations:
    """The equations that records of a mechanism give at a cut-off [Hz].

    Raises ClosureError where its loops cannot be closed at the recorded positions, AnalysisError if a joint rests.
    """
    evidence = RegressionEquations(tuple(_part(record, mechanism, cutoff) for record in records))
    for joint, moving in zip(mechanism.driven, evidence.moving.T, strict=False):
        if not moving.any():
            raise AnalysisError(
                f"{', '.join(r.name for r in records)}: joint {joint!r} never moves faster than {REST_SPEED} rad/s: "
                "expected a record in which every driven joint moves" + _but(evidence)
            )
    return evidence


def _but(evidence: RegressionEquations) -> str:
    lost = evidence.left_out
    return f"; {'; '.join(lost)}" if lost else ""


def one_sided(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> RegressionEquations:
    """The equations as they are often set up, with a bias: torque and rates low-passed, positions as recorded.

    The weight then moves with the whole motion and the torque with what the low-pass leaves of it. For comparison.
    """
    parts = []
    for record in records:
        smooth = record.rates(cutoff)
        parts.append(_part_of(record, mechanism, cutoff, Rates(record.q, smooth.v, smooth.a)))
    return RegressionEquations(tuple(parts))


def _part(record: JointRecord, mechanism: Mechanism, cutoff: float) -> RecordEquations:
    return _part_of(record, mechanism, cutoff, record.rates(POSITION_BANDWIDTH * cutoff))


def _part_of(record: JointRecord, mechanism: Mechanism, cutoff: float, smooth: Rates) -> RecordEquations:
    path = path_of(record, mechanism, smooth)
    whole = regressor(record, mechanism, smooth, path)
    moving = _moving(smooth.v, record.grid.rate / cutoff)
    forces = len(record.rows(mechanism)) - record.torque.shape[1]
    any_moves = np.repeat(moving.max(axis=1, keepdims=True), forces, axis=1)
    used = np.concatenate([moving[:, : record.torque.shape[1]], any_moves], axis=1)
    used = used * record.sound(gap_reach(POSITION_BANDWIDTH * cutoff))
    return RecordEquations(record, cutoff, names_of(mechanism, record.rows(mechanism)), smooth, path, whole, used)


def _moving(v: Floats, reach: float) -> Floats:
    """Zero where a joint rests as long as the low-pass looks around, ``reach`` samples."""
    from scipy.ndimage import maximum_filter1d

    return (maximum_filter1d(np.abs(v), 2 * int(reach / 2) + 1, axis=0) > REST_SPEED).astype(float)
