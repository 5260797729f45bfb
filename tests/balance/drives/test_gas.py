"""Gas on a piston, as a table over the crank's angle, against a slider-crank in closed form."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from balance.drives.drive_files import load_drive
from balance.drives.harmonic_balance import steady_rotation
from balance.errors import DataError

from ..cli.conftest import call

RPM = np.pi / 30.0
R, L = 0.05, 0.2
ANGLES = [0.0, 15.0, 40.0, 90.0, 150.0, 200.0, 300.0, 345.0]
GAS = [3.0, 6.0, 2.0, 0.6, 0.1, 0.0, 0.3, 1.5]
"""Towards the crank [kN]."""
HEAD = """
mechanism = "sc.xml"
crank = "crankshaft"
speeds = ["1500 rpm"]
[motor]
kind = "dc"
stall_torque = "60 N m"
no_load_speed = "1600 rpm"
[[inertia]]
inertia = "0.2 kg m^2"
side = "crank"
[[load]]
kind = "table"
joint = "piston_1"
"""
LISTS = f"angle = {[f'{a} deg' for a in ANGLES]}\nforce = {[f'{f} kN' for f in GAS]}\n"


def turned(folder, load, csv=""):
    """Steady rotation of the shipped single cylinder under a load."""
    model = call("engine", "mechanism", "single").out
    (folder / "sc.xml").write_text(model, encoding="utf-8")
    (folder / "gas.csv").write_text(csv, encoding="utf-8")
    (folder / "gas.toml").write_text(HEAD + load, encoding="utf-8")
    drive = load_drive(folder / "gas.toml")
    (machine,) = drive.machines(drive.load_mechanism())
    return steady_rotation(machine)


def inertia(phi):
    """Twice the kinetic energy over the square of the crank's speed, from the velocities of crank, rod and piston."""
    lean = np.arcsin(R / L * np.sin(phi))
    turn = -R * np.cos(phi) / (L * np.cos(lean))
    rod = [-R * np.sin(phi) + 0.06 * np.sin(lean) * turn, R * np.cos(phi) + 0.06 * np.cos(lean) * turn]
    piston = -R * np.sin(phi) - R * np.cos(phi) * np.tan(lean)
    return 0.2 + 0.000625 + 1.2 * (rod[0] ** 2 + rod[1] ** 2) + 0.0101 * turn**2 + 0.8 * piston**2


def gain(phi):
    """Speed of the piston over that of the crank, positive away from the crank [m]."""
    return -R * np.sin(phi) - R * np.cos(phi) * np.tan(np.arcsin(R / L * np.sin(phi)))


def test_steady_rotation_against_the_closed_form(tmp_path):
    """Kinetic energy over the angle, integrated from the speed that repeats: extremes to 1e-6."""
    found = turned(tmp_path, LISTS)
    angles, forces = np.radians([*ANGLES[-2:], *ANGLES, *ANGLES[:2]]), np.array([*GAS[-2:], *GAS, *GAS[:2]])
    angles[:2] -= 2 * np.pi
    angles[-2:] += 2 * np.pi
    gas = PchipInterpolator(angles, 1e3 * forces)

    def slope(phi, energy):
        speed = np.sqrt(2.0 * energy / inertia(phi))
        return 60.0 / (1600 * RPM) * (1500 * RPM - speed) - gas(phi % (2 * np.pi)) * gain(phi)

    def turn(speed):
        start = [0.5 * inertia(0.0) * speed**2]
        return solve_ivp(slope, (0.0, 2 * np.pi), start, rtol=1e-10, atol=1e-9, max_step=0.05, dense_output=True)

    start = brentq(lambda n: turn(n).y[0, -1] - 0.5 * inertia(0.0) * n**2, 150.0, 250.0, xtol=1e-9)
    phi = np.linspace(0.0, 2 * np.pi, 20_001)
    speed = np.sqrt(2.0 * turn(start).sol(phi)[0] / inertia(phi))
    assert found.fastest[1] == pytest.approx(speed.max(), rel=1e-6)
    assert found.slowest[1] == pytest.approx(speed.min(), rel=1e-6)


def test_a_file_is_the_lists(tmp_path):
    """A CSV in the folder of the drive file, its units in the header, also one that ends at 360 degrees as it began."""
    rows = "\n".join(f"{a},{1e3 * f}" for a, f in zip([*ANGLES, 360.0], [*GAS, GAS[0]], strict=True))
    listed, filed = turned(tmp_path, LISTS), turned(tmp_path, 'file = "gas.csv"\n', f"angle (deg),force (N)\n{rows}\n")
    assert filed.fastest == pytest.approx(listed.fastest, rel=1e-12)
    assert filed.slowest == pytest.approx(listed.slowest, rel=1e-12)


@pytest.mark.parametrize(
    ("csv", "message"),
    [
        ("angle,force (N)\n0,1\n", "gas.csv: column 'angle': has no unit: write for example 'angle \\(deg\\)'"),
        ("angle (deg),torque (N m)\n0,1\n", "must hold the columns angle \\(rad\\), force \\(N\\)"),
        ("angle (deg),force (kg)\n0,1\n", "'kg' is not a unit of force"),
        ("angle (deg),force (N)\n0,1\n90,\n180,2\n", "gas.csv, line 3: force is '': expected a number"),
        ("angle (deg),force (N)\n0,1\n90\n180,2\n", "gas.csv, line 3: force is '': expected a number"),
        ("angle (deg),force (N)\n0,1\n200,5\n100,2\n", "angles increasing"),
        ("angle (deg),force (N)\n0,1\n200,5\n360,2\n", "angle goes from 0 to 360 deg: expected one turn"),
        ("angle (deg),force (N)\n0,1\n200,5\n540,2\n", "angle goes from 0 to 540 deg"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, csv, message):
    """Header, unit, row, and angles that are not one turn."""
    with pytest.raises(DataError, match=message):
        turned(tmp_path, 'file = "gas.csv"\n', csv)


def test_a_file_and_lists_are_one_too_many(tmp_path):
    """Which would hold is not guessed; a file that is not there is named."""
    with pytest.raises(DataError, match="gives both file and angle"):
        turned(tmp_path, 'file = "gas.csv"\n' + LISTS)
    with pytest.raises(DataError, match=r"no such file 'none\.csv'"):
        turned(tmp_path, 'file = "none.csv"\n')
