"""``balance simulate``."""

import json

import numpy as np
import polars
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import simulate
from balance.motion.motion_files import load_motion

from .. import models


def test_json_has_the_keys_that_are_promised(balance):
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


def test_people_read_a_table(balance):
    """Components with RMS and peak, how well the loops closed, and what is left out."""
    code, out, _ = balance("simulate", "parallelogram-6bar-full", "--motion", "triangle", "--rate", "2000 Hz")
    assert code == 0
    for text in ("Fx", "Mz", "torque A0", "RMS", "peak", "branch of 'home'", "weight excluded"):
        assert text in out


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
