"""Rates of smoothed positions against closed forms; a clock that is no grid; gaps that are refused."""

import numpy as np
import pytest

from testbench.errors import AnalysisError
from testbench.kinematics.smoothing_and_derivatives import (
    Grid,
    bridge_gaps,
    grid_of,
    low_pass,
    on_grid,
    smoothed_derivatives,
)

RATE = 200.0
TIME = np.arange(2000) / RATE
INSIDE = slice(200, -200)


def test_rates_of_a_sine():
    """Well below the cut-off, velocity and acceleration are those of the closed form to 1e-4 of their amplitude."""
    omega = 2 * np.pi * 2.0
    found = smoothed_derivatives(np.sin(omega * TIME)[:, None], 20.0, RATE)
    assert np.abs(found.v[INSIDE, 0] / omega - np.cos(omega * TIME[INSIDE])).max() < 1e-4
    assert np.abs(found.a[INSIDE, 0] / omega**2 + np.sin(omega * TIME[INSIDE])).max() < 1e-4


def test_rates_near_the_cutoff_keep_their_phase():
    """At the cut-off half of the amplitude is left, of all three alike, and nothing is delayed."""
    omega = 2 * np.pi * 20.0
    found = smoothed_derivatives(np.sin(omega * TIME)[:, None], 20.0, RATE)
    for value, expected in (
        (found.q, 0.5 * np.sin(omega * TIME)),
        (found.v, 0.5 * omega * np.cos(omega * TIME)),
        (found.a, -0.5 * omega**2 * np.sin(omega * TIME)),
    ):
        assert np.abs(value[INSIDE, 0] - expected[INSIDE]).max() < 2e-3 * np.abs(expected).max()


def test_a_constant_and_a_ramp_pass():
    """A joint at rest has no rates; one at constant speed no acceleration, even near the ends of the record."""
    found = smoothed_derivatives(np.stack([np.full_like(TIME, 0.7), 3.0 * TIME], axis=1), 5.0, RATE)
    assert np.abs(found.v[:, 0]).max() < 1e-9
    assert np.abs(found.v[:, 1] - 3.0).max() < 3e-3
    assert np.abs(found.v[INSIDE, 1] - 3.0).max() < 1e-6
    assert np.abs(found.a[INSIDE]).max() < 1e-5


def test_jittered_clock_is_carried_over():
    """Samples taken 0.2 ms off the grid are carried over to it 1000 times better than by taking them as on it."""
    jittered = TIME + np.random.default_rng(0).uniform(-2e-4, 2e-4, len(TIME))
    signal = np.sin(2 * np.pi * 3.0 * jittered)
    grid = grid_of(jittered, "log")
    carried = on_grid(jittered, signal[:, None], grid)[:, 0]
    error = np.abs(carried - np.sin(2 * np.pi * 3.0 * grid.time))[INSIDE].max()
    assert error < 5e-6
    assert error * 500 < np.abs(signal - np.sin(2 * np.pi * 3.0 * TIME)).max()


def test_grid_of_a_slow_first_step():
    """A first step of nearly two is bridged; the grid ends within the record."""
    time = np.concatenate([[0.0], 3.6e-3 + 2e-3 * np.arange(500)])
    grid = grid_of(time, "log")
    assert grid.step == pytest.approx(2e-3)
    assert grid.rate == pytest.approx(500.0)
    assert time[-1] - grid.step < grid.time[-1] <= time[-1] + 1e-9


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ([0.0, 0.1, 0.1, 0.2], "does not increase at sample 2"),
        ([0.0, 0.1, 0.2, 0.9, 1.0], r"gap of 0.7 s after 0.2 s"),
        ([0.0, float("nan")], "not numbers"),
        ([0.0], "1 instants"),
    ],
)
def test_clocks_that_are_refused(time, message):
    """Time that stands still, a gap, no number, no clock at all: each named with its place."""
    with pytest.raises(AnalysisError, match=message):
        grid_of(np.array(time), "log")


def test_a_cutoff_above_what_was_sampled_is_refused():
    """A low-pass near half of the sampling rate is refused with what would be allowed."""
    with pytest.raises(AnalysisError, match="at most 80 Hz"):
        low_pass(np.zeros((100, 1)), 90.0, RATE)


def test_grid_instants():
    """Instants are computed from their index, not summed up."""
    assert Grid(1.0, 0.1, 4).time.tolist() == [1.0, 1.1, 1.2, 1.0 + 0.1 * 3]


def test_bridged():
    """For those who leave gaps out, a line of even points lies across one; recorded points stay as they are."""
    time = np.r_[0.0:0.5:0.1, 1.2, 1.3]
    assert grid_of(time, "x", bridged=True).count == 14
    whole, values = bridge_gaps(time, np.column_stack([2.0 * time, -time]), 0.1)
    assert np.allclose(np.diff(whole), 0.1)
    assert np.allclose(values, np.column_stack([2.0 * whole, -whole]))
    assert set(time) <= set(whole)
