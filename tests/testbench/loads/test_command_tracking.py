"""Acceleration by encoders and by accelerometer against the command, and the clocks of two loggers."""

import numpy as np
import pytest

from balance.mechanism.mjcf_parser import load_mechanism
from testbench.errors import AnalysisError
from testbench.kinematics.smoothing_and_derivatives import noise_gain, smoothed_derivatives
from testbench.loads.command_tracking import command_performance
from testbench.runs.aligned_run import AlignedRun
from testbench.runs.si_run import SIRun
from testbench.store import open_campaign


@pytest.fixture(scope="module")
def shown(brief):
    """The 5 kg run along y at 3 g0 with counter-masses: the base hardly moves."""
    return command_performance(
        AlignedRun(SIRun.of(open_campaign(brief.campaign).runs[6]), load_mechanism("parallelogram-6bar"))
    )


def test_encoders_give_the_commanded_acceleration(shown):
    """Through the loops, the encoders' second derivatives are the commanded acceleration within the bandwidth."""
    error = shown.encoders["y"] - shown.target["y"]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.abs(shown.target["y"]).max()
    assert np.abs(shown.encoders["x"]).max() < 0.02 * np.abs(shown.target["y"]).max()


def test_accelerometer_sees_it_too(shown):
    """On a base that rests, the accelerometer on the platform follows the command, on its own clock brought in line."""
    error = shown.accelerometer["y"] - shown.target["y"]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.abs(shown.target["y"]).max()


def test_lag_is_the_difference_of_the_starts(shown):
    """The lag is that of the loggers' starts, -0.237 and -0.100 s, to half a millisecond."""
    assert shown.lag_s == pytest.approx(0.137, abs=5e-4)


def test_what_the_rig_lacks(brief, monkeypatch):
    """A rig without a target is refused, saying so."""
    run = open_campaign(brief.campaign).runs[0]
    text = run.rig[: run.rig.index("[sensors.target]")] + run.rig[run.rig.index("[bench]") :]
    object.__setattr__(run, "rig", text)
    with pytest.raises(AnalysisError, match="target"):
        command_performance(AlignedRun(SIRun.of(run), load_mechanism("parallelogram-6bar")))


def test_figures_name_peaks_errors_and_delays(shown):
    """Peaks of all three agree within 3 %; the encoders follow the command within half a millisecond on the bench."""
    by = {(one.axis, one.by): one for one in shown.reached()}
    for source in ("encoders", "accelerometer"):
        one = by["y", source]
        assert one.peak == pytest.approx(one.target_peak, rel=0.03)
        assert one.error_rms < 0.05 * one.target_rms
    assert abs(by["y", "encoders"].delay_s) < 5e-4
    assert by["x", "encoders"].delay_s is None
    assert by["x", "encoders"].target_peak == 0.0


def test_noise_of_the_encoders_is_stated(shown):
    """Steps of 4.8e-5 rad through the filter of 80 Hz."""
    assert shown.encoder_noise.keys() == {"A0", "B0"}
    assert shown.encoder_noise["A0"] == pytest.approx(4.8e-5 / np.sqrt(12.0) * noise_gain(80.0, 1000.0), rel=1e-3)


def test_noise_gain_is_what_white_noise_becomes():
    """Of 50 thousand samples of unit noise, to 2 %."""
    noise = np.random.default_rng(0).normal(size=(50_000, 1))
    assert np.std(smoothed_derivatives(noise, 80.0, 1000.0).a[1000:-1000]) == pytest.approx(
        noise_gain(80.0, 1000.0), rel=0.02
    )
