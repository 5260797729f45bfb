"""The law of what the base still feels."""

import dataclasses

import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.mechanism.mjcf_parser import load_mechanism
from studies.kiper2019.model import PARAMETERS, cases, reductions
from testbench import campaign_plan
from testbench.errors import AnalysisError
from testbench.published_tables import load_published


def test_every_number_once(printed):
    """78 numbers: 24 of the lightest payload, 54 of the others."""
    assert [len(printed.of_payload(payload).printed) for payload in printed.payloads] == [24, 30, 24]
    assert len(printed.without_payload(1.451).printed) == 54
    assert printed.across.sum() == 52


def test_forces_follow_from_first_moments(printed):
    """A shaking force by acceleration is the balance conditions' residual by the length of the arms."""
    mechanism = load_mechanism("parallelogram-6bar")
    conditions = balance_conditions(mechanism)
    for run in campaign_plan.load_plan("kiper2019").runs():
        loaded = mechanism.with_payload({"platform": run.payload}).with_counter_mass(run.counter_masses)
        column = 1 if run.counter_masses else 0
        forces = printed.of_payload(run.payload).mechanics[:, column]
        assert forces == pytest.approx(conditions.first_moment_residual(loaded) / 0.15, rel=1e-6)


def test_the_set_of_the_middle_payload_leaves_most(printed):
    """The set built for 3.41 kg leaves 0.0308 kg m, by the conditions; its plates' own force is the rest."""
    without, left, taken, *_ = printed.of_payload(3.4116).mechanics.T
    assert 0.15 * left == pytest.approx(0.0308, abs=5e-5)
    assert taken == pytest.approx(without - left, rel=1e-9)


def test_the_shaking_moment_rises_along_x_and_is_none_along_y(printed):
    """Both arms turn alike in x and oppositely in y; the counter-masses' own inertia adds to the moment."""
    without, moment = printed.mechanics.T[3:]
    x = printed.motion == "x"
    assert (moment[x] > 1.2 * without[x]).all()
    assert np.abs(printed.mechanics[~x, 3:]).max() < 1e-9


def test_a_plan_of_other_tests_is_refused():
    """Printed numbers whose conditions the plan lacks are not left out in silence."""
    with pytest.raises(AnalysisError, match="78 printed numbers"):
        cases(load_published("kiper2019"), campaign_plan.load_plan("kiper2019-brief"))


def test_one_payload_cannot_predict_another():
    """A table of one payload has nothing to predict."""
    table, tests = load_published("kiper2019"), campaign_plan.load_plan("kiper2019")
    rows = {key: value for key, value in table.rows.items() if key[0] == 5.0}
    with pytest.raises(AnalysisError, match="one payload"):
        cases(dataclasses.replace(table, rows=rows), tests)


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
