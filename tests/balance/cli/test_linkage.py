"""``balance linkage``."""

import math
import re

import pytest

from balance import datasets

from .conftest import call, json_of


def test_a_balanced_linkage_is_shown_with_force_moment_torque_and_cost(tmp_path):
    """Tables, a figure, the time series and a MJCF that MuJoCo reads."""
    import mujoco
    import polars

    files = {kind: tmp_path / f"out.{kind}" for kind in ("png", "csv", "xml")}
    result = call(
        "linkage",
        "two-levels",
        "--figure",
        files["png"],
        "--csv",
        files["csv"],
        "--mjcf",
        files["xml"],
        "--equations",
        "--all",
    )
    assert result.code == 0, result.err
    assert "Simulated, varying speed, share of before" in result.out
    assert re.search(r"speed \[rad/s\] +12\.566\n", result.out)
    assert "I_z5 = (Z*/Z) I[5], Z = 45, Z* = 18" in result.out
    assert re.search(r"Simulated, multiple of before\n.*\n.*\n.*\n.*\ncomplete.* 14\.338 ", result.out)
    assert files["png"].stat().st_size > 10_000
    table = polars.read_csv(files["csv"])
    assert {"time_varying_s", "varying_complete_Mz_Nm", "constant_before_torque_Nm"} <= set(table.columns)
    assert mujoco.MjModel.from_xml_path(str(files["xml"])).neq == 6


def test_json_holds_what_the_tables_and_the_figure_show():
    """Units in the keys; the residuals, the series and the comparison with the source."""
    result = call("linkage", "pantograph", "--json")
    assert result.code == 3, result.err
    document = result.json
    simulated = document["simulated"]
    assert simulated["origin"] == "simulated"
    assert simulated["varying_speed"]["share_of_before"]["complete"]["moment"] < 1e-10
    assert len(simulated["constant_speed"]["series"]["force"]["Mz_Nm"]) == len(simulated["constant_speed"]["time_s"])
    values = {e["equation"].split(" = ")[0]: e for e in document["equations"]}
    m5_star = values["m5*"]["value_kg"]
    m3_star = (0.94 * 0.381 / 2 + 1.53 * 0.381 + (0.26 + m5_star) * 0.381) / 0.095  # (m3 L3/2 + m4 L3 + m5' L3) / R3
    assert values["m3*"]["value_kg"] == pytest.approx(m3_star, rel=1e-12)
    assert m5_star == pytest.approx(0.26, abs=0.005)  # as published
    assert values["I[2+7]"]["value_kgm2"] == pytest.approx(values["I_z1"]["value_kgm2"])
    differing = [row["symbol"] for row in document["printed"]["values"] if row["verdict"] == "differs"]
    assert differing == ["I_z1", "I_z3"]


def test_speed_and_variation_are_taken():
    """Forces go with the square of the speed."""
    slow, fast = (
        json_of("linkage", "two-levels", "--speed", speed, "--variation", "0.5")["simulated"]
        for speed in ("100rpm", "300 rpm")
    )
    assert (fast["speed_rad_per_s"], fast["variation_share_of_speed"]) == (pytest.approx(10 * math.pi), 0.5)
    ratio = [s["varying_speed"]["rms"]["before"]["Fx_N"] for s in (fast, slow)]
    assert ratio[0] / ratio[1] == pytest.approx(9.0)


