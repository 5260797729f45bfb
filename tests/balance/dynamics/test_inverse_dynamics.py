"""Shaking wrench and drive torque against two independent engines, and against the laws of mechanics."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from balance.balancing.objective import discs
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import (
    Response,
    body_force,
    body_momentum,
    momentum,
    shaking_force_per_acceleration,
    simulate,
)
from balance.errors import ClosureError, ModelError
from balance.mechanism.forward_kinematics import motion, pose
from balance.mechanism.mechanism import Mechanism, Site
from balance.mechanism.tape import Symbols
from balance.motion import Samples
from balance.motion.motion_files import load_motion
from balance.units import G0

from .. import models, referees

OTHERS = {
    "skew arm": models.skew_arm(),
    "spatial four-bar": models.spatial_four_bar(),
    "Bennett": models.bennett(),
    "parallelogram four-bar": models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0),
    "kite four-bar": models.four_bar(0.2, 0.2, 0.35, 0.35, 1.2),
    "driven by its rocker": models.four_bar(0.25, 0.1, 0.26, 0.2, 1.0, driven="rocker"),
}


def both(response: Response, k: int) -> np.ndarray:
    """Wrench at one sample."""
    return np.r_[response.force[k], response.moment[k]]


def assert_mujoco_agrees(mechanism: Mechanism, text: str) -> None:
    """Every sample of a random motion: the loops closed, their rates allowed, wrench and torque equal to 1e-10."""
    motion = referees.random_motion(mechanism)
    mine, referee = simulate(mechanism, motion), referees.MujocoReferee(text, mechanism)
    for k, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        rows, rate = referee.loop_jacobian(q), referee.loop_jacobian(q, v)
        assert referee.gap(q) < 1e-12
        assert np.abs(rows @ v).max(initial=0.0) < 1e-11 * np.abs(v).max()
        assert np.abs(rows @ a + rate @ v).max(initial=0.0) < 1e-11 * np.abs(a).max()
        wrench, torque = referee.response(q, v, a)
        assert referees.relative(both(mine, k), wrench) < 1e-10
        assert referees.relative([values[k] for values in mine.torque.values()], torque) < 1e-10


@pytest.mark.parametrize("name", models.SHIPPED)
def test_shipped_mechanisms_agree_with_mujoco(name: str) -> None:
    """Shaking wrench and drive torque of every shipped mechanism are MuJoCo's on the same file."""
    assert_mujoco_agrees(models.load(name), models.load(name).text)


@pytest.mark.parametrize("name", models.BUILT_IN)
def test_loads_agree_with_mujoco(name: str) -> None:
    """A payload is a mass, a counter-mass a disc at its site: MuJoCo agrees when they are written in the file."""
    mechanism, (payload, counters) = models.loaded(name), models.LOADS[name]
    gyration = {site: mechanism.site(site).radius_of_gyration for site in counters}
    assert_mujoco_agrees(mechanism, referees.with_loads(mechanism.text, payload, counters, gyration))


@pytest.mark.parametrize("name", OTHERS)
def test_spatial_and_special_mechanisms_agree_with_mujoco(name: str) -> None:
    """Skew axes, slides, losses, universal joints, overconstrained welds, special four-bars: MuJoCo agrees."""
    assert_mujoco_agrees(models.model(OTHERS[name]), OTHERS[name])


@pytest.mark.parametrize("name", [*models.SHIPPED, *OTHERS])
def test_pinocchio_agrees(name: str) -> None:
    """Pinocchio's rnea, its root forces summed in the base frame, gives the same wrench and joint torques."""
    mechanism = models.model(OTHERS[name]) if name in OTHERS else models.loaded(name)
    motion = referees.random_motion(mechanism, seed=11)
    mine = simulate(mechanism, motion)
    wrench, torque = referees.pinocchio_response(mechanism, motion)
    assert referees.relative(np.hstack([mine.force, mine.moment]), wrench) < 1e-10
    if not mechanism.loops:
        assert referees.relative(np.array(list(mine.torque.values())).T, torque) < 1e-10


def along_x(mechanism: Mechanism, rate_hz: float = 2000.0) -> Trajectory:
    """The published motion along x."""
    return Closure(mechanism).follow(load_motion("x").sample(rate_hz))


