"""Cells and rows that are no plain numbers: named with their line, left out or refused, never another number."""

import math

import numpy as np
import pytest

from testbench.readers.csv import text_blocks
from testbench.readers.csv.dialect import Dialect
from testbench.readers.csv.row_parser import RowParser

HEADER = "Time (s),AccX (g),AccY (g)\n"
ROWS = [f"{i / 1000:.4f},{0.5 * i % 7 - 3:.4f},{1.25 * (i % 11):.4f}\n" for i in range(600)]
SHORT = ROWS[:400]


@pytest.mark.parametrize(
    ("token", "reason"),
    [("01C3", "hexadecimal"), ("FF0A", "hexadecimal"), ("(1.5)", "notation"), ("1.5-", "notation"),
     ("- 1.5", "notation"), ("1.5D+08", "notation"), ("1.5+103", "notation"), ("1.5 kN", "notation"),
     ('"1.5"', "notation"), ("0x1F", "notation"), ("1_000", "notation"), ("0.1e", "notation"), ("12A", "hexadecimal"),
     ("E005", None), ("Err 5", None), ("OL", None), ("****", None), ("1e999", None), ("nan", None), ("1.#IND", None)],
)  # fmt: skip
def test_a_number_in_another_notation_is_refused(log, token, reason):
    """What is a number to a person, below numbers written otherwise, is no missing value: its loss is an error."""
    found = log(HEADER + "".join([*ROWS[:500], f"0.5000,{token},1.0\n", *ROWS[501:]]))
    errors = [(f.code, f.where) for f in found.findings if f.severity == 2]
    assert errors == ([("ambiguous_number", "line 502")] if reason else [])
    assert reason is None or reason in found.message("ambiguous_number")


def test_words_before_the_sensor_is_ready_hide_no_numbers(log):
    """A column of words in all of the first lines, and of numbers at the end, is a channel with values missing."""
    found = log(
        "Time (s),F (N),G (N),note\n" + "".join(f"{i / 100},{'WAIT' if i < 600 else i},{i},ok\n" for i in range(1200))
    )
    assert found.column("F (N)")[600:].tolist() == [float(i) for i in range(600, 1200)]
    assert "600 of its cells" in found.message("not_a_number")
    assert [f.channel for f in found.findings if f.code == "text_kept"] == ["note"]


def test_means_under_the_data_are_no_samples(log):
    """A word where the time stands: the line is no row, and an error; a word in another column is a row."""
    found = log(HEADER + "".join(ROWS) + "Average,1.5,2.5\nMax,2.5,3.5\n")
    assert len(found.time()) == len(ROWS)
    assert [(f.code, f.where) for f in found.findings if f.severity == 2] == [
        ("text_row", f"lines {len(ROWS) + 2}, {len(ROWS) + 3}")
    ]
    found = log("AccX (g),Time (s)\n" + "".join(f"{'OL' if i == 50 else i},{i / 100}\n" for i in range(100)))
    assert len(found.time()) == 100
    assert not [f for f in found.findings if f.severity == 2]


