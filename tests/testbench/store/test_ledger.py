"""The ledger: what should be in a campaign, in order, by digests that follow from each other."""

import json
import multiprocessing
import os
import sys

import numpy as np
import pytest

from testbench.cli.campaign import ledger as command
from testbench.cli.campaign import remove
from testbench.errors import NotConfirmedError, StoreError
from testbench.ingestion.recovered_runs import recover
from testbench.store import append_only_records, atomic_files, open_campaign
from testbench.store.ledger import FILE, enter_not_stored, read_ledger
from testbench.store.writer import RunWriter

from .stored import ACC, fill, names_in, store


@pytest.fixture
def campaign(two_runs):
    """A folder with two runs and a record."""
    append_only_records.append_record(two_runs, "decision", [two_runs / "a.h5"], {"x": 1})
    return two_runs


def record_of(campaign):
    """The name of the only record."""
    (path,) = (campaign / "records").iterdir()
    return f"records/{path.name}"


def test_everything_is_an_entry(campaign, verified, capsys):
    """Runs and records with their SHA-256, each chained to the one before; the command prints them."""
    found = read_ledger(campaign)
    assert [(entry.number, entry.kind) for entry in found.entries] == [(1, "run"), (2, "run"), (3, "record")]
    assert [entry.previous for entry in found.entries] == ["", *(entry.digest for entry in found.entries[:-1])]
    assert found.newest["a.h5"].sha256 == atomic_files.sha256_of(campaign / "a.h5")
    assert found.newest[record_of(campaign)].details == {"kind": "decision", "number": 1}
    assert verified(campaign) == ({}, 0)
    assert command.main([str(campaign), "--json"], standalone_mode=False) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["head"], len(document["entries"])) == (found.head, 3)


def test_what_was_not_stored_stays_open_until_it_is_stored_or_given_up(campaign, capsys):
    """Said once for a reason; no damage to verify; a removed run of that name may lack anew."""
    for reason in ("torn", "torn", "its log was not given"):
        enter_not_stored(campaign, "c.h5", reason)
    enter_not_stored(campaign, "a.h5", "is stored")
    enter_not_stored(campaign, "d.h5", "torn")
    assert read_ledger(campaign).not_stored == {"c.h5": "its log was not given", "d.h5": "torn"}
    assert [entry.kind for entry in read_ledger(campaign).entries].count("not_stored") == 3
    store(campaign, ACC, [np.full(3, 9.0)], name="c")
    why = ["--by", "A. Kaya", "--reason", "the log is lost"]
    assert remove.main([str(campaign / "d.h5"), *why], standalone_mode=False) == 0
    assert read_ledger(campaign).not_stored == {}
    assert remove.main([str(campaign / "c.h5"), *why], standalone_mode=False) == 0
    enter_not_stored(campaign, "c.h5", "torn")
    assert read_ledger(campaign).not_stored == {"c.h5": "torn"}


def test_of_a_campaign_whose_ledger_begins_what_is_there_is_stored(campaign):
    """Not so because a run table's log is refused: the run of that name was stored before there was a ledger."""
    (campaign / FILE).unlink()
    enter_not_stored(campaign, "a.h5", "its log was not given")
    enter_not_stored(campaign, "c.h5", "its log was not given")
    found = read_ledger(campaign)
    assert list(found.not_stored) == ["c.h5"]
    assert found.holds("a.h5")


def gone(*names):
    """Remove files by hand."""

    def act(campaign):
        for name in names:
            (campaign / name).unlink()

    return act


def run_exchanged(campaign):
    """Another run with its own digest in the place of one."""
    gone("a.h5", "a.h5.sha256")(campaign)
    before = (campaign / FILE).read_bytes()
    store(campaign, ACC, [np.full(3, 9.0)], name="a")
    (campaign / FILE).write_bytes(before)


def run_added(campaign):
    """A run from elsewhere, with its digest."""
    other = store(campaign.parent / f"{campaign.name}_other", ACC, [np.full(3, 9.0)], name="c").path
    for path in (other, atomic_files.digest_file(other)):
        (campaign / path.name).write_bytes(path.read_bytes())


def records_gone(campaign):
    """The folder of records is removed."""
    (campaign / record_of(campaign)).unlink()
    (campaign / "records").rmdir()


