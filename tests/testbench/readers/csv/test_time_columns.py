"""Times that are written as text: exact seconds from the first one, or said, and never guessed."""

from datetime import datetime, timedelta
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import io

from testbench.readers import ReadOptions
from testbench.readers.csv.cell_syntax import DAY, SECOND, read_timestamp
from testbench.recording import TimeColumn

from .. import reading

DAY_S = 86_400
START = datetime(2024, 2, 29, 23, 59, 59, 900000)
NOTATIONS = {
    "ISO 8601": "{:%Y-%m-%dT%H:%M:%S}.{:03d}Z",
    "with a blank": "{:%Y-%m-%d %H:%M:%S}.{:03d}",
    "with a zone": "{:%Y-%m-%d %H:%M:%S}.{:03d}+03:00",
    "decimal comma": "{:%Y-%m-%d %H:%M:%S},{:03d}",
    "packed": "{:%Y%m%dT%H%M%S}.{:03d}",
    "points": "{:%d.%m.%Y %H:%M:%S}.{:03d}",
    "day above twelve first": "{:%d/%m/%Y %H:%M:%S}.{:03d}",
    "month first": "{:%m/%d/%Y %I:%M:%S}.{:03d} {:%p}",
    "named month": "{:%d-%b-%Y %H:%M:%S}.{:03d}",
    "slashes, year first": "{:%Y/%m/%d %H:%M:%S}.{:03d}",
    "milliseconds behind a colon": "{:%Y-%m-%d %H:%M:%S}:{:03d}",
    "time of day": "{:%H:%M:%S}.{:03d}",
    "date and time apart": "{:%d.%m.%Y;%H:%M:%S}.{:03d}",
}


