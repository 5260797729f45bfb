"""Drives that yield, feet that lift and what rides on force sensors: against equations written out here, and limits."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.moving_base import BaseMotion, MountedBase, rigid_body
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion import Samples
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig.bench import Bench
from testbench.simulator import bench_dynamics
from testbench.simulator.bench_dynamics import BenchDynamics, Contact
from testbench.simulator.drive_trains import DriveTrains, parameters_on_links, with_motor_sides
from testbench.simulator.elastic_joints import (
    across,
    beyond_hinge,
    is_across,
    part_at,
    with_elastic_joints,
    with_elastic_links,
)
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import true_signals

from .bench import BUILT, MECHANISM, RIG, benched, run, supported

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


def moved(settings, masses, duration=0.08, rest=0.02, rate=RATE):
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
    sided = with_motor_sides(with_elastic_joints(MECHANISM, bench.joints), bench.drives)
    armature, turning = sided.armature.copy(), [name for name in sided.driven if not is_across(name)]
    armature[[sided.coordinate_index(name) for name in turning[2:] or turning]] += ROTOR
    loaded = replace(sided, armature=armature).with_payload({"platform": PAYLOAD}).with_counter_mass(masses)
    found = DriveTrains.of(loaded, bench.drives, Closure(MECHANISM).follow(samples), bench.joints)
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


@pytest.mark.parametrize(("case", "masses"), [*((case, BUILT) for case in CASES), ("loop", {})])
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


def test_energy_is_kept_without_losses():
    """Arms on springs without damping, motors at rest: kinetic and potential energy together do not change, to 3e-6."""
    lossless = drives({**SPRING, "damping": "0 N m s/rad"}, control=None, hub=False)
    solution, found = moved(lossless, {}, rest=0.1)
    after = found.command.time > 0.081
    q, v = (x[after][:, found._indices[:2]] for x in (solution.trajectory.q, solution.trajectory.v))
    m1, p1, i1, m2, p2, i2 = 1.04642, 0.05943, 0.0049, 0.58909, 0.0187, 0.0006
    own = i1 + m1 * p1**2 + m2 * R**2 + i2 + m2 * p2**2 + PAYLOAD * R**2
    mixed, lift = 2 * m2 * R * p2 + PAYLOAD * R**2, (m1 * p1 + m2 * (R + p2) + PAYLOAD * R) * G
    kinetic = 0.5 * own * (v**2).sum(axis=1) + mixed * np.cos(q[:, 0] - q[:, 1]) * v[:, 0] * v[:, 1]
    spring = 0.5 * 3000.0 * (solution.deviation.position[after] ** 2).sum(axis=1)
    energy = kinetic + spring + lift * np.sin(q).sum(axis=1)
    assert np.ptp(kinetic) > 1e-3
    assert np.ptp(energy) < 3e-6 * np.ptp(kinetic)


def test_sag_at_rest():
    """At rest an arm hangs by the torque of gravity over the stiffness, and half the play lower."""
    sagged = {}
    for play in ("0 deg", "0.1 deg"):
        solution, _ = moved(drives({**SPRING, "backlash": play}, control=None), {}, rest=0.0)
        torque = solution.response.torque["A0"][0]
        sagged[play], half = solution.deviation.position[0, 0], np.radians(float(play.split()[0])) / 2.0
        assert sagged[play] == pytest.approx(-torque / 3000.0 - np.sign(torque) * half, rel=1e-9)
    assert sagged["0.1 deg"] != sagged["0 deg"]


def test_stiff_drives_are_rigid():
    """With stiffness the arms come to where the command is, in proportion to what they yield by."""
    off = []
    for factor in (100, 1000):
        stiff = drives({"stiffness": f"{3 * factor} kN m/rad", "damping": f"{factor} N m s/rad"}, control=None)
        off.append(np.abs(moved(stiff, BUILT)[0].deviation.position).max())
    assert off[1] < 1e-4
    assert off[1] == pytest.approx(off[0] / 10.0, rel=0.1)


def test_counter_mass_on_the_arm_balances_whatever_the_drive_does():
    """Yielding drives shake a base that is balanced only where the counter-mass sits before the spring."""
    hub, arm = (run(benched(**drives(hub=hub)), BUILT) for hub in (True, False))
    assert np.abs(arm.response.force).max() < 0.01 * np.abs(hub.response.force).max()
    assert np.abs(hub.response.force).max() > 1.0


def pinned(joint, **more):
    """A joint without a motor that yields: of an arm and a link (A), or of that link and the platform (C)."""
    return {"joints": {joint: {"stiffness": "2 MN/m", "damping": "200 N s/m", **more}}}


def links_written_out(settings, found):
    """Rates and energy of links and platform as free bodies (Newton, Euler), pinned but for the joint that yields.

    Positions are centre and angle of each link, then the platform, (8,), followed by their rates.
    """
    (yields, spring), *_ = Bench.model_validate(settings).joints.items()
    m, p, inertia = 0.58909, 0.0187, 0.0006
    mass, weight = np.diag([m, m, inertia, m, m, inertia, PAYLOAD, PAYLOAD]), np.zeros(8)
    weight[[1, 4, 7]] = -G * np.array([m, m, PAYLOAD])
    time, columns = found.command.time, [found.mechanism.coordinate_index(x) for x in ("A0", "B0")]
    angle, rate, faster = (CubicSpline(time, getattr(found.command, x)[:, columns]) for x in "qva")

    def on(place, speed, angles, s, column=None):
        """A point at s along a body: place, velocity, acceleration per accelerations and at none; turn of the body."""
        (phi, omega, alpha), rows = angles, np.zeros((2, 8))
        e, n = np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
        if column is not None:
            rows[:, column : column + 2], rows[:, column + 2] = np.eye(2), s * n
        return place + s * e, speed + s * omega * n, rows, s * (alpha * n - omega**2 * e), omega, column

    def joints(t, y):
        """Bearing and pin of each joint."""
        q, v, around = y[:8], y[8:], {}
        for k, (first, last, x) in enumerate((("A", "C", -0.12), ("B", "D", 0.12))):
            arm = on(np.array([x, 0.0]), np.zeros(2), (angle(t)[k], rate(t)[k], faster(t)[k]), R)
            body, own = 3 * k, (q[3 * k + 2], v[3 * k + 2], 0.0)
            ends = [on(q[body : body + 2], v[body : body + 2], own, s, body) for s in (-p, R - p)]
            corner = (q[6:] + np.array([x, 0.0]), v[6:], np.eye(8)[6:], np.zeros(2), 0.0, None)
            around |= {first: (arm, ends[0]), last: (ends[1], corner)}
        return around

    def force(bearing, pin):
        """Of the spring on the pin, from where it lies in the bearing, which turns."""
        off = pin[0] - bearing[0]
        slips, far = pin[1] - bearing[1] - bearing[4] * np.array([-off[1], off[0]]), np.linalg.norm(off)
        return off, -spring.stiffness * max(1.0 - spring.clearance / far, 0.0) * off - spring.damping * slips

    def rates(t, y):
        around = joints(t, y)
        bearing, pin = around.pop(yields)
        off, push = force(bearing, pin)
        loads = weight + (pin[2] - bearing[2]).T @ push
        if bearing[5] is not None:  # the bearing's body is pushed where the pin is
            loads[bearing[5] + 2] -= off[0] * push[1] - off[1] * push[0]
        rows = np.vstack([pin[2] - bearing[2] for bearing, pin in around.values()])
        bias = np.concatenate([bearing[3] - pin[3] for bearing, pin in around.values()])
        whole = np.block([[mass, rows.T], [rows, np.zeros((6, 6))]])
        return np.concatenate([y[8:], np.linalg.solve(whole, np.concatenate([loads, bias]))[:8]])

    def energy(t, y):
        bearing, pin = joints(t, y)[yields]
        beyond = max(np.linalg.norm(pin[0] - bearing[0]) - spring.clearance, 0.0)
        kinetic = 0.5 * y[8:] @ mass @ y[8:]
        return kinetic, kinetic + 0.5 * spring.stiffness * beyond**2 - weight @ y[:8]

    return rates, energy, p


def as_bodies(solution, found, p):
    """A solution as ``links_written_out`` has its positions and rates, (n, 16)."""
    at = found.mechanism.coordinate_index
    q, v = solution.trajectory.q, solution.trajectory.v
    whole = np.zeros((len(q), 2, 8))
    for k, (x, corner) in enumerate((("A", -0.12), ("B", 0.12))):
        (arm, link), own = (at(f"{x}0"), at(x)), across(x)
        turned, omega = q[:, arm], v[:, arm]
        e, n = np.array([np.cos(turned), np.sin(turned)]), np.array([-np.sin(turned), np.cos(turned)])
        pin, slip = np.array([[R], [0.0]]) * np.ones(len(q)), np.zeros((2, len(q)))
        if own[0] in found.mechanism.coordinates:
            pin, slip = pin + q[:, [at(c) for c in own]].T, v[:, [at(c) for c in own]].T
        place = pin[0] * e + pin[1] * n
        speed = omega * (pin[0] * n - pin[1] * e) + slip[0] * e + slip[1] * n
        phi, spin = turned + q[:, link], omega + v[:, link]
        d, dn = np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
        whole[:, 0, 3 * k : 3 * k + 3] = np.vstack([place + p * d + np.array([[corner], [0.0]]), phi]).T
        whole[:, 1, 3 * k : 3 * k + 3] = np.vstack([speed + p * spin * dn, spin]).T
    platform = [at("platform_x"), at("platform_y")]
    whole[:, 0, 6:], whole[:, 1, 6:] = q[:, platform], v[:, platform]
    return whole.reshape(len(q), 16)


@pytest.mark.parametrize(
    ("joint", "more"), [("A", {}), ("C", {}), ("A", {"stiffness": "1 MN/m", "clearance": "0.02 mm"})]
)
def test_joint_that_yields_against_equations_written_out(joint, more):
    """Links and platform are where scipy's integrator finds them, to 1e-6 of their travel; with clearance, and none."""
    settings = pinned(joint, **more)
    solution, found = moved(settings, {}, duration=0.06 if more else 0.04, rest=0.0, rate=2 * RATE)
    rates, _, p = links_written_out(settings, found)
    seen, time = as_bodies(solution, found, p), found.command.time
    expected = solve_ivp(rates, (0.0, time[-1]), seen[0], "DOP853", time[::50], rtol=1e-9, atol=1e-12, max_step=1e-3)
    travel = np.array([0.02, 0.02, np.ptp(seen[:, 2]), 0.02, 0.02, np.ptp(seen[:, 5]), 0.02, 0.02])
    assert np.abs(solution.deviation.position).max() > 3e-5
    assert (np.abs(seen[::50, :8] - expected.y[:8].T).max(axis=0) < 1e-6 * travel).all()


