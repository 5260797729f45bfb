"""The equations that records give at one cut-off: W pi = tau, as recorded, and low-passed alike on both sides.

A low-pass is linear: run over the columns of W and over tau alike it changes nothing in W pi = tau, whatever its
cut-off. What does distort W is the smoothing of the positions that W is made of, so these keep twice the bandwidth of
the comparison; on simulated records with known parameters that leaves a bias below 1 % (see the tests).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats, Indices
from balance.closure import Closure
from balance.joint_terms import joint_terms
from balance.mechanism import Mechanism
from balance.motion import Samples
from balance.regressor import driven_torque_regressor

from ..derivatives import Rates, low_pass, rates
from ..errors import AnalysisError
from .record import JointRecord

POSITION_BANDWIDTH = 2.0
"""Cut-off for the positions, in cut-offs of the comparison."""
EDGE_S = 0.25
"""Left out at both ends of a record, where low-passes start up [s]."""
REST_SPEED = 0.1
"""A joint slower than this is at rest, where dry friction may hold any torque: it says nothing [rad/s, m/s]."""


@dataclass(frozen=True)
class Part:
    """The equations of one record at one cut-off."""

    record: JointRecord
    cutoff: float
    """Of the comparison [Hz]."""
    names: tuple[str, ...]
    """Of the parameters: inertial ones of the bodies, then terms of the joints, (p)."""
    whole: Floats
    """W of the whole record, positions smoothed, (samples, joints, p)."""
    moving: Floats
    """One where a joint moves, zero where it rests, (samples, joints)."""

    @cached_property
    def low_passed_torque(self) -> Floats:
        """Torque of the whole record, low-passed at the cut-off, (samples, joints) [N m, N]."""
        return low_pass(self.record.torque, self.cutoff, self.record.grid.rate)

    def low_passed_columns(self, pivots: Sequence[int]) -> Floats:
        """Columns of the whole record's W, low-passed at the cut-off, (samples, joints, pivots)."""
        return low_pass(self.whole[:, :, list(pivots)], self.cutoff, self.record.grid.rate)

    def inside(self, values: Floats, delay: float = 0.0) -> Floats:
        """``values`` of the whole record without its ends, as they stand ``delay`` [s] later."""
        edge, shift = round(EDGE_S / self.record.grid.step), round(delay / self.record.grid.step)
        return values[edge + shift : len(values) - edge + shift]


@dataclass(frozen=True)
class Evidence:
    """The equations of all records at one cut-off, one record after the other."""

    parts: tuple[Part, ...]

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
        """W of smoothed positions, (n, joints, p)."""
        return self._joined(lambda part: part.inside(part.whole))

    @cached_property
    def moving(self) -> Floats:
        """One where a joint moves, zero where it rests, (n, joints)."""
        return self._joined(lambda part: part.inside(part.moving))

    def low_passed_columns(self, pivots: Sequence[int]) -> Floats:
        """Columns of W low-passed at the cut-off, (n, joints, pivots)."""
        return self._joined(lambda part: part.inside(part.low_passed_columns(pivots)))

    def torque(self, delay: float) -> Floats:
        """Torque as recorded ``delay`` [s] after the motion, (n, joints) [N m, N]."""
        return self._joined(lambda part: part.inside(part.record.torque, delay))

    def low_passed_torque(self, delay: float) -> Floats:
        """The same, low-passed at the cut-off, (n, joints) [N m, N]."""
        return self._joined(lambda part: part.inside(part.low_passed_torque, delay))

    def stretches(self, seconds: float) -> Indices:
        """Numbers of equal stretches at least so long, none over two records, (n,)."""
        numbers: list[Indices] = []
        for part in self.parts:
            samples = len(part.inside(part.moving))
            count = max(1, int(samples * part.record.grid.step / seconds))
            first = 0 if not numbers else int(numbers[-1][-1]) + 1
            numbers.append(first + np.arange(samples) * count // samples)
        return np.concatenate(numbers)

    def _joined(self, of: Callable[[Part], Floats]) -> Floats:
        return np.concatenate([of(part) for part in self.parts])


def gather(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> Evidence:
    """The equations that records of a mechanism give at a cut-off [Hz].

    Raises ClosureError where its loops cannot be closed at the recorded positions, AnalysisError if a joint rests.
    """
    evidence = Evidence(tuple(_part(record, mechanism, cutoff) for record in records))
    for joint, moving in zip(mechanism.driven, evidence.moving.T, strict=True):
        if not moving.any():
            raise AnalysisError(
                f"{', '.join(r.name for r in records)}: joint {joint!r} never moves faster than {REST_SPEED} rad/s: "
                "expected a record in which every driven joint moves"
            )
    return evidence


def one_sided(records: Sequence[JointRecord], mechanism: Mechanism, cutoff: float) -> Evidence:
    """The equations as they are often set up, with a bias: torque and rates low-passed, positions as recorded.

    The weight then moves with the whole motion and the torque with what the low-pass leaves of it. For comparison.
    """
    parts = []
    for record in records:
        smooth = rates(record.q, cutoff, record.grid.rate)
        parts.append(_part_of(record, mechanism, cutoff, Rates(record.q, smooth.v, smooth.a)))
    return Evidence(tuple(parts))


def _part(record: JointRecord, mechanism: Mechanism, cutoff: float) -> Part:
    return _part_of(record, mechanism, cutoff, rates(record.q, POSITION_BANDWIDTH * cutoff, record.grid.rate))


def _part_of(record: JointRecord, mechanism: Mechanism, cutoff: float, smooth: Rates) -> Part:
    samples = Samples(record.grid.time, smooth.q, smooth.v, smooth.a, joints=mechanism.driven)
    path = Closure(mechanism).follow(samples)
    bodies = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive)
    terms, names = joint_terms(mechanism.driven, smooth.v, smooth.a)
    whole = np.concatenate([bodies, terms], axis=2)
    moving = _moving(smooth.v, record.grid.rate / cutoff)
    return Part(record, cutoff, (*mechanism.parameter_names, *names), whole, moving)


def _moving(v: Floats, reach: float) -> Floats:
    """Zero where a joint rests as long as the low-pass looks around, ``reach`` samples."""
    from scipy.ndimage import maximum_filter1d

    return (maximum_filter1d(np.abs(v), 2 * int(reach / 2) + 1, axis=0) > REST_SPEED).astype(float)
