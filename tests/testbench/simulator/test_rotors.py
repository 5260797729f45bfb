"""Rotors: their angular momentum and the power that they take."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig import load_rig
from testbench.rig.bench import Rotor
from testbench.simulator import added_bodies
from testbench.simulator.run import simulate_run

RIG, MECHANISM = load_rig("parallelogram-6bar"), load_mechanism("parallelogram-6bar")
ROTOR = Rotor.model_validate({"inertia": "2e-4 kg m^2", "ratio": 30.0})


def run(*, turned: bool = False, motion: str = "x"):
    """A run with rotors at both motors; ``turned``: that at B0 turns against its joint."""
    second = ROTOR.model_copy(update={"ratio": -30.0 if turned else 30.0})
    bench = RIG.bench.model_copy(update={"rotors": {"A0": ROTOR, "B0": second}})
    planned = PlannedRun("r", 5.0, {}, motion, 29.43, 1)
    return simulate_run(RIG.model_copy(update={"bench": bench}), MECHANISM, planned)


def plain(motion: str = "x"):
    """The same without rotors."""
    return simulate_run(RIG, MECHANISM, PlannedRun("r", 5.0, {}, motion, 29.43, 1))


def joint(done, name: str, what: str = "a") -> np.ndarray:
    """Course of a joint."""
    return getattr(done.trajectory, what)[:, MECHANISM.coordinate_index(name)]


def test_moment():
    """A rotor that turns N times as fast adds -J N q'' about its axis, with either sense of its gear."""
    for turned, sign in ((False, 1.0), (True, -1.0)):
        done = run(turned=turned)
        more = done.response.moment - plain().response.moment
        expected = -2e-4 * 30.0 * (joint(done, "A0") + sign * joint(done, "B0"))
        assert more[:, 2] == pytest.approx(expected, abs=1e-12)
        assert not np.any(more[:, :2])


def test_arms_that_mirror_each_other():
    """Along y the arms turn against each other: alike rotors cancel, and add where one gear reverses."""
    cancels, adds = run(motion="y"), run(motion="y", turned=True)
    assert np.abs(cancels.response.moment[:, 2]).max() < 1e-9
    assert np.abs(adds.response.moment[:, 2]).max() > 1.0


def test_power():
    """What the torques do more than without rotors is the rotors' kinetic energy, J N^2 q'^2 / 2, at every instant."""
    done, less = run(), plain()
    work = 0.0
    for name in ("A0", "B0"):
        more = done.torque[name] - less.torque[name]
        power = more * joint(done, name, "v")
        work = work + np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) * done.step])
    energy = sum(0.5 * 2e-4 * 900.0 * joint(done, name, "v") ** 2 for name in ("A0", "B0"))
    assert energy.max() > 1.0
    assert work == pytest.approx(energy, abs=1e-5 * energy.max())


def test_axis():
    """The momentum lies along the axis, of whatever length it is written."""
    across = ROTOR.model_copy(update={"axis": (0.0, 3.0, 4.0)})
    rates = Closure(MECHANISM).follow(load_motion("x").sample(500.0)).v
    found = added_bodies.rotor_momentum(MECHANISM, {"A0": across}, rates)
    straight = added_bodies.rotor_momentum(MECHANISM, {"A0": ROTOR}, rates)
    assert found == pytest.approx(straight[:, [2]] * np.array([0.0, 0.6, 0.8]))


def test_unknown_joint():
    """A rotor at a joint that is not there is blamed by its table."""
    with pytest.raises(RigError, match=r"bench\.rotors.*'A7'"):
        added_bodies.with_rotors(MECHANISM, {"A7": ROTOR})


def test_no_axis():
    """An axis without direction is refused."""
    with pytest.raises(ValueError, match="expected a direction"):
        Rotor.model_validate({"inertia": "1 kg m^2", "axis": [0, 0, 0]})
