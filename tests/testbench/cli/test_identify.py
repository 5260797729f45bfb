"""``testbench identify``: one JSON document with units, tables for people, exit codes."""

import numpy as np
import pytest
from click.testing import CliRunner

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from testbench import rig as rigs
from testbench.cli.identify import identify
from testbench.errors import AnalysisError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun

from ...commands import invoke
from .gapped import without_rows

ARM = "two-joint-arm-a0"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A stored run of a simulated arm: a swing of both joints, torques of the shipped parameters without friction."""
    from balance.dynamics.regressor import torque_regressor

    folder = tmp_path_factory.mktemp("campaign")
    time = np.arange(0.0, 6.0, 0.005)
    omega = 2 * np.pi * np.array([0.31, 0.7, 1.1, 1.4, 1.73])
    wave = np.array([[0.3, -0.6], [0.7, 0.2], [0.2, 1.0], [0.4, -0.2], [-0.2, 0.4]])
    q = np.sin(np.outer(time, omega)) @ wave
    v = (np.cos(np.outer(time, omega)) * omega) @ wave
    a = (-np.sin(np.outer(time, omega)) * omega**2) @ wave
    model = load_mechanism(ARM)
    torque = torque_regressor(model, q, v, a) @ model.pi + np.random.default_rng(0).normal(0, 0.05, q.shape)
    log = folder / "swing.csv"
    table = np.column_stack([time, q, torque])
    np.savetxt(log, table, "%.9f", ",", header="# origin: simulated\ntime (s),pos1,pos2,tau1,tau2", comments="")
    assert Ingest(folder, rigs.load_rig(ARM)).run(PlannedRun("swing", (log,)))[0].status == "stored"
    return folder / "swing.h5"


@pytest.fixture(scope="module")
def found(run):
    """The document of the command, MECH as the rig names it."""
    return invoke(identify, run, "--json", "--budget").json


def test_document(found):
    """Keys and units of the JSON document; masses are not observable, first moments are near the truth."""
    assert {"parameters", "base_parameters", "validation", "verdict", "counter_masses", "cutoff"} <= set(found)
    by_name = {row["name"]: row for row in found["parameters"]}
    assert by_name["m[link_2]"] == {"name": "m[link_2]", "value": None, "interval": None, "observable": False}
    assert by_name["mcx[link_2]"]["observable"]
    assert by_name["mcx[link_2]"]["value"] == pytest.approx(0.11106, rel=0.03)
    first = found["first_moments"][0]
    assert first["name"] == "mcx[link_1] + 0.3 m[link_2]"
    assert first["unit"] == "kg m"
    assert first["interval"][0] < first["value"] < first["interval"][1]
    assert set(found["validation"]["rms_ratio"]) == {"J1", "J2"}
    assert found["origin"] == "simulated"
    assert found["counter_masses"][1]["first_moment_kgm"] == pytest.approx(0.1 * found["counter_masses"][1]["mass_kg"])
    assert found["verdict"] == "usable up to a torque scale"
    assert found["doubt_codes"] == found["doubts"] == []
    assert found["first_moment_ratios"][1]["name"] == "mcx[link_2] / mcx[link_1] + 0.3 m[link_2]"
    low, high = found["first_moment_ratios"][1]["interval"]
    assert low < 0.11106 / 0.34912 < high
    assert "held-out" in found["cutoff"]["rule"]
    for value, budget in zip(found["first_moments"], found["budget"], strict=True):
        low, high = value["interval"]
        assert budget["quantity"] == value["name"]
        assert 0.2 * (high - low) < budget["expanded_uncertainty"] < 0.6 * (high - low)


def test_tables_and_figure(run, tmp_path):
    """The verdict comes first, then its scale, the combination, its interval, the unexplained torque; and a figure."""
    text = invoke(identify, ARM, run, "--method", "ls", "--figure", tmp_path / "torque.svg", "--all").out
    for words in ("mcx[link_1] + 0.3 m[link_2]", "origin simulated", "RMS ratio below cutoff", "ratios of first"):
        assert words in text
    assert text.startswith("Verdict: usable up to a torque scale; ")
    assert "counter_link_1" in text
    assert (tmp_path / "torque.svg").read_text("utf-8").startswith("<?xml")


def test_doubtful_results_exit_with_3(run, tmp_path):
    """Torques of exchanged joints are no bodies' torques: doubts with codes, and the exit code says so."""
    rig = datasets.find_dataset(ARM, "rigs", ".toml").read_text("utf-8")
    swapped = tmp_path / "swapped.toml"
    swapped.write_text(rig.replace('"tau1"', '"x"').replace('"tau2"', '"tau1"').replace('"x"', '"tau2"'), "utf-8")
    found = invoke(identify, ARM, run, "--rig", swapped, "--method", "ls", "--json", code=3).json
    assert found["verdict"] == "doubtful"
    assert {"no_such_bodies", "slip"} & set(found["doubt_codes"])
    assert len(found["doubts"]) == len(found["doubt_codes"])
    shown = invoke(identify, ARM, run, "--rig", swapped, "--method", "ls", code=3).out
    assert "Do not build on it: mend what is named below the tables" in " ".join(shown.split("\n\n")[0].split())
    assert "-0.0000" not in shown