def test_joint_without_losses_keeps_energy():
    """Without damping nothing is lost as a pin bounces in its bearing: to 3e-6 of what is exchanged."""
    settings = pinned("A", stiffness="200 kN/m", damping="0 N s/m", clearance="0.05 mm")
    solution, found = moved(settings, {}, duration=0.06, rate=4 * RATE)
    _, energy, p = links_written_out(settings, found)
    late = found.command.time > 0.0601
    time, states = found.command.time[late][::20], as_bodies(solution, found, p)[late][::20]
    kinetic, whole = np.array([energy(t, y) for t, y in zip(time, states, strict=True)]).T
    assert np.ptp(kinetic) > 0.1
    assert np.ptp(whole) < 3e-6 * np.ptp(kinetic)


def test_clearance_at_rest_and_stiff_joints(monkeypatch):
    """A pin lies where its load over the stiffness, and the clearance, let it; the stiffer, the more rigid it is.

    Little damping takes no more rounds: the inertia along the command is in the steps.
    """
    for clearance in (0.0, 0.1):
        solution, _ = moved(pinned("A", clearance=f"{clearance} mm"), {}, duration=0.04, rest=0.0)
        load = np.array([solution.response.torque[name][0] for name in across("A")])
        far = 1e-3 * clearance + np.linalg.norm(load) / 2e6
        np.testing.assert_allclose(solution.deviation.position[0], -load / np.linalg.norm(load) * far, rtol=1e-6)
    monkeypatch.setattr(bench_dynamics, "ROUNDS", 6)
    moved(pinned("A", stiffness="20 MN/m", damping="5 N s/m"), {}, rest=0.0)
    stiff = [pinned("C", stiffness=f"{k} MN/m", damping=f"{20 * k} N s/m") for k in (100, 1000)]
    off = [np.abs(moved(settings, {})[0].deviation.position).max() for settings in stiff]
    assert off[1] == pytest.approx(off[0] / 10.0, rel=0.05)


