"""Arrays and how they are worked on: types for annotations, blocks in parallel, convex programmes, silent solvers."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Array of real numbers, double precision; shape and unit are in the docstring."""
Complexes = NDArray[np.complexfloating]
"""Array of complex numbers."""
Indices = NDArray[np.intp]
"""Array of positions."""
Mask = NDArray[np.bool_]
"""Array of truth values."""


def frozen(array: Floats) -> Floats:
    """The same array (...,), in any unit [SI], read-only from now on."""
    array.setflags(write=False)
    return array


def root_mean_square(values: Floats | Complexes) -> float:
    """Of all values (...,) [any unit], or of their moduli."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def upper_median(values: Floats) -> float:
    """Median of values (n,) [any unit], the upper of two; numpy's takes several times as long.

    Unlike there, a NaN counts as larger than any number, and of no values it raises IndexError.
    """
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])


def parabola_peak(values: Floats, k: int, periodic: bool = False) -> tuple[float, float]:
    """The vertex of the parabola through a peak of samples (n,) [any unit], sample ``k``, and its two neighbours.

    Its distance from sample ``k`` [samples], half of one at most, and its value; sample ``k`` itself at an end, unless
    the samples are ``periodic``. Of a trough: the negative samples.
    """
    if not periodic and not 0 < k < len(values) - 1:
        return 0.0, float(values[k])
    before, top, after = values[k - 1], values[k], values[(k + 1) % len(values)]
    offset = 0.5 * np.clip((before - after) / min(before - 2.0 * top + after, -1e-300), -1.0, 1.0)
    return float(offset), float(top - 0.25 * (before - after) * offset)


BLOCK = 4096
"""Samples in a block: so few that they stay in the processor's cache."""

T = TypeVar("T")


def parallel_blocks(count: int, work: Callable[[slice], T]) -> Iterator[T]:
    """Call ``work`` on each block of samples, on all cores at once (NumPy releases the lock); results in order."""
    parts = [slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
    if len(parts) < 2:
        yield from map(work, parts)
        return
    from concurrent.futures import ThreadPoolExecutor  # late: few samples do without it

    with ThreadPoolExecutor(max_workers=min(len(parts), os.cpu_count() or 1)) as pool:
        yield from pool.map(work, parts)


@contextmanager
def stdout_discarded() -> Iterator[None]:
    """Discard what compiled code writes to standard output: HiGHS writes there even when set to be silent.

    A command with ``--json`` prints one document on standard output and nothing else.
    """
    sys.stdout.flush()
    stdout = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(stdout, 1)
        os.close(stdout)
        os.close(nowhere)


Cones = Sequence[tuple[str, int]]
"""Kind (``Zero``, ``Nonnegative``, ``SecondOrder``, ``PSDTriangle``) and size of each cone, of the last its side."""


def conic_optimum(
    cost: Floats, rows: Floats, right: Floats, cones: Cones, tolerance: float, quadratic: Floats | None = None
) -> Any:  # noqa: ANN401
    """Clarabel's solution of the convex programme: least cost @ x + x' quadratic x / 2, right - rows @ x in the cones.

    ``cost`` (n,), ``rows`` (m, n) and ``right`` (m,), in the order of the cones, near one in size [-]; of ``quadratic``
    (n, n) the upper triangle counts. Its status is the caller's to judge.
    """
    import clarabel  # late: most sizes are found without it
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    square = sparse.csc_matrix((len(cost), len(cost)) if quadratic is None else np.triu(quadratic))
    sets = [getattr(clarabel, f"{kind}ConeT")(size) for kind, size in cones]
    return clarabel.DefaultSolver(square, cost, sparse.csc_matrix(rows), right, sets, settings).solve()


def packed_triangle(matrices: Floats) -> Floats:
    """Symmetric matrices (..., k, k) [any unit] as a cone ``PSDTriangle`` takes them, (..., k (k + 1) / 2).

    Upper triangles, column by column, entries off the diagonal times sqrt(2).
    """
    columns, rows = np.tril_indices(matrices.shape[-1])
    return np.asarray(matrices[..., rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0)))
