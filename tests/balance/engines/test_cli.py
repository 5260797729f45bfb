"""``balance engine`` at its face."""

import json

import pytest
from click.testing import CliRunner

from balance.cli.engine import engine
from balance.conditions import find
from balance.mechanism import Mechanism


def _json(*arguments):
    result = CliRunner().invoke(engine, [*arguments, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.output)


def test_single(tmp_path):
    """Masses, forces, cases and best fractions; a chosen radius gives the counterweight's mass."""
    picture = tmp_path / "polar.svg"
    found = _json("single", "single", "--radius", "60mm", "--fraction", "0.55", "--figure", str(picture))
    assert found["rotating_mass_at_r_kg"] == pytest.approx(1.34)
    assert found["first_order_force_N"] == pytest.approx(636.04117)
    assert found["second_order_force_N"] == pytest.approx(159.01029)
    assert found["best_fraction"]["exact"]["fraction"] == pytest.approx(0.58993413, rel=1e-6)
    half = found["cases"]["1/2"]
    assert half["counterweight_mass_kg"] * 0.06 == pytest.approx(half["counterweight_kgm"])
    assert half["exact"]["F_max_N"] == pytest.approx(477.03088)
    assert "0.55" in found["cases"]
    assert picture.stat().st_size > 1000
    assert "third condition" in CliRunner().invoke(engine, ["single", "single"]).output


def test_free(tmp_path):
    """Orders, place, shafts and firing of a layout in m r omega^2, of a sheet in newtons."""
    found = _json("free", "in-line-4", "--orders", "4", "--figure", str(tmp_path / "orders.png"))
    second = found["orders"][1]
    assert second["force"]["largest_mrw2"] == pytest.approx(4 * 0.25402504)
    assert second["place_a"] == pytest.approx(1.5)
    assert found["firing"]["even"]
    sized = _json("free", "v4-72-offset")
    assert sized["orders"][0]["moment"]["largest_Nm"] > 0.0
    assert sized["over_a_turn_exact"]["force_N"] > 0.0
    assert "uneven" in CliRunner().invoke(engine, ["free", "v4-72-offset"], catch_exceptions=False).output


def test_table():
    """A row an engine; an own sheet may stand beside the shipped ones."""
    rows = {row["engine"]: row for row in _json("table")["engines"]}
    assert rows["in-line 3"]["M1_mrw2a"] == pytest.approx(3**0.5)
    assert rows["V2, 90 deg"]["F1_with_counterweights_mrw2"] == pytest.approx(0.0, abs=1e-12)
    assert len(rows) > 15
    assert [row["engine"] for row in _json("table", "single", "boxer-6")["engines"]] == ["single", "boxer 6"]


def test_mechanism_can_be_used_by_the_other_commands(tmp_path):
    """The written file closes, and has the one condition set of an engine."""
    path = tmp_path / "v4.xml"
    assert CliRunner().invoke(engine, ["mechanism", "v4-72-offset", "-o", str(path)]).exit_code == 0
    assert find(Mechanism.load(path)).dof == 1


@pytest.mark.parametrize(
    "arguments", [["single", "in-line-4"], ["single", "single", "--radius", "1m", "--mass", "1kg"]]
)
def test_wrong_command_lines(arguments):
    """A missing speed, or both radius and mass, is a wrong command line."""
    assert CliRunner().invoke(engine, arguments).exit_code == 2
