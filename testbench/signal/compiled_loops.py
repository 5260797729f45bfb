"""Loops over samples, compiled: filters of four channels side by side, segments of a spectrum, their power, extremes of
signals in noise.

It imports numba, and is imported only where there is enough to do. LLVM is let join the four channels' operations into
one each (superword-level parallelism, which numba leaves off): that makes the recursion three times as fast.
"""

from typing import Any

import numpy as np
from numba import config, njit
from numpy.typing import NDArray

from balance.compiled_kernels import compiled_by

_usual, config.SLP_VECTORIZE = config.SLP_VECTORIZE, 1

_BLOCK = 2048
"""Samples that one section after the other passes over while they are in the processor's cache."""


@compiled_by(njit, "void(f8[:,::1], f8[:,:,::1], f8[:,::1], b1)", fastmath={"contract"})
def recursion(sections: NDArray[Any], state: NDArray[Any], x: NDArray[Any], backwards: bool) -> None:
    """Filter ``x`` (n, 4) [any unit] in place, direct form II transposed: y = b0 x + p, p = b1 x - a1 y + q,
    q = b2 x - a2 y.

    ``sections`` (s, 6) [-], s even; ``state`` (s, 2, 4) holds p and q of each section and channel. Two sections pass
    over the samples together: one need not wait for the other's last result.
    """
    last, step = len(x) - 1, -1 if backwards else 1
    for begin in range(0, len(x), _BLOCK):
        first = last - begin if backwards else begin
        count = min(_BLOCK, len(x) - begin)
        for s in range(0, len(sections), 2):
            b0, b1, b2, a1, a2 = sections[s, 0], sections[s, 1], sections[s, 2], sections[s, 4], sections[s, 5]
            d0, d1, d2 = sections[s + 1, 0], sections[s + 1, 1], sections[s + 1, 2]
            c1, c2 = sections[s + 1, 4], sections[s + 1, 5]
            p0, p1, p2, p3 = state[s, 0, 0], state[s, 0, 1], state[s, 0, 2], state[s, 0, 3]
            q0, q1, q2, q3 = state[s, 1, 0], state[s, 1, 1], state[s, 1, 2], state[s, 1, 3]
            r0, r1, r2, r3 = state[s + 1, 0, 0], state[s + 1, 0, 1], state[s + 1, 0, 2], state[s + 1, 0, 3]
            t0, t1, t2, t3 = state[s + 1, 1, 0], state[s + 1, 1, 1], state[s + 1, 1, 2], state[s + 1, 1, 3]
            for k in range(count):
                i = first + step * k
                x0, x1, x2, x3 = x[i, 0], x[i, 1], x[i, 2], x[i, 3]
                y0, y1, y2, y3 = b0 * x0 + p0, b0 * x1 + p1, b0 * x2 + p2, b0 * x3 + p3
                p0, p1 = b1 * x0 + q0 - a1 * y0, b1 * x1 + q1 - a1 * y1
                p2, p3 = b1 * x2 + q2 - a1 * y2, b1 * x3 + q3 - a1 * y3
                q0, q1, q2, q3 = b2 * x0 - a2 * y0, b2 * x1 - a2 * y1, b2 * x2 - a2 * y2, b2 * x3 - a2 * y3
                z0, z1, z2, z3 = d0 * y0 + r0, d0 * y1 + r1, d0 * y2 + r2, d0 * y3 + r3
                r0, r1 = d1 * y0 + t0 - c1 * z0, d1 * y1 + t1 - c1 * z1
                r2, r3 = d1 * y2 + t2 - c1 * z2, d1 * y3 + t3 - c1 * z3
                t0, t1, t2, t3 = d2 * y0 - c2 * z0, d2 * y1 - c2 * z1, d2 * y2 - c2 * z2, d2 * y3 - c2 * z3
                x[i, 0], x[i, 1], x[i, 2], x[i, 3] = z0, z1, z2, z3
            state[s, 0, 0], state[s, 0, 1], state[s, 0, 2], state[s, 0, 3] = p0, p1, p2, p3
            state[s, 1, 0], state[s, 1, 1], state[s, 1, 2], state[s, 1, 3] = q0, q1, q2, q3
            state[s + 1, 0, 0], state[s + 1, 0, 1], state[s + 1, 0, 2], state[s + 1, 0, 3] = r0, r1, r2, r3
            state[s + 1, 1, 0], state[s + 1, 1, 1], state[s + 1, 1, 2], state[s + 1, 1, 3] = t0, t1, t2, t3