def stamps(notation, count=400, step_ms=5):
    """Times through midnight and the end of February, as text."""
    times = [START + timedelta(milliseconds=step_ms * i) for i in range(count)]
    return [notation.format(t, t.microsecond // 1000, t) for t in times]


@pytest.mark.parametrize("name", NOTATIONS)
def test_notations_of_loggers(log, name):
    """Whatever the notation, the clock is that of 200 Hz, each time the nearest float64 to its exact seconds."""
    texts = stamps(NOTATIONS[name])
    header = "Date;Time;F (N)" if ";" in texts[0] else "Time;F (N)"
    found = log(f"{header}\n" + "".join(f"{text};{i},5\n" for i, text in enumerate(texts)))
    assert [(c.name, c.unit) for c in found.group().channels] == [("Time", "s"), ("F (N)", "N")]
    assert found.time().tolist() == [float(Fraction(5 * i, 1000)) for i in range(400)]
    (check,) = found.checks.values()
    assert check.rate_hz == pytest.approx(200.0, rel=1e-12)
    assert found.recording.metadata["zero of Time"] == texts[0].replace(";", " ")
    assert not [f for f in found.findings if f.severity > 0]


@settings(max_examples=60, deadline=None)
@given(
    moment=st.datetimes(min_value=datetime(1971, 1, 1), max_value=datetime(2200, 1, 1)),
    nanoseconds=st.integers(0, 999_999_999),
    zone=st.integers(-14 * 60, 14 * 60),
)
def test_a_moment_is_exact(moment, nanoseconds, zone):
    """Days, nanoseconds and zone of any time are those of the calendar."""
    sign, minutes = "-" if zone < 0 else "+", abs(zone)
    text = f"{moment:%Y-%m-%dT%H:%M:%S}.{nanoseconds:09d}{sign}{minutes // 60:02d}:{minutes % 60:02d}"
    found = read_timestamp(text)
    whole = (moment.replace(microsecond=0) - timedelta(minutes=zone) - datetime(1, 1, 1)) // timedelta(seconds=1)
    assert (found.days() - 1) * DAY + found.nanoseconds == whole * SECOND + nanoseconds


@pytest.mark.parametrize(
    "text",
    ["12:30", "1.5", "24:00", "12:60:00", "1:2:3", "2024-03-01 12:00:00.1234567891", "120000", "2024-03-01T", "noon",
     "13:00:00 PM", "", "2024-03-01 25:00:00", "192.168.1.10"],
)  # fmt: skip
def test_what_is_no_clear_time_is_none(text):
    """Hours or minutes, other numbers, tenths of a nanosecond: nothing is made of them."""
    found = read_timestamp(text)
    assert found is None or not found.notation.clock


def test_numbers_since_1970_keep_their_last_digit(log):
    """Nanoseconds of nineteen digits, which no float64 holds, are counted from the first one."""
    for zero, step in ((1709294400123456789, 500_001), (1709337598000000000, 10_000_000)):
        times = [zero + step * i for i in range(300)]
        found = log("timestamp_ns,F (N)\n" + "".join(f"{t},{i}.5\n" for i, t in enumerate(times)))
        assert found.time().tolist() == [t - zero for t in times]
        assert found.group().clock == TimeColumn(0, 1e-9)
        assert found.recording.metadata["zero of timestamp_ns"] == str(zero)


@pytest.mark.parametrize(
    ("name", "clock"),
    [("unix_ms", TimeColumn(0, 1e-3)), ("epoch", TimeColumn(0, 1e-3)), ("timestamp", TimeColumn(0, None)),
     ("timestamp (ms)", TimeColumn(0, 1e-3))],
)  # fmt: skip
def test_milliseconds_since_1970_are_not_taken_for_seconds(log, name, clock):
    """A name or unit tells what they are; without it there is no rate."""
    found = log(f"{name},F (N)\n" + "".join(f"{1709294400123 + 5 * i},{i}.5\n" for i in range(100)))
    assert found.group().clock == clock
    assert found.time()[:2].tolist() == [1709294400123, 1709294400128]
    (check,) = found.checks.values()
    assert check.rate_hz == (pytest.approx(200.0) if clock.seconds_per_unit else None)


def test_day_and_month_that_cannot_be_told_apart(log):
    """Over several days it matters and is refused; within one day it does not."""
    rows = [f"{3 + i // 40:02d}/04/2024 10:00:{i % 40:02d}.0,{i}.5\n" for i in range(80)]
    found = log("Time,F (N)\n" + "".join(rows))
    assert found.message("ambiguous_date").startswith("3/4/2024 and 4/4/2024: day or month first?")
    assert [c.name for c in found.group().channels] == ["F (N)"]
    found = log("Time,F (N)\n" + "".join(rows[:40]))
    assert found.time().tolist() == list(range(40))
    assert "either number may be the day" in found.message("time_as_text")


@pytest.mark.parametrize(
    ("order", "before", "after", "days"),
    [("dmy", "03/04/2024", "04/04/2024", 1), ("mdy", "03/04/2024", "04/04/2024", 31), ("mdy", "12/31/23", "1/1/24", 1),
     ("dmy", "28/02/24", "01/03/24", 2), ("ymd", "24/02/28", "24/03/01", 2), ("mdy", "03.04.2024", "04.04.2024", 31),
     ("mdy", "2024-04-03", "2024-04-04", 1)],
)  # fmt: skip
def test_a_stated_order_of_dates(log, order, before, after, days):
    """What a person says holds where the notation leaves it open; it stands in the settings, which are stored."""
    rows = [f"{day} 10:00:{i:02d}.0,{i}.5\n" for day in (before, after) for i in range(40)]
    found = log("Time,F (N)\n" + "".join(rows), ReadOptions(date_order=order))
    assert found.time()[40] == days * 86400.0
    assert "ambiguous_date" not in found.codes
    assert found.recording.settings["date_order"] == f"{order}, as stated"
    assert ("as --date-order states" in found.message("time_as_text")) == ("-" not in before)


def test_the_end_of_the_file_has_a_say_in_its_dates(log):
    """A date far below the first lines is seen before any row is read; it may contradict a stated order."""
    seconds = [f"{s // 3600:02d}:{s % 3600 // 60:02d}:{s % 60:02d}" for s in range(4000)]
    rows = "Time,F (N)\n" + "".join(f"{day:02d}/04/2024 {text},1\n" for day in (3, 4) for text in seconds)
    assert "ambiguous_date" in log(rows).codes
    later = rows.replace("04/04/2024", "13/04/2024")
    assert log(later).time()[4000] == 10 * 86400
    found = log(later, ReadOptions(date_order="mdy"))
    assert "13/4/2024 is no date in the order mdy" in found.message("ambiguous_date")
    assert [c.name for c in found.group().channels] == ["F (N)"]


def test_times_too_coarse_for_a_clock(log):
    """Whole seconds over samples of 100 Hz are a channel; a rate in a comment is the clock."""
    rows = "".join(f"2024-03-01 10:00:{i // 100:02d},{i}.5\n" for i in range(500))
    found = log("Time,F (N)\n" + rows)
    assert found.group().clock is None
    assert found.column("Time")[[0, 99, 100, 499]].tolist() == [0, 0, 1, 4]
    assert "written to 1 s" in found.message("time_coarse")
    assert log("# rate: 100 Hz\nTime,F (N)\n" + rows).group().clock.rate_hz == 100.0


def test_a_repeat_is_coarse_only_where_the_last_digit_counts(log):
    """Whole seconds at 1.5 Hz are too coarse; one row twice in times of milliseconds at 100 Hz stands still."""
    found = log("Time,F (N)\n" + "".join(f"10:00:{2 * i // 3:02d},{i}.5\n" for i in range(60)))
    assert "time_coarse" in found.codes
    texts = stamps(NOTATIONS["ISO 8601"], 100, 10)
    texts.insert(50, texts[49])
    found = log("Time,F (N)\n" + "".join(f"{t},{i}.5\n" for i, t in enumerate(texts)))
    assert "time_coarse" not in found.codes
    assert next(f.where for f in found.findings if f.code == "time_not_increasing") == "line 52"


def test_numbers_called_time_go_before_stamps(log):
    """Beside a column of seconds, times of day are one channel more."""
    texts = stamps(NOTATIONS["ISO 8601"])
    found = log("Stamp,Time (s),F (N)\n" + "".join(f"{s},{i / 200},{i}\n" for i, s in enumerate(texts)))
    assert found.group().clock == TimeColumn(1, 1.0)
    assert np.array_equal(found.column("Stamp"), found.column("Time (s)"))


@pytest.mark.parametrize(
    "cell", ["2024-03-01 00:00:0x", "00:00:01.000", "2024-02-30 00:00:00.000", "2024-03-01T00:00:00Z"]
)
def test_a_cell_in_another_notation_is_no_time(log, cell):
    """It is NaN and named with its line, and the others stay as they are."""
    texts = stamps(NOTATIONS["with a blank"])
    found = log("Time,F (N)\n" + "".join(f"{cell if i == 200 else t},{i}.5\n" for i, t in enumerate(texts)))
    assert np.flatnonzero(np.isnan(found.time())).tolist() == [200]
    assert next(f.where for f in found.findings if f.code == "not_a_number") == "line 202"
    assert found.column("F (N)")[200] == 200.5


def test_every_cut_gives_a_prefix_of_the_times(log):
    """A time that may be cut is never used, also where it stands last in its row."""
    text = "F (N);Time\n" + "".join(f"{i},5;{t}\n" for i, t in enumerate(stamps(NOTATIONS["time of day"], 8)))
    whole = log(text).time().tolist()
    for cut in range(60, len(text), 3):
        found = log(text[:cut]).time().tolist()
        assert found == whole[: len(found)]
        assert len(found) in (text[:cut].count("\n") - 1, text[:cut].count("\n"))


def test_the_same_times_however_they_are_written(log):
    """Without fractions at full seconds, as Python writes; in quotes and UTF-16; behind a header that comes again."""
    times = [START + timedelta(microseconds=100_000 * i) for i in range(50)]
    found = log("time,F (N)\n" + "".join(f"{t.isoformat()},{i}\n" for i, t in enumerate(times)))
    assert found.time().tolist() == [float(Fraction(i, 10)) for i in range(50)]
    rows = "".join(f'"{t}","{i},5"\n' for i, t in enumerate(stamps(NOTATIONS["points"])))
    found = log(('"Zaman","Kuvvet (N)"\n' + rows).encode("utf-16"))
    assert found.time().tolist() == [float(Fraction(5 * i, 1000)) for i in range(400)]
    assert found.column("Kuvvet (N)")[-1] == 399.5
    texts = stamps(NOTATIONS["ISO 8601"])
    parts = ["".join(f"{t},{i}.5\n" for i, t in enumerate(texts[a:b])) for a, b in ((0, 200), (300, 400))]
    assert log("Time,F (N)\n" + "Time,F (N)\n".join(parts)).time("log part 2")[0] == 1.5
    for mark in ".,":  # times alone are events
        found = log("Time\n" + "".join(f"12:00:{i:02d}{mark}25\n" for i in range(40)))
        assert found.time().tolist() == list(range(40))
        assert "event_times" in found.codes


def test_a_notation_in_the_header_is_no_odd_unit(log):
    """What stands in brackets, or in a second row, behind the name of a time is how it is written."""
    rows = "".join(f"{t};{i}\n" for i, t in enumerate(stamps(NOTATIONS["time of day"])))
    for header in ("Time (hh:mm:ss);F (N)\n", "Time;F\nhh:mm:ss.fff;N\n"):
        found = log(header + rows)
        assert [c.unit for c in found.group().channels] == ["s", "N"]
        assert not [f for f in found.findings if f.severity > 0]


def test_whole_numbers_that_float64_rounds_are_said(log):
    """A counter beyond 2**53 is kept as float64 holds it, and this is said, also where it grows so late."""
    for first, said in ((2**53 + 1, True), (2**53, False), (2**53 - 999, True)):
        found = log("Time (s),count,F (N)\n" + "".join(f"{i},{first + 2 * i},{i}.5\n" for i in range(600)))
        assert [f.channel for f in found.findings if f.code == "not_exact"] == ["count"] * said, first


@pytest.mark.parametrize(
    ("first", "step", "name", "rate_hz", "code"),
    [
        *((day, 1 / rate / DAY_S, "Time", None, "time_unit_unknown")
          for day in (45352.4166, 739312.4166) for rate in (1000, 100, 1)),
        (45352.4166, 0.001, "Time", 1e3, "time_unit_assumed"), (0.0, 1e-5, "Time", 1e5, "time_unit_assumed"),
        (45352.0, 1.0, "Time", 1.0, "time_unit_assumed"), (1.0e5, 1e-5, "Time", 1e5, "time_unit_assumed"),
        (45352.4166, 1e-5, "Time (s)", 1e5, ""),
    ],
)  # fmt: skip
def test_days_are_not_taken_for_seconds(log, first, step, name, rate_hz, code):
    """Days, as spreadsheets and MATLAB count them, at 1 kHz would be seconds at 86 MHz: no rate, and why is said.

    Seconds of the day at 1 kHz, a log of 100 kHz from zero and one of 1 Hz are seconds; so is whatever has that unit.
    """
    found = log(f"{name},F (N)\n" + "".join(f"{first + i * step:.12f},{i % 7}.5\n" for i in range(300)))
    assert found.checks["log"].rate_hz == (None if rate_hz is None else pytest.approx(rate_hz, rel=1e-3))
    assert found.codes & {"time_unit_unknown", "time_unit_assumed"} == ({code} if code else set())


def test_days_of_matlab(tmp_path):
    """``datenum`` counts days from the year 0."""
    times = [739312.4 + i / 100 / DAY_S for i in range(100)]
    io.savemat(tmp_path / "run.mat", {"t": times, "F": range(100)})
    found = reading.read(tmp_path / "run.mat")
    assert found.checks["run"].rate_hz is None
    assert "time_unit_unknown" in found.codes
