"""LabVIEW measurement files."""

import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.recording import TimeColumn, UniformClock

from . import reading

FILE_HEADER = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t{decimal}\n"
FILE_HEADER += "Multi_Headings\tYes\nX_Columns\t{x}\n***End_of_Header***\t\n\t\n"
SEGMENT = "Channels\t2\t\t\nSamples\t{n}\t{m}\t\nY_Unit_Label\tN\tm/s^2\t\nX_Dimension\tTime\tTime\t\n"
SEGMENT += "X0\t0.5\t{x0}\t\nDelta_X\t0.001000000\t{dx}\t\n***End_of_Header***\t\t\t\n{names}\n"


def _write(tmp_path, segments, decimal=".", x="No"):
    path = tmp_path / "run.lvm"
    path.write_text((FILE_HEADER.format(decimal=decimal, x=x) + segments).replace("0.", f"0{decimal}"), "latin-1")
    return path


def _segment(rows, n=None, m=None, x0="0.5", dx="0.001000000", names="X_Value\tF 1\tm_1\tComment"):
    n = len(rows) if n is None else n
    return SEGMENT.format(n=n, m=n if m is None else m, x0=x0, dx=dx, names=names) + "".join(f"{r}\n" for r in rows)


ROWS = [f"\t{i + 0.25}\t{-i}" for i in range(6)]


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_columns_names_units_and_clock_are_as_written(tmp_path, line_end):
    """Names, units, start and step come from the header of the segment, with either line end."""
    path = _write(tmp_path, _segment(ROWS))
    path.write_bytes(path.read_bytes().replace(b"\n", line_end.encode()))
    found = reading.read(path)
    assert found.column("F 1").tolist() == [i + 0.25 for i in range(6)]
    assert (found.unit("F 1"), found.unit("m_1")) == ("N", "m/s^2")
    assert found.group().clock == UniformClock(1 / 0.001, 0.5)
    assert not found.codes


def test_comments_behind_rows_are_no_data(tmp_path):
    """Text behind the last column, a separator alone, and rows without either give the same numbers."""
    rows = [ROWS[0] + "\tstart of hit, 3.5", ROWS[1] + "\t", *ROWS[2:]]
    found = reading.read(_write(tmp_path, _segment(rows)))
    assert found.column("m_1").tolist() == [0, -1, -2, -3, -4, -5]
    assert not found.codes


def test_a_decimal_comma_is_a_decimal(tmp_path):
    """With Decimal_Separator comma, 0,25 is a quarter."""
    found = reading.read(_write(tmp_path, _segment(["\t0.25\t0.5"] * 3), decimal=","))
    assert found.column("F 1").tolist() == [0.25] * 3


def test_segments_with_headers_are_groups(tmp_path):
    """Each header begins a group with its own clock."""
    found = reading.read(_write(tmp_path, _segment(ROWS) + "\t\n" + _segment(ROWS[:4], x0="0.5", dx="0.002000000")))
    sizes = {name: len(columns[0]) for name, columns in found.data.items()}
    assert sizes == {"run": 6, "run segment 2 F 1": 4, "run segment 2 m_1": 4}
    assert found.groups["run segment 2 m_1"].clock == UniformClock(500.0, 0.5)


def test_blocks_without_header_are_groups_of_their_own(tmp_path):
    """Twice the declared samples are two recordings, not one that is twice as long."""
    found = reading.read(_write(tmp_path, _segment(ROWS, n=3)))
    assert found.column("F 1", "run").tolist() == [0.25, 1.25, 2.25]
    assert found.column("F 1", "run part 2").tolist() == [3.25, 4.25, 5.25]
    assert "declared 3 samples, found 6" in found.message("appended_blocks")


def test_blocks_are_cut_where_a_piece_of_the_file_ends(tmp_path, monkeypatch):
    """Where the file is read in small pieces, groups and their samples are the same."""
    path = _write(tmp_path, _segment(ROWS * 7, n=14))
    whole = reading.read(path)
    from testbench.readers.csv import text_blocks

    monkeypatch.setattr(text_blocks, "BLOCK_BYTES", 32)
    pieces = reading.read(path)
    assert list(pieces.data) == list(whole.data) == ["run", "run part 2", "run part 3"]
    for name in whole.data:
        np.testing.assert_array_equal(pieces.data[name], whole.data[name])


def test_writes_in_many_pieces_are_one_group_without_rate(tmp_path):
    """Hundreds of blocks under one header are no triggered recordings; that there is no clock is said."""
    found = reading.read(_write(tmp_path, _segment(ROWS * 40, n=1)))
    assert len(found.column("F 1")) == 240
    assert found.group().clock is None
    assert "appended_blocks" in found.codes


