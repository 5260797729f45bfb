"""Marks of thousands: read where they are beyond doubt, refused everywhere else, and never decimals."""

import numpy as np
import pytest

from testbench.readers import ReadOptions

from .. import reading

VALUES = [-12345.5, -999.25, 0.0, 7.75, 999.5, 1000.0, 1234.5, 12345.75, 1234567.25] * 4
GROUPED = {
    "points, decimal comma": (".", ",", ";", ""),
    "commas in quotes": (",", ".", ",", '"'),
    "blanks, decimal comma": (" ", ",", ";", ""),
    "narrow no-break blanks": ("\u202f", ",", "\t", ""),
    "apostrophes": ("'", ".", ";", ""),
    "typographic apostrophes": ("\u2019", ".", ",", ""),
}


def write(path, values, mark, decimal, delimiter, quote, encoding="utf-8"):
    """A log of these numbers, grouped by threes."""
    texts = [f"{v:,.2f}".replace(",", "\0").replace(".", decimal).replace("\0", mark) for v in values]
    rows = "".join(f"{i}{delimiter}{quote}{text}{quote}\n" for i, text in enumerate(texts))
    path.write_text(f"i{delimiter}F (N)\n{rows}", encoding=encoding)
    return path


@pytest.mark.parametrize("name", GROUPED)
def test_columns_that_leave_no_doubt(tmp_path, name):
    """Every number grouped alike, one of them by two marks: the numbers, and that marks were taken off."""
    found = reading.read(write(tmp_path / "log.csv", VALUES, *GROUPED[name]))
    assert found.column("F (N)").tolist() == VALUES
    assert "thousands_marks" in found.codes
    assert not [f for f in found.findings if f.severity > 0 and f.code != "no_clock"]


def test_in_a_single_byte_encoding(tmp_path):
    """The typographic apostrophe of Windows-1252 is one byte."""
    path = write(tmp_path / "log.csv", VALUES, "\u2019", ".", ";", "", "cp1252")
    assert reading.read(path).column("F (N)").tolist() == VALUES


@pytest.mark.parametrize(
    "texts", [["1.234", "5.678", "2.500"], ["1.234,5", "1.234", "0.5"], ["1.234,5", "12345,6", "2,5"]]
)
def test_columns_in_doubt_are_refused(tmp_path, texts):
    """One mark with three digits, two readings in one column, one number grouped and one not: errors by name."""
    path = tmp_path / "log.csv"
    path.write_text("t;F (N)\n" + "".join(f"0,{i};{text}\n" for i, text in enumerate(texts)))
    found = reading.read(path)
    assert {f.code for f in found.findings if f.severity == 2} <= {"ambiguous_number", "decimal_mark_changes"}
    assert [f for f in found.findings if f.severity == 2]
    assert not np.isin(found.column("F (N)"), [1.234, 5.678]).any()


def test_a_number_grouped_otherwise_far_below_is_refused(tmp_path):
    """1.23,5 is no number in any grouping."""
    path = write(tmp_path / "log.csv", VALUES * 20, ".", ",", ";", "")
    path.write_text(path.read_text() + "720;1.23,5\n")
    found = reading.read(path)
    assert np.isnan(found.column("F (N)")[-1])
    assert next(f.where for f in found.findings if f.code == "ambiguous_number") == "line 722"


def growing(path, late, delimiter=";"):
    """A log whose numbers are whole in its first 500 rows; the texts of the last ones are ``late``."""
    rows = [str(500 + i) for i in range(500)] + late
    path.write_text(f"n{delimiter}F (N)\n" + "".join(f"{i}{delimiter}{text}\n" for i, text in enumerate(rows)))
    return reading.read(path)


def test_whole_numbers_that_grow_past_999_are_in_doubt(tmp_path):
    """1.000 below whole numbers may be one or a thousand: an error with its line, at every delimiter."""
    for delimiter in ";\t,":
        found = growing(tmp_path / "log.csv", ["1.000", "1.001"], delimiter)
        (finding,) = [f for f in found.findings if f.severity == 2]
        assert (finding.code, finding.where) == ("ambiguous_number", "lines 502, 503")
        assert "'1.000'" in str(finding.message)


@pytest.mark.parametrize("late", [["1.000", "0.5"], ["1.000", "1000.5"], ["0.125"], ["1000"]])
def test_a_number_that_is_no_thousand_settles_the_point(tmp_path, late):
    """Below whole numbers too, one number such as 0.5 tells that the point is of decimals."""
    found = growing(tmp_path / "log.csv", late)
    assert not [f for f in found.findings if f.severity == 2]
    assert found.column("F (N)")[500:].tolist() == [float(text) for text in late]


def test_a_stated_mark_leaves_no_doubt(tmp_path):
    """Who says --decimal point gets 1.000 as one."""
    growing(tmp_path / "log.csv", ["1.000"])
    found = reading.read(tmp_path / "log.csv", ReadOptions(decimal="."))
    assert found.column("F (N)")[-1] == 1.0
    assert not [f for f in found.findings if f.severity == 2]
