"""The law of what the base still feels."""

import numpy as np
import pytest

from testbench.publication.model import PARAMETERS, reductions


def test_at_most_eight_parameters():
    """Six of mechanics and the scatter; each has a unit, bounds and a meaning."""
    assert len(PARAMETERS) + 1 <= 8
    assert all(p.low < p.high and len(p.meaning) > 30 for p in PARAMETERS)


def test_nothing_but_force_is_left_as_the_rigid_mechanism_leaves_it(printed):
    """With all parameters zero the reduction is that of the shaking force: 95 to 100 %."""
    found = reductions({"residual_mass": 0.0}, printed)
    assert found == pytest.approx(100.0 * (1.0 - printed.mechanics[:, 1] / printed.mechanics[:, 0]))
    assert found.min() > 95.0


def test_a_residual_matters_less_the_heavier_the_payload(printed):
    """What balancing does not remove is a smaller part of a larger force."""
    found = reductions({"residual_mass": 1.8}, printed)
    light, middle, heavy = (found[printed.payload_kg == payload][0] for payload in printed.payloads)
    assert light < middle < heavy


def test_couples_are_the_same_share_whatever_the_payload(printed):
    """Couples of the counter-masses grow with the force that these balance: where they do, their share stays."""
    found = reductions({"couple_share_x": 0.4}, printed)
    exact = (printed.axis == "x") & (printed.payload_kg != 3.4116)
    assert found[exact] == pytest.approx(60.0, abs=0.1)


def test_flexing_lowers_fast_motions_and_the_moment_acts_across_x_alone(printed):
    """What gives way lowers the reduction, the more the faster; the moment acts across the x motion only."""
    still = reductions({"residual_mass": 1.0}, printed)
    fall = still - reductions({"residual_mass": 1.0, "flexing": 0.01}, printed)
    one = (printed.payload_kg == 5.0) & (printed.motion == "x") & (printed.axis == "x")
    assert (fall > 0.0).all()
    assert (np.diff(fall[one]) > 0.0).all()
    turned = reductions({"residual_mass": 1.0, "moment_weight": 1.2}, printed) - still
    across_x = (printed.motion == "x") & (printed.axis != "x")
    assert (turned[across_x] < -1.0).all()
    assert np.abs(turned[~across_x]).max() < 1e-9


def test_parameters_broadcast(printed):
    """Many parameters at once give what each gives alone."""
    many = reductions({"residual_mass": np.array([0.5, 1.5]), "couple_share_z": np.array([0.1, 0.6])}, printed)
    assert many[1] == pytest.approx(reductions({"residual_mass": 1.5, "couple_share_z": 0.6}, printed))
