"""The named methods: published conditions against derived ones, and each method rebuilt part by part in Pinocchio."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

import balance
from balance.balancing import closed_forms, conditions, methods
from balance.balancing.sizing import Sizing, exact_sizing
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import momentum, simulate
from balance.dynamics.regressor import first_moment
from balance.errors import ModelError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism, mechanism_from_text
from balance.motion import Samples
from balance.motion.motion_files import load_motion

from .. import models, referees


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("seed", [0, 1])
def test_serial_chains_equal_the_derived_conditions(count, seed):
    """1R to 5R of random lengths: the same space of conditions to 1e-12."""
    (comparison,) = closed_forms.compare_conditions(
        conditions.balance_conditions(models.model(models.serial_chain(count, 10 * count + seed)))
    )
    assert comparison.rank == (2 * count, 2 * count)
    assert comparison.is_equal(1e-12)
    assert comparison.verdict() == "equal to the derived conditions"


@pytest.mark.parametrize("name", ["serial-1r", "serial-2r", "serial-3r", "serial-4r", "serial-5r"])
def test_shipped_chains_equal_the_derived_conditions(name):
    """1R to 5R as shipped."""
    (comparison,) = closed_forms.compare_conditions(conditions.balance_conditions(load_mechanism(name)))
    assert comparison.is_equal(1e-12)


FOUR_BARS = {
    "shipped": lambda: models.load("four-bar"),
    "crank-rocker": lambda: models.model(models.four_bar(0.31, 0.07, 0.26, 0.22, 0.6)),
    "double crank": lambda: models.model(models.four_bar(0.1, 0.25, 0.28, 0.3, 0.9)),
    "kite": lambda: models.model(models.four_bar(0.2, 0.2, 0.35, 0.35, 1.2)),
}


@pytest.mark.parametrize("build", FOUR_BARS.values(), ids=FOUR_BARS)
def test_both_printed_four_bar_methods(build):
    """Loop closure equals the derived ones to 1e-12; so does the split once the coupler's centre is on its line."""
    split, closure = closed_forms.compare_conditions(conditions.balance_conditions(build()))
    assert closure.rank == (4, 4)
    assert closure.is_equal(1e-12)
    assert split.sufficient < 1e-12
    assert split.equal_given < 1e-12
    assert split.verdict().startswith("sufficient, not necessary: equal once mcy[")


def test_the_parallelogram_four_bar_needs_less():
    """Its printed four conditions are sufficient, not necessary: two are enough."""
    text = models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0)
    split, closure = closed_forms.compare_conditions(conditions.balance_conditions(models.model(text)))
    assert closure.rank == (4, 2)
    assert closure.sufficient < 1e-12
    assert closure.verdict() == "sufficient, not necessary"
    assert split.verdict() == "sufficient, not necessary"


@pytest.mark.parametrize("share", [-0.3, 0.0, 0.4, 1.0, 1.7])
def test_whatever_the_split_the_four_bar_is_balanced(share):
    """m2b = share m2, each chain balanced as 2R: linear momentum of any motion below 1e-12."""
    mechanism, (l1, l2, l3) = models.load("four-bar"), (0.1, 0.26, 0.2)
    rows = mechanism.parameters.copy()
    crank, coupler, rocker = (mechanism.body_index(body) for body in ("A0A", "AB", "B0B"))
    part_b = share * rows[coupler, 0]
    rows[coupler, 1:3] = part_b * l2, 0.0
    rows[crank, 1:3] = -(rows[coupler, 0] - part_b) * l1, 0.0
    rows[rocker, 1:3] = -part_b * l3, 0.0
    balanced = replace(mechanism, parameters=rows)
    closure = Closure(balanced)
    q = closure.states(20)
    assert np.abs(momentum(balanced, q, closure.velocities(q))[:, :3]).max() < 1e-12
    assert conditions.balance_conditions(mechanism).first_moment_residual(balanced) < 1e-12


