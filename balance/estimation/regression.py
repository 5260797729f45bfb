"""Weighted least squares of records with nuisances, instruments and priors; intervals by the delete-block jackknife.

A record says readings = columns @ unknowns + nuisance @ (what is unknown of this record alone) + noise. Every row (a
joint's torque, a component of force, a channel) has one weight over all records, 1 / the mean square of its residual,
found by repetition: its noise is its sensor's. Nuisances are eliminated record by record.

Residuals are correlated in time, so intervals do not come from their number: blocks of the records, longer than the
correlation, are left out in turn, nuisances solved for anew (delete-block jackknife), which also counts what the model
lacks. Repeats of one motion repeat what is systematic: the same block is left out of all of them. The variance of a
combination of unknowns has (sum p)^2 / sum p^2 - 1 degrees of freedom, p what each block contributes to it, were the
noise white (Satterthwaite): few where few blocks determine it, blocks - 1 where all do equally. That is the most it
can be: it takes what the blocks say for independent, but every balance condition that is estimated from them ties them
once, as unknowns do in any least squares. So degrees of freedom are at most blocks - conditions: in doubt the wider
interval holds.

Where the columns themselves carry noise, least squares is biased towards zero: Z' W b = Z' y with instruments Z,
columns made without that noise, is not (instrumental variables; Janot, Vandanjon, Gautier, IEEE Trans. Control Syst.
Technol. 22, 2014).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Floats, Indices
from ..errors import DataError
from .estimate import Estimate
from .identifiability import RANK_LIMIT, NotIdentifiable

LEAST_BLOCKS = 3
"""From which a jackknife says something."""
_EXACT = 1e-4
"""Residual of a row, as a part of its readings' rms, below which it earns no more weight."""
_REWEIGHTINGS = 20
_SETTLED = 1e-6
"""Relative change of the weights at which they count as found."""
_INVERTED = 0.1 * RANK_LIMIT**-2
"""Condition number up to which equations of nuisances have an inverse."""
_OUTSIDE = 1e-6
"""Part of a combination outside what is excited, relative to it, that is rounding."""


@dataclass(frozen=True)
class RegressionRecord:
    """readings = columns @ unknowns + nuisance @ (unknowns of this record alone) + noise, by sample and row."""

    columns: Floats
    """(n, rows, p)"""
    readings: Floats
    """(n, rows) [N, N m, m/s2]"""
    blocks: Indices
    """Number of the block that each sample is in, (n,)."""
    nuisance: Floats
    """(n, rows, k)"""
    used: Floats
    """One where a reading counts, zero where not, (n, rows)."""
    instruments: Floats | None = None
    """In place of the columns, where these carry noise, (n, rows, p)."""
    motion: str = ""
    """Records of one motion leave out the same block together; empty: like no other."""
    rows: tuple[str, ...] = ()
    """Names of the rows: those of one name have one noise."""

    @classmethod
    def of(
        cls,
        columns: Floats,
        readings: Floats,
        blocks: Indices,
        nuisance: Floats | None = None,
        used: Floats | None = None,
        instruments: Floats | None = None,
        motion: str = "",
        rows: Sequence[str] = (),
    ) -> "RegressionRecord":
        """With what is left out filled in: no nuisance, all readings used, rows by number.

        Raises DataError where shapes differ or a value that counts is not finite.
        """
        none = np.zeros((*readings.shape, 0)) if nuisance is None else nuisance
        every = np.broadcast_to(1.0 if used is None else used, readings.shape)
        names = tuple(rows) or tuple(str(k) for k in range(readings.shape[1]))
        shapes = {columns.shape[:2], readings.shape, none.shape[:2], (len(blocks), len(names))}
        if instruments is not None:
            shapes |= {instruments.shape[:2], (*readings.shape, columns.shape[2])[:2]}
        if len(shapes) > 1:
            raise DataError(f"parts of a regression record differ in samples and rows: {sorted(shapes)}")
        return cls(columns, readings, blocks, none, every, instruments, motion, names)


