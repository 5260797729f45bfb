"""Measured speed beside the machine's equation of motion."""

import numpy as np
import pytest

from testbench.errors import AnalysisError
from testbench.rotating import Disc, number_edges, periodic_turn, speed_history, speed_results

from . import discs


def test_the_first_edge_s_angle_is_found():
    """Without an index pulse the curves are laid over each other: to half a degree, speeds to 0.05 rpm rms."""
    log = number_edges("log", discs.turning(start=1.234), Disc(100))
    held = speed_results.joint_fit(periodic_turn(log), discs.machine())
    assert held.first_edge == pytest.approx(1.234, abs=0.01)
    assert held.aligned
    assert held.rms_difference() < 0.05 * discs.RPM


def test_the_true_reading_is_told_from_the_other():
    """The log made without gearing lies on that curve, and far from the geared one."""
    turn = periodic_turn(number_edges("log", discs.turning(), Disc(100)))
    nominal = 276 * discs.RPM
    off = {
        reading: speed_results.joint_fit(
            turn, speed_results.drive_machine("inverted-slider-crank", nominal, reading), 0.0
        ).rms_difference()
        for reading in ("geared", "ungeared")
    }
    assert off["ungeared"] < 0.01 * discs.RPM
    assert off["geared"] > 2.0 * discs.RPM


def test_a_reading_left_open_must_be_said():
    """The source leaves it open, so the comparison asks."""
    with pytest.raises(AnalysisError, match="--reading"):
        speed_results.drive_machine("inverted-slider-crank", 276 * discs.RPM, None)


def test_a_start_edge_by_edge_lies_on_the_computed_one():
    """From the tenth edge on within 0.05 rpm, at the crank's angle; its own intervals hold most."""
    log = number_edges("log", discs.starting(), Disc(100))
    speed, run = speed_history(log), speed_results.computed_start_up(discs.machine(), 4, 0.0)
    late = speed.angle > 0.6
    computed = np.interp(speed.angle + 2 * np.pi / 100, run.travel, run.speed)
    assert np.abs(speed.speed - computed)[late].max() < 0.05 * discs.RPM
    assert abs(speed_results.start_up_delay(speed, run)) < 0.02


def test_local_cubics_carry_an_honest_interval():
    """Jitter of 5 us: about 95 % of the intervals hold the true speed."""
    log = number_edges("log", discs.turning(jitter=5e-6, clock=0.0, turns=20), Disc(100))
    found = speed_history(log)
    inside = np.abs(found.speed - discs.truth().rate(found.angle)) < found.error
    assert 0.9 < inside.mean() < 0.99


def test_gaps_are_not_computed_through():
    """No speed is given at edges whose window holds a gap."""
    time = np.delete(discs.turning(), [200, 201])
    found = speed_history(number_edges("log", time, Disc(100), bridge=True))
    assert not ((found.time > time[197]) & (found.time < time[202])).any()
    np.testing.assert_allclose(found.speed, discs.truth().rate(found.angle), rtol=5e-4)
