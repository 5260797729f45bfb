"""``balance simulate``, ``balance conditions`` and ``balance check``: numbers, files, exit codes."""

import json
import re
import warnings
from dataclasses import replace

import numpy as np
import polars
import pytest

from balance import datasets, front_door
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.motion.motion_files import load_motion

from .. import models


def test_json_of_simulate(balance):
    """rms and peak of force, moment and the torque of each motor; residual and branch of the closure."""
    code, out, err = balance("simulate", "parallelogram-6bar", "--motion", "x", "-p", "platform=5kg", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    for kind in ("rms", "peak"):
        assert {"Fx_N", "Fy_N", "Mz_Nm", "torque_Nm"} <= document[kind].keys()
        assert document[kind]["torque_Nm"].keys() == {"A0", "B0"}
    assert document["peak"]["Fx_N"] == pytest.approx(3 * 59.617, rel=1e-3)
    assert document["closure"]["residual_m"] < 1e-13
    assert document["closure"]["branch"] == "home"


def test_series_are_written_with_units(balance, tmp_path):
    """CSV and Parquet hold time, wrench, torque and the coordinates, the same numbers as the library's."""
    csv, parquet = tmp_path / "run.csv", tmp_path / "run.parquet"
    assert balance(
        "simulate", "parallelogram-6bar", "--motion", "y", "--rate", "1 kHz", "--csv", csv, "--parquet", parquet
    ).code == 0  # fmt: skip
    table = polars.read_parquet(parquet)
    mechanism = models.load("parallelogram-6bar")
    response = simulate(mechanism, Closure(mechanism).follow(load_motion("y").sample(1000.0)))
    np.testing.assert_array_equal(table["Fy_N"], response.force[:, 1])
    np.testing.assert_array_equal(table["torque_B0_Nm"], response.torque["B0"])
    assert {"time_s", "q_A0_rad", "v_platform_x_m_per_s", "a_B_rad_per_s2"} <= set(table.columns)
    assert csv.read_text(encoding="utf-8").startswith("# origin: simulated\n")
    assert polars.read_parquet_metadata(parquet)["origin"] == "simulated"
    assert polars.read_csv(csv, comment_prefix="#").columns == table.columns


def test_reactions_are_in_table_document_and_series(balance, tmp_path):
    """Sizes by joint and closure; the series has their components, of which the document has the peaks."""
    asked = ("simulate", "parallelogram-6bar", "--motion", "x", "--rate", "1 kHz", "--reactions")
    said = balance(*asked).out
    assert "redundant: rigid bodies do not determine Fz Mx My of A0, " in said
    assert "Couplings are torques" not in said
    document = json.loads(balance(*asked, "--csv", tmp_path / "run.csv", "--json").out)
    table = polars.read_csv(tmp_path / "run.csv", comment_prefix="#")
    assert {"A0", "A", "B0", "B"} < document["reactions"].keys()
    for joint, sizes in document["reactions"].items():
        assert sizes["force_N"]["peak"] >= sizes["Fx_N"]["peak"] == np.abs(table[f"reaction_{joint}_Fx_N"]).max()


def test_force_and_moment_together(balance):
    """A crank's inertia forbids it: named, exit code 3, in text and document; force alone is met."""
    code, out, _ = balance("conditions", "serial-2r", "--moment")
    assert code == 3
    assert "They ask for\n  Izz[link_2] = 0\nwhich no mass on any body lowers" in out
    code, out, _ = balance("conditions", "serial-2r", "--moment", "--json")
    forbidden = json.loads(out)["positive_masses"]
    assert (code, forbidden["status"], forbidden["coefficients"]) == (3, "forbidden", {"Izz[link_2]": 1.0})
    code, out, _ = balance("conditions", "serial-2r", "--moment", "--momentum", "linear")
    assert code == 0
    assert "Positive masses at suitable places" in out


def test_people_read_a_table(balance):
    """Components with RMS and peak, how well the loops closed, and what is left out."""
    code, out, _ = balance("simulate", "parallelogram-6bar-full", "--motion", "triangle", "--rate", "2000 Hz", "--all")
    assert code == 0
    for text in (
        "Fx",
        "Mz",
        "Drives",
        "\nA0 ",
        "peak speed",
        "power [W]",
        "RMS",
        "peak",
        "branch        home",
        "weight excluded",
    ):
        assert text in out


def test_rounding_is_no_force(balance, tmp_path):
    """Exact counter-masses leave rounding alone: zero is said and no row of force; a gram too much is a force.

    A page of it in motion says so too.
    """
    sized = json.loads(balance("size", "four-bar", "--json").out)["counter_masses"]
    motion = ("simulate", "four-bar", "--motion", "four-bar", "--rate", "1kHz")
    with_exact, with_more = (
        [word for c in sized for word in ("-c", f"{c['site']}={c['mass_kg'] + more!r}kg")] for more in (0.0, 1e-3)
    )
    exact, off = (balance(*motion, *masses).out for masses in (with_exact, with_more))
    assert exact.startswith("four-bar puts 0 N on its base in motion four-bar: its force is balanced")
    assert "Fx [N]" not in exact
    assert "Mz [N m]" in exact
    assert "N RMS in motion" in off
    assert "Fx [N]" in off
    page = balance("animate", "four-bar", "--motion", "four-bar", *with_exact, "-o", str(tmp_path / "a.html")).out
    assert ", 0 N with counter-masses" in page


def test_without_motors_it_says_so(balance, tmp_path):
    """A file without <actuator> gives no torque, and the reason."""
    text = models.load("parallelogram-6bar").text
    path = tmp_path / "plain.xml"
    path.write_text(text.replace("<motor ", "<!-- ").replace(' joint="A0"/>', " -->").replace(' joint="B0"/>', " -->"))
    out = balance("simulate", path, "--motion", "x", "--rate", "500 Hz").out
    assert "no <actuator>" in out


def test_a_joint_beyond_its_limits_is_said(balance, tmp_path):
    """Limits of the file are not enforced, so leaving them is a finding."""
    text = models.load("serial-1r").text
    path = tmp_path / "serial-1r.xml"
    path.write_text(text.replace('name="J1"', 'name="J1" limited="true" range="-0.3 2"', 1))
    code, out, _ = balance("simulate", path, "--motion", "serial-1r", "--rate", "500 Hz", "--json")
    low, high = json.loads(out)["beyond_limits"]["J1"]
    assert code == 3
    assert (low, high) == pytest.approx((0.5 - np.deg2rad(50.0), 0.5 + np.deg2rad(60.0)), abs=1e-6)
    assert "beyond the file's limits" in balance("simulate", path, "--motion", "serial-1r", "--rate", "500 Hz").out


def test_a_sliding_drive_has_a_force(balance, tmp_path):
    """What a linear motor gives is in newtons: m a of a carriage that weighs nothing along its guide."""
    path, motion = tmp_path / "carriage.xml", tmp_path / "slide.toml"
    path.write_text(
        '<mujoco><option gravity="0 -9.81 0"/><worldbody><body name="base"><body name="carriage">'
        '<joint name="S" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1e-3 1e-3 1e-3"/>'
        '</body></body></worldbody><actuator><motor joint="S"/></actuator></mujoco>'
    )
    motion.write_text(
        'driven = "joints"\njoints = ["S"]\nstart = ["0 mm"]\npeak_acceleration = "3 m/s^2"\n'
        'moves = [{ joint = "S", to = ["40 mm", "0 mm"] }]\n'
    )
    code, out, err = balance("simulate", path, "--motion", motion, "--json")
    assert code == 0, err
    peak = json.loads(out)["peak"]
    assert peak["drive_force_N"] == pytest.approx({"S": 6.0}, rel=1e-9)
    assert peak["torque_Nm"] == {}


def test_one_file_cannot_be_two(balance, tmp_path):
    """--csv and --parquet to one file would leave one of them."""
    code, _, err = balance(
        "simulate", "serial-1r", "--motion", "serial-1r", "--csv", tmp_path / "a", "--parquet", tmp_path / "a"
    )
    assert code == 2
    assert "one file" in err


def test_json_of_conditions(balance):
    """dof, rank, singular_value_gap, conditions with coefficients and value_kgm, balanced: one document, no more."""
    code, out, err = balance("conditions", "parallelogram-6bar", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert {"dof", "rank", "singular_value_gap", "conditions", "balanced"} <= document.keys()
    assert (document["dof"], document["rank"], document["balanced"]) == (2, 4, False)
    kept, dropped = document["singular_value_gap"]
    assert kept > 1e6 * dropped
    assert [set(c) for c in document["conditions"]] == [{"coefficients", "value_kgm"}] * 4
    assert document["conditions"][0]["coefficients"]["mcx[A0A]"] == 1.0


def test_a_condition_on_masses_alone_is_in_kilograms(balance):
    """The masses that the legs of a hexapod lift, 6.4 kg: no first moment, in text and JSON; it holds for no masses."""
    found = json.loads(balance("conditions", "stewart", "--json").out)["conditions"]
    assert [name for c in found for name in c.keys() - {"coefficients"}] == ["value_kgm"] * 21 + ["value_kg"]
    assert found[-1]["value_kg"] == pytest.approx(6.4)
    out = balance("conditions", "stewart").out
    assert re.search(r" \+6\.4  kg\n", out)
    residual = front_door.conditions("stewart").first_moment_residual()
    assert out.startswith(f"Not balanced: first-moment residual {residual:.4g} kg m, 6.4 kg, of")


def test_people_read_equations(balance):
    """Each condition as an equation with its value now, and the verdict."""
    code, out, _ = balance("conditions", "parallelogram-6bar", "--all")
    assert code == 0
    assert "mcx[A0A] + r m[AC] + mcx[BD] + r m[platform] = 0" in out
    assert "4 conditions on linear momentum.\n" in out
    assert re.search(r"degrees of freedom +2\n", out)
    assert "Not balanced" in out


def test_counter_masses_balance(balance):
    """With the exact counter-masses the verdict is balanced."""
    counters = ["-c", "counter_A0A=24.27611815kg", "-c", "counter_B0B=24276.11815 g"]
    code, out, _ = balance("conditions", "parallelogram-6bar", "-p", "platform=5kg", *counters, "--json")
    assert code == 0
    assert json.loads(out)["balanced"] is True


@pytest.mark.parametrize(("kind", "rank"), [("linear", 4), ("planar", 12), ("all", 16)])
def test_other_momenta(balance, kind, rank):
    """With angular momentum there are more conditions.

    In space four more: those on linear momentum again, with z times the mass, mcz, Ixz and Iyz for m, mcx and mcy.
    """
    code, out, _ = balance("conditions", "parallelogram-6bar-full", "--momentum", kind, "--json")
    assert (code, json.loads(out)["rank"]) == (0, rank)


GALLERY = {
    "3-rrr": (3, 10), "4-rrr": (3, 12), "bennett": (1, 4), "delta": (3, 13), "five-bar": (2, 6), "forbal-2": (2, 4),
    "four-bar": (1, 4), "inverted-slider-crank": (1, 4), "parallelogram-6bar": (2, 4),
    "parallelogram-6bar-full": (2, 4), "scara-quill": (4, 7), "serial-1r": (1, 2), "serial-2r": (2, 4),
    "serial-3r": (3, 6), "serial-4r": (4, 8), "serial-5r": (5, 10), "slider-crank": (1, 4), "stewart": (6, 22),
    "two-joint-arm-a0": (2, 4), "two-joint-arm-c1": (2, 4), "weighed-pendulum": (1, 2), "whitworth": (1, 6),
}  # fmt: skip
"""Degrees of freedom and independent conditions on linear momentum of the shipped mechanisms."""


@pytest.mark.parametrize("name", datasets.dataset_names("mechanisms", ".xml"))
def test_every_shipped_mechanism(balance, name):
    """Gruebler's count, or the known mobility of the overconstrained ones; each has conditions."""
    document = json.loads(balance("conditions", name, "--json").out)
    assert (document["dof"], document["rank"]) == GALLERY[name]


def test_forbal_is_balanced_in_its_links_directions_only(balance):
    """As built the rows along the links vanish; centres 2 % off the links' lines leave the rows across."""
    rows = json.loads(balance("conditions", "forbal-2", "--json").out)["conditions"]
    along, across = [[abs(row["value_kgm"]) for row in rows[start::2]] for start in (0, 1)]
    assert max(along) < 3e-9
    assert across == pytest.approx([9.642e-4, 7.281e-4], rel=1e-3)


BUILT = ("-p", "platform=3.4116kg", "-c", "counter_A0A=17.1105kg", "-c", "counter_B0B=17.1105kg")


def test_json_of_check(balance):
    """Residual, per cent, conditions, balanced payload, and the force per g0."""
    code, out, err = balance("check", "parallelogram-6bar", *BUILT, "--json")
    document = json.loads(out)
    assert (code, err) == (3, "")
    assert {
        "residual_first_moment_kgm", "residual_percent", "conditions", "balanced_payload_kg", "shaking_force_N_per_g",
    } <= document.keys()  # fmt: skip
    assert document["residual_first_moment_kgm"] == pytest.approx(3.081e-2, abs=5e-6)
    assert document["residual_percent"] == pytest.approx(4.576, abs=5e-4)
    assert (document["balanced"], document["remaining_percent"]) == (False, pytest.approx(4.576, abs=5e-4))
    assert document["balanced_payload_kg"]["platform"] == pytest.approx(3.2062, abs=5e-5)
    assert [set(c) for c in document["conditions"]] == [{"coefficients", "value_kgm"}] * 4


def test_force_per_g_of_the_unbalanced_machine(balance):
    """59.617 N per g0 at 5 kg without counter-masses, stated with the residual force with them."""
    counters = ("-c", "counter_A0A=24.2626kg", "-c", "counter_B0B=24.2626kg")
    document = json.loads(balance("check", "parallelogram-6bar", "-p", "platform=5kg", *counters, "--json").out)
    assert document["shaking_force_without_counter_masses_N_per_g"] == pytest.approx(59.617, abs=5e-4)
    assert document["shaking_force_N_per_g"] == pytest.approx((24.276118 - 24.2626) * 0.03755 / 0.15 * 9.81, rel=1e-4)


def test_people_read_the_verdict(balance):
    """Residual with per cent, balanced and asked payload, force per g0; not balanced is exit 3."""
    code, out, _ = balance("check", "parallelogram-6bar", *BUILT, "--all")
    assert code == 3
    assert out.startswith("Not balanced completely: 4.58 % of the RMS momentum remains over the workspace.")
    for text in ("0.030809", "4.58 %", "3.2062 kg", "asked: 3.4116 kg", "N per g0"):
        assert text in out


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (models.load("serial-2r").text.replace('mass="0.9" diaginertia="9.375e-05 0.0046875 0.0046875"',
                                               'mass="0" diaginertia="0 0 0"'), "bodies without mass can move alone"),
        (models.load("serial-1r").text.replace('inertial pos="0.14 0 0"', 'inertial pos="0 0 0"'), "there was none"),
    ],
)  # fmt: skip
def test_what_remains_where_momentum_has_no_measure(balance, tmp_path, text, why):
    """Of massless bodies, or of a mechanism without momentum, no share can be said: the first-moment residual is."""
    (tmp_path / "arm.xml").write_text(text, encoding="utf-8")
    given = ("check", str(tmp_path / "arm.xml"), "-c", "counter_link_1=1kg")
    document = json.loads(balance(*given, "--json").out)
    left = document["residual_first_moment_kgm"]
    assert document["remaining_percent"] is None
    said = f"Not balanced completely: first-moment residual {left:.4g} kg m; the RMS momentum has no measure: {why}"
    assert balance(*given).out.startswith(said)


