"""Intervals and regions by tables of the distributions."""

import numpy as np
import pytest

from balance.estimation.estimate import (
    Estimate,
    beta_quantile,
    chi_square_tail,
    coverage_factor,
    effective_degrees_of_freedom,
    f_tail,
    joint_coverage_factor,
    log_normal_probability,
    normal_probability,
    normal_quantile,
    standard_deviation_within,
    student_quantile,
    student_tail,
)


def test_published_quantiles():
    """Tables of Student's t, of the normal, chi-square and F distributions (JCGM 100:2008, G.2; Abramowitz, Stegun)."""
    assert coverage_factor() == pytest.approx(1.959964, abs=1e-6)
    assert [coverage_factor(n) for n in (1, 4, 14, 1000)] == pytest.approx([12.706, 2.776, 2.145, 1.962], abs=1e-3)
    assert coverage_factor(3, 0.99) == pytest.approx(5.841, abs=1e-3)
    assert joint_coverage_factor(2) == pytest.approx(np.sqrt(5.991), abs=1e-3)
    assert joint_coverage_factor(2, 10) == pytest.approx(np.sqrt(2 * 4.103), abs=1e-3)
    assert joint_coverage_factor(1) == pytest.approx(coverage_factor(), rel=1e-9)
    assert joint_coverage_factor(1, 5) == pytest.approx(coverage_factor(5), rel=1e-9)


def test_tails_and_quantiles_are_inverse():
    """What lies beyond a quantile is the rest of the probability."""
    assert student_tail(np.array([student_quantile(0.975, 7)]), 7) == pytest.approx([0.025], rel=1e-9)
    assert chi_square_tail(joint_coverage_factor(3) ** 2, 3) == pytest.approx(0.05, rel=1e-9)
    assert f_tail(joint_coverage_factor(3, 8) ** 2 / 3, 3, 8) == pytest.approx(0.05, rel=1e-9)
    assert normal_probability(float(normal_quantile(np.array(0.3)))) == pytest.approx(0.3, rel=1e-9)
    assert np.exp(log_normal_probability(np.array([-1.0]))) == pytest.approx([normal_probability(-1.0)], rel=1e-9)
    assert beta_quantile(0.5, 2.0, 2.0) == pytest.approx(0.5, rel=1e-9)
    assert standard_deviation_within(1.959964) == pytest.approx(1.0, abs=1e-6)


def test_an_interval_is_wide_by_uncertainty_and_bounds():
    """Student's t times the standard uncertainty; what other methods give lies inside, bounded on its own side."""
    found = Estimate.single(3.0, 0.5, 4)
    assert found.interval() == pytest.approx((3.0 - 2.776 * 0.5, 3.0 + 2.776 * 0.5), abs=1e-3)
    wider = found.containing([3.2, 2.9])
    assert wider.interval()[0] == pytest.approx(found.interval()[0] - 0.1)
    assert wider.interval()[1] == pytest.approx(found.interval()[1] + 0.2)
    assert wider.standard_uncertainty == pytest.approx(0.5)


def test_regions_hold_as_often_as_they_say():
    """Of drawn pairs 95 % lie in the ellipse of their covariance."""
    covariance = np.array([[2.0, 0.9], [0.9, 1.0]])
    region = Estimate(np.zeros(2), covariance).region()
    drawn = np.random.default_rng(0).multivariate_normal(np.zeros(2), covariance, 20_000)
    turned = (drawn[:, 0] + 1j * drawn[:, 1]) * np.exp(-1j * region.angle)
    inside = (turned.real / region.half_axes[0]) ** 2 + (turned.imag / region.half_axes[1]) ** 2 < 1.0
    assert inside.mean() == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 20_000))
    on_edge = region.outline() * np.exp(-1j * region.angle)
    assert np.abs(on_edge.real / region.half_axes[0]) ** 2 + np.abs(
        on_edge.imag / region.half_axes[1]
    ) ** 2 == pytest.approx(1.0)


def test_degrees_of_freedom_of_a_sum():
    """Welch, Satterthwaite: equal variances add their degrees of freedom; one that is known adds none of its doubt."""
    assert effective_degrees_of_freedom(np.array([1.0, 1.0]), 6.0) == pytest.approx(12.0)
    assert effective_degrees_of_freedom(np.array([1.0, 1.0]), np.array([6.0, np.inf])) == pytest.approx(24.0)
    assert effective_degrees_of_freedom(np.array([1.0, 1.0]), np.inf) == np.inf
