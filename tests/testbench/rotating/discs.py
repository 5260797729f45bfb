"""Edges of a disc on a crank whose motion is known: clock, jitter, lost edges and errors of the disc as asked."""

from functools import cache

import numpy as np

from balance.drives.drive_files import load_drive
from balance.drives.harmonic_balance import SteadyRotation, steady_rotation
from balance.drives.machine import Machine
from balance.drives.time_integration import start_up

RPM = np.pi / 30.0
CLOCK = 4e-6
"""Step of a microcontroller's clock [s]."""


@cache
def machine() -> Machine:
    """The inverted slider-crank at 276 rev/min, torque not geared."""
    drive = load_drive("inverted-slider-crank")
    return drive.machines(drive.load_mechanism())[1]


@cache
def truth() -> SteadyRotation:
    """Its steady rotation."""
    return steady_rotation(machine())


@cache
def _waves() -> np.ndarray:
    u = np.arange(4096) * 2 * np.pi / 4096
    return np.fft.rfft(1.0 / truth().rate(u))[:60] / 2048


def instants(phi: np.ndarray) -> np.ndarray:
    """Time at which the crank passes angles in its steady rotation: the integral of dphi / n [s]."""
    k = np.arange(1, 60)
    return truth().period * phi / (2 * np.pi) + np.real(np.exp(1j * np.outer(phi, k)) @ (_waves()[1:] / (1j * k)))


def errors(pulses: int, pitch: float, seed: int = 0) -> np.ndarray:
    """Errors of a disc, random and mean zero, ``pitch`` their standard deviation in shares of the pitch [rad]."""
    off = np.random.default_rng(seed).normal(size=pulses) * pitch * 2 * np.pi / pulses
    return off - off.mean()


def turning(
    pulses: int = 100, turns: float = 8, ratio: float = 1.0, jitter: float = 0.0, clock: float = CLOCK,
    ahead: np.ndarray | None = None, start: float = 0.0, seed: int = 0,
) -> np.ndarray:  # fmt: skip
    """Edges of a disc that turns ``ratio`` times a turn of the steadily turning crank [s]."""
    k = np.arange(round(pulses * ratio * turns) + 1)
    off = 0.0 if ahead is None else ahead[k % pulses] - ahead[0]
    time = instants((2 * np.pi * k / pulses + off) / ratio + start)
    time = np.sort(time + jitter * np.random.default_rng(seed).normal(size=len(k)))
    return np.round(time / clock) * clock if clock else time


def starting(pulses: int = 100, turns: int = 4, clock: float = CLOCK) -> np.ndarray:
    """Edges of a start from standstill, the first one at a slot's angle after the start [s]."""
    run = start_up(machine(), turns)
    from scipy.interpolate import PchipInterpolator

    angle = 2 * np.pi * np.arange(1, pulses * turns) / pulses
    return np.round(PchipInterpolator(run.travel[1:], run.time[1:])(angle) / clock) * clock
