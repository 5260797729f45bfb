"""Steady state of a motor-driven machine: ``balance`` against integrating to it from standstill, in turn.

    python -m benchmarks.drive [--rounds 5]

The peer is ``scipy.integrate.solve_ivp``, DOP853 at rtol 1e-10, from standstill until the speed is the same after a
turn to 1e-8: once on the source's equation of motion typed in closed form with ``math``, once on the equation taken
from the mechanism's file. Ours finds the periodic solution and its extremes by harmonic balance on the latter. Setting
that equation up is timed apart: the typed peer is spared it.
"""

import argparse
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from balance.drives import time_integration
from balance.drives.drive_files import Drive, load_drive
from balance.drives.harmonic_balance import SteadyRotation, steady_rotation

REQUIRED = 20
"""How many times faster than integrating it must be."""
PERIODICITY = 1e-8
"""Relative change of speed over a turn at which the peer stops, and that ours must keep."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""Ours and the peer run on one thread, so that other work on the machine disturbs both alike."""
REPEATS = 5
"""Times ours runs a round, being so short."""
RPM = math.pi / 30.0
_R, _D, _G2, _G4, _J2, _J34, _JC = 0.15, 0.5, 0.07517, 0.3362, 0.000756, 0.0015 + 0.2023, 0.42
_M2, _M3, _M4, _G = 0.27275, 1.6662, 2.96932, 9.81


def acceleration(phi: float, rate: float, nominal: float) -> float:
    """The source's equation of motion, typed in."""
    c, s = math.cos(phi), math.sin(phi)
    across, along = _R * s, _D - _R * c
    square = across * across + along * along
    psi, turn = math.atan2(across, along), (_R * _D * c - _R * _R) / square
    bend = -_R * _D * s / square - turn * 2.0 * _R * _D * s / square
    swing = _J34 + _M4 * _G4 * _G4
    inertia = _M2 * _G2 * _G2 + _J2 + _M3 * _R * _R + _JC + swing * turn * turn
    weight = _G * ((_M2 * _G2 + _M3 * _R) * c + _M4 * _G4 * math.cos(psi) * turn)
    slip = 1.0 - 3.61 * rate / nominal
    torque = 12.75 * slip / (slip + (0.315 - slip) ** 2 * (2.565 - 1.380 * slip**3))
    return (torque - weight - swing * turn * bend * rate * rate) / inertia


def integrated(law: Callable[[float, float], float]) -> tuple[float, float, int]:
    """Largest and smallest speed of the last turn [rad/s], and how many turns it took."""
    state, start, turns = [0.0, 0.0], 0.0, 0
    while True:
        turns += 1

        def round_once(_: float, y: np.ndarray, target: float = 2.0 * math.pi * turns) -> float:
            return y[0] - target

        round_once.terminal = True
        run = solve_ivp(
            lambda _, y: (y[1], law(y[0], y[1])), (start, start + 60.0), state, "DOP853",
            events=round_once, dense_output=True, rtol=1e-10, atol=1e-10,
        )  # fmt: skip
        before, state, begun, start = state[1], run.y[:, -1], start, run.t[-1]
        if abs(state[1] - before) < PERIODICITY * state[1]:
            speed = run.sol(np.linspace(begun, start, 4001))[1]
            return float(speed.max()), float(speed.min()), turns


def timed(law: Callable[[float, float], float]) -> tuple[tuple[float, float, int], float]:
    """What integrating finds, and how long it takes [s]."""
    begin = time.perf_counter()
    result = integrated(law)
    return result, time.perf_counter() - begin


def found(drive: Drive, mechanism: object) -> tuple[SteadyRotation, float, float]:
    """The steady state, the time to set up its equation of motion, and the time to find it with its extremes [s]."""
    begin = time.perf_counter()
    (machine,) = drive.machines(mechanism, (828 * RPM,), "ungeared")
    ready = time.perf_counter()
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        solution = steady_rotation(machine)
        solution.fluctuation()
        seconds.append(time.perf_counter() - start)
    return solution, ready - begin, statistics.median(seconds)


def main(arguments: list[str] | None = None) -> int:
    """Print times and ratio; 1 where the results differ or the ratio falls short."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drive", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--rounds", type=int, default=5, help="times each runs; medians are shown")
    options = parser.parse_args(arguments)
    drive = load_drive("inverted-slider-crank")
    mechanism = drive.load_mechanism()
    nominal, ours, setting_up, typed, modelled = 828 * RPM, [], [], [], []
    for _ in range(options.rounds):
        solution, apart, seconds = found(drive, mechanism)
        ours.append(seconds)
        setting_up.append(apart)
        (fastest, slowest, turns), seconds = timed(lambda phi, rate: acceleration(phi, rate, nominal))
        typed.append(seconds)
        modelled.append(timed(solution.machine.acceleration)[1])
    mine, prepared, peer, other = (statistics.median(values) for values in (ours, setting_up, typed, modelled))
    off = max(abs(solution.fastest[1] - fastest), abs(solution.slowest[1] - slowest)) / fastest
    kept = time_integration.periodicity(solution)
    short = peer / mine < REQUIRED or off > 1e-7 or kept > PERIODICITY
    print(
        f"Steady state at 828 rev/min of the motor, periodic to {PERIODICITY:g}\n\n"
        f"integrated, equation typed in closed form  {peer * 1e3:8.1f} ms   {turns} turns, DOP853, rtol 1e-10\n"
        f"integrated, equation of the mechanism      {other * 1e3:8.1f} ms\n"
        f"balance                                    {mine * 1e3:8.2f} ms   periodic to {kept:.0e}, extremes off by "
        f"{off:.0e}\n"
        f"setting up the mechanism's equation        {prepared * 1e3:8.1f} ms\n\n"
        f"ratio {peer / mine:.0f} and {other / mine:.0f}, required {REQUIRED}"
        f"{'  too slow or different' if short else ''}"
    )
    return int(short)


if __name__ == "__main__":
    if ONE_THREAD.keys() <= os.environ.keys():
        raise SystemExit(main())
    again = [sys.executable, "-m", "benchmarks.drive", *sys.argv[1:]]
    raise SystemExit(subprocess.run(again, env=os.environ | ONE_THREAD, check=False).returncode)
