"""Numbers in other notations are the numbers that they say where that is beyond doubt, and refused elsewhere."""

import numpy as np
import pytest

from testbench.readers import ReadOptions
from testbench.readers.csv.cell_syntax import MINUS, is_number_like, plain_number

VALUES = [1500.0, -0.088, 0.0, 2.5e-7, -1234.5, 31.0] * 60
THOUSANDS = [-12345.5, -999.25, 0.0, 7.75, 999.5, 1000.0, 1234.5, 12345.75, 1234567.25] * 4
GROUPED = {
    "points, decimal comma": (".", ",", ";", "", "utf-8"),
    "commas in quotes": (",", ".", ",", '"', "utf-8"),
    "blanks, decimal comma": (" ", ",", ";", "", "utf-8"),
    "narrow no-break blanks": ("\u202f", ",", "\t", "", "utf-8"),
    "apostrophes": ("'", ".", ";", "", "utf-8"),
    "typographic apostrophes": ("\u2019", ".", ",", "", "utf-8"),
    "one byte of Windows-1252": ("\u2019", ".", ";", "", "cp1252"),
}


def rows(texts, delimiter=",", quote=""):
    """A log of these texts, each behind a whole number."""
    return f"i{delimiter}F (N)\n" + "".join(f"{i}{delimiter}{quote}{text}{quote}\n" for i, text in enumerate(texts))


def grouped(name):
    """A log of numbers grouped by threes."""
    mark, decimal, delimiter, quote, encoding = GROUPED[name]
    texts = [f"{v:,.2f}".replace(",", "\0").replace(".", decimal).replace("\0", mark) for v in THOUSANDS]
    return rows(texts, delimiter, quote).encode(encoding)


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
@pytest.mark.parametrize("letter", ["D", "d"])
def test_exponents_of_fortran(log, delimiter, decimal, letter):
    """1.5D+03 is 1500, in the bits that ``float()`` gives 1.5E+03."""
    found = log(rows([f"{v:.17E}".replace("E", letter).replace(".", decimal) for v in VALUES], delimiter))
    assert found.column("F (N)").tolist() == VALUES
    assert {f.code for f in found.findings if f.severity > 0} == {"no_clock"}
    assert "number_notation" in found.codes


def test_a_typographic_minus(log):
    """U+2212 is a minus, also in a column whose first negative number comes late."""
    texts = [f"{i}.25,{i - 500}.75".replace("-", MINUS) for i in range(1000)]
    texts[999] = f"{MINUS}1.5,2"
    found = log("Time (s),p (N),q (N)\n" + "".join(f"{i},{text}\n" for i, text in enumerate(texts)))
    assert found.column("p (N)")[-1] == -1.5
    assert found.column("q (N)")[:2].tolist() == [-500.75, -499.75]
    assert not [f for f in found.findings if f.severity > 0]


def test_hexadecimal_counts(log):
    """Counts of a converter in base 16."""
    assert log(rows([f"0x{i:04X}" for i in range(300)])).column("F (N)").tolist() == list(range(300))


@pytest.mark.parametrize("text", ["12D4", "0x", "0xFG", "0x12345678901234", "D5", "1.5D", "1.5D+1234", "1e5D2", "--1"])
def test_codes_stay_as_they_are(text):
    """What may be the name of a part, or is no number at all, is none."""
    assert plain_number(text) == text
    assert not is_number_like(text)


def test_in_a_file_of_nothing_else(log):
    """Rows of such numbers alone are rows of data."""
    found = log("Time F\n" + "".join(f"{i / 100:.4E} {v:.6E}\n".replace("E", "D") for i, v in enumerate(VALUES)))
    assert found.column("F").tolist() == [float(f"{v:.6E}") for v in VALUES]