def test_other_mechanisms_have_no_printed_chain_or_four_bar():
    """The manipulator and a spatial linkage are no chain and no planar four-bar."""
    assert closed_forms.compare_conditions(conditions.balance_conditions(models.load("parallelogram-6bar"))) == []
    assert closed_forms.four_bar_lengths(models.model(models.spatial_four_bar())) is None
    assert closed_forms.serial_lengths(models.model(models.skew_arm())) is None


def waving(mechanism: Mechanism, count: int = 120) -> Trajectory:
    """A motion of all driven joints at once, at varying speed."""
    time = np.linspace(0.0, 1.0, count)
    joints = mechanism.driven
    start = Closure(mechanism).home[[mechanism.coordinate_index(joint) for joint in joints]]
    w, size = 2 * np.pi * (1 + np.arange(len(joints))), 0.5
    place = start + size * np.sin(np.outer(time, w))
    return Closure(mechanism).follow(
        Samples(
            time, place, size * w * np.cos(np.outer(time, w)), -size * w**2 * np.sin(np.outer(time, w)), joints=joints
        )
    )


def balanced(mechanism: Mechanism) -> tuple[Mechanism, Sizing]:
    """With the exact counter-masses."""
    sized = exact_sizing(conditions.balance_conditions(mechanism), mechanism)
    return sized.after, sized


@pytest.mark.parametrize("name", ["serial-1r", "serial-2r", "serial-3r", "four-bar"])
def test_wheels_cancel_the_moment_in_pinocchio(name):
    """Counter-masses and geared wheels built as bodies: force and moment below 1e-10 of before, torques as stated."""
    plain = models.load(name)
    heavy, sized = balanced(plain)
    motion, ratio = waving(plain), 1.7
    outcome = methods.counter_inertia_outcome(heavy, motion, ratio, 0.1, sized.added_mass)
    wheels = methods.fit_wheels(heavy).wheels
    counters = {c.site: c.mass for c in sized.counter_masses}
    root = ElementTree.fromstring(referees.with_loads(plain.text, {}, counters, {}))
    base = root.find("worldbody/body")
    for wheel in wheels:
        body = ElementTree.SubElement(base, "body", name=f"wheel_{wheel.body}", pos="0.3 0.2 0")
        ElementTree.SubElement(body, "joint", name=f"w{wheel.body}", axis="0 0 1")
        inertia = repr(abs(wheel.momentum) / ratio)
        ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia=f"{inertia} {inertia} {inertia}")
    for part in ("actuator", "keyframe"):
        root.remove(root.find(part))
    whole = mechanism_from_text(ElementTree.tostring(root, encoding="unicode"), "whole")
    signs = [-ratio * np.sign(wheel.momentum) for wheel in wheels]
    own = [whole.coordinates.index(joint) for joint in plain.coordinates]
    geared = [whole.coordinates.index(f"w{wheel.body}") for wheel in wheels]
    gains = absolute_gains(plain, motion)
    rates = [gains[:, wheel.body] for wheel in wheels]
    states = []
    for values in (motion.q, motion.v, motion.a):
        state = np.zeros((len(motion.time), len(whole.coordinates)))
        state[:, own] = values
        for place, sign, rate in zip(geared, signs, rates, strict=True):
            state[:, place] = sign * np.einsum("nj,nj->n", rate, values)
        states.append(state)
    wrench, torque = referees.pinocchio_response(whole, replace(motion, q=states[0], v=states[1], a=states[2]))
    before = simulate(plain, motion)
    assert np.abs(wrench[:, :2]).max() < 1e-10 * np.abs(before.force).max()
    assert np.abs(wrench[:, 5]).max() < 1e-10 * np.abs(before.moment).max()
    np.testing.assert_allclose(outcome.force[:, :2], wrench[:, :2], atol=1e-9)
    np.testing.assert_allclose(outcome.moment[:, 2], wrench[:, 5], atol=1e-9)
    for k, joint in enumerate(plain.driven):
        motor = np.einsum("nj,nj->n", motion.per_drive[:, :, k], torque[:, own])
        for place, sign, rate in zip(geared, signs, rates, strict=True):
            motor += torque[:, place] * sign * np.einsum("nj,nj->n", rate, motion.per_drive[:, :, k])
        np.testing.assert_allclose(outcome.torque[joint], motor, atol=1e-9)


