"""The equations that records give at one cut-off, W pi = tau: as recorded, and low-passed on both sides.

A low-pass is linear: run over the columns of W and over tau it changes nothing in W pi = tau, whatever its cut-off.
What does distort W is the smoothing of the positions that W is made of, so these keep twice the bandwidth of the
comparison; on simulated records with known parameters that leaves a bias below 1 % (see the tests).

Zeros of torque and force sensors move from run to run: every row has an offset of each run, all else is shared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from balance.arrays import Floats, Indices
from balance.closure import Closure, Trajectory
from balance.dynamics.regressor import (
    JOINT_TERMS,
    driven_torque_regressor,
    friction_law,
    joint_friction_regressor,
    wrench_regressor,
)
from balance.estimation.identifiability import Identifiability, identifiability
from balance.estimation.regression import RegressionFit, RegressionRecord, equal_blocks, fit
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples

from ..errors import AnalysisError
from ..kinematics.gaps import gap_reach
from ..kinematics.smoothing_and_derivatives import ALMOST, DRY_PART, Rates, low_pass, rest_speeds
from .records import JointRecord, Law

POSITION_BANDWIDTH = 2.0
"""Cut-off for the positions, in cut-offs of the comparison."""
_LEAST_SHARE = 1e-6
"""Of a parameter that is zero in the file, in the largest [-]."""
NEARBY = 1e-5
"""Of differences [rad, m, and their rates]."""


def path_of(record: JointRecord, mechanism: Mechanism, motion: Rates, near: Trajectory | None = None) -> Trajectory:
    """The mechanism closed along any motion of the record's driven joints; quicker from a path ``near`` by."""
    samples = Samples(record.grid.time, motion.q, motion.v, motion.a, joints=mechanism.driven)
    return Closure(mechanism).follow(samples, near=near)


def parameters_in_file(mechanism: Mechanism, joints: Sequence[str]) -> Floats:
    """Of the bodies, then of each of the ``joints`` its JOINT_TERMS, as the mechanism's file has them, (p,) [SI]."""
    terms = (mechanism.coulomb, mechanism.viscous, 0.0 * mechanism.viscous, mechanism.armature)
    return np.concatenate([mechanism.pi, *(np.array(terms)[:, mechanism.coordinate_index(j)] for j in joints)])


def acted_on_by_root(identifiable: Identifiability, mechanism: Mechanism) -> Floats:
    """Inertial parameters that a base's motion acts on, per parameters of bodies and joints, (10 nb, p) [SI].

    Each base parameter is shared out over the parameters that make it up, in proportion to the file's: what a base at
    rest does not tell apart, such as a body's inertia and its drive's, which does not move with the base, its small
    motion hardly tells.
    """
    size = np.abs(parameters_in_file(mechanism, mechanism.driven))
    known = identifiable.combinations[:, : len(size)]
    scaled = known * (size + _LEAST_SHARE * size.max())
    return np.asarray((scaled.T @ np.linalg.pinv(scaled @ known.T, hermitian=True) @ known)[: len(mechanism.pi)])


