"""Several clocks in one text stay apart, each with the columns behind it and up to its own end."""

import numpy as np
import pytest

from testbench.readers.csv.header import time_name_base
from testbench.readers.csv.table import MultipleTimeColumns
from testbench.recording import Block, Channel, Group

HEADERS = [
    ("Time (s)", "Time (s)"), ("Time A (s)", "Time B (s)"), ("Time_1 (s)", "Time_2 (s)"), ("Time (s)", "Time (s).1"),
    ("time [s]", "Time [s]"), ("Zeit 1 (s)", "Zeit 2 (s)"),
]  # fmt: skip


def two_loggers(header, short=300, hole=()):
    """300 rows of two loggers in one table, the second with ``short`` rows."""
    seconds = [f"{i / 40:.3f},{i}.25" if i < short and i not in hole else "," for i in range(300)]
    return header + "\n" + "".join(f"{i / 100:.2f},{i}.5,{second}\n" for i, second in enumerate(seconds))


@pytest.mark.parametrize(("first", "second"), HEADERS)
@pytest.mark.parametrize("short", [300, 120])
def test_two_clocks(log, first, second, short):
    """Each force has its own time, rate and length; where the shorter one has ended nothing is missing."""
    found = log(two_loggers(f"{first},F (N),{second},G (N)", short))
    assert [(g.name, [c.name for c in g.channels]) for g in found.recording.groups] == [
        ("log 1", [first, "F (N)"]),
        ("log 2", [second, "G (N)"]),
    ]
    assert [round(found.checks[name].rate_hz, 6) for name in ("log 1", "log 2")] == [100.0, 40.0]
    assert found.column("G (N)", "log 2").tolist() == [i + 0.25 for i in range(short)]
    assert found.time("log 1").tolist() == [float(f"{i / 100:.2f}") for i in range(300)]
    assert [f.code for f in found.findings if f.severity > 0] == ["several_clocks"]


def test_cells_that_are_missing_within_are_said(log):
    """Empty cells before the end are values that are missing."""
    found = log(two_loggers("Time (s),F (N),Time (s),G (N)", 250, range(100, 160)))
    values = found.column("G (N)", "log 2")
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(100, 160))
    assert len(values) == 250
    assert {"not_a_number", "time_unreadable"} <= found.codes


@pytest.mark.parametrize("size", [1, 7, 60, 1000])
def test_blocks_change_nothing(size):
    """Rows that wait for a value behind them keep their places, in whatever blocks the table comes."""
    table = np.arange(1200.0).reshape(4, 300)
    table[2:, [*range(100, 160), *range(250, 300)]] = np.nan
    whole = Group("log", tuple(Channel(name) for name in "abcd"))
    groups = (Group("log 1", whole.channels[:2]), Group("log 2", whole.channels[2:]))

    def read(report):
        for i in range(0, 300, size):
            yield Block(whole, tuple(table[:, i : i + size]), i, range(i, min(i + size, 300)))

    found = {name: [] for name in ("log 1", "log 2")}
    for block in MultipleTimeColumns(groups, ((0, 1), (2, 3))).split(read)(print):
        assert block.start == sum(part.shape[1] for part in found[block.group.name])
        found[block.group.name].append(np.array(block.columns))
    np.testing.assert_array_equal(np.hstack(found["log 1"]), table[:2])
    np.testing.assert_array_equal(np.hstack(found["log 2"]), table[2:, :250])


def test_dates_and_times(log):
    """Two columns of dates and times of day, each counted from its own first one."""
    rows = "".join(
        f"2024-03-01T12:00:00.{i:03d},{i}.5,2024-03-01T13:00:{i // 10:02d}.{i % 10},{i}\n" for i in range(100)
    )
    found = log(f"Time 1,F (N),Time 2,G (N)\n{rows}")
    assert found.time("log 1").tolist() == [i / 1000 for i in range(100)]
    assert found.time("log 2").tolist() == [i / 10 for i in range(100)]


@pytest.mark.parametrize(
    "header", ["Time (s),F (N),G (N),Time (s)", "F (N),Time (s),G (N),H (N)", "Time (s),Elapsed (s),F (N),G (N)",
               "Time (s),F (N),Elapsed (s),G (N)", "t1,F (N),t2,G (N)"],
)  # fmt: skip
def test_other_tables_stay_whole(log, header):
    """A second time at the end, other names of time, temperatures called t1 and t2: one table, as before."""
    assert len(log(two_loggers(header)).recording.groups) == 1


def test_a_header_that_comes_again(log):
    """Two loggers, recorded twice: four groups."""
    rows = "".join(f"{i / 100:.2f},{i}.5,{i / 40:.3f},{i}.25\n" for i in range(100))
    found = log(f"Time A (s),F (N),Time B (s),G (N)\n{rows}" * 2)
    assert {name: check.samples for name, check in found.checks.items()} == dict.fromkeys(
        ["log 1", "log 2", "log part 2 1", "log part 2 2"], 100
    )


def test_names_of_time():
    """A number or letter behind a name of time, and none behind a single letter."""
    assert time_name_base("Time_2") == time_name_base("Time B") == "time"
    assert time_name_base("t") == "t"
    assert time_name_base("t2") is None
    assert time_name_base("timex") is None
