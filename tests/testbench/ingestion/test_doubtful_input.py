"""Logs and run tables that leave open what was measured: said with the cure, and no number from them."""

import numpy as np
import pytest

from testbench.cli import main
from testbench.ingestion.planned_runs import is_run_table, plan_runs
from tests.commands import call

RIG = """name = "bench"
mechanism = "none"
[loggers.daq]
[sensors.base]
kind = "accelerometer"
logger = "daq"
channels = { x = "ax" }
position = ["0 m", "0 m", "0 m"]
"""
MOTION = 'driven = "platform"\nstart = ["0 m", "0.2 m"]\npeak_acceleration = "1 m/s^2"\nrest = "0.5 s"\n'
MOTION += 'moves = [ { axis = "x", to = ["+40 mm", "0 mm"] } ]\n'


def log(header, step=1e-3, count=2000, columns=1, above=""):
    """A log of noise in so many columns beside its time."""
    rows = np.column_stack([step * np.arange(count), *np.random.default_rng(1).normal(size=(columns, count))])
    return above + header + "\n" + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows) + "\n"


@pytest.fixture
def ingest(tmp_path, monkeypatch):
    """Ingest of a log by a run table of one run, in a folder with a rig and a motion of 1.6 s."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "slide.toml").write_text(MOTION)

    def made(text, *options, motion="", name="log.csv", run="r"):
        (tmp_path / name).write_text(text)
        (tmp_path / "runs.csv").write_text(f"run,file,motion\n{run},{name},{motion}\n")
        return call(main, "testbench", "ingest", name, "--runs", "runs.csv", "-o", "c", *options)

    return made


@pytest.mark.parametrize(
    ("header", "cure"), [("Time (s),ax (g),ax (g)", '"channel 3" = '), ("Time (s),ax (g),ax (V)", "'ax (g)'")]
)
def test_a_sensor_whose_name_several_channels_have_is_refused(ingest, header, cure):
    """Of one name and unit, or of one name alone: the channels are named by place, and the cure."""
    found = ingest(log(header, columns=2), "--rig", "rig.toml")
    assert (found.code, "sensors.base" in found.out, cure in found.out) == (1, True, True)
    assert "channel 2" in found.out


def test_the_cure_that_is_said_leaves_the_name_to_one(ingest, tmp_path):
    """A place in an import description renames one of several; a channel that has a name of its own it never does."""
    (tmp_path / "as.toml").write_text('[channels]\n"channel 3" = "spare (g)"\n')
    found = ingest(log("Time (s),ax (g),ax (g)", columns=2), "--rig", "rig.toml", "--as", "as.toml")
    assert found.code == 0
    refused = ingest(log("Time (s),ax (g),ay (g)", columns=2), "--as", "as.toml", name="other.csv", run="s")
    assert "channel_not_found" in refused.out  # a place names only what its name does not tell


@pytest.mark.parametrize(
    ("header", "step", "motion", "rig", "code"),
    [
        ("Time (s),ax (g)", 1e-3, "slide", "", None),
        ("Time (ms),ax (g)", 1e-3, "slide", "", "duration_contradiction"),  # values in seconds
        ("time,ax (g)", 1e-3, "slide", "", "time_unit_confirmed"),
        ("time,ax (g)", 1.0, "slide", "", "time_unit_contradiction"),  # values in milliseconds
        ("time,ax (g)", 1e-3, "", "", "time_unit_assumed"),
        ("time,ax (g)", 1e-3, "", 'rate = "1 kHz"', "time_unit_confirmed"),
        ("time,ax (g)", 1.0, "", 'rate = "1 kHz"', "time_unit_contradiction"),
        ("Time (s),ax (g)", 1e-3, "slde", "", "unknown_motion"),
        ("Time (s),ax (g)", 1e-3, "by hand", "", None),
    ],
)
def test_what_time_and_motion_say_of_each_other(ingest, tmp_path, header, step, motion, rig, code):
    """A motion of 1.6 s and a log of 2 s: which unit the time is in, or that nothing shows it."""
    (tmp_path / "rig.toml").write_text(RIG.replace("[loggers.daq]", f"[loggers.daq]\n{rig}"))
    found = ingest(log(header, step), "--rig", "rig.toml", "--json", motion=motion)
    kept = {"duration_contradiction", "time_unit_confirmed", "time_unit_assumed", "unknown_motion"}
    kept |= {"time_unit_contradiction"}
    assert {one for one in kept if f'"{one}"' in found.out} == ({code} if code else set())
    assert (found.code == 1) is (code == "time_unit_contradiction")


def test_a_header_of_any_length_is_read_where_its_lines_are_stated(ingest, tmp_path):
    """Lines that are stated are read where they are."""
    text = log("Time (s),ax (g)", above="".join(f"Setting {i}: x\n" for i in range(700)))
    assert "data = LINE" in ingest(text).err
    (tmp_path / "as.toml").write_text("names = 701\ndata = 702\n")
    assert ingest(text, "--as", "as.toml").code == 0


def test_other_run_tables_among_the_logs_are_no_logs(ingest, tmp_path):
    """A pattern that catches a copy, or an older run table, refuses nothing."""
    (tmp_path / "copy.csv").write_text("run,file,motion\nr,log.csv,\n")
    found = ingest(log("Time (s),ax (g)"), "copy.csv")
    assert (found.code, "copy of the run table" in found.err) == (0, True)
    (tmp_path / "old.csv").write_text("run,file\nr,log.csv\n")
    assert "is a run table" in ingest(log("Time (s),ax (g)"), "old.csv").err


def test_a_log_with_columns_of_a_run_table_is_a_log(tmp_path):
    """Its rows are numbers; given twice by overlapping patterns it is one run."""
    merged = tmp_path / "merged.csv"
    merged.write_text(log("Time (s),x (m),run,file_index", columns=3))
    assert not is_run_table(merged)
    assert [run.name for run in plan_runs([merged, tmp_path / "." / "merged.csv"], None)] == ["merged"]