def equal_blocks(information: Floats, shortest: float, count: int | None = None) -> Indices:
    """Numbers of blocks that share the information (n,) [-] of samples equally, (n,) from zero.

    ``count`` of them, else as many as fit with at least ``shortest`` samples that tell something. One that is shorter,
    where information is dense, is joined with those after it. ``shortest`` is known to its rounding: 24.999999999 of a
    clock's steps are 25.
    """
    least = int(shortest * (1.0 + 1e-9))
    before = np.cumsum(information) - information
    total = max(float(before[-1] + information[-1]), np.finfo(float).tiny)
    count = count or max(1, int(np.count_nonzero(information) / shortest * (1.0 + 1e-9)))
    numbers = np.minimum(before * count // total, count - 1).astype(np.intp)
    joined, current, begun = np.zeros(len(numbers), dtype=np.intp), -1, -np.inf
    starts = np.flatnonzero(np.diff(numbers, prepend=-1))
    for a, b in zip(starts, np.r_[starts[1:], len(numbers)], strict=True):
        if a - begun >= least:
            current, begun = current + 1, float(a)
        joined[a:b] = current
    return joined


class _RecordSums:
    """Normal equations of a record by block and row, from which any choice of blocks is solved without the samples."""

    def __init__(self, record: RegressionRecord) -> None:
        self.record, self.size = record, record.columns.shape[2]
        self.labels = np.unique(record.blocks[record.used.any(axis=1)])
        own = record.nuisance / np.maximum(np.sqrt(np.mean(record.nuisance**2, axis=(0, 1))), 1e-300)
        used = record.used[:, :, None]
        self.design = np.concatenate([record.columns, own], axis=2)
        design = self.design * used
        parts = [np.flatnonzero(record.blocks == label) for label in self.labels]
        readings = record.readings * record.used
        self.matrix, self.vector = _sums(design, design, readings, parts)
        self.square = np.sum(readings**2, axis=0)
        self.samples = record.used.sum(axis=0)
        self.weights = np.ones(len(self.square))
        self.left, self.left_vector, self.left_square = self.matrix, self.vector, self.matrix
        self.left_design = self.design
        if record.instruments is not None:
            self.left_design = np.concatenate([record.instruments, own], axis=2)
            left = self.left_design * used
            self.left, self.left_vector = _sums(left, design, readings, parts)
            self.left_square = _sums(left, left, readings, parts)[0]

    def reduced(self, left_out: Sequence[int | None] = (None,), weights: Floats | None = None) -> tuple[Floats, Floats]:
        """Equations of the unknowns alone, the nuisances solved for, without each block in turn, or with all (None).

        (choices, p, p) and (choices, p); ``weights`` (rows,) or own.
        """
        own = self.weights if weights is None else weights
        matrix = np.einsum("j,bjik->bik", own, self.left)
        vector = np.einsum("j,bji->bi", own, self.left_vector)
        places = np.array([-1 if block is None else block for block in left_out])
        lost = np.where(places < 0, 0.0, 1.0)
        matrix = matrix.sum(axis=0) - lost[:, None, None] * matrix[places]
        vector = vector.sum(axis=0) - lost[:, None] * vector[places]
        k = self.size
        if matrix.shape[1] == k:
            return matrix, vector
        share = _pseudo_inverse(matrix[:, k:, k:]) @ np.concatenate([matrix[:, k:, :k], vector[:, k:, None]], axis=2)
        across = matrix[:, :k, k:]
        return matrix[:, :k, :k] - across @ share[:, :, :k], vector[:, :k] - (across @ share[:, :, k:])[:, :, 0]

    def lengths(self) -> Floats:
        """Weighted squared lengths of the unknowns' columns, (p,)."""
        k = self.size
        return np.einsum("j,bjii->i", self.weights, self.matrix[:, :, :k, :k])

    def contributions(self) -> Floats:
        """What each block adds to the covariance of the reduced equations' vector, were noise white, (blocks, p, p)."""
        left, k = self._nuisance_shares(), self.size
        square = np.einsum("j,bjik->bik", self.weights, self.left_square)
        before = np.hstack([np.eye(k), -left])
        return np.asarray(before @ square @ before.T)

    def _nuisance_shares(self) -> Floats:
        """What the columns, or their instruments, contain of the nuisances, (p, k)."""
        k = self.size
        matrix = np.einsum("j,bjik->ik", self.weights, self.left)
        return _least_norm(matrix[k:, k:].T, matrix[:k, k:].T).T

    def with_nuisances(self, values: Floats) -> Floats:
        """Values of the unknowns, then of the nuisances that go with them, (p + k,)."""
        k = self.size
        matrix = np.einsum("j,bjik->ik", self.weights, self.left)
        vector = np.einsum("j,bji->i", self.weights, self.left_vector)
        own = _least_norm(matrix[k:, k:], (vector[k:] - matrix[k:, :k] @ values)[:, None])[:, 0]
        return np.concatenate([values, own])

    def residual_squares(self, values: Floats) -> Floats:
        """Sum of squares of each row's residual, (rows,)."""
        whole = self.with_nuisances(values)
        by_row, right = self.matrix.sum(axis=0), self.vector.sum(axis=0)
        left = self.square - 2.0 * right @ whole + np.einsum("i,jik,k->j", whole, by_row, whole)
        return np.maximum(left, 0.0)

    def gains(self, solution: Floats) -> Floats:
        """By how much solution (c, p) @ the reduced equations' vector rises per reading, (n, rows, c)."""
        left, k = self._nuisance_shares(), self.size
        own = self.left_design[:, :, :k] - self.left_design[:, :, k:] @ left.T
        return np.asarray((own @ solution.T) * (self.record.used * self.weights)[:, :, None])


@dataclass(frozen=True)
class RegressionFit:
    """Unknowns by weighted least squares of records."""

    values: Floats
    """(p,); least, in columns of one length, where the records do not excite them."""
    covariance: Floats
    """(p, p), of the delete-block jackknife."""
    excited: Floats
    """Orthonormal combinations of the scaled unknowns that the records determine, (excited, p)."""
    residual_rms: Mapping[str, float]
    """Of each row, by name [N, N m, m/s2]."""
    unexplained: float
    """Rms of the residual as a part of that of the readings less nuisances."""
    conditions: int
    """Number of the unknowns that are balance conditions, by which degrees of freedom are fewer than blocks."""
    _equations: "_Equations" = field(repr=False)
    _inverse: Floats = field(repr=False)
    """Of the equations, (p, p)."""
    _contributions: Floats = field(repr=False)
    """Of blocks to the covariance of the equations' vector, (blocks, p, p)."""

    @property
    def blocks(self) -> int:
        """Number of blocks that were left out in turn."""
        return len(self._contributions)

    def unexplained_of(self, change: Floats) -> float:
        """Rms of the residual as a part of what a change (p,) [SI] of the unknowns makes of the readings [-]; infinite
        where it makes nothing.
        """
        near = (self.values, self.values + change, self.values - change)
        left, above, below = (sum(self._equations.residual_squares(one).values()) for one in near)
        made = 0.5 * (above + below) - left
        return float(np.sqrt(left / made)) if made > 0.0 else np.inf

    def determines(self, combination: Floats) -> bool:
        """Whether the records determine a combination (p,) [-] of the unknowns."""
        own = combination / self._equations.scale
        outside = own - self.excited.T @ (self.excited @ own)
        return not np.abs(outside).max(initial=0.0) > _OUTSIDE * np.abs(own).max(initial=0.0)

    def estimate(self, combination: Floats) -> Estimate:
        """A combination (p,) [-] of the unknowns. Raises NotIdentifiable where the records do not determine it."""
        if not self.determines(combination):
            raise NotIdentifiable(
                "these records do not determine it: their motions do not excite it; record others, all drives at once"
            )
        variance = max(float(combination @ self.covariance @ combination), 0.0)
        value = float(combination @ self.values)
        return Estimate.single(value, float(np.sqrt(variance)), self.degrees_of_freedom(combination))

    def degrees_of_freedom(self, combination: Floats) -> float:
        """Of the variance of a combination (p,) [-]: Satterthwaite's, at most blocks - conditions, at least one."""
        gain = combination @ self._inverse
        return _satterthwaite(np.einsum("i,bij,j->b", gain, self._contributions, gain), self.conditions)

    @property
    def excess_variance(self) -> float:
        """What the jackknife finds of the excited unknowns' variance, as a multiple of what white noise leaves [-].

        Its mean over directions that white noise leaves equally uncertain.
        """
        information = np.linalg.pinv(self._inverse, hermitian=True)
        return float(np.trace(self.covariance @ information)) / max(len(self.excited), 1)

    def designed_estimate(self, combination: Floats, residual_rms: Mapping[str, float]) -> Estimate:
        """Of zero, as uncertain as a combination (p,) by the records, were noise white with an rms by row.

        Of the readings nothing is used, so that a record may be of a run that was not made. Raises NotIdentifiable
        where the records do not determine it.
        """
        sums, scale = self._equations.sums, self._equations.scale
        weights = [np.array([residual_rms[row] for row in one.record.rows]) ** -2.0 for one in sums]
        parts = [one.reduced(weights=own)[0][0] for one, own in zip(sums, weights, strict=True)]
        matrix = np.sum(parts, axis=0) + np.diag(self._equations.prior)
        sizes, turned = np.linalg.eigh(matrix / np.outer(scale, scale))
        own, kept = turned.T @ (combination / scale), sizes > RANK_LIMIT**2 * sizes[-1]
        if np.abs(own[~kept]).max(initial=0.0) > _OUTSIDE * np.abs(own).max():
            raise NotIdentifiable("these records do not determine it: their motions do not excite it")
        gain = (turned[:, kept] @ (own[kept] / sizes[kept])) / scale
        shares: dict[tuple[str | int, int], float] = defaultdict(float)
        for r, one in enumerate(sums):
            for label, block in zip(one.labels, one.contributions(), strict=True):
                shares[one.record.motion or r, int(label)] += float(gain @ block @ gain)
        freedom = _satterthwaite(np.array(list(shares.values())), self.conditions)
        return Estimate.single(0.0, float(np.sqrt(np.sum(own[kept] ** 2 / sizes[kept]))), freedom)

    def gains(self, combinations: Floats) -> list[Floats]:
        """By record: how much combinations (c, p) [-] rise by what a reading is more, weights fixed, (n, rows, c)."""
        solution = combinations @ self._inverse
        return [one.gains(solution) for one in self._equations.sums]

    def explained(self) -> list[Floats]:
        """By record: what unknowns and nuisances explain of the readings, (n, rows) [as the readings]."""
        return [np.asarray(one.design @ one.with_nuisances(self.values)) for one in self._equations.sums]

    def residual(self) -> list[Floats]:
        """By record: what unknowns and nuisances leave of the readings, zero where these do not count, (n, rows)."""
        records = (one.record for one in self._equations.sums)
        return [(r.readings - made) * r.used for r, made in zip(records, self.explained(), strict=True)]


def fit(
    records: Sequence[RegressionRecord],
    prior: Floats | None = None,
    one_scale: int = 0,
    least_blocks: int = LEAST_BLOCKS,
    conditions: int | None = None,
) -> RegressionFit:
    """Weighted least squares of records.

    ``prior`` (p,) is how surely each unknown is zero, 1 / variance times the samples that noise of the records lasts;
    zero where nothing is known. The first ``one_scale`` unknowns are of one kind: one excited far less than the others
    counts as not excited. ``conditions`` of the unknowns are balance conditions (default: those of one kind). Raises
    DataError with fewer than ``least_blocks`` blocks, NotIdentifiable with no motion.
    """
    equations = _Equations(records, prior, one_scale)
    equations.weigh()
    without = equations.without_each_block()
    count = len(without)
    if count < least_blocks:
        raise DataError(
            f"an interval needs {least_blocks} blocks of the record to leave out in turn: there are {count}; give "
            "longer or more runs"
        )
    found = equations.solve()
    spread = equations.solve_each(without).values - found.values
    covariance = (count - 1) / count * spread.T @ spread
    left = equations.residual_squares(found.values)
    whole = sum(one.residual_squares(np.zeros(one.size)).sum() for one in equations.sums)
    unexplained = float(np.sqrt(sum(left.values()) / max(whole, 1e-300)))
    rms = {row: float(np.sqrt(left[row] / max(equations.samples[row], 1.0))) for row in left}
    contributions = equations.contributions(without)
    return RegressionFit(
        found.values,
        covariance,
        found.excited,
        rms,
        unexplained,
        one_scale if conditions is None else conditions,
        equations,
        found.inverse,
        contributions,
    )


def _satterthwaite(shares: Floats, conditions: int) -> float:
    """Degrees of freedom of a variance to which blocks contribute shares (blocks,), at least one."""
    squares = float(np.sum(shares**2))
    effective = float(shares.sum()) ** 2 / squares - 1.0 if squares > 0.0 else 1.0
    return max(min(effective, float(len(shares) - conditions)), 1.0)


def least_squares(record: RegressionRecord) -> Floats:
    """The same unknowns (p,) [own unit each] without intervals."""
    equations = _Equations([record], None, 0)
    equations.weigh()
    return equations.solve().values


@dataclass(frozen=True)
class _Solution:
    """Equations solved, once or for each of several choices of blocks."""

    values: Floats
    inverse: Floats
    kept: "np.typing.NDArray[np.bool_]"
    """Which of the directions are excited."""
    directions: Floats

    @property
    def excited(self) -> Floats:
        """Orthonormal combinations that are, (excited, p)."""
        return self.directions[self.kept]


class _Equations:
    """All records together, with the weights of their rows."""

    def __init__(self, records: Sequence[RegressionRecord], prior: Floats | None, one_scale: int) -> None:
        self.sums = [_RecordSums(record) for record in records]
        self.prior = np.zeros(self.sums[0].size) if prior is None else prior
        self.one_scale = one_scale
        self.samples = self._by_row([one.samples for one in self.sums])
        self.square = self._by_row([one.square for one in self.sums])
        if not np.sum([one.lengths() for one in self.sums], axis=0)[: one_scale or None].any():
            raise NotIdentifiable(
                "nothing that is measured depends on a first moment: nothing moves, or the sensors cannot see one, as "
                "the torque about an axis along gravity; give runs that move, or another source"
            )
        self._share_weights({row: self._weight(row, square) for row, square in self.square.items()})

    def weigh(self) -> None:
        """Weights of the rows by what they leave, 1 / mean square, over all records of a row."""
        for _ in range(_REWEIGHTINGS):
            left, before = self.residual_squares(self.solve().values), self.weights
            self._share_weights({row: self._weight(row, square) for row, square in left.items()})
            if all(abs(self.weights[row] - old) <= _SETTLED * old for row, old in before.items()):
                break

    def _weight(self, row: str, square: float) -> float:
        """Of a row whose residual has this sum of squares."""
        least = _EXACT**2 * max(self.square[row], _EXACT**2 * sum(self.square.values()), 1e-100)
        return self.samples[row] / max(square, least)

    def _share_weights(self, weights: Mapping[str, float]) -> None:
        """Give each row its weight; the columns' lengths (p,) follow, one for the first, which are of one kind."""
        self.weights = weights
        for one in self.sums:
            one.weights = np.array([weights[row] for row in one.record.rows])
        scale = np.sqrt(np.sum([one.lengths() for one in self.sums], axis=0) + self.prior)
        scale[: self.one_scale] = scale[: self.one_scale].max(initial=0.0)
        self.scale: Floats = np.where(scale > 0.0, scale, 1.0)

    def residual_squares(self, values: Floats) -> dict[str, float]:
        """By row, over all records."""
        return self._by_row([one.residual_squares(values) for one in self.sums])

    def _by_row(self, each: Sequence[Floats]) -> dict[str, float]:
        found: dict[str, float] = defaultdict(float)
        for one, values in zip(self.sums, each, strict=True):
            for row, value in zip(one.record.rows, values, strict=True):
                found[row] += float(value)
        return dict(found)

    def without_each_block(self) -> list[dict[int, int]]:
        """What is left out in turn: blocks by record, of repeats of one motion together."""
        found: dict[tuple[str | int, int], dict[int, int]] = defaultdict(dict)
        for r, one in enumerate(self.sums):
            for place, label in enumerate(one.labels):
                found[one.record.motion or r, int(label)][r] = place
        return list(found.values())

    def solve(self) -> _Solution:
        """All records together."""
        one = self.solve_each([{}])
        return _Solution(one.values[0], one.inverse[0], one.kept[0], one.directions[0])

    def solve_each(self, left_out: Sequence[Mapping[int, int]]) -> _Solution:
        """The same without each choice of blocks by record, (choices, ...)."""
        both = [one.reduced([skip.get(r) for skip in left_out]) for r, one in enumerate(self.sums)]
        unit = np.outer(self.scale, self.scale)
        u, sizes, rows = np.linalg.svd((np.sum([m for m, _ in both], axis=0) + np.diag(self.prior)) / unit)
        kept = sizes > RANK_LIMIT**2 * sizes[:, :1]
        per_size = np.where(kept, 1.0 / np.where(kept, sizes, 1.0), 0.0)
        inverse = (rows.transpose(0, 2, 1) * per_size[:, None]) @ u.transpose(0, 2, 1) / unit
        vector = np.sum([v for _, v in both], axis=0)
        return _Solution((inverse @ vector[:, :, None])[:, :, 0], inverse, kept, rows)

    def contributions(self, without: Sequence[Mapping[int, int]]) -> Floats:
        """Of what is left out in turn to the covariance of the equations' vector, (blocks, p, p)."""
        added = [one.contributions() for one in self.sums]
        return np.array([sum(added[r][place] for r, place in skip.items()) for skip in without])


def _sums(left: Floats, right: Floats, readings: Floats, parts: Sequence[Indices]) -> tuple[Floats, Floats]:
    """Sums of l' r (blocks, rows, m, m) and l' y (blocks, rows, m)."""
    rows = range(readings.shape[1])
    matrix = np.array([[left[p, j].T @ right[p, j] for j in rows] for p in parts])
    return matrix, np.array([[left[p, j].T @ readings[p, j] for j in rows] for p in parts])


def _least_norm(matrix: Floats, right: Floats) -> Floats:
    """Least squares of nuisances, which may repeat each other, (k, c)."""
    return _pseudo_inverse(matrix) @ right


def _pseudo_inverse(matrix: Floats) -> Floats:
    """Of equations of nuisances, which are symmetric, (..., k, k); the inverse where all have one, which is quicker."""
    with suppress(np.linalg.LinAlgError):
        found = np.linalg.inv(matrix)
        sizes = (np.abs(one).sum(axis=-1).max(axis=-1, initial=0.0) for one in (matrix, found))
        if (np.prod([*sizes], axis=0) < _INVERTED).all():
            return np.asarray(found)
    return np.asarray(np.linalg.pinv(matrix, rcond=RANK_LIMIT**2, hermitian=True))
