"""A run of the bench: momentum is kept, balanced force moves nothing, limits are those of the closed forms."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig import Rig, load_rig
from testbench.rig.support_loads import elastic_base, wrench_transport
from testbench.simulator.run import payload_body, simulate_run
from testbench.simulator.sensors import true_signals

EXACT = {"counter_A0A": 24.276118, "counter_B0B": 24.276118}
RIG = load_rig("parallelogram-6bar")


def run(masses: dict[str, float], motion: str = "x", rig: Rig = RIG, acceleration: float = 29.43):
    """The 5 kg run of the published table, by default along x at 3 g0."""
    planned = PlannedRun("r", 5.0, masses, motion, acceleration, 1)
    return simulate_run(rig, load_mechanism("parallelogram-6bar"), planned)


def heavy() -> Rig:
    """The rig on a base of a million tonnes, which does not move."""
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={"mass": 1e9, "inertia": (1e9, 1e9, 1e9)})})


def supported(done, rig: Rig) -> np.ndarray:
    """Wrench about the origin that the channels of all force sensors add up to, (n, 6)."""
    seen, total = true_signals(rig, done), np.zeros((len(done.time), 6))
    for name, sensor in rig.supports.items():
        load = np.zeros((len(done.time), 6))
        for column in sensor.columns(name):
            load[:, ("Fx", "Fy", "Fz", "Mx", "My", "Mz").index(column.component)] = seen[column.channel]
        total += load @ wrench_transport(np.array(sensor.position)).T
    return total


def test_base_moves_by_what_the_sensors_carry():
    """Newton for the bare base: the sensors' wrench, dampers and springs give its momentum."""
    done = run({})
    bare = elastic_base(RIG.bench)
    m = done.motion
    left = m.acceleration @ bare.mass.T + m.velocity @ bare.damping.T + m.displacement @ bare.stiffness.T
    assert left == pytest.approx(supported(done, RIG), abs=1e-9 * np.abs(left).max())


def test_base_carries_the_mechanism():
    """What moves on the mounts is the base and everything on it."""
    done = run(EXACT)
    assert done.base.mass[0, 0] == pytest.approx(RIG.bench.mass + done.mechanism.total_mass)
    assert done.mechanism.total_mass == pytest.approx(2 * (1.04642 + 0.58909 + 24.276118) + 5.0)


def test_base_that_stands_still():
    """On a base that does not move, the sensors together show the shaking wrench itself."""
    done = run({}, rig=heavy())
    assert supported(done, heavy()) == pytest.approx(done.wrench, abs=1e-4 * np.abs(done.wrench).max())


def test_exact_counter_masses():
    """With the exact counter-masses no force is left; along y, where the arms mirror each other, nothing moves."""
    along_x, along_y = run(EXACT), run(EXACT, "y")
    assert np.abs(along_x.response.force).max() < 1e-4
    assert np.abs(along_x.response.moment).max() > 10.0
    assert np.abs(along_y.motion.acceleration).max() < 1e-5 * np.abs(run({}, "y").motion.acceleration).max()


def test_force_per_g():
    """Unbalanced at 5 kg the force is 59.617 N per g0 of the platform's acceleration."""
    done = run({}, acceleration=9.81)
    assert np.abs(done.response.force[:, 0]).max() == pytest.approx(59.617, abs=1e-3)


def test_rest_to_rest():
    """The bench rests before the motion, and the command is over before the loggers stop."""
    done = run({})
    assert not np.any(done.wrench[done.time < 0.149])
    assert not np.any(done.command.acceleration[done.time > done.time[-1] - RIG.bench.settling])


def test_every_channel_has_a_signal():
    """Every channel of the shipped rig is simulated, finite, as long as the run."""
    done = run({})
    found = true_signals(RIG, done)
    assert set(found) == {column.channel for column in RIG.columns()}
    assert all(values.shape == done.time.shape and np.isfinite(values).all() for values in found.values())


def test_payload_body():
    """A plan may not call another body the payload: its runs record a mass alone."""
    mechanism = load_mechanism("parallelogram-6bar")
    assert payload_body(mechanism, "platform") == "platform"
    with pytest.raises(RigError, match=r"'AC'.*'platform'"):
        payload_body(mechanism, "AC")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('joint = "A0"\nunit = "rad"', 'joint = "A9"\nunit = "rad"', "sensors.encoder_A0: .*no joint 'A9'"),
        ('joint = "A0"\nunit = "N m"', 'joint = "A"\nunit = "N m"', "sensors.motor_A0: .*not driven"),
        ('attached_to = "platform"', 'attached_to = "plattform"', "sensors.platform_acc: .*'plattform'"),
    ],
)
def test_what_the_mechanism_has_not(old, new, said):
    """A sensor on what the mechanism does not have is blamed by its key."""
    assert old in RIG.text
    with pytest.raises(RigError, match=said):
        true_signals(load_rig(RIG.text.replace(old, new)), run({}))


def test_unknown_motion():
    """A motion that is not known is refused with those that are."""
    with pytest.raises(RigError, match=r"'circle'.*triangle"):
        run({}, "circle")
