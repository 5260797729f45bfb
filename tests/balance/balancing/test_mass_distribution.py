"""Masses among sites: least squares, then the lightest, then the least squares of the masses; unique and in bounds."""

import numpy as np
import pytest

from balance.balancing.sizing import distribute_masses

TWO_ARMS = np.array([[0.1, 0.2, 0.0, 0.0], [0.0, 0.0, 0.1, 0.1]])
"""Two sites at 0.1 m and 0.2 m on one arm, two alike at 0.1 m on the other."""


@pytest.mark.parametrize("removable", [False, True])
def test_the_lightest_and_among_equals_even(removable):
    """The far site carries all of its arm's mass; sites that are alike share it evenly."""
    found = distribute_masses(TWO_ARMS, np.array([0.3, 0.4]), removable=removable)
    assert found.masses == pytest.approx([0.0, 1.5, 2.0, 2.0], abs=1e-9)


def test_limits():
    """What a limited site cannot carry goes to the next."""
    found = distribute_masses(TWO_ARMS, np.array([0.3, 0.4]), np.array([9.0, 1.0, 1.0, 9.0]))
    assert found.masses == pytest.approx([1.0, 1.0, 1.0, 3.0], abs=1e-9)


def test_masses_are_taken_away_only_where_they_may_be():
    """Too much on an arm: nothing is mounted there, or mass is removed where that takes least."""
    target = np.array([-0.3, 0.4])
    assert distribute_masses(TWO_ARMS, target).masses == pytest.approx([0.0, 0.0, 2.0, 2.0], abs=1e-9)
    removed = distribute_masses(TWO_ARMS, target, removable=True).masses
    assert removed == pytest.approx([0.0, -1.5, 2.0, 2.0], abs=1e-9)


def test_masses_change_with_the_target_as_stated():
    """A small change of the target moves the masses by their slopes."""
    target, change = np.array([0.3, 0.4]), np.array([0.001, -0.002])
    before, after = (distribute_masses(TWO_ARMS, t, removable=True) for t in (target, target + change))
    assert after.masses - before.masses == pytest.approx(before.per_target @ change, abs=1e-9)


def test_more_conditions_than_sites_are_least_squares():
    """What no mass can change stays; the rest is fitted."""
    columns, target = np.array([[0.1], [0.1]]), np.array([0.2, 0.4])
    assert distribute_masses(columns, target).masses == pytest.approx([3.0])
