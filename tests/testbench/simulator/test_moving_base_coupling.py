"""Moving base and moving mechanism together, held against MuJoCo, particles and statics: inertia, torques, gravity."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.moving_base import apparent_gravity, displacement_at, first_moment, gravity_in_tilted_axes
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig import Rig
from testbench.rig.bench import Bench
from testbench.simulator import bench_dynamics
from testbench.simulator import run as runs
from testbench.simulator.moving_base_coupling import (
    second_moment,
    velocity_cross_product,
    weight_wrench_change,
)
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import base_acceleration

from .bench import BUILT, MECHANISM, RIG, benched, run, supported
from .freebase import FreeBase

PLANES = {"AC": "25 mm", "BD": "25 mm", "platform": "10 mm", "counter_A0A": "-40 mm", "counter_B0B": "-40 mm"}
ROTORS = {"A0": {"inertia": "2e-4 kg m^2", "ratio": 30.0}, "B0": {"inertia": "2e-4 kg m^2", "ratio": -30.0}}


def missing(rig: Rig, done, masses, gravity=(0.0, 0.0, 0.0)) -> np.ndarray:
    """What mounts must give and do not at the motion found, to first order, as a share of the wrench, (6,)."""
    samples = np.arange(0, len(done.time), 97)
    referee, bare = FreeBase(rig, done, 5.0, masses, gravity), rig.bench.elastic()
    asked = referee.linear(samples)[0]
    given = -(done.motion.displacement @ bare.stiffness.T + done.motion.velocity @ bare.damping.T)[samples]
    at_rest = referee.loads(samples[:1], 0.0)[0]
    return np.abs(asked - at_rest - given).max(axis=0) / np.abs(done.wrench).max()


@pytest.mark.parametrize("masses", [{}, BUILT])
@pytest.mark.parametrize("extra", [{}, {"planes": PLANES}, {"rotors": ROTORS}])
def test_equation_of_motion(masses, extra):
    """The motion found satisfies MuJoCo's equation to first order; locked, it misses it by parts in a thousand."""
    moving, locked = benched(coupling="moving", **extra), benched(**extra)
    left, left_out = (missing(rig, run(rig, masses), masses).max() for rig in (moving, locked))
    assert left < 3e-5
    assert 4e-4 < left_out < 2e-2


def test_error_of_leaving_it_out():
    """On the default bench, base accelerations with locked inertia are within 1 %; drives feel the base."""
    moving, locked = run(benched(coupling="moving"), {}), run(RIG, {})
    difference = moving.motion.acceleration - locked.motion.acceleration
    assert np.abs(difference[:, :3]).max() < 0.01 * np.abs(locked.motion.acceleration[:, :3]).max()
    more = np.abs(moving.torque["A0"] - locked.torque["A0"]).max() / np.abs(locked.torque["A0"]).max()
    assert 0.1 < more < 0.4


@pytest.mark.parametrize("rotors", [{}, ROTORS])
def test_torque_on_the_moving_base(rotors):
    """Motors carry what the base does, Coriolis and tilt in gravity too: MuJoCo's torques to first order."""
    rig = benched(coupling="moving", weight=True, rotors=rotors)
    done = run(rig, {})
    samples = np.arange(0, len(done.time), 97)
    found = np.stack(list(done.torque.values()), axis=1)[samples]
    referee = FreeBase(rig, done, 5.0, {}, MECHANISM.gravity)
    expected, on_rest = referee.linear(samples)[1], referee.loads(samples, 0.0)[1]
    scale = np.abs(expected - on_rest).max()
    assert np.stack(list(done.response.torque.values()), axis=1)[samples] == pytest.approx(on_rest, abs=1e-8)
    assert scale > 0.1 * np.abs(expected).max()
    assert np.abs(found - expected).max() < 1e-4 * scale


def test_heavy_base_is_not_coupled():
    """On a base that does not move there is nothing to couple."""
    heavy = {"mass": "1e8 kg", "inertia": "1e8 kg m^2"}
    moving, locked = run(benched(coupling="moving", **heavy)), run(benched(**heavy))
    np.testing.assert_allclose(moving.transmitted_wrench, locked.wrench, rtol=0, atol=1e-3)


def test_rounds_that_do_not_agree(monkeypatch):
    """A motion that has not been found is refused and not returned."""
    monkeypatch.setattr(bench_dynamics, "ROUNDS", 1)
    with pytest.raises(RigError, match=r"bench\.coupling"):
        simulate_run(benched(coupling="moving"), MECHANISM, PlannedRun("r", 5.0, {}, "x", 29.43, 1))


