"""Linkages as MJCF."""

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.closure import Closure
from balance.errors import ClosureError, ModelError
from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.linkage_files import load_linkage
from balance.linkages.mjcf_writer import geared_trajectory, linkage_mjcf
from balance.linkages.verification import turn_samples
from balance.mechanism.mjcf_parser import mechanism_from_text

from .conftest import balanced, free_base, left_over


def test_gears_in_mujoco_follow_their_ratios():
    """A position of the closed linkage with counter-gears as coupled satisfies MuJoCo's own joint equalities."""
    result = balance_linkage(load_linkage("two-levels"))
    linkage = result.linkage
    plain, geared = (mechanism_from_text(linkage_mjcf(result, stage), "x") for stage in ("before", "complete"))
    closure = Closure(plain)
    start = float(closure.home[plain.coordinate_index("A0")])
    path = geared_trajectory(result, closure.follow(turn_samples(linkage, 10.0, 0.2, start, 12)), plain, geared)
    model = mujoco.MjModel.from_xml_string(linkage_mjcf(result, "complete", couplings=True))
    data = mujoco.MjData(model)
    first = path.q[0]
    for q, v in zip(path.q, path.v, strict=True):
        data.qpos[:], data.qvel[:] = q - first + model.key_qpos[0], v
        mujoco.mj_forward(model, data)
        assert data.nefc == 2 * 3 + 4
        assert np.abs(data.efc_pos).max() < 1e-9
        assert np.abs(data.efc_vel).max() < 1e-9


def test_gears_in_the_file_keep_all_momenta_zero():
    """With its gears as couplings, the linkage has one freedom, and linear and angular momentum that stay zero."""
    text = linkage_mjcf(balance_linkage(load_linkage("two-levels")), "complete", couplings=True)
    found = balance_conditions(mechanism_from_text(text, "x"), "planar")
    assert (found.dof, len(found.mechanism.loops)) == (1, 6)
    assert np.abs(found.values()).max() < 1e-6


def test_a_linkage_that_does_not_close_is_refused(slider_crank_keys):
    """A connecting rod that is too short is found before anything is simulated."""
    keys = slider_crank_keys
    keys["joints"]["C"]["3"] = ["20 mm", "0 m"]
    with pytest.raises(ClosureError, match=r"cannot be closed near the angles under \[start\]"):
        linkage_mjcf(balanced(keys), "before")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda keys: keys["start"].pop("3"), "has no angle of body 3"),
        (lambda keys: keys.pop("drive"), "has no driven joint"),
        (lambda keys: keys.update(drive="A"), "driven joint A must be a revolute joint on the ground"),
    ],
)
def test_what_a_simulation_needs_is_named(change, message, slider_crank_keys):
    """Each in one message."""
    change(slider_crank_keys)
    with pytest.raises(ModelError, match=message):
        linkage_mjcf(balanced(slider_crank_keys), "before")


def shaper():
    """A crank whose block slides on a rocker, both geared: to the crank and to the ground; a ram on its guide."""
    place = {"radius": "60 mm", "radius_of_gyration": "20 mm"}
    sliding = {"point": ["0 m", "0 m"], "along": "0 deg"}
    return {
        "drive": "O2",
        "speed": "80 rpm",
        "links": {
            "2": {"mass": "0.9 kg", "centre": ["27 mm", "7 mm"], "inertia": "2e-3 kg m^2", "counter_mass": place},
            "3": {"mass": "0.3 kg", "centre": ["6 mm", "-4 mm"], "inertia": "2e-4 kg m^2", "counter_mass": place},
            "4": {"mass": "2 kg", "centre": ["0.2 m", "11 mm"], "inertia": "0.03 kg m^2", "counter_mass": place},
            "5": {"mass": "0.8 kg", "centre": ["0.1 m", "9 mm"], "inertia": "4e-3 kg m^2", "counter_mass": place},
            "6": {"mass": "3 kg", "centre": ["50 mm", "0 m"]},
        },
        "joints": {
            "O2": {"ground": ["0 m", "0 m"], "2": ["0 m", "0 m"]},
            "A": {"2": ["80 mm", "0 m"], "3": ["0 m", "0 m"]},
            "S": {"kind": "prismatic", "3": sliding, "4": {"point": ["0 m", "5 mm"], "along": "0 deg"}},
            "O4": {"ground": ["0 m", "-0.2 m"], "4": ["0 m", "0 m"]},
            "B": {"4": ["0.42 m", "0 m"], "5": ["0 m", "0 m"]},
            "C": {"5": ["0.25 m", "0 m"], "6": ["0 m", "0 m"]},
            "G": {"kind": "prismatic", "ground": {"point": ["0 m", "0.2 m"], "along": "0 deg"}, "6": sliding},
        },
        "start": {"2": "80 deg", "3": "88 deg", "4": "88 deg", "5": "5 deg"},
        "gears": {
            "z2": {"body": "2", "teeth": [50, 20]},
            "z3": {"body": "3", "teeth": [48, 31], "counter": {"mass": "0.5 kg"}},
            "z4": {"body": "4", "teeth": [48, 31]},
            "z5": {"body": "5", "teeth": [22, 37], "counter": {"mass": "0.9 kg", "at": ["0.25 m", "3 cm"], "on": "4"}},
        },
    }  # fmt: skip


def pushed(text, torque):
    """How far a free base and the crank have come after 0.1 s of torque on the crank, by MuJoCo forwards."""
    mujoco.MjModel.from_xml_string(text)  # as written: no inertia is too small for it
    root = free_base(text)
    key = root.find("keyframe/key")
    key.set("qpos", "0 0 0 " + key.get("qpos"))
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    model.opt.timestep, model.opt.integrator, model.eq_solref[:] = 1e-4, mujoco.mjtIntegrator.mjINT_RK4, [0.001, 1.0]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert np.abs(data.efc_pos).max() < 1e-9
    data.ctrl[0], start = torque, data.joint("O2").qpos[0]
    mujoco.mj_step(model, data, 1000)
    return np.abs(data.qpos[:3]).max(), data.joint("O2").qpos[0] - start


def test_a_pushed_linkage_leaves_a_free_base_where_it_is_in_mujoco():
    """The file as written, its gears as joint equality and, where several joints turn one, as tendon; both are soft."""
    result = balanced(shaper())
    text = linkage_mjcf(result, "complete", couplings=True)
    assert [tendon.get("name") for tendon in ElementTree.fromstring(text).findall("tendon/fixed")] == ["z3*"]
    moved, turned = pushed(text, 100.0)
    assert turned > 0.3
    assert moved < 1e-4 * turned
    moved, turned = pushed(linkage_mjcf(result, "before"), 1.0)
    assert moved > 1e-2 * turned
    with pytest.raises(ModelError, match=r"coupling between joints|tendon"):
        mechanism_from_text(text, "x")


def test_a_point_mass_that_turns_gets_no_inertia_worth_mentioning(slider_crank_keys):
    """A rod without inertia of its own, and none invented: balanced, and its torque that of a point mass."""
    keys = slider_crank_keys
    keys["links"]["3"] |= {"inertia": "0 kg m^2", "centre": ["0 m", "0 m"], "mass": "20 kg"}
    keys["links"]["4"] |= {"mass": "1e-6 kg", "centre": ["0 m", "0 m"]}
    del keys["gears"]["z3"]
    keys["gears"]["z3"] = {"body": "3", "counter": {"mass": "1e-9 kg"}}
    assert left_over(balanced(keys)) < 1e-10
