"""``balance rotor``: documents, tables, refusals."""

import math
import re

import pytest

from balance.cli.printing import with_interval

from .conftest import call, json_of


def test_correct_gives_corrections_polygons_and_bearing_loads(tmp_path):
    """Every number of table and figure is in the document, the published ones too."""
    picture = tmp_path / "polygons.svg"
    found = json_of("rotor", "correct", "three-masses", "--figure", str(picture))
    left, right = found["corrections"]
    assert right["magnitude_kgmm"] == pytest.approx(177.412, abs=1e-3)
    assert right["angle_deg"] == pytest.approx(261.105, abs=1e-3)
    assert right["mass_kg"] == pytest.approx(1.77412, abs=1e-5)
    assert left["published"]["magnitude_kgmm"] == pytest.approx(133.77)
    assert found["bearing_loads"]["before"][1]["magnitude_N"] == pytest.approx(1609.4057)
    assert found["polygons"][0]["sides"] == ["1", "2", "3", "R"]
    assert picture.stat().st_size > 1000


@pytest.mark.parametrize(("place", "is_found"), [("0.001mm", True), ("20mm", True), ("300mm", False)])
def test_planes_next_to_each_other_are_a_finding(place, is_found):
    """Two planes a micrometre apart correct a couple on paper only."""
    arguments = ["correct", "three-masses", "--plane", "L=0mm", "--plane", f"R={place}"]
    result = call("rotor", *arguments)
    assert result.code == (3 if is_found else 0)
    assert ("planes L and R are" in result.out) is is_found


def test_correct_from_a_table_with_planes_and_bearings_given():
    """A table and places on the command line give what the file gives."""
    places = ["--plane", "L=0mm", "--plane", "R=0.8m", "--bearing", "-100mm", "--bearing", "0.9 m"]
    places += ["--speed", "100rad/s"]
    table, file = (
        json_of("rotor", "correct", "three-masses-table", *places),
        json_of("rotor", "correct", "three-masses"),
    )
    assert table["bearing_loads"] == file["bearing_loads"]
    text = call("rotor", "correct", "three-masses-table", "--plane", "m=0mm")
    assert "the couple remains" in text.out


def test_influence_prints_weights_and_whether_the_trial_stayed_on(tmp_path):
    """Text names the trial's effect and whether it stayed on; JSON holds coefficients and readings."""
    text = call("rotor", "influence", "feese-2004", "--all").out
    assert re.search(r"trial, aft +yes +1\.265\n", text)
    assert "phase counts as lead" in text
    for plane in json_of("rotor", "influence", "feese-2004")["planes"]:  # of what is to be there, what is not yet
        for axis in ("x_g", "y_g"):
            assert plane["add"][axis] == pytest.approx(plane["total"][axis] - plane["on_now"][axis])
    found = json_of("rotor", "influence", "goodman-1964", "--method", "min-max", "--figure", str(tmp_path / "v.png"))
    largest = max(row["after"]["magnitude_um"] for row in found["readings"])
    assert largest * 1e-6 == pytest.approx(found["cost_lower_bound_SI"], rel=1e-6)
    assert largest < 0.47619


def test_ill_conditioned_planes_are_a_finding(tmp_path):
    """Two planes of the same effect: computed, listed, exit code 3."""
    text = """
phase = "lead"
angles = "with rotation"
per = "g"
planes = [ { name = "a" }, { name = "b" } ]
initial.unstated = { A = "1 um @ 0 deg", B = "2 um @ 0 deg" }
coefficients.unstated = { A = ["1 um @ 0 deg", "1.01 um @ 0 deg"], B = ["1 um @ 0 deg", "1.02 um @ 0 deg"] }
"""
    path = tmp_path / "proportional.toml"
    path.write_text(text, encoding="utf-8")
    result = call("rotor", "influence", str(path), "--json")
    assert result.code == 3
    assert "condition number" in result.json["findings"][0]


