"""The flywheel for a wanted fluctuation."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import balance
from balance.datasets import find_dataset
from balance.drives import DriveError
from balance.drives.drive_files import load_drive
from balance.drives.harmonic_balance import flywheel_estimate, flywheel_for, steady_rotation
from balance.drives.machine import Load
from balance.drives.time_integration import run_to

from ..cli.conftest import call
from .source import REFERENCE, machine


@pytest.mark.parametrize("row", REFERENCE["flywheel"], ids=lambda row: f"{row['nm']}-{row['target']}")
def test_the_reference_s_flywheels(row):
    """Inertia on the crank's shaft to 2e-5; none where the fluctuation is small enough already."""
    wheel = flywheel_for(machine(row["nm"]), row["target"])
    assert wheel.inertia == pytest.approx(row["J_added"], rel=3e-5)
    assert wheel.fluctuation <= wheel.wanted + 1e-9


def test_a_flywheel_on_the_motor_s_shaft_is_smaller_by_the_ratio_squared():
    """J_motor = J_crank / ratio^2; the fluctuation is met either way."""
    crank, motor = (flywheel_for(machine(276), 0.1, side=side) for side in ("crank", "motor"))
    assert motor.inertia == pytest.approx(crank.inertia / 3.61**2, rel=1e-9)
    assert steady_rotation(machine(276).with_flywheel(motor.inertia, "motor")).fluctuation() == pytest.approx(
        0.1, rel=1e-9
    )


def test_the_textbook_s_estimate():
    """dE / (omega^2 delta) with the swing of weight's energy, 11.055 J."""
    row = REFERENCE["flywheel_estimate"]
    assert flywheel_estimate(machine(276), 0.1) == pytest.approx(row["I_needed_delta_0_1"], rel=1e-6)
    assert np.ptp(machine(276).reduced.potential(np.linspace(0, 7, 20001))) == pytest.approx(row["dE_pot"], rel=1e-6)


def test_the_estimate_is_of_loads_too():
    """A torque M = a + b cos 2 phi against the crank: dE = b beside weight that is left out, whatever a."""
    own = machine(276)
    phi = np.linspace(0.0, 2.0 * np.pi, 2001)
    curve = CubicSpline(phi, 30.0 + 5e4 * np.cos(2.0 * phi), bc_type="periodic")
    place = own.reduced.mechanism.coordinate_index(own.reduced.mechanism.driven[0])
    loaded = replace(own, loads=(Load("gas", "table", place, 0.0, curve),))
    energy = flywheel_estimate(loaded, 0.1) * own.nominal_crank**2 * 0.1
    assert energy == pytest.approx(5e4, abs=12.0)  # within the swing of weight's energy, 11.055 J


def first_machine(path):
    """The machine of a drive file at the first of its speeds."""
    return load_drive(path).machines(load_drive(path).load_mechanism())[0]


def test_one_that_stalls_without_a_flywheel(tmp_path):
    """It runs with the one that is found, as an integrated turn shows; the other speed is computed without, too."""
    path = tmp_path / "drive.toml"
    path.write_text(
        find_dataset("four-bar-dc", "drives", ".toml").read_text("utf-8").replace('["900', '["300 rpm", "900')
    )
    with pytest.warns(UserWarning, match="four-bar: at 300 rpm it stalls or all but stands: .* give, at 322 deg"):
        (kept,) = balance.drive(path)
    stalling = first_machine(path)
    _, turn = run_to(stalling, 0.0, np.array([0.0, stalling.nominal_crank]), 2.0 * np.pi)
    travel, speed = turn.sol(np.linspace(0.0, turn.t[-1], 100_001))
    assert np.degrees(travel[np.argmax(speed < 0.01 * stalling.nominal_crank)]) == pytest.approx(322.0, abs=0.5)
    assert kept.machine.nominal == pytest.approx(30.0 * np.pi)
    slow, fast = balance.drive(path, flywheel_for=0.4)
    for found in (slow, fast):
        machine, start = found.machine, float(found.rate(0.0))
        assert machine.inertias[-1].value > 0.0
        _, turn = run_to(machine, 0.0, np.array([0.0, start]), 2.0 * np.pi)
        assert turn.y[1, -1] == pytest.approx(start, rel=1e-7)
        speed = turn.sol(np.linspace(0.0, turn.t[-1], 4001))[1]
        assert np.ptp(speed) / machine.nominal_crank == pytest.approx(0.4, rel=1e-5)
    outcome = call("drive", path, "--flywheel-for", "0.4", "--json")
    assert outcome.code == 3
    document = json.loads(outcome.out)
    assert [row["nominal_rpm"] for row in document["steady"]] == pytest.approx([900.0])
    found = [row["inertia_kgm2"] for row in document["flywheel"]]
    assert found == pytest.approx([one.machine.inertias[-1].value for one in (slow, fast)], rel=1e-9)
    assert [row["fluctuation"] for row in document["flywheel"]] == pytest.approx([0.4, 0.4], rel=1e-9)
    assert [row["mean_rpm"] for row in document["flywheel"]] == pytest.approx(
        [one.mean_speed * 30.0 / np.pi for one in (slow, fast)], rel=1e-9
    )
    assert "stalls" in document["findings"][0]


def test_nonsense_is_refused():
    """A fluctuation of zero needs an infinite flywheel."""
    with pytest.raises(DriveError, match="expected a number between"):
        flywheel_for(machine(276), 0.0)
