"""A simulated campaign: logs as loggers write them, the same for the same seed; the truth apart, never analysed."""

import ast
import csv
import json
import shutil
from pathlib import Path

import numpy as np
import polars
import pytest
from click.testing import CliRunner

from balance.task_pool import HERE, TaskPool
from testbench import campaign_plan as plans
from testbench import rig as rigs
from testbench.cli.analyze import compare
from testbench.cli.trim import trim
from testbench.errors import RigError
from testbench.simulator import campaign
from testbench.simulator.sensors import draw_transducers

from ...other_process import OtherProcess
from ...source_trees import trees, walked
from ..conftest import call as command

PLAN = """
mechanism = "parallelogram-6bar"
seed = 5
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.276118 kg" }
motion = "y"
peak_acceleration = "4 g0"
"""
RIG = rigs.load_rig("parallelogram-6bar")


def make(folder: Path, plan: str = PLAN, rig: rigs.Rig = RIG, pool: TaskPool = HERE) -> Path:
    """Simulate a plan into ``folder``."""
    campaign.simulate_campaign(plans.plan_from_text(plan), rig, folder, pool=pool)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below ``folder``, by its path there."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One condition, with and without."""
    return make(tmp_path_factory.mktemp("made") / "logs")


def test_same_seed_same_bytes(made, tmp_path):
    """The same plan and rig give the same bytes, in other processes too; another seed other logs of the same truth."""
    assert contents(make(tmp_path / "again", pool=OtherProcess(None))) == contents(made)
    other = contents(make(tmp_path / "other", PLAN.replace("seed = 5", "seed = 6")))
    assert other["r001_daq.csv"] != contents(made)["r001_daq.csv"]
    assert other["truth/r001.parquet"] == contents(made)["truth/r001.parquet"]


def test_every_log_says_that_it_is_simulated(made):
    """The first line of every log marks it as simulated, and so does every line of the sheet."""
    logs = sorted(made.glob("r*_*.csv"))
    assert len(logs) == 6
    assert {log.read_text("utf-8").splitlines()[0] for log in logs} == {"# origin: simulated"}
    rows = list(csv.DictReader((made / "runs.csv").read_text("utf-8").splitlines()))
    assert {row["origin"] for row in rows} == {"simulated"}
    assert [row["file"] for row in rows] == [f"r00{i}_{n}.csv" for i in (1, 2) for n in ("daq", "forces", "controller")]


def test_sheet_keeps_every_digit(made):
    """The sheet holds counter-masses as planned, and nothing where there are none."""
    rows = list(csv.DictReader((made / "runs.csv").read_text("utf-8").splitlines()))
    assert rows[0]["counter_masses"] == "counter_A0A=24.2626;counter_B0B=24.276118"
    assert rows[-1]["counter_masses"] == ""
    assert (rows[0]["run"], rows[0]["payload_kg"], rows[0]["peak_acceleration_g"]) == ("r001", "5", "4")


def test_marks_of_the_loggers(made):
    """Each logger writes its own marks: a declared rate without time, or a column of time; decimal point or comma."""
    daq, forces = ((made / f"r001_{name}.csv").read_text("utf-8").splitlines() for name in ("daq", "forces"))
    assert "# rate: 5000 Hz" in daq
    assert daq[5].split(",") == ["AccX (g)", "AccY (g)", "AccZ (g)", "PlatX (g)", "PlatY (g)"]
    assert forces[4].startswith("Time (s);Fx1 (N);")
    assert all(len(row.split(";")) == 12 and "." not in row for row in forces[5:])
    assert forces[6].startswith("0,0005;")


def test_truth_is_apart(made):
    """Beside the logs lies what happened: the wrench, the base without noise, the clocks. No log is named for it."""
    import polars

    truth = json.loads((made / "truth" / "truth.json").read_text("utf-8"))
    assert truth["clocks"]["forces"] == {"start_s": -0.151, "drift_ppm": -8.0}
    table = polars.read_parquet(made / "truth" / "r002.parquet")
    assert table["Fy_N"].abs().max() == pytest.approx(4 * 59.617, abs=0.01)
    log = np.loadtxt(made / "r002_daq.csv", delimiter=",", comments=["#", "A"])[:, 1] * 9.81
    true_time = -0.237 + np.arange(len(log)) / 5000.0 / (1 + 12e-6)
    noise = log - np.interp(true_time, table["time_s"], table["AccY_m_s2"])
    assert noise.std() == pytest.approx(0.002 * 9.81, rel=0.05)


