"""Random signals of a stated power spectral density, and the vibration that floors may have.

All densities are one-sided; a signal is one period of a stationary Gaussian process, made on its Fourier lines.
"""

import numpy as np

from balance.arrays import Floats

FLOOR_VELOCITY = {
    "workshop": 800e-6, "office": 400e-6, "residential": 200e-6, "operating theatre": 100e-6,
    "VC-A": 50e-6, "VC-B": 25e-6, "VC-C": 12.5e-6, "VC-D": 6.25e-6, "VC-E": 3.12e-6,
}  # fmt: skip
"""Root mean square in each third-octave band from 8 to 80 Hz [m/s]: generic vibration criteria, Amick et al., "Evolving
criteria for research facilities", Proc. SPIE 5933 (2005), table 1."""
FLOOR_BAND = (4.0, 8.0, 80.0)
"""Below the second, the curves down to VC-B allow the acceleration at it; outside, nothing is added [Hz]."""
THIRD_OCTAVE = 2.0 ** (1.0 / 6.0) - 2.0 ** (-1.0 / 6.0)
"""Width of a third-octave band, per its centre."""


def lines(density: Floats, rng: np.random.Generator, count: int, step: float) -> np.ndarray:
    """Fourier lines, as irfft takes them, of ``count`` samples every ``step`` [s]; ``density`` [unit2/Hz] a line."""
    normal = rng.normal(size=(*density.shape, 2))
    return np.sqrt(density * count / (4.0 * step)) * (normal[..., 0] + 1j * normal[..., 1])


def floor_density(level: str, frequency: Floats) -> Floats:
    """Displacement of the floor that fills a curve in every band, one axis [m2/Hz]: v^2 / (0.23 f) / (2 pi f)^2."""
    low, corner, high = FLOOR_BAND
    inside = (frequency >= low) & (frequency <= high)
    f = np.where(inside, frequency, corner)
    falling = level in {"VC-C", "VC-D", "VC-E"}
    velocity = FLOOR_VELOCITY[level] * (1.0 if falling else np.maximum(1.0, corner / f))
    return np.where(inside, velocity**2 / (THIRD_OCTAVE * f) / (2.0 * np.pi * f) ** 2, 0.0)


def flat_density(rms: float, band: tuple[float, float], frequency: Floats) -> Floats:
    """A flat density within a band, of a signal of root mean square ``rms``."""
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return np.where(inside, rms**2 / (band[1] - band[0]), 0.0)