@pytest.mark.parametrize(
    ("act", "expected", "code"),
    [
        (gone("a.h5", "a.h5.sha256"), {"a.h5": "missing"}, 1),
        (gone("a.h5.sha256"), {"a.h5": "damaged"}, 1),
        (records_gone, {"record": "missing"}, 1),
        (run_exchanged, {"a.h5": "damaged"}, 1),
        (run_added, {"c.h5": "added"}, 3),
        (gone(FILE), {FILE: "missing"}, 1),
    ],
)
def test_what_is_missing_exchanged_or_added_is_named(campaign, verified, act, expected, code):
    """Every file for itself is intact; what should be there is known all the same."""
    record = record_of(campaign)
    act(campaign)
    assert verified(campaign) == ({record if name == "record" else name: s for name, s in expected.items()}, code)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda lines: [lines[0], lines[2]], "line 2: is entry 3: entries 2 to 2 are missing"),
        (lambda lines: [lines[1], lines[0], lines[2]], "line 1: is entry 2: entries 1 to 1 are missing"),
        (lambda lines: [*lines, lines[1]], "line 4: is entry 2: out of order"),
        (lambda lines: [lines[0].replace(b"a.h5", b"b.h5"), *lines[1:]], "line 1: not what was written"),
        (lambda lines: [b"{}\n", *lines[1:]], "line 1: no entry"),
        (lambda lines: [bytes(len(lines[0]) - 1) + b"\n", *lines[1:]], "line 1: no entry"),
    ],
)
def test_a_ledger_that_was_changed_is_named(campaign, verified, change, named):
    """Removed, exchanged, repeated and edited lines; nothing is appended to it until a person has seen to it."""
    path = campaign / FILE
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))
    with pytest.raises(StoreError, match=named):
        read_ledger(campaign)
    assert verified(campaign) == ({FILE: "damaged"}, 1)
    with pytest.raises(StoreError, match="ledger"):
        append_only_records.append_record(campaign, "decision", [], {})
    with pytest.raises(StoreError, match="take it out of the campaign"):
        store(campaign, ACC, [np.ones(3)], name="c")
    assert names_in(campaign) == ["a.h5", "a.h5.sha256", "b.h5", "b.h5.sha256", "records"]


def test_an_entry_of_another_ledger_does_not_follow(campaign, tmp_path_factory):
    """Whole by itself, of the right number: the digest of the entry before tells."""
    other = tmp_path_factory.mktemp("other")
    store(other, ACC, [np.full(3, 5.0)], name="a")
    store(other, ACC, [np.full(3, 6.0)], name="b")
    lines = (campaign / FILE).read_bytes().splitlines(keepends=True)
    lines[1] = (other / FILE).read_bytes().splitlines(keepends=True)[1]
    (campaign / FILE).write_bytes(b"".join(lines))
    with pytest.raises(StoreError, match="line 2: does not follow from the entry before it"):
        read_ledger(campaign)


def test_a_torn_append_is_dropped(campaign, verified):
    """What was not written whole was never acknowledged: named, and the next entry takes its place."""
    with (campaign / FILE).open("ab") as stream:
        stream.write(b'{"number": 4, "prev' + bytes(7))
    assert verified(campaign) == ({FILE: "unfinished"}, 3)
    append_only_records.append_record(campaign, "decision", [], {})
    assert len(read_ledger(campaign).entries) == 4
    assert verified(campaign) == ({}, 0)


def test_an_older_campaign_gets_one_at_the_next_append(campaign, verified):
    """What is there then is entered as found; before, recover begins one too."""
    (campaign / FILE).unlink()
    append_only_records.append_record(campaign, "decision", [], {})
    found = read_ledger(campaign)
    assert [entry.details.get("found", False) for entry in found.entries] == [True, True, True, False]
    assert verified(campaign) == ({}, 0)
    (campaign / FILE).unlink()
    assert [one.status for one in recover(campaign)] == ["entered"] * 4
    assert verified(campaign) == ({}, 0)


