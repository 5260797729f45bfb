"""What machines do: a disk that is full, folders that cannot be written, two ingests at once."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from studies import store_faults as faults
from testbench.errors import StoreError
from testbench.export import TARGETS, export
from testbench.ingest import Ingest
from testbench.ingest.recovered_runs import recover
from testbench.ingest.run_conditions import plan_runs
from testbench.store import open_campaign
from testbench.store.archive import archive

TWO = [sys.executable, "-c", "from testbench.cli import main; main()", "ingest"]
LIMITED = """
import resource, signal, sys
from pathlib import Path
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), resource.RLIM_INFINITY))
sys.argv = ["testbench", "ingest", sys.argv[1], "-o", sys.argv[2]]
from testbench.cli import main
main()
"""


@pytest.fixture
def campaign(tmp_path):
    """A campaign of one run, with a longer log beside it that is not ingested yet."""
    faults.write_log(tmp_path / "first.csv", 2000)
    faults.write_log(tmp_path / "log.csv", 200_000)
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "first.csv"], None)[0])
    return tmp_path / "c"


def intact(campaign):
    """The names of the runs, if every file of the campaign is intact."""
    states = open_campaign(campaign).verify()
    assert {state.status for state in states} == {"intact"}, states
    return [state.name for state in states]


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of resources")
@pytest.mark.parametrize("limit", [0, 100, 3000, 100_000, 1_500_000, 4_000_000])
def test_no_room_for_the_run(campaign, limit):
    """Wherever the system stops writing: one clear message, exit 1, the campaign intact and nothing left behind."""
    log = campaign.parent / "log.csv"
    done = subprocess.run([sys.executable, "-c", LIMITED, log, campaign, str(limit)], capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "cannot be written (File too large)" in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert intact(campaign) == ["first.h5"]


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="nothing is read-only to root")
def test_a_folder_that_is_read_only(campaign):
    """One clear message; after that the folder takes runs again."""
    campaign.chmod(0o555)
    try:
        (outcome,) = Ingest(campaign).run(plan_runs([campaign.parent / "log.csv"], None)[0])
    finally:
        campaign.chmod(0o755)
    assert outcome.status == "refused"
    assert "cannot be written (Permission denied)" in outcome.message
    assert intact(campaign) == ["first.h5"]


def test_a_folder_that_is_a_file(tmp_path):
    """A campaign cannot be made where a file is; the file stays as it is."""
    faults.write_log(tmp_path / "log.csv", 100)
    (tmp_path / "c").write_text("mine")
    (outcome,) = Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    assert outcome.status == "refused"
    assert "File exists" in outcome.message or "Not a directory" in outcome.message
    assert (tmp_path / "c").read_text() == "mine"


def at_once(*commands):
    """Run several ingests at the same time; their exit codes and documents."""
    children = [
        subprocess.Popen([*TWO, *map(str, words), "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for words in commands
    ]
    answers = [child.communicate() for child in children]
    return [(child.returncode, json.loads(out)["runs"]) for child, (out, _) in zip(children, answers, strict=True)]


@pytest.mark.parametrize("names", [("log", "log"), ("log", "copy")])
def test_the_same_log_twice_at_once(tmp_path, names):
    """Under one name or two: stored once, the other one says that it is there; both end well."""
    columns = faults.write_log(tmp_path / "log.csv", 100_000)
    (tmp_path / "copy.csv").write_bytes((tmp_path / "log.csv").read_bytes())
    found = at_once(*([tmp_path / f"{name}.csv", "-o", tmp_path / "c"] for name in names))
    assert sorted(run["status"] for _, (run,) in found) == ["already_stored", "stored"]
    assert {code for code, _ in found} <= {0, 3}
    (name,) = intact(tmp_path / "c")
    (run,) = open_campaign(tmp_path / "c").runs
    assert np.array_equal(run.channel("AccX"), columns[1])
    assert {r["file"] for _, (r,) in found} == {name}


def test_different_logs_at_once(tmp_path):
    """Two processes with three logs each, one of them common: five runs, all whole."""
    logs = [tmp_path / f"r{number}.csv" for number in range(5)]
    for number, log in enumerate(logs):
        faults.write_log(log, 20_000 + number)
    found = at_once([*logs[:3], "-o", tmp_path / "c"], [*logs[2:], "-o", tmp_path / "c"])
    assert {run["status"] for _, runs in found for run in runs} <= {"stored", "already_stored"}
    assert intact(tmp_path / "c") == [f"r{number}.h5" for number in range(5)]
    assert [run.group().samples for run in open_campaign(tmp_path / "c").runs] == [20_000 + n for n in range(5)]


@pytest.fixture
def disk(tmp_path):
    """A file system of 1 MB in memory, where this user may mount one."""
    mounted = tmp_path / "disk"
    mounted.mkdir()
    if not mount("-t", "tmpfs", "-o", "size=1m", "tmpfs", mounted):
        pytest.skip("mounting a 1 MB file system takes root on Linux: the full disk is not covered here")
    yield mounted
    subprocess.run(["umount", "--lazy", mounted], check=True)


def mount(*words):
    """Whether a file system was mounted."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    return subprocess.run(["mount", *map(str, words)], capture_output=True).returncode == 0


