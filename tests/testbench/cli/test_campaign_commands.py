"""``testbench simulate``, ``analyze`` and ``compare`` as a person calls them."""

import shutil

import pytest

from balance.results import table
from testbench.vibration.metrics import DEFAULT_METRIC, VIBRATION_BAND

from ..conftest import call as command

PLAN = """
mechanism = "parallelogram-6bar"
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.2626 kg" }
motion = "y"
peak_acceleration = "4 g0"
"""


def test_from_plan_to_comparison(tmp_path):
    """simulate, ingest, analyze, compare: each does its part and the last knows all three values."""
    plan, logs, campaign = tmp_path / "plan.toml", tmp_path / "logs", tmp_path / "campaign"
    plan.write_text(PLAN, encoding="utf-8")
    made = command("simulate", "--plan", plan, "--rig", "parallelogram-6bar", "-o", logs)
    assert (made.code, made.err) == (0, "")
    assert "2 simulated runs, 6 logs" in made.out
    files = sorted(logs.glob("r*_*.csv"))
    stored = command("ingest", *files, "--rig", "parallelogram-6bar", "--runs", logs / "runs.csv", "-o", campaign)
    assert stored.code in {0, 3}
    analyzed = command("analyze", campaign, "--json", "--metric", "rms", "--band", "1..100")
    assert analyzed.code == 3  # what is left is below the noise
    first = analyzed.json["reductions"][1]
    assert (first["axis"], first["metric"], first["band_hz"], first["origin"]) == (
        "y",
        "rms",
        [1.0, 100.0],
        "simulated",
    )
    assert first["reduction_percent"] > 95.0
    low, high = first["interval_percent"]
    assert 95.0 < low <= first["reduction_percent"] <= high <= 100.0
    assert (first["method"], first["n"]) == ("propagation", {"with": 1, "without": 1})
    assert first["noise_floor_m_s2"]["with"] > 0.0
    compared = command("compare", campaign, "--published", "kiper2019", "--figure", tmp_path / "all.png")
    assert compared.code == 3
    assert (tmp_path / "all.png").read_bytes().startswith(b"\x89PNG")
    assert "< noise" in compared.out
    assert "original logs of the manipulator tests are not available" in compared.out
    assert "2 of 2 runs are simulated." in compared.out


def test_sets_of_counter_masses_are_told_apart(brief):
    """Rows of one condition with two sets name their counter-masses; where there is one set, no column is spent."""
    from dataclasses import replace

    from testbench.store import open_campaign
    from testbench.vibration.metrics import Measure
    from testbench.vibration.reduction import Reduction, analyze, sets_differ

    one = analyze(open_campaign(brief.campaign).runs[4:6], Measure()).reductions[0]
    other = replace(one, counter_masses={"a": 9.0, "b": 12.5})
    assert not sets_differ([one, one])
    assert sets_differ([one, other])
    cells = table(Reduction, [one, other], "counter_masses")
    assert cells == (["counter-masses kg"], [["24.2626 + 24.2626"], ["9 + 12.5"]])


@pytest.fixture
def three(brief, tmp_path):
    """Three runs of the brief campaign: a pair, and one that has lost its partner."""
    folder = tmp_path / "campaign"
    folder.mkdir()
    for path in brief.campaign.glob("r00[123].*"):
        shutil.copy(path, folder)
    return folder


def test_text_of_analyze(three):
    """People read the metric, the band and the origin beside the numbers."""
    said = command("analyze", three, "--budget")
    assert said.code == 3
    assert "combined standard uncertainty" in said.out
    assert f"{DEFAULT_METRIC} (" in said.out
    assert f"band {VIBRATION_BAND}" in said.out
    assert "2 of 2 runs are simulated." in said.out  # of the pair


def test_defaults_of_the_commands_are_those_of_the_module(three):
    """What the help shows as default is what the analysis has as default."""
    said = command("compare", three, "--published", "kiper2019", "--json").json
    assert said["rows"][0]["metric"] == DEFAULT_METRIC
    assert said["rows"][0]["band_hz"] == [VIBRATION_BAND.low_hz, VIBRATION_BAND.high_hz]


def test_no_band_and_a_run_without_partner(three):
    """``--band none`` keeps all frequencies and says null; the run that is left over is listed: exit 3."""
    said = command("analyze", three, "--json", "--metric", "rms", "--band", "none", "--budget")
    assert said.code == 3
    document = said.json
    for row in document["reductions"]:
        for budget in row["budget"]:
            assert sum(budget["variance_shares"]) == pytest.approx(1.0)
            assert all(part["contribution"] >= 0.0 for part in budget["contributions"])
        for side, interval in row["amplitude_interval_m_s2"].items():
            assert interval[0] <= row["amplitude_m_s2"][side] <= interval[1]
    assert document["reductions"][0]["band_hz"] is None
    assert len(document["reductions"]) == 3
    alone = [finding["where"] for finding in document["findings"] if finding["code"] == "no_partner"]
    assert alone == ["r003"]


def test_plan_next(three):
    """The verdict comes first, and names the run; JSON has every candidate; what does not fit is refused."""
    said = command("plan", "next", three, "--metric", "rms", "--axis", "y")
    assert said.code == 0
    assert said.out.startswith("repeat r00")
    document = command("plan", "next", three, "--metric", "rms", "--axis", "y", "--json").json
    assert [one["run"]["repeats"] for one in document["proposals"]] in (["r001", "r002"], ["r002", "r001"])
    assert document["verdict"] in said.out
    assert document["unit"] == "points"
    for words in (["--site", "counter_A0A"], ["--for", "first-moment", "--axis", "x"], ["--peak", "3 kg"]):
        assert command("plan", "next", three, *words).code == 2
    assert command("plan", "next", three, "--payload", "77").code == 1


def test_no_rig(brief, tmp_path):
    """Without a rig it is said what is needed."""
    files = sorted(brief.logs.glob("r00[12]_daq.csv"))
    (tmp_path / "runs.csv").write_text(
        "file,payload_kg,counter_masses,motion,peak_acceleration_g\nr001_daq.csv,5,counter_A0A=1,x,3\nr002_daq.csv,5,,x,3\n"
    )
    command("ingest", *files, "--runs", tmp_path / "runs.csv", "-o", tmp_path / "campaign")
    said = command("analyze", tmp_path / "campaign")
    assert said.code == 1
    assert "stored without a rig" in said.err
    assert "--rig" in said.err
