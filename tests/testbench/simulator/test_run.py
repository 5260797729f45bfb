"""A run of the bench: momentum is kept, balanced force moves nothing, limits and modes are those of closed forms."""

import numpy as np
import pytest

from testbench.errors import RigError
from testbench.rig import load_rig
from testbench.rig.bench import Mode
from testbench.simulator.run import modal_acceleration, mode_acceleration, payload_body
from testbench.simulator.sensors import base_acceleration, true_signals

from .bench import EXACT, MECHANISM, RIG, benched, run, supported

HEAVY = benched(mass="1e9 kg", inertia="1e9 kg m^2")
"""On a base of a million tonnes, which does not move."""


def test_base_moves_by_what_the_sensors_carry():
    """Newton for the bare base: the sensors' wrench, dampers and springs give its momentum."""
    done = run()
    bare = RIG.bench.elastic()
    m = done.motion
    left = m.acceleration @ bare.mass.T + m.velocity @ bare.damping.T + m.displacement @ bare.stiffness.T
    np.testing.assert_allclose(left, supported(done), rtol=0, atol=1e-9 * np.abs(left).max())


def test_base_carries_the_mechanism():
    """What moves on the mounts is the base and everything on it."""
    done = run(RIG, EXACT)
    assert done.base.mass[0, 0] == pytest.approx(RIG.bench.mass + done.mechanism.total_mass)
    assert done.mechanism.total_mass == pytest.approx(2 * (1.04642 + 0.58909 + 24.276118) + 5.0)


def test_base_that_stands_still():
    """On a base that does not move, the sensors together show the shaking wrench itself."""
    done = run(HEAVY)
    np.testing.assert_allclose(supported(done, HEAVY), done.wrench, rtol=0, atol=1e-4 * np.abs(done.wrench).max())


def test_exact_counter_masses():
    """With the exact counter-masses no force is left; along y, where the arms mirror each other, nothing moves."""
    along_x, along_y = run(RIG, EXACT), run(RIG, EXACT, "y")
    assert np.abs(along_x.response.force).max() < 1e-4
    assert np.abs(along_x.response.moment).max() > 10.0
    assert np.abs(along_y.motion.acceleration).max() < 1e-5 * np.abs(run(motion="y").motion.acceleration).max()


def test_force_per_g():
    """Unbalanced at 5 kg the force is 59.617 N per g0 of the platform's acceleration."""
    done = run(acceleration=9.81)
    assert np.abs(done.response.force[:, 0]).max() == pytest.approx(59.617, abs=1e-3)


def test_rest_to_rest():
    """The bench rests before the motion, and the command is over before the loggers stop."""
    done = run()
    assert not np.any(done.wrench[done.time < 0.149])
    assert not np.any(done.command.acceleration[done.time > done.time[-1] - RIG.bench.settling])


def test_every_channel_has_a_signal():
    """Every channel of the shipped rig is simulated, finite, as long as the run."""
    done = run()
    found = true_signals(RIG, done)
    assert set(found) == {column.channel for column in RIG.columns()}
    assert all(values.shape == done.time.shape and np.isfinite(values).all() for values in found.values())


def test_payload_body():
    """A plan may not call another body the payload: its runs record a mass alone."""
    assert payload_body(MECHANISM, "platform") == "platform"
    with pytest.raises(RigError, match=r"'AC'.*'platform'"):
        payload_body(MECHANISM, "AC")


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
        true_signals(load_rig(RIG.text.replace(old, new)), run())


def test_unknown_motion():
    """A motion that is not known is refused with those that are."""
    with pytest.raises(RigError, match=r"'circle'.*triangle"):
        run(motion="circle")


MODE = Mode.model_validate({
    "frequency": "60 Hz", "damping": 0.02, "mass": "40 kg", "translation": [1, 0, 0], "rotation": [0, 0, 2],
    "at": {"base_acc": [0.5, 0, 0.2]},
})  # fmt: skip
STEP, OMEGA = 1e-4, 2 * np.pi * 60.0
TIME = np.arange(30_000) * STEP


