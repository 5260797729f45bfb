"""Several loggers' logs in one ``testbench ingest`` or ``watch``, under a rig that describes the whole bench."""

import json

import pytest

from testbench import rig as rigs
from testbench.cli import main
from testbench.ingestion import Ingest
from testbench.ingestion.watch_folder import Watch
from testbench.store import open_run

from ...commands import call

RIG = """
mechanism = "none"
[loggers.daq]
[loggers.forces]
[sensors.base_acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "AccX", y = "AccY" }
unit = "g"
position = ["0 m", "0 m", "0 m"]
[sensors.cell]
kind = "force"
logger = "forces"
channel = "Fz"
axis = "z"
unit = "N"
position = ["0.15 m", "0.10 m", "0 m"]
"""


@pytest.fixture
def ingest(tmp_path, monkeypatch):
    """Two logs of two loggers, and an ingest of what is named; the exit code and the codes beyond `dialect` by log."""
    (tmp_path / "rig.toml").write_text(RIG)
    rows = range(200)
    daq = "".join(f"{i / 1000:.4f},{0.5 * (i % 7) - 3:.4f},{0.3 * (i % 5):.4f}\n" for i in rows)
    forces = "".join(f"{i / 500:.4f},{1.5 * (i % 9):.4f}\n" for i in rows)
    (tmp_path / "a_daq.csv").write_text("Time (s),AccX (g),AccY (g)\n" + daq)
    (tmp_path / "b_forces.csv").write_text("Time (s),Fz (N)\n" + forces)
    (tmp_path / "c_none.csv").write_text("")
    monkeypatch.chdir(tmp_path)

    def run(*words, command="ingest"):
        done = call(main, "testbench", command, *words, "--rig", "rig.toml", "-o", "c", "--json")
        runs = done.json["runs"]
        return done.code, {r["source"]: [f["code"] for f in r["findings"] if f["code"] != "dialect"] for r in runs}

    return run


def test_what_another_log_holds_is_not_missing(ingest, tmp_path):
    """Each log is a run of its own, in which a note names the other; nothing is wrong, so the exit code is 0."""
    code, found = ingest("a_daq.csv", "b_forces.csv")
    assert (code, found) == (0, {"a_daq.csv": ["sensor_elsewhere"], "b_forces.csv": ["sensor_elsewhere"]})
    (note,) = [f for f in open_run(tmp_path / "c" / "a_daq.h5").findings if f.code == "sensor_elsewhere"]
    assert note.message.startswith("sensors cell (logger forces) are in b_forces.csv, a run of its own")


def test_what_no_log_holds_is_missing(ingest):
    """A log that cannot be read, or that is not given, holds nothing."""
    code, found = ingest("a_daq.csv", "c_none.csv")
    assert (code, found) == (1, {"a_daq.csv": ["sensor_not_recorded"], "c_none.csv": ["empty_file"]})


def test_with_a_sheet_only_the_run_counts(ingest, tmp_path):
    """The sheet says which logs are one run: what another run holds is missing in this one."""
    (tmp_path / "runs.csv").write_text("file\na_daq.csv\nb_forces.csv\n")
    code, found = ingest("a_daq.csv", "b_forces.csv", "--runs", "runs.csv")
    assert (code, found) == (3, {"a_daq.csv": ["sensor_not_recorded"], "b_forces.csv": ["sensor_not_recorded"]})
    (tmp_path / "runs.csv").write_text("file,run\na_daq.csv,r1\nb_forces.csv,r1\n")
    for path in (tmp_path / "c").iterdir():
        path.unlink()
    assert ingest("a_daq.csv", "b_forces.csv", "--runs", "runs.csv") == (0, {"a_daq.csv": [], "b_forces.csv": []})


def test_logs_of_runs_that_are_stored_need_not_be_given_again(ingest, tmp_path):
    """Of one run or several; only what is neither given nor stored is missing, and what the sheet says anew is said."""
    table = tmp_path / "runs.csv"
    table.write_text("file,run,motion\na_daq.csv,r1,left\nb_forces.csv,r1,left\n")
    assert ingest("a_daq.csv", "b_forces.csv", "--runs", "runs.csv")[0] == 0
    (tmp_path / "d_daq.csv").write_text("Time (s),AccX (g),AccY (g)\n0,1,2\n0.001,2,1\n0.002,1,2\n0.003,0,1\n")
    (tmp_path / "d_forces.csv").write_text("Time (s),Fz (N)\n0,1\n0.001,2\n0.002,1\n0.003,0\n")
    table.write_text(table.read_text() + "d_daq.csv,r2,left\nd_forces.csv,r2,left\n")
    stored = {"a_daq.csv": [], "b_forces.csv": [], "d_daq.csv": [], "d_forces.csv": []}
    assert ingest("d_daq.csv", "d_forces.csv", "--runs", "runs.csv") == (0, stored)
    found = call(main, "testbench", "ingest", "d_daq.csv", "--runs", "runs.csv", "--rig", "rig.toml", "-o", "c")
    assert (found.out.splitlines()[0], found.code) == (
        "Logs: 4 already stored in 2 runs.",
        3,
    )  # one of them was given again
    table.write_text(table.read_text() + "e_daq.csv,r3,left\n")
    assert ingest("d_daq.csv", "--runs", "runs.csv")[1]["e_daq.csv"] == ["log_missing"]
    lacking = json.loads(call(main, "testbench", "list", "c", "--json").out)["not_stored"]
    assert lacking == ["r3: is in the run table and not stored: its log was not given"]
    table.write_text("file,run,motion\na_daq.csv,r1,right\nb_forces.csv,r1,right\nd_daq.csv,r2,left\n")
    assert ingest("d_daq.csv", "--runs", "runs.csv")[1]["a_daq.csv"] == ["conditions_differ"]


