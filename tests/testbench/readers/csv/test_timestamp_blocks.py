"""Times of whole blocks at once are those of one row after the other, for whatever rows."""

from dataclasses import replace
from datetime import datetime, timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.readers.csv.cell_syntax import read_timestamp
from testbench.readers.csv.dialect import Dialect
from testbench.readers.csv.rewritten_columns import TimestampColumn
from testbench.readers.csv.row_parser import RowParser

from .test_time_columns import NOTATIONS

START = datetime(2024, 2, 29, 23, 59, 58, 250000)
PLAIN = {name: notation for name, notation in NOTATIONS.items() if ";" not in notation}
ORDERS = {"day above twelve first": "dmy", "month first": "mdy"}
"""The orders of dates whose notation leaves them open."""


def rows_of(notation, count, step_ms, end="\n", last=False):
    """Rows of a time and two numbers; the time first, or last."""
    times = [START + timedelta(milliseconds=step_ms * i) for i in range(count)]
    texts = [notation.format(t, t.microsecond // 1000, t) for t in times]
    rows = [f"{i};{i / 8};{t}" if last else f"{t};{i};{i / 8}" for i, t in enumerate(texts)]
    return texts[0], "".join(f"{row}{end}" for row in rows)


def column_of(first, field, order):
    """The column whose first time is this text."""
    time = read_timestamp(first)
    begun = TimestampColumn(field, time.notation, 0, first, time.decimals, order=order)
    return replace(begun, zero=begun.nanoseconds({field: first}))


def both(plain, column):
    """The block rewritten at once (None if that is left to the other way) and row by row, as numbers and texts."""
    parser = RowParser(Dialect(";", "."), 3, rewritten=(column,))
    quick = column.block(plain, parser)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TimestampColumn, "block", lambda *_: None)
        slow = parser.plain(plain)
    return None if quick is None else understood(quick), understood(slow)


def understood(plain):
    """Cells as numbers where they are such."""
    return [[number(cell) for cell in line.split(";")] for line in plain.decode("latin-1").split("\n")]


def number(cell):
    """The value and decimals of a number, else the text."""
    try:
        return float(cell), len(cell.strip().partition(".")[2])
    except ValueError:
        return cell


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("name", PLAIN)
def test_blocks_of_all_notations(name, end):
    """Taken at once, through midnight; and equal to the bit and the last decimal."""
    first, text = rows_of(PLAIN[name], 800, 5, end)
    quick, slow = both(text.encode(), column_of(first, 0, ORDERS.get(name, "")))
    assert quick is not None
    assert quick == slow


@settings(max_examples=150, deadline=None)
@given(
    name=st.sampled_from(sorted(PLAIN)), step_ms=st.integers(-40, 400), last=st.booleans(), at=st.integers(0, 3000),
    with_=st.sampled_from([b"", b"x", b";", b"\n", b"9", b"0", b" ", b"\r", b"-", b".", b"\xe9", b"00:00:00.000"]),
    dropped=st.integers(0, 3),
)  # fmt: skip
def test_damaged_blocks(name, step_ms, last, at, with_, dropped):
    """What is not regular is left to the way row by row; what is taken at once is the same."""
    first, text = rows_of(PLAIN[name], 80, step_ms, last=last)
    raw = text.encode()
    raw = raw[: at % len(raw)] + with_ + raw[at % len(raw) + dropped :]
    quick, slow = both(raw, column_of(first, 2 if last else 0, ORDERS.get(name, "")))
    assert quick is None or quick == slow
