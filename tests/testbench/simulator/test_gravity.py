"""Gravity: the weight's wandering moment, accelerometers that tilt, a base that does not stand level."""

import numpy as np
import pytest

from balance.dynamics.moving_base import displacement_at, first_moment
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import PlannedRun
from testbench.rig import Rig, load_rig
from testbench.rig.bench import Bench
from testbench.rig.support_loads import elastic_base, wrench_transport
from testbench.simulator import moving_base_coupling
from testbench.simulator import run as runs
from testbench.simulator.run import simulate_run
from testbench.simulator.sensors import base_acceleration, true_signals

from .freebase import FreeBase

RIG, MECHANISM = load_rig("parallelogram-6bar"), load_mechanism("parallelogram-6bar")
G = np.array([0.0, -9.81, 0.0])


def benched(**settings) -> Rig:
    """The shipped rig with more in its bench."""
    stated = Bench.model_validate(settings)
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={k: getattr(stated, k) for k in settings})})


def run(rig: Rig, acceleration: float = 29.43):
    """5 kg without counter-masses along x."""
    return simulate_run(rig, MECHANISM, PlannedRun("r", 5.0, {}, "x", acceleration, 1))


def test_quasi_static(monkeypatch):
    """So slow that nothing accelerates, the base follows the platform's weight: x = K^-1 of its moment, g phi shows."""
    monkeypatch.setattr(runs, "rate_hz", lambda _: 500.0)
    rig = benched(weight=True)
    done = run(rig, 1e-4)
    middle = len(done.time) // 3
    wandered = moving_base_coupling.weight_wrench_change(done.response.weight_moment)[middle]
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
    done, still = run(rig, 9.81), run(benched(coupling="moving"), 9.81)
    samples = np.arange(0, len(done.time), 97)
    referee = FreeBase(rig, done, 5.0, {}, G)
    asked = referee.linear(samples)[0] - referee.loads(samples[:1], 0.0)[0]
    bare = elastic_base(rig.bench, done.mechanism_inertia)
    sunk = np.linalg.solve(bare.stiffness, np.r_[bare.mass[0, 0] * G, np.cross(first_moment(bare.mass), G)])
    given = np.zeros((len(samples), 6))
    for mount in rig.bench.mounts:
        at = np.array(mount.position)
        held = -np.array(mount.stiffness) * (displacement_at(at) @ sunk)
        x, v = done.motion.displacement[samples], done.motion.velocity[samples]
        moved, moving = (s[:, :3] + np.cross(s[:, 3:], at) for s in (x, v))
        force = -np.array(mount.stiffness) * moved - np.array(mount.damping) * moving
        given += np.hstack([force, np.cross(at, force) + np.cross(np.cross(x[:, 3:], at), held)])
    wandered = np.abs(moving_base_coupling.weight_wrench_change(done.response.weight_moment)[:, 5]).max()
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
    base = elastic_base(Bench.model_validate(frame))
    added = moving_base_coupling.gravitational_stiffness(
        Bench.model_validate(frame).mounts, base.stiffness, base.mass, G
    )
    assert added[3:, 3:] == pytest.approx(np.diag([-981.0, 0.0, -981.0]), abs=1e-9)
    assert not np.any(added[:3])


def test_what_supports_carry():
    """The sensors' wrench holds the wandering moment and the weight that turns with the base; the bare base answers."""
    rig = benched(weight=True)
    done = run(rig)
    seen, total = true_signals(rig, done), np.zeros((len(done.time), 6))
    for name, sensor in rig.supports.items():
        load_of = np.zeros_like(total)
        for column in sensor.columns(name):
            load_of[:, ("Fx", "Fy", "Fz", "Mx", "My", "Mz").index(column.component)] = seen[column.channel]
        total += load_of @ wrench_transport(np.array(sensor.position)).T
    m, bare = done.motion, done.base.mass - done.mechanism_inertia
    moved = m.acceleration @ bare.T + m.velocity @ done.base.damping.T + m.displacement @ done.base.stiffness.T
    turned = total - moved
    weight = done.mechanism.total_mass * 9.81
    assert turned[:, 0] == pytest.approx(-weight * m.displacement[:, 5], abs=1e-9)
    assert np.abs(turned[:, 0]).max() > 0.1
    assert turned[:, 1] == pytest.approx(np.zeros(len(turned)), abs=1e-9)


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
    assert np.linalg.norm(moving_base_coupling.gravity_in_tilted_axes(G, 1e3 * turn)) == pytest.approx(9.81)
    moved = np.r_[np.zeros(3), turn][None]
    assert G - moving_base_coupling.gravity_in_tilted_axes(G, turn) == pytest.approx(
        moving_base_coupling.apparent_gravity(G, moved)[0], abs=1e-6
    )


def test_off_is_off():
    """Without weight and tilt nothing of gravity reaches sensors or base."""
    done = run(RIG)
    assert done.sensed_acceleration == pytest.approx(done.motion.acceleration, abs=0.0)
    assert not np.any(done.gravity)
