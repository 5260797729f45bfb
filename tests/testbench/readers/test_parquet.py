"""Parquet, written by polars and pyarrow."""

from datetime import date, datetime, time, timedelta
from decimal import Decimal

import numpy as np
import polars
import pyarrow
import pytest
from pyarrow import parquet

from testbench.errors import RecordingError
from testbench.recording import TextLog

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

TIME = np.arange(500) / 64


def _write(tmp_path, frame, name="run.parquet", **options):
    path = tmp_path / name
    polars.DataFrame(frame).write_parquet(path, **options)
    return path


def test_missing_values_are_nan_and_counted(tmp_path):
    """Null and NaN are both no number."""
    found = reading.read(_write(tmp_path, {"a": [1.0, None, float("nan"), 4.0], "b": [1, None, 3, 4]}))
    assert np.isnan(found.column("a")).tolist() == [False, True, True, False]
    assert {f.channel: f.message[:2] for f in found.findings if f.code == "not_a_number"} == {"a": "2 ", "b": "1 "}


@pytest.mark.parametrize(("unit", "written"), [("ms", "ms"), ("us", "µs"), ("ns", "ns")])
def test_points_in_time_are_counted_exactly(tmp_path, unit, written):
    """Milli- and microseconds since 1970; nanoseconds from the first one, which is said, since 1970 would not fit."""
    stamps = polars.Series([1795248000_123456789 + 1_000_001 * i for i in range(5)])
    stamps = (stamps // {"ms": 10**6, "us": 10**3, "ns": 1}[unit]).cast(polars.Datetime(unit))
    found = reading.read(_write(tmp_path, {"when": stamps, "a": range(5)}))
    zero = int(found.recording.metadata.get("when: zero", "0").split()[0])
    assert [int(t) + zero for t in found.time()] == stamps.to_physical().to_list()
    assert found.unit("when") == written
    assert (unit == "ns") == (zero > 0)


def test_other_types_are_kept_or_said(tmp_path):
    """Switches and durations are numbers, texts are kept beside them; lists are named."""
    found = reading.read(_write(tmp_path, {
        "on": [True, False], "for": [timedelta(seconds=1), timedelta(seconds=2)], "day": [date(1970, 1, 2)] * 2,
        "at": [time(0, 0, 1)] * 2, "when": [datetime(1970, 1, 1)] * 2, "text": ["a", None], "list": [[1], [2]],
    }))  # fmt: skip
    assert found.column("on").tolist() == [1, 0]
    assert found.column("for").tolist() == [1e6, 2e6]
    assert (found.column("day")[0], found.unit("day")) == (1, "day")
    assert found.column("at")[0] == 1e9
    assert {f.channel: f.code for f in found.findings if f.code in ("text_kept", "left_out")} == {
        "text": "text_kept",
        "list": "left_out",
    }
    (series,) = found.recording.texts.kept
    assert (series.channel, series.samples, series.texts) == ("text", [0, 1], ["a", ""])


def test_a_text_ends_where_none_follows():
    """Also where the next block begins with none: a text is not in force where the file has no value."""
    log = TextLog()
    for start, texts in enumerate([[None], ["a"], [None], [None], ["a"], ["a"]]):
        log.take_all("g", "state", start, texts)
    assert (log.kept[0].samples, log.kept[0].texts) == ([1, 2, 4], ["a", "", "a"])


def test_what_only_the_reference_reads(tmp_path):
    """Zones that are mere offsets, half floats, decimals, dictionaries, and points in time that are no clock."""
    path, when = tmp_path / "run.parquet", pyarrow.array([3, 1, 2], pyarrow.timestamp("s", tz="-02:15"))
    table = {
        "when": when,
        "half": np.array([0.5, 1, 2], np.float16),
        "state": pyarrow.array([*"aab"]).dictionary_encode(),
    }
    parquet.write_table(
        pyarrow.table(table | {"price": pyarrow.array([Decimal("1.25"), 2**53 + 1, 1], pyarrow.decimal128(20, 2))}),
        path,
    )
    found = reading.read(path)
    assert found.column("half").tolist() == [0.5, 1, 2]
    assert found.column("price")[0] == 1.25
    assert "not_exact" in {finding.code for finding in found.findings if finding.channel == "price"}
    assert found.group().clock is None
    assert found.recording.texts.kept[0].texts == ["a", "b"]


def test_stars_in_a_name_open_one_file_only(tmp_path):
    """A file called *.parquet is that file, and not all of the folder."""
    _write(tmp_path, {"a": [1.0, 2.0]}, "other.parquet")
    found = reading.read(_write(tmp_path, {"b": [3.0]}, "*.parquet"))
    assert found.column("b").tolist() == [3.0]


def test_names_with_points_are_names(tmp_path):
    """A column a.b beside a clock a is no part of it."""
    rows = {"a": [datetime(2026, 1, 1, 0, 0, s) for s in range(3)], "a.b": [1.0, 2.0, 4.0]}
    found = reading.read(_write(tmp_path, rows))
    assert found.column("a.b").tolist() == [1.0, 2.0, 4.0]
    assert found.group().clock.index == 0


def test_cut_and_empty_files_are_refused(tmp_path):
    """The index lies at the end, so that nothing of a cut file can be read."""
    path = _write(tmp_path, {"a": TIME})
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RecordingError, match="cannot read"):
        reading.read(path)
    with pytest.raises(RecordingError, match="with 0 rows"):
        reading.read(_write(tmp_path, {"a": polars.Series([], dtype=polars.Float64)}))


def test_nested_columns_alone_are_refused_by_name(tmp_path):
    """Lists and structures are no single number a row; what they are is said."""
    with pytest.raises(RecordingError, match=r"acc holds .*list<.*double>, not one number a row"):
        reading.read(_write(tmp_path, {"acc": [[1.0, 2.0], [3.0]]}))