@pytest.mark.parametrize("name", models.MANIPULATORS)
@pytest.mark.parametrize("motion", ["x", "y", "triangle"])
def test_no_momentum_when_balanced(name: str, motion: str) -> None:
    """With the counter-masses of the closed form the linear momentum of both models stays below 1e-12 kg m/s."""
    counter = (1.04642 * 0.05943 + (0.58909 + 5.0) * 0.15 + 0.58909 * 0.0187) / 0.03755
    mechanism = models.load(name).with_payload({"platform": 5.0})
    balanced = mechanism.with_counter_mass({"counter_A0A": counter, "counter_B0B": counter})
    trajectory = Closure(balanced).follow(load_motion(motion).sample(500.0))
    assert np.abs(momentum(balanced, trajectory.q, trajectory.v)[:, :3]).max() < 1e-12
    assert np.abs(momentum(mechanism, trajectory.q, trajectory.v)[:, :3]).max() > 1.0
    assert np.abs(simulate(balanced, trajectory).force).max() < 1e-10


def integral(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Integral over time from the first sample, by trapezia."""
    return cumulative_trapezoid(values, time, axis=0, initial=0.0)


@pytest.mark.parametrize("name", models.MANIPULATORS)
def test_wrench_is_minus_the_rate_of_momentum(name: str) -> None:
    """F = -dL/dt and M = -dH/dt: what the wrench adds up to is the momentum, to the order of the sum."""
    mechanism = models.loaded(name)
    trajectory = along_x(mechanism, 20000.0)
    response = simulate(mechanism, trajectory)
    gained = -integral(np.hstack([response.force, response.moment]), trajectory.time)
    assert referees.relative(gained, momentum(mechanism, trajectory.q, trajectory.v)) < 1e-5


def test_power_of_the_drives_is_the_rate_of_energy() -> None:
    """Drive torque times rate adds up to kinetic and potential energy, gravity along a general direction."""
    text = models.load("parallelogram-6bar").text.replace('gravity="0 -9.81 0"', 'gravity="2 -9.81 1"')
    mechanism = models.model(text)
    trajectory = along_x(mechanism, 20000.0)
    response = simulate(mechanism, trajectory)
    rows = [mechanism.coordinate_index(joint) for joint in response.torque]
    power = sum(torque * trajectory.v[:, row] for torque, row in zip(response.torque.values(), rows, strict=True))
    energy = referees.pinocchio_energy(mechanism, trajectory)
    assert np.ptp(energy) > 1.0
    assert referees.relative(integral(power, trajectory.time), energy - energy[0]) < 1e-5


def test_losses_cost_what_they_dissipate() -> None:
    """Viscous and dry friction and the drives' inertia add b v, c sign(v) and J a to a joint's torque, nothing else."""
    text = models.load("serial-2r").text
    lossy = text.replace('name="J1"', 'name="J1" damping="0.4" frictionloss="0.7" armature="0.05"')
    plain, mechanism = models.load("serial-2r"), models.model(lossy)
    motion = referees.random_motion(plain)
    one, other = simulate(plain, motion), simulate(mechanism, motion)
    added = 0.4 * motion.v[:, 0] + 0.7 * np.sign(motion.v[:, 0]) + 0.05 * motion.a[:, 0]
    np.testing.assert_allclose(other.torque["J1"] - one.torque["J1"], added, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(other.torque["J2"], one.torque["J2"])
    np.testing.assert_array_equal(other.force, one.force)


@pytest.mark.parametrize("name", models.BUILT_IN)
def test_at_rest_nothing_shakes(name: str) -> None:
    """Zero in, zero out: at rest no wrench but the weight, whose moment is that of the centre of mass."""
    mechanism = models.loaded(name)
    motion = referees.random_motion(mechanism)
    still = replace(motion, v=0 * motion.v, a=0 * motion.a)
    response = simulate(mechanism, still)
    assert not np.any(response.force)
    assert not np.any(response.moment)
    assert np.abs(np.array(list(response.torque.values()))).max() > 0.1


@pytest.mark.parametrize("name", models.MANIPULATORS)
def test_twice_as_fast_shakes_four_times_as_much(name: str) -> None:
    """The same path in half the time: wrench four times as large, and the same weight."""
    mechanism = models.loaded(name)
    motion = along_x(mechanism, 500.0)
    one = simulate(mechanism, motion)
    four = simulate(mechanism, replace(motion, v=2 * motion.v, a=4 * motion.a))
    np.testing.assert_allclose(four.force, 4 * one.force, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(four.moment, 4 * one.moment, rtol=1e-12, atol=1e-10)
    np.testing.assert_array_equal(four.weight_moment, one.weight_moment)


def test_weight_moment_is_that_of_the_centre_of_mass() -> None:
    """The moment of the moving weight is centre of mass x total weight; Pinocchio finds the centre."""
    import pinocchio

    mechanism = models.model(models.skew_arm())
    motion = referees.random_motion(mechanism)
    model = mechanism.pinocchio_model()
    centres = np.array([pinocchio.centerOfMass(model, model.createData(), q) for q in motion.q])
    expected = np.cross(centres, mechanism.total_mass * mechanism.gravity)
    np.testing.assert_allclose(simulate(mechanism, motion).weight_moment, expected, rtol=1e-10, atol=1e-10)


def test_summaries_are_those_of_the_series() -> None:
    """RMS and peak of a sine of amplitude 3 are 3/sqrt(2) and 3; columns carry joint and unit."""
    time = np.arange(1000) / 1000.0
    sine, none = 3.0 * np.sin(2 * np.pi * 5 * time), np.zeros((1000, 3))
    response = Response(time, none, none, {"A0": sine}, none)
    assert response.rms()["torque_A0_Nm"] == pytest.approx(3 / np.sqrt(2))
    assert response.peak()["torque_A0_Nm"] == pytest.approx(3.0)
    assert list(response.columns()) == ["Fx_N", "Fy_N", "Fz_N", "Mx_Nm", "My_Nm", "Mz_Nm", "torque_A0_Nm"]
    assert response.rms()["Fx_N"] == 0.0


def test_what_the_drives_are_chosen_by() -> None:
    """Loads and speeds of the driven joints; without losses all power is the rate of the energy, zero in the mean."""
    mechanism = models.loaded("parallelogram-6bar")
    trajectory = along_x(mechanism, 2000.0)
    response = simulate(mechanism, trajectory)
    drives = response.drives()
    assert list(drives) == list(mechanism.driven)
    for joint, load in drives.items():
        assert load["peak_torque_Nm"] == response.peak()[f"torque_{joint}_Nm"]
        assert load["rms_torque_Nm"] == response.rms()[f"torque_{joint}_Nm"]
        at = mechanism.coordinate_index(joint)
        assert load["peak_speed_rad_per_s"] == np.abs(trajectory.v[:, at]).max()
        power = response.torque[joint] * trajectory.v[:, at]
        assert (load["least_power_W"], load["peak_power_W"]) == (power.min(), power.max())
    power = sum(response.torque[joint] * response.speed[joint] for joint in drives)
    assert abs(np.trapezoid(power, trajectory.time)) < 1e-4 * np.trapezoid(np.abs(power), trajectory.time)


def test_the_drive_torque_does_not_depend_on_what_the_motion_is_given_in() -> None:
    """The manipulator driven by its platform or by its two joints along one path needs the same torques."""
    mechanism = models.loaded("parallelogram-6bar")
    by_platform = along_x(mechanism, 500.0)
    rows = [mechanism.coordinate_index(joint) for joint in mechanism.driven]
    q, v, a = (values[:, rows] for values in (by_platform.q, by_platform.v, by_platform.a))
    by_joints = Closure(mechanism).follow(Samples(by_platform.time, q, v, a, joints=mechanism.driven))
    one, other = simulate(mechanism, by_platform), simulate(mechanism, by_joints)
    for joint in mechanism.driven:
        np.testing.assert_allclose(other.torque[joint], one.torque[joint], rtol=1e-9, atol=1e-9)


def test_too_few_motors_are_refused() -> None:
    """One motor on a mechanism of two degrees of freedom does not determine its torque: refused, with both numbers."""
    text = models.load("parallelogram-6bar").text.replace('<motor name="motor_B0" joint="B0"/>', "")
    mechanism = models.model(text)
    with pytest.raises(ModelError, match="2 degrees of freedom and 1 driven joint"):
        simulate(mechanism, along_x(mechanism, 500.0))


def test_without_motors_a_loop_has_no_torque_to_report() -> None:
    """A file without <actuator> gives the wrench and no torques; an open chain then drives every joint."""
    text = models.load("four-bar").text
    four_bar = models.model(text.replace('<motor name="motor_A0" joint="A0"/>', ""))
    motion = referees.random_motion(models.load("four-bar"))
    assert not simulate(four_bar, motion).torque
    chain = models.model(models.load("serial-2r").text.replace('<motor name="motor_J2" joint="J2"/>', "").replace(
        '<motor name="motor_J1" joint="J1"/>', ""
    ))  # fmt: skip
    assert list(simulate(chain, referees.random_motion(chain)).torque) == ["J1", "J2"]


def test_a_motor_at_a_dead_centre_is_refused() -> None:
    """The rocker of a crank-rocker cannot drive it through its dead centres: no torque is given, the time is."""
    text = models.load("four-bar").text.replace('joint="A0"/>\n  </actuator>', 'joint="B0"/>\n  </actuator>')
    mechanism = models.model(text)
    assert mechanism.driven == ("B0",)
    trajectory = Closure(mechanism).follow(load_motion("four-bar").sample(1000.0))
    with pytest.raises(ClosureError, match="dead centre of B0 at t = "):
        simulate(mechanism, trajectory)


def test_a_disc_is_its_mass_at_a_site() -> None:
    """1 kg at a site: parameters of a disc normal to z by Steiner's theorem, its trace the sum of squares."""
    site = Site("s", 0, np.array([0.3, -0.4, 0.1]), radius_of_gyration=0.2)
    m, *first, xx, xy, yy, xz, yz, zz = site.unit_mass()
    assert (m, first) == (1.0, [0.3, -0.4, 0.1])
    at_centre = np.diag([0.02, 0.02, 0.04])
    steiner = 0.26 * np.eye(3) - np.outer(first, first)
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], at_centre + steiner, atol=1e-15)


