"""Elastic modes: oscillators of one degree of freedom that colour what is above their frequency."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import PlannedRun
from testbench.errors import RigError
from testbench.rig import load_rig
from testbench.rig.bench import Mode
from testbench.simulator.run import modal_acceleration, mode_acceleration, simulate_run
from testbench.simulator.sensors import base_acceleration

MODE = Mode.model_validate({
    "frequency": "60 Hz", "damping": 0.02, "mass": "40 kg", "translation": [1, 0, 0], "rotation": [0, 0, 2],
    "at": {"base_acc": [0.5, 0, 0.2]},
})  # fmt: skip
STEP, OMEGA = 1e-4, 2 * np.pi * 60.0
TIME = np.arange(30_000) * STEP
RIG, MECHANISM = load_rig("parallelogram-6bar"), load_mechanism("parallelogram-6bar")


def run(modes, motion: str = "x"):
    """5 kg without counter-masses."""
    rig = RIG.model_copy(update={"bench": RIG.bench.model_copy(update={"modes": modes})})
    return simulate_run(rig, MECHANISM, PlannedRun("r", 5.0, {}, motion, 29.43, 1))


@pytest.mark.parametrize("frequency", [15.0, 58.0, 60.0, 200.0])
def test_frequency_response(frequency):
    """Driven by a harmonic it settles on -w2 / (w0^2 - w2 + 2 i z w0 w) / m."""
    omega, own = 2 * np.pi * frequency, 2 * np.pi * 60.0
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 0] = 3.0 * np.sin(omega * TIME)
    gain = 3.0 / 40.0 * -(omega**2) / (own**2 - omega**2 + 2j * 0.02 * own * omega)
    late = TIME > 2.0
    assert mode_acceleration(MODE, wrench, STEP)[late] == pytest.approx(
        np.imag(gain * np.exp(1j * omega * TIME))[late], abs=3e-3 * abs(gain)
    )


def test_impulse():
    """After a short push it rings at its damped frequency and decays by its damping."""
    wrench = np.zeros((len(TIME), 6))
    wrench[1:11, 5] = 1.0
    found = mode_acceleration(MODE, wrench, STEP)
    peaks = np.flatnonzero((found[1:-1] > found[:-2]) & (found[1:-1] > found[2:])) + 1
    period = np.diff(peaks[2:20]).mean() * STEP
    assert 1.0 / period == pytest.approx(60.0 * np.sqrt(1 - 0.02**2), rel=1e-3)
    assert np.log(found[peaks[2]] / found[peaks[12]]) / 10 == pytest.approx(2 * np.pi * 0.02, rel=1e-2)


def test_shapes():
    """The mode sees what does work on its shape, and moves a sensor along its shape there."""
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 1:5] = np.random.default_rng(1).normal(size=(len(TIME), 4))
    assert not np.any(mode_acceleration(MODE, wrench, STEP))
    wrench[:, 0] = np.sin(50.0 * TIME)
    moved = modal_acceleration((MODE, MODE), wrench, STEP)["base_acc"]
    assert moved[:, 0] == pytest.approx(2.5 * moved[:, 2])
    assert not np.any(moved[:, 1])
    assert moved[:, 0] == pytest.approx(2 * 0.5 * mode_acceleration(MODE, wrench, STEP))


def test_in_a_run():
    """What the sensor shows more is the mode's closed-form gain times the wrench; the rigid motion is as before."""
    with_mode, without = run((MODE,)), run(())
    sensor = RIG.base_accelerometers["base_acc"]
    added = base_acceleration(sensor, with_mode)["x"] - base_acceleration(sensor, without)["x"]
    push = without.transmitted_wrench @ np.array([1.0, 0.0, 0.0, 0.0, 0.0, 2.0]) * 0.5 / 40.0
    pushed = np.fft.rfft(np.pad(push, (0, 7 * len(push))))
    i_omega = 2j * np.pi * np.fft.rfftfreq(8 * len(added), with_mode.step)
    expected = pushed * i_omega**2 / (i_omega**2 + 2 * 0.02 * OMEGA * i_omega + OMEGA**2)
    assert added == pytest.approx(np.fft.irfft(expected)[: len(added)], abs=2e-3 * np.abs(added).max())
    assert np.array_equal(with_mode.motion.acceleration, without.motion.acceleration)


def test_high_harmonics():
    """Above its frequency the residue is that of the free modal mass: s psi W / m."""
    omega = 2 * np.pi * 900.0
    wrench = np.zeros((len(TIME), 6))
    wrench[:, 0] = np.sin(omega * TIME)
    late = TIME > 2.0
    assert np.abs(mode_acceleration(MODE, wrench, STEP)[late]).max() == pytest.approx(1.0 / 40.0, rel=2e-2)


def test_unknown_sensor():
    """A mode at a sensor that is not an accelerometer on the base is refused."""
    with pytest.raises(RigError, match=r"bench\.modes\.0\.at.*'platform_acc'.*base_acc"):
        run((MODE.model_copy(update={"at": {"platform_acc": (1.0, 0.0, 0.0)}}),))
