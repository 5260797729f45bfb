"""Moving base and moving mechanism together, held against MuJoCo's nonlinear dynamics of a free base."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig import Rig, load_rig
from testbench.rig.bench import Bench
from testbench.rig.support_loads import elastic_base
from testbench.simulator import moving_base_coupling
from testbench.simulator.run import simulate_run

from .freebase import FreeBase

MECHANISM, RIG = load_mechanism("parallelogram-6bar"), load_rig("parallelogram-6bar")
BUILT = {"counter_A0A": 24.2626, "counter_B0B": 24.2626}
PLANES = {"AC": "25 mm", "BD": "25 mm", "platform": "10 mm", "counter_A0A": "-40 mm", "counter_B0B": "-40 mm"}
ROTORS = {"A0": {"inertia": "2e-4 kg m^2", "ratio": 30.0}, "B0": {"inertia": "2e-4 kg m^2", "ratio": -30.0}}


def benched(**settings) -> Rig:
    """The shipped rig with more in its bench."""
    stated = Bench.model_validate(settings)
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={k: getattr(stated, k) for k in settings})})


def run(rig: Rig, masses=BUILT, motion: str = "x"):
    """5 kg at 3 g0."""
    return simulate_run(rig, MECHANISM, PlannedRun("r", 5.0, masses, motion, 29.43, 1))


def missing(rig: Rig, done, masses, gravity=(0.0, 0.0, 0.0)) -> np.ndarray:
    """What mounts must give and do not at the motion found, to first order, as a share of the wrench, (6,)."""
    samples = np.arange(0, len(done.time), 97)
    referee, bare = FreeBase(rig, done, 5.0, masses, gravity), elastic_base(rig.bench)
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
    assert moving.transmitted_wrench == pytest.approx(locked.wrench, abs=1e-3)


def test_rounds_that_do_not_agree(monkeypatch):
    """A motion that has not been found is refused and not returned."""
    monkeypatch.setattr(moving_base_coupling, "ROUNDS", 1)
    with pytest.raises(RigError, match=r"bench\.coupling"):
        run(benched(coupling="moving"), {})