def test_a_shorter_channel_is_a_group_of_its_own(tmp_path):
    """Channels with another number of samples end where they are declared to end, without NaN."""
    rows = [*ROWS[:2], *(f"\t{i}\t" for i in range(2, 6))]
    found = reading.read(_write(tmp_path, _segment(rows, n=6, m=2)))
    assert len(found.column("F 1")) == 6
    assert found.column("m_1").tolist() == [0, -1]
    assert not found.codes


def test_recorded_abscissae_are_the_time(tmp_path):
    """X_Columns One gives a time column, and more rows than declared stay one group."""
    rows = [f"{i / 8}\t{i}\t{-i}" for i in range(6)]
    found = reading.read(_write(tmp_path, _segment(rows, n=3), x="One"))
    assert isinstance(found.group().clock, TimeColumn)
    np.testing.assert_array_equal(found.time(), np.arange(6) / 8)


def test_abscissae_of_each_channel_are_clocks_of_their_own(tmp_path):
    """X_Columns Multi gives one group a channel."""
    rows = [f"{i / 8}\t{i}\t{i / 4}\t{-i}" for i in range(4)]
    path = _write(tmp_path, _segment(rows, names="X_Value\tF 1\tX_Value\tm_1\tComment"), x="Multi")
    found = reading.read(path)
    np.testing.assert_array_equal(found.time("run F 1"), np.arange(4) / 8)
    np.testing.assert_array_equal(found.time("run m_1"), np.arange(4) / 4)


def test_a_stated_step_is_held_against_recorded_abscissae(tmp_path):
    """Delta_X of 1 ms beside abscissae 125 ms apart is a contradiction; of 125 ms, none."""
    rows = [f"{i / 8}\t{i}\t{-i}" for i in range(40)]
    text = _segment(rows)
    assert "1000 Hz" in reading.read(_write(tmp_path, text, x="One")).message("rate_contradiction")
    agreeing = text.replace("0.001000000", "0.125000000")
    assert "rate_contradiction" not in reading.read(_write(tmp_path, agreeing, x="One")).codes


@pytest.mark.parametrize(("x", "rows"), [("No", ROWS), ("One", [f"{i}\t{i}\t{-i}" for i in range(6)])])
def test_abscissae_in_their_own_unit(tmp_path, x, rows):
    """Steps of 1 ms are 1 kHz, whether X_Unit_Label is that of declared or of recorded abscissae."""
    text = _segment(rows).replace("X0\t", "X_Unit_Label\tms\tms\t\nX0\t").replace("0.001000000", "1.000000000")
    found = reading.read(_write(tmp_path, text, x=x))
    clock = found.group().clock
    assert clock == (UniformClock(1000.0, 0.0005) if x == "No" else TimeColumn(0, 0.001))
    assert "rate_contradiction" not in found.codes


def test_fewer_rows_than_declared_are_an_error(tmp_path):
    """A missing row is said with both numbers."""
    found = reading.read(_write(tmp_path, _segment(ROWS, n=8)))
    assert found.message("count_contradiction") == "declared 8 samples, found 6"


def test_a_cut_last_row_is_left_out(tmp_path):
    """A number that may be cut is never used."""
    path = _write(tmp_path, _segment(ROWS))
    path.write_bytes(path.read_bytes()[:-3])
    found = reading.read(path)
    assert {"cut_last_row", "count_contradiction"} <= found.codes
    assert len(found.column("F 1")) == 5


def test_cells_that_are_no_number_are_named_by_line(tmp_path):
    """A word between the numbers is NaN, and its line is said."""
    found = reading.read(_write(tmp_path, _segment([*ROWS[:2], "\tOverload\t1", *ROWS[2:]])))
    assert "'Overload' in line 19" in found.message("not_a_number")
    assert np.isnan(found.column("F 1")[2])


@pytest.mark.parametrize(
    ("segments", "said"),
    [
        ("", "stands alone"),
        (_segment(ROWS, names="X_Value\tF 1\tComment"), "2 channels are declared, 1 are named"),
        (_segment(ROWS, n="many"), "Samples is 'many'"),
        (_segment(ROWS, dx="fast"), "is no number"),
    ],
)
def test_headers_that_contradict_themselves_are_refused(tmp_path, segments, said):
    """The refusal says what is wrong."""
    with pytest.raises(RecordingError, match=said):
        reading.read(_write(tmp_path, segments))