def test_joint_that_yields_in_a_run():
    """The shaking force of a run changes by what clearance lets through; encoders and conditions of balance do not."""
    rigid, loose = run(RIG), run(benched(**pinned("C", stiffness="1 MN/m", clearance="0.01 mm")))
    assert 1.0 < np.abs(loose.response.force - rigid.response.force).max() < 100.0
    assert set(loose.torque) == {"A0", "B0"}
    np.testing.assert_allclose(loose.shown("A0"), rigid.shown("A0"), atol=1e-12)
    on_links = parameters_on_links(loose.mechanism, MECHANISM).parameters
    np.testing.assert_allclose(on_links, rigid.mechanism.parameters, atol=1e-12)


@pytest.mark.parametrize(
    ("joint", "more", "message"),
    [
        ("A0", {}, "there are A, B, C, D"),
        ("platform_x", {}, "this one slides"),
        ("C", {"stiffness": "20 MN/m", "clearance": "0.01 mm"}, r"joints\.C: .* at most \d.* MN/m, or no clearance"),
    ],
)
def test_wrong_joints(joint, more, message):
    """A joint that has a motor or slides, or bounces too fast, is refused with what may yield, and how much."""
    with pytest.raises(RigError, match=message):
        run(benched(**pinned(joint, **more)))


