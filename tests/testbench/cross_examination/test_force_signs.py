"""Force channels that go against their load: found by name where the load is large, silent where it cannot be told."""

import json

import pytest
from click.testing import CliRunner

from studies import simulated_runs as memory
from testbench.cli.report import report as command

from ..cli.gapped import without_rows
from ..conftest import reported


def signs(run) -> list[str]:
    """The channels with a finding."""
    return [finding.channel for finding in reported(run).findings if finding.code == "force_sign"]


@pytest.fixture(scope="module")
def loud():
    """A run along x without counter-masses, and one along y."""
    return memory.scene("x", masses={}).run(0), memory.scene("y", masses={}).run(0)


def test_sound_channels_are_no_finding(loud):
    """Neither where the mechanism shakes, nor where counter-masses leave next to nothing to compare with."""
    assert not signs(loud[0])
    assert not signs(loud[1])
    assert not signs(memory.scene("y").run(1))


@pytest.mark.parametrize("channel", ["Fx1", "Fy2", "Mz1"])
def test_a_turned_channel_is_named(loud, channel):
    """And no other beside it."""
    assert signs(memory.with_values(loud[0], channel, -loud[0].channel(channel))) == [channel]


def test_exchanged_channels_are_both_named(loud):
    """Two supports that a moment loads one up, one down; where both carry the same, nothing can be told."""
    along_x, along_y = (
        memory.with_values(memory.with_values(run, "Fy1", run.channel("Fy2")), "Fy2", run.channel("Fy1"))
        for run in loud
    )
    assert signs(along_x) == ["Fy1", "Fy2"]
    assert not signs(along_y)


def test_a_channel_that_nothing_loads_is_silent(loud):
    """The mechanism moves in a plane: what stands across it shows no sign."""
    assert not signs(memory.with_values(loud[0], "Fz3", -loud[0].channel("Fz3")))


def test_the_finding_of_the_command(brief, tmp_path):
    """A campaign with one column of a log turned: exit code 3, and what to look at."""

    def turned(line: str) -> str:
        cells = line.split(";")
        cells[1] = cells[1].removeprefix("-") if cells[1].startswith("-") else f"-{cells[1]}"
        return ";".join(cells)

    campaign = without_rows(brief, tmp_path, {}, {"r002_forces.csv": turned})
    done = CliRunner().invoke(command, [str(campaign / "r002.h5"), "--json"], standalone_mode=False)
    assert done.return_value == 3
    (finding,) = json.loads(done.stdout)["runs"][0]["findings"]
    assert (finding["code"], finding["channel"]) == ("force_sign", "Fx1")
    assert (
        "reversed polarity: it opposes the load Fx that the motion puts on k6d40: correlation -0.9"
        in finding["message"]
    )
