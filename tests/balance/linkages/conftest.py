"""Linkages that are in no data file, and the independent dynamics that check them."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.linkage_files import linkage_from_table
from balance.linkages.verification import verify_linkage

_DISC = {"mass": "6.127 kg", "diameter": "1 m"}


def crank_rocker(rng=None):
    """Keys of a crank-rocker with a sliding dyad on its coupler, gears on two levels, centres off the lines."""
    draw = (
        (lambda low, high: float(rng.uniform(low, high))) if rng is not None else (lambda low, high: (low + high) / 2)
    )

    def link(length, gyration):
        mass = draw(0.3, 2.0)
        return {
            "mass": f"{mass:.6f} kg",
            "centre": [f"{length * draw(0.2, 0.8):.6f} m", f"{length * draw(-0.2, 0.2):.6f} m"],
            "inertia": f"{mass * (gyration * length) ** 2:.8f} kg m^2",
            "counter_mass": {"radius": f"{draw(40, 90):.4f} mm", "radius_of_gyration": f"{draw(10, 40):.4f} mm"},
        }

    teeth = (lambda: [int(rng.integers(17, 70)), int(rng.integers(17, 70))]) if rng is not None else (lambda: [40, 25])
    sizes = ((0.1, 0.35), (0.3, 0.3), (0.22, 0.3), (0.3, 0.3), (0.05, 0.4))
    arm, lift = draw(0.08, 0.14), draw(0.03, 0.09)
    return {
        "drive": "A0",
        "speed": "90 rpm",
        "gravity": ["0 m/s^2", "-9.81 m/s^2"],
        "links": {n: link(*size) for n, size in zip("23456", sizes, strict=True)},
        "joints": {
            "A0": {"ground": ["0 m", "0 m"], "2": ["0 m", "0 m"]},
            "A": {"2": ["0.1 m", "0 m"], "3": ["0 m", "0 m"]},
            "B": {"3": ["0.3 m", "0 m"], "4": ["0.22 m", "0 m"]},
            "B0": {"ground": ["0.28 m", "0 m"], "4": ["0 m", "0 m"]},
            "D": {"3": [f"{arm:.6f} m", f"{lift:.6f} m"], "5": ["0 m", "0 m"]},
            "P": {
                "kind": "prismatic",
                "5": {"point": ["0 m", f"{draw(-0.01, 0.02):.6f} m"], "along": f"{draw(-3, 3):.4f} deg"},
                "6": {"point": ["0 m", f"{draw(-0.01, 0.01):.6f} m"], "along": "90 deg"},
            },
            "E0": {"ground": ["0.10 m", "-0.25 m"], "6": ["0 m", "0 m"]},
        },
        "start": {"2": "60 deg", "3": "25 deg", "4": "110 deg", "5": "-100 deg", "6": "170 deg"},
        "reduction": {"3": "A", "5": "D"},
        "gears": {
            "z2": {"body": "2", "teeth": teeth()},
            "z3": {"body": "3", "teeth": teeth(), "disc": _DISC, "counter": {"mass": f"{draw(0.5, 2):.4f} kg"}},
            "z4": {"body": "4", "teeth": teeth(), "wheel": {"mass": "0.3 kg", "inertia": "2e-4 kg m^2"}},
            "z5": {
                "body": "5",
                "teeth": teeth(),
                "wheel": {"mass": "0.2 kg", "inertia": "1e-4 kg m^2"},
                "counter": {"radius_of_gyration": "60 mm"},
            },
        },
    }  # fmt: skip


def slider_crank():
    """Keys of an offset slider-crank whose slider's centre of mass lies on its line, with a geared planet."""
    return {
        "drive": "A0",
        "speed": "200 rpm",
        "links": {
            "2": {"mass": "0.4 kg", "centre": ["20 mm", "5 mm"], "inertia": "2e-4 kg m^2",
                  "counter_mass": {"radius": "50 mm"}},
            "3": {"mass": "0.6 kg", "centre": ["70 mm", "-8 mm"], "inertia": "2e-3 kg m^2",
                  "counter_mass": {"radius": "40 mm"}},
            "4": {"mass": "0.5 kg", "centre": ["15 mm", "0 mm"]},
        },
        "joints": {
            "A0": {"ground": ["0 m", "0 m"], "2": ["0 m", "0 m"]},
            "A": {"2": ["50 mm", "0 m"], "3": ["0 m", "0 m"]},
            "C": {"3": ["200 mm", "0 m"], "4": ["0 m", "0 m"]},
            "P": {"kind": "prismatic", "ground": {"point": ["0 m", "20 mm"], "along": "10 deg"},
                  "4": {"point": ["0 m", "0 m"], "along": "0 deg"}},
        },
        "start": {"2": "70 deg", "3": "-10 deg"},
        "gears": {"z2": {"body": "2", "teeth": [30, 20]}, "z3": {"body": "3", "teeth": [20, 50]}},
    }  # fmt: skip


