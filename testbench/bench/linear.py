"""A linear system y' = A y + B w from rest, exact where w is linear between samples."""

from functools import lru_cache

import numpy as np

from balance.arrays import Floats

BLOCK = 128
"""Samples a block: about the square root of the samples of a run."""
_ROWS = 1024
"""Rows in one product, so few that BLAS stays on one thread: more threads cost more here than they bring."""


def respond(a: Floats, b: Floats, driven: Floats, step: float) -> Floats:
    """States (n, ..., k) of y' = A y + B w from rest; ``driven`` is w, (n, ..., m), sampled every ``step`` [s].

    y[i+1] = P y[i] + Q0 w[i] + Q1 w[i+1], from the exponential of the system with w and its slope appended.
    """
    phi, now, after = _propagator(a.tobytes(), b.tobytes(), len(a), step)
    state = np.zeros((*driven.shape[:-1], len(a)))
    state[1:] = times(now, driven[:-1]) + times(after, driven[1:])
    return _accumulated(phi, state)


def times(matrix: Floats, vectors: Floats) -> Floats:
    """Matrix (j, k) times each of ``vectors`` (..., k), (..., j)."""
    rows = np.ascontiguousarray(vectors).reshape(-1, matrix.shape[1])
    found, across = np.empty((len(rows), len(matrix))), np.ascontiguousarray(matrix.T)
    for begin in range(0, len(rows), _ROWS):
        np.matmul(rows[begin : begin + _ROWS], across, out=found[begin : begin + _ROWS])
    return found.reshape(*vectors.shape[:-1], len(matrix))


def _accumulated(phi: Floats, pushes: Floats) -> Floats:
    """y[i] = P y[i-1] + push[i] for all i: within all blocks at once, then from block to block."""
    size, blocks = phi.shape[0], -(-len(pushes) // BLOCK)
    held = np.zeros((blocks * BLOCK, pushes.size // (len(pushes) * size), size))
    held[: len(pushes)] = pushes.reshape(len(pushes), -1, size)
    held = held.reshape(blocks, BLOCK, -1, size)
    powers = [phi]
    for i in range(1, BLOCK):
        held[:, i] += times(phi, held[:, i - 1])
        powers.append(powers[-1] @ phi)
    carried = held[:, -1].copy()
    for k in range(1, blocks):
        carried[k] += carried[k - 1] @ powers[-1].T
    for i, power in enumerate(powers):
        held[1:, i] += times(power, carried[:-1])
    return held.reshape(-1, *pushes.shape[1:])[: len(pushes)]


@lru_cache(maxsize=64)
def _propagator(a_bytes: bytes, b_bytes: bytes, size: int, step: float) -> tuple[Floats, Floats, Floats]:
    """P, Q0 and Q1 of A (size, size) and B (size, m), which come as their bytes: the same system is asked for often."""
    from scipy.linalg import expm

    a, b = np.frombuffer(a_bytes).reshape(size, size), np.frombuffer(b_bytes).reshape(size, -1)
    inputs = b.shape[1]
    system = np.zeros((size + 2 * inputs,) * 2)
    system[:size, :size], system[:size, size : size + inputs] = a * step, b * step
    system[size : size + inputs, size + inputs :] = np.eye(inputs)
    full = expm(system)
    slope = full[:size, size + inputs :]
    return full[:size, :size], full[:size, size : size + inputs] - slope, slope
