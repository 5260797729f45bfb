"""Analogue filters: their closed-form frequency response."""

import numpy as np
import pytest

from testbench.rig import Column
from testbench.rig.bench import Logger
from testbench.simulator.loggers import high_pass, low_pass, record_log

STEP = 1e-4
TIME = np.arange(60_000) * STEP


def gain(filtered, frequency: float) -> complex:
    """Of the settled answer to a cosine."""
    signal = filtered(np.cos(2 * np.pi * frequency * TIME))
    late = TIME >= 3.0
    return 2.0 * np.mean(signal[late] * np.exp(-2j * np.pi * frequency * TIME[late]))


@pytest.mark.parametrize("frequency", [10.0, 100.0, 200.0, 400.0])
def test_butterworth(frequency):
    """Of fourth order: 1 / sqrt(1 + (f / f0)^8), and its poles' phase."""
    found = gain(lambda s: low_pass(s, 200.0, STEP), frequency)
    x = 1j * frequency / 200.0
    expected = np.prod([1.0 / (x**2 + 2.0 * np.cos(a) * x + 1.0) for a in (np.pi / 8, 3 * np.pi / 8)])
    assert abs(expected) == pytest.approx(1.0 / np.sqrt(1.0 + (frequency / 200.0) ** 8))
    lines_between_samples = np.sinc(frequency * STEP) ** 4  # two sections, each from a signal of straight lines
    assert found == pytest.approx(expected * lines_between_samples, abs=2e-3 * abs(expected))


def test_delay():
    """What is slow beside the corner comes later by the stated delay, and not smaller."""
    logger = Logger.model_validate({"low_pass": "200 Hz"})
    found = gain(lambda s: low_pass(s, 200.0, STEP), 5.0)
    assert -np.angle(found) / (2 * np.pi * 5.0) == pytest.approx(logger.delay, rel=1e-3)
    assert abs(found) == pytest.approx(1.0, abs=1e-4)
    assert Logger().delay == 0.0


@pytest.mark.parametrize("frequency", [0.5, 1.0, 20.0])
def test_high_pass(frequency):
    """First order: i f / (f0 + i f)."""
    found = gain(lambda s: high_pass(s, 1.0, STEP), frequency)
    assert found == pytest.approx(1j * frequency / (1.0 + 1j * frequency), abs=5e-3)


def test_at_rest():
    """What stands still passes the low pass as it is, and a high pass not at all."""
    assert low_pass(np.full(500, 3.0), 200.0, STEP) == pytest.approx(np.full(500, 3.0))
    assert not np.any(high_pass(np.full(500, 3.0), 1.0, STEP))


def test_step_decays():
    """A charge amplifier forgets a constant load with its time constant."""
    load = np.where(TIME > 0.0, 5.0, 0.0)
    assert high_pass(load, 0.5, STEP)[20_000] == pytest.approx(5.0 * np.exp(-2 * np.pi * 0.5 * 2.0), rel=1e-3)


def test_in_a_logger():
    """A logger's anti-alias filter takes out what would fold; what a controller computed it leaves alone."""
    fast, shared = np.sin(2 * np.pi * 900.0 * TIME), ("acc", "x", "daq", "m/s^2", ("acceleration",))
    columns = [Column("A", *shared), Column("T", *shared, commanded=True)]
    logger = Logger.model_validate({"rate": "1 kHz", "start": "0 s", "low_pass": "250 Hz"})
    log = record_log(logger, columns, TIME, {"A": fast, "T": fast}, (1, 1))
    assert np.abs(log.columns["A"][500:]).max() < 0.01
    assert np.abs(log.columns["T"][500:]).max() > 0.9
