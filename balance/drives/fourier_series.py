"""Functions of the crank angle with period 2 pi, as Fourier series: of smooth ones exact to rounding error."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..arrays import Complexes, Floats, frozen


@dataclass(frozen=True)
class Periodic:
    """Several functions f(phi) = Re sum_k c_k exp(i k phi) that share their harmonics."""

    coefficients: Complexes
    """c_k of each function, k = 0, 1, ..., (functions, harmonics + 1)."""

    @classmethod
    def through(cls, samples: Floats) -> "Periodic":
        """Through equidistant samples of one turn, its end excluded, (functions, n) [unit of each function]."""
        count = samples.shape[1]
        coefficients = np.fft.rfft(samples, axis=1)[:, : (count + 1) // 2] * (2.0 / count)
        coefficients[:, 0] /= 2.0
        return cls(coefficients)

    @property
    def harmonics(self) -> int:
        """Highest harmonic kept."""
        return self.coefficients.shape[1] - 1

    @cached_property
    def _orders(self) -> Complexes:
        return 1j * np.arange(self.harmonics + 1)

    def __call__(self, phi: Floats | float) -> Floats:
        """Values at angles phi of any shape [rad], (functions, *shape of phi) [unit of each function]."""
        waves = np.exp(np.multiply.outer(self._orders, phi)).reshape(self.harmonics + 1, -1)
        return np.real(self.coefficients @ waves).reshape(-1, *np.shape(phi))

    def slope(self) -> "Periodic":
        """Derivatives by phi."""
        return Periodic(self.coefficients * self._orders)

    def tail(self) -> float:
        """Largest coefficient in the last eighth of the harmonics, of each function relative to its largest."""
        last = self.coefficients[:, -max(2, self.harmonics // 8) :]
        size = np.abs(self.coefficients).max(axis=1)
        return float((np.abs(last).max(axis=1) / np.where(size > 0.0, size, 1.0)).max())

    def trimmed(self, tol: float = 1e-17) -> "Periodic":
        """Without the highest harmonics whose coefficients are all below ``tol`` of the largest of their function."""
        size = np.abs(self.coefficients)
        relative = (size / np.maximum(size.max(axis=1, keepdims=True), 1e-300)).max(axis=0)
        last = int(np.flatnonzero(relative > tol).max(initial=0))
        return Periodic(self.coefficients[:, : last + 1])


def odd_grid(harmonics: int) -> Floats:
    """Equidistant angles of one turn for so many harmonics, (2 harmonics + 1,) [rad]."""
    return 2.0 * np.pi * np.arange(2 * harmonics + 1) / (2 * harmonics + 1)


@lru_cache(maxsize=8)
def differentiation(harmonics: int) -> Floats:
    """Matrix from samples on ``odd_grid`` to samples of the derivative of their series, (n, n) [1/rad].

    D_jk = (-1)^(j-k) / (2 sin((phi_j - phi_k) / 2)) off the diagonal.
    """
    count = 2 * harmonics + 1
    steps = np.arange(1, count)
    first = np.r_[0.0, 0.5 * (-1.0) ** steps / np.sin(-np.pi * steps / count)]
    rows, columns = np.ogrid[:count, :count]
    return frozen(first[(columns - rows) % count])