def test_folder_in_use(made):
    """A folder that holds something is refused and left as it is."""
    before = contents(made)
    with pytest.raises(RigError, match="not empty"):
        make(made)
    assert contents(made) == before


def test_empty_folder(tmp_path):
    """A folder that is there and empty is used."""
    (tmp_path / "logs").mkdir()
    assert (make(tmp_path / "logs") / "runs.csv").is_file()


def test_failure_leaves_nothing(tmp_path, monkeypatch):
    """If a log cannot be written, nothing stays behind."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(campaign, "write_log", full)
    with pytest.raises(OSError, match="No space"):
        make(tmp_path / "logs")
    assert not list(tmp_path.iterdir())


def test_plan_and_rig_of_two_mechanisms(tmp_path):
    """A plan for another mechanism than the rig's is refused."""
    with pytest.raises(RigError, match="'four-bar'"):
        make(tmp_path / "logs", PLAN.replace("parallelogram-6bar", "four-bar"))
    assert not list(tmp_path.iterdir())


def test_rig_without_bench(tmp_path):
    """A rig that says nothing of bench, rates and noise is simulated with the documented defaults."""
    text = """
mechanism = "parallelogram-6bar"
[loggers.daq]
clock = "uniform"
[sensors.acc]
kind = "accelerometer"
logger = "daq"
channels = { y = "Y" }
unit = "g"
position = ["0 m", "0 m", "0 m"]
"""
    made = make(tmp_path / "logs", rig=rigs.load_rig(text))
    assert "# rate: 2000 Hz" in (made / "r001_daq.csv").read_text("utf-8")


def test_seed_of_the_command(made, tmp_path):
    """``--seed`` goes before the plan's own seed: the plan's seed gives the plan's logs, another one others."""
    from click.testing import CliRunner

    from testbench.cli.simulate import simulate

    (tmp_path / "plan.toml").write_text(PLAN.replace("seed = 5", "seed = 9"), encoding="utf-8")
    words = ["--plan", str(tmp_path / "plan.toml"), "--rig", "parallelogram-6bar"]
    for seed in ("5", "9"):
        said = CliRunner().invoke(simulate, [*words, "--seed", seed, "-o", str(tmp_path / seed)])
        assert said.exit_code == 0, said.output
    assert contents(tmp_path / "5") == contents(made)
    assert contents(tmp_path / "9")["r001_daq.csv"] != contents(made)["r001_daq.csv"]
    assert CliRunner().invoke(simulate, [*words, "--seed", "-1", "-o", str(tmp_path / "x")]).exit_code == 2


def test_help_has_examples():
    """``--help`` shows examples, and what a rig may state of the bench."""
    from click.testing import CliRunner

    from testbench.cli.simulate import simulate
    from testbench.rig.bench import Bench, Logger

    said = CliRunner().invoke(simulate, ["--help"]).output
    assert "testbench simulate --plan kiper2019-brief --rig parallelogram-6bar-deep" in said
    plain = {"mass", "centre", "inertia", "mounts", "settling"}
    assert not [name for name in Bench.model_fields.keys() - plain if name not in said]
    written = {"read_as", "clock", "rate", "start", "drift_ppm", "delimiter", "decimal", "decimals"}
    assert not [name for name in Logger.model_fields.keys() - written if name not in said]


DEEP_PLAN = """
mechanism = "parallelogram-6bar"
seed = 11
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.2626 kg" }
motion = "x"
peak_acceleration = "3 g0"
"""
DEEP_RIG = "parallelogram-6bar-deep"


@pytest.fixture(scope="module")
def deep(tmp_path_factory) -> Path:
    """A condition on the deep rig: logs with their truth, and the campaign that was ingested from them."""
    folder = tmp_path_factory.mktemp("deep")
    campaign.simulate_campaign(plans.plan_from_text(DEEP_PLAN), rigs.load_rig(DEEP_RIG), folder / "logs")
    logs = sorted((folder / "logs").glob("r*_*.csv"))
    ingested = command(
        "ingest", *logs, "--rig", DEEP_RIG, "--runs", folder / "logs" / "runs.csv", "-o", folder / "campaign"
    )
    assert ingested.code in {0, 3}
    return folder


def analysed(folder: Path) -> list[str]:
    """What the analyses of a campaign say; trim aligns by the way."""
    runs = sorted((folder / "campaign").glob("*.h5"))
    calls = (
        (compare, folder / "campaign", "--published", "kiper2019", "--json"),
        (trim, "parallelogram-6bar", runs[-1], "--json"),
    )
    found = [CliRunner().invoke(call, [str(word) for word in words]) for call, *words in calls]
    return [f"{done.output}{done.exception!r}" for done in found]