@pytest.fixture
def watch(ingest, tmp_path):
    """The same logs, put by name into a watched folder, and one pass of `testbench watch` over it."""
    (tmp_path / "in").mkdir()

    def run(*names, options=()):
        for name in names:
            (tmp_path / name).rename(tmp_path / "in" / name)
        return ingest("in", "--once", "--settle", "20ms", *options, command="watch")

    return run


def test_what_another_log_in_a_watched_folder_holds_is_not_missing(watch, tmp_path):
    """As with one `ingest` of both: a note in each run, nothing wrong, exit code 0."""
    both = {"a_daq.csv": ["sensor_elsewhere"], "b_forces.csv": ["sensor_elsewhere"]}
    assert watch("a_daq.csv", "b_forces.csv") == (0, both)
    (note,) = [f for f in open_run(tmp_path / "c" / "b_forces.h5").findings if f.code == "sensor_elsewhere"]
    assert note.message.startswith("sensors base_acc (logger daq) are in a_daq.csv, a run of its own")


def test_what_no_log_in_a_watched_folder_holds_is_missing(watch, tmp_path):
    """A log that is not there yet holds nothing, nor does one that was taken away; the one that comes later finds the
    first."""
    assert watch("a_daq.csv", "c_none.csv") == (1, {"a_daq.csv": ["sensor_not_recorded"], "c_none.csv": ["empty_file"]})
    (tmp_path / "in" / "c_none.csv").unlink()
    code, found = watch("b_forces.csv")
    assert (code, found["b_forces.csv"]) == (0, ["sensor_elsewhere"])
    (tmp_path / "in" / "a_daq.csv").unlink()
    (tmp_path / "in" / "b_forces.csv").rename(tmp_path / "in" / "d.csv")
    with (tmp_path / "in" / "d.csv").open("a") as log:
        log.write("0.4000,1.0000\n")
    assert watch() == (3, {"d.csv": ["sensor_not_recorded"]})


def test_with_a_sheet_only_the_run_counts_in_a_watched_folder(watch, tmp_path):
    """The sheet says which logs are one run, as for `ingest`."""
    (tmp_path / "runs.csv").write_text("file\na_daq.csv\nb_forces.csv\n")
    alone = {"a_daq.csv": ["sensor_not_recorded"], "b_forces.csv": ["sensor_not_recorded"]}
    assert watch("a_daq.csv", "b_forces.csv", options=("--runs", "runs.csv")) == (3, alone)


def test_a_watch_that_goes_on_looks_at_the_logs_that_are_there_now(ingest, tmp_path):
    """One process: a log that was taken away, or that says something else now, is no longer what it was."""
    (tmp_path / "in").mkdir()
    watching = Watch(tmp_path / "in", Ingest(tmp_path / "c", rigs.load_rig("rig.toml")), settle_s=0.02)
    forces = tmp_path / "in" / "b_forces.csv"
    (tmp_path / "b_forces.csv").rename(forces)
    text = (tmp_path / "a_daq.csv").read_text()

    def codes(name, rows):
        (tmp_path / "in" / name).write_text("\n".join(text.splitlines()[:rows]) + "\n")
        return [f.code for o in watching.once() if o.source == name for f in o.findings if f.code != "dialect"]

    assert codes("d.csv", 100) == ["sensor_elsewhere"]
    forces.write_text(forces.read_text().replace("Fz (N)", "Fq (N)"))
    assert codes("e.csv", 120) == ["sensor_not_recorded"]
    forces.write_text(forces.read_text().replace("Fq (N)", "Fz (N)"))
    assert codes("f.csv", 140) == ["sensor_elsewhere"]
    forces.unlink()
    assert codes("g.csv", 160) == ["sensor_not_recorded"]
