import pytest

from testbench.readers.csv.dialect import UnclearDialect, detect_dialect
from testbench.readers.csv.header import Header, named_channels, read_header, time_column, unknown_brackets
from testbench.units import seconds_per


def header(text: str, has_header: bool | None = None) -> Header:
    """The header of a text whose dialect is detected."""
    lines = text.split("\n")
    return read_header(lines, detect_dialect(lines), has_header)


def test_names_stay_as_written_and_units_stand_beside() -> None:
    """The name is the header cell, the unit what its brackets hold, the label the rest."""
    found = header("Time (s),Acc X [m/s²],Force (filtered) (N),Angle (X)\n0.1,1.5,2.5,3.5\n0.2,1,2,3")
    assert [(c.name, c.unit, c.label) for c in found.channels] == [
        ("Time (s)", "s", "Time"),
        ("Acc X [m/s²]", "m/s²", "Acc X"),
        ("Force (filtered) (N)", "N", "Force (filtered)"),
        ("Angle (X)", None, "Angle (X)"),
    ]


def test_units_in_a_second_row() -> None:
    """A row of units under the names is no data and no name."""
    found = header("t;AccX;n\ns;[m/s²];\n0,1;2,5;1\n0,2;2,6;2")
    assert [(c.name, c.unit) for c in found.channels] == [("t", "s"), ("AccX", "m/s²"), ("n", None)]
    assert found.first_data_line == 3


@pytest.mark.parametrize(
    ("first_rows", "expected"),
    [
        ("Time;Force;Angle\ns;blorp;deg", [("Time", "s"), ("Force", "blorp"), ("Angle", "deg")]),
        ("Zeit;Kraft;Weg\n[s];[Furlong];[Elle]", [("Zeit", "s"), ("Kraft", "Furlong"), ("Weg", "Elle")]),
        ("Load;Span;Angle\nkN;blorp;deg", [("Load", "kN"), ("Span", "blorp"), ("Angle", "deg")]),
        ("run 7;hall 2;cell 3\nTime;Force;Angle", [("Time", None), ("Force", None), ("Angle", None)]),
        ("Test;Run;Ali\nTime (s);F (N);A (g)", [("Time (s)", "s"), ("F (N)", "N"), ("A (g)", "g")]),
        ("Strom;Kraft;Weg\n[A];kN/(m);(mm)", [("Strom", "A"), ("Kraft", "kN/(m)"), ("Weg", "mm")]),
    ],
)
def test_an_unknown_unit_in_a_second_row_takes_no_name(first_rows: str, expected: list[tuple[str, str | None]]) -> None:
    """A row of units with an odd one among them is a row of units still, and the odd one is kept as written."""
    found = header(f"{first_rows}\n0,1;2,5;1\n0,2;2,6;2")
    assert [(c.name, c.unit) for c in found.channels] == expected


@pytest.mark.parametrize(
    ("above", "expected"),
    [
        ("Time;Force;Acc\nSR = 9 Hz;SR = 9 Hz;SR = 9 Hz\n01.02.2024 10:00:00;;\nT0 = 0;;\ns;N;g", "Time Force Acc"),
        ("Time;Force;Acc\n2024-02-01;x;y", "Time Force Acc"),
        ("Time;Acc;Acc\n;X;Y\ns;g;g", "Time X Y"),
        ("Vertical Units;CH1:V;CH2:V\nSecond;Volt;Value", "Second Volt Value"),
        ("Operator;Ali;\n;X;Y", "col0 X Y"),
    ],
)
def test_names_above_rows_that_are_none(above: str, expected: str) -> None:
    """Rates, dates and starts of channels below their names are no names; a cell without one has the name above it."""
    found = header(f"{above}\n0,1;2,5;1,5\n0,2;2,6;2,5")
    assert [c.label for c in found.channels] == expected.split()


def test_a_factor_behind_the_unit_leaves_no_unit() -> None:
    """Numbers of a channel called F (N) x10 are no newtons; x1 behind a unit may be an axis."""
    found = header("F (N) x10,A [g] *1e-3,Fx1 (N),B (g) x1\n0.1,1.5,2.5,3.5\n0.2,1,2,3").channels
    assert [c.unit for c in found] == [None, None, "N", "g"]


def test_unknown_units_in_brackets() -> None:
    """Square brackets and the signs of units tell a unit; others in round ones stay in the name, and are said."""
    found = header("A [blorp],B (kp/Elle),C (filtered),D [2]\n0.1,1.5,2.5,3.5\n0.2,1,2,3").channels
    assert [c.unit for c in found] == ["blorp", "kp/Elle", None, None]
    assert [unknown_brackets(c) for c in found] == ["", "", "filtered", ""]