def with_modes(*modes):
    """The shipped rig with elastic modes of its base."""
    return RIG.model_copy(update={"bench": RIG.bench.model_copy(update={"modes": modes})})


@pytest.mark.parametrize("frequency", [15.0, 58.0, 60.0, 200.0])
def test_frequency_response_of_a_mode(frequency):
    """Driven by a harmonic it settles on -w2 / (w0^2 - w2 + 2 i z w0 w) / m."""
    omega, own = 2 * np.pi * frequency, 2 * np.pi * 60.0
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 0] = 3.0 * np.sin(omega * TIME)
    gain = 3.0 / 40.0 * -(omega**2) / (own**2 - omega**2 + 2j * 0.02 * own * omega)
    late = TIME > 2.0
    assert mode_acceleration(MODE, wrench, STEP)[late] == pytest.approx(
        np.imag(gain * np.exp(1j * omega * TIME))[late], abs=3e-3 * abs(gain)
    )


def test_impulse_of_a_mode():
    """After a short push it rings at its damped frequency and decays by its damping."""
    wrench = np.zeros((len(TIME), 6))
    wrench[1:11, 5] = 1.0
    found = mode_acceleration(MODE, wrench, STEP)
    peaks = np.flatnonzero((found[1:-1] > found[:-2]) & (found[1:-1] > found[2:])) + 1
    period = np.diff(peaks[2:20]).mean() * STEP
    assert 1.0 / period == pytest.approx(60.0 * np.sqrt(1 - 0.02**2), rel=1e-3)
    assert np.log(found[peaks[2]] / found[peaks[12]]) / 10 == pytest.approx(2 * np.pi * 0.02, rel=1e-2)


def test_shapes_of_modes():
    """The mode sees what does work on its shape, and moves a sensor along its shape there."""
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 1:5] = np.random.default_rng(1).normal(size=(len(TIME), 4))
    assert not np.any(mode_acceleration(MODE, wrench, STEP))
    wrench[:, 0] = np.sin(50.0 * TIME)
    moved = modal_acceleration((MODE, MODE), wrench, STEP)["base_acc"]
    np.testing.assert_allclose(moved[:, 0], 2.5 * moved[:, 2], rtol=1e-6)
    assert not np.any(moved[:, 1])
    np.testing.assert_allclose(moved[:, 0], 2 * 0.5 * mode_acceleration(MODE, wrench, STEP), rtol=1e-6)


def test_mode_in_a_run():
    """What the sensor shows more is the mode's closed-form gain times the wrench; the rigid motion is as before."""
    with_mode, without = run(with_modes(MODE)), run()
    sensor = RIG.base_accelerometers["base_acc"]
    added = base_acceleration(sensor, with_mode)["x"] - base_acceleration(sensor, without)["x"]
    push = without.transmitted_wrench @ np.array([1.0, 0.0, 0.0, 0.0, 0.0, 2.0]) * 0.5 / 40.0
    pushed = np.fft.rfft(np.pad(push, (0, 7 * len(push))))
    i_omega = 2j * np.pi * np.fft.rfftfreq(8 * len(added), with_mode.step)
    expected = pushed * i_omega**2 / (i_omega**2 + 2 * 0.02 * OMEGA * i_omega + OMEGA**2)
    assert added == pytest.approx(np.fft.irfft(expected)[: len(added)], abs=2e-3 * np.abs(added).max())
    assert np.array_equal(with_mode.motion.acceleration, without.motion.acceleration)


def test_high_harmonics_of_a_mode():
    """Above its frequency the residue is that of the free modal mass: s psi W / m."""
    omega = 2 * np.pi * 900.0
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 0] = np.sin(omega * TIME)
    late = TIME > 2.0
    assert np.abs(mode_acceleration(MODE, wrench, STEP)[late]).max() == pytest.approx(1.0 / 40.0, rel=2e-2)


def test_mode_at_an_unknown_sensor():
    """A mode at a sensor that is not an accelerometer on the base is refused."""
    with pytest.raises(RigError, match=r"bench\.modes\.0\.at.*'platform_acc'.*base_acc"):
        run(with_modes(MODE.model_copy(update={"at": {"platform_acc": (1.0, 0.0, 0.0)}})))
