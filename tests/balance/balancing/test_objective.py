"""What is made small: physics, and independence of how a mechanism is written."""

import numpy as np
import pytest

from balance.balancing.conditions import balance_conditions
from balance.balancing.methods import fit_wheels
from balance.balancing.objective import motion_objective, workspace_objective
from balance.balancing.sizing import exact_sizing
from balance.balancing.sizing_study import remaining_directions, verdict_of
from balance.balancing.static_balancing import evaluate_springs
from balance.dynamics.inverse_dynamics import simulate
from balance.dynamics.regressor import potential
from balance.front_door import follow

from .. import models

RANDOM = np.random.default_rng(29)
FIVE_BAR = """<mujoco model="five-bar"><compiler angle="radian"/><option gravity="0 -9.81 0"/>
<worldbody><body name="base">{arms}</body></worldbody>
<equality><connect name="tool" site1="end_{a}" site2="end_{b}"/></equality><actuator>{motors}</actuator>
<keyframe><key name="home" qpos="{home}"/></keyframe></mujoco>"""
ARM = """<body name="crank_{n}" pos="{x} 0 0"><joint name="{n}" axis="0 0 1"/>
<inertial pos="0.08 0 0" mass="{m}" diaginertia="0.001 0.001 0.001"/><site name="counter_{n}" pos="-0.06 0 0"/>
<body name="rod_{n}" pos="0.16 0 0"><joint name="elbow_{n}" axis="0 0 1"/>
<inertial pos="0.12 0 0" mass="0.35" diaginertia="0.001 0.001 0.001"/><site name="end_{n}" pos="0.24 0 0"/>
</body></body>"""


def five_bar(order="lr", masses=(0.42, 0.5)):
    """A five-bar with its arms in either order in the file; mirror-symmetric where both masses are equal."""
    half, crank, rod, angle = 0.1, 0.16, 0.24, 1.9
    elbow = np.array([-half, 0.0]) + crank * np.array([np.cos(angle), np.sin(angle)])
    lift = np.arccos(-elbow[0] / rod)
    home = {"l": (angle, lift - angle), "r": (np.pi - angle, angle - lift)}
    given = {"l": (-half, masses[0]), "r": (half, masses[1])}
    return models.model(
        FIVE_BAR.format(
            arms="".join(ARM.format(n=n, x=given[n][0], m=given[n][1]) for n in order),
            a=order[0],
            b=order[1],
            motors="".join(f'<motor name="m_{n}" joint="{n}"/>' for n in order),
            home=" ".join(f"{value:.17g}" for n in order for value in home[n]),
        )
    )


def slider(scale=1.0, base=0.0, zero=0.0):
    """A crank, a rod with a slide along it that is driven, and a guide that slides on the base; lengths times scale.

    The base frame has its origin ``base`` [m] away, the guide's zero is moved by ``zero`` [m]; the machine is the same.
    """
    x, y = 0.3 * np.cos(0.9) + 0.2 * np.cos(0.9 - 1.4), 0.3 * np.sin(0.9) + 0.2 * np.sin(0.9 - 1.4)
    at = "{:.17g} {:.17g} 0".format
    inertial = '<inertial pos="{}" mass="{}" diaginertia="{i} {i} {i}"/>'.format
    turning = scale**2 * 0.002
    return models.model(
        f"""<mujoco model="slider"><compiler angle="radian"/><worldbody><body name="base">
<body name="crank" pos="{at(base, 0)}"><joint name="crank" axis="0 0 1"/>{inertial(at(0.1 * scale, 0), 0.5, i=turning)}
<site name="counter_crank" pos="{at(-0.1 * scale, 0)}"/>
<body name="rod" pos="{at(0.3 * scale, 0)}"><joint name="rod" axis="0 0 1"/>
{inertial(at(0.1 * scale, 0), 0.4, i=turning)}
<site name="counter_rod" pos="{at(-0.1 * scale, 0)}"/>
<body name="end"><joint name="end" type="slide" axis="1 0 0"/>
{inertial(at(0, 0), 0.2, i=turning)}<site name="a"/></body>
</body></body>
<body name="guide" pos="{at(base + x * scale - zero, y * scale)}"><joint name="guide" type="slide" axis="0 1 0"/>
{inertial(at(0, 0), 0.3, i=turning)}
<body name="across"><joint name="across" type="slide" axis="1 0 0"/><site name="b"/></body></body>
</body></worldbody><equality><connect name="c" site1="a" site2="b"/></equality>
<actuator><motor joint="crank"/><motor joint="rod"/><motor joint="end"/></actuator>
<keyframe><key name="home" qpos="0.9 -1.4 {0.2 * scale:.17g} 0 {zero:.17g}"/></keyframe></mujoco>"""
    )


