"""Permissible unbalance and trial masses."""

import math

import pytest

from balance.errors import DataError
from balance.rotors.iso21940 import permissible, trial_mass

RPM = 0.10471975511965977


@pytest.mark.parametrize(
    ("grade", "mass", "rpm", "e_um", "u_gmm"),
    [
        (6.3, 40, 3000, 20.053523, 802.14091),
        (2.5, 40, 3000, 7.9577472, 318.30989),
        (6.3, 15, 828, 72.657691, 1089.8654),
        (16, 6, 276, 553.58241, 3321.4945),
    ],
)
def test_permissible_unbalance(grade, mass, rpm, e_um, u_gmm):
    """e_per = G / omega and U_per = 9549.3 G m / n in g mm."""
    allowed = permissible(grade * 1e-3, mass, rpm * RPM)
    assert allowed.eccentricity * 1e6 == pytest.approx(e_um, rel=1e-6)
    assert allowed.unbalance * 1e6 == pytest.approx(u_gmm, rel=1e-6)
    assert allowed.unbalance * 1e6 == pytest.approx(9549.3 * grade * mass / rpm, rel=1e-5)
    assert allowed.reached(allowed.unbalance) == pytest.approx(grade * 1e-3)


def test_shares_of_the_bearing_planes():
    """U_A = U_per L_B / L, and no share below 0.3 or above 0.7."""
    shares = permissible(6.3e-3, 250, 1500 * RPM).in_planes(0.3, 0.5)
    assert [s * 1e6 for s in shares] == pytest.approx([6266.7259, 3760.0355], rel=1e-6)
    capped = permissible(2.5e-3, 12.5, 9000 * RPM).in_planes(0.04, 0.26)
    assert [s * 1e6 for s in capped] == pytest.approx([23.210096, 9.9471839], rel=1e-6)


def test_what_is_out_of_scope_is_refused():
    """A rotor near its critical speed is not rigid; a centre of mass outside the bearings has no shares here."""
    with pytest.raises(DataError, match="rigid rotors"):
        permissible(6.3e-3, 40, 80.0, critical=100.0)
    assert permissible(6.3e-3, 40, 69.0, critical=100.0).unbalance > 0.0
    with pytest.raises(DataError, match="centre of mass between"):
        permissible(6.3e-3, 40, 80.0).in_planes(-0.1, 0.5)
    with pytest.raises(DataError, match="speed is 0"):
        permissible(6.3e-3, 40, 0.0)


@pytest.mark.parametrize(
    ("mass", "rpm", "radius", "planes", "grams"), [(40, 3000, 0.1, 1, 3.9758432), (250, 1500, 0.3, 2, 16.566014)]
)
def test_trial_mass_rule(mass, rpm, radius, planes, grams):
    """A centrifugal force of 10 % of the weight on the plane."""
    assert 1e3 * trial_mass(mass, rpm * RPM, radius, planes) == pytest.approx(grams, rel=1e-6)


@pytest.mark.parametrize("wrong", ["mass", "speed", "radius", "planes", "share"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_trial_mass_of_nothing_is_refused(wrong, value):
    """By the name of what is not above zero."""
    given = {"mass": 40.0, "speed": 300.0, "radius": 0.1, "planes": 1, "share": 0.1} | {wrong: value}
    with pytest.raises(DataError, match=f"{wrong} is"):
        trial_mass(**given)
