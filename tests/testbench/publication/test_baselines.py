"""Predictions without mechanics."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.publication.baselines import BASELINES, constant, nearest_acceleration, per_axis


def test_means(training, printed):
    """One mean for all; one for each axis."""
    assert constant(training, printed) == pytest.approx(np.full(78, training.printed.mean()))
    found = per_axis(training, printed)
    for axis in "xyz":
        assert found[printed.axis == axis] == pytest.approx(training.printed[training.axis == axis].mean())


def test_nearest_by_ratio(training, printed):
    """0.5 g0 is nearest to 1 g0, and 3.5 g0 to 4 g0, which is closer by ratio than 3 g0."""
    found = nearest_acceleration(training, printed)
    at = (printed.payload_kg == 3.4116) & (printed.motion == "y") & (printed.axis == "y")
    assert found[at].tolist() == [54.58, 54.58, 54.41, 52.45, 29.02]


def test_equally_near_are_averaged(training):
    """Two that are equally near count alike."""
    root = replace(training, peak_acceleration=np.full(24, 9.81 * np.sqrt(2.0)))
    at = (training.motion == "x") & (training.axis == "x")
    assert nearest_acceleration(training, root)[at] == pytest.approx((52.31 + 44.45) / 2.0)


@pytest.mark.parametrize("name", BASELINES)
def test_a_constant_table_is_predicted(training, printed, name):
    """Of numbers that are all the same, every baseline predicts the same."""
    same = replace(training, printed=np.full(24, 40.0))
    assert BASELINES[name](same, printed) == pytest.approx(40.0)