ARM = """<mujoco model="arm"><compiler autolimits="true"/><option gravity="0 -9.81 0"/><worldbody>
<body name="arm"><joint name="J" type="hinge" axis="0 0 1"/><site name="counter_back" pos="-0.1 0 0"/>
<inertial pos="0.25 0 0" mass="3" diaginertia="0.002 0.08 0.08"/></body></worldbody>
<actuator><motor joint="J"/></actuator></mujoco>"""
TIP = {
    "at": ("0.1 m", "0 m", "0 m"),
    "mass": "1.8 kg",
    "centre": ("0.35 m", "0 m", "0 m"),
    "inertia": ("1e-3 kg m^2", "0.02 kg m^2", "0.02 kg m^2"),
}


def bending(stiffness, damping):
    """An arm that bends at 0.1 m, swung by 0.6 rad on a base at rest: time, angle and rate of the bend."""
    arm = mechanism_from_text(ARM, "arm.xml").with_counter_mass({"counter_back": 4.0})
    bench = Bench.model_validate({"links": {"arm": TIP | {"stiffness": stiffness, "damping": damping}}})
    time = np.arange(4001) / RATE
    s = time / time[-1]
    shape, speed = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / time[-1]
    samples = Samples(
        time, 0.6 * shape[:, None], 0.6 * speed[:, None],
        0.6 * (60 * s * (1 - s) * (1 - 2 * s) / time[-1] ** 2)[:, None], joints=("J",),
    )  # fmt: skip
    split = with_elastic_links(arm, bench.links, {})
    found = DriveTrains.of(split, {}, Closure(arm).follow(samples), links=bench.links)
    base = MountedBase().elastic()
    solution = BenchDynamics(split, found.command, {}, base, np.zeros((6, 6)), np.zeros(3), found, None, None).solved()
    return samples, solution


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_link_that_bends_against_an_equation_written_out(damping):
    """The part beyond the hinge is a pendulum on a point that is moved: its equation by scipy, to 1e-6 of its bend."""
    a, r, m, inertia, k = 0.1, 0.25, 1.8, 0.02, 2000.0
    samples, solution = bending("2 kN m/rad", f"{damping} N m s/rad")
    at, speed, push = (
        CubicSpline(samples.time, x[:, 0]) for x in (samples.position, samples.velocity, samples.acceleration)
    )

    def rates(t, y):
        bend, rate = y
        lever = m * a * r * (push(t) * np.cos(bend) + speed(t) ** 2 * np.sin(bend)) + m * G * r * np.cos(at(t) + bend)
        return [rate, (-lever - k * bend - damping * rate) / (inertia + m * r**2) - push(t)]

    seen = solution.deviation.position[:, 0]
    expected = solve_ivp(rates, (0.0, samples.time[-1]), [seen[0], 0.0], "DOP853", samples.time, rtol=1e-11, atol=1e-14)
    assert seen[0] == pytest.approx(-m * G * r * np.cos(seen[0]) / k, rel=1e-9)
    assert np.ptp(seen) > 5e-3
    assert np.abs(seen - expected.y[0]).max() < 1e-6 * np.ptp(seen)