def test_what_a_stopped_append_left_is_entered_by_recover(campaign, verified):
    """A record that has its name, and whose entry was not written."""
    lines = (campaign / FILE).read_bytes().splitlines(keepends=True)
    (campaign / FILE).write_bytes(b"".join(lines[:-1]))
    assert verified(campaign) == ({record_of(campaign): "added"}, 3)
    assert [(one.run, one.status) for one in recover(campaign)] == [(record_of(campaign), "entered")]
    assert verified(campaign) == ({}, 0)


def test_a_digest_of_a_run_that_never_was_goes(campaign, verified):
    """A loss of power kept the name of a digest and not that of its run; one of a run that was entered stays."""
    gone("a.h5")(campaign)
    (campaign / "c.h5.sha256").write_text(atomic_files.line_for("c.h5", "0" * 64))
    recover(campaign)
    assert names_in(campaign) == ["a.h5.sha256", "b.h5", "b.h5.sha256", "records"]
    assert verified(campaign) == ({"a.h5": "missing"}, 1)


def test_a_person_removes(campaign, verified):
    """Run, damaged run and record, by whom and why; the number of a removed record is not given again."""
    names = ["a.h5", record_of(campaign)]
    (campaign / "a.h5").write_bytes(b"damaged")
    words = ["--by", "A. Kaya", "--reason", "the wrong rig"]
    assert remove.main([*(str(campaign / name) for name in names), *words], standalone_mode=False) == 0
    assert names_in(campaign) == ["b.h5", "b.h5.sha256", "records"]
    assert verified(campaign) == ({}, 0)
    newest = read_ledger(campaign).newest
    assert {newest[name].kind for name in names} == {"removed"}
    assert newest["a.h5"].details == {"by": "A. Kaya", "reason": "the wrong rig"}
    append_only_records.append_record(campaign, "decision", [campaign / "b.h5"], {"x": 2})
    assert [record.number for record in append_only_records.read_records(campaign)] == [2]
    gone("b.h5", "b.h5.sha256")(campaign)
    assert verified(campaign) == ({"b.h5": "missing"}, 1)
    assert remove.main([str(campaign / "b.h5"), *words], standalone_mode=False) == 0
    assert verified(campaign)[0] == {}
    for wrong in ("b.h5.sha256", "none.h5", FILE):
        assert remove.main([str(campaign / wrong), *words], standalone_mode=False) == 1


def _appending(campaign, count):
    for _ in range(count):
        append_only_records.append_record(campaign, "decision", [campaign / "a.h5"], {"x": 1})


@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
def test_numbers_of_appends_at_once(campaign):
    """Four processes: numbers without gaps or repeats, and a ledger that holds all of them."""
    fork = multiprocessing.get_context("fork")
    children = [fork.Process(target=_appending, args=(campaign, 5)) for _ in range(4)]
    for child in children:
        child.start()
    for child in children:
        child.join()
    numbers = [record.number for record in append_only_records.read_records(campaign)]
    assert numbers == list(range(1, 22))
    assert [entry.number for entry in read_ledger(campaign).entries] == list(range(1, 24))


@pytest.mark.parametrize("failing", ["folder", "ledger"])
def test_a_run_that_the_disk_does_not_confirm(campaign, monkeypatch, verified, failing):
    """It has its name; that it may be lost is said, and recover enters it once the disk is well."""
    real = os.fsync

    def fsync(handle):
        path = os.readlink(f"/proc/self/fd/{handle}")
        if (campaign / "c.h5").exists() and path == str(campaign if failing == "folder" else campaign / FILE):
            raise OSError(5, "Input/output error")
        real(handle)

    if not os.path.exists("/proc/self/fd"):
        pytest.skip("the system does not say which file a handle is of")
    with RunWriter(campaign, "c") as run:
        fill(run, {ACC: [np.ones(3)]})
        run.seal()
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", fsync)
            with pytest.raises(
                NotConfirmedError, match=r"c\.h5: was written and has its name, but .*Input/output error"
            ):
                run.commit()
    found, code = verified(campaign)
    assert (found["c.h5"], code) == ("added", 3)
    assert [one.status for one in recover(campaign)] == ["completed"]
    assert verified(campaign) == ({}, 0)
    assert open_campaign(campaign).runs[2].channel("AccX").tolist() == [1.0, 1.0, 1.0]
