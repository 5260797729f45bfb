"""Stopped ingests: what was acknowledged survives kill -9, what was not is said to be lost."""

import errno
import json
import os
import random
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from studies import store_faults as faults
from studies import system_calls
from testbench.cli.campaign import recover as command
from testbench.errors import StoreError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.ingestion.recovered_runs import recover
from testbench.recording import Channel, Group, TimeColumn, UniformClock
from testbench.store import Campaign, atomic_files, chunk_io, open_campaign, open_run, writer
from testbench.store.archive import archive
from testbench.store.atomic_files import JournalWriter
from testbench.store.writer import RunWriter

from .stored import fill, names_in, store_groups

INTENT = {
    "origin": "simulated", "conditions": {"payload_kg": 5.0}, "rig": "a = 1\n",
    "sources": [{"name": "log.csv", "size_bytes": 9}],
}  # fmt: skip
GROUP = Group("log", (Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")), TimeColumn(0))
COLUMNS = [
    np.arange(writer.GATHERED + 5000) / 1000.0,
    np.random.default_rng(3).normal(size=writer.GATHERED + 5000),
]


@pytest.mark.skipif(sys.platform == "win32", reason="a killed process keeps its files open for a while")
def test_killed_amid_its_data(tmp_path):
    """By the system, three pieces acknowledged: they are there to the bit, and no half file has a final name."""
    columns = faults.write_log(tmp_path / "log.csv", 100_000)
    acknowledged = faults.kill(tmp_path / "log.csv", tmp_path / "c", 3, pause_s=0.2)
    assert acknowledged >= 3 * 8192
    assert faults.recovered(tmp_path / "c", acknowledged, columns) == 3
    assert faults.recovered(tmp_path / "c", acknowledged, columns) == 0  # nothing is left to do


def stopped(folder, monkeypatch, finish=False, seal=False, commit=False):
    """What a killed process leaves: nothing is tidied up."""
    with monkeypatch.context() as patch:
        patch.setattr(RunWriter, "__exit__", lambda *_: None)
        with RunWriter(folder, "r001", INTENT) as run:
            run.group(GROUP).append(COLUMNS)
            if finish:
                run.group(GROUP).finish(1000.0, "median_step")
                run.describe("simulated", {}, [], {"sources": []}, None)
            if seal:
                run.seal()
            if commit:
                patch.setattr(JournalWriter, "remove", lambda _: None)
                run.commit()
    if run._file is not None:
        run._file.close()
    run._out._stream.close()
    run._journal._stream.close()


@pytest.fixture(params=["of this machine", "as on Windows"])
def system(request, monkeypatch):
    """Its file operations; as on Windows nothing is locked by fcntl, and what is open is not renamed or removed."""
    handles = Path("/proc/self/fd")
    if request.param == "of this machine":
        return
    if not handles.is_dir():
        pytest.skip("needs /proc, to see which files are open")

    def unless_open(function):
        def checked(*places, **named):
            names = {os.path.realpath(place) for place in places}
            for handle in handles.iterdir():
                with suppress(FileNotFoundError):  # that of the listing itself
                    if os.readlink(handle) in names:
                        raise PermissionError(errno.EACCES, "is open", str(places[0]))
            return function(*places, **named)

        return checked

    monkeypatch.setattr(atomic_files, "fcntl", None)
    for name in ("rename", "replace", "unlink", "link"):
        monkeypatch.setattr(os, name, unless_open(getattr(os, name)))


def test_what_is_written_during_a_sync_waits_for_the_next_one(tmp_path, monkeypatch):
    """The journal says of the chunks alone that they are on the disk that were acknowledged before the sync began."""
    begun, ended = threading.Event(), threading.Event()
    monkeypatch.setattr(chunk_io.OutFile, "sync", lambda _: (begun.set(), ended.wait(60.0)))
    with RunWriter(tmp_path, "r001", INTENT) as run:
        for every_s in (0.0, 1e9):
            monkeypatch.setattr(writer, "SYNCED_EVERY_S", every_s)
            run.group(GROUP).append([column[: writer.GATHERED] for column in COLUMNS])
            assert begun.wait(60.0)
        ended.set()
        run.wait_until_synced()
        (kept,) = atomic_files.read_journal(run.part.with_suffix(atomic_files.JOURNAL)).groups
        chunks = writer.GATHERED // writer.CHUNK
        assert ([len(pieces) for pieces in kept.pieces], kept.synced) == ([2 * chunks] * 2, chunks)
        run._journal._note({"synced": True})  # as in journals of earlier versions, whose sync kept the writer waiting
        assert atomic_files.read_journal(run._journal.path).groups[0].synced == 2 * chunks


@pytest.mark.usefixtures("system")
def test_what_was_acknowledged_becomes_a_marked_run(tmp_path, monkeypatch):
    """Samples to the bit; conditions, rig and origin as they were meant; the loss in a finding."""
    stopped(tmp_path, monkeypatch)
    (found,) = recover(tmp_path)
    assert (found.status, found.file) == ("recovered", "r001.recovered.h5")
    run = open_run(tmp_path / found.file)
    assert run.group().samples == writer.GATHERED == found.samples["log"]
    assert run.channel("AccX").tobytes() == COLUMNS[1][: writer.GATHERED].tobytes()
    assert run.rate_hz == pytest.approx(1000.0)
    assert (run.origin, run.conditions, run.rig) == ("simulated", {"payload_kg": 5.0}, "a = 1\n")
    assert "interrupted" in {finding.code for finding in run.findings}
    assert recover(tmp_path) == []
    assert {state.status for state in open_campaign(tmp_path).verify()} == {"intact"}


@pytest.mark.usefixtures("system")
@pytest.mark.parametrize("commit", [False, True])
def test_a_run_that_was_written_whole_is_put_in_its_place(tmp_path, monkeypatch, commit):
    """Stopped between the last byte and the last name: the run itself is there, and nothing is lost."""
    stopped(tmp_path, monkeypatch, finish=True, seal=True, commit=commit)
    (found,) = recover(tmp_path)
    assert (found.status, found.file) == ("completed", "r001.h5")
    assert open_run(tmp_path / "r001.h5").channel("AccX").tobytes() == COLUMNS[1].tobytes()
    assert names_in(tmp_path) == ["r001.h5", "r001.h5.sha256"]
    assert atomic_files.recorded_digest(tmp_path / "r001.h5") == atomic_files.sha256_of(tmp_path / "r001.h5")


def test_stopped_between_digest_and_run(tmp_path, monkeypatch):
    """The digest has its name, the run not yet: it gets it."""
    stopped(tmp_path, monkeypatch, finish=True, seal=True)
    (part,) = tmp_path.glob("*.part")
    atomic_files.digest_file(tmp_path / "r001.h5").write_text(
        atomic_files.line_for("r001.h5", atomic_files.sha256_of(part))
    )
    assert [found.status for found in recover(tmp_path)] == ["completed"]
    assert {state.status for state in open_campaign(tmp_path).verify()} == {"intact"}


def test_the_whole_log_makes_what_was_saved_unnecessary(tmp_path, monkeypatch):
    """If the log was ingested again before, the leftover only goes; another run of the name stays as it is."""
    stopped(tmp_path, monkeypatch)
    store_groups(tmp_path, {GROUP: COLUMNS})
    before = (tmp_path / "r001.h5").read_bytes()
    assert [found.status for found in recover(tmp_path)] == ["superseded"]
    stopped_again = COLUMNS[1][7]
    COLUMNS[1][7] += 1.0
    try:
        with monkeypatch.context() as patch:
            patch.setattr("pathlib.Path.exists", lambda path: False)  # the run came meanwhile
            stopped(tmp_path, patch)
    finally:
        COLUMNS[1][7] = stopped_again
    assert [found.file for found in recover(tmp_path)] == ["r001.recovered.h5"]
    assert (tmp_path / "r001.h5").read_bytes() == before


def test_damage_is_not_saved(tmp_path, monkeypatch):
    """A flipped bit in an acknowledged chunk or in the journal: refused, and what is there stays."""
    for ending in (".part", ".journal"):
        stopped(tmp_path, monkeypatch)
        (path,) = tmp_path.glob(f"*{ending}")
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        before = {p.name for p in tmp_path.iterdir()}
        assert [found.status for found in recover(tmp_path)] == ["failed"]
        assert {p.name for p in tmp_path.iterdir()} == before
        for left in tmp_path.iterdir():
            left.unlink()


@pytest.mark.skipif(sys.platform == "win32", reason="locks of another kind")
def test_a_running_ingest_is_left_alone(tmp_path):
    """Recover does not touch what a living process writes; verify says so; the ingest ends well."""
    with RunWriter(tmp_path, "r001", INTENT) as run:
        run.group(GROUP).append(COLUMNS)
        assert [found.status for found in recover(tmp_path)] == ["running"]
        (state,) = [s for s in Campaign(tmp_path).verify() if s.status == "unfinished"]
        assert "at this moment" in state.message
        run.group(GROUP).finish(None, None)
        run.describe("simulated", {}, [], {"sources": []}, None)
        run.commit()
    assert recover(tmp_path) == []


@pytest.mark.parametrize("clock", [TimeColumn(0), UniformClock(100.0, 0.5), None])
def test_clocks_survive(tmp_path, monkeypatch, clock):
    """Recorded, uniform or none: the group is what it was."""
    monkeypatch.setitem(globals(), "GROUP", Group("log", GROUP.channels, clock))
    stopped(tmp_path, monkeypatch, finish=True)
    recover(tmp_path)
    group = open_run(tmp_path / "r001.recovered.h5").group()
    assert (group.clock, group.channels, group.samples) == (clock, GROUP.channels, len(COLUMNS[0]))


def test_the_command_says_what_is_lost(tmp_path, monkeypatch, capsys):
    """0 nothing to do, 3 with losses, 1 if nothing could be saved; a folder that is none is refused."""
    assert command.main([str(tmp_path)], standalone_mode=False) == 0
    stopped(tmp_path, monkeypatch)
    capsys.readouterr()
    assert command.main([str(tmp_path), "--json"], standalone_mode=False) == 3
    (found,) = json.loads(capsys.readouterr().out)["recovered"]
    assert "lost unless the log is at hand" in found["message"]
    monkeypatch.setitem(globals(), "COLUMNS", [column[:100] for column in COLUMNS])
    stopped(tmp_path, monkeypatch)
    assert command.main([str(tmp_path)], standalone_mode=False) == 1
    assert command.main([str(tmp_path)], standalone_mode=False) == 0
    with pytest.raises(StoreError, match="no such folder"):
        command.main([str(tmp_path / "nowhere")], standalone_mode=False)


def test_a_random_bit_or_cut_is_found(tmp_path):
    """Bits of runs and digests flipped, 8 cuts: each is named by verify, and no cut run gives fewer samples.

    So it is of an archive. The study of faults of the store makes hundreds of each.
    """
    faults.write_log(tmp_path / "log.csv", 3000)
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    chance = random.Random(21)
    run = tmp_path / "c" / "log.h5"
    for stored in (run, archive(open_run(run), tmp_path / "a").file):
        assert all(faults.flipped(stored, chance) for _ in range(20))
        assert all(faults.cut(stored, chance) for _ in range(8))


def test_a_campaign_of_nothing_but_leftovers(tmp_path, monkeypatch):
    """Commands that need a run say what is there and how to save it."""
    stopped(tmp_path, monkeypatch)
    with pytest.raises(
        StoreError, match=r"holds no run \(\*\.h5\), only what a stopped ingest left: `testbench recover"
    ):
        open_campaign(tmp_path)
    with RunWriter(tmp_path, "other"), pytest.raises(StoreError, match="at this moment"):
        open_campaign(tmp_path)


def test_files_of_others_are_left_alone(tmp_path):
    """Files of a person that end like ours are neither leftovers nor removed, empty ones included."""
    mine = {"lab.journal": b"notes of the day", "lab.part": b"2 of 3", "empty.journal": b"", "empty.part": b"x",
            "other.h5.sha256.part": b"y", ".hidden.journal": b"", ".hidden.part": b"z"}  # fmt: skip
    for name, content in mine.items():
        (tmp_path / name).write_bytes(content)
    assert recover(tmp_path) == []
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == mine
    assert {state.status for state in Campaign(tmp_path).verify()} == {"extra"}


@pytest.mark.parametrize("name", ["my.journal", "a.journal.b", "r001.part", "a.h5.sha256.b"])
def test_runs_whose_names_look_like_endings(tmp_path, monkeypatch, name):
    """What is saved has the name of its run, where everybody finds it."""
    real = RunWriter.__init__
    with monkeypatch.context() as patch:
        patch.setattr(RunWriter, "__init__", lambda self, folder, _, intent: real(self, folder, name, intent))
        stopped(tmp_path, patch)
    assert [(found.run, found.file) for found in recover(tmp_path)] == [(name, f"{name}.recovered.h5")]
    (run,) = open_campaign(tmp_path).runs
    assert run.channel("AccX").tobytes() == COLUMNS[1][: run.group().samples].tobytes()
    assert len(names_in(tmp_path)) == 2


def test_a_recovery_that_was_stopped_before_it_tidied_up(tmp_path, monkeypatch):
    """The run is saved once: a second one of the same samples would count as a repeat."""
    stopped(tmp_path, monkeypatch)
    left = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert [found.status for found in recover(tmp_path)] == ["recovered"]
    for path, content in left.items():
        path.write_bytes(content)
    assert [(found.status, found.file) for found in recover(tmp_path)] == [("superseded", "r001.recovered.h5")]
    assert names_in(tmp_path) == ["r001.recovered.h5", "r001.recovered.h5.sha256"]


@pytest.mark.skipif(sys.platform == "win32", reason="locks of another kind")
def test_the_digest_of_a_running_ingest_is_left_alone(tmp_path, monkeypatch):
    """A recovery at the moment in which an ingest names its digest takes nothing away."""
    real, found = atomic_files.take_name, []

    def amid(part, target):
        found.append(recover(tmp_path))
        real(part, target)

    monkeypatch.setattr(atomic_files, "take_name", amid)
    with RunWriter(tmp_path, "r001", INTENT) as run:
        fill(run, {GROUP: COLUMNS})
        run.commit()
    assert [[one.status for one in each] for each in found] == [["running"], ["running"]]
    assert {state.status for state in open_campaign(tmp_path).verify()} == {"intact"}


@pytest.mark.parametrize("ending", [".journal", ".journal.new"])
def test_stopped_before_it_began(tmp_path, ending):
    """An empty journal alone is nothing; beside an unfinished run it was lost with the machine, and the run stays."""
    journal, part = tmp_path / f".r001.0123456789ab{ending}", tmp_path / ".r001.0123456789ab.part"
    journal.touch()
    assert recover(tmp_path) == []
    assert not list(tmp_path.iterdir())
    journal.touch()
    part.write_bytes(b"samples")
    (found,) = recover(tmp_path)
    assert (found.status, found.run) == ("failed", "r001")
    assert "loss of power" in found.message
    assert part.read_bytes() == b"samples"


@pytest.mark.skipif(
    sys.platform != "linux", reason="the laboratory forks, and asks the system for the files of handles"
)
@pytest.mark.parametrize(
    ("work", "kind"), [("calibrate", "fails"), ("calibrate", "killed"), ("calibrate", "power"), ("watch", "fails")]
)
def test_system_calls_that_go_wrong(tmp_path, work, kind):
    """Two calls, of the laboratory that the study takes through all of them: nothing told is lost, nothing silent."""
    base = system_calls.prepare(tmp_path, work)
    assert [system_calls.trial(base, work, kind, number, seed=1) for number in (3, 16)] == [(True, "")] * 2
