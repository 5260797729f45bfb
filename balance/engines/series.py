"""Orders of the reciprocating force: -s'' / r = Re sum_k c_k e^(i k theta)."""

import numpy as np

from .slidercrank import SliderCrank

_SAMPLES = 8192


def exact(crank: SliderCrank, orders: int = 8) -> dict[int, complex]:
    """Coefficients c_1 ... of the exact motion, by the discrete Fourier transform of a whole turn."""
    theta = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    spectrum = np.fft.rfft(crank.reciprocation(theta)) * 2.0 / _SAMPLES
    return {k: complex(spectrum[k]) for k in range(1, orders + 1)}


def second_order(crank: SliderCrank) -> dict[int, complex]:
    """The usual approximation: c_1 = 1 - i e / l, c_2 = r / l, from s = r cos theta + l - w^2 / (2 l)."""
    return {1: 1.0 - 1j * crank.offset / crank.rod_length, 2: complex(crank.ratio)}
