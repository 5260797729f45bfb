"""Amplitudes with their calibration: what cancels in a reduction, what does not, and budgets that add up."""

from dataclasses import replace

import numpy as np
import pytest

from studies import simulated_runs as memory
from testbench.rig import rig_from_text
from testbench.signal.filters import Band
from testbench.vibration.metrics import Measure
from testbench.vibration.reduction import reduction_of_pair
from testbench.vibration.run_pairs import pairs

RIG = """
mechanism = "parallelogram-6bar"
[loggers.daq]
clock = "uniform"
rate = "1 kHz"
start = "-0.4 s"
[sensors.base_acc]
kind = "accelerometer"
logger = "daq"
channels = { y = "AccY" }
unit = "g"
noise = "0.002 g"
position = ["0.20 m", "-0.10 m", "0 m"]
[sensors.encoder_A0]
kind = "encoder"
logger = "daq"
channel = "angle"
joint = "A0"
unit = "rad"
"""
CERTIFIED = """
[sensors.base_acc.calibration]
reference = "{}"
uncertainty = {{ expanded = "3 %", coverage_factor = 2 }}
"""
SHARE = 0.015


@pytest.fixture(scope="module")
def runs():
    """With counter-masses and without, along y: far above the noise."""
    scenes = [memory.scene("y", 3.0, masses, rig=rig_from_text(RIG)) for masses in (memory.BUILT, {})]
    return [replace(scene.run(k), path=scene.run(k).path.with_name(f"r{k}.h5")) for k, scene in enumerate(scenes)]


def reduction(runs, *certificates):
    """Of the runs, with the certificates of their rigs; an empty one: no calibration."""
    rigs = [RIG + (CERTIFIED.format(c) if c else "") for c in certificates]
    (pair,), _ = pairs([replace(run, rig=rig) for run, rig in zip(runs, rigs, strict=True)])
    (found,) = reduction_of_pair(pair, Measure("rms", Band(1.0, 100.0)))
    return found


def test_one_calibration_cancels_in_the_reduction(runs):
    """The same interval as without any; each amplitude's is wider by it, in quadrature."""
    without, found = reduction(runs, "", ""), reduction(runs, "A", "A")
    assert found.interval == without.interval
    for amplitude, narrow, wide in zip(
        found.amplitudes, without.amplitude_intervals, found.amplitude_intervals, strict=True
    ):
        for end, wider in zip(narrow, wide, strict=True):
            assert abs(wider - amplitude) == pytest.approx(
                np.hypot(end - amplitude, 1.96 * SHARE * amplitude), rel=1e-3
            )


@pytest.mark.parametrize(("first", "second", "errors"), [("A", "B", 2), ("A", "", 1)])
def test_a_calibration_in_between_does_not_cancel(runs, first, second, errors):
    """Each side has an error of its own: sqrt 2 times one, or one where the other states none."""
    without, found = reduction(runs, "", ""), reduction(runs, first, second)
    more = 1.96 * SHARE * (100.0 - found.percent) * errors**0.5
    for narrow, wide in zip(without.interval, found.interval, strict=True):
        assert abs(wide - found.percent) == pytest.approx(np.hypot(narrow - found.percent, more), rel=1e-3)


def test_budgets_add_up_to_the_intervals(runs):
    """Far above the noise the expanded uncertainty is half of what is printed, of the reduction and both amplitudes.

    The spectrum of the noise is known from two rests, so that its tails are a tenth longer than those of a normal.
    """
    found = reduction(runs, "A", "B")
    budgets = {budget.quantity: budget for budget in found.uncertainty.budgets}
    printed = dict(zip(budgets, (found.interval, *found.amplitude_intervals), strict=True))
    assert list(printed) == ["reduction", "amplitude with", "amplitude without"]
    for name, budget in budgets.items():
        assert budget.half_width == pytest.approx(0.5 * (printed[name][1] - printed[name][0]), rel=0.1)
    certified = [part for part in budgets["reduction"].contributions if "(A)" in part.source or "(B)" in part.source]
    assert [part.size for part in certified] == pytest.approx([SHARE * (100.0 - found.percent)] * 2)


def test_an_amplitude_s_interval_holds_the_truth(runs):
    """Sensitivities off by what the certificate allows: 95 % of the intervals hold the amplitude without error.

    The error of 4000 draws is 0.3 %; noise is next to nothing.
    """
    (low, high), amplitude = reduction(runs, "A", "A").amplitude_intervals[1], reduction(runs, "A", "A").amplitudes[1]
    off = 1.0 + SHARE * np.random.default_rng(1).standard_normal(4000)
    assert np.mean((low * off <= amplitude) & (amplitude <= high * off)) == pytest.approx(0.95, abs=0.012)
