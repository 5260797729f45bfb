"""Budgets against the example of JCGM 100:2008, annex H.1: the calibration of an end gauge of 50 mm."""

import numpy as np
import pytest

from balance.estimation.estimate import effective_degrees_of_freedom
from balance.estimation.uncertainty_budget import Budget, Contribution, budget_rows
from balance.results import plain

GAUGE = (
    Contribution("standard", "B", 25.0, "nm", 1.0, "normal", 18.0),
    Contribution("differences", "A", 9.7, "nm", 1.0, "normal", 25.6),
    Contribution("expansion", "B", 0.58e-6, "1/K", 0.1 * 50e6 * 1.0, "rectangular", 50.0),
    Contribution("temperature", "B", 0.029, "K", -50e6 * 11.5e-6, "rectangular", 2.0),
)
"""Table H.1, with the components of the difference together: 25, 9.7, 2.9 and 16.6 nm (u_c = 32 nm, 16 degrees)."""


def test_the_guide_s_example():
    """32 nm, 16 degrees of freedom, k99 there; here k95 = 2.12; shares add to one, the largest comes first."""
    variances = np.array([one.size**2 for one in GAUGE])
    freedom = effective_degrees_of_freedom(variances, np.array([one.degrees_of_freedom for one in GAUGE]))
    budget = Budget("length", 50.000838, "mm", GAUGE, freedom)
    assert budget.standard_uncertainty == pytest.approx(32.0, abs=0.5)
    assert freedom == pytest.approx(16.7, abs=0.8)
    assert budget.factor == pytest.approx(2.12, abs=0.01)
    assert sum(budget.shares) == pytest.approx(1.0)
    header, rows = budget_rows(budget)
    assert [header[0], header[-1]] == ["source", "share"]
    assert [row[0] for row in rows] == ["standard", "temperature", "differences", "expansion"]


def test_what_is_known_has_no_number_of_degrees():
    """In JSON null; the expanded uncertainty is then 1.96 times the combined one."""
    shown = plain(Budget("a", 1.0, "m/s2", (Contribution("noise", "A", 0.5, "m/s2", -2.0, "normal"),)))
    (part,) = shown["contributions"]
    assert part["degrees_of_freedom"] is None
    assert part["contribution"] == 1.0
    assert shown["expanded_uncertainty"] == pytest.approx(1.959964)