@pytest.mark.parametrize(
    ("token", "kept"),
    [("NaN", math.nan), ("", math.nan), ("---", math.nan), ("#N/A", math.nan), ("1.#QNAN", math.nan),
     ("Overload", math.nan), ("1_000", math.nan), ("0x1F", math.nan), ("1D5", math.nan), ("\uff11", math.nan),
     ("\u22122", math.nan), ("inf", math.inf), ("-Infinity", -math.inf), ("1e999", math.inf), (" 2.5 ", 2.5)],
)  # fmt: skip
def test_a_cell_is_the_number_that_it_spells_or_none(log, token, kept):
    """A cell that spells no finite number is NaN or inf, and named with its line; it never becomes another number."""
    rows = [*ROWS[:100], f"0.1000,{token},1.0\n", *ROWS[101:]]
    found = log(HEADER + "".join(rows))
    value = found.column("AccX (g)")[100]
    assert value == kept or (math.isnan(value) and math.isnan(kept))
    wrong = [f for f in found.findings if f.code == "not_a_number"]
    assert [(f.channel, f.where) for f in wrong] == ([] if kept == 2.5 else [("AccX (g)", "line 102")])
    assert found.column("AccY (g)")[100] == 1.0


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ("0.1000,1.0\n", "ragged_row"),
        ("0.1000,1.0,2.0,3.0\n", "ragged_row"),
        ("Stop by operator\n", "text_row"),
        ("a,b,c\n", "text_row"),
        ("0.1\x00000,1,2\n", "nul_bytes"),
        ("\0" * 64 + "\n", "nul_bytes"),
    ],
)
def test_rows_that_may_hide_a_loss_are_refused(log, row, code):
    """A row of another length, a line of text, a NUL byte: an error with its line, and no other row changed."""
    found = log(HEADER + "".join([*ROWS[:100], row, *ROWS[101:]]))
    (finding,) = [f for f in found.findings if f.severity == 2]
    assert (finding.code, finding.where) == (code, "line 102")
    assert found.column("AccX (g)")[-1] == float(ROWS[-1].split(",")[1])


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("End of [file]: 60 rows\x1b\n", r"'End of [file]: 60 rows\x1b'"),
        ("\0" * 64 + "\n", r"'\x00\x00"),
        ("ü" * 300, "'üüü"),
    ],
)
def test_lines_that_are_no_rows_are_shown(log, row, said):
    """The first of them, short, and without what steers a terminal."""
    found = log(HEADER + "".join([*ROWS[:100], row.rstrip("\n") + "\n", *ROWS[101:]]))
    (finding,) = [f for f in found.findings if f.severity == 2]
    assert f": 1, the first is {said}" in finding.message
    assert len(finding.message) < 300


def test_a_mark_that_changes_is_an_error(log):
    """Numbers with the other decimal mark, or with two marks, are never converted."""
    found = log("t (s);F\n0,1;2,5\n0,2;1.234,5\n0,3;2,75\n0.4;2.25\n0,5;7,04\n")
    errors = {f.code: f.where for f in found.findings if f.severity == 2}
    assert errors == {"decimal_mark_changes": "line 5", "ambiguous_number": "line 3"}
    assert np.isnan(found.column("F")).tolist() == [False, True, False, True, False]
    assert found.column("F")[4] == 7.04


def test_thousands_are_not_decimals(log):
    """1,234.50 in quotes, far below the sample of first lines, is refused and not read as 1.234 or 123450."""
    rows = [f'{i / 10},"{900 + i / 10:,.2f}"\n' for i in range(2000)]
    found = log("t (s),F (N)\n" + "".join(rows))
    assert "ambiguous_number" in found.codes
    assert np.nanmax(found.column("F (N)")) < 1000.0


@pytest.mark.parametrize(
    ("ending", "kept", "code"),
    [
        ("0.5000,1.0000,2.0000", [1.0, 2.0], "no_final_newline"),
        ("0.5000,1.0000,2.000", [1.0, np.nan], "cut_last_row"),
        ("0.5000,1.0000,2", [1.0, np.nan], "cut_last_row"),
        ("0.5000,1.0000,", [1.0, np.nan], "cut_last_row"),
        ("0.5000,1.0", [], "cut_last_row"),
        ("0.5000,1.0000,2.0000\r", [1.0, 2.0], None),
        ("\0\0\0\0", [], "nul_bytes"),
        ("\x1a", [], None),
    ],
)
def test_a_last_number_that_may_be_cut_is_never_used(log, ending, kept, code):
    """Without a line end it counts only if it has as many decimals as all above; the cells before it are whole."""
    found = log(HEADER + "".join(SHORT) + ending)
    assert len(found.time()) == len(SHORT) + bool(kept)
    last = [found.column(name)[-1] for name in ("AccX (g)", "AccY (g)")]
    np.testing.assert_array_equal(last if kept else [], kept)
    ends_empty = {"not_a_number"} if kept and np.isnan(kept[-1]) else set()
    assert found.codes - {"dialect"} == ({code} if code else set()) | ({"time_gap"} if kept else set()) | ends_empty


