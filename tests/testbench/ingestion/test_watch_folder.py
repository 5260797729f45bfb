"""A watched folder: each log once, when it has stopped growing, also after a crash."""

import errno
import json
import os
import subprocess
import sys
import time

import click
import pytest

from testbench.cli.campaign import list_runs
from testbench.cli.ingest import watch as command
from testbench.errors import RecordingError
from testbench.ingestion import Ingest, watch_folder
from testbench.ingestion.watch_folder import Watch, WatchedRunTable
from testbench.store import open_campaign
from testbench.store.ledger import read_ledger

HEADER = "Time (s),AccX (g)\n"


def log(path, rows=200, first=0.0):
    """A small log."""
    path.write_text(HEADER + "".join(f"{i / 100:.2f},{first + i % 7:.3f}\n" for i in range(rows)))


@pytest.fixture
def watching(tmp_path):
    """A watched folder with two logs, a campaign beside."""
    (tmp_path / "in").mkdir()
    log(tmp_path / "in" / "a.csv")
    log(tmp_path / "in" / "b.csv", first=1.0)
    return Watch(tmp_path / "in", Ingest(tmp_path / "c"), settle_s=0.05)


def told(outcomes):
    """What became of each file."""
    return {outcome.source: outcome.status for outcome in outcomes}


def test_each_log_once(watching, tmp_path):
    """What is there becomes runs; a second pass and a process that begins anew store nothing twice."""
    assert told(watching.once()) == {"a.csv": "stored", "b.csv": "stored"}
    assert told(watching.once()) == {}
    anew = Watch(tmp_path / "in", Ingest(tmp_path / "c"), settle_s=0.05)
    assert told(anew.once()) == {"a.csv": "already_stored", "b.csv": "already_stored"}
    assert len(open_campaign(tmp_path / "c").runs) == 2


def test_a_file_that_grows_waits(watching, tmp_path):
    """A log is taken when it has not changed for a while, and then whole."""
    path = tmp_path / "in" / "b.csv"
    list(watching.look())
    time.sleep(0.06)
    with path.open("a") as stream:
        stream.write("2.00,5.000\n")
    assert told(watching.look()) == {"a.csv": "stored"}
    assert [p.name for p in watching.growing] == ["b.csv"]
    time.sleep(watching._settle_s(path))  # twice the pause that it made
    assert told(watching.look()) == {"b.csv": "stored"}
    assert open_campaign(tmp_path / "c").runs[1].group().samples == 201


