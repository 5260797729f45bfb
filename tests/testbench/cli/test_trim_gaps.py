"""``testbench trim`` of runs whose encoders paused: what a gap touches is left out, said, and the truth is told."""

import re

import pytest

from testbench.cli.trim import trim
from testbench.errors import AnalysisError

from ...commands import invoke
from .gapped import without_rows

MISSING = 0.030809
"""On each arm, by the masses that were built [kg m]."""
BOTH = {"r001_controller.csv": (0.4, 0.5), "r002_controller.csv": (0.5, 0.65)}


@pytest.fixture(scope="module")
def gapped(pair_built, tmp_path_factory):
    """The same with a gap in the motion of each."""
    return without_rows(pair_built, tmp_path_factory.mktemp("gapped"), BOTH)


def told(campaign, *options, expected) -> dict:
    """The document of the command."""
    return invoke(trim, "parallelogram-6bar", campaign, "--json", *options, code=expected).json


@pytest.mark.parametrize(("source", "wider"), [("wrench", 2.0), ("torque", 3.0), ("vibration", 2.0)])
def test_a_gap_is_left_out_and_said(pair_built, gapped, source, wider):
    """The interval holds the truth and what the whole runs tell, is not much wider, and no doubt arises.

    Torques have an offset and a drift each run besides: of a second of motion the gap takes an eighth, and so more of
    what distinguishes the drift. Where the interval holds zero, nothing is told.
    """
    whole, found = (told(c, "--from", source, expected=code) for c, code in ((pair_built.campaign, 0), (gapped, 3)))
    assert whole["verdict"] == "add"
    assert found["verdict"] == ("add" if min(one["interval"][0] for one in found["missing"]) > 0.0 else "nothing told")
    assert not found["doubts"]
    for one, other in zip(found["missing"], whole["missing"], strict=True):
        low, high = one["interval"]
        assert low < MISSING < high
        assert low < other["first_moment_kgm"] < high
        assert high - low < wider * (other["interval"][1] - other["interval"][0])
    assert [f["code"] for f in found["findings"]] == ["time_gap", "time_gap"]
    assert (
        "r001: 1 gap in the record of r001_controller, 0.101 s in all, the first after 0.399 s: left out"
        in (found["findings"][0]["message"])
    )


def test_the_finding_stands_in_the_text(gapped):
    """For people too."""
    said = invoke(trim, "parallelogram-6bar", gapped, "--from", "torque", code=3).out
    assert "time_gap: r002: 1 gap in the record of r002_controller, 0.151 s in all" in said
    assert said.startswith("Nothing to add: every interval holds zero.")


def test_a_run_of_which_nothing_is_left(pair_built, tmp_path):
    """It is left out beside a whole one, by name; alone it is refused."""
    campaign = without_rows(pair_built, tmp_path, {"r001_controller.csv": (0.2, 1.1)})
    with pytest.raises(AnalysisError, match=r"r001: 1 gap .* nothing of its motion is left; give another run"):
        told(campaign / "r001.h5", "--from", "torque", expected=1)
    found = told(campaign, "--from", "torque", expected=3)
    assert "left out: r001: 1 gap" in found["findings"][0]["message"]
    assert all(m["interval"][0] < MISSING < m["interval"][1] for m in found["missing"])


@pytest.mark.parametrize(("source", "why"), [("torque", "an interval needs 7 blocks"), ("wrench", "is not aligned")])
def test_a_refusal_names_run_and_gap(pair_built, tmp_path, source, why):
    """Where too little is left for an interval, or to align clocks: which run, where in its log, and what to do."""
    campaign = without_rows(pair_built, tmp_path, {"r001_controller.csv": (0.25, 0.7)})
    with pytest.raises(AnalysisError, match=rf"{why}.*; gaps take part of what the runs tell: ") as refusal:
        told(campaign / "r001.h5", "--from", source, expected=1)
    assert str(refusal.value).endswith(
        "r001: 1 gap in the record of r001_controller, 0.451 s in all, the first after 0.249 s: repeat the run, or "
        "give others of the same mounting beside it"
    )


def test_the_last_row_of_a_log_without_a_number(pair_built, tmp_path):
    """As if the log had ended before it; the run was refused."""
    name = "r001_controller.csv"
    last = (pair_built.logs / name).read_text("utf-8").splitlines()[-1]
    end, empty = float(last.split(",")[0]), re.sub(r",[^,]*", ",", last, count=1)
    ended = without_rows(pair_built, tmp_path / "ended", {name: (end, end + 1.0)})
    change = {name: lambda line: line.replace(last, empty)}
    found = without_rows(pair_built, tmp_path / "empty", {}, change)
    first, second = (told(c / "r001.h5", "--from", "torque", expected=0)["missing"] for c in (found, ended))
    assert first == second