def test_the_nearest_payload_where_none_is_balanced(balance):
    """Half a per cent off on one arm: none meets the conditions, and the nearest comes with what it leaves."""
    given = ("check", "serial-2r", "-p", "link_2=1kg", "-c", "counter_link_1=8.2kg", "-c", "counter_link_2=1.1kg")
    document = json.loads(balance(*given, "--json").out)
    near, left = document["nearest_payload_kg"]["link_2"], document["nearest_payload_remaining_percent"]["link_2"]
    assert document["balanced_payload_kg"] == {"link_2": None}
    said = f"They would balance no link_2 exactly; nearest is {near:.4f} kg, which leaves {left:.3g} % of the"
    assert said in balance(*given).out
    model, counters = models.load("serial-2r"), {"counter_link_1": 8.2, "counter_link_2": 1.1}
    sized = replace(front_door.check(model.with_payload(link_2=1.0), counters), payload_bodies=("link_2",))
    least, *others = (sized.objective.value(sized.after.with_payload(link_2=near * x)) for x in (1.0, 0.99, 1.01))
    assert least < min(others)


def test_where_there_is_no_force_per_g(balance):
    """A four-bar has no platform: the number is null, and not made up."""
    document = json.loads(balance("check", "four-bar", "-p", "AB=1kg", "-c", "counter_A0A=1kg", "--json").out)
    assert document["shaking_force_N_per_g"] is None
    assert balance("check", "serial-2r", "-p", "link_1=2kg", "-c", "counter_link_1=1kg").code == 3