def masses_of(mechanism):
    """Masses by site over the workspace."""
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    return {c.site: c.mass for c in sized.counter_masses}


def test_the_order_in_the_file_does_not_matter():
    """Incomplete balance of unequal arms: the same masses, whichever arm is written first."""
    there, back = masses_of(five_bar("lr")), masses_of(five_bar("rl"))
    assert set(there) == set(back) == {"counter_l", "counter_r"}
    assert back == pytest.approx(there, rel=1e-9)  # closed to 1e-12 of its size, and as well conditioned
    assert abs(there["counter_l"] - there["counter_r"]) > 0.1


def test_the_order_in_the_file_does_not_matter_to_springs_and_wheels():
    """The swing of potential energy, and wheels that leave some angular momentum, were those of random states."""
    there, back = five_bar("lr"), five_bar("rl")
    swings = [evaluate_springs(one, ()).swing() for one in (there, back)]
    assert swings[1] == pytest.approx(swings[0], rel=1e-9)
    wheels = [{one.bodies[w.body]: w.momentum for w in fit_wheels(one).wheels} for one in (there, back)]
    assert wheels[1] == pytest.approx(wheels[0], rel=1e-6)  # least squares of what is left in part
    assert len(wheels[0]) > 1


@pytest.mark.parametrize("limit", [0.02, 0.1, 0.3])
def test_a_workspace_narrower_than_a_step_is_no_single_state(limit):
    """At one state wheels cancel all and nothing swings: a mechanism of little room counted as balanced."""
    link = '<body name="{0}" pos="{1} 0 0"><joint name="{0}" axis="0 0 1" range="-{2} {2}" limited="true"/>'
    link += '<inertial pos="0.1 0.2 0" mass="2" diaginertia="0.02 0.03 0.04"/>{3}</body>'
    arm = link.format("a", 0, limit, link.format("b", 0.3, limit, ""))
    arm = models.model(models.mjcf(arm, '<actuator><motor joint="a"/><motor joint="b"/></actuator>'))
    assert 1e-5 < fit_wheels(arm).residual_share < 0.5  # the momentum depends on the angle between the links
    corners = limit * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])  # the weight turns it everywhere
    swing = np.ptp(potential(arm, corners))
    assert 0.75 * swing < evaluate_springs(arm, ()).swing() <= swing


@pytest.mark.parametrize("same", [{"scale": 40.0}, {"scale": 0.01}, {"base": 3.0}, {"zero": 2.0}], ids=str)
def test_neither_units_of_length_nor_origins_matter(same):
    """Angles and slides in one mechanism: the same masses in metres or millimetres, wherever zeros lie."""
    assert masses_of(slider(**same)) == pytest.approx(masses_of(slider()), rel=1e-7)  # closed to 1e-12 of its size


def test_a_symmetric_mechanism_gets_symmetric_masses():
    """Mirror images carry the same mass."""
    masses = masses_of(five_bar(masses=(0.42, 0.42)))
    assert masses["counter_l"] == pytest.approx(masses["counter_r"], rel=1e-9)


@pytest.mark.parametrize("name", ["parallelogram-6bar", "four-bar", "serial-3r"])
def test_the_objective_of_a_motion_is_the_mean_square_that_simulation_gives(name):
    """Force, moment and torque, with any counter-masses: by the triangle and by inverse dynamics."""
    mechanism = models.load(name)
    trajectory = follow(mechanism, {"parallelogram-6bar": "x"}.get(name, name))
    mounted = mechanism.with_counter_mass(dict.fromkeys(mechanism.counter_sites, 1.7))
    response = simulate(mounted, trajectory)
    torque = np.array(list(response.torque.values())).T
    for quantity, samples in (("force", response.force), ("moment", response.moment), ("torque", torque)):
        expected = np.mean(np.sum(samples**2, axis=1))
        found = motion_objective(mechanism, trajectory, {quantity: 1.0}).value(mounted)
        assert found == pytest.approx(expected, rel=1e-9)


