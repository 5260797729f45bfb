"""Errors of predictions, and what the calibrated table says of the law's terms."""

from dataclasses import replace

import numpy as np
import pytest

from studies.kiper2019.model import NAMES
from studies.kiper2019.validation import (
    BASELINES,
    FORMS,
    WAYS,
    constant,
    forms,
    groups,
    mean_error,
    nearest_acceleration,
    per_axis,
)


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


@pytest.mark.parametrize(
    ("name", "held_out", "left_out"),
    [("constant", 13.8, 11.4), ("per axis", 12.3, 9.5), ("nearest acceleration", 11.0, 8.4)],
)
def test_baselines_err_as_known(printed, training, name, held_out, left_out):
    """The baselines' errors on 54 numbers, and with each payload left out, to the decimal."""
    asked = printed.without_payload(1.451)
    errors = [mean_error(WAYS[name](printed.without_payload(p)), printed.of_payload(p)) for p in printed.payloads]
    assert round(mean_error(WAYS[name](training), asked), 1) == held_out
    assert round(float(np.mean(errors)), 1) == left_out


def test_groups_find_where_it_fails(printed):
    """A group is told as failing where its errors have one sign and exceed the scatter, not where they scatter."""
    asked = printed.without_payload(1.451)
    wrong = asked.printed + 2.0 * (-1.0) ** np.arange(54) + 20.0 * ((asked.payload_kg == 5.0) & (asked.axis == "y"))
    first, *others = groups(asked, wrong, 4.0)
    assert (first.payload_kg, first.axis, first.count, first.fails) == (5.0, "y", 8, True)
    assert not any(group.fails for group in others)


def test_every_term_is_asked_for(training):
    """Leaving conditions out of the 1.45 kg table, no form does better than the whole law."""
    found = forms(training)
    assert len(found) == len(FORMS)
    assert found[0].parameters == NAMES
    assert all(form.left_out >= form.fitted for form in found)