def test_analysis_never_sees_it(deep):
    """With the truth gone, every analysis says the same, byte for byte; so it does when the truth tells lies."""
    before = analysed(deep)
    assert "reductions" in before[0]
    shutil.move(deep / "logs" / "truth", deep / "elsewhere")
    (deep / "logs" / "truth").mkdir()
    (deep / "logs" / "truth" / "truth.json").write_text("not what happened", encoding="utf-8")
    try:
        assert analysed(deep) == before
    finally:
        shutil.rmtree(deep / "logs" / "truth")
        shutil.move(deep / "elsewhere", deep / "logs" / "truth")


def test_nothing_drawn_is_stored(deep):
    """A stored run holds what the rig states, and no value that was drawn: no start, no sensitivity."""
    truth = json.loads((deep / "logs" / "truth" / "truth.json").read_text("utf-8"))
    drawn = [repr(truth["runs"][0]["clocks"]["daq"]["start_s"])]
    drawn += [
        repr(row[i]) for s in truth["sensors"].values() for i, row in enumerate(s["sensitivity_si"]) if row[i] != 1.0
    ]
    assert len(drawn) > 10
    for path in sorted((deep / "campaign").rglob("*.h5")):
        stored = path.read_bytes()
        assert not [value for value in drawn if value.encode() in stored]


def test_who_imports_it():
    """Campaigns and what is drawn: for the simulator, its command, the front door and the next run's plan alone."""
    root = Path("testbench")
    making_runs = {root / "cli" / "simulate.py", root / "next_run.py", root / "front_door.py"}
    hidden = {"campaign", "simulated_logs", "draw_transducers", "draw_samples", "disturbed", "record_run"}
    assert making_runs < trees().keys()
    for path, tree in trees().items():
        if path.parts[0] == "balance" or path.parent.name == "simulator" or path in making_runs:
            continue
        for node in walked(tree):
            if isinstance(node, ast.ImportFrom) and "simulator" in (node.module or "").split("."):
                names = {alias.name for alias in node.names} | set((node.module or "").split("."))
                assert not names & hidden, f"{path.name} imports {names & hidden} of the simulator"


def test_what_it_says(deep):
    """Clocks of each run, sensors of the campaign, and what is out of balance, as what happened."""
    truth = json.loads((deep / "logs" / "truth" / "truth.json").read_text("utf-8"))
    assert truth["origin"] == "simulated"
    balanced, bare = truth["runs"]
    # 24.276118 kg balance 5 kg: the built 24.2626 kg miss by their difference at 37.55 mm
    assert balanced["first_moment_residual_kg_m"] == pytest.approx(0.03755 * (24.276118 - 24.2626), rel=1e-3)
    assert bare["first_moment_residual_kg_m"] == pytest.approx(0.03755 * 24.276118, rel=1e-5)
    assert balanced["clocks"]["daq"]["start_s"] != bare["clocks"]["daq"]["start_s"]
    sensor = draw_transducers(rigs.load_rig(DEEP_RIG), 11)["kistler"]
    assert truth["sensors"]["kistler"]["sensitivity_si"] == sensor.sensitivity.tolist()
    assert truth["sensors"]["kistler"]["drift_si_per_s"] == sensor.drift.tolist()


def test_time_series(deep):
    """The base's motion in the truth is what its own accelerations integrate to."""
    table = polars.read_parquet(deep / "logs" / "truth" / "r002.parquet")
    step = table["time_s"][1] - table["time_s"][0]
    x = table["base_x_m"].to_numpy().astype(float)
    second = np.diff(x, 2) / step**2
    a = table["base_x_acceleration_m_s2"].to_numpy().astype(float)[1:-1]
    smooth = np.ones(50) / 50
    assert np.convolve(second, smooth, "valid") == pytest.approx(np.convolve(a, smooth, "valid"), abs=0.02 * a.max())
    assert {"torque_A0_Nm", "torque_B0_Nm", "Fx_N", "Mz_Nm", "AccX_m_s2"} <= set(table.columns)


def test_everything_is_marked(deep):
    """Logs, sheet, truth and stored runs all say that they are simulated."""
    assert all(p.read_text("utf-8").startswith("# origin: simulated") for p in (deep / "logs").glob("r*_*.csv"))
    said = command("list", deep / "campaign")
    assert said.out.count("simulated") >= 2
