"""``balance methods`` and ``balance static``."""

import re

import pytest

from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion

from .conftest import call, json_of


def test_methods_side_by_side(tmp_path):
    """Nine rows, published conditions compared; the same numbers in JSON; a figure."""
    figure = tmp_path / "methods.svg"
    code, output, _ = call("methods", "four-bar", "--figure", str(figure), "--all")
    assert code == 0
    for text in (
        "counter-inertia",
        "the wheel of AB turns with the body",
        "three images",
        "active",
        "springs",
        "sufficient, not necessary",
        "loop closure",
    ):
        assert text in output
    document = json_of("methods", "four-bar")
    rows = {row["method"]: row for row in document["methods"]}
    assert len(rows) == 9
    assert rows["counter-mass"]["force_rms_N"] < 1e-10
    assert rows["counter-inertia"]["moment_rms_Nm"] < 1e-10
    assert rows["counter-mass"]["moment_rms_Nm"] > rows["as it is"]["moment_rms_Nm"]
    assert rows["active"]["needs"]["stroke_x_m"] == pytest.approx(0.1)
    assert [c["verdict"].split(":")[0] for c in document["printed_conditions"]] == [
        "sufficient, not necessary",
        "equal to the derived conditions",
    ]
    assert figure.read_text(encoding="utf-8").startswith("<?xml")


def test_settings_of_methods():
    """Half the stroke, twice the mass."""
    document = [json_of("methods", "serial-1r", "--stroke", s) for s in ("100mm", "50mm")]
    masses = [d["methods"][-1]["needs"]["mass_x_kg"] for d in document]
    assert masses[1] == pytest.approx(2 * masses[0])


@pytest.mark.parametrize("name", ["serial-2r", "five-bar"])  # ways of the second pass singular positions of its motors
def test_static_balance(tmp_path, name):
    """Swing of the potential energy: all of it, and none to 1e-12 either way; then motors hold nothing."""
    figure = tmp_path / "energy.svg"
    document = json_of("static", name, "--figure", figure)
    assert document["as_it_is"]["potential_swing_J"] > 1.0
    assert min(document["as_it_is"]["holding_torque_peak_Nm"].values()) > 0.1
    for way in ("counter_masses", "springs"):
        assert document[way]["share_of_unbalanced"] < 1e-12
        assert max(document[way]["holding_torque_peak_Nm"].values()) < 1e-10
    assert len(document["workspace"]["weight_J"]) == document["configurations"]
    assert "potential energy" in figure.read_text(encoding="utf-8").lower() or figure.stat().st_size > 1000
    assert "Springs of zero free length" in call("static", name).out


def test_static_places(tmp_path):
    """Places of a file, or a layout, not both."""
    code, output, _ = call("static", "parallelogram-6bar", "-p", "platform=5kg", "--springs", "parallelogram-6bar")
    assert code == 0
    assert "794.89" in output


@pytest.mark.parametrize(
    "name", [n for n in datasets.dataset_names("mechanisms", ".xml") if n.startswith(("serial", "four-bar"))]
)
def test_shipped_motions_move_their_mechanism(name):
    """Each chain and the four-bar has a motion of its name that drives all its motors."""
    assert set(load_motion(name).joints) == set(load_mechanism(name).driven)


def test_needs_are_printed_with_their_units():
    """As in the keys of the JSON document."""
    output = call("methods", "serial-1r", "--all").out
    assert re.search(r"needs stiffness \[N/m\] .* 36\.624 ", output)
    assert re.search(r"needs disc turn \[rad\] .* 6\.2832\n", output)


def test_springs_that_leave_a_swing_are_a_finding(tmp_path):
    """Stiffness given and wrong: the residual is stated, and the exit code is 3."""
    path = tmp_path / "springs.toml"
    spring = """[[spring]]
first = { body = "base", at = ["0 m", "0.2 m", "0 m"] }
second = { body = "AB", at = ["0.1 m", "-0 m", "0 m"] }
stiffness = "50 N/m"
"""
    path.write_text(spring, encoding="utf-8")
    code, output, _ = call("static", "four-bar", "--springs", str(path))
    assert code == 3
    assert "springs leave 70.6 % of it" in output.splitlines()[0]
    assert "AB (0.1, 0)" in output


@pytest.mark.parametrize(
    ("gravity", "stated"),
    [("0 0 -9.81", r"needs springs +- +0 "), ("0 0 0", "not needed: its file has no gravity")],
)
def test_a_level_mechanism_needs_no_static_balance(tmp_path, gravity, stated):
    """Weight across the plane does no work, and none does none; the other methods are compared all the same."""
    path = tmp_path / "level.xml"
    text = datasets.find_dataset("four-bar", "mechanisms", ".xml").read_text(encoding="utf-8")
    path.write_text(text.replace("0 -9.81 0", gravity), encoding="utf-8")
    code, output, _ = call("methods", str(path), "--motion", "four-bar", "--all")
    assert code == 0
    assert re.search(stated, output)
    if gravity != "0 0 0":
        assert "Nothing to balance: the weight of level does no work" in call("static", str(path)).out


def test_an_end_that_a_spring_file_lacks_is_named_as_missing(tmp_path):
    """Not as one that is None."""
    path = tmp_path / "springs.toml"
    path.write_text("[[spring]]\nsecond = { body = 'AB', at = ['0.1 m', '0 m', '0 m'] }\n", encoding="utf-8")
    assert "spring[0].first: missing: expected one end" in call("static", "four-bar", "--springs", path).err


CART = """<mujoco><compiler angle="radian"/><option gravity="0 -9.81 0"/><worldbody><body name="cart">
  <joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
  <body name="arm"><joint name="turn" axis="0 0 1"/><inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>
</body></worldbody><actuator><motor joint="x"/><motor joint="turn"/></actuator></mujoco>"""


def test_forces_of_sliding_drives_are_no_torques(tmp_path):
    """A motor that slides has a force [N] under a key of its own, one that turns a torque [N m]."""
    (tmp_path / "cart.xml").write_text(CART, encoding="utf-8")
    (tmp_path / "m.toml").write_text(
        'driven = "joints"\njoints = ["x", "turn"]\nstart = ["0 m", "0 rad"]\n'
        'peak_acceleration = ["1 m/s^2", "1 rad/s^2"]\n'
        'moves = [ { joint = "x", to = ["0.1 m", "0 m"] } ]\n',
        encoding="utf-8",
    )
    document = json_of("methods", str(tmp_path / "cart.xml"), "--motion", str(tmp_path / "m.toml"))
    plain = document["methods"][0]
    assert {key: list(plain[key]) for key in plain if key.startswith(("torque", "drive"))} == {
        "torque_rms_Nm": ["turn"], "drive_force_rms_N": ["x"], "torque_peak_Nm": ["turn"], "drive_force_peak_N": ["x"],
    }  # fmt: skip
    assert plain["drive_force_peak_N"]["x"] == pytest.approx(3.0, rel=1e-3)
    held = json_of("static", str(tmp_path / "cart.xml"))["as_it_is"]
    assert held["holding_torque_peak_Nm"]["turn"] == pytest.approx(0.981, rel=1e-3)
    assert held["holding_force_peak_N"]["x"] == pytest.approx(0.0, abs=1e-9)