@dataclass(frozen=True)
class RecordEquations:
    """The equations of one record at one cut-off."""

    record: JointRecord
    mechanism: Mechanism
    cutoff: float
    """Of the comparison [Hz]."""
    names: tuple[str, ...]
    """Of the parameters, (p): inertial ones of the bodies, terms of the joints, offsets of forces, laws of friction,
    all of the first run; then those of each further run, such as ``offset[J1, run_2]``."""
    offsets: tuple[int, ...]
    """Places of this run's own offsets among the parameters, (rows)."""
    first_offsets: tuple[int, ...]
    """Places of the first run's, (rows)."""
    motion: Rates
    """Of the driven joints, positions smoothed, over the whole record."""
    path: Trajectory
    """Of all joints along it."""
    rest: Floats
    """Speeds of the driven joints below which they rest in any of the records, (joints) [rad/s, m/s]."""

    @classmethod
    def of(
        cls, records: Sequence[JointRecord], run: int, mechanism: Mechanism, cutoff: float, motion: Rates, rest: Floats
    ) -> "RecordEquations":
        """Of the motion of one of the ``records``' driven joints. Raises ClosureError where loops cannot be closed."""
        record = records[run]
        path, rows = path_of(record, mechanism, motion), record.rows(mechanism)
        terms = [f"{term}[{joint}]" for joint in mechanism.driven if joint in rows for term in JOINT_TERMS]
        forces = [f"offset[{row}]" for row in rows if row not in mechanism.driven]
        names = [*mechanism.parameter_names, *terms, *forces, *(law.name for law in record.laws)]
        first = tuple(names.index(f"offset[{row}]") for row in rows)
        own = tuple(len(names) + (run - 1) * len(rows) + k for k in range(len(rows))) if run else first
        names += [f"offset[{row}, {further.name}]" for further in records[1:] for row in rows]
        return cls(record, mechanism, cutoff, tuple(names), own, first, motion, path, rest)

    @cached_property
    def whole(self) -> Floats:
        """W of the whole record, positions smoothed, (samples, rows, p)."""
        return self.regressor(self.motion, self.path)

    def regressor(self, motion: Rates, path: Trajectory) -> Floats:
        """W of the record's rows for any motion of its driven joints, (samples, rows, p) [SI].

        The motion of the base acts on the parameters ``of_root``, so that it tells no more of them apart.
        """
        mechanism, loads, joints = self.mechanism, self.record.loads, self.record.torque.shape[1]
        bodies, rows = len(mechanism.pi), len(self.offsets)
        columns = np.zeros((len(path.q), rows, len(self.names)))
        if joints:
            terms = joint_friction_regressor(mechanism.driven, motion.v, motion.a, DRY_PART * self.rest)[0]
            states = (mechanism, path.q, path.v, path.a, path.per_drive)
            columns[:, :joints, :bodies] = still = driven_torque_regressor(*states)
            columns[:, :joints, bodies : bodies + terms.shape[2]] = terms
            if self.record.root is not None and self.record.of_root is not None:
                root = low_pass(self.record.root, POSITION_BANDWIDTH * self.cutoff, self.record.grid.rate)
                moved = driven_torque_regressor(*states, root) - still
                columns[:, :joints, : self.record.of_root.shape[1]] += moved @ self.record.of_root
        if loads is not None:
            wrench = wrench_regressor(mechanism, path.q, path.v, path.a)
            columns[:, joints:, :bodies] = loads.projected_regressor(wrench)
        for law in self.record.laws:
            columns[:, :, self.names.index(law.name)] = self.friction(law, motion)
        columns[:, :, self.first_offsets] = 0.0
        columns[:, range(rows), self.offsets] = 1.0
        return columns

    @cached_property
    def by_any_motion(self) -> Identifiability:
        """What these drives and sensors determine at random states; of loops at the record's, by random rates."""
        rng, shape = np.random.default_rng(0), self.motion.q.shape
        q = self.motion.q if self.mechanism.loops else rng.uniform(-np.pi, np.pi, shape)
        motion = Rates(q, *rng.normal(0.0, 3.0, (2, *shape)))
        path = path_of(self.record, self.mechanism, motion, self.path)
        return identifiability(self.regressor(motion, path), self.names)

    def friction(self, law: Law, motion: Rates) -> Floats:
        """What a law of friction makes of the rows at one [N m, N, per speed or its square], (samples, rows)."""
        made, joint = np.zeros((len(motion.v), len(self.offsets))), self.mechanism.driven.index(law.joint)
        sizes = law.size * np.exp([NEARBY, -NEARBY]) if law.by_size else [law.size]
        v, step, turns = motion.v[:, joint], self.record.grid.step, DRY_PART * float(self.rest[joint])
        at = [friction_law(law.kind, size, v, step, turns) for size in sizes]
        made[:, joint] = (at[0] - at[1]) / (2.0 * NEARBY) if law.by_size else at[0]
        return made

    def with_own_offsets(self, parameters: Floats) -> Floats:
        """Parameters (..., p) [SI] with this run's offsets in the places of the first run's."""
        own = parameters.copy()
        own[..., self.first_offsets] = parameters[..., self.offsets]
        return own

    @cached_property
    def moving(self) -> Floats:
        """One where a joint moves, zero where a gap touches or it rests as long as the low-pass looks around.

        (samples, rows); forces count where any joint moves.
        """
        from scipy.ndimage import maximum_filter1d

        reach = 2 * int(self.record.grid.rate / ALMOST / self.cutoff / 2) + 1
        moves = (maximum_filter1d(np.abs(self.motion.v), reach, axis=0) > self.rest).astype(float)
        joints = self.record.torque.shape[1]
        forces = np.repeat(moves.max(axis=1, keepdims=True), self.whole.shape[1] - joints, axis=1)
        return np.concatenate([moves[:, :joints], forces], axis=1) * self.valid

    @cached_property
    def nearby(self) -> dict[str, list[tuple[tuple[Rates, Trajectory], ...]]]:
        """Motions and paths NEARBY above and below this one in q, v or a of each driven joint in turn."""
        found = {}
        for of in "avq":
            changes = NEARBY * np.eye(self.record.q.shape[1])
            near = [[replace(self.motion, **{of: getattr(self.motion, of) + c}) for c in (d, -d)] for d in changes]
            found[of] = [tuple((m, path_of(self.record, self.mechanism, m, self.path)) for m in pair) for pair in near]
        return found

    @property
    def reach(self) -> float:
        """How far a gap disturbs the positions [s]."""
        return gap_reach(POSITION_BANDWIDTH * self.cutoff)

    @cached_property
    def valid(self) -> Floats:
        """One where no gap touches, else zero, (samples, 1)."""
        return self.record.valid(self.reach)

    def delayed(self, values: Floats, delay: float) -> Floats:
        """Rows (samples, rows) of the whole record, those of torques ``delay`` [s] later."""
        joints = self.record.torque.shape[1]
        place = np.clip(np.arange(len(values)) + round(delay / self.record.grid.step), 0, len(values) - 1)
        return np.concatenate([values[place, :joints], values[:, joints:]], axis=1)

    @cached_property
    def known(self) -> Floats:
        """What masses that are known to be mounted in this run alone take of each row, (samples, rows) [N m, N]."""
        return np.asarray(self.whole[:, :, : len(self.record.mounted)] @ self.record.mounted)

    def measured(self, delay: float) -> Floats:
        """What was measured of the whole record less what is known, (samples, rows) [N m, N]."""
        return self.delayed(self.record.measured, delay) - self.known

    @cached_property
    def smooth(self) -> tuple[Floats, Floats]:
        """What was measured, and what is known of it, low-passed at the cut-off, (samples, rows) [N m, N] each."""
        return self.low_passed(self.record.measured), self.low_passed(self.known) if self.known.any() else self.known

    def low_passed(self, values: Floats) -> Floats:
        """Values (samples, ...) [any unit] of the whole record, low-passed at the cut-off between gaps."""
        grid = self.record.grid
        return self.record.gaps.by_segment(lambda v: low_pass(v, self.cutoff, grid.rate), values, grid, self.reach)

    def low_passed_columns(self, columns: Floats) -> Floats:
        """Columns (samples, rows, p) low-passed; those of offsets stay as they are."""
        varies = (columns != columns[0]).any(axis=(0, 1))
        found = columns.copy()
        found[:, :, varies] = self.low_passed(columns[:, :, varies])
        return found

    def inside(self, values: Floats) -> Floats:
        """Values (samples, ...) [any unit] of the whole record without its ends."""
        edge = self.record.edge
        return values[edge : len(values) - edge]


