"""Descriptions of linkages, and what is wrong with them."""

import copy

import numpy as np
import pytest

from balance import datasets
from balance.errors import CounterpoiseError, DataError
from balance.linkages.linkage_files import linkage_from_table, load_linkage


def changed(keys, where, value):
    """A copy with one key set, or removed where value is None."""
    keys = copy.deepcopy(keys)
    *path, last = where.split("/")
    table = keys
    for name in path:
        table = table[name]
    if value is None:
        del table[last]
    else:
        table[last] = value
    return keys


@pytest.mark.parametrize(
    ("where", "value", "message"),
    [
        ("links/2/mass", None, "links.2.mass: missing: expected mass of the link"),
        ("links/2/mass", "-1 kg", "links.2.mass: '-1 kg': expected more than zero"),
        ("links/2/centre", ["L2", "0 m"], "'L2' is not a named length"),
        ("links/2/counter_mass", {"bar": "1 m"}, "links.2.counter_mass: expected either at"),
        ("links/3/fixed_to", "7", "links.3.fixed_to: '7': expected one of 2, 3, 4"),
        ("links/3/fixed_to", "3", "links.3: fixed in a circle: 3 to 3"),
        ("links/3/angle", "3 deg", "links.3: angle is for a link that is fixed_to another"),
        ("links/ground", {}, "links: 'ground' is no name for a link: the ground needs no description"),
        ("joints/A", {"2": ["0 m", "0 m"]}, "joints.A: joins 2: expected two links"),
        ("joints/A/9", ["0 m", "0 m"], "joints.A: joins 2, 3, 9"),
        ("joints/A", {"2": ["0 m", "0 m"], "9": ["0 m", "0 m"]}, "joints.A.9: '9': no such link"),
        ("joints/A", {"2": "not given", "3": ["0 m", "0 m"]}, "only places on the ground may be 'not given'"),
        ("joints/P/kind", "screw", "joints.P.kind: 'screw': expected revolute or prismatic"),
        ("joints/P/4", {"point": ["0 m", "0 m"]}, "joints.P.4.along: missing: expected direction of sliding"),
        ("gears/z3/teeth", [20, 0], "gears.z3.teeth\\[1\\]: 0: expected more than zero"),
        ("gears/z3/body", "9", "no moving link '9'"),
        ("gears/z3/wheel", {"mass": "1 kg"}, "gears.z3.wheel.inertia: missing: expected inertia of the gear"),
        ("gears/z3/counter", {"mass": "0 kg"}, "gears.z3.counter.mass: '0 kg': expected more than zero"),
        ("gears/z3/counter", {"mass": "1 kg", "radius_of_gyration": "1 m"}, "counter: mass and radius_of_gyration are"),
        ("gears/z3/counter", {"at": ["0 m", "0 m"]}, "gears.z3.counter: at is given and on is missing"),
        ("gears/z3/counter", {"on": "2"}, "gears.z3.counter: on is given and at is missing"),
        ("gears/z3/counter", {"at": ["0 m", "0 m"], "on": "7"}, "gears.z3.counter.on: '7': no such link"),
        ("links/2/counter_mass", {"radius": "0 m"}, "links.2.counter_mass.radius: '0 m' is 0 m: expected more"),
        ("links/2/counter_mass", {"radius": "-5 mm"}, "links.2.counter_mass.radius: '-5 mm' is -0.005 m"),
        ("links/2/counter_mass", {"radius": "5 mm", "bar": "-1 mm"}, "links.2.counter_mass.bar: '-1 mm' is -0.001 m"),
        ("links/2/counter_mass", {"radius": "5 mm", "bar": "1 mm", "inertia": "1 kg m^2"}, "bar and inertia are both"),
        ("links/2/counter_mass", {"radius": "5 mm", "inertia": "-1 kg m^2"}, "inertia: '-1 kg m\\^2': expected zero"),
        ("links/2/counter_mass", {"name": "3", "radius": "5 mm"}, "on 2 and 3 are both named '3'"),
        ("links/2/centre", ["1 m/0", "0 m"], "links.2.centre\\[0\\]: '1 m/0' divides by zero"),
        ("links/base", {}, "links: 'base' is no name for a link: the name of the frame"),
        ("lengths", {"mm": "1 m"}, "lengths: the name 'mm' is a unit of length"),
        ("swing", ["10 deg", "10 deg"], "both ends are the same angle"),
        ("drive", "X", "no joint 'X'"),
        ("start/9", "1 deg", "no moving link '9'"),
    ],
)
def test_a_wrong_key_is_named(where, value, message, slider_crank_keys):
    """One message that says which key, what it is and what was expected."""
    with pytest.raises(CounterpoiseError, match=message):
        linkage_from_table(changed(slider_crank_keys, where, value), "x")


def test_rigidly_joined_links_are_one_body(slider_crank_keys):
    """A link fixed at a place and an angle adds its parts, places and joints to the body's frame."""
    keys = slider_crank_keys
    keys["lengths"] = {"L7": "30 mm"}
    keys["links"]["7"] = {
        "fixed_to": "2", "at": ["50 mm", "0 m"], "angle": "90 deg",
        "mass": "0.1 kg", "centre": ["L7/2", "0 m"], "inertia": "1e-5 kg m^2",
    }  # fmt: skip
    linkage = linkage_from_table(keys, "x")
    body = linkage.body("7")
    assert body is linkage.body("2")
    assert body.name == "2+7"
    assert np.allclose(body.parts[1].centre.at(linkage.values), [0.05, 0.015])
    assert body.parts[1].centre.y.text() == "L7/2"


def test_every_shipped_linkage_is_read():
    """The six of the source, and one of our own."""
    names = datasets.dataset_names("linkages", ".toml")
    assert len(names) == 7
    assert all(load_linkage(name).bodies for name in names)


def test_a_file_that_is_no_toml_is_named(tmp_path):
    """With its name."""
    path = tmp_path / "bad.toml"
    path.write_text("links = [", encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.toml: not a TOML file"):
        load_linkage(path)
    path.write_text("[links.2]\nmass = '1 kg'\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.toml: links.2.centre: missing"):
        load_linkage(path)
