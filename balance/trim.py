"""What first moment is missing where, from measured shaking forces: least squares on the balance conditions.

The shaking force is linear in pi and vanishes where the conditions C pi = c are zero: F = W_F pi = W_F[pivots] c. So c
is what is measured, one number a condition, and counter-masses m that would balance are those of C pi + B m = 0 with
the measured c in place of C pi. Intervals come from leaving out stretches of the record in turn (delete-block
jackknife), with offsets and the like of each record solved for anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arrays import Floats, Indices
from .conditions import Conditions
from .errors import DataError
from .identification import Estimate, student_t
from .mechanism import Mechanism
from .observability import NotObservable

RANK_LIMIT = 1e-6
"""Singular value of the conditions' columns, scaled alike, below which a direction is not excited."""
_REWEIGHTINGS = 3


@dataclass(frozen=True)
class Record:
    """The equations of one record: force = columns @ c + nuisance @ (something of this record alone)."""

    columns: Floats
    """(n, rows, conditions)"""
    force: Floats
    """(n, rows) [N]"""
    nuisance: Floats
    """(n, rows, k)"""
    blocks: Indices
    """Number of the stretch that each sample is in, from zero, (n,)."""


@dataclass(frozen=True)
class Missing:
    """What a site lacks for balance; negative where it has too much."""

    site: str
    position: Floats
    """In its body's frame, (3,) [m]."""
    mass: Estimate
    """[kg]"""
    first_moment: Estimate
    """About the body's joint, mass times distance [kg m]."""


@dataclass(frozen=True)
class Imbalance:
    """Values of the balance conditions as measured."""

    conditions: Conditions
    values: Floats
    """(rank,) [kg m]"""
    covariance: Floats
    """(rank, rank)"""
    freedom: int
    excited: Floats
    """Orthonormal combinations of the conditions that the records determine, (excited, rank)."""
    unexplained: float
    """Share of the force's rms that the conditions do not explain."""

    def estimate(self, share: Floats) -> Estimate:
        """A combination (rank,) of the conditions' values. Raises NotObservable if the records do not determine it."""
        outside = share - self.excited.T @ (self.excited @ share)
        if np.abs(outside).max() > 1e-6 * np.abs(share).max(initial=0.0):
            raise NotObservable("what balances is not determined by this record: the motion does not excite it")
        error = float(np.sqrt(max(float(share @ self.covariance @ share), 0.0)))
        return Estimate(float(share @ self.values), error, student_t(self.freedom) * error)

    def missing(self, mechanism: Mechanism, sites: Sequence[str]) -> list[Missing]:
        """What each site lacks, in least squares over the conditions. Raises NotObservable as ``estimate`` does."""
        shares = shares_of(self.conditions, mechanism, sites)
        return [self._missing(mechanism, site, share) for site, share in zip(sites, shares, strict=True)]

    def _missing(self, mechanism: Mechanism, site: str, share: Floats) -> Missing:
        position = mechanism.site(site).position
        distance = float(np.linalg.norm(position))
        return Missing(site, position, self.estimate(share), self.estimate(distance * share))


