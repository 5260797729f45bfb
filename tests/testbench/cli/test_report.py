"""``testbench report`` as a person calls it."""

import json
import re

import click
import pytest

from testbench.cli.report import report

from ...commands import invoke


@pytest.fixture(scope="module")
def pair(brief):
    """The 5 kg runs along x, with counter-masses and without."""
    return brief.campaign / "r005.h5", brief.campaign / "r006.h5"


def test_text_has_every_part_and_says_simulated(pair):
    """The base's vibration with its definition, with --all a table a part; units in one spelling, in every table."""
    assert "Torque, drives" not in invoke(report, pair[0]).out
    text = invoke(report, *pair, "--all").out
    assert re.match(r"Simulated: 2 runs, \d+ findings\.\n\nSimulated: r005: payload 5 kg, motion x, peak 3 g0", text)
    for words in (
        "Motions",
        "Vibration of the base",
        "Modes",
        "Wrench, components",
        "Torque, drives",
        "Compared",
    ):
        assert words in text
    assert "No response: r005: the clocks of r005_daq and r005_forces are not aligned: testbench align" in text
    assert re.search(r"\bN m\b", text)
    assert "Nm" not in text


def test_json_and_figures_of_two_runs(pair, tmp_path):
    """One document; the figures of each run and of the two beside each other; torques with and without."""
    found = invoke(report, *pair, "-o", tmp_path / "out", "--at", "0m,-10cm,0m", "--json").json
    assert [run["run"] for run in found["runs"]] == ["r005", "r006"]
    assert found["runs"][0]["wrench"]["point_m"] == [0.0, -0.1, 0.0]
    (compared,) = found["compared"]
    assert {row["joint"] for row in compared["torques"]} == {"A0", "B0"}
    for row in compared["torques"]:
        assert row["measured_times"] == pytest.approx(row["model_times"], rel=0.02)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {f"{run}-{what}.svg" for run in ("r005", "r006") for what in ("command", "spectrum")} | {
        f"r005-r006-{what}.svg" for what in ("base", "torques", "forces")
    } | {"report.json"}
    assert json.loads((tmp_path / "out" / "report.json").read_text("utf-8"))["runs"] == found["runs"]


@pytest.mark.parametrize("point", ["1,2,3", "0m,0m", "0m,0m,2kg"])
def test_a_point_without_units_is_a_wrong_command_line(pair, point):
    """Three lengths are expected."""
    with pytest.raises(click.UsageError):
        invoke(report, pair[0], "--at", point)