def test_a_run_of_another_mechanism_is_refused(run):
    """A run whose rig is of another mechanism is refused; where that is accepted, the joint that lacks is named."""
    with pytest.raises(AnalysisError, match=r"rig is of 'two-joint-arm-a0', expected 'parallelogram-6bar'"):
        invoke(identify, "parallelogram-6bar", run)
    with pytest.raises(AnalysisError, match="on joint 'A0'"):
        invoke(identify, "parallelogram-6bar", run, "--accept", "mechanism_differs")


def test_the_same_machine_by_another_name(run, tmp_path):
    """A copy of the mechanism's file under another name is another mechanism until a person accepts it."""
    other = tmp_path / "my-arm.xml"
    other.write_text(datasets.find_dataset(ARM, "mechanisms", ".xml").read_text("utf-8"), "utf-8")
    with pytest.raises(AnalysisError, match="expected 'my-arm'"):
        invoke(identify, other, run)
    found = invoke(identify, other, run, "--accept", "mechanism_differs", "--method", "ls", "--json").json
    assert found["method"]["name"] == "ls"


def test_no_run_is_a_wrong_command_line():
    """Without a run the command line is wrong."""
    done = CliRunner().invoke(identify, [ARM])
    assert done.exit_code == 2
    assert "RUN..." in done.stderr


def test_a_gap_is_left_out_and_said(run, found, tmp_path):
    """Half a second lost: values as of the whole record, known to a fiftieth, and what is left out is said."""
    lines = (run.parent / "swing.csv").read_text("utf-8").splitlines(keepends=True)
    log = tmp_path / "paused.csv"
    log.write_text("".join([*lines[:2], *(x for x in lines[2:] if not 2.5 <= float(x.split(",")[0]) < 3.0)]), "utf-8")
    assert Ingest(tmp_path, rigs.load_rig(ARM)).run(PlannedRun("paused", (log,)))[0].status == "stored"
    whole, found = found, invoke(identify, ARM, tmp_path / "paused.h5", "--json", code=3).json
    assert found["verdict"] == "usable up to a torque scale"
    (finding,) = found["findings"]
    assert finding["code"] == "time_gap"
    assert (
        "paused: 1 gap in the record of paused, 0.505 s in all, the first after 2.495 s: left out" in finding["message"]
    )
    for one, other in zip(found["first_moments"], whole["first_moments"], strict=True):
        assert one["interval"][0] < other["value"] < one["interval"][1]
        assert one["interval"][0] < one["in_file"] < one["interval"][1]
        half = 0.5 * (one["interval"][1] - one["interval"][0])
        assert half < 0.02 * max(row["value"] for row in found["first_moments"])


def test_a_gap_through_loops_and_loggers(pair_built, tmp_path):
    """Force sensors and encoders of their own clocks, a gap in the encoders': first moments as built, and a finding."""
    campaign = without_rows(pair_built, tmp_path / "gapped", {"r002_controller.csv": (0.5, 0.65)})
    found = invoke(identify, "parallelogram-6bar", campaign, "--by", "wrench", "--json", code=3).json
    assert [f["message"][:33] for f in found["findings"]] == ["r002: 1 gap in the record of r002"]
    for moment in found["first_moments"]:
        assert moment["interval"][0] < moment["in_file"] < moment["interval"][1]
        assert moment["interval"][1] - moment["interval"][0] < 0.01