def test_split_of_any_weight_and_from_stock():
    """Two neighbouring holes, and the proven set of stock weights."""
    free = json_of("rotor", "split", "30 g @ 100 deg", "--holes", "12")
    assert [h["hole"] for h in free["holes"]] == ["4", "5"]
    weights = [word for m in ("5g", "10g", "20g") for word in ("--weight", m)]
    stock = json_of("rotor", "split", "30 g @ 100 deg", "--holes", "12", "--most-holes", "3", *weights)
    assert stock["residual_g"] == pytest.approx(0.53695602, abs=1e-6)
    assert stock["least_possible_residual_g"] == pytest.approx(stock["residual_g"], rel=1e-6)
    removed = json_of("rotor", "split", "3000 g mm @ 100 deg", "--holes", "12", "--radius", "100mm", "--remove")
    assert [h["hole"] for h in removed["holes"]] == ["10", "11"]


def test_split_states_vectors_and_limits_with_their_unit():
    """The unit follows the magnitude, also in the refusal of a limit that is too low."""
    shown = call("rotor", "split", "30 g @ 100 deg", "--holes", "12").out
    assert "Makes 30 g @ 100.000 deg of 30 g @ 100.000 deg" in shown
    assert "of at most 2 g each" in call("rotor", "split", "30 g @ 1 deg", "--holes", "12", "--limit", "2g").err


def test_tolerance_has_its_scope_and_refuses_linkages():
    """The scope is part of the answer; a mechanism is refused with the reason."""
    outside = ("rotor", "tolerance", "--grade", "G6.3", "--mass", "40kg", "--speed", "3000rpm", "--residual", "900gmm")
    assert call(*outside).code == 3
    found = call(*outside, "--json").json
    assert found["U_per_gmm"] == pytest.approx(802.14091)
    assert found["within_tolerance"] is False
    assert "rigid" in found["scope"]
    planes = ("rotor", "tolerance", "--grade", "2.5", "--mass", "40kg", "--speed", "3000rpm", "--residual", "180gmm")
    assert "needs --to-bearings" in call(*planes, "--residual", "120gmm").err
    for second, within in (("120gmm", True), ("130gmm", False)):  # 318.31 g mm in all, 190.99 and 127.32 in the planes
        done = call(*planes, "--residual", second, "--to-bearings", "200mm", "300mm", "--json")
        found = done.json
        assert done.code == (0 if within else 3)
        assert (found["residual_gmm"], found["within_tolerance"]) == (None, within)
        assert found["grade_reached_mm_per_s"] == pytest.approx(
            2.5 * max(180 / 190.986, float(second[:3]) / 127.324), rel=1e-4
        )
    assert "rigid rotors only" in call("rotor", "tolerance", "four-bar", "--grade", "G6.3").err


def test_trial_mass():
    """The rule of practice: a tenth of the weight."""
    found = json_of("rotor", "trial", "--mass", "40kg", "--speed", "3000rpm", "--radius", "100mm")
    assert found["trial_mass_g"] == pytest.approx(3.9758432)
    assert found["force_N"] == pytest.approx(0.1 * 40 * 9.81)


def test_a_split_too_large_to_prove_is_widened_with_a_finding(monkeypatch):
    """Out of time the least residual is not claimed: the lightest set within 1 % is, as a finding, exit code 3."""
    from balance.rotors import weight_splitting

    solve = weight_splitting.split_from_stock

    def hurried(target, holes, stock, rules):
        if rules.resolution < 1e-3:
            raise weight_splitting.NotProvenError("out of time")
        return solve(target, holes, stock, rules)

    monkeypatch.setattr(weight_splitting, "split_from_stock", hurried)
    arguments = ["split", "30 g @ 100 deg", "--holes", "24", "--weight", "5g", "--weight", "20g", "--most-holes", "4"]
    result = call("rotor", *arguments, "--json")
    assert result.code == 3
    found = result.json
    assert "could not be proven" in found["findings"][0]
    assert found["residual_percent"] <= 1.0 + 1e-6
    assert call("rotor", *arguments, "--within", "0.01%").code == 1


@pytest.mark.parametrize(
    ("value", "within", "text"),
    [
        (8402.2, 357.0, "8400 ± 360"),
        (12.345, 0.0987, "12.345 ± 0.099"),
        (12.345, 0.0996, "12.35 ± 0.10"),
        (3.21, 4.0, "3.2 ± 4.0"),
        (3.21, math.inf, "3.21 ± inf"),
    ],
)
def test_a_value_has_the_digits_of_its_interval(value, within, text):
    """Two of the interval."""
    assert with_interval(value, within) == text
