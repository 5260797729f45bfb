"""``balance engine``: documents, tables, refusals."""

import numpy as np
import pytest

from balance import datasets
from balance.balancing.conditions import balance_conditions
from balance.mechanism.mjcf_parser import load_mechanism

from .conftest import call, json_of


def test_single(tmp_path):
    """Masses, forces, cases and best fractions; a chosen radius gives the counterweight's mass."""
    picture = tmp_path / "polar.svg"
    found = json_of("engine", "single", "single", "--radius", "60mm", "--fraction", "0.55", "--figure", str(picture))
    assert found["rotating_mass_at_r_kg"] == pytest.approx(1.34)
    assert found["first_order_force_N"] == pytest.approx(636.04117)
    assert found["second_order_force_N"] == pytest.approx(159.01029)
    assert found["best_fraction"]["exact"]["fraction"] == pytest.approx(0.58993413, rel=1e-6)
    half = found["cases"]["1/2"]
    assert half["counterweight_mass_kg"] * 0.06 == pytest.approx(half["counterweight_kgm"])
    assert half["exact"]["F_max_N"] == pytest.approx(477.03088)
    assert "0.55" in found["cases"]
    assert picture.stat().st_size > 1000
    assert "centre of percussion" in call("engine", "single", "single", "--all").out


def test_an_inertia_that_no_rod_has_is_a_finding(tmp_path):
    """A tenfold one: its radius of gyration is beyond both pins."""
    text = datasets.find_dataset("single", "engines", ".toml").read_text(encoding="utf-8")
    path = tmp_path / "heavy.toml"
    path.write_text(text.replace('"0.0101 kg m^2"', '"0.101 kg m^2"'), encoding="utf-8")
    result = call("engine", "single", str(path))
    assert result.code == 3
    assert "means a radius of gyration of 290.1 mm" in " ".join(result.out.split())


def test_free(tmp_path):
    """Orders, place, shafts and firing of a layout in m r omega^2, of a file with sizes in newtons."""
    found = json_of("engine", "free", "in-line-4", "--orders", "4", "--figure", str(tmp_path / "orders.png"))
    second = found["orders"][1]
    assert second["force"]["largest_mrw2"] == pytest.approx(4 * 0.25402504)
    assert second["place_a"] == pytest.approx(1.5)
    assert found["firing"]["even"]
    sized = json_of("engine", "free", "v4-72-offset")
    assert sized["orders"][0]["moment"]["largest_Nm"] > 0.0
    assert sized["over_a_turn_exact"]["force_N"] > 0.0
    assert "uneven" in call("engine", "free", "v4-72-offset").out


def test_table():
    """A row an engine; an own file may be compared with the shipped ones."""
    rows = {row["engine"]: row for row in json_of("engine", "table")["engines"]}
    assert rows["in-line 3"]["M1_mrw2a"] == pytest.approx(3**0.5)
    assert rows["V2, 90 deg"]["F1_with_counterweights_mrw2"] == pytest.approx(0.0, abs=1e-12)
    assert len(rows) > 15
    assert [row["engine"] for row in json_of("engine", "table", "single", "boxer-6")["engines"]] == [
        "single",
        "boxer 6",
    ]


def test_mechanism_can_be_used_by_the_other_commands(tmp_path):
    """The written file closes, and has the one condition set of an engine."""
    path = tmp_path / "v4.xml"
    assert call("engine", "mechanism", "v4-72-offset", "-o", str(path)).code == 0
    assert balance_conditions(load_mechanism(path)).dof == 1


ENGINE = """
name = "odd V3"
throws = ["0 deg", "130 deg", "-77 deg"]
banks = ["-31 deg", "44 deg", "90 deg"]
at = [0, 0.4, 1.9]
spacing = "95 mm"
speed = "2750 rpm"
[slider_crank]
crank_radius = "41 mm"
rod_length = "131 mm"
piston_mass = "0.47 kg"
rod_mass = "0.61 kg"
rod_centre = "37 mm"
rod_inertia = "1.9e-3 kg m^2"
[[counterweights]]
name = "front"
unbalance = "21 kg mm @ 173 deg"
at = 0.2
"""


def test_residual_with_counterweights_and_shafts_over_a_turn(tmp_path):
    """An odd engine: orders 1 and 2 are gone from the exact force and moment, by their Fourier coefficients."""
    path, picture = tmp_path / "odd.toml", tmp_path / "odd.png"
    path.write_text(ENGINE, encoding="utf-8")
    left = json_of("engine", "free", str(path), "--figure", str(picture))["left_over_a_turn"]
    assert picture.stat().st_size > 10_000
    orders = {}
    for stage in ("before", "counterweights", "first_order_shafts", "shafts"):
        for what, unit in (("force", "N"), ("moment", "Nm")):
            x, y = (np.array(left[stage][f"{what}_{axis}_{unit}"][:-1]) for axis in "xy")
            orders[stage, what] = np.fft.fft(x + 1j * y) / len(x)
            assert left[stage][f"largest_{what}_{unit}"] == pytest.approx(np.hypot(x, y).max(), rel=1e-3)
    for what in ("force", "moment"):
        size = np.abs(orders["before", what]).max()
        assert abs(orders["counterweights", what][1]) < 1e-10 * size
        assert abs(orders["counterweights", what][-1]) == pytest.approx(abs(orders["before", what][-1]))
        assert np.abs(orders["first_order_shafts", what][[1, -1]]).max() < 1e-10 * size
        assert abs(orders["first_order_shafts", what][2]) == pytest.approx(abs(orders["before", what][2]))
        assert np.abs(orders["shafts", what][[1, -1, 2, -2]]).max() < 1e-10 * size
        assert abs(orders["shafts", what][4]) == pytest.approx(abs(orders["before", what][4]))
    boxer = json_of("engine", "free", "boxer-4")["left_over_a_turn"]["before"]
    assert set(boxer["force_x_mrw2"]) == {0.0}  # no rounding error is shown as a force
    assert boxer["largest_force_mrw2"] == 0.0
    text = call("engine", "free", str(path), "--all").out
    assert "Largest over a turn, before and after balancing" in text
    lines = text[text.index("Balance shafts") :].split("\n\n")[0].splitlines()
    assert max(map(len, lines)) <= 80
    shafts = json_of("engine", "free", str(path))["balance_shafts"]
    forces = [one["order"] ** 2 * u["magnitude_kgm"] for one in shafts for u in one["unbalances"]]
    shown = sum(force > 1e-4 * max(forces) for force in forces)
    assert len([line for line in lines if line[4:5].isdigit()]) == shown < len(forces)
    # one cylinder of many is called so, and the counterweights of the file, which are not included, are named
    output = call("engine", "single", str(path)).out
    assert "one of its 3 cylinders" in output
    assert "own counterweights (front) are not included" in output
