"""What is fitted beside the conditions, the same in all runs: as few columns as say the same."""

from collections.abc import Sequence

import numpy as np

from balance.arrays import Floats

INDEPENDENT = 1e-7
"""Singular value of columns of unit length, relative to the largest, below which a combination is not excited."""
NOTHING = 1e-12
"""Length of a column, relative to the longest, that is rounding."""


def reduction(parts: Sequence[Floats], least: float = INDEPENDENT) -> Floats:
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
