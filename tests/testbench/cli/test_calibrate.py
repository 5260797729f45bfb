"""``testbench calibrate``: what is recorded, what holds since when, and that each command says what it applied."""

import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import click
import numpy as np
import pytest

from testbench.cli import main
from testbench.cli.calibrate import calibrate
from testbench.cli.campaign import export, verify
from testbench.errors import RigError
from testbench.runs.si_run import physical
from testbench.store import open_run

from ...commands import call, invoke
from ..calibration import volts


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two runs of one bench, in volts."""
    folder, rig = tmp_path_factory.mktemp("made"), volts.HEAD + volts.SENSITIVITY + volts.SIX
    volts.stored(folder, rig, name="r1")
    volts.stored(folder, rig, name="r2", first=2.6)
    return folder / "campaign"


@pytest.fixture
def campaign(made, tmp_path):
    """A copy of one's own."""
    return shutil.copytree(made, tmp_path / "campaign")


def said(*words):
    """The document that the command prints."""
    return invoke(calibrate, *words, "--json").json


def test_what_holds_and_since_when(campaign):
    """The rig's at first; then the newest record for each run; older ones stay on the list."""
    (held,) = said(campaign, "--list")["holds"]
    assert (held["sensor"], held["from"], held["runs"]) == ("acc", "rig", ["r1", "r2"])
    why = ("--reason", "certificate 12")
    done = said(campaign, "acc", "--sensitivity", "90 mV/g", "--offset", "2.5 V", "--date", "2026-03-31", *why)
    assert done["runs"] == ["r1", "r2"]
    assert done["calibration"] == {"sensitivity": "90 mV/g", "offset": "2.5 V", "date": "2026-03-31"}
    second = said(campaign / "r2", "acc", "--sensitivity", "x=80 mV/g", *why)
    listed = said(campaign, "--list")
    assert [(h["from"], h["runs"]) for h in listed["holds"]] == [
        (done["record"].split("/")[-1], ["r1"]), (second["record"].split("/")[-1], ["r2"]),
    ]  # fmt: skip
    assert [r["holds_for"] for r in listed["records"]] == [["r1"], ["r2"]]
    assert [r["reason"] for r in listed["records"]] == ["certificate 12"] * 2
    assert "holds for r1" in invoke(calibrate, campaign, "--list").out


def test_a_record_that_changes_nothing_is_told_so(campaign):
    """The same sensitivity in another unit; a tenth of it does change the readings, and so does the first one after."""
    why, same = ("--reason", "certificate 12"), "It changes no reading"
    rig = tomllib.loads(open_run(campaign / "r1.h5").rig)["sensors"]["acc"]["calibration"]["sensitivity"]
    offset = ("--offset", "2500 mV")
    for sensitivity, changes in ((rig, False), ("9 mV/g", True), ("0.009 V/g", False)):
        words = [campaign, "acc", "--sensitivity", sensitivity, *offset, *why]
        assert said(*words)["changes_readings"] is changes
    assert same in invoke(calibrate, *words).out