def shares_of(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """The mass that each site lacks per unit of each condition's value, (sites, rank) [1/m]: m = -B^+ c."""
    columns = [conditions.matrix @ (mechanism.with_counter_mass({site: 1.0}).pi - mechanism.pi) for site in sites]
    return -np.linalg.pinv(np.array(columns).T, rcond=1e-12)


def adjusted(conditions: Conditions, mechanism: Mechanism, values: Floats) -> Mechanism:
    """The mechanism with the least change of its parameters that gives the conditions these values (rank,) [kg m]."""
    change = np.linalg.pinv(conditions.matrix) @ (values - conditions.values(mechanism))
    parameters = mechanism.parameters + change.reshape(mechanism.parameters.shape)
    parameters.setflags(write=False)
    return replace(mechanism, parameters=parameters)


def columns_of(conditions: Conditions, regressor: Floats) -> Floats:
    """The columns that the values of the conditions multiply, of a force regressor (n, 3, 10 nb), (n, 3, rank)."""
    pivots = [int(np.flatnonzero(row)[0]) for row in conditions.matrix]
    return np.asarray(regressor[:, :, pivots])


def measure(records: Sequence[Record], conditions: Conditions) -> Imbalance:
    """Values of the conditions from records. Raises DataError with too few stretches, NotObservable with no motion."""
    scale = np.sqrt(sum(np.sum(r.columns**2, axis=(0, 1)) for r in records) / sum(len(r.force) for r in records))
    if not scale.max() > 0.0:
        raise NotObservable("nothing moves in this record: it determines no first moment")
    sums = [_Sums(record, scale.max()) for record in records]
    excited, values = _solved(sums)
    for _ in range(_REWEIGHTINGS):
        for one in sums:
            one.weigh(values)
        excited, values = _solved(sums)
    left_out = np.array([_solved(sums, skip)[1] for skip in _stretches(sums)])
    count = len(left_out)
    if count <= conditions.rank + 2:
        raise DataError(f"an interval needs more than {conditions.rank + 2} stretches of the record: there are {count}")
    spread = left_out - values
    covariance = (count - 1) / count * spread.T @ spread / scale.max() ** 2
    left = sum(one.left(values) for one in sums) / sum(one.whole for one in sums)
    return Imbalance(
        conditions, values / scale.max(), covariance, count - conditions.rank, excited, float(np.sqrt(max(left, 0.0)))
    )


class _Sums:
    """Normal equations of a record by stretch, from which stretches can be left out."""

    def __init__(self, record: Record, scale: float) -> None:
        self.size = record.columns.shape[2]
        nuisance = record.nuisance / np.maximum(np.sqrt(np.mean(record.nuisance**2, axis=(0, 1))), 1e-300)
        design = np.concatenate([record.columns / scale, nuisance], axis=2)
        parts = [np.flatnonzero(record.blocks == k) for k in range(int(record.blocks.max()) + 1)]
        rows = range(record.force.shape[1])
        self.matrix = np.array([[design[p, j].T @ design[p, j] for j in rows] for p in parts])
        self.vector = np.array([[design[p, j].T @ record.force[p, j] for j in rows] for p in parts])
        self.square = np.sum(record.force**2, axis=0)
        self.samples = len(record.force)
        self.weights = np.full(
            len(self.square), self.samples * len(self.square) / max(float(self.square.sum()), 1e-300)
        )

    def reduced(self, skip: int | None = None) -> tuple[Floats, Floats]:
        """Equations of the conditions alone, the record's own nuisances solved for."""
        matrix, vector = self._weighted(skip)
        k = self.size
        gain = np.linalg.lstsq(matrix[k:, k:], np.column_stack([matrix[k:, :k], vector[k:]]), rcond=1e-12)[0]
        return matrix[:k, :k] - matrix[:k, k:] @ gain[:, :k], vector[:k] - matrix[:k, k:] @ gain[:, k]

    def weigh(self, values: Floats) -> None:
        """Weights of the rows by what the values leave: 1 / mean square."""
        left = self._left_by_row(values)
        self.weights = self.samples / np.maximum(left, 1e-8 * self.square.sum())

    def left(self, values: Floats) -> float:
        """Sum of squares of the force that the values leave."""
        return float(self._left_by_row(values).sum())

    @property
    def whole(self) -> float:
        """Sum of squares of the force, less what the nuisances explain."""
        return self.left(np.zeros(self.size))

    def _weighted(self, skip: int | None) -> tuple[Floats, Floats]:
        used = np.ones(len(self.matrix))
        if skip is not None:
            used[skip] = 0.0
        return (
            np.einsum("b,j,bjik->ik", used, self.weights, self.matrix),
            np.einsum("b,j,bji->i", used, self.weights, self.vector),
        )

    def _left_by_row(self, values: Floats) -> Floats:
        matrix, vector = self._weighted(None)
        k = self.size
        own = np.linalg.lstsq(matrix[k:, k:], vector[k:] - matrix[k:, :k] @ values, rcond=1e-12)[0]
        all_values = np.concatenate([values, own])
        by_row, right = self.matrix.sum(axis=0), self.vector.sum(axis=0)
        return np.maximum(
            self.square - 2.0 * right @ all_values + np.einsum("i,jik,k->j", all_values, by_row, all_values), 0.0
        )


def _stretches(sums: "Sequence[_Sums]") -> list[tuple[int, int]]:
    return [(r, b) for r, one in enumerate(sums) for b in range(len(one.matrix))]


def _solved(sums: "Sequence[_Sums]", skip: tuple[int, int] | None = None) -> tuple[Floats, Floats]:
    """Excited combinations and values, all records together, one stretch of one record left out."""
    both = [one.reduced(skip[1] if skip and skip[0] == r else None) for r, one in enumerate(sums)]
    matrix, vector = np.sum([m for m, _ in both], axis=0), np.sum([v for _, v in both], axis=0)
    sizes, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
    kept = sizes > RANK_LIMIT**2 * sizes[-1]
    excited = directions[:, kept]
    return excited.T, excited @ ((excited.T @ vector) / sizes[kept])
