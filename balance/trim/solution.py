"""Least squares of records on the balance conditions: values, their covariance, and how readings move them."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..conditions import Conditions
from ..errors import DataError
from ..observability import NotObservable
from .imbalance import Free, Imbalance
from .record import Record, Sums, weigh

RANK_LIMIT = 1e-6
"""Singular value of the conditions' columns, scaled alike, below which a direction is not excited."""
_REWEIGHTINGS = 3


@dataclass(frozen=True)
class Fit:
    """What records say of the conditions, and of what else is unknown."""

    imbalance: Imbalance
    shared: Floats
    """What else is unknown and the same in all records, (shared,); least where it is not excited."""
    gains: tuple[Floats, ...]
    """By record: how much each condition's value rises by what a reading is more, weights and excitation as they are,
    (n, rows, rank)."""
    explained: tuple[Floats, ...]
    """By record: what the unknowns explain of the measured, less what was held, (n, rows)."""


def measure(records: Sequence[Record], conditions: Conditions, free: Free | None = None) -> Imbalance:
    """Values of the conditions from records. Raises DataError with too few stretches, NotObservable with no motion."""
    return fit(records, conditions, free).imbalance


def fit(
    records: Sequence[Record], conditions: Conditions, free: Free | None = None, prior: Floats | None = None
) -> Fit:
    """The whole of what records say. Raises DataError with too few stretches, NotObservable with no motion.

    ``prior`` (shared,) is how surely what else is unknown is zero, each 1 / variance times the samples that noise of
    the records lasts; zero where nothing is known of it.
    """
    free = free or Free.all(conditions)
    size = len(free.directions)
    records = [free.of(record) for record in records]
    scale = _scales(records, size)
    sums = [Sums(record, scale) for record in records]
    known = np.zeros(len(scale)) if prior is None else np.r_[np.zeros(size), prior] / scale**2
    excited, values, inverse = _solved(*_equations(sums, known))
    for _ in range(_REWEIGHTINGS):
        weigh(sums, values)
        excited, values, inverse = _solved(*_equations(sums, known))
    without = [_equations(sums, known, skip) for skip in _stretches(sums)]
    left_out = np.array([_solved(*equations)[1] for equations in without])
    count = len(left_out)
    if count <= size + 2:
        raise DataError(f"an interval needs more than {size + 2} stretches of the record: there are {count}")
    spread = ((left_out - values) / scale)[:, :size] @ free.directions
    covariance = (count - 1) / count * spread.T @ spread
    left = sum(one.left(values) for one in sums) / sum(one.whole for one in sums)
    found = free.start + (values / scale)[:size] @ free.directions
    own = free.directions.T @ (inverse / scale[:, None])[:size]
    whole = _equations(sums, known)[0]
    added = np.array([own @ (whole - matrix) @ own.T for matrix, _ in without])
    measured = Imbalance(
        conditions, found, covariance, count - size, free, excited, float(np.sqrt(max(left, 0.0))), covariance, added
    )
    gains, explained = tuple(one.gain(own) for one in sums), tuple(one.explained(values) for one in sums)
    return Fit(measured, (values / scale)[size:], gains, explained)


def _scales(records: Sequence[Record], rank: int) -> Floats:
    """What each unknown is multiplied by: one number for all conditions, so that an excited direction stays one."""
    scale = np.sqrt(sum(np.sum(r.columns**2, axis=(0, 1)) for r in records) / sum(len(r.force) for r in records))
    if not scale[:rank].max() > 0.0:
        raise NotObservable("nothing moves in this record: it determines no first moment")
    scale[:rank] = scale[:rank].max()
    scale[scale == 0.0] = 1.0
    return np.asarray(scale)


def _stretches(sums: Sequence[Sums]) -> list[dict[int, int]]:
    """What is left out in turn: stretches by record, of repeats of one motion together."""
    found: dict[tuple[str | int, int], dict[int, int]] = defaultdict(dict)
    for r, one in enumerate(sums):
        for block in range(len(one.matrix)):
            found[one.motion or r, block][r] = block
    return list(found.values())


def _equations(sums: Sequence[Sums], known: Floats, skip: Mapping[int, int] | None = None) -> tuple[Floats, Floats]:
    """Matrix and vector of all records together, a stretch of some left out."""
    left_out = skip or {}
    both = [one.reduced(left_out.get(r)) for r, one in enumerate(sums)]
    matrix, vector = np.sum([m for m, _ in both], axis=0) + np.diag(known), np.sum([v for _, v in both], axis=0)
    return 0.5 * (matrix + matrix.T), vector


def _solved(matrix: Floats, vector: Floats) -> tuple[Floats, Floats, Floats]:
    """Excited combinations, values and the inverse of equations."""
    sizes, directions = np.linalg.eigh(matrix)
    kept = sizes > RANK_LIMIT**2 * sizes[-1]
    excited = directions[:, kept]
    return excited.T, excited @ ((excited.T @ vector) / sizes[kept]), (excited / sizes[kept]) @ excited.T
