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


@pytest.mark.parametrize(
    "spellings",
    [
        "m/s²; m/s^2; m s-2; m/s/s; metres/s^2",
        "deg/s; °/s; degrees/s",
        "Nm; N m; N.m; N·m; Newton meter",
        "kNm; kN m",
        "mNm; mN·m",
        "N mm; Nmm",
        "N cm; Ncm",
        "Nm/rad; N m/radian",
        "kg m²; kgm2; kgm^2",
        "rpm; RPM; rev/min; U/min; tr/min; turn/min",
        "µs; us; μs; usec",
        "s; sec; seconds; saniye",
        "µε; ueps; ustrain",
        "A; Amps",
        "°C; degC",
        "mV; mVolt",
    ],
)
def test_spellings_of_one_unit_are_the_same(spellings: str) -> None:
    """However it is written; each is known, and is that unit in both directions."""
    every = spellings.split("; ")
    assert all(units.is_unit(one) and units.same_unit(one, other) for one in every for other in every)


@pytest.mark.parametrize(
    ("one", "other"),
    [("deg", "rad"), ("m/s²", "m/s"), ("Nm", "N"), ("Nm", "nm"), ("Nm", "N/m"), ("mN", "m N"), ("kNm", "Nm"),
     ("Nmm", "Nm"), ("rpm", "Hz"), ("ms", "Ms^-1"), ("us", "ms"), ("Nm^2", "N^2 m^2"), (None, None)],
)  # fmt: skip
def test_other_units_are_not_the_same(one: str | None, other: str | None) -> None:
    """Another quantity, or another size of it."""
    assert not units.same_unit(one, other)


def test_seconds_per_unit_of_time() -> None:
    """Units of time in several languages have their length; others have none."""
    assert [units.seconds_per(u) for u in ("s", "ms", "µs", "us", "dk", "h", "g")] == [
        1.0, 1e-3, 1e-6, 1e-6, 60.0, 3600.0, None,
    ]  # fmt: skip