def absolute_gains(mechanism: Mechanism, motion: Trajectory) -> np.ndarray:
    """A body's rotation in the base frame per joint rate: ones along its path, (n, bodies, nv)."""
    rows = np.zeros((len(mechanism.bodies), mechanism.tree.size))
    for body, joint in enumerate(mechanism.tree.bodies):
        rows[body, mechanism.tree.path(joint)] = 1.0
    return np.broadcast_to(rows, (len(motion.time), *rows.shape))


def test_wheels_state_their_residual():
    """The manipulator's angular momentum is no constant mixture of rotations, nor that of an off-line coupler."""
    manipulator = methods.fit_wheels(balanced(models.load("parallelogram-6bar"))[0])
    assert not manipulator.is_complete()
    assert 0.05 < manipulator.residual_share < 1.0
    coupler = models.load("four-bar")
    rows = coupler.parameters.copy()
    rows[coupler.body_index("AB"), 2] = 0.03
    free = {"counter_A0A": 0.0}
    tilted = replace(coupler, parameters=rows).with_counter_mass(free)
    rows = tilted.parameters.copy()
    found = conditions.balance_conditions(tilted)
    first = [10 * body + k for body in range(3) for k in (1, 2)]
    change = np.linalg.lstsq(found.matrix[:, first], -found.values(tilted), rcond=None)[0]
    rows.ravel()[first] += change
    forced = replace(tilted, parameters=rows)
    assert found.first_moment_residual(forced) < 1e-12
    assert not methods.fit_wheels(forced).is_complete()


TURNS = {"": 1.0, "_lr": -1.0, "_ud": -1.0, "_half": 1.0}
"""Signs of the joint angles of a chain's images: mirrored bodies turn the other way."""
IMAGES = {
    "mirror image, left-right": ("", "_lr"),
    "mirror image, up-down": ("", "_ud"),
    "image turned by 180 deg": ("", "_half"),
    "three images": tuple(TURNS),
}


def with_images(name: str, copies: tuple[str, ...]) -> Mechanism:
    """A serial chain and images of it on one base; left-right mirrors and half turns stand on pi."""
    root = ElementTree.fromstring(models.load(name).text)
    base = root.find("worldbody/body")
    (arm,) = base.findall("body")
    for suffix in copies[1:]:
        copy = ElementTree.fromstring(ElementTree.tostring(arm))
        copy.set("euler", f"0 0 {0.0 if suffix == '_ud' else np.pi!r}")
        for element in copy.iter():
            if element.get("name"):
                element.set("name", element.get("name") + suffix)
        base.append(copy)
    for part in ("actuator", "keyframe"):
        root.remove(root.find(part))
    return mechanism_from_text(ElementTree.tostring(root, encoding="unicode"), "copies")


def test_the_inertia_of_an_image_is_about_the_axis_that_it_turns_about():
    """A pendulum in x-y whose frame has its own x axis along the joint: as with z there."""
    pendulum = '<body name="b" {}><joint name="b" axis="{}"/><inertial pos="{}" mass="2" diaginertia="{}"/></body>'
    upright = models.model(models.mjcf(pendulum.format("", "0 0 1", "0.1 0.2 0", "0.02 0.03 0.04")))
    turned = models.model(models.mjcf(pendulum.format('xyaxes="0 1 0 0 0 1"', "0 1 0", "0.2 0 0.1", "0.03 0.04 0.02")))
    found = [methods.mirror_outcomes(one, waving(one))[0].added_inertia for one in (upright, turned)]
    assert found == pytest.approx([0.04 + 2.0 * 0.05] * 2, rel=1e-9)