def test_stiff_link_is_rigid():
    """A stiff link bends in proportion to its compliance."""
    off = [np.abs(bending(f"{k} kN m/rad", f"{k / 100} N m s/rad")[1].deviation.position).max() for k in (1000, 10000)]
    assert off[1] == pytest.approx(off[0] / 10.0, rel=0.01)


def test_body_that_is_fixed_farther_out_is_beyond_the_hinge():
    """A tool fixed to the arm's end is as one that the arm's part beyond its hinge weighs in with."""
    tool = '<body name="tool" pos="0.5 0 0"><inertial pos="0.05 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>'
    centre, turned = (1.8 * 0.35 + 0.55) / 2.8, 1.8 * 1.0 / 2.8 * 0.2**2
    whole, about = (3 * 0.25 + 0.55) / 4.0, 3 * 1.0 / 4.0 * 0.3**2
    own = f'pos="{whole!r} 0 0" mass="4" diaginertia="0.003 {0.081 + about!r} {0.081 + about!r}"'
    both = ARM.replace('pos="0.25 0 0" mass="3" diaginertia="0.002 0.08 0.08"', own)
    one = {"mass": "2.8 kg", "centre": (f"{centre!r} m", "0 m", "0 m")}
    one["inertia"] = ("2e-3 kg m^2", *[f"{0.021 + turned!r} kg m^2"] * 2)
    found = []
    carrying, yields = ARM.replace("</body>", tool + "</body>"), {"stiffness": "1 kN m/rad", "damping": "1 N m s/rad"}
    for text, part in ((carrying, TIP | yields), (both, TIP | yields | one)):
        links = Bench.model_validate({"links": {"arm": part}}).links
        found.append(with_elastic_links(mechanism_from_text(text, "arm.xml"), links, {}).parameters)
    np.testing.assert_allclose(*found, atol=1e-15)
    links = Bench.model_validate({"links": dict.fromkeys(("arm", "tool"), TIP | yields)}).links
    with pytest.raises(RigError, match=r"links\.tool: is fixed to arm"):
        with_elastic_links(mechanism_from_text(carrying, "arm.xml"), links, {})


def split_arm(body: str, shift: float, tool: tuple[float, float], cosine: float):
    """An arm with a tool, one of them in two parts: the arm's frame ``shift`` behind its joint, the tool's at ``tool``.

    The latter is turned by an angle of that ``cosine``; places are 0.1 m and 0.35 m of the arm, 0.5 m and 0.65 m of the
    tool from the joint, along the arm.
    """
    sine = (1.0 - cosine**2) ** 0.5
    axes = np.array([[cosine, -sine], [sine, cosine]])
    quat = ((1.0 + cosine) / 2.0) ** 0.5, ((1.0 - cosine) / 2.0) ** 0.5

    def place(x: float, name: str = body) -> list[float]:
        on_arm = np.array([x + shift, 0.0])
        return [*(on_arm if name == "arm" else axes.T @ (on_arm - tool)).tolist(), 0.0]

    centre = " ".join(map(repr, place(0.6, "tool")))
    text = ARM.replace('axis="0 0 1"', f'axis="0 0 1" pos="{shift} 0 0"').replace('"0.25 0', f'"{0.25 + shift} 0')
    text = text.replace(
        "</body>",
        f'<body name="tool" pos="{tool[0]} {tool[1]} 0" quat="{quat[0]!r} 0 0 {quat[1]!r}"><inertial pos="{centre}" '
        'mass="2" diaginertia="0.02 0.02 0.03"/></body></body>',
    )
    at, middle = (0.1, 0.35) if body == "arm" else (0.5, 0.65)
    part = {"mass": "0.4 kg", "inertia": ("1e-4 kg m^2",) * 3, "stiffness": "1 kN m/rad", "damping": "1 N m s/rad"}
    part |= {key: tuple(f"{x!r} m" for x in place(far)) for key, far in (("at", at), ("centre", middle))}
    links = Bench.model_validate({"links": {body: part}}).links
    return with_elastic_links(mechanism_from_text(text, "arm.xml"), links, {})


@pytest.mark.parametrize("body", ["arm", "tool"])
@pytest.mark.parametrize(("shift", "tool", "cosine"), [(0.3, (0.7, 0.0), 1.0), (-0.2, (0.9, 0.1), 0.28)])
def test_hinge_of_a_link_is_placed_in_the_frame_of_the_file(body, shift, tool, cosine):
    """However frames lie, the link is split where it was, into the same parts."""
    one, other = split_arm(body, 0.0, (0.4, 0.0), 1.0), split_arm(body, shift, tool, cosine)
    np.testing.assert_allclose(other.parameters, one.parameters, atol=1e-14)
    np.testing.assert_allclose(other.tree.joints[1].position, one.tree.joints[1].position, atol=1e-14)


