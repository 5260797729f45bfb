"""What shakes the bench besides the motion: a rigid floor through the mounts, and the roughness of drives and joints.

Each is one period of a stationary Gaussian process of a given one-sided power spectral density, made on its Fourier
lines. Every random quantity has a stream of random numbers of its own, so that one does not depend on the others.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import BaseMotion, ElasticBase

from ..rig.bench import Bench, FloorMode

FLOOR_VELOCITY = {
    "workshop": 800e-6, "office": 400e-6, "residential": 200e-6, "operating theatre": 100e-6,
    "VC-A": 50e-6, "VC-B": 25e-6, "VC-C": 12.5e-6, "VC-D": 6.25e-6, "VC-E": 3.12e-6,
}  # fmt: skip
"""Root mean square in each third-octave band from 8 to 80 Hz [m/s]: generic vibration criteria, Amick et al., "Evolving
criteria for research facilities", Proc. SPIE 5933 (2005), table 1."""
FLOOR_BAND = (4.0, 8.0, 80.0)
"""Lowest, corner and highest frequency [Hz]: below the corner, curves down to VC-B have constant acceleration."""
THIRD_OCTAVE = 2.0 ** (1.0 / 6.0) - 2.0 ** (-1.0 / 6.0)
"""Width of a third-octave band over its centre [-]."""


def fourier_lines(density: Floats, rng: np.random.Generator, count: int, step: float) -> np.ndarray:
    """Random lines (m,) [unit] for irfft to ``count`` samples every ``step`` [s], of ``density`` (m,) [unit2/Hz]."""
    normal = rng.normal(size=(*density.shape, 2))
    return np.sqrt(density * count / (4.0 * step)) * (normal[..., 0] + 1j * normal[..., 1])


def floor_density(level: str, frequency: Floats) -> Floats:
    """Density of the floor's displacement along an axis at ``frequency`` (m,) [Hz], (m,) [m2/Hz].

    It fills a curve of FLOOR_VELOCITY in every third-octave band: v^2 / (0.23 f) / (2 pi f)^2.
    """
    low, corner, high = FLOOR_BAND
    inside = (frequency >= low) & (frequency <= high)
    f = np.where(inside, frequency, corner)
    falling = level in {"VC-C", "VC-D", "VC-E"}
    velocity = FLOOR_VELOCITY[level] * (1.0 if falling else np.maximum(1.0, corner / f))
    return np.where(inside, velocity**2 / (THIRD_OCTAVE * f) / (2.0 * np.pi * f) ** 2, 0.0)


def flat_density(rms: float, band: tuple[float, float], frequency: Floats) -> Floats:
    """Density (m,) [unit2/Hz] of a signal of ``rms`` [unit], flat in a band [Hz], at ``frequency`` (m,) [Hz]."""
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return np.where(inside, rms**2 / (band[1] - band[0]), 0.0)


def random_stream(*key: int | str) -> np.random.Generator:
    """A generator seeded by a key of numbers and words."""
    return np.random.default_rng([zlib.crc32(part.encode()) if isinstance(part, str) else part for part in key])


@dataclass(frozen=True)
class Disturbance:
    """A stationary vibration of the base, to be added to the response to the motion."""

    motion: BaseMotion
    wrench: Floats
    """Roughness: wrench on the base beyond the shaking wrench, about the base's origin, (n, 6) [N, N m]."""


def draw_disturbance(
    bench: Bench, base: ElasticBase, count: int, step: float, seed: tuple[int, int]
) -> Disturbance | None:
    """``count`` samples every ``step`` [s] of floor and roughness of the bench; None where it states neither.

    On each Fourier line x = (K - w^2 M + i w C)^-1 (W + (Kf + i w C) x_floor): stationary from the first sample.
    K is the base's, geometric stiffness of weight included; Kf is the mounts' alone, whose lower ends the floor moves.
    """
    if not is_disturbed(bench):
        return None
    frequency = np.fft.rfftfreq(count, step)
    rough = np.stack(list(_roughness(bench, frequency, count, step, seed)), axis=1)
    ground = floor_lines(bench, frequency, count, step, seed)
    used = np.any(rough != 0.0, axis=1) | np.any(ground != 0.0, axis=1)
    i_omega = 2j * np.pi * frequency[used, None, None]
    damping = i_omega * base.damping
    driven = rough[used] + np.matmul(bench.elastic().stiffness + damping, ground[used, :, None])[:, :, 0]
    x = np.zeros_like(rough)
    x[used] = np.linalg.solve(base.stiffness + damping + i_omega**2 * base.mass, driven[:, :, None])[:, :, 0]
    rate = 2j * np.pi * frequency[:, None]
    moved = BaseMotion(*(np.fft.irfft(spectrum, count, axis=0) for spectrum in (x, rate * x, rate**2 * x)))
    return Disturbance(moved, np.fft.irfft(rough, count, axis=0))


def is_disturbed(bench: Bench) -> bool:
    """Whether anything shakes the bench besides the motion."""
    return bench.floor is not None or bench.roughness is not None or bool(bench.floor_modes)


def _roughness(bench: Bench, frequency: Floats, count: int, step: float, seed: tuple[int, int]) -> Iterator[Floats]:
    """Fourier lines of the wrench, component by component."""
    rough = bench.roughness
    force, moment = (
        ((0.0,) * 3, (0.0,) * 3) if rough is None else (rough.force or (0.0,) * 3, rough.moment or (0.0,) * 3)
    )
    for i, rms in enumerate((*force, *moment)):
        density = np.zeros_like(frequency) if rough is None else flat_density(rms, rough.band, frequency)
        yield fourier_lines(density, random_stream("roughness", *seed, i), count, step)


def floor_lines(bench: Bench, frequency: Floats, count: int, step: float, seed: tuple[int, int]) -> np.ndarray:
    """Fourier lines of the floor's displacement and rotation at the origin of the base frame, (m, 6) [m, rad]."""
    lines = np.zeros((len(frequency), 6), dtype=complex)
    for i in range(3 if bench.floor else 0):
        density = floor_density(str(bench.floor), frequency)
        lines[:, i] = fourier_lines(density, random_stream("floor", *seed, i), count, step)
    for i, mode in enumerate(bench.floor_modes):
        density = floor_mode_density(mode, frequency)
        axis = np.array(mode.axis) / np.linalg.norm(mode.axis)
        shape = [axis, np.zeros(3)] if mode.angle is None else [np.cross(mode.centre, axis), axis]
        drawn = fourier_lines(density, random_stream("floor mode", *seed, i), count, step)
        lines += drawn[:, None] * np.concatenate(shape)
    return lines


def floor_mode_density(mode: FloorMode, frequency: Floats) -> Floats:
    """Density of a mode's displacement or angle at uniform ``frequency`` (m,) [Hz], (m,) [m2/Hz, rad2/Hz].

    That of an oscillator under noise, flat above zero to 80 Hz, scaled to the stated root mean square on these lines.
    """
    f, own = frequency, mode.frequency
    answer = 1.0 / ((own**2 - f**2) ** 2 + (2.0 * mode.damping * own * f) ** 2)
    density = np.where((f > 0.0) & (f <= FLOOR_BAND[2]), answer, 0.0)
    rms, stated = (
        (mode.angle, density) if mode.angle is not None else (mode.acceleration, density * (2.0 * np.pi * f) ** 4)
    )
    return density * float(rms or 0.0) ** 2 / (stated.sum() * frequency[1])