SPATIAL = """
<mujoco model="spatial"><compiler angle="radian"/><worldbody><body name="base">
  <body name="one"><joint name="q1" type="hinge" axis="0 0 1"/>
    <inertial pos="0.1 0.02 0.05" mass="2" diaginertia="0.02 0.03 0.04"/>
    <body name="two" pos="0.3 0 0.1"><joint name="q2" type="hinge" axis="0 1 0"/>
      <inertial pos="0.05 -0.03 0.2" mass="1.5" diaginertia="0.03 0.02 0.01"/></body></body>
</body></worldbody></mujoco>
"""


def particles(row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Six particles with a body's mass, centre and second moments: masses (6,), places (6, 3)."""
    m, centre = row[0], row[1:4] / row[0]
    about = second_moment(row) - m * np.outer(centre, centre)
    size, axes = np.linalg.eigh(about)
    arms = axes.T * np.sqrt(3.0 * size / m)[:, None]
    return np.full(6, m / 6.0), centre + np.vstack([arms, -arms])


def test_second_moment():
    """Particles placed by it have the body's inertia."""
    row = mechanism_from_text(SPATIAL, "spatial").parameters[1]
    mass, place = particles(row)
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, place, strict=True))
    xx, xy, yy, xz, yz, zz = row[4:]
    assert inertia == pytest.approx(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def test_sum_over_particles():
    """In space the sum over bodies is the sum over particles, each moved by its own finite difference."""
    mechanism = mechanism_from_text(SPATIAL, "spatial")
    q, rates = np.array([0.3, -0.7]), np.array([[2.0, -1.0], [0.5, 3.0]])

    def places(at: np.ndarray) -> np.ndarray:
        c1, s1, c2, s2 = np.cos(at[0]), np.sin(at[0]), np.cos(at[1]), np.sin(at[1])
        first = np.array([[c1, -s1, 0], [s1, c1, 0], [0, 0, 1]])
        second = first @ np.array([[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]])
        origin = first @ [0.3, 0.0, 0.1]
        return np.vstack([bodies[0][1] @ first.T, origin + bodies[1][1] @ second.T])

    bodies = [particles(row) for row in mechanism.parameters]
    mass, step = np.concatenate([m for m, _ in bodies]), 1e-6
    one, two = ((places(q + step * r) - places(q - step * r)) / (2 * step) for r in rates)
    expected = (mass[:, None] * np.cross(one, two)).sum(axis=0)
    assert np.abs(expected).min() > 1e-3
    assert velocity_cross_product(mechanism, q[None], rates[:1], rates[1:])[0] == pytest.approx(expected, rel=1e-7)


def test_nothing_along_itself():
    """It is odd: no sweep of a motion across itself, and the opposite the other way round."""
    mechanism = load_mechanism("parallelogram-6bar")
    closure = Closure(mechanism)
    q = closure.states(5, seed=2)
    v, u = closure.velocities(q, 1), closure.velocities(q, 2)
    assert velocity_cross_product(mechanism, q, v, v) == pytest.approx(np.zeros((5, 3)), abs=1e-15)
    assert velocity_cross_product(mechanism, q, v, u) == pytest.approx(
        -velocity_cross_product(mechanism, q, u, v), abs=1e-15
    )


G = np.array([0.0, -9.81, 0.0])


def test_quasi_static(monkeypatch):
    """So slow that nothing accelerates, the base follows the platform's weight: x = K^-1 of its moment, g phi shows."""
    monkeypatch.setattr(runs, "rate_hz", lambda _: 500.0)
    rig = benched(weight=True)
    done = run(rig, acceleration=1e-4)
    middle = len(done.time) // 3
    wandered = weight_wrench_change(done.response.weight_moment)[middle]
    assert wandered[5] == pytest.approx(-9.81 * _first_moment_x(done, middle), rel=1e-9)
    expected = np.linalg.solve(done.base.stiffness, wandered)
    assert done.motion.displacement[middle] == pytest.approx(expected, rel=2e-2, abs=2e-8)
    shown = base_acceleration(rig.base_accelerometers["base_acc"], done)["x"][middle]
    assert shown == pytest.approx(9.81 * done.motion.displacement[middle, 5], rel=2e-2)
    assert abs(shown) > 1e-5


def _first_moment_x(done, i: int) -> float:
    """First moment of mass along x less that at the start, from places of the centres in closed form [kg m]."""
    q = done.trajectory.q[[0, i]]
    names = {name: MECHANISM.coordinate_index(name) for name in ("A0", "B0", "A", "B", "platform_x")}
    x = 5.0 * q[:, names["platform_x"]]
    for upper, lower in (("A0", "A"), ("B0", "B")):
        a, b = q[:, names[upper]], q[:, names[upper]] + q[:, names[lower]]
        x = x + 1.04642 * 0.05943 * np.cos(a) + 0.58909 * (0.15 * np.cos(a) + 0.0187 * np.cos(b))
    return float(x[1] - x[0])


def test_wandering_against_mujoco():
    """In gravity MuJoCo asks the mounts for the wandering moment, and gets it to first order from mounts that turn."""
    rig = benched(weight=True, coupling="moving")
    done, still = run(rig, acceleration=9.81), run(benched(coupling="moving"), acceleration=9.81)
    samples = np.arange(0, len(done.time), 97)
    referee = FreeBase(rig, done, 5.0, {}, G)
    asked = referee.linear(samples)[0] - referee.loads(samples[:1], 0.0)[0]
    bare = rig.bench.elastic(done.mechanism_inertia)
    sunk = np.linalg.solve(bare.stiffness, np.r_[bare.mass[0, 0] * G, np.cross(first_moment(bare.mass), G)])
    given = np.zeros((len(samples), 6))
    for mount in rig.bench.mounts:
        at = np.array(mount.position)
        held = -np.array(mount.stiffness) * (displacement_at(at) @ sunk)
        x, v = done.motion.displacement[samples], done.motion.velocity[samples]
        moved, moving = (s[:, :3] + np.cross(s[:, 3:], at) for s in (x, v))
        force = -np.array(mount.stiffness) * moved - np.array(mount.damping) * moving
        given += np.hstack([force, np.cross(at, force) + np.cross(np.cross(x[:, 3:], at), held)])
    wandered = np.abs(weight_wrench_change(done.response.weight_moment)[:, 5]).max()
    assert wandered > 1.0
    assert np.abs(asked - given).max() < 3e-5 * np.abs(done.wrench).max()
    assert np.abs(done.motion.displacement - still.motion.displacement)[:, 5].max() > 1e-6


def test_a_pendulum_upside_down():
    """A frame on legs k at half width b turns about z by 2 k b^2 less m g h; as m g h reaches it, it would fall."""
    legs = [
        {"position": [f"{x} m", "-1 m", f"{z} m"], "stiffness": ["1e9 N/m", "1e5 N/m", "1e9 N/m"], "damping": "1 N s/m"}
        for x in (-0.2, 0.2)
        for z in (-0.2, 0.2)
    ]
    frame = {"mass": "100 kg", "centre": ["0 m", "0 m", "0 m"], "inertia": "1 kg m^2", "mounts": legs}
    bench = Bench.model_validate(frame)
    added = bench.elastic(gravity=G).stiffness - bench.elastic().stiffness
    assert added[3:, 3:] == pytest.approx(np.diag([-981.0, 0.0, -981.0]), abs=1e-9)
    assert not np.any(added[:3])


def test_what_supports_carry():
    """The sensors' wrench holds the wandering moment and the weight that turns with the base; the bare base answers."""
    rig = benched(weight=True)
    done = run(rig)
    total = supported(done, rig)
    m, bare = done.motion, done.base.mass - done.mechanism_inertia
    moved = m.acceleration @ bare.T + m.velocity @ done.base.damping.T + m.displacement @ done.base.stiffness.T
    turned = total - moved
    weight = done.mechanism.total_mass * 9.81
    np.testing.assert_allclose(turned[:, 0], -weight * m.displacement[:, 5], rtol=0, atol=1e-9)
    assert np.abs(turned[:, 0]).max() > 0.1
    np.testing.assert_allclose(turned[:, 1], 0.0, atol=1e-9)


def test_tilt_at_rest():
    """Sensors that were zeroed level show g sin(tilt) at rest, and the drives carry the weight of the tilted arms."""
    rig = benched(tilt=["0 deg", "0 deg", "2 deg"])
    done = run(rig)
    shown = base_acceleration(rig.base_accelerometers["base_acc"], done)
    assert shown["x"][0] == pytest.approx(9.81 * np.sin(np.radians(2.0)))
    assert shown["y"][0] == pytest.approx(9.81 * (np.cos(np.radians(2.0)) - 1.0))
    assert shown["z"][0] == pytest.approx(0.0, abs=1e-15)
    assert abs(done.torque["A0"][0] - run(RIG).torque["A0"][0]) > 0.01


def test_tilt_by_turning_gravity():
    """A base turned by a rotation vector sees gravity turned back: lengths stay, small turns add phi x g."""
    turn = np.array([1e-4, 2e-4, -3e-4])
    assert np.linalg.norm(gravity_in_tilted_axes(G, 1e3 * turn)) == pytest.approx(9.81)
    moved = np.r_[np.zeros(3), turn][None]
    assert G - gravity_in_tilted_axes(G, turn) == pytest.approx(apparent_gravity(G, moved)[0], abs=1e-6)


def test_off_is_off():
    """Without weight and tilt nothing of gravity reaches sensors or base."""
    done = run(RIG)
    assert np.array_equal(done.sensed_acceleration, done.motion.acceleration)
    assert not np.any(done.gravity)
