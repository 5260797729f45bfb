"""A watched folder: each log once, when it has stopped growing, also after a crash."""

import json
import subprocess
import sys
import time

import click
import pytest

from testbench.cli.watch import watch as command
from testbench.errors import RecordingError
from testbench.ingest import Ingest
from testbench.store import open_campaign
from testbench.watch import Watch

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
    time.sleep(0.06)
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
