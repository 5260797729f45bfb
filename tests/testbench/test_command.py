"""Acceleration by encoders and by accelerometer against the command, and the clocks of two loggers."""

import numpy as np
import pytest

from balance.mechanism import Mechanism
from testbench.command import performance
from testbench.errors import AnalysisError
from testbench.store import open_campaign


@pytest.fixture(scope="module")
def shown(brief):
    """The 5 kg run along y at 3 g0 with counter-masses: the base hardly moves."""
    return performance(open_campaign(brief.campaign).runs[6], Mechanism.load("parallelogram-6bar"))


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
        performance(run, Mechanism.load("parallelogram-6bar"))
