"""What machines do: a disk that is full, folders that cannot be written, two ingests at once."""

import contextlib
import json
import os
import shutil
import subprocess
import sys

import pytest

from studies import store_faults as faults
from testbench.errors import StoreError
from testbench.export import TARGETS, export
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.ingestion.recovered_runs import recover
from testbench.store import open_campaign
from testbench.store.archive import archive

from .stored import names_in

TWO = [sys.executable, "-c", "from testbench.cli import main; main()", "ingest"]


@contextlib.contextmanager
def files_of_at_most(size):
    """This process cannot make a file larger than so many bytes: the system stops its writing there."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))  # what it would be killed by, Python ignores
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two logs: a short one, and one whose run takes 4.8 MB."""
    folder = tmp_path_factory.mktemp("logs")
    faults.write_log(folder / "first.csv", 2000)
    faults.write_log(folder / "log.csv", 200_000)
    return folder


def ingested(log, campaign):
    """What the ingest of one log says."""
    (outcome,) = Ingest(campaign).run(plan_runs([log], None)[0])
    return outcome


@pytest.fixture
def campaign(logs, tmp_path):
    """A campaign of the short log."""
    ingested(logs / "first.csv", tmp_path / "c")
    return tmp_path / "c"


def intact(campaign):
    """The names of the runs, if every file of the campaign is intact."""
    states = open_campaign(campaign).verify()
    assert {state.status for state in states} == {"intact"}, states
    return [state.name for state in states]


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of resources")
@pytest.mark.parametrize("limit", [0, 100, 3000, 100_000, 1_500_000, 4_000_000])
def test_no_room_for_the_run(logs, campaign, command, limit):
    """Wherever the system stops writing: one clear message, exit 1, the campaign intact and nothing left behind."""
    with files_of_at_most(limit):
        code, _, err = command("ingest", logs / "log.csv", "-o", campaign)
    assert (code, len(err.splitlines())) == (1, 1), err
    assert "cannot be written (File too large)" in err
    assert intact(campaign) == ["first.h5"]


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="nothing is read-only to root")
def test_a_folder_that_is_read_only(logs, campaign):
    """One clear message; after that the folder takes runs again."""
    campaign.chmod(0o555)
    try:
        outcome = ingested(logs / "log.csv", campaign)
    finally:
        campaign.chmod(0o755)
    assert outcome.status == "refused"
    assert "cannot be written (Permission denied)" in outcome.message
    assert intact(campaign) == ["first.h5"]


def test_a_folder_that_is_a_file(logs, tmp_path):
    """A campaign cannot be made where a file is; the file stays as it is."""
    (tmp_path / "c").write_text("mine")
    outcome = ingested(logs / "first.csv", tmp_path / "c")
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


def test_two_ingests_at_once(tmp_path):
    """Logs of their own, one that is common, one under two names: each is stored once, and both ingests end well."""
    for number, name in enumerate(("log", "common", "a", "b")):
        faults.write_log(tmp_path / f"{name}.csv", 20_000 + number)
    (tmp_path / "copy.csv").write_bytes((tmp_path / "log.csv").read_bytes())
    found = at_once(
        *(
            [*(tmp_path / f"{name}.csv" for name in names), "-o", tmp_path / "c"]
            for names in (("log", "common", "a"), ("copy", "common", "b"))
        )
    )
    assert {code for code, _ in found} <= {0, 3}
    runs = [run for _, runs in found for run in runs]
    assert sorted(run["status"] for run in runs) == ["already_stored"] * 2 + ["stored"] * 4
    names = intact(tmp_path / "c")
    assert {run["file"] for run in runs} == set(names)
    assert names in ([f"{name}.h5" for name in ("a", "b", "common", first)] for first in ("copy", "log"))
    samples = [run.group().samples for run in open_campaign(tmp_path / "c").runs]
    assert sorted(samples) == [20_000 + number for number in range(4)]


@pytest.fixture
def disk(tmp_path):
    """A file system of half a megabyte in memory, where this user may mount one."""
    mounted = tmp_path / "disk"
    mounted.mkdir()
    if not mount("-t", "tmpfs", "-o", "size=512k", "tmpfs", mounted):
        pytest.skip("mounting a file system of half a megabyte takes root on Linux: the full disk is not covered here")
    yield mounted
    subprocess.run(["umount", "--lazy", mounted], check=True)


def mount(*words):
    """Whether a file system was mounted."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    return subprocess.run(["mount", *map(str, words)], capture_output=True).returncode == 0


def test_a_file_system_that_fills_up(logs, tmp_path, disk):
    """A clear error for the ingest and for the archive; what was stored before is intact, and nothing half is left."""
    for name, status in (("first", "stored"), ("log", "refused")):
        outcome = ingested(logs / f"{name}.csv", disk / "c")
        assert outcome.status == status, outcome.message
    assert "No space left on device" in outcome.message
    ingested(logs / "log.csv", tmp_path / "c")
    (run,) = open_campaign(tmp_path / "c").runs
    with pytest.raises(StoreError, match="No space left on device"):
        archive(run, disk / "c")
    assert intact(disk / "c") == ["first.h5"]
    assert names_in(disk / "c") == ["first.h5", "first.h5.sha256"]
    assert intact(tmp_path / "c") == ["log.h5"]


def test_very_many_channels_on_a_full_file_system(tmp_path, disk):
    """HDF5 stumbles over its own structures that were not written; what is said is that there is no room."""
    names = ",".join(f"c{i} (V)" for i in range(2500))
    (tmp_path / "wide.csv").write_text(names + "\n" + ("1" + ",1" * 2499 + "\n") * 3)
    outcome = ingested(tmp_path / "wide.csv", disk / "c")
    assert outcome.status == "refused"
    assert "No space left on device" in outcome.message


def test_an_export_without_room(logs, tmp_path, disk):
    """A clear error that names the file, and nothing half is left."""
    ingested(logs / "log.csv", tmp_path / "c")
    (run,) = open_campaign(tmp_path / "c").runs
    for to, ending in TARGETS.items():
        with pytest.raises(StoreError, match=rf"log\{ending}: cannot be written .*[Nn]o"):
            export(run, to, disk / "out")
        assert list((disk / "out").iterdir()) == []


def test_a_file_system_that_is_read_only(logs, tmp_path, disk):
    """To everybody, root included: it is read as ever, and each way of writing to it is one clear error."""
    ingested(logs / "first.csv", disk / "c")
    if not mount("-o", "remount,ro", disk):
        pytest.skip("this file system cannot be made read-only here")
    outcome = ingested(logs / "log.csv", disk / "c")
    assert outcome.status == "refused"
    assert "cannot be written (Read-only file system)" in outcome.message
    (run,) = open_campaign(disk / "c").runs
    assert run.channel("AccX").size == 2000
    with pytest.raises(StoreError, match="Read-only file system"):
        archive(run, disk / "archive")
    assert archive(run, tmp_path / "archive").status == "archived"
    assert recover(disk / "c") == []
    assert intact(disk / "c") == ["first.h5"]


def test_there_is_no_index_to_lose(logs, campaign):
    """A campaign is its files: what else comes or goes, the runs and their digests stay as they are."""
    before = {path.name: path.read_bytes() for path in campaign.iterdir()}
    copied = campaign.parent / "moved"
    shutil.copytree(campaign, copied)
    (copied / "index.json").write_text("{}")
    assert [run.name for run in open_campaign(copied).runs] == ["first"]
    assert ingested(logs / "first.csv", copied).status == "already_stored"
    assert {name: (copied / name).read_bytes() for name in before} == before
