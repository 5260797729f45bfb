"""What first moment is missing where, from measured shaking forces: least squares on the balance conditions.

The shaking force is linear in pi and vanishes where the conditions C pi = c are zero: F = W_F pi = W_F[pivots] c. So c
is what is measured, one number a condition, and counter-masses m that would balance are those of C pi + B m = 0 with
the measured c in place of C pi. Intervals come from leaving out stretches of the record in turn (delete-block
jackknife), with offsets and the like of each record solved for anew. Repeats of one motion repeat its systematic
errors: the same stretch is left out of all of them.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
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
    """The equations of one record: measured = columns @ (c, shared) + nuisance @ (something of this record alone)."""

    columns: Floats
    """Of the conditions' values, then of what else is unknown and the same in all records, (n, rows, rank + shared)."""
    force: Floats
    """What was measured, (n, rows) [N, N m, m/s2]; zero, as its columns, where it says nothing."""
    nuisance: Floats
    """(n, rows, k)"""
    blocks: Indices
    """Number of the stretch that each sample is in, from zero, (n,)."""
    motion: str = ""
    """Records of one motion repeat what is systematic: a stretch is left out of all of them. Empty: like no other."""


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
    free: "Free"
    """What of the values was found; the rest was held."""
    excited: Floats
    """Orthonormal combinations of all unknowns, those of ``free`` first, that the records determine, (excited, ...)."""
    unexplained: float
    """Share of the rms of what was measured that is not explained."""

    def estimate(self, share: Floats) -> Estimate:
        """A combination (rank,) of the conditions' values. Raises NotObservable if the records do not determine it."""
        own = self.free.directions @ share
        padded = np.pad(own, (0, self.excited.shape[1] - len(own)))
        outside = padded - self.excited.T @ (self.excited @ padded)
        if np.abs(outside).max() > 1e-6 * np.abs(share).max(initial=0.0):
            raise NotObservable("what balances is not determined by this record: the motion does not excite it")
        error = float(np.sqrt(max(float(share @ self.covariance @ share), 0.0)))
        return Estimate(float(share @ self.values), error, student_t(self.freedom) * error)

    def holds(self, share: Floats) -> bool:
        """Whether a combination (rank,) of the conditions' values was not found but held."""
        return bool(np.abs(self.free.directions @ share).max(initial=0.0) <= 1e-9 * np.abs(share).max(initial=0.0))

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
    return -np.linalg.pinv(site_columns(conditions, mechanism, sites), rcond=1e-12)


def site_columns(conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> Floats:
    """What a kilogram at each site adds to each condition's value, B of C pi + B m = 0, (rank, sites) [m]."""
    columns = [conditions.matrix @ (mechanism.with_counter_mass({site: 1.0}).pi - mechanism.pi) for site in sites]
    return np.array(columns).T


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


@dataclass(frozen=True)
class Free:
    """Values that conditions can have: c = start + directions.T @ (something)."""

    directions: Floats
    """Orthonormal, (k, rank)."""
    start: Floats
    """(rank,) [kg m]"""

    @classmethod
    def all(cls, conditions: Conditions) -> "Free":
        """Any values."""
        return cls(np.eye(conditions.rank), np.zeros(conditions.rank))

    @classmethod
    def at_sites(cls, conditions: Conditions, mechanism: Mechanism, sites: Sequence[str]) -> "Free":
        """What masses at ``sites`` can change; the rest as the mechanism's file has it."""
        columns = site_columns(conditions, mechanism, sites)
        basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return cls(basis[:, sizes > 1e-12 * sizes[0]].T, conditions.values(mechanism))

    def of(self, record: Record) -> Record:
        """The record's equations in what is free, in place of all conditions."""
        rank = len(self.start)
        own, others = record.columns[:, :, :rank], record.columns[:, :, rank:]
        columns = np.concatenate([own @ self.directions.T, others], axis=2)
        return replace(record, columns=columns, force=record.force - own @ self.start)


def measure(records: Sequence[Record], conditions: Conditions, free: Free | None = None) -> Imbalance:
    """Values of the conditions from records. Raises DataError with too few stretches, NotObservable with no motion."""
    free = free or Free.all(conditions)
    size = len(free.directions)
    records = [free.of(record) for record in records]
    scale = _scales(records, size)
    sums = [_Sums(record, scale) for record in records]
    excited, values = _solved(sums)
    for _ in range(_REWEIGHTINGS):
        for one in sums:
            one.weigh(values)
        excited, values = _solved(sums)
    left_out = np.array([_solved(sums, skip)[1] for skip in _stretches(sums)])
    count = len(left_out)
    if count <= size + 2:
        raise DataError(f"an interval needs more than {size + 2} stretches of the record: there are {count}")
    spread = ((left_out - values) / scale)[:, :size] @ free.directions
    covariance = (count - 1) / count * spread.T @ spread
    left = sum(one.left(values) for one in sums) / sum(one.whole for one in sums)
    found = free.start + (values / scale)[:size] @ free.directions
    return Imbalance(conditions, found, covariance, count - size, free, excited, float(np.sqrt(max(left, 0.0))))


def _scales(records: Sequence[Record], rank: int) -> Floats:
    """What each unknown is multiplied by: one number for all conditions, so that an excited direction stays one."""
    scale = np.sqrt(sum(np.sum(r.columns**2, axis=(0, 1)) for r in records) / sum(len(r.force) for r in records))
    if not scale[:rank].max() > 0.0:
        raise NotObservable("nothing moves in this record: it determines no first moment")
    scale[:rank] = scale[:rank].max()
    scale[scale == 0.0] = 1.0
    return np.asarray(scale)


class _Sums:
    """Normal equations of a record by stretch, from which stretches can be left out."""

    def __init__(self, record: Record, scale: Floats) -> None:
        self.size, self.motion = record.columns.shape[2], record.motion
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


def _stretches(sums: "Sequence[_Sums]") -> list[dict[int, int]]:
    """What is left out in turn: stretches by record, of repeats of one motion together."""
    found: dict[tuple[str | int, int], dict[int, int]] = defaultdict(dict)
    for r, one in enumerate(sums):
        for block in range(len(one.matrix)):
            found[one.motion or r, block][r] = block
    return list(found.values())


def _solved(sums: "Sequence[_Sums]", skip: Mapping[int, int] | None = None) -> tuple[Floats, Floats]:
    """Excited combinations and values, all records together, a stretch of some records left out."""
    left_out = skip or {}
    both = [one.reduced(left_out.get(r)) for r, one in enumerate(sums)]
    matrix, vector = np.sum([m for m, _ in both], axis=0), np.sum([v for _, v in both], axis=0)
    sizes, directions = np.linalg.eigh(0.5 * (matrix + matrix.T))
    kept = sizes > RANK_LIMIT**2 * sizes[-1]
    excited = directions[:, kept]
    return excited.T, excited @ ((excited.T @ vector) / sizes[kept])