@pytest.mark.parametrize("method", IMAGES)
@pytest.mark.parametrize("name", ["serial-1r", "serial-2r", "serial-3r"])
def test_images_in_pinocchio(name, method):
    """Images as bodies of their own: the residual force and moment, and the torques of common motors."""
    plain, copies = models.load(name), IMAGES[method]
    motion, whole = waving(plain), with_images(name, copies)
    outcome = next(o for o in methods.mirror_outcomes(plain, motion) if o.name == method)
    places = {s: [whole.coordinates.index(joint + s) for joint in plain.coordinates] for s in copies}
    states = np.zeros((3, len(motion.time), len(whole.coordinates)))
    for state, values in zip(states, (motion.q, motion.v, motion.a), strict=True):
        for suffix in copies:
            state[:, places[suffix]] = TURNS[suffix] * values
    q, v, a = states
    wrench, torque = referees.pinocchio_response(whole, replace(motion, q=q, v=v, a=a))
    np.testing.assert_allclose(outcome.force[:, :2], wrench[:, :2], atol=1e-10)
    np.testing.assert_allclose(outcome.moment[:, 2], wrench[:, 5], atol=1e-10)
    for k, joint in enumerate(plain.driven):
        motor = sum(TURNS[s] * torque[:, places[s][k]] for s in copies)
        np.testing.assert_allclose(outcome.torque[joint], motor, atol=1e-10)
    assert outcome.added_mass == pytest.approx((len(copies) - 1) * plain.total_mass)
    if method == "three images":
        assert outcome.force_peak < 1e-12


@pytest.mark.parametrize("name", ["serial-3r", "four-bar", "parallelogram-6bar"])
def test_active_masses_keep_momentum_zero(name):
    """Mass times place follows minus the first moment; stroke as asked, force and power those of that motion."""
    mechanism = models.load(name)
    motion = waving(mechanism)
    outcome = methods.active_outcome(mechanism, motion, 0.08, 3.0)
    moment, linear = first_moment(mechanism, motion.q), momentum(mechanism, motion.q, motion.v)
    response = simulate(mechanism, motion)
    for axis, letter in enumerate("xy"):
        if (mass := outcome.needs.get(f"mass_{letter}_kg")) is None:
            assert np.ptp(moment[:, axis]) < 1e-8
            continue
        place = -moment[:, axis] / mass
        assert np.ptp(place) == pytest.approx(0.08, rel=1e-12)
        speed = np.gradient(place, motion.time, edge_order=2)
        np.testing.assert_allclose(mass * speed + linear[:, axis], 0.0, atol=0.02 * np.abs(linear[:, axis]).max())
        peak = np.abs(response.force[:, axis] * linear[:, axis] / mass).max()
        assert outcome.needs[f"power_{letter}_peak_W"] == pytest.approx(peak)
    assert outcome.needs["disc_turn_rad"] == pytest.approx(3.0)
    assert outcome.force_peak == outcome.moment_peak == 0.0


@pytest.mark.parametrize("name", ["serial-2r", "four-bar", "parallelogram-6bar"])
def test_springs_free_the_motors_of_weight(name):
    """Their torque is that of the same motion without gravity; force and moment are as before."""
    mechanism = models.load(name)
    motion = waving(mechanism)
    outcomes = {o.name: o for o in methods.compare_methods(mechanism, motion)}
    weightless = simulate(replace(mechanism, gravity=np.zeros(3)), motion)
    for joint, torque in outcomes["springs"].torque.items():
        np.testing.assert_allclose(torque, weightless.torque[joint], atol=1e-10)
    np.testing.assert_array_equal(outcomes["springs"].force, outcomes["as it is"].force)


