"""LabVIEW measurement files."""

import numpy as np
import pytest

from testbench.recording import TimeColumn, UniformClock

from . import reading

FILE_HEADER = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t{decimal}\n"
FILE_HEADER += "Multi_Headings\tYes\nX_Columns\t{x}\n***End_of_Header***\t\n\t\n"
SEGMENT = "Channels\t2\t\t\nSamples\t{n}\t{m}\t\nY_Unit_Label\tN\tm/s^2\t\nX_Dimension\tTime\tTime\t\n"
SEGMENT += "X0\t0.5\t{x0}\t\nDelta_X\t0.001000000\t{dx}\t\n***End_of_Header***\t\t\t\n{names}\n"
ROWS = [f"\t{i + 0.25}\t{-i}" for i in range(6)]
TIMED = [f"{i / 8}\t{i}\t{-i}" for i in range(6)]
F, M, CLOCK = [i + 0.25 for i in range(6)], [-i for i in range(6)], UniformClock(1000.0, 0.5)


@pytest.fixture
def lvm(tmp_path):
    """A file of these segments."""

    def write(segments, decimal=".", x="No", end="\n"):
        path = tmp_path / "run.lvm"
        text = (FILE_HEADER.format(decimal=decimal, x=x) + segments).replace("0.", f"0{decimal}")
        path.write_bytes(text.replace("\n", end).encode("latin-1"))
        return path

    return write


def segment(rows, n=None, m=None, x0="0.5", dx="0.001000000", names="X_Value\tF 1\tm_1\tComment"):
    """A header and rows below it."""
    n = len(rows) if n is None else n
    return SEGMENT.format(n=n, m=n if m is None else m, x0=x0, dx=dx, names=names) + "".join(f"{r}\n" for r in rows)


def in_milliseconds(rows):
    """A segment whose abscissae are in ms."""
    text = segment(rows).replace("X0\t", "X_Unit_Label\tms\tms\t\nX0\t")
    return text.replace("0.001000000", "1.000000000")


MULTI = segment([f"{i / 8}\t{i}\t{i / 4}\t{-i}" for i in range(6)], names="X_Value\tF 1\tX_Value\tm_1\tComment")
SPACED = MULTI.replace("\tN\tm/s^2\t", "\tN\t\tm/s^2\t").replace("\t6\t6\t", "\t6\t\t6\t")
SHORTER = segment([*ROWS[:2], *(f"\t{i}\t" for i in range(2, 6))], n=6, m=2)
CASES = {
    "as written": (segment(ROWS), {}, {"run": (CLOCK, F, M)}, set()),
    "other line ends": (segment(ROWS), {"end": "\r\n"}, {"run": (CLOCK, F, M)}, set()),
    "comments behind rows": (
        segment([ROWS[0] + "\tstart of hit, 3.5", ROWS[1] + "\t", *ROWS[2:]]), {}, {"run": (CLOCK, F, M)},
        {"text_kept"},
    ),
    "decimal comma": (segment(["\t0.25\t0.5"] * 3), {"decimal": ","}, {"run": (CLOCK, [0.25] * 3, [0.5] * 3)}, None),
    "two segments": (
        segment(ROWS) + "\t\n" + segment(ROWS[:4], dx="0.002000000"), {},
        {"run": (CLOCK, F, M), "run segment 2 F 1": (CLOCK, F[:4]),
         "run segment 2 m_1": (UniformClock(500.0, 0.5), M[:4])}, {"blank_lines"},
    ),
    "blocks without header": (
        segment(ROWS, n=3), {}, {"run": (CLOCK, F[:3], M[:3]), "run part 2": (CLOCK, F[3:], M[3:])},
        {"appended_blocks"},
    ),
    "writes in hundreds of pieces": (
        segment(ROWS * 40, n=1), {}, {"run": (None, F * 40, M * 40)}, {"appended_blocks", "no_clock"},
    ),
    "a shorter channel": (
        SHORTER, {}, {"run F 1": (CLOCK, [0.25, 1.25, 2, 3, 4, 5]), "run m_1": (CLOCK, M[:2])}, set(),
    ),
    "recorded abscissae, more rows than declared": (
        segment(TIMED, n=3, dx="0.125").replace("0.001000000", "0.125"), {"x": "One"},
        {"run": (TimeColumn(0, 1.0, assumed=True), [i / 8 for i in range(6)], list(range(6)), M)},
        {"appended_blocks", "time_unit_confirmed"},
    ),
    "abscissae of each channel": (
        MULTI, {"x": "Multi"},
        {"run F 1": (TimeColumn(0, 1.0, assumed=True), [i / 8 for i in range(6)], list(range(6))),
         "run m_1": (TimeColumn(0, 1.0, assumed=True), [i / 4 for i in range(6)], M)}, None,
    ),
    "abscissae of each channel, blank cells above them": (
        SPACED, {"x": "Multi"},
        {"run F 1": (TimeColumn(0, 1.0, assumed=True), [i / 8 for i in range(6)], list(range(6))),
         "run m_1": (TimeColumn(0, 1.0, assumed=True), [i / 4 for i in range(6)], M)}, None,
    ),
    "declared abscissae in ms": (in_milliseconds(ROWS), {}, {"run": (UniformClock(1000.0, 0.0005), F, M)}, set()),
    "recorded abscissae in ms": (
        in_milliseconds([f"{i}\t{i}\t{-i}" for i in range(6)]), {"x": "One"},
        {"run": (TimeColumn(0, 0.001), list(range(6)), list(range(6)), M)}, set(),
    ),
    "a word between the numbers": (
        segment([*ROWS[:2], "\tOverload\t1", *ROWS[2:]]), {},
        {"run": (CLOCK, [*F[:2], np.nan, *F[2:]], [*M[:2], 1, *M[2:]])}, {"not_a_number"},
    ),
}  # fmt: skip
"""Segments, options, clock and columns of each group, and what is found (None: whatever)."""