def test_no_header_loses_no_row() -> None:
    """Without names the first row is data and the columns are numbered."""
    found = header("1.5,2,3,\n1.6,2,3,\n1.7,2,3,")
    assert [c.name for c in found.channels] == ["col0", "col1", "col2", "col3"]
    assert (found.first_data_line, found.named) == (1, False)


def test_a_delimiter_at_the_end_of_each_row_is_no_column() -> None:
    """Where names stand above, an empty last field is not a channel."""
    for text in ("a,b,\n1.5,2,\n2.5,3,", "a,b\n1.5,2,\n2.5,3,"):
        found = header(text)
        assert ([c.name for c in found.channels], found.fields) == (["a", "b"], 3)


def test_names_with_the_delimiter_in_them_are_refused() -> None:
    """Three names over two columns: none is moved to another column silently."""
    with pytest.raises(UnclearDialect, match="3 names, the rows below it have 2 fields"):
        header("Time (s),Force, N\n0.1,2.5\n0.2,2.6")


def test_names_in_a_comment() -> None:
    """The header that numpy.savetxt writes is one; a sentence with a colon is not."""
    assert [c.name for c in header("# t, a\n0.1,2.5\n0.2,2.6").channels] == ["t", "a"]
    assert header("# Sensor: 16 g, 3 axes\n0.1,2.5\n0.2,2.6").named is False


@pytest.mark.parametrize(
    ("name", "factor", "assumed"),
    [("Time (s)", 1.0, False), ("t_us", 1e-6, False), ("Zaman [ms]", 1e-3, False), ("ZAMAN", 1.0, True),
     ("Zeitstempel (s)", 1.0, False), ("timestamp", 1.0, True), ("t (ticks)", None, False),
     ("Time [ticks]", None, False)],
)  # fmt: skip
def test_time_is_known_by_name_and_its_unit_is_not_guessed(name: str, factor: float | None, assumed: bool) -> None:
    """The time column's unit is read; if there is none, that seconds were assumed is marked."""
    column = time_column(named_channels(["AccX (g)", name], ["", ""]))
    assert column is not None
    assert (column.index, column.seconds_per_unit, column.assumed) == (1, factor, assumed)


NOTATION = "Time/s,K1x/V,ax/(m/s^2),F/N,T / °C,Kraft/kN"


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (NOTATION, [("Time", "s"), ("K1x", "V"), ("ax", "m/s^2"), ("F", "N"), ("T", "°C"), ("Kraft", "kN")]),
        ("millis,F/N,a/m/s²", [("millis", None), ("F", "N"), ("a", "m/s²")]),  # most names
        ("t/ms,km/h,m/s²,events/s,v_km/h,acc_m/s^2,A/D1,in/out,Nm/A,Speed (km/h)",
         [("t", "ms"), ("km/h", None), ("m/s²", None), ("events/s", None), ("v_km/h", None), ("acc_m/s^2", None),
          ("A/D1", None), ("in/out", None), ("Nm/A", None), ("Speed", "km/h")]),
        ("Time (s),S/N,imu/x,imu/g", [("Time", "s"), ("S/N", None), ("imu/x", None), ("imu/g", None)]),  # one or two
        ("A/D1,B/D2", [("A/D1", None), ("B/D2", None)]),
        ("time/V,t/s", [("time/V", None), ("t", "s")]),
        ("t/s,B/C2,A/V1,sigma/mm2,G/N", [("t", "s"), ("B/C2", None), ("A/V1", None), ("sigma", "mm2"), ("G", "N")]),
    ],
)  # fmt: skip
def test_quantity_and_unit_with_a_slash(names: str, found: list[tuple[str, str | None]]) -> None:
    """As ISO 80000-1 has it, where time or most names are written so; other slashes stay in the names."""
    channels = named_channels(names.split(","), [""] * len(found))
    assert [(c.label, c.unit) for c in channels] == found
    assert [c.name for c in channels] == names.split(",")
    column = time_column(channels)
    expected = [(i, seconds_per(unit or "")) for i, (label, unit) in enumerate(found) if label in {"Time", "t"}]
    assert ([] if column is None else [(column.index, column.seconds_per_unit)]) == expected


def test_no_time_column() -> None:
    """A channel that is not called time is not taken for it."""
    assert time_column(named_channels(["timer", "Temperature (s)"], ["", ""])) is None