def test_a_matrix_of_a_file(campaign, tmp_path):
    """Rows of numbers, with a comment and decimal commas; the loads come back."""
    rows = [";".join(f"{value!r}".replace(".", ",") for value in row) for row in volts.PER_VOLT.tolist()]
    (tmp_path / "cross.csv").write_text("# N/V and N m/V\n" + "\n".join(rows) + "\n")
    units = ("--raw", "V", "--physical", "F=N", "--physical", "M=N m", "--reason", "sheet")
    said(campaign, "six", "--matrix", tmp_path / "cross.csv", *units)
    run = physical(open_run(campaign / "r1.h5"))
    np.testing.assert_allclose(run.channel("ch6"), volts.LOADS[5], atol=1e-7)
    (tmp_path / "cross.csv").write_text("1,2,x\n")
    with pytest.raises(RigError, match=r"cross\.csv, line 1: 'x' is no number"):
        said(campaign, "six", "--matrix", tmp_path / "cross.csv", *units)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["acc", "--sensitivity", "1 mV/g"], "--reason is missing"),
        (["acc", "--reason", "x"], "expected one of sensitivity"),
        (["acc", "--sensitivity", "1 mV/g", "--polynomial", "0,1", "--raw", "V", "--physical", "N", "--reason", "x"],
         "expected one of"),
        (["acc", "--polynomial", "0,1", "--reason", "x"], "need --raw and --physical"),
        (["acc", "--polynomial", "0,y", "--raw", "V", "--physical", "N", "--reason", "x"], "--polynomial"),
        (["acc", "--sensitivity", "1 mV/g", "--date", "31.3.26", "--reason", "x"], "such as 2026-03-31"),
        (["acc", "--sensitivity", "x=1 mV/g", "--sensitivity", "2 mV/g", "--reason", "x"], "AXIS=TEXT"),
        (["acc", "--sensitivity", "1 mV/g", "--physical", "N", "--reason", "x"], "go with --matrix"),
        ([], "then SENSOR"),
    ],
)  # fmt: skip
def test_a_wrong_command_line(campaign, words, message):
    """What is wrong is named, and nothing is recorded."""
    with pytest.raises(click.UsageError, match=message):
        invoke(calibrate, campaign, *words)
    assert not (campaign / "records").exists()


def test_export_in_si_says_by_what(tmp_path):
    """Values, unit and calibration are in the table; as recorded, neither; a crate holds runs as they are."""
    campaign = volts.stored(tmp_path, volts.HEAD + volts.SENSITIVITY).path.parent
    words = (export, campaign / "r1.h5", "--to", "csv", "--json")
    document = invoke(*words, "-o", tmp_path / "si", "--physical").json
    assert [h["from"] for h in document["calibrations"]] == ["rig"]
    text = (tmp_path / "si" / "r1.csv").read_text("utf-8")
    assert "ch0 (m/s^2)" in text
    assert "100 mV/g, offset 2.5 V" in text
    assert invoke(*words, "-o", tmp_path / "raw").json["calibrations"] == []
    assert "ch0 (V)" in (tmp_path / "raw" / "r1.csv").read_text("utf-8")
    with pytest.raises(click.UsageError, match="crate"):
        invoke(export, campaign, "--to", "ro-crate", "-o", tmp_path, "--physical")


def test_raw_values_are_not_exported_as_physical(campaign, tmp_path):
    """A sensor without a calibration has no value in SI: refused, with what to do."""
    done = invoke(export, campaign / "r1.h5", "--to", "csv", "-o", tmp_path / "si", "--physical", code=1)
    assert re.search(r"ch1.*testbench calibrate", done.err)
    assert not list((tmp_path / "si").iterdir())


def test_verify_reads_the_records(campaign):
    """A calibration that was edited afterwards is damage, like that of a run."""
    done = said(campaign, "acc", "--sensitivity", "90 mV/g", "--reason", "yearly")
    invoke(verify, campaign)
    record = Path(done["record"])
    record.write_text(record.read_text("utf-8").replace("90 mV/g", "80 mV/g"), encoding="utf-8")
    files = invoke(verify, campaign, "--json", code=1).json["files"]
    (state,) = [file for file in files if file["status"] != "intact"]
    assert record.name in state["message"]


def test_a_log_in_physical_units_already_is_told_so(brief, tmp_path):
    """What the log holds, what the calibration takes, and what to do; nothing is recorded."""
    folder = shutil.copytree(brief.campaign, tmp_path / "campaign")
    for words in (
        ["base_acc", "--sensitivity", "10.2 mV/g"],
        ["kistler", "--sensitivity", "3.9 pC/N", "--amplifier", "100 pC/V"],
        ["futek_1", "--polynomial", "0,250,1.3", "--raw", "V", "--physical", "N"],
    ):
        unit = "g" if words[0] == "base_acc" else "N"
        with pytest.raises(RigError, match=rf"in '{unit}', which is .* already: leave .* '1.02 {unit}/{unit}'") as told:
            said(folder, *words, "--reason", "x")
        assert "a log in V" in str(told.value) or "takes 'V'" in str(told.value)
    assert not (folder / "records").exists()