_SLIDE, _BALL = '<joint name="arm" type="slide" axis="1 0 0"/>', '<joint name="arm" type="ball"/>'


def _euler(angles: str) -> Any:
    """Rotation matrix (3, 3) of a body's ``euler`` [rad], as MuJoCo reads it."""
    return Rotation.from_euler("XYZ", [float(angle) for angle in angles.split()]).as_matrix()


_PUSHED = '<body name="post" euler="0 0.3 0"><joint name="turn" axis="0.6 0.8 0"/>{}</body>'


@pytest.mark.parametrize(
    ("joint", "outer", "axis"),
    [
        ('<joint name="arm" axis="0.6 0 0.8"/>', "{}", (0.6, 0.0, 0.8)), (_SLIDE, _PUSHED, (0.6, 0.8, 0.0)),
        (_BALL, "{}", (0.0, 0.0, 1.0)), (_BALL, _PUSHED, (0.0, 0.0, 1.0)), (_SLIDE, "{}", (0.0, 0.0, 1.0)),
    ],
    ids=["hinge", "slide on a hinge", "ball", "ball on a hinge", "slide"],
)  # fmt: skip
@pytest.mark.parametrize("hand", ["0 0 0", "0.5 0.2 0.1"])
def test_a_disc_is_normal_to_the_axis_that_its_body_turns_about(joint: str, outer: str, axis: Any, hand: str) -> None:
    """As written into the file; a body that is fixed to another turns with that. Of slides alone, its own z axis."""
    if outer == "{}" and joint == _SLIDE:
        axis = _euler(hand)[:, 2]
    disc = '<body name="disc" pos="{}"><inertial pos="0 0 0" mass="2" fullinertia="{}"/></body>'
    at, about = _euler(hand) @ [0.1, 0.0, 0.0] + [0.3, 0.0, 0.0], 0.04 * (np.eye(3) + np.outer(axis, axis))
    wide = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    written = disc.format(" ".join(map(repr, at.tolist())), " ".join(map(repr, wide.tolist())))
    text = models.mjcf(
        outer.format(
            models.link(
                f'<body name="hand" pos="0.3 0 0" euler="{hand}"><site name="s" pos="0.1 0 0"/></body>{{}}',
                "arm",
                joint,
            )
        ),
        '<custom><numeric name="s.radius_of_gyration" data="0.2"/></custom>',
    )
    arm = models.model(text.format(""))
    expected = models.model(text.format(written)).parameters
    np.testing.assert_allclose(arm.with_counter_mass({"s": 2.0}).parameters, expected, atol=1e-15)
    place, turning = replace(arm.site("s"), radius_of_gyration=0.0).unit_mass(), discs(arm, ["s"])[0]
    np.testing.assert_allclose(arm.pi[-10:] + 2.0 * (place + 0.04 * turning[-10:]), expected[-1], atol=1e-15)


