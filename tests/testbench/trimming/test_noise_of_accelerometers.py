"""Forces on a base that moves: the mass by which its acceleration counts is not known, and accelerometers are noisy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mjcf_parser import load_mechanism
from studies import simulated_runs as memory
from testbench.simulator.simulated_logs import MemoryRun
from testbench.trimming import trim_runs

from . import linkages

RATE, SECONDS, DRAWS = 1000.0, 6.0, 8
MODE_HZ, DAMPING, GAIN = 9.0, 0.05, 4e-3
"""Of the base, which slides and does not turn; and its acceleration per shaking force, high above the mode [1/kg]."""
NOISE = 0.2
"""Of the accelerometers [m/s2], at each sample."""


def _base(force: np.ndarray) -> np.ndarray:
    """Acceleration (n, 3) [m/s2] of a base with one mode in every direction, under a force (n, 3) [N]."""
    omega = 2j * np.pi * np.fft.rfftfreq(4 * len(force), 1.0 / RATE)[:, None]
    mode = 2.0 * np.pi * MODE_HZ
    shape = GAIN * omega**2 / (omega**2 + 2.0 * DAMPING * mode * omega + mode**2)
    return np.fft.irfft(np.fft.rfft(force, 4 * len(force), axis=0) * shape, axis=0)[: len(force)]


def noisy_run(built, seed):
    """Forces that hold the mechanism against the base's motion, and what an accelerometer reads of that."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, SECONDS, 1.0 / RATE)
    path = Closure(built).follow(linkages.motion(built, time, np.random.default_rng(5), 0.4))
    response = simulate(built, path)
    moved = _base(response.force)
    wrench = np.hstack([response.force - built.total_mass * moved, response.moment])
    names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    columns = {f"q_{j}": path.q[:, built.coordinate_index(j)] for j in built.driven}
    columns |= {f"tau_{j}": response.torque[j] for j in built.driven}
    columns |= {n: w + 0.02 * rng.normal(size=len(w)) for n, w in zip(names, wrench.T, strict=True)}
    read = {f"{a}{k}": moved[:, i] for k in range(len(linkages.PLACES)) for i, a in enumerate(("ax", "ay"))}
    columns |= {name: m + NOISE * rng.normal(size=len(m)) for name, m in read.items()}
    data: dict[str, np.ndarray] = {}
    group = linkages.group("drive", columns, data, RATE)
    text = linkages.rig_text(built).partition("[sensors.base_acc]")[0].replace('logger = "plate"', 'logger = "drive"')
    text += "".join(linkages.ON_BASE.format(k=k, at=at) for k, at in enumerate(linkages.PLACES))
    return MemoryRun(Path("run.h5"), (group,), "measured", {"counter_masses": {}}, text, (), {"data": data})


@pytest.fixture(scope="module")
def errors():
    """Of the conditions' values over draws of noise, and half widths of their intervals, (draws, rank) [kg m]."""
    arm = load_mechanism("serial-2r")
    built = replace(arm, parameters=arm.parameters * np.array([0.98] + [0.98] * 3 + [1.0] * 6))
    truth, found = balance_conditions(arm).values(built), []
    for seed in range(DRAWS):
        trimmed = trim_runs(memory.aligned([noisy_run(built, seed)], arm), source="wrench")
        values = [value for _, value in trimmed.values]
        found.append([(v.value - t, v.half_width()) for v, t in zip(values, truth, strict=True)])
    return np.moveaxis(np.array(found), 2, 0)


def test_noise_makes_no_mass_smaller(errors):
    """The mean error of what a wrong mass changes most is zero within 5 standard errors, by Student's t 1 in 600.

    By least squares without instruments it was 9 of them.
    """
    away = errors[0][:, 0]
    assert abs(away.mean()) < 5.0 * away.std(ddof=1) / DRAWS**0.5


def test_the_intervals_hold(errors):
    """Of 95 %: that fewer than 26 of 32 hold is one case in 1,000."""
    away, half = errors
    assert np.count_nonzero(np.abs(away) <= half) >= 26