def test_several_quantities_are_weighed_by_what_they_are_without_counter_masses():
    """Without counter-masses, J is the sum of the weights."""
    mechanism = models.load("four-bar")
    trajectory = follow(mechanism, "four-bar")
    objective = motion_objective(mechanism, trajectory, {"force": 1.0, "moment": 2.0, "torque": 0.5})
    assert objective.value(mechanism) == pytest.approx(3.5, rel=1e-12)


def test_the_momentum_of_a_pendulum_per_kinetic_energy():
    """A body on a pivot: p' p / (2 T) = (m c)^2 / I, in every position."""
    mechanism = models.load("serial-1r")
    row = mechanism.parameters[0]
    assert workspace_objective(mechanism).value(mechanism) == pytest.approx(row[1] ** 2 / row[9], rel=1e-12)


def test_it_does_not_depend_on_the_scale_of_masses():
    """All masses doubled: the momentum per kinetic energy doubles, and so do the counter-masses."""
    text = models.load("four-bar").text
    once = models.model(text)
    twice = once.with_payload({body: 2.0 * once.mass(body) for body in once.bodies})
    assert workspace_objective(twice).value(twice) == pytest.approx(
        2.0 * workspace_objective(once).value(once), rel=1e-9
    )


def test_what_remains_and_which_body_lacks_a_site():
    """A four-bar with a site on its crank alone: directions of the force; the coupler or the rocker lacks one."""
    mechanism = models.load("four-bar")
    trajectory = follow(mechanism, "four-bar")
    objective = motion_objective(mechanism, trajectory)
    sized = exact_sizing(balance_conditions(mechanism), mechanism, ["counter_A0A"], objective=objective)
    for other in (0.0, 1.0, 1.658, 2.17):
        assert objective.value(mechanism.with_counter_mass({"counter_A0A": other})) > objective.value(sized.after)
    verdict = verdict_of(sized, sized, lambda one: simulate(one, trajectory).force)
    assert not verdict.balanced
    assert verdict.has_finding
    response = simulate(sized.after, trajectory).force
    assert sum(one.after**2 for one in verdict.directions) == pytest.approx(verdict.after**2, rel=1e-9)
    assert np.mean((response @ verdict.directions[0].direction) ** 2) == pytest.approx(verdict.directions[0].after ** 2)
    assert [[one.counter_masses[-1].site for one in equals] for equals in verdict.needed] == [["on AB", "on B0B"]]


def test_directions_in_which_nothing_is_left_are_those_of_what_there_was():
    """Of x and y both balanced, which rounding alone told apart: the greater force first, whatever rounding is left."""
    time = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    turn = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
    before = np.stack([3.0 * np.sin(time), 2.0 * np.cos(time), np.sin(2.0 * time)], axis=1) @ turn
    left = before @ np.outer(turn[2], turn[2])
    for _ in range(3):
        found = remaining_directions(before, left + 1e-9 * RANDOM.normal(size=left.shape))
        assert np.abs(np.array([one.direction for one in found]) @ turn.T) == pytest.approx(
            np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), abs=1e-6
        )
        assert [one.after for one in found] == pytest.approx([np.sqrt(0.5), 0.0, 0.0], rel=1e-6)


def test_complete_balance_needs_nothing():
    """Both sites of the four-bar: nothing remains."""
    mechanism = models.load("four-bar")
    sized = exact_sizing(balance_conditions(mechanism), mechanism)
    verdict = verdict_of(sized, sized, None)
    assert (verdict.balanced, verdict.needed, verdict.directions, verdict.has_finding) == (True, (), (), False)


def test_equal_masses():
    """Sites of one group carry the same mass, which is the best that is the same."""
    mechanism = five_bar()
    found = balance_conditions(mechanism)
    sized = exact_sizing(found, mechanism, equal=[("counter_l", "counter_r")])
    one, other = (c.mass for c in sized.counter_masses)
    assert one == other
    for step in (-1e-3, 1e-3):
        mounted = mechanism.with_counter_mass(dict.fromkeys(("counter_l", "counter_r"), one + step))
        assert sized.objective.value(mounted) > sized.objective.value(sized.after)
