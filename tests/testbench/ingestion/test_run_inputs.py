"""What a run was made with is stored with it: a campaign needs no other folder, and opens none."""

import shutil

import numpy as np
import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion, motion_from_texts
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.ingestion.run_inputs import run_inputs
from testbench.kinematics.encoder_motion import stored_mechanism
from testbench.rig import load_rig
from testbench.store import open_run
from testbench.store.archive import archive

RIG = """
mechanism = "arm.xml"
[loggers.daq]
[sensors.encoder]
kind = "encoder"
logger = "daq"
channel = "angle"
joint = "J1"
unit = "rad"
"""
MOTION = 'driven = "joints"\njoints = ["J1"]\nsamples = "swing.csv"\n'
SWING = "time (s),J1 (deg)\n" + "".join(f"{0.1 * i:g},{i * i}\n" for i in range(8))


@pytest.fixture
def folder(tmp_path):
    """A machine of one's own: a mechanism of two files, a motion of samples, a rig, a run table, a log."""
    text = (datasets.ROOT / "mechanisms" / "serial-1r.xml").read_text()
    head, body = text.split("<worldbody>")
    inner, tail = body.split("</worldbody>")
    (tmp_path / "arm.xml").write_text(f'{head}<include file="bodies.xml"/>{tail}')
    (tmp_path / "bodies.xml").write_text(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
    for name, content in {"rig.toml": RIG, "swing.toml": MOTION, "swing.csv": SWING}.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "runs.csv").write_text("file,motion\nlog.csv,swing\n")
    (tmp_path / "log.csv").write_text("time (s),angle (rad)\n" + "".join(f"{i / 100},{i % 3}\n" for i in range(99)))
    return tmp_path


def stored(folder):
    """The run that ingest makes of the folder, whose files are then gone."""
    expected = load_mechanism(folder / "arm.xml"), load_motion(folder / "swing.toml")
    (planned,) = plan_runs([folder / "log.csv"], folder / "runs.csv")
    (outcome,) = Ingest(folder / "campaign", load_rig(folder / "rig.toml")).run(planned)
    assert outcome.status == "stored"
    assert max(finding.severity for finding in outcome.findings) == 0
    shutil.move(folder / "campaign", folder / "elsewhere")
    for path in folder.glob("*.*"):
        path.unlink()
    return open_run(folder / "elsewhere" / outcome.file), *expected


def test_mechanism_and_motion_come_back(folder):
    """From the run alone, and from its archive: the same masses, the same samples."""
    run, mechanism, motion = stored(folder)
    archived = open_run(archive(run, folder / "archive").file)
    for one in (run, archived):
        again, moved = stored_mechanism(*one.inputs["mechanism"]), motion_from_texts(*one.inputs["motion"])
        assert again.total_mass == mechanism.total_mass
        assert again.bodies == mechanism.bodies
        assert np.array_equal(moved.recorded.position, motion.recorded.position)


def test_a_label_is_no_file(folder):
    """A motion of which there is no file is a label; one outside the folder is not looked for, which is said."""
    (folder / "inner").mkdir()
    for name in ("as by hand", "../swing", str(folder / "swing.toml")):
        inputs, findings = run_inputs(None, {"motion": name}, [folder / "inner"])
        assert inputs == {}
        assert [one.code for one in findings] == ["unknown_motion"] * name.endswith(".toml")
    assert "motion" in run_inputs(None, {"motion": "swing"}, [folder])[0]


@pytest.mark.parametrize("file", ["bodies.xml", "arm.xml"])
def test_what_cannot_be_read_is_said(folder, file):
    """The log is stored nevertheless, and the finding names file and reason: of a part, or of the one file there is."""
    (folder / "swing.csv").unlink()
    hinge = (datasets.ROOT / "mechanisms" / "serial-1r.xml").read_text()
    (folder / file).write_text("<mujoco" if file == "bodies.xml" else hinge.replace("hinge", "hinj"))
    (planned,) = plan_runs([folder / "log.csv"], folder / "runs.csv")
    (outcome,) = Ingest(folder / "campaign", load_rig(folder / "rig.toml")).run(planned)
    assert outcome.status == "stored"
    said = [finding.message for finding in outcome.findings if finding.code == "input_not_stored"]
    assert [name in message for name, message in zip(("arm.xml", "swing.csv"), said, strict=True)] == [True, True]


def test_a_payload_that_nothing_carries_is_said(folder):
    """Where no body is named for it, the finding says how to state it by body or site."""
    (folder / "none.xml").write_text((folder / "arm.xml").read_text())
    rig = load_rig(folder / "rig.toml")
    _, findings = run_inputs(rig, {"payload_kg": 0.5}, [folder])
    assert [finding.code for finding in findings] == ["condition_contradiction"]
    assert "payload_" in findings[0].message
    assert run_inputs(rig, {"payloads": {"tip": 0.5}}, [folder])[1] == []


@pytest.mark.parametrize(
    ("motion", "stated", "said"),
    [
        ("swing", "peak_acceleration_g", "state peak_acceleration_rad_s2"),
        ("swing", "peak_acceleration_rad_s2", None),
        ("x", "peak_acceleration_rad_s2", "state peak_acceleration_g"),
        ("x", "peak_acceleration_g", None),
    ],
)
def test_a_peak_of_another_kind_is_said(folder, motion, stated, said):
    """g0 of joints that turn, rad/s2 of a point: a finding that names the right column; the log is stored."""
    _, findings = run_inputs(None, {"motion": motion, stated: 3.0}, [folder])
    assert [finding.code for finding in findings] == ["condition_contradiction"] * (said is not None)
    assert said is None or said in findings[0].message