def test_what_balances_completely_is_exit_0(balance):
    """Masses as balance size gives them, at full precision."""
    sized = json.loads(balance("size", "parallelogram-6bar", "--json").out)["counter_masses"]
    given = [part for one in sized for part in ("-c", f"{one['site']}={one['mass_kg']!r}kg")]
    code, out, _ = balance("check", "parallelogram-6bar", *given)
    assert (code, out.splitlines()[0]) == (0, "Balanced completely over the workspace.")


def test_something_to_check_is_needed(balance):
    """Without --counter the command line is wrong."""
    code, _, err = balance("check", "parallelogram-6bar")
    assert code == 2
    assert "--counter SITE=M" in err


def test_assemble_lists_the_ways_to_put_a_mechanism_together(balance):
    """Branch A is the keyframe's; each with its residual, and its coordinates by name."""
    code, out, err = balance("assemble", "four-bar", "--json")
    document = json.loads(out)
    assert (code, err, document["dof"], document["start"]) == (0, "", 1, "home")
    first, second = document["configurations"]
    assert (first["branch"], second["branch"]) == ("A", "B")
    assert first["q"]["A0"] == second["q"]["A0"] == 1.0
    assert max(first["residual_m"], second["residual_m"]) < document["tolerance_m"]
    assert "qpos='1 -0.554284311888 1.37643062239'" in balance("assemble", "four-bar")[1]


