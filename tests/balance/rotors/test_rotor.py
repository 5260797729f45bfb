"""Correction planes, bearing reactions, polygons: the worked example and what must hold for any rotor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from balance.errors import DataError, SizingError
from balance.rotors import rotor as bearings
from balance.rotors.rotor import (
    Plane,
    Unbalance,
    angle_deg,
    correct_planes,
    mass_and_radius,
    polygons,
    unbalance_couple,
    unbalance_force,
    vector_document,
)
from balance.rotors.rotor_files import load_rotor

vectors = st.builds(complex, st.floats(-1, 1), st.floats(-1, 1))
rotors = st.lists(st.builds(Unbalance, st.just("u"), vectors, st.floats(-2, 2)), min_size=1, max_size=6)


def test_worked_example():
    """L = 133.752 kg mm at 348.041 deg, R = 177.412 kg mm at 261.105 deg."""
    rotor = load_rotor("three-masses")
    left, right = correct_planes(rotor.unbalances, rotor.planes).vectors
    assert abs(left) == pytest.approx(133.75176e-3, rel=1e-6)
    assert angle_deg(left) == pytest.approx(348.04083, abs=1e-5)
    assert abs(right) == pytest.approx(177.4116e-3, rel=1e-6)
    assert angle_deg(right) == pytest.approx(261.10508, abs=1e-5)


def test_worked_example_bearings_before_and_after():
    """Bearing loads of the example at 100 rad/s: 1226.1 N and 1609.4 N, then none."""
    rotor = load_rotor("three-masses")
    before = bearings.bearing_loads(rotor.unbalances, rotor.bearings, rotor.speed)
    assert [abs(f) for f in before] == pytest.approx([1226.1156, 1609.4057], rel=1e-6)
    after = bearings.bearing_loads(correct_planes(rotor.unbalances, rotor.planes).after, rotor.bearings, rotor.speed)
    assert max(abs(f) for f in after) < 1e-10


def test_one_plane_is_static_balancing():
    """One plane removes the force, 227.819 kg mm at 296.997 deg, and leaves two equal and opposite bearing loads."""
    rotor = load_rotor("three-masses")
    result = correct_planes(rotor.unbalances, [Plane("m", 0.4)])
    assert abs(result.vectors[0]) == pytest.approx(227.81862e-3, rel=1e-6)
    assert angle_deg(result.vectors[0]) == pytest.approx(296.997, abs=1e-3)
    left, right = bearings.bearing_loads(result.after, rotor.bearings, rotor.speed)
    assert left == pytest.approx(-right, rel=1e-12)
    assert abs(right) == pytest.approx(rotor.speed**2 * abs(result.couple()) / 1.0, rel=1e-12)
    assert not result.is_balanced(1e-3)


@settings(max_examples=60)
@given(rotors, st.lists(st.integers(-30, 30), min_size=2, max_size=5, unique=True))
def test_two_planes_or_more_remove_force_and_couple(unbalances, places):
    """Any rotor, any planes: neither sum nor couple is left, and so no load on any two bearings."""
    result = correct_planes(unbalances, [Plane(str(z), 0.1 * z) for z in places])
    size = sum(abs(u.vector) for u in unbalances) + sum(abs(v) for v in result.vectors)
    assert result.is_balanced(1e-13 * (1.0 + size))
    loads = bearings.bearing_loads(result.after, (-5.0, 7.0), 10.0)
    assert max(abs(f) for f in loads) <= 1e-11 * (1.0 + size)


def test_many_planes_take_the_least_sum_of_squares():
    """Three planes: no other balancing set is smaller; moving along the one free direction makes it larger."""
    unbalances = [Unbalance("a", 0.3 + 0.1j, 0.15), Unbalance("b", -0.2j, 0.7)]
    places = np.array([0.0, 0.4, 1.0])
    result = correct_planes(unbalances, [Plane(str(z), z) for z in places])
    free = np.cross(np.ones(3), places)
    least = np.linalg.norm(result.vectors)
    for step in (0.01, -0.01, 0.01j, -0.01j):
        other = np.array(result.vectors) + step * free
        assert abs(other.sum() + unbalance_force(unbalances)) < 1e-15
        assert abs(other @ places + unbalance_couple(unbalances, 0.0)) < 1e-15
        assert np.linalg.norm(other) > least


def test_a_load_shared_by_bearings_is_a_lever():
    """A single unbalance midway loads both bearings by half, one over a bearing loads that one alone."""
    assert bearings.bearing_loads([Unbalance("u", 2.0, 0.5)], (0.0, 1.0), 3.0) == pytest.approx((9.0, 9.0))
    assert bearings.bearing_loads([Unbalance("u", 2.0, 1.0)], (0.0, 1.0), 3.0) == pytest.approx((0.0, 18.0))
    assert bearings.bearing_weights(10.0, 0.25, (0.0, 1.0), 9.81) == pytest.approx((73.575, 24.525))


def test_polygons_close_and_their_closing_sides_are_the_corrections():
    """The graphical solution: each polygon closes, and the closing side about L is U_R times the distance."""
    rotor = load_rotor("three-masses")
    result = correct_planes(rotor.unbalances, rotor.planes)
    about_left, about_right, sums = polygons(result)
    assert max(p.gap() for p in (about_left, about_right, sums)) < 1e-15
    assert -sum(about_left.vectors) / 0.8 == pytest.approx(result.vectors[1])
    assert -sum(about_right.vectors) / -0.8 == pytest.approx(result.vectors[0])
    assert about_left.closing_names == ("R",)


def test_choose_mass_or_radius():
    """m_b r_b = U: from either the other; both is refused, neither leaves the product."""
    assert mass_and_radius(Plane("p", 0.0, radius=0.1), 0.5j) == (pytest.approx(5.0), 0.1)
    assert mass_and_radius(Plane("p", 0.0, mass=2.0), 0.5j) == (2.0, pytest.approx(0.25))
    assert mass_and_radius(Plane("p", 0.0), 0.5j) is None
    with pytest.raises(DataError, match="choose one"):
        mass_and_radius(Plane("p", 0.0, 0.1, 2.0), 0.5j)


def test_planes_in_one_place_are_refused():
    """Two planes at one place determine no couple."""
    with pytest.raises(SizingError, match="'a' and 'b' are both at"):
        correct_planes([Unbalance("u", 1.0, 0.0)], [Plane("a", 0.5), Plane("b", 0.5)])
    with pytest.raises(SizingError, match="no correction plane"):
        correct_planes([Unbalance("u", 1.0, 0.0)], [])


@pytest.mark.parametrize("turn", [0.0, np.pi / 2, np.pi, 3 * np.pi / 2])
def test_rounding_is_zero_in_documents(turn):
    """A vector along an axis has no other component, and its angle is whole, below a turn; the magnitude stays."""
    shown = vector_document(2.0 * np.exp(1j * turn) - 1e-16j, "kgm")
    assert shown["angle_deg"] == round(np.degrees(turn))
    assert sorted(map(abs, (shown["x_kgm"], shown["y_kgm"]))) == [0.0, pytest.approx(2.0)]
