"""Analogue filters, as they answer a signal that is linear between its samples; at rest before the first."""

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import linear_response


def low_pass(signal: Floats, corner: float, step: float) -> Floats:
    """Butterworth of fourth order, two sections w^2 / (s^2 + s w / Q + w^2), (n, ...); ``corner`` [Hz]."""
    omega, rest, passed = 2.0 * np.pi * corner, signal[0], signal - signal[0]
    for angle in (np.pi / 8.0, 3.0 * np.pi / 8.0):
        section = np.array([[0.0, 1.0], [-(omega**2), -2.0 * np.cos(angle) * omega]])
        passed = linear_response(section, np.array([[0.0], [omega**2]]), passed[..., None], step)[..., 0]
    return passed + rest


def high_pass(signal: Floats, corner: float, step: float) -> Floats:
    """First order, as of AC coupling or a charge amplifier: s / (s + w), (n, ...); zero at the first sample."""
    omega, moved = 2.0 * np.pi * corner, signal - signal[0]
    return moved - linear_response(np.array([[-omega]]), np.array([[omega]]), moved[..., None], step)[..., 0]