def test_as_built_is_a_stage_of_its_own(tmp_path):
    """What stock masses and gears leave, by option or in the file; bearing and tooth forces by stage; drawing, MJCF."""
    drawing, model = tmp_path / "gears.svg", tmp_path / "built.xml"
    result = call(
        "linkage",
        "two-levels",
        "--built",
        "m4*=3.5kg",
        "--built",
        "z3=40:26",
        "--drawing",
        drawing,
        "--mjcf",
        model,
        "--json",
    )
    assert result.code == 0, result.err
    document = result.json
    assert document["built"] == {"m4*": "3.5kg", "z3": [40, 26]}
    computed, made = (
        {
            **{one["symbol"]: one["mass_kg"] for one in part["counter_masses"]},
            **{one["name"]: one["teeth"] for one in part["gears"]},
        }
        for part in (document, document["as_built"])
    )
    assert made == {**computed, "m4*": 3.5, "z3": [40, 26]}
    assert (computed["m4*"], computed["z3"]) != (3.5, [40, 26])
    varying = document["simulated"]["varying_speed"]
    assert varying["share_of_before"]["built"]["force"] > 1e-3
    assert varying["bearing_forces"]["built"]["largest_teeth_N"]["z3"] > 100.0
    assert "z5*" in drawing.read_text(encoding="utf-8")
    assert not json_of("conditions", model)["balanced"]
    path = tmp_path / "built.toml"
    text = datasets.find_dataset("two-levels", "linkages", ".toml").read_text(encoding="utf-8")
    path.write_text(text + '\n[built]\n"m4*" = "3.5 kg"\nz3 = [40, 26]\n', encoding="utf-8")
    output = call("linkage", path, "--all").out
    assert re.search(r" before +force +complete +built\n", output)
    assert "largest teeth [N] z2" in output
    assert all(f"\n{part} as computed" in output for part in ("Counter-masses", "Gears"))
    assert re.search(r"(?s)Counter-masses as built.*^m4\* .* 3\.5000 .*Gears as built.*^z3 .* 40:26 ", output, re.M)


@pytest.mark.parametrize(
    ("options", "said", "listed"),
    [
        (
            (),
            r" with counter-masses and gears; .*times\); 2 counter-gears are not counted \(z4, z2: no mass given\)\.\n",
            2,
        ),
        (("--built", "m_z2*=1kg"), r" remains as built; .*times\); 1 counter-gear is not counted \(z4: no", 1),
        (("--built", "m_z2*=1kg", "--built", "m_z4*=2kg"), r"times\)\.\n", 0),
        (("--force-only",), r"times\)\.\n", 0),
    ],
)
def test_the_moving_mass_says_what_it_leaves_out(options, said, listed):
    """Counter-gears whose mass is neither described nor stated as built."""
    assert re.search(said, call("linkage", "two-levels", "--quiet", *options).out)
    document = json_of("linkage", "two-levels", *options)
    assert len(document["simulated"]["counter_gears_without_mass"]) == listed


def test_force_only_leaves_the_gears_out():
    """Two stages, no gears."""
    document = json_of("linkage", "two-levels", "--force-only")
    assert document["gears"] == []
    assert list(document["simulated"]["constant_speed"]["rms"]) == ["before", "force"]


def test_a_swing_is_not_called_constant_speed(tmp_path):
    """A joint that swings between two ends has no constant speed."""
    path = tmp_path / "swing.toml"
    text = datasets.find_dataset("two-levels", "linkages", ".toml").read_text(encoding="utf-8")
    path.write_text('swing = ["30 deg", "100 deg"]\n' + text, encoding="utf-8")
    output = call("linkage", path, "--all").out
    assert re.search(r"swings +yes\n", output)


@pytest.mark.parametrize("name", ["dwell", "dwell-short-two-point"])
def test_what_cannot_be_simulated_is_named_and_compared(name):
    """Exit code 3: balanced, but the source gives no pivots on the ground."""
    result = call("linkage", name)
    assert result.code == 3
    assert "Not simulated: where" in result.out
    assert "are on the ground is not given" in result.out
    assert "Restored in the published copy" in result.out


def test_nothing_is_written_where_nothing_is_simulated(tmp_path):
    """Asked for a figure of a linkage without pivots: refused, no file written."""
    assert "nothing to draw or write" in call("linkage", "dwell", "--figure", tmp_path / "x.png").err
    assert not list(tmp_path.iterdir())
