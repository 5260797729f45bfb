import pytest

from testbench import units


@pytest.mark.parametrize(
    "text",
    ["g", "m/s²", "m/s^2", "m s-2", "°/s", "N·m", "Nmm", "mV/V", "µm/m", "1/min", "km/h", "kg m²", "Newtons", "-"],
)
def test_units_of_loggers_are_known(text: str) -> None:
    """Units as loggers write them are recognised."""
    assert units.is_unit(text)


@pytest.mark.parametrize("text", ["X", "ai0", "1", "0", "raw", "filtered", "", "m/", "//", "dof", "x" * 50])
def test_other_texts_in_brackets_are_no_units(text: str) -> None:
    """Axis names, indices and words in brackets are not taken for units."""
    assert not units.is_unit(text)


def test_spellings_of_one_unit_are_the_same() -> None:
    """m/s², m/s^2, m s-2 and m/s/s are one unit; m/s is another."""
    assert all(units.same_unit("m/s²", other) for other in ("m/s^2", "m s-2", "m/s/s"))
    assert units.same_unit("deg/s", "°/s")
    assert not units.same_unit("deg", "rad")
    assert not units.same_unit("m/s²", "m/s")
    assert not units.same_unit(None, None)


def test_seconds_per_unit_of_time() -> None:
    """Units of time in several languages have their length; others have none."""
    assert [units.seconds_per(u) for u in ("s", "ms", "µs", "us", "dk", "h", "g")] == [
        1.0, 1e-3, 1e-6, 1e-6, 60.0, 3600.0, None,
    ]  # fmt: skip