@pytest.mark.parametrize(
    ("numbers", "last", "value"),
    [
        ([f"{i + 100}" for i in range(50)], "15", np.nan),  # of whole numbers none tells
        ([f"{i / 10 + 0.003:g}" for i in range(50)], "0.376", 0.376),
        ([f"{i / 1000:g}" for i in range(50)], "0.076", 0.076),  # 0.01, 0.02 among them
        ([f"{i / 1000:g}" for i in range(50)], "0.07", np.nan),
    ],
)
def test_a_last_number_that_is_as_long_as_most_is_whole(log, numbers, last, value):
    """Where programs drop zeros at the end, most numbers have all decimals; 123 may be the rest of 1234."""
    found = log("t (s),n\n" + "".join(f"{i / 10:.1f},{text}\n" for i, text in enumerate(numbers)) + f"5.0,{last}")
    np.testing.assert_array_equal(found.column("n")[-1:], [value])
    assert ("cut_last_row" in found.codes) == bool(np.isnan(value))


def test_every_cut_gives_a_prefix_of_the_rows(log):
    """Wherever a file is cut, what is read are whole rows of the original; of the last one the last cell may lack."""
    text = HEADER + "".join(ROWS[:8])
    whole = log(text)
    for cut in range(len(HEADER) + len(ROWS[0]) + 1, len(text), 3):  # every place in a row, for rows are of 22 bytes
        found = log(text[:cut])
        n = len(found.time())
        assert n in (text[:cut].count("\n") - 1, text[:cut].count("\n"))
        for name in ("Time (s)", "AccX (g)"):
            assert found.column(name).tobytes() == whole.column(name)[:n].tobytes()
        column, expected = found.column("AccY (g)"), whole.column("AccY (g)")[:n]
        assert (column == expected)[:-1].all()
        assert column[-1] == expected[-1] or (np.isnan(column[-1]) and "cut_last_row" in found.codes)


def test_comments_and_blank_lines_between_the_rows(log):
    """They are passed over and said; lines are still counted right below them."""
    found = log(HEADER + "".join(ROWS[:10]) + "# trigger\n\n" + ROWS[10] + "0.0110,x,1\n")
    assert len(found.time()) == 12
    assert found.codes == {"dialect", "comment_inside", "blank_lines", "not_a_number"}
    assert next(f.where for f in found.findings if f.code == "not_a_number") == "line 15"


def test_slow_sensors_leave_empty_cells(log):
    """Most cells of a slow channel are empty: counted, not listed one by one, and the others are kept."""
    rows = [f"{i / 1000:.3f},1.5,{i if i % 100 == 0 else ''}\n" for i in range(3000)]
    found = log("Time (s),AccX (g),Speed (m/s)\n" + "".join(rows))
    assert np.nanmax(found.column("Speed (m/s)")) == 2900
    assert "2970 of its cells" in found.message("not_a_number")


def test_odd_blocks_far_inside(log, monkeypatch):
    """What is odd in a later block is found with its line; the blocks round it are read as ever."""
    monkeypatch.setattr(text_blocks, "BLOCK_BYTES", 50_000)
    rows = SHORT * 30
    rows[9_000] = "0.0000,oops,1.0000\n"
    found = log(HEADER + "".join(rows))
    assert next(f.where for f in found.findings if f.code == "not_a_number") == "line 9002"
    expected = np.array([float(r.split(",")[2]) for r in rows])
    assert found.column("AccY (g)").tobytes() == expected.tobytes()


@pytest.mark.parametrize("row", ['"0,1";"2",5"', '0,1;2"5', '"0,1;2,5', '"0,1"x;2,5'])
def test_quotes_glue_nothing_together(log, row):
    """A quote in the middle of a cell makes it no number; 2"5 is not 25."""
    rows = "".join(f'"{i},5";"{i},25"\n' for i in range(30))
    found = log('"t";"F"\n' + rows + row + "\n" + rows)
    assert set(np.unique(found.column("F")[np.isfinite(found.column("F"))])) <= {i + 0.25 for i in range(30)} | {2.5}
    assert found.codes & {"not_a_number", "ragged_row", "text_row"}


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_rows_of_empty_cells_are_rows(delimiter):
    """Where all rows of a block were ragged, all of its cells are empty: no number in any of them."""
    columns = RowParser(Dialect(delimiter, "."), 3).columns(f"{delimiter * 2}\n".encode() * 4)
    assert np.isnan(columns).all()
    assert np.shape(columns) == (3, 4)