@pytest.mark.parametrize(
    ("body", "x", "part", "there"),
    [("arm", 0.05, "arm", 0.05), ("arm", 0.4, "arm beyond its hinge", 0.3), ("tool", 0.0, "arm beyond its hinge", 0.4)],
)
def test_sensor_is_on_the_part_where_it_is_mounted(body, x, part, there):
    """Farther out than the hinge it moves with the part beyond, as with a body that is fixed there."""
    tool = '<body name="tool" pos="0.5 0 0"><inertial pos="0.05 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body>'
    arm = mechanism_from_text(ARM.replace("</body>", tool + "</body>"), "arm.xml")
    links = Bench.model_validate({"links": {"arm": TIP | {"stiffness": "1 kN m/rad", "damping": "1 N m s/rad"}}}).links
    bent = with_elastic_links(arm, links, {})
    found = part_at(bent, body, np.array([x, 0.0, 0.0]))
    assert bent.bodies[bent.tree.bodies.index(found.joint)] == part
    assert found.position.tolist() == [pytest.approx(there), 0.0, 0.0]


def test_link_in_a_loop_is_two_bodies():
    """Loads with a link in two parts are those of a file that has two bodies there; together they weigh what it did."""
    part = {
        "mass": "0.3 kg",
        "centre": ("0.04 m", "0 m", "0 m"),
        "inertia": ("2e-6 kg m^2", "5e-5 kg m^2", "5e-5 kg m^2"),
    }
    bent = {"at": ("0.02 m", "0 m", "0 m"), "stiffness": "5 kN m/rad", "damping": "1 N m s/rad"} | part
    split = with_elastic_links(MECHANISM, Bench.model_validate({"links": {"AC": bent}}).links, {})
    rest, name = 0.58909 - 0.3, beyond_hinge("AC")
    centre = (0.58909 * 0.0187 - 0.3 * 0.04) / rest
    about = 0.0006 + 0.58909 * 0.0187**2 - (5e-5 + 0.3 * 0.04**2) - rest * centre**2
    old = MECHANISM.text[MECHANISM.text.index('<inertial pos="0.0187') : MECHANISM.text.index("</body>")]
    new = f"""<inertial pos="{centre!r} 0 0" mass="{rest!r}" diaginertia="1e-05 {about!r} {about!r}"/>
        <body name="{name}" pos="0.02 0 0"><joint name="{name}" type="hinge" axis="0 0 1"/>
        <inertial pos="0.02 0 0" mass="0.3" diaginertia="2e-6 5e-5 5e-5"/><site name="C_AC" pos="0.13 0 0"/></body>"""
    text = MECHANISM.text.replace(old, new, 1).replace("</actuator>", f'<motor joint="{name}"/></actuator>')
    text = text.replace("-1.5707963267948966 0.78", "-1.5707963267948966 0 0.78")
    written = mechanism_from_text(text, "two.xml")
    time = np.linspace(0.0, 0.1, 101)
    q = np.column_stack([f + g * np.sin(h * time) for f, g, h in ((0.0, 0.1, 50), (0.0, 0.2, 30), (0.0, 0.05, 90))])
    v = np.column_stack([g * h * np.cos(h * time) for g, h in ((0.1, 50), (0.2, 30), (0.05, 90))])
    a = np.column_stack([-g * h**2 * np.sin(h * time) for g, h in ((0.1, 50), (0.2, 30), (0.05, 90))])
    found = []
    for one in (split, written):
        at = [one.coordinate_index(x) for x in ("A0", "B0", name)]
        samples = Samples(time, one.home[at] + q, v, a, joints=("A0", "B0", name))
        found.append(simulate(one, Closure(one).follow(samples)))
    assert split.total_mass == pytest.approx(MECHANISM.total_mass)
    np.testing.assert_allclose(parameters_on_links(split, MECHANISM).parameters, MECHANISM.parameters, atol=1e-15)
    np.testing.assert_allclose(
        np.hstack([found[0].force, found[0].moment]), np.hstack([found[1].force, found[1].moment]), atol=1e-9
    )
    for joint in ("A0", "B0", name):
        np.testing.assert_allclose(found[0].torque[joint], found[1].torque[joint], atol=1e-9)