def test_samples_in_steps_are_a_finding(balance, tmp_path):
    """Rounded to 1 mrad, 1 ms apart: a simulation says what the steps make of the acceleration, and ends with 3."""
    rows = "".join(f"{k / 1000:.3f},{1.0 + 0.0157 * k:.3f}\n" for k in range(100))
    (tmp_path / "path.csv").write_text(f"time (s),A0 (rad)\n{rows}", encoding="utf-8")
    motion = tmp_path / "path.toml"
    motion.write_text('driven = "joints"\njoints = ["A0"]\nsamples = "path.csv"\n', encoding="utf-8")
    code, out, _ = balance("simulate", "four-bar", "--motion", str(motion))
    assert code == 3
    assert "coarse_samples: A0: the samples go in steps of 0.001 rad, each of which makes 1e+03 rad/s2" in out
    assert (
        len(json.loads(balance("simulate", "four-bar", "--motion", str(motion), "--json").out)["coarse_samples"]) == 1
    )


def test_degrees_in_a_keyframe_are_warned_of_where_they_are_refused(balance, tmp_path):
    """A command that refuses says its warnings, too: they may be why."""
    text = (datasets.ROOT / "mechanisms/four-bar.xml").read_text(encoding="utf-8")
    keyframe = re.search(r'qpos="([^"]*)"', text)
    degrees = " ".join(f"{np.degrees(float(x)):.3f}" for x in keyframe[1].split())
    (tmp_path / "m.xml").write_text(text.replace(keyframe[0], f'qpos="{degrees}"'), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        code, _, said = balance("simulate", tmp_path / "m.xml", "--motion", "nowhere")
    assert code == 1
    assert (
        "m.xml: in 'home' hinges are more than one turn (6.283 rad) from zero: A0 = 57.296 rad (1 if degrees)" in said
    )
    assert "nowhere" in said


def test_springs_of_a_file_are_said_to_be_left_out_of_torques(balance, tmp_path):
    """Conditions do not depend on them; a simulation says what torques and the moment lack, and ends with 3."""
    text = (datasets.ROOT / "mechanisms" / "four-bar.xml").read_text(encoding="utf-8")
    given = 'name="A0" stiffness="3" armature="0.01" '
    (tmp_path / "sprung.xml").write_text(text.replace('name="A0" ', given), encoding="utf-8")
    (tmp_path / "m.toml").write_text(
        'driven = "joints"\njoints = ["A0"]\nstart = ["1 rad"]\npeak_acceleration = "1 rad/s^2"\n'
        'moves = [ { joint = "A0", to = ["1.1 rad"] } ]\n',
        encoding="utf-8",
    )
    assert balance("conditions", str(tmp_path / "sprung.xml"))[0] == 0
    code, out, _ = balance("simulate", str(tmp_path / "sprung.xml"), "--motion", str(tmp_path / "m.toml"), "--json")
    assert (code, json.loads(out)["left_out"]) == (
        3,
        ["springs of joints A0", "the shaking moment of rotors (armature of A0)"],
    )
    out = balance("simulate", str(tmp_path / "sprung.xml"), "--motion", str(tmp_path / "m.toml")).out
    assert "left_out: the shaking moment of rotors (armature of A0) is not in M, though they count in" in out


def test_a_base_that_an_sdf_does_not_fix_is_named(balance, tmp_path):
    """Whatever is asked of it; not where a joint fixes the base."""
    arm = "<link name='{}'><inertial><mass>1</mass></inertial></link>"
    joint = "<joint name='to {1}' type='{2}'><parent>{0}</parent><child>{1}</child>{3}</joint>"
    loose = arm.format("stand") + arm.format("arm") + joint.format("stand", "arm", "revolute", "<axis/>")
    for name, links in {"loose": loose, "fixed": loose + joint.format("world", "stand", "fixed", "")}.items():
        text = f"<sdf version='1.7'><model name='m'>{links}</model></sdf>"
        (tmp_path / f"{name}.sdf").write_text(text, encoding="utf-8")
        code, out, notes = balance("conditions", str(tmp_path / f"{name}.sdf"))
        assert (code, "first-moment residual" in out) == (0, True)
        assert ("no joint of the SDF file holds link 'stand' to the world" in notes) == (name == "loose")