def test_a_link_turning_steadily() -> None:
    """A bar turning at w about z: m c w of momentum, J w of angular momentum, m c w2 of centripetal force."""
    mechanism, w, row = models.load("serial-1r"), 3.0, models.load("serial-1r").parameters[0]

    def loads(q: Symbols, v: Symbols) -> Symbols:
        moving = motion(mechanism.tree, at := pose(mechanism.tree, q), v)
        return np.array([body_momentum(row, at, moving, 0), body_force(row, at, moving, 0)], dtype=object)

    ((carried, load),) = models.evaluated(loads, np.array([[0.5]]), np.array([[w]]))
    assert np.linalg.norm(carried[:3]) == pytest.approx(1.2 * 0.14 * w)
    assert carried[5] == pytest.approx(row[9] * w)
    np.testing.assert_allclose(
        load, -1.2 * 0.14 * w**2 * np.array([np.cos(0.5), np.sin(0.5), 0.0, 0.0, 0.0, 0.0]), atol=1e-12
    )


@pytest.mark.parametrize("name", models.MANIPULATORS)
def test_unbalanced_at_5_kg(name: str) -> None:
    """59.617 N per g0 at 5 kg: the first moment 0.9116 kg m over r, times g0."""
    mechanism = models.load(name).with_payload({"platform": 5.0})
    force = shaking_force_per_acceleration(mechanism, "platform")
    assert force is not None
    assert force * G0 == pytest.approx(59.617, abs=5e-4)
    assert force * G0 == pytest.approx(24.276118 * 0.03755 / 0.15 * G0, rel=1e-6)


