"""The truth lies beside the logs, holds what was drawn, and no analysis reads it."""

import ast
import json
import shutil
from pathlib import Path

import numpy as np
import polars
import pytest
from click.testing import CliRunner

import testbench
from testbench import campaign_plan as plans
from testbench import rig as rigs
from testbench.cli.align import align
from testbench.cli.analyze import analyze, compare
from testbench.cli.trim import trim
from testbench.simulator import campaign
from testbench.simulator.sensors import draw_transducers

from ..conftest import call as command

PLAN = """
mechanism = "parallelogram-6bar"
seed = 11
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.2626 kg" }
motion = "x"
peak_acceleration = "3 g0"
"""
RIG = "parallelogram-6bar-deep"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A condition on the deep rig: logs with their truth, and the campaign that was ingested from them."""
    folder = tmp_path_factory.mktemp("deep")
    campaign.simulate_campaign(plans.plan_from_text(PLAN), rigs.load_rig(RIG), folder / "logs")
    logs = sorted((folder / "logs").glob("r*_*.csv"))
    ingested = command("ingest", *logs, "--rig", RIG, "--runs", folder / "logs" / "runs.csv", "-o", folder / "campaign")
    assert ingested.returncode in {0, 3}
    return folder


def analysed(folder: Path) -> list[str]:
    """What the analyses of a campaign say."""
    runs = sorted((folder / "campaign").glob("*.h5"))
    calls = (
        (analyze, folder / "campaign", "--json"),
        (compare, folder / "campaign", "--published", "kiper2019", "--json"),
        (align, *runs, "--json", "--dry-run"),
        (trim, "parallelogram-6bar", runs[-1], "--json"),
    )
    found = [CliRunner().invoke(call, [str(word) for word in words]) for call, *words in calls]
    return [f"{done.output}{done.exception!r}" for done in found]


def test_analysis_never_sees_it(made):
    """With the truth gone, every analysis says the same, byte for byte; so it does when the truth tells lies."""
    before = analysed(made)
    assert all("reductions" in text for text in before[:2])
    shutil.move(made / "logs" / "truth", made / "elsewhere")
    (made / "logs" / "truth").mkdir()
    (made / "logs" / "truth" / "truth.json").write_text("not what happened", encoding="utf-8")
    try:
        assert analysed(made) == before
    finally:
        shutil.rmtree(made / "logs" / "truth")
        shutil.move(made / "elsewhere", made / "logs" / "truth")


def test_nothing_drawn_is_stored(made):
    """A stored run holds what the rig states, and no value that was drawn: no start, no sensitivity."""
    truth = json.loads((made / "logs" / "truth" / "truth.json").read_text("utf-8"))
    drawn = [repr(truth["runs"][0]["clocks"]["daq"]["start_s"])]
    drawn += [
        repr(row[i]) for s in truth["sensors"].values() for i, row in enumerate(s["sensitivity_si"]) if row[i] != 1.0
    ]
    assert len(drawn) > 10
    for path in sorted((made / "campaign").rglob("*.h5")):
        stored = path.read_bytes()
        assert not [value for value in drawn if value.encode() in stored]


def test_who_imports_it():
    """Outside the simulator and its command, no module imports campaigns, drawn sensors or recorded runs."""
    root = Path(testbench.__file__).parent
    hidden = {"campaign", "simulated_logs", "draw_transducers", "draw_samples", "disturbed", "record_run"}
    for path in sorted(root.rglob("*.py")):
        if path.parent.name == "simulator" or path == root / "cli" / "simulate.py":
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and "simulator" in (node.module or "").split("."):
                names = {alias.name for alias in node.names} | set((node.module or "").split("."))
                assert not names & hidden, f"{path.name} imports {names & hidden} of the simulator"


def test_what_it_says(made):
    """Clocks of each run, sensors of the campaign, and what is out of balance, as what happened."""
    truth = json.loads((made / "logs" / "truth" / "truth.json").read_text("utf-8"))
    assert truth["origin"] == "simulated"
    balanced, bare = truth["runs"]
    # 24.276118 kg balance 5 kg: the built 24.2626 kg miss by their difference at 37.55 mm
    assert np.abs(balanced["first_moment_residual_kg_m"]).max() == pytest.approx(
        0.03755 * (24.276118 - 24.2626), rel=1e-3
    )
    assert np.abs(bare["first_moment_residual_kg_m"]).max() == pytest.approx(0.03755 * 24.276118, rel=1e-5)
    assert balanced["clocks"]["daq"]["start_s"] != bare["clocks"]["daq"]["start_s"]
    sensor = draw_transducers(rigs.load_rig(RIG), 11)["kistler"]
    assert truth["sensors"]["kistler"]["sensitivity_si"] == sensor.sensitivity.tolist()
    assert truth["sensors"]["kistler"]["drift_si_per_s"] == sensor.drift.tolist()


def test_time_series(made):
    """The base's motion in the truth is what its own accelerations integrate to."""
    table = polars.read_parquet(made / "logs" / "truth" / "r002.parquet")
    step = table["time_s"][1] - table["time_s"][0]
    x = table["base_x_m"].to_numpy().astype(float)
    second = np.diff(x, 2) / step**2
    a = table["base_x_acceleration_m_s2"].to_numpy().astype(float)[1:-1]
    smooth = np.ones(50) / 50
    assert np.convolve(second, smooth, "valid") == pytest.approx(np.convolve(a, smooth, "valid"), abs=0.02 * a.max())
    assert {"torque_A0_Nm", "torque_B0_Nm", "Fx_N", "Mz_Nm", "AccX_m_s2"} <= set(table.columns)


def test_everything_is_marked(made):
    """Logs, sheet, truth and stored runs all say that they are simulated."""
    assert all(p.read_text("utf-8").startswith("# origin: simulated") for p in (made / "logs").glob("r*_*.csv"))
    said = command("list", made / "campaign")
    assert said.stdout.count("simulated") >= 2
