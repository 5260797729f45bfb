"""Sheets: each key with its unit, by name when it is wrong."""

import math

import pytest

from balance.errors import DataError, UnitError
from balance.sheet import Sheet, quantity, vector


def test_vectors_need_an_angle():
    """A magnitude and an angle make a vector in SI; a magnitude alone, or a negative one, does not."""
    assert vector("240 kg mm @ 90 deg", "first moment") == pytest.approx(0.24j)
    assert vector("7 mils @ 180 deg", "length", "velocity") == pytest.approx(-7 * 25.4e-6)
    for text in ("240 kg mm", "240 kg mm @", "-1 g @ 3 deg", "1 g @ 30", "1 s @ 30 deg"):
        with pytest.raises(UnitError):
            vector(text, "first moment", "mass")


def test_rotation_is_never_taken_from_hertz():
    """3000 rpm is 314.16 rad/s; 50 Hz would be read as 50 rad/s and is refused."""
    assert quantity("3000 rpm", "angular velocity") == pytest.approx(100 * math.pi)
    assert quantity("50 turn/s", "angular velocity") == pytest.approx(100 * math.pi)
    for text in ("50 Hz", "3000 1/min", "1e400 rad/s"):
        with pytest.raises(UnitError):
            quantity(text, "angular velocity")


def test_unread_keys_are_refused():
    """A key that nothing asked for is refused, what was expected listed."""
    sheet = Sheet({"mass": "1 kg", "colour": "red"}, "sheet.toml")
    assert sheet.quantity("mass", "mass") == 1.0
    with pytest.raises(DataError, match="unknown key 'colour': expected mass"):
        sheet.finish()


@pytest.mark.parametrize(
    ("table", "read"),
    [
        ({"n": True}, lambda s: s.number("n")),
        ({"n": float("nan")}, lambda s: s.number("n")),
        ({"n": 3}, lambda s: s.text("n")),
        ({"n": "yes"}, lambda s: s.flag("n")),
        ({"n": 3}, lambda s: s.quantity("n", "mass")),
        ({"n": "-3 kg"}, lambda s: s.quantity("n", "mass", positive=True)),
        ({"n": "3 m"}, lambda s: s.maybe("n", "mass")),
        ({"n": "3 kg"}, lambda s: s.quantities("n", "mass")),
        ({"n": [1, "2"]}, lambda s: s.numbers("n")),
        ({"n": []}, lambda s: s.sheets("n")),
        ({"n": 1}, lambda s: s.sheet("n")),
        ({}, lambda s: s.value("n")),
    ],
)
def test_wrong_values_are_named(table, read):
    """The key that holds the wrong thing is in the message, with what was expected."""
    with pytest.raises(DataError, match=r"sheet.toml: n"):
        read(Sheet(table, "sheet.toml"))
