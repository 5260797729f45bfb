"""Records beside runs: added, never changed, about the bytes that they name."""

import json
import os
from datetime import UTC, datetime

import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.store import append_only_records, atomic_files, open_campaign

from .stored import ACC, store


def test_records_are_added_and_read_back(two_runs):
    """Two records of one kind stand beside each other, in the order in which they were written."""
    first = append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": 0.5})
    before = first.read_bytes()
    append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5", two_runs / "b.h5"], {"offset_s": 0.6})
    append_only_records.append_record(two_runs, "calibration", [two_runs / "b.h5"], {"factor": 2.0})
    assert [r.content["offset_s"] for r in append_only_records.read_records(two_runs, "alignment")] == [0.5, 0.6]
    assert len(append_only_records.read_records(two_runs)) == 3
    assert first.read_bytes() == before
    assert [p.suffix for p in (two_runs / "records").iterdir()] == [".json"] * 3
    assert {state.status for state in open_campaign(two_runs).verify()} == {"intact"}  # records are no extra files


def test_a_record_is_about_the_bytes_that_it_names(two_runs):
    """A run that was replaced has no record any more."""
    run = two_runs / "a.h5"
    append_only_records.append_record(two_runs, "alignment", [run], {})
    assert len(append_only_records.about(two_runs, "alignment", run)) == 1
    assert not append_only_records.about(two_runs, "alignment", two_runs / "b.h5")
    run.unlink()
    atomic_files.digest_file(run).unlink()
    store(two_runs, ACC, [np.full(3, 7.0)], name="a")
    assert not append_only_records.about(two_runs, "alignment", run)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"layout": 2}', "[" * 100_000])
def test_damaged_records_are_refused(two_runs, text):
    """What is no record is named, not passed over."""
    append_only_records.append_record(two_runs, "alignment", [], {})
    (two_runs / "records" / "broken.json").write_text(text, encoding="utf-8")
    with pytest.raises(StoreError, match=r"broken\.json"):
        append_only_records.read_records(two_runs)


@pytest.mark.parametrize("at", range(0, 8, 3))
def test_every_bit_of_a_record_counts(two_runs, at):
    """One that flips is noticed, wherever it is, unless only white space changes."""
    path = append_only_records.append_record(
        two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": 0.512345, "by": "Küppers"}
    )
    whole = path.read_bytes()
    said = json.loads(whole)
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << at
        path.write_bytes(flipped)
        if path.name not in append_only_records.damaged(two_runs):
            assert json.loads(flipped) == said


def test_records_of_before_there_were_digests(two_runs):
    """They are read as ever."""
    path = append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"x": 1})
    document = json.loads(path.read_text("utf-8"))
    del document["sha256"], document["number"]
    path.write_text(json.dumps(document | {"layout": 1}), encoding="utf-8")
    assert [record.content for record in append_only_records.read_records(two_runs, "alignment")] == [{"x": 1}]
    path.write_text(json.dumps(document | {"layout": 2}), encoding="utf-8")
    with pytest.raises(StoreError, match="not what was written"):
        append_only_records.read_records(two_runs)


def test_numbers_that_are_none_are_not_written(two_runs):
    """NaN has no JSON form: nothing is written."""
    with pytest.raises(ValueError, match="JSON"):
        append_only_records.append_record(two_runs, "alignment", [], {"offset_s": float("nan")})
    assert not append_only_records.read_records(two_runs)


def test_a_record_states_who_wrote_it(two_runs):
    """Kind, date, version and digests are in the file."""
    path = append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"x": 1})
    document = json.loads(path.read_text("utf-8"))
    assert document["kind"] == "alignment"
    assert document["runs"] == {"a.h5": atomic_files.recorded_digest(two_runs / "a.h5")}
    assert document["written"].endswith("+00:00")
    assert "counterpoise" in document["software"]


class SetBack(datetime):
    """A clock that was set back by years."""

    @classmethod
    def now(cls, tz=None):
        """The first day of 2020."""
        return datetime(2020, 1, 1, tzinfo=UTC)


def test_a_clock_that_was_set_back(two_runs, monkeypatch):
    """What was recorded last is current, and says truly what the clock showed; records without a number come first."""
    for offset in (0.5, 0.6):
        path = append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": offset})
        with monkeypatch.context() as patch:
            patch.setattr(append_only_records, "datetime", SetBack)
            append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": offset + 1.0})
    found = append_only_records.about(two_runs, "alignment", two_runs / "a.h5")
    assert [record.content["offset_s"] for record in found] == [0.5, 1.5, 0.6, 1.6]
    assert [record.number for record in found] == [1, 2, 3, 4]
    assert found[-1].written == "2020-01-01T00:00:00.000000+00:00"
    document = json.loads(path.read_text("utf-8"))
    del document["number"], document["sha256"]
    path.write_text(json.dumps(document | {"layout": 1}), encoding="utf-8")
    assert append_only_records.read_records(two_runs)[0].name == path.name


def test_records_that_nobody_reads_are_named(two_runs, verified):
    """One that was renamed no longer holds: verify says so; a folder that is a file is damage."""
    path = append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": 0.5})
    assert verified(two_runs)[1] == 0
    path.rename(path.with_name("mine.json.txt"))
    found, code = verified(two_runs)
    assert (found["records/mine.json.txt"], found[f"records/{path.name}"], code) == ("extra", "missing", 1)
    path.with_name("mine.json.txt").unlink()
    path.parent.rmdir()
    path.parent.write_text("")
    found, code = verified(two_runs)
    assert (found["records"], code) == ("damaged", 1)
    with pytest.raises(StoreError, match="is a file"):
        append_only_records.read_records(two_runs)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_is_no_record(two_runs, verified):
    """It is not waited for."""
    append_only_records.append_record(two_runs, "alignment", [two_runs / "a.h5"], {"offset_s": 0.5})
    os.mkfifo(two_runs / "records" / "pipe.json")
    found, code = verified(two_runs)
    assert (found["records/pipe.json"], code) == ("damaged", 1)