def test_force_balance_alone_raises_moment_and_torque():
    """On the manipulator at 5 kg along x, both go up; counter-masses cancel the force to rounding."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": 5.0})
    motion = Closure(mechanism).follow(load_motion("x").sample(500.0))
    outcomes = {o.name: o for o in methods.compare_methods(mechanism, motion)}
    plain, heavy = outcomes["as it is"], outcomes["counter-mass"]
    assert heavy.force_peak < 1e-12 * plain.force_peak
    assert heavy.moment_rms > plain.moment_rms
    assert heavy.torque_rms()["A0"] > plain.torque_rms()["A0"]
    assert heavy.added_mass == pytest.approx(2 * 24.27612, rel=1e-5)


def test_wheels_that_turn_faster_are_lighter_and_ask_more():
    """Inertia falls with the ratio, what it adds to the torque grows with it."""
    mechanism, sized = balanced(models.load("serial-2r"))
    motion = waving(mechanism)
    slow, fast = (methods.counter_inertia_outcome(mechanism, motion, k, 0.1, sized.added_mass) for k in (1.0, 3.0))
    own = simulate(mechanism, motion).torque["J1"]
    assert fast.added_inertia == pytest.approx(slow.added_inertia / 3.0)
    np.testing.assert_allclose(fast.torque["J1"] - own, 3.0 * (slow.torque["J1"] - own), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("name", "letters"), [("serial-2r", "xzy"), ("four-bar", "yzx")])
def test_methods_act_in_the_plane_of_the_mechanism(name, letters):
    """What they leave, cost and need is the same in x-y and in another plane; the names of its axes go with it."""
    plain = models.load(name)
    written = np.array([[float(a == b) for a in letters] for b in "xyz"])  # of x-y, in the other's axes
    written[:, 2] *= np.linalg.det(written)
    other = models.model(models.reframed(plain.text, written.T), plain.name)
    names = str.maketrans("xyz", letters)
    for own, found in zip(*(methods.compare_methods(one, waving(one)) for one in (plain, other)), strict=True):
        np.testing.assert_allclose(found.force, own.force @ written.T, atol=1e-9)
        np.testing.assert_allclose(found.moment, own.moment @ written.T, atol=1e-9)
        assert found.torque_rms() == pytest.approx(own.torque_rms(), rel=1e-8)
        assert (found.added_mass, found.added_inertia) == pytest.approx((own.added_mass, own.added_inertia), rel=1e-8)
        needs = {re.sub("_([xy])_", lambda m: m[0].translate(names), key): value for key, value in own.needs.items()}
        assert found.needs == pytest.approx(needs, rel=1e-6)
        assert found.note == re.sub("[FM][xyz]", lambda m: m[0].translate(names), own.note)


def test_what_shakes_out_of_the_plane_is_refused():
    """A spatial arm is not computed as a planar one."""
    arm = models.model(models.skew_arm())
    with pytest.raises(ModelError, match="out of the plane"):
        methods.compare_methods(arm, waving(arm, 30))
    plain, (c, s) = models.load("serial-2r"), (0.8, 0.6)
    turned = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    oblique = models.model(models.reframed(plain.text, turned), plain.name)
    with pytest.raises(ModelError, match=r"its plane has the normal \[-?0\.0, -?0\.6, 0\.8\], along no axis"):
        methods.compare_methods(oblique, waving(oblique, 30))


def test_a_table_has_what_all_methods_have():
    """No empty cell; what one method needs, and its note, are apart."""
    found = balance.methods("serial-2r", "serial-2r")
    assert not found.table().isna().any(axis=None)
    assert {"method", "force_rms_N", "torque_rms_Nm.J1"} < set(found.table()) < {*found.table(), "note"}
    assert any(row["needs"] and row["note"] for row in found.rows)


def test_without_a_place_for_counter_masses_the_rest_is_compared():
    """Springs, images and active masses need no site."""
    chain_without = models.model(models.serial_chain(2, 3).replace("counter_", "hole_"))
    names = [o.name for o in methods.compare_methods(chain_without, waving(chain_without, 60))]
    assert "springs" in names
    assert "counter-mass" not in names