def test_balanced_is_nothing() -> None:
    """With the exact counter-masses no force, whatever the direction."""
    mechanism = models.load("parallelogram-6bar").with_payload({"platform": 5.0})
    balanced = mechanism.with_counter_mass({"counter_A0A": 24.276118069, "counter_B0B": 24.276118069})
    assert shaking_force_per_acceleration(balanced, "platform") == pytest.approx(0.0, abs=1e-6)


def test_a_point_mass_on_an_arm_shakes_with_its_mass() -> None:
    """A 2R arm whose only mass is at its tip: one newton per m/s2 and kilogram, in every direction."""
    text = models.load("serial-2r").text
    text = text.replace('mass="1.2"', 'mass="1e-9"').replace('pos="0.11 0 0" mass="0.9"', 'pos="0.25 0 0" mass="3"')
    assert shaking_force_per_acceleration(models.model(text), "link_2") == pytest.approx(3.0, rel=1e-6)


def test_where_there_is_no_such_number() -> None:
    """One degree of freedom, or three: the centre's position does not determine the mechanism."""
    assert shaking_force_per_acceleration(models.load("four-bar"), "AB") is None
    assert shaking_force_per_acceleration(models.load("serial-3r"), "link_3") is None


def test_a_body_that_does_not_move_the_mechanism() -> None:
    """The first link of a 2R arm moves on a circle: its centre in the plane says nothing of the second link."""
    assert shaking_force_per_acceleration(models.load("serial-2r"), "link_1") is None


def test_at_rest_only_rounding_is_added_up() -> None:
    """Turned axes along gravity: torques at rest are rounding, and are not refused for differing by rounding."""
    arm = models.link(models.link("", "b", place='pos="0.3 0.1 0.2"'), "a", place='axisangle="3 2 1 0.7"')
    down = Rotation.from_rotvec(0.7 * np.array([3.0, 2.0, 1.0]) / np.sqrt(14.0)).apply([0.0, 0.0, -9.81])
    mechanism = replace(models.model(models.mjcf(arm)), gravity=down)
    still, rates = np.full((5, 2), 0.3), np.tile(np.eye(2), (5, 1, 1))
    response = simulate(mechanism, Trajectory("", np.arange(5.0), still, 0 * still, 0 * still, rates, 0.0, 1.0, ""))
    assert 0.0 < np.abs(response.torque["a"]).max() < 1e-13
