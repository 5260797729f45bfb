"""What shakes the bench besides the motion: its floor through the mounts, and the roughness of drives and joints."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.dynamics.moving_base import BaseMotion, ElasticBase

from .noise import flat_density, floor_density, lines
from .streams import stream

if TYPE_CHECKING:
    from ..rig.bench import Bench


@dataclass(frozen=True)
class Disturbance:
    """A stationary vibration of the base, on top of what the motion does to it."""

    motion: BaseMotion
    wrench: Floats
    """What the mechanism exerts on the base beyond its shaking wrench, about the origin, (n, 6) [N, N m]."""


def draw(bench: "Bench", base: ElasticBase, count: int, step: float, seed: tuple[int, int]) -> Disturbance | None:
    """``count`` samples every ``step`` [s] of all that the bench states; None where it states nothing.

    On each Fourier line x = (K - w^2 M + i w C)^-1 (W + (K + i w C) x_floor): stationary from the first sample.
    """
    if not is_disturbed(bench):
        return None
    frequency = np.fft.rfftfreq(count, step)
    rough = np.stack(list(_roughness(bench, frequency, count, step, seed)), axis=1)
    ground = np.stack(list(_floor(bench, frequency, count, step, seed)), axis=1)
    used = np.any(rough != 0.0, axis=1) | np.any(ground != 0.0, axis=1)
    i_omega = 2j * np.pi * frequency[used, None, None]
    mounts = base.stiffness + i_omega * base.damping
    driven = rough[used] + np.matmul(mounts, ground[used, :, None])[:, :, 0]
    x = np.zeros_like(rough)
    x[used] = np.linalg.solve(mounts + i_omega**2 * base.mass, driven[:, :, None])[:, :, 0]
    rate = 2j * np.pi * frequency[:, None]
    moved = BaseMotion(*(np.fft.irfft(spectrum, count, axis=0) for spectrum in (x, rate * x, rate**2 * x)))
    return Disturbance(moved, np.fft.irfft(rough, count, axis=0))


def is_disturbed(bench: "Bench") -> bool:
    """Whether anything shakes the bench besides the motion."""
    return bench.floor is not None or bench.roughness is not None


def _roughness(bench: "Bench", frequency: Floats, count: int, step: float, seed: tuple[int, int]) -> Iterator[Floats]:
    """Fourier lines of the wrench, component by component."""
    rough = bench.roughness
    force, moment = (
        ((0.0,) * 3, (0.0,) * 3) if rough is None else (rough.force or (0.0,) * 3, rough.moment or (0.0,) * 3)
    )
    for i, rms in enumerate((*force, *moment)):
        density = np.zeros_like(frequency) if rough is None else flat_density(rms, rough.band, frequency)
        yield lines(density, stream("roughness", *seed, i), count, step)


def _floor(bench: "Bench", frequency: Floats, count: int, step: float, seed: tuple[int, int]) -> Iterator[Floats]:
    """Fourier lines of the floor's displacement, component by component; it does not turn."""
    for i in range(6):
        quiet = bench.floor is None or i > 2
        density = np.zeros_like(frequency) if quiet else floor_density(str(bench.floor), frequency)
        yield lines(density, stream("floor", *seed, i), count, step)
