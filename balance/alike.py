"""Errors that all readings of a run share: a tachometer that comes late turns the phases of all sensors alike.

Each such error is a mode of its own; what it does to the coefficients of different rows belongs together.
"""

import numpy as np

from .arrays import Floats
from .rotors.moduli import Complexes


def changes(readings: Complexes, deviations: Floats) -> Complexes:
    """Change of the readings (runs, rows) by one standard deviation of each mode, (modes, runs, rows).

    ``deviations`` (modes, runs, rows) turn the phases of the readings [rad].
    """
    return 1j * deviations * readings


def of_coefficients(inverse: Complexes, changed: Complexes) -> Floats:
    """Change of each row's (Re v0, Re alpha_1, ..., Im v0, Im alpha_1, ...), (modes, rows, 2 planes + 2)."""
    coefficients = np.swapaxes(inverse @ changed, 1, 2)
    return np.concatenate([coefficients.real, coefficients.imag], axis=2)


def covariance(modes: Floats) -> Floats:
    """Of each row's coefficients by all modes, (rows, 2 planes + 2, 2 planes + 2)."""
    found: Floats = np.einsum("mri,mrj->rij", modes, modes)
    return found


def of_weights(slopes: Floats, modes: Floats) -> Floats:
    """Covariance of the weights (2 planes, 2 planes), rows together; ``slopes`` (rows, 2 planes, 2 planes + 2)."""
    moved = np.einsum("rpi,mri->mp", slopes, modes)
    found: Floats = moved.T @ moved
    return found
