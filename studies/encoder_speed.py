"""Coverage of the intervals of ``testbench speed``: simulated encoder logs whose truth is known.

Edges of a disc on the crank of the shipped inverted slider-crank, steady at 276 rev/min of the motor: clock steps,
jitter, errors of the disc, few and many turns. Where the clock steps the intervals are bounds.
"""

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from balance.drives.drive_files import load_drive
from balance.drives.harmonic_balance import SteadyRotation, steady_rotation
from balance.errors import CounterpoiseError
from testbench.rotating import Disc, SteadySpeedFit, number_edges, periodic_turn

from .laboratories import Family, floor, hum, roughness, walk
from .table import Row, covered

NOISES = {
    "floor": Family([floor]), "hum": Family([hum]), "wander": Family([walk]), "broadband": Family([roughness]),
    "all mixed": Family([floor, hum, walk, roughness]),
}  # fmt: skip
"""Of the instants, by a sensor that shakes, 50 us for a residual of 1 m/s2; a slope would be another speed."""
CASES: dict[str, dict[str, Any]] = {
    "clock of 4 us": {"clock": 4e-6},
    "clock of 4 us, jitter 10 us": {"clock": 4e-6, "jitter": 1e-5},
    "jitter 10 us, 3 turns": {"jitter": 1e-5, "turns": 3},
    "jitter 50 us": {"jitter": 5e-5},
    "jitter 200 us, 30 turns": {"jitter": 2e-4, "turns": 30},
    "60 pulses, jitter 20 us": {"pulses": 60, "jitter": 2e-5},
    "361 pulses, jitter 10 us": {"pulses": 361, "jitter": 1e-5},
    "2 % of pitch": {"pitch": 0.02},
    "5 % of pitch, jitter 10 us": {"pitch": 0.05, "jitter": 1e-5},
} | {f"{name}, {turns} turns": {"jitter": 1e-5, "turns": turns, "family": name} for name in NOISES for turns in (8, 30)}


def truth() -> SteadyRotation:
    """The steady rotation that the logs are made of."""
    drive = load_drive("inverted-slider-crank")
    return steady_rotation(drive.machines(drive.load_mechanism())[1])


def log(
    motion: SteadyRotation, seed: int, pulses: int = 100, turns: int = 8, clock: float = 0.0, jitter: float = 0.0,
    pitch: float = 0.0, family: str = "",
) -> SteadySpeedFit:  # fmt: skip
    """The turn found from one log."""
    rng = np.random.default_rng(seed)
    waves = np.fft.rfft(1.0 / motion.rate(np.arange(4096) * 2 * np.pi / 4096))[1:60] / 2048
    off = rng.normal(0.0, pitch * 2 * np.pi / pulses, pulses)
    edge = np.arange(pulses * turns + 1)
    phi = 0.25 * seed + 2 * np.pi * edge / pulses + off[edge % pulses] - off[0]
    k = np.arange(1, 60)
    time = motion.period * phi / (2 * np.pi) + np.real(np.exp(1j * np.outer(phi, k)) @ (waves / (1j * k)))
    time = time + rng.normal(0.0, jitter, len(edge))
    if family:
        even = np.arange(0.0, time[-1] + 0.01, 1e-3)
        shaken = 5e-5 * NOISES[family].law(rng, 1.0)(rng, even, np.ones(len(even)))
        time = time + np.interp(time, even, shaken)
    return periodic_turn(number_edges("log", np.round(time / clock) * clock if clock else time, Disc(pulses)))


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage of the three intervals of each case; a jittering disc makes them wide, so that they are bounds."""
    motion = truth()
    nominal, fluctuation = motion.machine.nominal_crank, motion.fluctuation()
    for name, given in CASES.items():
        turns = []
        for seed in range(count):
            with contextlib.suppress(CounterpoiseError):
                turns.append(log(motion, seed, **given))
        if not turns:
            yield Row(f"{name}, refused", count, f"of {count}")
            continue
        found = [turn.fluctuation(nominal) for turn in turns]
        error = np.sqrt(np.mean([(estimate.value - fluctuation) ** 2 for estimate in found]))
        width = np.median([0.5 * (estimate.high - estimate.low) for estimate in found]) / error
        hits = {
            "fluctuation": sum(estimate.contains(fluctuation) for estimate in found),
            "fastest": sum(turn.fastest.contains(motion.fastest[1]) for turn in turns),
            "mean": sum(turn.mean.contains(motion.mean_speed) for turn in turns),
        }
        for quantity, number in hits.items():
            note = f"half width over rms error {width:.2f}" if quantity == "fluctuation" else ""
            note += f", {count - len(turns)} refused" * (len(turns) < count)
            yield covered(f"{name}, {quantity}", number, len(turns), note, conservative=True)