def test_the_examples_of_the_help_work_on_simulated_logs(brief, tmp_path, monkeypatch):
    """As typed: those for logs in physical units, in the folder that holds the campaign."""
    shutil.copytree(brief.campaign, tmp_path / "campaign")
    monkeypatch.chdir(tmp_path)
    examples = calibrate.epilog.split("And for logs in volts")[0].splitlines()
    typed = [shlex.split(line)[2:] for line in examples if line.startswith("  testbench calibrate ")]
    assert len(typed) == 3
    out = "".join(invoke(calibrate, *words).out for words in typed)
    assert "1.02 g/g" in out
    assert "offset x -0.6 N" in out


@pytest.mark.parametrize("damage", ["overwritten", "cut", "no digest", "other digest"])
def test_a_damaged_run_keeps_no_other_out(campaign, damage):
    """The intact run is calibrated; the damaged one is named with what to do, and the correction is not about it."""
    broken = campaign / "r2.h5"
    if damage == "overwritten":
        broken.write_text("not a run")
    elif damage == "cut":
        broken.write_bytes(broken.read_bytes()[:-3000])
    elif damage == "no digest":
        broken.with_name("r2.h5.sha256").unlink()
    else:
        broken.with_name("r2.h5.sha256").write_text("not a digest")
    words = (campaign, "acc", "--sensitivity", "90 mV/g", "--offset", "2.5 V", "--reason", "yearly")
    code, out, err = call(main, "testbench", "calibrate", *words)
    assert (code, "from now on for r1." in out) == (3, True)
    assert re.search(r"r2.*r2 is left out: `testbench verify` tells .* ingest its logs again, and calibrate it", err)
    (record,) = (campaign / "records").iterdir()
    assert list(json.loads(record.read_text("utf-8"))["runs"]) == ["r1.h5"]
    # 100 mV/g in the rig: 90 mV/g make the same volts 100 / 90 times the acceleration
    np.testing.assert_allclose(
        physical(open_run(campaign / "r1.h5")).channel("ch0")[1:], volts.ACCELERATION[1:] * 100 / 90, atol=1e-7
    )
    code, out, err = call(main, "testbench", "calibrate", *words, "--json")
    assert (code, json.loads(out)["runs"], "r2" in err) == (3, ["r1"], True)
    assert [(one["run"], one["status"]) for one in json.loads(out)["refused"]] == [("r2", "refused")]
    if damage in {"overwritten", "cut"}:
        code, out, err = call(main, "testbench", "calibrate", campaign, "--list", "--json")
        assert (code, [one["run"] for one in json.loads(out)["refused"]]) == (3, ["r2"])
        assert [held["runs"] for held in json.loads(out)["holds"]] == [["r1"]]


def test_nothing_is_recorded_where_every_run_is_damaged(campaign, tmp_path):
    """Each is named; a place where nothing is, and a folder without runs, are refused as such."""
    for name in ("r1", "r2"):
        (campaign / f"{name}.h5").write_text("not a run")
    words = ("acc", "--sensitivity", "90 mV/g", "--reason", "yearly")
    code, out, err = call(main, "testbench", "calibrate", campaign, *words)
    assert (code, out, err.count("is left out")) == (1, "", 2)
    assert not (campaign / "records").exists()
    (tmp_path / "empty").mkdir()
    for place, said in (("nope", "no such file"), ("empty", "holds no run")):
        code, _, err = call(main, "testbench", "calibrate", tmp_path / place, *words)
        assert (code, said in err, "left out" in err) == (1, True, False)
