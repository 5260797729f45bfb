"""A project of one's own machine: valid as written, and everything wrong in it said at once."""

import json

import pytest

from balance import datasets
from testbench.campaign_plan import load_plan
from testbench.errors import RigError
from testbench.ingest.run_table import read_run_table
from testbench.project import new_project, project_problems
from testbench.rig import load_rig
from testbench.rig.sensors import Encoder


@pytest.mark.parametrize(("mechanism", "loggers"), [("five-bar", 2), ("scara-quill", 1), ("bennett", 2)])
def test_what_is_written_is_valid(tmp_path, mechanism, loggers):
    """Whatever the mechanism's joints: files that load, a motion that it can follow, a table of the planned runs."""
    folder = tmp_path / "test"
    files = new_project(folder, mechanism, loggers)
    assert sorted(path.name for path in folder.iterdir()) == sorted(files)
    assert [p for p in project_problems(folder) if "nothing can be compared" not in p.message] == []
    plan, rig = load_plan(folder / "plan.toml"), load_rig(folder / "rig.toml")
    assert {row.run for row in read_run_table(folder / "runs.csv")} == {run.name for run in plan.runs()}
    assert len(rig.loggers) == loggers
    assert {sensor.joint for sensor in rig.of_kind(Encoder).values()}


def test_it_runs_at_once(command, tmp_path, monkeypatch):
    """By the commands of its README: simulated logs, stored, analysed and compared, from the folder alone."""
    assert command("new", tmp_path / "test", "--from", "four-bar")[0] == 0
    monkeypatch.chdir(tmp_path / "test")
    assert command("check", ".")[0] == 0
    assert command("simulate", "--plan", "plan.toml", "--rig", "rig.toml", "-o", "logs")[0] == 0
    logs = sorted((tmp_path / "test" / "logs").glob("r*.csv"))
    words = ("--rig", "rig.toml", "--runs", "logs/runs.csv", "-o", "campaign")
    assert command("ingest", *logs, *words)[0] in (0, 3)
    (tmp_path / "test" / "campaign").rename(tmp_path / "campaign")
    monkeypatch.chdir(tmp_path)
    code, out, _ = command("compare", "campaign", "--json")
    rows = {row["axis"]: row for row in json.loads(out)["rows"]}
    assert code in (0, 3)
    assert rows["x"]["simulated_percent"] == pytest.approx(rows["x"]["analyzed_percent"], abs=3.0)
    assert rows["x"]["published_percent"] is None


def test_a_machine_of_several_files(tmp_path):
    """What is written is one file, whatever the mechanism was made of."""
    text = (datasets.ROOT / "mechanisms" / "serial-1r.xml").read_text()
    head, body = text.split("<worldbody>")
    inner, tail = body.split("</worldbody>")
    (tmp_path / "arm.xml").write_text(f'{head}<include file="bodies.xml"/>{tail}')
    (tmp_path / "bodies.xml").write_text(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
    new_project(tmp_path / "test", str(tmp_path / "arm.xml"))
    assert "<include" not in (tmp_path / "test" / "arm.xml").read_text()


BROKEN = {
    "rig.toml": ('joint = "A"', 'joint = "Q"', "has no joint 'Q'"),
    "plan.toml": ('motion = "motion"', 'motion = "moton"', "moton"),
    "runs.csv": ("counter_A0A", "counter_A0Z", "counter_A0Z"),
    "motion.toml": ("15 deg", "15 kg", "kg"),
    "four-bar.xml": ("</worldbody>", "", "four-bar.xml"),
}


@pytest.mark.parametrize("file", BROKEN)
def test_what_is_wrong_is_said(tmp_path, file):
    """Each file by name, with what is wrong in it; nothing stops at the first."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    old, new, said = BROKEN[file]
    text = (folder / file).read_text()
    joint = load_rig(folder / "rig.toml").of_kind(Encoder).popitem()[1].joint
    old = old.replace('"A"', f'"{joint}"')
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    problems = project_problems(folder)
    assert any(said in problem.message for problem in problems), problems


def test_a_folder_in_use(tmp_path):
    """Nothing is overwritten; and what is not there is said with what to do."""
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RigError, match="not empty; name a new folder"):
        new_project(tmp_path, "four-bar")
    with pytest.raises(RigError, match="testbench new"):
        project_problems(tmp_path / "nowhere")
