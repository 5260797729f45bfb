"""Records beside runs: added, never changed, about the bytes that they name."""

import json

import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.recording import Channel, Group
from testbench.store import digest, open_campaign, records

from .test_writer import store

GROUP = Group("log", (Channel("AccX (g)", "g", "AccX"),))


@pytest.fixture
def campaign(tmp_path):
    """A folder with two runs and their digests."""
    for number, name in enumerate(("a", "b")):
        store(tmp_path, GROUP, [np.full(3, float(number))], name=name)
    return tmp_path


def test_records_are_added_and_read_back(campaign):
    """Two records of one kind stand beside each other, in the order in which they were written."""
    first = records.append(campaign, "alignment", [campaign / "a.h5"], {"offset_s": 0.5})
    before = first.read_bytes()
    records.append(campaign, "alignment", [campaign / "a.h5", campaign / "b.h5"], {"offset_s": 0.6})
    records.append(campaign, "calibration", [campaign / "b.h5"], {"factor": 2.0})
    assert [r.content["offset_s"] for r in records.read(campaign, "alignment")] == [0.5, 0.6]
    assert len(records.read(campaign)) == 3
    assert first.read_bytes() == before
    assert [p.suffix for p in (campaign / "records").iterdir()] == [".json"] * 3


def test_a_record_is_about_the_bytes_that_it_names(campaign):
    """A run that was replaced has no record any more."""
    run = campaign / "a.h5"
    records.append(campaign, "alignment", [run], {})
    assert len(records.about(campaign, "alignment", run)) == 1
    assert not records.about(campaign, "alignment", campaign / "b.h5")
    run.unlink()
    digest.beside(run).unlink()
    store(campaign, GROUP, [np.full(3, 7.0)], name="a")
    assert not records.about(campaign, "alignment", run)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"layout": 2}', "[" * 100_000])
def test_damaged_records_are_refused(campaign, text):
    """What is no record is named, not passed over."""
    records.append(campaign, "alignment", [], {})
    (campaign / "records" / "broken.json").write_text(text, encoding="utf-8")
    with pytest.raises(StoreError, match=r"broken\.json"):
        records.read(campaign)


@pytest.mark.parametrize("at", range(0, 8, 3))
def test_every_bit_of_a_record_counts(campaign, at):
    """One that flips is noticed, wherever it is, unless only white space changes."""
    path = records.append(campaign, "alignment", [campaign / "a.h5"], {"offset_s": 0.512345, "by": "Küppers"})
    whole = path.read_bytes()
    said = json.loads(whole)
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << at
        path.write_bytes(flipped)
        if path.name not in records.damaged(campaign):
            assert json.loads(flipped) == said


def test_records_of_before_there_were_digests(campaign):
    """They are read as ever."""
    path = records.append(campaign, "alignment", [campaign / "a.h5"], {"x": 1})
    document = json.loads(path.read_text("utf-8"))
    del document["sha256"]
    path.write_text(json.dumps(document | {"layout": 1}), encoding="utf-8")
    assert [record.content for record in records.read(campaign, "alignment")] == [{"x": 1}]
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(StoreError, match="not what was written"):
        records.read(campaign)


def test_numbers_that_are_none_are_not_written(campaign):
    """NaN has no JSON form: nothing is written."""
    with pytest.raises(ValueError, match="JSON"):
        records.append(campaign, "alignment", [], {"offset_s": float("nan")})
    assert not records.read(campaign)


def test_a_record_states_who_wrote_it(campaign):
    """Kind, date, version and digests are in the file."""
    path = records.append(campaign, "alignment", [campaign / "a.h5"], {"x": 1})
    document = json.loads(path.read_text("utf-8"))
    assert document["kind"] == "alignment"
    assert document["runs"] == {"a.h5": digest.recorded(campaign / "a.h5")}
    assert document["written"].endswith("+00:00")
    assert "counterpoise" in document["software"]


def test_records_are_no_extra_files(brief, tmp_path):
    """Verifying a campaign with records finds nothing wrong."""
    import shutil

    folder = shutil.copytree(brief.campaign, tmp_path / "campaign")
    records.append(folder, "alignment", [], {})
    assert {state.status for state in open_campaign(folder).verify()} == {"intact"}