@dataclass(frozen=True)
class RegressionEquations:
    """The equations of all records at one cut-off, one record after the other, without their ends."""

    parts: tuple[RecordEquations, ...]

    @property
    def cutoff(self) -> float:
        """Of the comparison [Hz]."""
        return self.parts[0].cutoff

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, (p)."""
        return self.parts[0].names

    @property
    def records(self) -> list[JointRecord]:
        """What the equations were made of."""
        return [part.record for part in self.parts]

    @property
    def places(self) -> list[slice]:
        """The equations of each record among all."""
        ends = np.cumsum([0, *(len(part.inside(part.whole)) for part in self.parts)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def time(self) -> Floats:
        """Instants of the equations on their record's clock, (n,) [s]."""
        return self.joined(lambda part: part.record.grid.time)

    @cached_property
    def columns(self) -> Floats:
        """W of smoothed positions, (n, rows, p)."""
        return self.joined(lambda part: part.whole)

    @cached_property
    def moving(self) -> Floats:
        """One where a joint moves, zero where it rests, (n, rows)."""
        return self.joined(lambda part: part.moving)

    @cached_property
    def valid(self) -> Floats:
        """One where no gap touches, else zero, (n, 1)."""
        return self.joined(lambda part: part.valid)

    def low_passed_columns(self, pivots: Sequence[int]) -> Floats:
        """Columns of W low-passed at the cut-off, (n, rows, pivots)."""
        return self.joined(lambda part: part.low_passed_columns(part.whole[:, :, list(pivots)]))

    def torque(self, delay: float) -> Floats:
        """Rows as recorded, torques ``delay`` [s] after the motion, less what is known, (n, rows) [N m, N]."""
        return self.joined(lambda part: part.measured(delay))

    def low_passed_torque(self, delay: float) -> Floats:
        """The same, low-passed at the cut-off, (n, rows) [N m, N]."""
        return self.joined(lambda part: part.delayed(part.smooth[0], delay) - part.smooth[1])

    def equal_parts(self, count: int) -> Indices:
        """Numbers of ``count`` equal parts, none over two records and of each record two at least, (n,)."""
        numbers, total = [np.zeros(0, dtype=np.intp)], len(self.time)
        for place in self.places:
            size, begun = place.stop - place.start, numbers[-1].max(initial=-1) + 1
            numbers.append(begun + np.arange(size) * max(round(count * size / total), 2) // size)
        return np.concatenate(numbers)

    def blocks(self, seconds: float) -> Indices:
        """Numbers of blocks with equal motion, at least so long, none over two records, (n,)."""
        numbers = np.zeros(0, dtype=np.intp)
        for part in self.parts:
            moves = part.inside(part.moving).any(axis=1).astype(float)
            own = equal_blocks(moves, seconds / part.record.grid.step)
            numbers = np.r_[numbers, own + numbers.max(initial=-1) + 1]
        return numbers

    def fitted(self, columns: Floats, rows: Floats, used: Floats | None = None) -> RegressionFit:
        """Least squares of rows (n, rows) [N m, N] in columns (n, rows, p), where they count: by default in motion."""
        blocks, counts = self.blocks(1.0 / self.cutoff), self.moving if used is None else used
        return fit([RegressionRecord.of(columns, rows, blocks, used=counts)])

    @property
    def left_out(self) -> list[str]:
        """What gaps take of the records."""
        return [text for part in self.parts for text in part.record.left_out(part.reach)]

    def joined(self, of: Callable[[RecordEquations], Floats]) -> Floats:
        """Values (n, ...) of all records without their ends, ``of`` one record (samples, ...) [any unit]."""
        return np.concatenate([part.inside(of(part)) for part in self.parts])


def regression_equations(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> RegressionEquations:
    """The equations that records of a mechanism give at a cut-off [Hz].

    Raises ClosureError where its loops cannot be closed at the recorded positions, AnalysisError if a joint rests.
    """
    bandwidth = POSITION_BANDWIDTH * cutoff
    found = _equations(records, mechanism, cutoff, bandwidth, [record.rates(bandwidth) for record in records])
    for joint, moving in zip(mechanism.driven, found.moving.T, strict=False):
        if not moving.any():
            lost = "".join(f"; {text}" for text in found.left_out)
            raise AnalysisError(
                f"{', '.join(r.name for r in records)}: joint {joint!r} never moves but for noise of its readings: "
                f"expected a record in which every driven joint moves{lost}"
            )
    return found


def _equations(
    records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float, bandwidth: float, motions: Sequence[Rates]
) -> RegressionEquations:
    turning = [mechanism.drive_unit(joint) != "N" for joint in mechanism.driven]
    pairs = [(record.q, motion.v) for record, motion in zip(records, motions, strict=True)]
    rest = rest_speeds(pairs, bandwidth, turning)
    each = enumerate(motions)
    return RegressionEquations(tuple(RecordEquations.of(records, k, mechanism, cutoff, m, rest) for k, m in each))


def one_sided(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> RegressionEquations:
    """The equations as they are often set up, with a bias: torque and rates low-passed, positions as recorded.

    The weight then moves with the whole motion and the torque with what the low-pass leaves of it. For comparison.
    """
    rates = [replace(record.rates(cutoff), q=record.q) for record in records]
    return _equations(records, mechanism, cutoff, cutoff, rates)
