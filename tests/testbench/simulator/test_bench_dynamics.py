"""Drives that yield, feet that lift and what rides on force sensors: against equations written out here, and limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from balance.closure import Closure
from balance.dynamics.moving_base import MountedBase
from balance.motion import Samples
from testbench.rig.bench import Bench
from testbench.simulator.bench_dynamics import BenchDynamics
from testbench.simulator.drive_trains import DriveTrains, with_motor_sides

from .bench import BUILT, MECHANISM

R, G, PAYLOAD, ROTOR = 0.15, 9.81, 5.0, 0.02
SPRING = {"stiffness": "3 kN m/rad", "damping": "4 N m s/rad"}
CONTROL = {"stiffness": "4 kN m/rad", "damping": "20 N m s/rad"}
RATE = 20_000.0


def drives(transmission=SPRING, control=CONTROL, hub=True, **more):
    """The same drive on both arms, its counter-mass on the hub."""
    found = {}
    for joint in ("A0", "B0"):
        spring = {**transmission, "motor_side": [f"counter_{joint}{joint[0]}"] if hub else []} if transmission else None
        found[joint] = {"transmission": spring, "control": {**control, **more} if control else None}
    return {"drives": found, "rotors": {j: {"inertia": f"{ROTOR} kg m^2"} for j in found}}


def moved(settings, masses, duration=0.12, rest=0.05, rate=RATE):
    """Drives on a base at rest along a smooth move of the platform, 20 mm along x and 10 mm along y."""
    bench = Bench.model_validate(settings)
    time = np.arange(round((duration + rest) * rate) + 1) / rate
    s = np.minimum(time / duration, 1.0)
    shape = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    speed, push = 140 * s**3 * (1 - s) ** 3, 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s)
    way, start = np.array([0.02, 0.01]), np.array([0.0, 0.212])
    samples = Samples(
        time, start + np.outer(shape, way), np.outer(speed, way) / duration, np.outer(push, way) / duration**2
    )
    sided = with_motor_sides(MECHANISM, bench.drives)
    armature = sided.armature.copy()
    armature[[sided.coordinate_index(name) for name in sided.driven[2:] or sided.driven]] += ROTOR
    loaded = replace(sided, armature=armature).with_payload({"platform": PAYLOAD}).with_counter_mass(masses)
    found = DriveTrains.of(loaded, bench.drives, Closure(MECHANISM).follow(samples))
    base, locked = MountedBase().elastic(), np.zeros((6, 6))
    return BenchDynamics(loaded, found.command, {}, base, locked, np.zeros(3), found, None, None).solved(), found


def written_out(settings, found, masses):
    """Angles of arms and hubs (n, 4) by Lagrange's equations of the parallelogram, integrated by another's hand."""
    drive = Bench.model_validate(settings).drives["A0"]
    spring, control = drive.transmission, drive.control
    m1, p1, i1, m2, p2, i2 = 1.04642, 0.05943, 0.0049, 0.58909, 0.0187, 0.0006
    own = i1 + m1 * p1**2 + m2 * R**2 + i2 + m2 * p2**2 + PAYLOAD * R**2
    mixed, lift = 2 * m2 * R * p2 + PAYLOAD * R**2, (m1 * p1 + m2 * (R + p2) + PAYLOAD * R) * G
    counter = max(masses.values(), default=0.0)
    hub, drop = ROTOR + counter * (0.03755**2 + 0.06**2), -counter * 0.03755 * G
    time, columns = found.command.time, found._indices[:2]
    wanted, rate = (CubicSpline(time, x[:, columns]) for x in (found.command.q, found.command.v))
    known = [torque for _, _, torque in found.controls] or [np.zeros_like(time)] * 2
    rigid = CubicSpline(time, np.column_stack(known))
    gap, loops = spring.backlash / 2.0, control and control.bandwidth

    def passed(q, hubs, v, w):
        turn = hubs - q
        return spring.stiffness * (turn - np.clip(turn, -gap, gap)) + spring.damping * (w - v)

    def ahead(t, hubs, w, i):
        error = wanted(t) - hubs
        more = control.stiffness / control.integral_time * i if control.integral_time else 0.0
        return control.feedforward * rigid(t) + control.stiffness * error + control.damping * (rate(t) - w) + more

    def rates(t, y):
        q, hubs, v, w, i, loop = y.reshape(6, 2)
        if control is None:
            hubs, w = wanted(t), rate(t)
        s, apart = passed(q, hubs, v, w), q[0] - q[1]
        mass = np.array([[own, mixed * np.cos(apart)], [mixed * np.cos(apart), own]])
        swept = mixed * np.sin(apart) * np.array([v[1] ** 2, -(v[0] ** 2)])
        a = np.linalg.solve(mass, s - swept - lift * np.cos(q))
        if control is None:
            return np.concatenate([v, 0 * v, a, np.zeros(6)])
        asked = ahead(t, hubs, w, i)
        torque = loop if loops else asked
        if control.ripple:
            torque = torque + control.ripple.torque * np.sin(control.ripple.order * hubs)
        b = (torque - s - drop * np.cos(hubs)) / hub
        lag = 2 * np.pi * loops * (asked - loop) if loops else 0 * loop
        return np.concatenate([v, w, a, b, wanted(t) - hubs, lag])

    def at_rest(z):
        """Integrals of control and torques of current loops."""
        torque = lift * np.cos(z[:2]) + drop * np.cos(z[2:])
        missing = torque - control.feedforward * rigid(0.0) if control else np.zeros(2)
        return missing * control.integral_time / control.stiffness if loops else np.zeros(2), torque

    return time, rates, at_rest


CASES = {
    "spring": drives(control=None),
    "control": drives(),
    "loop": drives(integral_time="50 ms", bandwidth="200 Hz", feedforward=0.9),
    "cogging": drives(ripple={"torque": "0.5 N m", "order": 60}),
    "play": drives({**SPRING, "backlash": "0.05 deg"}),
}


@pytest.mark.parametrize("masses", [{}, BUILT], ids=["bare", "balanced"])
@pytest.mark.parametrize("case", CASES)
def test_against_equations_written_out(case, masses):
    """Angles of arms and hubs along a move are those of Lagrange's equations by an integrator of scipy, to 1e-6."""
    solution, found = moved(CASES[case], masses)
    time, rates, at_rest = written_out(CASES[case], found, masses)
    z = solution.trajectory.q[:, found._indices]
    start = np.concatenate([z[0], np.zeros(4), *at_rest(z[0])])
    expected = solve_ivp(rates, (0.0, time[-1]), start, "DOP853", time[::50], rtol=1e-10, atol=1e-12, max_step=1e-3)
    there = [0, 1] if case == "spring" else [0, 1, 2, 3]
    assert np.abs(solution.deviation.position).max() > 1e-3 * np.ptp(z[:, :2])
    assert np.abs(z[::50, there] - expected.y[there].T).max() < 1e-6 * np.ptp(z[:, :2])
