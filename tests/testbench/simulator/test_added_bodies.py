"""Planes and rotors: what is balanced in projection still tips the base; momentum and power of what is geared."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mjcf_parser import mechanism_from_text
from balance.motion.motion_files import load_motion
from testbench.errors import RigError
from testbench.rig.bench import Rotor
from testbench.simulator import added_bodies
from testbench.simulator.added_bodies import with_planes

from .bench import EXACT, MECHANISM, RIG, run

ROTOR = Rotor.model_validate({"inertia": "2e-4 kg m^2", "ratio": 30.0})
PLANES = {"A0A": 0.01, "AC": 0.025, "BD": 0.025, "platform": -0.01, "counter_A0A": -0.04, "counter_B0B": -0.04}


def loaded(planes):
    """5 kg with exact counter-masses."""
    return with_planes(MECHANISM, planes).with_payload({"platform": 5.0}).with_counter_mass(EXACT)


def responses(planes):
    """In its plane, and with planes, along a triangle."""
    flat, deep = loaded({}), loaded(planes)
    trajectory = Closure(flat).follow(load_motion("triangle").sample(1000.0))
    return trajectory, simulate(flat, trajectory), simulate(deep, trajectory)


def test_as_in_a_file():
    """Parameters are those of a file with these places: the file itself is changed, and read anew."""
    text = MECHANISM.text.replace('<inertial pos="0.0187 0 0"', '<inertial pos="0.0187 0 0.025"', 1)
    text = text.replace('name="counter_A0A" pos="-0.03755 0 0"', 'name="counter_A0A" pos="-0.03755 0 -0.04"')
    text = text.replace('<inertial pos="0 0 0" mass="1.451"', '<inertial pos="0 0 -0.01" mass="1.451"')
    read = mechanism_from_text(text, "changed").with_payload({"platform": 5.0}).with_counter_mass(EXACT)
    found = loaded({"AC": 0.025, "counter_A0A": -0.04, "platform": -0.01})
    assert found.parameters == pytest.approx(read.parameters, abs=1e-14)
    assert not np.allclose(found.parameters, loaded({}).parameters)


def test_planes_of_a_body_that_is_fixed_to_another():
    """They lie along the axis that both turn about, here against the hand's x axis, and so do those of its sites."""
    text = MECHANISM.text.replace(
        '<site name="counter_A0A"',
        '<body name="hand" euler="0 1.5707963267948966 0"><inertial pos="{} 0 0" mass="2" diaginertia="1 1 1"/>'
        '<site name="s" pos="{} 0 0"/></body><site name="counter_A0A"',
    )
    flat, deep = (mechanism_from_text(text.format(*z), "hand.xml") for z in ((0, 0), (-0.1, -0.2)))
    found = with_planes(flat, {"hand": 0.1, "s": 0.2}).with_counter_mass({"s": 3.0}).parameters
    assert found == pytest.approx(deep.with_counter_mass({"s": 3.0}).parameters, abs=1e-14)


def test_couples_are_force_times_distance():
    """A force in another plane adds Mx = -z Fy and My = z Fx, here of the counter-masses alone, and nothing else."""
    trajectory, flat, deep = responses({"counter_A0A": -0.04, "counter_B0B": -0.04})
    disc = np.zeros((len(trajectory.time), 3))
    for joint, mass in zip(("A0", "B0"), EXACT.values(), strict=True):
        i = MECHANISM.coordinate_index(joint)
        q, v, a = trajectory.q[:, i], trajectory.v[:, i], trajectory.a[:, i]
        outward = np.column_stack([np.cos(q), np.sin(q), 0 * q])
        across = np.column_stack([-np.sin(q), np.cos(q), 0 * q])
        disc += mass * 0.03755 * (across * a[:, None] - outward * v[:, None] ** 2)
    couple = np.cross([0.0, 0.0, -0.04], disc)
    assert np.abs(couple).max() > 1.0
    assert deep.moment - flat.moment == pytest.approx(couple, abs=1e-9)
    assert deep.force == pytest.approx(flat.force, abs=1e-9)
    assert deep.torque["A0"] == pytest.approx(flat.torque["A0"], abs=1e-9)


def test_balanced_and_yet_tipping():
    """With exact counter-masses no force is left, and couples about x and y remain."""
    _, _, deep = responses(PLANES)
    assert np.abs(deep.force).max() < 1e-3
    assert np.abs(deep.moment[:, :2]).max(axis=0).min() > 1.0


