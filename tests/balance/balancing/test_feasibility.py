"""Conditions that positive masses cannot meet: the combination that forbids it, and masses where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.balancing.feasibility import feasibility
from balance.mechanism.mechanism import pseudo_inertia

from .. import models

FORBIDDEN = {
    ("serial-1r", "planar"): {"Izz[link_1]": 1.0},
    ("serial-3r", "all"): {"Izz[link_3]": 1.0},
    ("scara-quill", "linear"): {"m[quill]": 1.0},
    ("inverted-slider-crank", "all"): {"Izz[B0C]": 1.0, "Izz[slider]": 1.0},
}


@pytest.mark.parametrize("case", FORBIDDEN, ids=str)
def test_what_forbids_it_by_hand(case: tuple[str, str]) -> None:
    """The last link's inertia of an arm, a mass that only slides, two bodies that turn as one."""
    found = feasibility(balance_conditions(models.load(case[0]), case[1]))
    assert found.status == "forbidden"
    assert found.coefficients == pytest.approx(FORBIDDEN[case], abs=1e-4)
    assert found.value > 0.0


@pytest.mark.parametrize("name", ["four-bar", "five-bar", "whitworth", "parallelogram-6bar-full", "3-rrr", "bennett"])
def test_no_mass_anywhere_lowers_it(name: str) -> None:
    """It is a combination of the conditions, and point masses at random places of every body only raise it."""
    conditions = balance_conditions(models.load(name), "all")
    found = feasibility(conditions)
    assert found.status == "forbidden"
    names = conditions.mechanism.parameter_names
    row = np.array([found.coefficients.get(parameter, 0.0) for parameter in names])
    share = np.linalg.lstsq(conditions.matrix.T, row, rcond=None)[0]
    np.testing.assert_allclose(share @ conditions.matrix, row, atol=1e-4)
    for x, y, z in np.random.default_rng(0).normal(size=(200, 3)):
        unit = np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
        raised = row.reshape(-1, 10) @ unit
        assert raised.min() > -1e-4 * (1.0 + x * x + y * y + z * z)


@pytest.mark.parametrize("name", ["serial-2r", "four-bar", "parallelogram-6bar", "whitworth", "five-bar"])
def test_force_alone_can_be_balanced(name: str) -> None:
    """Counter-masses at suitable places meet the conditions on linear momentum."""
    assert feasibility(balance_conditions(models.load(name))).status == "possible"


def test_it_does_not_depend_on_units_of_mass() -> None:
    """The same mechanism in grams: the same combination."""
    mechanism = models.load("slider-crank")
    light = replace(mechanism, parameters=1e-3 * mechanism.parameters)
    one, other = (feasibility(balance_conditions(each, "planar")) for each in (mechanism, light))
    assert other.coefficients == pytest.approx(one.coefficients, abs=1e-3)
    assert other.value == pytest.approx(1e-3 * one.value, rel=1e-3)


def test_the_matrix_of_a_body_is_the_sum_over_its_points() -> None:
    """Of each point mass m at x the matrix is m [x, 1] [x, 1]', from mass, first moments and inertia of all of them."""
    rng = np.random.default_rng(3)
    x, m = rng.normal(size=(5, 3)), rng.uniform(1.0, 2.0, 5)
    inertia = np.einsum("p,pij->ij", m, (x**2).sum(axis=1)[:, None, None] * np.eye(3) - np.einsum("pi,pj->pij", x, x))
    row = np.array([m.sum(), *(m @ x), *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
    whole = np.column_stack([x, np.ones(5)])
    np.testing.assert_allclose(pseudo_inertia(row), np.einsum("p,pi,pj->ij", m, whole, whole), atol=1e-12)
