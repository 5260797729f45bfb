"""A linear system y' = A y + B w from rest, exact where w is linear between samples."""

import numpy as np

from balance.arrays import Floats


def respond(a: Floats, b: Floats, driven: Floats, step: float) -> Floats:
    """States (n, k) of y' = A y + B w from rest; ``driven`` is w, (n, m), sampled every ``step`` [s].

    y[i+1] = P y[i] + Q0 w[i] + Q1 w[i+1], from the exponential of the system with w and its slope appended.
    """
    phi, now, after = _propagator(a, b, step)
    state = np.zeros((len(driven), len(a)))
    state[1:] = driven[:-1] @ now.T + driven[1:] @ after.T
    return _accumulated(phi, state)


def _accumulated(phi: Floats, pushes: Floats) -> Floats:
    """y[i] = P y[i-1] + push[i] for all i by doubling: after pass j each sample holds the pushes of 2**j steps."""
    shift = 1
    while shift < len(pushes):
        pushes[shift:] += pushes[:-shift] @ phi.T
        phi = phi @ phi
        shift *= 2
    return pushes


def _propagator(a: Floats, b: Floats, step: float) -> tuple[Floats, Floats, Floats]:
    from scipy.linalg import expm

    size, inputs = b.shape
    system = np.zeros((size + 2 * inputs,) * 2)
    system[:size, :size], system[:size, size : size + inputs] = a * step, b * step
    system[size : size + inputs, size + inputs :] = np.eye(inputs)
    full = expm(system)
    slope = full[:size, size + inputs :]
    return full[:size, :size], full[:size, size : size + inputs] - slope, slope
