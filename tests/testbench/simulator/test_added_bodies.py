"""Planes: what is balanced in projection still tips the base."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion.motion_files import load_motion
from testbench.errors import RigError
from testbench.simulator.added_bodies import with_planes

MECHANISM = load_mechanism("parallelogram-6bar")
PLANES = {"A0A": 0.01, "AC": 0.025, "BD": 0.025, "platform": -0.01, "counter_A0A": -0.04, "counter_B0B": -0.04}
EXACT = {"counter_A0A": 24.276118, "counter_B0B": 24.276118}


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


def test_unknown_name():
    """What is neither body nor site of a body is refused with what there is."""
    with pytest.raises(RigError, match=r"bench\.planes.*'arm'.*A0A.*counter_A0A"):
        with_planes(MECHANISM, {"arm": 0.1})