@pytest.mark.parametrize("name", GROUPED)
def test_thousands_that_leave_no_doubt(log, name):
    """Every number grouped alike, one of them by two marks: the numbers, and that marks were taken off."""
    found = log(grouped(name))
    assert found.column("F (N)").tolist() == THOUSANDS
    assert "thousands_marks" in found.codes
    assert not [f for f in found.findings if f.severity > 0 and f.code not in ("no_clock", "encoding_inferred")]


@pytest.mark.parametrize(
    "texts", [["1.234", "5.678", "2.500"], ["1.234,5", "1.234", "0.5"], ["1.234,5", "12345,6", "2,5"]]
)
def test_thousands_in_doubt_are_refused(log, texts):
    """One mark with three digits, two readings in one column, one number grouped and one not: errors by name."""
    found = log("t (s);F (N)\n" + "".join(f"0,{i};{text}\n" for i, text in enumerate(texts)))
    assert {f.code for f in found.findings if f.severity == 2} <= {"ambiguous_number", "decimal_mark_changes"}
    assert [f for f in found.findings if f.severity == 2]
    assert not np.isin(found.column("F (N)"), [1.234, 5.678]).any()


def test_a_number_grouped_otherwise_far_below_is_refused(log):
    """1.23,5 is no number in any grouping."""
    body = grouped("points, decimal comma").decode().partition("\n")[2]
    found = log("i;F (N)\n" + body * 20 + "720;1.23,5\n")
    assert np.isnan(found.column("F (N)")[-1])
    assert next(f.where for f in found.findings if f.code == "ambiguous_number") == "line 722"


def growing(late, delimiter=";"):
    """A log whose numbers are whole in its first 500 rows; the texts of the last ones are ``late``."""
    return rows([*(str(500 + i) for i in range(500)), *late], delimiter)


@pytest.mark.parametrize("delimiter", [";", "\t", ","])
def test_whole_numbers_that_grow_past_999_are_in_doubt(log, delimiter):
    """1.000 below whole numbers may be one or a thousand: an error with its line, at every delimiter."""
    (finding,) = [f for f in log(growing(["1.000", "1.001"], delimiter)).findings if f.severity == 2]
    assert (finding.code, finding.where) == ("ambiguous_number", "lines 502, 503")
    assert "'1.000'" in str(finding.message)


@pytest.mark.parametrize("late", [["1.000", "0.5"], ["1.000", "1000.5"], ["0.125"], ["1000"]])
def test_a_number_that_is_no_thousand_settles_the_point(log, late):
    """Below whole numbers too, one number such as 0.5 shows that the point is of decimals."""
    found = log(growing(late))
    assert not [f for f in found.findings if f.severity == 2]
    assert found.column("F (N)")[500:].tolist() == [float(text) for text in late]


@pytest.mark.parametrize(
    ("late", "mark", "values"),
    [(["0.606"], ".", [10.0, 0.606]), (["1000.000"], ".", [10.0, 1000.0]), (["2.5"], ".", [10.0, 2.5])],
)
def test_a_number_far_below_settles_three_decimals(log, late, mark, values):
    """Three digits behind the mark in all first lines: the first number that is no thousand shows what it is."""
    found = log(rows([*(f"{10 + i % 900}.000" for i in range(2000)), *late], "\t"))
    assert not [f for f in found.findings if f.severity == 2]
    assert found.recording.settings["decimal"] == mark
    assert found.column("F (N)")[[0, -1]].tolist() == values


def test_points_that_turn_out_as_thousands_are_no_decimals(log):
    """A decimal comma far below: the points of the first lines are in doubt, never decimals."""
    found = log(rows([*(f"{10 + i % 900}.000" for i in range(2000)), "2,5"], ";"))
    assert [f for f in found.findings if f.severity == 2]
    assert not np.isin(found.column("F (N)"), [10.0, 11.0]).any()


def test_a_stated_mark_leaves_no_doubt(log):
    """Who says --decimal point gets 1.000 as one."""
    found = log(growing(["1.000"]), ReadOptions(decimal="."))
    assert found.column("F (N)")[-1] == 1.0
    assert not [f for f in found.findings if f.severity == 2]
