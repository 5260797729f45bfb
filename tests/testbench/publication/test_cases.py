"""Printed numbers with their mechanics."""

import dataclasses

import numpy as np
import pytest

from balance.conditions import find
from balance.loading.loading import load_mechanism
from testbench import plan
from testbench.errors import AnalysisError
from testbench.publication.cases import cases
from testbench.published import load


def test_every_number_once(printed):
    """78 numbers: 24 of the lightest payload, 54 of the others."""
    assert [len(printed.of_payload(payload).printed) for payload in printed.payloads] == [24, 30, 24]
    assert len(printed.without_payload(1.451).printed) == 54
    assert printed.across.sum() == 52


def test_forces_follow_from_first_moments(printed):
    """A shaking force by acceleration is the balance conditions' residual by the length of the arms."""
    mechanism = load_mechanism("parallelogram-6bar")
    conditions = find(mechanism)
    for run in plan.load("kiper2019").runs():
        loaded = mechanism.with_payload({"platform": run.payload}).with_counter_mass(run.counter_masses)
        column = 1 if run.counter_masses else 0
        forces = printed.of_payload(run.payload).mechanics[:, column]
        assert forces == pytest.approx(conditions.residual(loaded) / 0.15, rel=1e-6)


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
        cases(load("kiper2019"), plan.load("kiper2019-brief"))


def test_one_payload_cannot_predict_another():
    """A table of one payload has nothing to predict."""
    table, tests = load("kiper2019"), plan.load("kiper2019")
    rows = {key: value for key, value in table.rows.items() if key[0] == 5.0}
    with pytest.raises(AnalysisError, match="one payload"):
        cases(dataclasses.replace(table, rows=rows), tests)