@pytest.mark.parametrize("name", CASES)
def test_groups_clocks_and_columns(lvm, name):
    """Names, units, start and step are those of the headers; where recordings or abscissae differ, groups do."""
    segments, options, groups, codes = CASES[name]
    found = reading.read(lvm(segments, **options))
    assert {group: found.groups[group].clock for group in found.data} == {n: clock for n, (clock, *_) in groups.items()}
    for group, (_, *columns) in groups.items():
        np.testing.assert_array_equal(found.data[group], columns)
    assert codes in (None, found.codes)
    assert (found.unit("F 1"), found.unit("m_1")) == ("N", "m/s^2")


@pytest.mark.parametrize(
    ("segments", "options", "message"),
    [
        ("", {}, "stands alone"),
        (segment(ROWS, names="X_Value\tF 1\tComment"), {}, "2 channels are declared, 1 are named"),
        (segment(ROWS, n="many"), {}, "Samples is 'many'"),
        (segment(ROWS, dx="fast"), {}, "is no number"),
        (segment(ROWS, n=8), {}, "count_contradiction: declared 8 samples, found 6"),
        (segment(ROWS, n=3), {}, "appended_blocks: declared 3 samples, found 6: 2 blocks"),
        (segment([*ROWS[:2], "\tOverload\t1"]), {}, "'Overload' in line 19"),
        (
            segment([*ROWS[:2], ROWS[2] + "\tLOST COMMUNICATION"]),
            {},
            "text_kept: holds text ('LOST COMMUNICATION'), not numbers; it is kept as it is",
        ),
        (segment(TIMED), {"x": "One"}, "rate_contradiction: the header states 1000 Hz"),
    ],
)
def test_what_contradicts_itself_is_refused_or_found(lvm, segments, options, message):
    """It is said what is wrong: a header, a count, a cell, a step of 1 ms beside abscissae 125 ms apart."""
    assert message in reading.said(lvm(segments, **options))


def test_a_last_number_that_may_be_cut_is_left_out(lvm):
    """It is never used; the cell before it is whole."""
    path = lvm(segment(ROWS))
    path.write_bytes(path.read_bytes()[:-2])
    found = reading.read(path)
    assert "cut_last_row" in found.codes
    assert found.column("F 1").tolist() == F
    np.testing.assert_array_equal(found.column("m_1"), [*M[:5], np.nan])