def test_a_file_system_that_fills_up(tmp_path, disk):
    """A clear error for the ingest and for the archive; what was stored before is intact, and nothing half is left."""
    faults.write_log(tmp_path / "first.csv", 2000)
    faults.write_log(tmp_path / "log.csv", 300_000)
    for name, status in (("first", "stored"), ("log", "refused")):
        (outcome,) = Ingest(disk / "c").run(plan_runs([tmp_path / f"{name}.csv"], None)[0])
        assert outcome.status == status, outcome.message
    assert "No space left on device" in outcome.message
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    (run,) = open_campaign(tmp_path / "c").runs
    with pytest.raises(StoreError, match="No space left on device"):
        archive(run, disk / "c")
    assert intact(disk / "c") == ["first.h5"]
    assert sorted(path.name for path in (disk / "c").iterdir()) == ["first.h5", "first.h5.sha256"]
    assert intact(tmp_path / "c") == ["log.h5"]


def test_very_many_channels_on_a_full_file_system(tmp_path, disk):
    """HDF5 stumbles over its own structures that were not written; what is said is that there is no room."""
    names = ",".join(f"c{i} (V)" for i in range(8000))
    (tmp_path / "wide.csv").write_text(names + "\n" + ("1" + ",1" * 7999 + "\n") * 3)
    (outcome,) = Ingest(disk / "c").run(plan_runs([tmp_path / "wide.csv"], None)[0])
    assert outcome.status == "refused"
    assert "No space left on device" in outcome.message


@pytest.mark.parametrize("to", TARGETS)
def test_an_export_without_room(tmp_path, disk, to):
    """A clear error that names the file, and nothing half is left."""
    faults.write_log(tmp_path / "log.csv", 200_000)
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    (run,) = open_campaign(tmp_path / "c").runs
    with pytest.raises(StoreError, match=rf"log\{TARGETS[to]}: cannot be written .*[Nn]o"):
        export(run, to, disk / "out")
    assert list((disk / "out").iterdir()) == []


def test_a_file_system_that_is_read_only(tmp_path, disk):
    """To everybody, root included: it is read as ever, and each way of writing to it is one clear error."""
    faults.write_log(tmp_path / "first.csv", 2000)
    faults.write_log(tmp_path / "log.csv", 3000)
    Ingest(disk / "c").run(plan_runs([tmp_path / "first.csv"], None)[0])
    if not mount("-o", "remount,ro", disk):
        pytest.skip("this file system cannot be made read-only here")
    (outcome,) = Ingest(disk / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
    assert outcome.status == "refused"
    assert "cannot be written (Read-only file system)" in outcome.message
    (run,) = open_campaign(disk / "c").runs
    assert run.channel("AccX").size == 2000
    with pytest.raises(StoreError, match="Read-only file system"):
        archive(run, disk / "archive")
    assert archive(run, tmp_path / "archive").status == "archived"
    assert recover(disk / "c") == []
    assert intact(disk / "c") == ["first.h5"]


def test_there_is_no_index_to_lose(campaign):
    """A campaign is its files: what else comes or goes, the runs and their digests stay as they are."""
    before = {path.name: path.read_bytes() for path in campaign.iterdir()}
    copied = campaign.parent / "moved"
    shutil.copytree(campaign, copied)
    (copied / "index.json").write_text("{}")
    assert [run.name for run in open_campaign(copied).runs] == ["first"]
    (outcome,) = Ingest(copied).run(plan_runs([campaign.parent / "first.csv"], None)[0])
    assert outcome.status == "already_stored"
    assert {name: (copied / name).read_bytes() for name in before} == before
