"""Partial balance and orders of one cylinder: reference values, closed forms, limits."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from balance.engines import slider_crank
from balance.engines.slider_crank import SliderCrank

CRANK = SliderCrank(0.05, 0.2, 1.0, 0.025, 0.0, 1.2, 0.06, 0.0101, 0.8)
OMEGA = 2 * np.pi * 1000 / 60


def test_series_of_the_exact_motion():
    """Exact coefficients at r / l = 0.25: the first is 1, the second 0.254 and not r / l."""
    found = slider_crank.exact_series(CRANK)
    expected = {1: 1.0, 2: 0.25402504, 4: -0.0040981112, 6: 7.4379033e-05, 8: -1.3332915e-06}
    for k, value in expected.items():
        assert found[k].real == pytest.approx(value, rel=1e-6)
    assert max(abs(found[k]) for k in (3, 5, 7)) < 1e-14


@pytest.mark.parametrize("offset", [0.0, 0.004])
def test_second_order_is_the_limit_of_long_rods(offset):
    """The usual approximation differs from the exact motion by the square of r / l, offset in first order included."""
    errors = []
    for rod in (0.5, 1.0):
        crank = SliderCrank(0.05, rod, piston_mass=1.0, offset=offset)
        exact, rough = slider_crank.exact_series(crank, 2), slider_crank.second_order(crank)
        errors.append(max(abs(exact[k] - rough[k]) for k in (1, 2)))
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.05)


@pytest.mark.parametrize(
    ("weight", "largest", "least", "rms"),
    [
        (0.0, 1529.7887, 728.0547, 1105.6636),
        (1.34, 795.05147, 0.0, 464.03672),
        (1.92, 477.03088, 159.01029, 337.92453),
        (2.1133333, 459.72262, 53.003431, 354.1616),
    ],
)
def test_exact_force_with_counterweights(weight, largest, least, rms):
    """Extremes over a turn, unbalanced and with counterweights m_b at the crank radius."""
    found = slider_crank.residual_extremes(CRANK, weight * CRANK.radius, OMEGA, "exact")
    assert found.largest == pytest.approx(largest, rel=1e-6)
    assert found.least == pytest.approx(least, rel=1e-6, abs=1e-6)
    assert found.rms == pytest.approx(rms, rel=1e-6)


def test_polar_diagram_of_second_order():
    """Points of the published kind of diagram: 1529.8 N at 0 deg, 878.62 N at 46.40 deg for theta = 60 deg."""
    force = slider_crank.residual_force(CRANK, 0.0, np.radians([0.0, 60.0, 180.0]), OMEGA, "order2")
    assert np.abs(force) == pytest.approx([1529.7887, 878.62083, 1211.7681], rel=1e-6)
    assert np.degrees(np.angle(force[1])) == pytest.approx(46.402706, abs=1e-5)


@pytest.mark.parametrize(
    ("model", "fraction", "force"),
    [("order1", 0.5, 318.02059), ("order2", 0.59173432, 418.6841), ("exact", 0.58993413, 419.82907)],
)
def test_best_fraction(model, fraction, force):
    """The fraction with the least largest force, and that force."""
    best = slider_crank.best_fraction(CRANK, model)
    assert best.fraction == pytest.approx(fraction, rel=1e-6)
    inline = CRANK.reciprocating_mass * CRANK.radius * OMEGA**2
    assert best.largest * inline == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.15, 0.3, 0.6, 0.85])
def test_best_fraction_is_not_beaten(ratio):
    """A general minimiser over the largest force on a fine turn finds the same."""
    crank = SliderCrank(1.0, 1.0 / ratio, piston_mass=1.0)
    theta = np.linspace(0.0, 2 * np.pi, 20001)

    def largest(fraction):
        return np.abs(slider_crank.residual_force(crank, fraction, theta, 1.0)).max()

    other = minimize_scalar(largest, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-10})
    best = slider_crank.best_fraction(crank)
    assert best.largest <= other.fun * (1 + 1e-6)
    assert best.largest == pytest.approx(other.fun, rel=1e-6)


def test_the_largest_force_is_at_an_angle_below_a_turn():
    """Unbalanced it is at top dead centre, 0 deg; the search may end on either side of it."""
    extremes = [slider_crank.residual_extremes(CRANK, 0.0, OMEGA, model) for model in ("order1", "order2", "exact")]
    assert [str(each.at_deg) for each in extremes] == ["0.0"] * 3  # neither -0 nor 360


@pytest.mark.parametrize("offset", [0.0, 0.7, -0.7])
def test_a_half_has_the_least_mean_square(offset):
    """The mean square is least at half the reciprocating mass, whatever the rod and the offset."""
    crank = SliderCrank(1.0, 2.0, piston_mass=1.0, offset=offset)
    theta = slider_crank.crank_angles(720)
    squares = [np.mean(np.abs(slider_crank.residual_force(crank, c, theta, 1.0)) ** 2) for c in (0.49, 0.5, 0.51)]
    assert np.mean(squares[::2]) - squares[1] == pytest.approx(1e-4, rel=1e-6)
    assert squares[0] == pytest.approx(squares[2], rel=1e-9)


@pytest.mark.parametrize(("ratio", "percent"), [(0.25, 0.8), (1 / 3, 2.0)])
def test_error_of_second_order(ratio, percent):
    """First and second order are off by 0.8 % at r / l = 0.25 and 2 % at 1/3."""
    crank, theta = SliderCrank(1.0, 1.0 / ratio, piston_mass=1.0), slider_crank.crank_angles(7200)
    off = slider_crank.reciprocating_force(crank, theta, "exact") - slider_crank.reciprocating_force(
        crank, theta, "order2"
    )
    assert 100 * np.abs(off).max() == pytest.approx(percent, rel=0.05)
