"""A pendulum on a base on mounts, by hand from Newton and Euler: rotations not linearised, integrated by scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from balance.balancing.conditions import balance_conditions
from balance.closure import Closure
from balance.dynamics.moving_base import displacement_at, locked_inertia
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion import Samples
from testbench.kinematics.base_motion import BaseAcceleration
from testbench.kinematics.gaps import Gaps, ValidSamples
from testbench.kinematics.smoothing_and_derivatives import Grid
from testbench.rig.bench import Bench
from testbench.trimming.base_coupling import BaseCoupling
from testbench.trimming.vibration_regression import ShakenBase

PENDULUM = """
<mujoco model="pendulum">
  <compiler angle="radian"/>
  <option gravity="0 -9.81 0"/>
  <worldbody><body name="base"><body name="bob" pos="0.1 0.3 0">
    <joint name="J" type="hinge" axis="0 0 1"/>
    <inertial pos="0.4 0 0" mass="0.001" diaginertia="1e-12 1e-12 1e-12"/>
  </body></body></worldbody>
  <actuator><motor name="motor" joint="J"/></actuator>
</mujoco>
"""
PIVOT, ROD = np.array([0.1, 0.3]), 0.4  # [m]
LIGHT = 1e-3  # [kg], a bob that answers to no motion of the base
MASS, INERTIA, CENTRE = 60.0, 5.0, np.array([0.0, 0.1])
FEET = np.array([[-0.3, -0.5], [0.3, -0.5]])
SPRING, DAMPER = np.array([6e4, 9e4]), np.array([300.0, 400.0])  # of the two legs of each side
PLACE = np.array([0.2, 0.4])
GRID = Grid(0.0, 1e-3, 1800)


def angle(t):
    """Angle of the pendulum, its rate and second rate [rad]: a swing of 1.2 rad, and rest."""
    s, by, length = np.clip((t - 0.2) / 0.5, 0.0, 1.0), 1.2, 0.5
    return (
        -0.3 + by * s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3),
        by / length * 140.0 * s**3 * (1.0 - s) ** 3,
        by / length**2 * 420.0 * s**2 * (1.0 - s) ** 2 * (1.0 - 2.0 * s),
    )


def by_hand(gravity, bob_mass=LIGHT):
    """What an ideal accelerometer at PLACE shows less its reading at rest, (n / 5, 2) [m/s2]."""
    down = np.array([0.0, -gravity])

    def turned(phi):
        return np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])

    def cross(a, b):
        return a[0] * b[1] - a[1] * b[0]

    def bob(t):
        """Place, speed and acceleration on the base, base axes."""
        q, v, a = angle(t)
        along, across = np.array([np.cos(q), np.sin(q)]), np.array([-np.sin(q), np.cos(q)])
        return PIVOT + ROD * along, ROD * v * across, ROD * (a * across - v * v * along)

    start, lever = bob(0.0)[0], FEET[1, 0]
    rest = -MASS * down / 2.0 - bob_mass * down / 2.0
    offset = (cross(CENTRE, MASS * down) + cross(start, bob_mass * down)) / (
        2.0 * lever
    )  # of the feet about the origin
    preload = np.array([rest + [0.0, offset], rest - [0.0, offset]])

    def accelerations(t, x):
        """Of the origin, floor axes, and of the turning."""
        (u, phi), (v, omega) = (x[:2], x[2]), (x[3:5], x[5])
        turn, (at, slides, moves) = turned(phi), bob(t)
        force, moment = np.zeros(2), 0.0
        for foot, held in zip(FEET, preload, strict=True):
            arm = turn @ foot
            given = held - SPRING * (u + arm - foot) - DAMPER * (v + omega * np.array([-arm[1], arm[0]]))
            force, moment = force + given, moment + cross(arm, given)
        matrix = np.zeros((3, 3))
        matrix[2, 2] = INERTIA
        for mass, place, own in (
            (MASS, turn @ CENTRE, np.zeros(2)),
            (bob_mass, turn @ at, turn @ moves + 2.0 * omega * np.array([[0.0, -1.0], [1.0, 0.0]]) @ turn @ slides),
        ):
            carried = mass * (down - own + omega**2 * place)
            force, moment = force + carried, moment + cross(place, carried)
            by = np.array([[1.0, 0.0, -place[1]], [0.0, 1.0, place[0]]])
            matrix += mass * by.T @ by
        return np.linalg.solve(matrix, [*force, moment])

    found = solve_ivp(
        lambda t, x: np.concatenate([x[3:], accelerations(t, x)]),
        (0.0, GRID.time[-1]),
        np.zeros(6),
        method="DOP853",
        t_eval=GRID.time[::5],
        rtol=1e-8,
        atol=1e-13,
        max_step=0.01,
    )
    shown = []
    for t, x in zip(found.t, found.y.T, strict=True):
        turn, (ax, ay, alpha) = turned(x[2]), accelerations(t, x)
        arm = turn @ PLACE
        felt = np.array([ax, ay]) + alpha * np.array([-arm[1], arm[0]]) - x[5] ** 2 * arm - down
        shown.append(turn.T @ felt + down)
    return np.array(shown)


def shaken_base(gravity, bob_mass=LIGHT):
    """The same by the package, its gravity (3,) [m/s2], and its bench."""
    model = mechanism_from_text(PENDULUM.replace('mass="0.001"', f'mass="{bob_mass}"'), "pendulum")
    bench = Bench.model_validate({
        "mass": f"{MASS} kg",
        "centre": [f"{CENTRE[0]} m", f"{CENTRE[1]} m", "0 m"],
        "inertia": [f"{i} kg m^2" for i in (3.0, 4.0, INERTIA)],
        "mounts": [
            {
                "position": [f"{x} m", f"{y} m", f"{z} m"],
                "stiffness": [f"{k / 2.0} N/m" for k in (*SPRING, 6e4)],
                "damping": [f"{c / 2.0} N s/m" for c in (*DAMPER, 300.0)],
            }
            for x, y in FEET
            for z in (-0.3, 0.3)
        ],
    })  # fmt: skip
    path = Closure(model).follow(Samples(GRID.time, *(x[:, None] for x in angle(GRID.time)), ("J",)))
    rows = displacement_at(np.array([*PLACE, 0.0]))[:2]
    sensors = BaseAcceleration("daq", rows, GRID.time, np.zeros((GRID.count, 2)), ())
    base = bench.elastic(locked_inertia(model, path.q[0]), gravity)
    valid = ValidSamples("r", GRID, Gaps(), 0.0)
    return ShakenBase(model, GRID, path, base, gravity, sensors, sensors.values, slice(None), 40.0, "", valid), bench


def test_the_base_answers_to_weight_as_it_rocks():
    """Readings of a pendulum of one gram on 60 kg: to 1e-4 of their largest, of which weight makes a twentieth.

    To first order in the base's motion; the bob is 2e-5 of the base.
    """
    shown, expected = [], []
    for gravity in (0.0, 9.81):
        run, _ = shaken_base(np.array([0.0, -gravity, 0.0]))
        shown.append(run.answers(run.wrench_regressor(run.path))[::5] @ run.model.pi)
        expected.append(by_hand(gravity))
    size = np.abs(expected).max()
    assert np.array(shown) == pytest.approx(np.array(expected), abs=1e-4 * size)
    assert np.abs(expected[1] - expected[0]).max() > 0.05 * size


@pytest.mark.parametrize(
    ("gravity", "bob", "bounds"),
    [
        (0.0, 4.0, [[0.3, 5e-3, 0.0], [0.4, 2e-2, 1e-3]]),
        (9.81, 4.0, [[0.3, 5e-3, 0.0], [0.4, 2e-2, 1e-3]]),
        (9.81, 45.0, [[1.5, 5e-2, 0.0], [2.0, 0.2, 2e-2]]),
    ],
)
def test_what_a_heavy_mechanism_does_to_its_base(gravity, bob, bounds):
    """A bob of 4 kg on 60 kg: readings are off by a third without the coupling, by a hundredth with first order alone.

    With second order by less than a thousandth: the base turns by 20 mrad. A bob of 45 kg turns it ten times as far.
    """
    run, bench = shaken_base(np.array([0.0, -gravity, 0.0]), bob)
    linear = run.smooth(run.answers(run.wrench_regressor(run.path)) @ run.model.pi)
    whole, second = BaseCoupling(run, bench, np.tile([*PLACE, 0.0], (2, 1)), run.model, exact=True).readings()
    expected = by_hand(gravity, bob)
    off = [np.abs((linear + added)[::5] - expected).max() for added in (0.0, whole - second, whole)]
    least, most = np.abs(expected).max() * np.array(bounds)
    assert (off > least).all()
    assert (off < most).all()


def test_mass_at_a_joint_is_held_by_the_base_alone(monkeypatch):
    """A twentieth more of a bob's mass at its pivot, which is part of the base by hand: 2 % of the readings."""
    run, bench = shaken_base(np.array([0.0, -9.81, 0.0]), 4.0)
    linear = run.smooth(run.answers(run.wrench_regressor(run.path)) @ run.model.pi)
    coupling = BaseCoupling(run, bench, np.tile([*PLACE, 0.0], (2, 1)), run.model, exact=True)
    more = coupling.with_heavier_joints(balance_conditions(run.model), 0.05)
    mass, at = MASS + 0.2, (MASS * CENTRE + 0.2 * PIVOT) / (MASS + 0.2)
    own = MASS * (CENTRE - at) @ (CENTRE - at) + 0.2 * (PIVOT - at) @ (PIVOT - at)
    for name, value in {"MASS": mass, "CENTRE": at, "INERTIA": INERTIA + own}.items():
        monkeypatch.setattr(f"{__name__}.{name}", value)
    expected = by_hand(9.81, 4.0)
    off = [np.abs((linear + one.readings()[0])[::5] - expected).max() for one in (coupling, more)]
    assert off[1] < 1e-3 * np.abs(expected).max() < 0.02 * np.abs(expected).max() < off[0]