def test_all_in_one_other_plane():
    """Balanced, and all moved out alike, nothing changes: no force, no couple."""
    everything = {**dict.fromkeys(MECHANISM.own_mass, 0.1), "counter_A0A": 0.1, "counter_B0B": 0.1}
    _, flat, deep = responses(everything)
    assert deep.moment == pytest.approx(flat.moment, abs=1e-4)


def test_own_inertia_of_the_counter_masses():
    """The shaking moment about z holds the discs' own inertia: m k^2 times what their arms turn."""
    text = MECHANISM.text.replace('radius_of_gyration" data="0.06"', 'radius_of_gyration" data="0"')
    points = mechanism_from_text(text, "points").with_payload({"platform": 5.0}).with_counter_mass(EXACT)
    trajectory, flat, _ = responses({})
    turning = trajectory.a[:, [MECHANISM.coordinate_index("A0"), MECHANISM.coordinate_index("B0")]].sum(axis=1)
    less = flat.moment[:, 2] - simulate(points, trajectory).moment[:, 2]
    assert less == pytest.approx(-24.276118 * 0.06**2 * turning, abs=1e-9)
    assert np.abs(less).max() > 0.1


def test_unknown_names():
    """What is neither body nor site of a body, and a joint that is not there, are refused with what there is."""
    with pytest.raises(RigError, match=r"bench\.planes.*'arm'.*A0A.*counter_A0A"):
        with_planes(MECHANISM, {"arm": 0.1})
    with pytest.raises(RigError, match=r"bench\.rotors.*'A7'"):
        added_bodies.with_rotors(MECHANISM, {"A7": ROTOR})


def geared(*, turned: bool = False, motion: str = "x"):
    """A run with rotors at both motors; ``turned``: that at B0 turns against its joint."""
    rotors = {"A0": ROTOR, "B0": ROTOR.model_copy(update={"ratio": -30.0 if turned else 30.0})}
    return run(RIG.model_copy(update={"bench": RIG.bench.model_copy(update={"rotors": rotors})}), motion=motion)


def joint(done, name: str, what: str = "a") -> np.ndarray:
    """Course of a joint."""
    return getattr(done.trajectory, what)[:, MECHANISM.coordinate_index(name)]


def test_moment_of_rotors():
    """A rotor that turns N times as fast adds -J N q'' about its axis, with either sense of its gear."""
    for turned, sign in ((False, 1.0), (True, -1.0)):
        done = geared(turned=turned)
        more = done.response.moment - run().response.moment
        expected = -2e-4 * 30.0 * (joint(done, "A0") + sign * joint(done, "B0"))
        assert more[:, 2] == pytest.approx(expected, abs=1e-12)
        assert not np.any(more[:, :2])


def test_arms_that_mirror_each_other():
    """Along y the arms turn against each other: alike rotors cancel, and add where one gear reverses."""
    cancels, adds = geared(motion="y"), geared(motion="y", turned=True)
    assert np.abs(cancels.response.moment[:, 2]).max() < 1e-9
    assert np.abs(adds.response.moment[:, 2]).max() > 1.0


def test_power_of_rotors():
    """What the torques do more than without rotors is the rotors' kinetic energy, J N^2 q'^2 / 2, at every instant."""
    done, less = geared(), run()
    work = 0.0
    for name in ("A0", "B0"):
        more = done.torque[name] - less.torque[name]
        power = more * joint(done, name, "v")
        work = work + np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * done.step])
    energy = sum(0.5 * 2e-4 * 900.0 * joint(done, name, "v") ** 2 for name in ("A0", "B0"))
    assert energy.max() > 1.0
    assert work == pytest.approx(energy, abs=1e-5 * energy.max())


def test_axis_of_a_rotor():
    """The momentum lies along the axis, of whatever length it is written."""
    across = ROTOR.model_copy(update={"axis": (0.0, 3.0, 4.0)})
    rates = Closure(MECHANISM).follow(load_motion("x").sample(500.0)).v
    found = added_bodies.rotor_momentum(MECHANISM, {"A0": across}, rates)
    straight = added_bodies.rotor_momentum(MECHANISM, {"A0": ROTOR}, rates)
    assert found == pytest.approx(straight[:, [2]] * np.array([0.0, 0.6, 0.8]))


def test_rotor_without_axis():
    """An axis without direction is refused."""
    with pytest.raises(ValueError, match="expected a direction"):
        Rotor.model_validate({"inertia": "1 kg m^2", "axis": [0, 0, 0]})
