"""Loggers: their own clock, noise, range and steps."""

import numpy as np
import pytest

from testbench.rig import Column
from testbench.rig.bench import Logger
from testbench.simulator.loggers import digitized, record_log, sample_instants

TIME = np.arange(20_001) / 10_000.0


def logger(**settings) -> Logger:
    """A logger of 1 kHz that starts 0.1 s before the motion."""
    return Logger.model_validate({"rate": "1 kHz", "start": "-0.1 s", **settings})


def column(**settings) -> Column:
    """A channel in g."""
    return Column("A", "acc", "x", "daq", "g", ("acceleration",), **settings)


def rng():
    """The same noise each time."""
    return np.random.default_rng(7)


def test_drift():
    """A clock that is 1000 ppm fast has taken 1000 samples a second of its own in 1/1.001 s."""
    own, true = sample_instants(logger(drift_ppm=1000.0), 2.0)
    assert own[1000] == pytest.approx(1.0)
    assert true[1000] == pytest.approx(-0.1 + 1.0 / 1.001)
    assert true[0] == -0.1
    assert 2.0 - 1e-3 < true[-1] <= 2.0


def test_rest_before_and_after():
    """Before the motion and after it a logger records the state of rest."""
    log = record_log(logger(), [column()], TIME, {"A": 9.81 * np.minimum(TIME, 1.0)}, (0, 0))
    assert not np.any(log.columns["A"][log.time < 0.1])
    assert log.columns["A"][-1] == pytest.approx(1.0)


def test_unit():
    """Values are written in the unit of the log."""
    assert digitized(column(), np.full(3, 19.62), rng()) == pytest.approx([2.0] * 3)


def test_clipping():
    """Nothing goes beyond the range of the sensor."""
    values = digitized(column(range=98.1, noise=50.0), 200.0 * np.sin(TIME), rng())
    assert np.abs(values).max() == pytest.approx(10.0)


def test_resolution():
    """Values lie on the steps of the converter, at most half a step off."""
    signal = np.sin(9 * TIME)
    values = digitized(column(resolution=0.0981), signal, rng())
    assert values / 0.01 == pytest.approx(np.round(values / 0.01), abs=1e-9)
    assert np.abs(values * 9.81 - signal).max() <= 0.0981 / 2 + 1e-12


def test_noise():
    """Noise has the stated standard deviation, no mean, and no memory."""
    values = 9.81 * digitized(column(noise=0.3), np.zeros(20_000), rng())
    assert values.std() == pytest.approx(0.3, rel=0.02)
    assert abs(values.mean()) < 4 * 0.3 / np.sqrt(20_000)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 4 / np.sqrt(20_000)


def test_noise_of_its_own():
    """The noise of a channel does not depend on which other channels there are."""
    other = Column("B", "acc", "y", "daq", "g", ("acceleration",), noise=0.3)
    signals = {"A": np.zeros_like(TIME), "B": np.zeros_like(TIME)}
    alone = record_log(logger(), [column(noise=0.3)], TIME, signals, (1, 2))
    both = record_log(logger(), [column(noise=0.3), other], TIME, signals, (1, 2))
    assert np.array_equal(alone.columns["A"], both.columns["A"])
    assert not np.array_equal(both.columns["A"], both.columns["B"])


def test_zero_in_zero_out():
    """Without noise a signal of zero is written as zero, without a sign."""
    values = digitized(column(resolution=0.1, range=10.0), np.array([0.0, -0.0, -0.01]), rng())
    assert not np.signbit(values).any()
    assert not values.any()
