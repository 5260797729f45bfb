"""Lengths in symbols, and the rounding of their digits."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from balance.errors import UnitError
from balance.linkages.expressions import Point, Symbol, read_length, symbol

LENGTHS = {"L2": Symbol(0.18, 5e-4), "L7": Symbol(0.09, 5e-6)}
VALUES = {name: s.value for name, s in LENGTHS.items()}


@pytest.mark.parametrize(
    ("text", "value", "printed"),
    [
        ("L2/2", 0.09, "L2/2"),
        ("-L2/4 - L7/4", -0.0675, "-L2/4 - L7/4"),
        ("2 L2 + 10 mm", 0.37, "2 L2 + 0.01 m"),
        ("0.25*L2", 0.045, "L2/4"),
        ("-45 mm", -0.045, "-0.045 m"),
        ("1e-3 m + L7", 0.091, "L7 + 0.001 m"),
        ("L2 - L2", 0.0, "0 m"),
    ],
)
def test_sums_of_lengths(text, value, printed):
    """Value and symbols of what a description may say."""
    expression = read_length(text, LENGTHS)
    assert expression.at(VALUES) == pytest.approx(value)
    assert expression.text() == printed


@pytest.mark.parametrize("text", ["", "L9", "45", "L2 L7", "L2 +", "3 kg", "L2**2", "(L2)", "__import__"])
def test_anything_else_is_refused(text):
    """Nothing is evaluated that is not a length."""
    with pytest.raises(UnitError):
        read_length(text, LENGTHS)


@given(st.floats(-10, 10), st.floats(-1, 1), st.floats(-1, 1))
def test_turning_keeps_lengths(angle, x, y):
    """A turned point is as far away."""
    point = Point(read_length("L2", LENGTHS).times(x), read_length("L7", LENGTHS).times(y))
    turned = point.turned(angle).at(VALUES)
    assert turned @ turned == pytest.approx(point.at(VALUES) @ point.at(VALUES), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "dimension", "half"),
    [
        ("0.756 kg", "mass", 5e-4),
        ("3.0 kg", "mass", 0.05),
        ("6.64e-3 kg m^2", "inertia", 5e-6),
        ("450 mm", "length", 5e-4),
    ],
)
def test_half_a_unit_of_the_last_digit(text, dimension, half):
    """As written, trailing zeros included."""
    assert symbol(text, dimension).half_unit == pytest.approx(half)
