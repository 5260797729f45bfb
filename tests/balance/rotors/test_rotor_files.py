"""Rotor sheets and tables: what is missing is named."""

import numpy as np
import pytest

from balance.errors import DataError
from balance.rotors.rotor_files import load_rotor

KEYS = """
[[planes]]
name = "L"
at = "0 mm"
[[masses]]
name = "A"
mass = "3 kg"
radius = "80 mm"
angle = "60 deg"
at = "0.6 m"
[[masses]]
name = "B"
unbalance = "160 g mm"
{angle}
at = "300 mm"
"""


def _write(tmp_path, text, name="rotor.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_in_si(tmp_path):
    """Masses times radii and products of them come in kg m, places in m."""
    rotor = load_rotor(_write(tmp_path, KEYS.format(angle='angle = "90 deg"')))
    assert abs(rotor.unbalances[0].vector) == pytest.approx(0.24)
    assert rotor.unbalances[1].vector == pytest.approx(160e-6j)
    assert [u.at for u in rotor.unbalances] == pytest.approx([0.6, 0.3])


@pytest.mark.parametrize("row", ["B,2,80,,300", "B,2,80"])
def test_a_table_row_without_its_angle_is_named(tmp_path, row):
    """A table with an empty or cut cell is refused, line, mass and column named."""
    text = f"name,mass (kg),radius (mm),angle (deg),at (mm)\nA,3,80,60,600\n{row}\n"
    with pytest.raises(DataError, match=r"masses.csv, line 3 \(B\): angle: missing"):
        load_rotor(_write(tmp_path, text, "masses.csv"))


def test_the_shipped_table_is_the_shipped_file():
    """The same three masses as TOML and as CSV."""
    toml, table = load_rotor("three-masses"), load_rotor("three-masses-table")
    assert [u.vector for u in table.unbalances] == pytest.approx([u.vector for u in toml.unbalances])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,mass (kg),radius (mm),at (mm)\nA,1,1,1\n", "no column 'angle'"),
        (
            "name,mass (kg),radius (mm),angle (deg),at (mm)\nA,1,-80,20,10",
            "line 2 \\(A\\): radius: '-80 mm': expected zero",
        ),
        ("name,mass (kg),radius (mm),angle (deg),at (mm)\n", "holds no masses"),
        ("name,mass (kg),radius (mm),angle (deg),at (mm)\nA,1,1,1,1\nA,1,1,1,1\n", "'A' is there twice"),
    ],
)
def test_wrong_tables_are_named(tmp_path, text, message):
    """A column that is missing, a radius below zero, no mass, one mass twice; other cells as of any table."""
    with pytest.raises(DataError, match=message):
        load_rotor(_write(tmp_path, text, "masses.csv"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('at = "0 mm"', 'at = "0 mm"\nradius = "1 mm"\nmass = "1 kg"'), "both radius and mass"),
        (("[[planes]]", '[[planes]]\nname = "L"\nat = "7 mm"\n[[planes]]'), "planes: 'L' is there twice"),
        (("[[planes]]", 'bearings = ["5 mm", "5 mm"]\n[[planes]]'), "rotor.toml: bearings: .*: expected two, in"),
        (
            ("[[masses]]", '[[masses]]\nname = "A"\nunbalance = "1 kg mm"\nangle = "0 deg"\nat = "0 mm"\n[[masses]]'),
            "masses: 'A' is there twice",
        ),
        (('"80 mm"', '"-80 mm"'), r"\(A\).radius: '-80 mm': expected zero or more"),
        (('angle = "90 deg"', ""), r"rotor.toml: masses\[1\] \(B\)\.angle: missing: expected angle"),
        (("[[planes]]", 'speed = "50 Hz"\n[[planes]]'), "turns or radians"),
    ],
)
def test_wrong_files_are_named(tmp_path, change, message):
    """What does not go together, or has no bearing, is refused where it is; units and keys as of any input file."""
    with pytest.raises(DataError, match=message):
        load_rotor(_write(tmp_path, KEYS.format(angle='angle = "90 deg"').replace(*change, 1)))


def test_a_linkage_is_no_rotor():
    """A mechanism, shipped or a file, is refused: a linkage's force does not turn with a shaft."""
    for name in ("four-bar", "elsewhere/own.xml"):
        with pytest.raises(DataError, match="rigid rotors only"):
            load_rotor(name)


def test_a_hole_is_a_negative_mass(tmp_path):
    """Its radius has its angle."""
    text = KEYS.format(angle='angle = "90 deg"').replace('"3 kg"', '"-3 kg"')
    assert abs(load_rotor(_write(tmp_path, text)).unbalances[0].vector + 0.24 * np.exp(1j * np.pi / 3)) < 1e-15