@compiled_by(njit, "void(f8[::1], i8, f8[::1], f8[:,::1])", fastmath={"contract", "reassoc", "nsz"})
def windowed(values: NDArray[Any], first: int, window: NDArray[Any], block: NDArray[Any]) -> None:
    """Fill ``block`` (k, n) [unit of values] with segments of ``values`` (m,) from sample ``first`` on.

    They overlap by half; each has its mean taken off and is multiplied by ``window`` (n,) [-].
    """
    length = len(window)
    for row in range(len(block)):
        segment = values[first + row * (length // 2) : first + row * (length // 2) + length]
        total = 0.0
        for i in range(length):
            total += segment[i]
        mean = total / length
        for i in range(length):
            block[row, i] = (segment[i] - mean) * window[i]


@compiled_by(njit, "void(c16[:,::1], f8[::1])", fastmath={"contract"})
def add_power(spectra: NDArray[Any], power: NDArray[Any]) -> None:
    """Add |X|^2 of every row of ``spectra`` (k, m) [unit] to ``power`` (m,) [unit^2]."""
    for row in range(len(spectra)):
        for i in range(len(power)):
            power[i] += spectra[row, i].real ** 2 + spectra[row, i].imag ** 2


@compiled_by(njit, "void(f4[:,::1], i8[::1], f4, f4[:,:], f4[:,::1])")
def raise_highest(
    noise: NDArray[Any], at: NDArray[Any], sign: float, levels: NDArray[Any], found: NDArray[Any]
) -> None:
    """Raise ``found`` (k, draws) to the largest of ``levels`` (k, m) with ``sign`` times ``noise[at]`` (m, draws)."""
    for i in range(len(at)):
        row = noise[at[i]]
        for k in range(len(levels)):
            level, highest = levels[k, i], found[k]
            for d in range(len(row)):
                value = sign * row[d] + level
                highest[d] = value if value > highest[d] else highest[d]


@compiled_by(njit, "void(f4[:,::1], i8[::1], f4, f4[:,:], f4[::1], f8[:,::1])")
def add_excess(
    noise: NDArray[Any], at: NDArray[Any], sign: float, levels: NDArray[Any], raised: NDArray[Any], found: NDArray[Any]
) -> None:
    """Add to ``found`` (k, draws) squares of what ``levels`` (k, m), ``sign`` times ``noise[at]`` (m, draws) and what
    is ``raised`` (draws,) are together above zero."""
    total = np.zeros(found.shape, np.float32)
    for i in range(len(at)):
        row = noise[at[i]]
        for k in range(len(levels)):
            level, sums = levels[k, i], total[k]
            for d in range(len(row)):
                value = sign * row[d] + raised[d] + level
                value = value if value > np.float32(0.0) else np.float32(0.0)
                sums[d] += value * value
    for k in range(len(found)):
        for d in range(found.shape[1]):
            found[k, d] += total[k, d]


@compiled_by(njit, "void(f8[:,::1], i8, f8[:,:,::1])", fastmath={"contract", "reassoc", "nsz"})
def lagged_products(rows: NDArray[Any], count: int, products: NDArray[Any]) -> None:
    """Fill ``products`` (k, m, m) with the sums over ``count`` samples t of x[t + i] x[t + j] of each of ``rows``."""
    size = products.shape[1]
    for k in range(len(rows)):
        x, found = rows[k], products[k]
        for lag in range(size):
            total = 0.0
            for t in range(count):
                total += x[t] * x[t + lag]
            found[0, lag] = found[lag, 0] = total
        for i in range(size - 1):
            for j in range(i, size - 1):
                found[i + 1, j + 1] = found[i, j] + x[count + i] * x[count + j] - x[i] * x[j]
                found[j + 1, i + 1] = found[i + 1, j + 1]


@compiled_by(njit, "void(f8[:,::1], f8[:,::1], f8[:,::1])", fastmath={"contract"})
def predicted(rows: NDArray[Any], weights: NDArray[Any], found: NDArray[Any]) -> None:
    """Add to ``found`` (k, n - m) what ``weights`` (k, m) of the samples before each make of ``rows`` (k, n)."""
    for k in range(len(rows)):
        x, sums = rows[k], found[k]
        for i in range(weights.shape[1]):
            weight = weights[k, i]
            for t in range(len(sums)):
                sums[t] += weight * x[t + i]


config.SLP_VECTORIZE = _usual