def test_what_is_refused_is_said_once_and_the_rest_goes_on(watching, tmp_path):
    """A picture, an empty log, another log of a stored name: each refused once; tried again when it changes."""
    (tmp_path / "in" / "0.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(99))
    (tmp_path / "in" / "empty.csv").write_text("")
    found = told(watching.once())
    assert found == {"0.png": "refused", "a.csv": "stored", "b.csv": "stored", "empty.csv": "refused"}
    assert told(watching.once()) == {}
    log(tmp_path / "in" / "empty.csv", first=3.0)
    log(tmp_path / "in" / "a.csv", first=4.0)
    (outcomes) = list(watching.once())
    assert told(outcomes) == {"empty.csv": "stored", "a.csv": "refused"}
    assert "stored runs never change" in outcomes[0].message


def test_hidden_files_folders_and_links_are_left_alone(watching, tmp_path):
    """No link is followed, no folder entered, nothing half-copied taken."""
    log(tmp_path / "elsewhere.csv", first=9.0)
    (tmp_path / "in" / "link.csv").symlink_to(tmp_path / "elsewhere.csv")
    (tmp_path / "in" / "folder").mkdir()
    log(tmp_path / "in" / ".hidden.csv")
    log(tmp_path / "in" / "c.csv.part")
    assert set(told(watching.once())) == {"a.csv", "b.csv"}


@pytest.mark.skipif(sys.platform == "win32", reason="a killed process keeps its files open for a while")
def test_once_each_after_a_crash(watching, tmp_path):
    """Killed while it ingests: begun anew, every log is stored once, none is lost."""
    for number in range(6):
        log(tmp_path / "in" / f"r{number}.csv", rows=3000, first=float(number + 10))
    code = "from testbench.cli import main; main()"
    words = ["watch", tmp_path / "in", "-o", tmp_path / "c", "--settle", "10ms"]
    child = subprocess.Popen([sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    child.stdout.readline()
    child.kill()
    child.communicate()
    assert set(told(watching.once()).values()) <= {"stored", "already_stored"}
    runs = open_campaign(tmp_path / "c").runs
    assert sorted(run.provenance["sources"][0]["name"] for run in runs) == sorted(
        ["a.csv", "b.csv", *(f"r{number}.csv" for number in range(6))]
    )


def test_the_command(watching, tmp_path, capsys):
    """--once prints one document; --json needs it; a folder that is none is refused."""
    words = [str(tmp_path / "in"), "-o", str(tmp_path / "c"), "--settle", "10ms"]
    assert command.main([*words, "--once", "--json"], standalone_mode=False) == 0
    document = json.loads(capsys.readouterr().out)
    assert [run["status"] for run in document["runs"]] == ["stored", "stored"]
    assert document["growing"] == []
    (tmp_path / "in" / "empty.csv").write_text("")
    assert command.main([*words, "--once"], standalone_mode=False) == 1
    assert "a.csv: already stored as a.h5" in capsys.readouterr().out
    with pytest.raises(click.UsageError, match="needs --once"):
        command.main([*words, "--json"], standalone_mode=False)
    with pytest.raises(RecordingError, match="no such folder"):
        command.main([str(tmp_path / "x"), *words[1:], "--once"], standalone_mode=False)


def sheet_of(path, *rows):
    """Write a run table."""
    path.write_text("file,run,payload_kg\n" + "".join(f"{row}\n" for row in rows))


@pytest.fixture
def sheeted(watching, tmp_path):
    """The watched folder with a run table in it, which names the first log."""
    sheet_of(tmp_path / "in" / "runs.csv", "a.csv,ra,5")
    watching.run_table = WatchedRunTable(tmp_path / "in" / "runs.csv", watching.settle_s)
    return watching


def test_conditions_of_a_sheet_that_goes_on(sheeted, tmp_path):
    """What the run table names gets its conditions; the other log waits, said once, until a line is added for it."""
    assert told(sheeted.once()) == {"a.csv": "stored", "b.csv": "waiting"}
    assert told(sheeted.once()) == {}
    assert {path.name: reason for path, reason in sheeted.waiting.items()} == {
        "b.csv": "b.csv: runs.csv does not name it: add a row for it, or do not give it"
    }
    sheet_of(tmp_path / "in" / "runs.csv", "a.csv,ra,5", "b.csv,rb,3")
    assert told(sheeted.once()) == {"b.csv": "stored"}
    assert not sheeted.waiting
    assert [(r.name, r.conditions) for r in open_campaign(tmp_path / "c").runs] == [
        ("ra", {"payload_kg": 5.0}), ("rb", {"payload_kg": 3.0}),
    ]  # fmt: skip


def test_a_run_waits_for_all_its_files(sheeted, tmp_path):
    """Two loggers, one run: stored once both are there."""
    sheet_of(tmp_path / "in" / "runs.csv", "a.csv,r1,5", "c.csv,r1,5")
    found = {o.source: o.message for o in sheeted.once()}
    assert found == {
        "a.csv": "waits for c.csv, of the same run 'r1'",
        "b.csv": "b.csv: runs.csv does not name it: add a row for it, or do not give it",
    }
    log(tmp_path / "in" / "c.csv", first=9.0)
    assert told(sheeted.once()) == {"a.csv": "stored", "c.csv": "stored"}
    (run,) = open_campaign(tmp_path / "c").runs
    assert len(run.groups) == 2


def test_a_sheet_that_cannot_be_read_holds_everything(sheeted, tmp_path):
    """No log is taken with conditions of yesterday: the run table is refused once, and all wait until it is mended."""
    (tmp_path / "in" / "runs.csv").write_text("file,paylod\na.csv,5\n")
    assert told(sheeted.once()) == {"runs.csv": "refused", "a.csv": "waiting", "b.csv": "waiting"}
    assert told(sheeted.once()) == {}
    sheet_of(tmp_path / "in" / "runs.csv", "a.csv,ra,5", "b.csv,rb,3")
    assert told(sheeted.once()) == {"a.csv": "stored", "b.csv": "stored"}
    (tmp_path / "in" / "runs.csv").unlink()
    log(tmp_path / "in" / "c.csv", first=9.0)
    assert told(sheeted.once()) == {"c.csv": "waiting"}


def test_a_line_that_changes_after_its_run_was_stored(sheeted, tmp_path):
    """The stored run stays, and the contradiction is said."""
    sheet_of(tmp_path / "in" / "runs.csv", "a.csv,ra,5", "b.csv,rb,3")
    list(sheeted.once())
    sheet_of(tmp_path / "in" / "runs.csv", "b.csv,rb,3", "a.csv,ra,7")
    (outcome,) = sheeted.once()
    assert (outcome.source, outcome.status) == ("a.csv", "already_stored")
    assert [f.message for f in outcome.findings if f.code == "conditions_differ"] == [
        "ra.h5 is stored with other values than the run table has: payload_kg 5 (now 7); correct the table, or take "
        "ra.h5 out by testbench remove, with the reason, and ingest again"
    ]


def test_files_without_a_line_may_be_stored(sheeted, tmp_path):
    """Where asked for: without conditions, which nothing invents."""
    sheeted.store_unnamed = True
    assert told(sheeted.once()) == {"a.csv": "stored", "b.csv": "stored"}
    assert [run.conditions for run in open_campaign(tmp_path / "c").runs] == [{}, {"payload_kg": 5.0}]


def test_the_command_with_a_sheet(watching, tmp_path, capsys):
    """Who waits, and for what, is in the document; the exit code says that something is left."""
    sheet_of(tmp_path / "runs.csv", "a.csv,ra,5")
    words = [str(tmp_path / "in"), "-o", str(tmp_path / "c"), "--settle", "20ms", "--once"]
    words += ["--runs", str(tmp_path / "runs.csv")]
    assert command.main([*words, "--json"], standalone_mode=False) == 3
    document = json.loads(capsys.readouterr().out)
    assert [(run["source"], run["file"]) for run in document["runs"]] == [("a.csv", "ra.h5")]
    assert document["waiting"] == [
        {"file": "b.csv", "reason": "b.csv: runs.csv does not name it: add a row for it, or do not give it"}
    ]
    assert command.main([*words, "--unnamed", "store"], standalone_mode=False) == 0
    assert len(open_campaign(tmp_path / "c").runs) == 2


def test_the_folder_of_the_campaign_itself(tmp_path, monkeypatch):
    """Runs would arrive as logs: refused before anything is read."""
    (tmp_path / "log.csv").write_text("t (s),F (N)\n0,1\n1,2\n")
    words = ["watch", str(tmp_path), "-o", f"{tmp_path}/.", "--once"]
    done = subprocess.run([sys.executable, "-c", "from testbench.cli import main; main()", *words], capture_output=True)
    assert done.returncode == 1
    assert b"is the campaign's folder too" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


class Clock:
    """A clock that goes on while somebody sleeps, and not else."""

    now = 0.0

    def monotonic(self):
        """The time [s]."""
        return self.now

    def sleep(self, seconds):
        """Let so much time pass."""
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    """Time as a watched folder sees it."""
    made = Clock()
    monkeypatch.setattr(watch_folder, "time", made)
    return made


def test_a_log_that_a_process_still_writes_is_left(watching, clock, tmp_path):
    """A buffered logger holds its file: it rests, and is not taken until the logger lets it go."""
    if not watch_folder.knows_all_writers():
        pytest.skip("the system does not say who writes a file")
    with (tmp_path / "in" / "b.csv").open("a") as stream:
        assert told(watching.once()) == {"a.csv": "stored"}
        assert {path.name: process for path, process in watching.writing.items()} == {"b.csv": os.getpid()}
        assert [path.name for path in watching.growing] == ["b.csv"]
        stream.write("2.00,5.000\n")
    clock.sleep(0.06)
    list(watching.look())  # the change is seen
    clock.sleep(0.3)
    assert told(watching.look()) == {"b.csv": "stored"}
    assert open_campaign(tmp_path / "c").runs[1].group().samples == 201


def test_a_folder_that_goes_away_and_comes_back(watching, tmp_path):
    """A share without its network: said once, and what lies in it is taken when it is there again."""
    (tmp_path / "in").rename(tmp_path / "away")
    assert [told(watching.look()) for _ in range(2)] == [{"in": "refused"}, {}]
    (tmp_path / "away").rename(tmp_path / "in")
    assert told(watching.once()) == {"a.csv": "stored", "b.csv": "stored"}


def test_a_disk_that_fails_for_a_while(watching, clock, tmp_path, monkeypatch):
    """A log that could not be read or written is said once, and taken when that is over, without having changed."""
    failing, whole = {"b.csv"}, Ingest._copy

    def copy(ingest, source, writer):
        if source.path.name in failing:
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(source.path))
        return whole(ingest, source, writer)

    monkeypatch.setattr(Ingest, "_copy", copy)
    assert told(watching.once()) == {"a.csv": "stored", "b.csv": "refused"}
    for _ in range(3):
        clock.sleep(watch_folder.TRIED_AGAIN_S)
        assert told(watching.look()) == {}
    failing.clear()
    assert told(watching.look()) == {}
    clock.sleep(watch_folder.TRIED_AGAIN_S)
    assert told(watching.look()) == {"b.csv": "stored"}


@pytest.mark.parametrize("pause_s", [1, 9, 30, 60])
def test_a_logger_that_flushes_slowly(watching, clock, tmp_path, pause_s):
    """Ten flushes that cut rows, a look each second: in between whole or marked incomplete, whole in the end."""
    path, campaign = tmp_path / "in" / "b.csv", tmp_path / "c"
    whole = path.read_bytes()
    for second in range(13 * pause_s):
        if flushed := second % pause_s == 0 and second < 10 * pause_s:
            path.write_bytes(whole[: len(whole) * (1 + second // pause_s) // 10])
        list(watching.look())
        if flushed and second:
            held = {run.path.name for run in open_campaign(campaign).runs if run.name.startswith("b")}
            assert held <= read_ledger(campaign).grown
        clock.sleep(1.0)
    (b,) = [run for run in open_campaign(campaign).runs if run.name.startswith("b")]
    assert (b.group().samples, read_ledger(campaign).grown) == (200, frozenset())


def test_a_log_that_grows_after_it_was_stored(watching, clock, tmp_path, capsys):
    """Marked incomplete when that is seen, then stored whole as the next version, which counts alone."""
    path = tmp_path / "in" / "b.csv"
    assert told(watching.once()) == {"a.csv": "stored", "b.csv": "stored"}
    for row in range(2):
        with path.open("a") as stream:
            stream.write(f"{2 + row}.00,5.000\n")
        assert told(watching.look()) == {}
        assert listed(tmp_path / "c", capsys)[("b", "b.v2")[row]] == "incomplete"
        clock.sleep(2.0 * watching._settle_s(path))
        (outcome,) = watching.look()
        assert (outcome.status, outcome.file) == ("stored", f"b.v{row + 2}.h5")
        assert "continued" in {finding.code for finding in outcome.findings}
    assert listed(tmp_path / "c", capsys) == {
        "a": None, "b": "superseded by b.v2", "b.v2": "superseded by b.v3", "b.v3": None,
    }  # fmt: skip
    assert [(run.name, run.group().samples) for run in open_campaign(tmp_path / "c").runs] == [
        ("a", 200),
        ("b.v3", 202),
    ]
    assert {state.status for state in open_campaign(tmp_path / "c").verify()} == {"intact"}


def listed(campaign, capsys):
    """What ``testbench list`` says of the log of each run."""
    capsys.readouterr()
    assert list_runs.main([str(campaign), "--json"], standalone_mode=False) == 0
    return {run["run"]: run.get("log") for run in json.loads(capsys.readouterr().out)["runs"]}


def test_a_pause_is_learned_for_logs_of_a_kind(watching, clock, tmp_path):
    """A logger that pauses for longer than a file must rest: the next file of its name is waited for."""
    path = tmp_path / "in" / "slow_1.csv"
    log(path)
    list(watching.look())
    clock.sleep(0.04)
    with path.open("a") as stream:
        stream.write("2.00,5.000\n")
    list(watching.look())
    clock.sleep(9.0)
    assert told(watching.look()) == {"a.csv": "stored", "b.csv": "stored", "slow_1.csv": "stored"}
    with path.open("a") as stream:
        stream.write("2.01,5.000\n")
    list(watching.look())
    log(tmp_path / "in" / "slow_2.csv", first=8.0)
    list(watching.look())
    clock.sleep(9.5)  # longer than any file must rest of which nothing is known
    assert told(watching.look()) == {}
    clock.sleep(9.0)
    assert told(watching.look()) == {"slow_1.csv": "stored", "slow_2.csv": "stored"}