def balanced(keys, **options):
    """The linkage of these keys, balanced."""
    return balance_linkage(linkage_from_table(keys, "x"), **options)


def left_over(result, stage="complete"):
    """Largest force or moment at varying speed, as a share of before."""
    return max(verify_linkage(result, count=60).varying.residual(stage).values())


@pytest.fixture
def random_crank_rocker():
    """A linkage with random masses, centres, inertias, lengths and teeth, by seed."""
    return lambda seed: linkage_from_table(crank_rocker(np.random.default_rng(seed)), f"random-{seed}")


@pytest.fixture
def crank_rocker_keys():
    """Keys of the crank-rocker, to be changed."""
    return crank_rocker()


@pytest.fixture
def slider_crank_keys():
    """Keys of the slider-crank, to be changed."""
    return slider_crank()


def free_base(text):
    """The same MJCF, parsed, on a base of 1 kg that may slide and turn in the plane."""
    root = ElementTree.fromstring(text)
    base = root.find("worldbody/body")
    for name, kind, axis in (("bz", "hinge", "0 0 1"), ("by", "slide", "0 1 0"), ("bx", "slide", "1 0 0")):
        base.insert(0, ElementTree.Element("joint", name=name, type=kind, axis=axis))
    base.insert(3, ElementTree.Element("inertial", pos="0 0 0", mass="1", diaginertia="1 1 1"))
    return root


def _on_free_base(text, gravity):
    """On a free base without its loops: the three forces of the base are those on it."""
    root = free_base(text)
    if not gravity:
        root.find("option").set("gravity", "0 0 0")
    for element in root.findall("keyframe") + root.findall("equality"):
        root.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def _mujoco_forces(text, path, gravity):
    import mujoco

    model = mujoco.MjModel.from_xml_string(_on_free_base(text, gravity))
    data = mujoco.MjData(model)
    rows = []
    for q, v, a in zip(path.q, path.v, path.a, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = (np.concatenate([np.zeros(3), x]) for x in (q, v, a))
        mujoco.mj_inverse(model, data)
        rows.append(data.qfrc_inverse.copy())
    return np.array(rows)


def _pinocchio_forces(text, path, gravity, folder):
    import pinocchio

    file = folder / "linkage.xml"
    file.write_text(_on_free_base(text, gravity), encoding="utf-8")
    model = pinocchio.buildModelFromMJCF(str(file))
    root = ElementTree.fromstring(text)
    model.gravity.linear = np.array(root.find("option").get("gravity").split(), dtype=float) * gravity
    data = model.createData()
    rows = [
        pinocchio.rnea(model, data, *(np.concatenate([np.zeros(3), x]) for x in state)).copy()
        for state in zip(path.q, path.v, path.a, strict=True)
    ]
    return np.array(rows)


@pytest.fixture
def referees(tmp_path):
    """Generalised forces on base (x, y, turn) and joints by two other inverse dynamics, (n, 3 + nv)."""
    return {
        "mujoco": lambda text, path, gravity=True: _mujoco_forces(text, path, gravity),
        "pinocchio": lambda text, path, gravity=True: _pinocchio_forces(text, path, gravity, tmp_path),
    }
