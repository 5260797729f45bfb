"""The runs of one mounting as records of one least squares: other unknowns are made independent over all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.estimation.regression import RegressionRecord

from ..recording import Finding
from .force_regression import equal_blocks

INDEPENDENT = 1e-7
"""Singular value of columns of unit length, relative to the largest, below which a combination is not excited."""
NOTHING = 1e-12
"""Length of a column, relative to the longest, that is rounding."""


@dataclass(frozen=True)
class RunRegression:
    """One run: readings = own @ conditions + others @ (unknowns of all runs) + nuisance @ (unknowns of this run)."""

    own: Floats
    """Columns of the conditions, (n, channels, rank)."""
    others: Floats
    """Columns of what else is unknown and the same in all runs, (n, channels, p)."""
    readings: Floats
    """The readings, (n, channels) [N m, m/s2]."""
    nuisance: Floats
    """Offsets, delays: of this run alone, (n, channels, k)."""
    used: Floats
    """One where a reading counts, else zero, (n, channels)."""
    rows: tuple[str, ...]
    """Names of the channels."""
    shortest: float
    """Block of the jackknife [samples]."""
    motion: str
    findings: tuple[Finding, ...] = ()
    """What was left out of the run."""


def shared_unknowns(parts: Sequence[RunRegression]) -> Floats:
    """The combinations (p, k) of what else is unknown that the runs together excite."""
    return excited_combinations([part.others for part in parts])


def regression_records(parts: Sequence[RunRegression], combinations: Floats | None = None) -> list[RegressionRecord]:
    """The parts as records, their shared columns reduced to those combinations: all that they together excite."""
    turned = shared_unknowns(parts) if combinations is None else combinations
    return [
        RegressionRecord.of(
            np.concatenate([part.own, part.others @ turned], axis=2),
            part.readings,
            equal_blocks(part.own, part.shortest),
            part.nuisance,
            part.used,
            motion=part.motion,
            rows=part.rows,
        )
        for part in parts
    ]


def excited_combinations(parts: Sequence[Floats], least: float = INDEPENDENT) -> Floats:
    """The matrix (p, k) that turns columns (n, rows, p) of runs into the combinations that they together excite.

    ``least`` is the singular value of columns of unit length, relative to the largest, that counts.
    """
    length = np.sqrt(sum(np.sum(part**2, axis=(0, 1)) for part in parts))
    used = np.flatnonzero(length > NOTHING * length.max(initial=0.0))
    stacked = np.concatenate([part[:, :, used].reshape(-1, len(used)) for part in parts])
    values, rows = np.linalg.svd(np.linalg.qr(stacked / length[used], mode="r"))[1:]
    kept = rows[: int(np.count_nonzero(values > least * values.max(initial=0.0)))]
    turned = np.zeros((len(length), len(kept)))
    turned[used] = (kept / length[used]).T
    return turned
