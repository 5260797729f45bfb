"""Text with unit to SI and nothing else; hostile text is refused, quickly."""

import math
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from balance.errors import UnitError
from balance.units import G0, SI_UNITS, factor_to_si, parse, parse_unit, parse_vector

GOOD = [
    ("5kg", "mass", 5.0), ("250 g", "mass", 0.25), ("37.55mm", "length", 0.03755), ("+40 mm", "length", 0.04),
    ("-1.5e2 cm", "length", -1.5), ("3 g0", "acceleration", 3 * G0), ("5 mg", "acceleration", 0.005 * G0),
    ("1 m/s2", "acceleration", 1.0),
    ("1 m/s²", "acceleration", 1.0), ("2 kHz", "frequency", 2000.0), ("90 deg", "angle", 1.5707963267948966),
    ("90°", "angle", 1.5707963267948966), ("60 rpm", "angular velocity", 6.283185307179586),
    ("20 N m", "moment", 20.0),
    ("20 N·m", "moment", 20.0), ("20 Nm", "moment", 20.0), ("50 mNm", "moment", 0.05),
    ("1 kgm2", "inertia", 1.0), ("150 ms", "time", 0.15), ("5 µm", "length", 5e-6), (".5 kg", "mass", 0.5),
    ("10 kN/mm", "stiffness", 1e7), ("2 lb", "mass", 0.90718474),
    ("3 1/s", "frequency", 3.0), ("1 kg/(m s)*m*s", "mass", 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("text", "dimension", "value"), GOOD)
def test_quantities(text: str, dimension: str, value: float) -> None:
    """Units as people and loggers write them."""
    assert parse(text, dimension) == pytest.approx(value, rel=1e-12)


BAD = {
    "5": "has no unit", "": "no mass", "kg": "no mass", "5 m": "not a unit of mass", "5 kgg": "not a known unit",
    "5,5 kg": "has a comma", "nan kg": "no finite number", "inf kg": "no finite number", "1_000 kg": "not a known unit",
    "1e999 kg": "too large", "5 kg kg": "not a unit of mass", "\N{ARABIC-INDIC DIGIT FIVE} kg": "no mass",
    "5 g0": "not a unit of mass", "1 m; 2 m": "not a known unit", "0x10 kg": "not a", "5 1kg": "not a known unit",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_what_is_no_quantity(text: str) -> None:
    """No number, no unit, another dimension: refused, with the text and what was expected."""
    with pytest.raises(UnitError, match=BAD[text]) as caught:
        parse(text, "mass")
    assert "kg" in str(caught.value)


@pytest.mark.parametrize("dimension", SI_UNITS)
def test_the_si_unit_of_each_dimension_is_one(dimension: str) -> None:
    """Every dimension's own unit has the factor 1."""
    assert factor_to_si(SI_UNITS[dimension], dimension) == pytest.approx(1.0)


HOSTILE = [
    "__import__('os').system('x')", "m" * 100_000, "a1" * 19 + "!", "9**9**9**9 kg", "9^9^9", "2**(10**9)", "m^1e9",
    "kg^(99999999)", "kg^9^9^9", "kg^9 ^9 ^9", "kg ** 9 ** 9 ** 9", "(((((((((((kg", "kg)",
    "lambda: 1", "kg\x00", "m/0",
    "1/0 m", "m**m", "°F", "degC", "\N{SNOWMAN}", "kg²²³", "kg^",
]  # fmt: skip
"""Text that is code, that pint would compute for minutes, or that breaks its tokenizer."""


@pytest.mark.parametrize("unit", HOSTILE)
def test_hostile_units_are_refused_at_once(unit: str) -> None:
    """A unit's text is never evaluated, and never costs more than a moment."""
    start = time.process_time()
    with pytest.raises(UnitError):
        parse(f"1 {unit}", "mass")
    assert time.process_time() - start < 1.0


@settings(max_examples=50)
@given(st.text(max_size=30))
@example("1 kg^2^2")
@example("1 1kg")
def test_any_text_is_a_quantity_or_refused(text: str) -> None:
    """Whatever is typed, a finite number of kilograms or a UnitError."""
    try:
        value = parse(text, "mass")
    except UnitError:
        return
    assert abs(value) < float("inf")


def test_a_text_that_is_no_unit_is_none() -> None:
    """Text that names no unit gives None."""
    assert parse_unit("kg m/s^2") is not None
    assert parse_unit("") is None
    assert parse_unit("Acc X") is None


@pytest.mark.parametrize(
    ("text", "dimension"), [("50 Hz", "angular velocity"), ("50 rad/s", "frequency"), ("1", "angle")]
)
def test_turns_and_cycles_are_not_mixed_up(text: str, dimension: str) -> None:
    """50 Hz is not 50 rad/s: units of angle and of frequency are refused for one another."""
    with pytest.raises(UnitError):
        parse(text, dimension)


def test_revolutions_a_minute() -> None:
    """rev/min and rpm are turns a minute."""
    assert parse("60 rev/min", "angular velocity") == pytest.approx(6.283185307179586, rel=1e-15)
    assert parse("60 rpm", "angular velocity") == pytest.approx(6.283185307179586, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        ("1,5kg", "write '1.5kg'"),
        ("-0,25 kg", "write '-0.25 kg'"),
        ("1,500kg", "write '1.500kg', or '1500kg'"),
        ("1.500,5kg", "with a decimal point and without marks of thousands"),
    ],
)
def test_a_comma_is_refused_with_what_to_write(text: str, stated: str) -> None:
    """A decimal comma is refused by what to write instead, and no mark of thousands is taken for one."""
    with pytest.raises(UnitError, match="has a comma") as refused:
        parse(text, "mass")
    assert stated in str(refused.value)


def test_vectors_need_an_angle():
    """A magnitude and an angle make a vector in SI; a magnitude alone, or a negative one, does not."""
    assert parse_vector("240 kg mm @ 90 deg", "first moment") == pytest.approx(0.24j)
    assert parse_vector("7 mils @ 180 deg", "length", "velocity") == pytest.approx(-7 * 25.4e-6)
    for text in ("240 kg mm", "240 kg mm @", "-1 g @ 3 deg", "1 g @ 30", "1 s @ 30 deg"):
        with pytest.raises(UnitError):
            parse_vector(text, "first moment", "mass")


def test_rotation_is_never_taken_from_hertz():
    """3000 rpm is 314.16 rad/s; 50 Hz would be read as 50 rad/s and is refused."""
    assert parse("3000 rpm", "angular velocity") == pytest.approx(100 * math.pi)
    assert parse("50 turn/s", "angular velocity") == pytest.approx(100 * math.pi)
    for text in ("50 Hz", "3000 1/min", "1e400 rad/s"):
        with pytest.raises(UnitError):
            parse(text, "angular velocity")