@pytest.mark.parametrize(
    ("body", "more", "message"),
    [
        ("AB", {}, "no body 'AB': there are A0A, AC"),
        ("AC", {"at": ("0 m", "0 m", "0 m")}, "expected a place off the body's joint"),
        ("AC", {"mass": "2 kg"}, r"links\.AC: of its 0\.5891 kg no body is left .*: expected"),
        ("platform", {}, "links.platform: carries a payload"),
    ],
)
def test_wrong_links(body, more, message):
    """A link that is not there, or cannot have such a part, is refused with what is expected."""
    stated = TIP | {"mass": "0.1 kg", "stiffness": "1 kN m/rad", "damping": "1 N m s/rad"} | more
    with pytest.raises(RigError, match=message):
        run(benched(links={body: stated}))


def pushed(force, friction=0.5, mass="100 kg", count=6000, step=2.5e-5):
    """A frame on four feet under a force at its centre of mass, (n, 3) [N]: its motion, without a mechanism."""
    feet = [
        {"position": (f"{x} m", "0 m", f"{z} m"), "stiffness": "100 kN/m", "damping": "300 N s/m"}
        for x in (-0.3, 0.3)
        for z in (-0.3, 0.3)
    ]
    stated = {"mass": mass, "centre": ("0 m", "0 m", "0 m"), "inertia": "10 kg m^2", "mounts": feet}
    bench = MountedBase.model_validate(stated)
    base = bench.elastic()
    contact = None if friction is None else Contact.of(bench.mounts, base, np.array([0.0, -G, 0.0]), friction)
    core = bench_dynamics._Core.of(base, None, (np.zeros((0, 0)), np.zeros((6, 0))), count, contact)
    time = np.arange(count) * step
    wrench = np.hstack([np.stack([np.broadcast_to(f(time), time.shape) for f in force], axis=1), np.zeros((count, 3))])
    stepped = None if contact is None else core.stepped(step, np.zeros((1, 6, 6)), count)
    return time, BaseMotion(*core.respond(wrench, step, stepped))


def zero(time):
    """No force."""
    return 0.0 * time


def test_frame_that_hops():
    """Pulled up by more than its weight it lifts and lands: an equation written out, by scipy, to 1e-6."""

    def pull(time):
        return 2500.0 * np.sin(60.0 * time) ** 2

    time, moved_by = pushed((zero, pull, zero))

    def rates(t, y):
        pressure = max(100.0 * G - 4e5 * y[0] - 1200.0 * y[1], 0.0)
        return [y[1], (pull(t) + pressure - 100.0 * G) / 100.0]

    expected = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], "DOP853", time, rtol=1e-11, atol=1e-13, max_step=2e-4)
    assert expected.y[0].max() > 2 * 100.0 * G / 4e5
    assert np.abs(moved_by.displacement[:, 1] - expected.y[0]).max() < 1e-6 * np.ptp(expected.y[0])


def test_frame_that_slides():
    """Pushed aside by more than friction holds it goes off with what is left over; below, it is fixed."""
    steady = 800.0
    time, moved_by = pushed((lambda t: steady * np.minimum(t / 0.02, 1.0), zero, zero), friction=0.5)
    late = time > 0.1
    assert moved_by.acceleration[late, 0] == pytest.approx((steady - 0.5 * 100.0 * G) / 100.0, rel=1e-6)
    rough, fixed = (
        pushed((lambda t: steady * np.minimum(t / 0.02, 1.0), zero, zero), friction=friction)[1]
        for friction in (5.0, None)
    )
    np.testing.assert_allclose(rough.displacement, fixed.displacement, atol=1e-12)


def test_contact_without_lift_or_slide_is_none():
    """A heavy frame on rough ground moves as if it were fixed to it."""
    fixed, standing = run(RIG, {}), run(benched(contact={"friction": 50.0}, mass="1500 kg"), {})
    heavy = run(benched(mass="1500 kg"), {})
    np.testing.assert_allclose(standing.motion.acceleration, heavy.motion.acceleration, atol=1e-9)
    assert np.abs(fixed.motion.acceleration).max() > np.abs(heavy.motion.acceleration).max()


def test_a_fixed_base_does_not_move():
    """Nor with a mechanism that moves on it; what it is stated to weigh contradicts that."""
    for bench in (Bench(fixed=True), Bench(fixed=True, coupling="moving", weight=True)):
        still = run(RIG.model_copy(update={"bench": bench}), {})
        assert np.abs(still.motion.acceleration).max() < 1e-7
    with pytest.raises(ValidationError, match=r"fixed: expected a base without mass"):
        Bench(fixed=True, mass="150 kg")


def test_all_of_the_base_rides():
    """Force sensors under the whole base carry what its mounts do."""
    bench = RIG.bench
    rider = {
        "mass": "150 kg",
        "centre": [f"{x} m" for x in bench.centre],
        "inertia": [f"{x} kg m^2" for x in bench.inertia],
    }
    rig = benched(rider=rider)
    done = run(rig, {})
    base = done.base
    carried = done.motion.displacement @ base.stiffness.T + done.motion.velocity @ base.damping.T
    np.testing.assert_allclose(done.supported_wrench, carried, atol=1e-9 * np.abs(carried).max())
    assert np.abs(supported(done, rig) - done.supported_wrench).max() < 1e-6 * np.abs(carried).max()
    own = rigid_body(150.0, np.zeros(3), np.eye(3))
    assert np.abs(done.transmitted_wrench - done.supported_wrench).max() > np.abs(own[0, 0])


def test_stack_grows_outwards():
    """A counter-mass of M kg on plates of L kg/m has its centre M / 2L beyond its plane."""
    stacked = {"planes": {"counter_A0A": "-30 mm"}, "stacks": {"counter_A0A": "200 kg/m"}}
    done = run(benched(**stacked), BUILT)
    row = done.mechanism.parameters[done.mechanism.body_index("A0A")]
    assert row[3] == pytest.approx(-24.2626 * (0.03 + 24.2626 / 400.0))


def test_unstated_mass_is_carried_like_payload():
    """The platform with 1 kg more than stated moves as one of 6 kg; an unknown body is refused."""
    heavier = simulate_run(benched(), MECHANISM, PlannedRun("r", 6.0, BUILT, "x", 29.43, 1))
    unstated = run(benched(unstated_mass={"platform": "1 kg"}), BUILT)
    np.testing.assert_allclose(unstated.response.force, heavier.response.force, atol=1e-9)
    with pytest.raises(RigError, match="no body 'nothing'"):
        run(benched(unstated_mass={"nothing": "1 kg"}), BUILT)


def test_encoders_turn_with_the_motors():
    """A motor without a control is where the command is; its arm is not, as the platform shows.

    For the conditions of balance, written beside the logs as true, what is on the hubs counts as on the arms.
    """
    rig = benched(**drives(control=None))
    done, rigid = run(rig, BUILT), run(RIG, BUILT)
    seen, still = true_signals(rig, done), true_signals(RIG, rigid)
    np.testing.assert_allclose(seen["theta1"], still["theta1"], atol=1e-12)
    assert np.abs(seen["PlatX"] - still["PlatX"]).max() > 0.1
    on_links = parameters_on_links(done.mechanism, MECHANISM).parameters[:, :4]
    np.testing.assert_allclose(on_links, rigid.mechanism.parameters[:, :4], atol=1e-12)


WRONG = {
    r"no driven joint 'A'.*A0, B0": {"A": {"control": CONTROL}},
    r"no site 'counter_B0B' there: expected counter_A0A": {
        "A0": {"transmission": {**SPRING, "motor_side": ["counter_B0B"]}}
    },
    r"needs the inertia of its rotor: state bench\.rotors\.A0": {"A0": {"transmission": SPRING, "control": CONTROL}},
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_drives(message):
    """A drive that cannot be simulated is refused with what is there."""
    with pytest.raises(RigError, match=message):
        simulate_run(benched(drives=WRONG[message]), MECHANISM, PlannedRun("r", 5.0, {}, "x", 29.43, 1))


def test_foot_without_load():
    """Feet that all lie on one side of the centre of mass do not carry it by pressure."""
    rig = benched(contact={"friction": 0.5}, centre=["2 m", "-0.2 m", "0 m"])
    with pytest.raises(RigError, match=r"bench\.mounts\.\d carries -"):
        simulate_run(rig, MECHANISM, PlannedRun("r", 5.0, {}, "x", 29.43, 1))
