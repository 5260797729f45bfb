"""Closed configurations, degrees of freedom, walks over the loops; what cannot close is refused."""

import re

import numpy as np
import pytest

from balance.balancing.nested_sizing import study_nested
from balance.balancing.objective import workspace_objective
from balance.balancing.sizing_study import study_sizing
from balance.closure import Closure, independent_rows
from balance.dynamics.inverse_dynamics import simulate
from balance.errors import ClosureError, DataError, SizingError
from balance.mechanism.forward_kinematics import motion, pose
from balance.mechanism.loop_constraints import constraint_bias, constraints_at
from balance.mechanism.tape import Symbols
from balance.motion import Samples
from balance.motion.motion_files import load_motion

from .. import models, referees

LOOPED = {
    "four-bar": (models.load("four-bar").text, 1, 2),
    "parallelogram-6bar": (models.load("parallelogram-6bar").text, 2, 4),
    "parallelogram-6bar-full": (models.load("parallelogram-6bar-full").text, 2, 9),
    "parallelogram four-bar": (models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0), 1, 2),
    "kite four-bar": (models.four_bar(0.2, 0.2, 0.35, 0.35, 1.2), 1, 2),
    "spatial four-bar": (models.spatial_four_bar(), 1, 3),
    "Bennett": (models.bennett(), 1, 3),
}
"""Text, degrees of freedom, and rank of the loop constraints, redundant rows left out."""


@pytest.mark.parametrize("name", LOOPED)
def test_degrees_of_freedom_and_rank(name: str) -> None:
    """Redundant rows are distinguished from independent ones: planar loops as point anchors, Bennett's as a weld."""
    text, dof, rank = LOOPED[name]
    closure = Closure(models.model(text))
    assert (closure.dof, len(closure.rows)) == (dof, rank)


@pytest.mark.parametrize("name", LOOPED)
def test_states_close_every_row_and_stay_on_their_branch(name: str) -> None:
    """Walked configurations close all rows, the redundant ones too; neighbours are one step apart."""
    closure = Closure(models.model(LOOPED[name][0]))
    states = closure.states(40, seed=3)
    assert states.shape == (40, closure.mechanism.tree.size)
    assert closure.residual(states).max() < 1e-12
    assert np.linalg.norm(np.diff(states, axis=0), axis=1).max() < 2 * 0.15
    assert np.ptp(states, axis=0).max() > 0.3


@pytest.mark.parametrize("name", LOOPED)
def test_velocities_keep_the_loops_closed(name: str) -> None:
    """A small step along an allowed velocity opens the loops only to second order, redundant rows too."""
    closure = Closure(models.model(LOOPED[name][0]))
    q = closure.states(10, seed=1)
    v = closure.velocities(q, seed=2)
    opened = [closure.residual(q + step * v).max() for step in (1e-3, 1e-4)]
    assert opened[1] < 0.02 * opened[0] + 1e-12
    assert np.linalg.norm(v, axis=1).min() > 0.0


def test_constraint_bias_is_the_second_rate_of_the_residual() -> None:
    """Along q + v t the residual's second derivative is the bias: central differences, weld rows too."""
    closure = Closure(models.model(models.bennett()))
    q = closure.states(4, seed=1)
    v = closure.velocities(q, seed=2)
    tree, loops, step = closure.mechanism.tree, closure.mechanism.loops, 1e-4

    def bias_of(q: Symbols, v: Symbols) -> Symbols:
        return constraint_bias(loops, at := pose(tree, q), motion(tree, at, v))

    before, here, after = (constraints_at(tree, loops, q + s * v)[0] for s in (-step, 0.0, step))
    bias = models.evaluated(bias_of, q.T, v.T)
    np.testing.assert_allclose((after - 2 * here + before) / step**2, bias, atol=1e-6 * np.abs(bias).max())


def test_states_are_the_same_every_time() -> None:
    """Seeded: conditions found twice are the same to the last bit."""
    closure = Closure(models.load("parallelogram-6bar-full"))
    np.testing.assert_array_equal(closure.states(16), closure.states(16))


def test_a_rough_keyframe_is_closed_nearby() -> None:
    """A keyframe rounded to three digits is closed to rounding error, within the digits that it gives."""
    text = models.load("four-bar").text.replace("1.0 -0.5542843118878877 1.376430622392165", "1.000 -0.554 1.376")
    closure = Closure(models.model(text))
    assert np.abs(closure.home - models.load("four-bar").home).max() < 2e-3
    assert closure.residual(closure.home[None]).max() < 1e-15


def test_links_that_do_not_reach_are_refused() -> None:
    """Sites out of each other's reach: the mechanism, its loop and the gap are named."""
    text = models.load("four-bar").text.replace(
        '<site name="B_B0B" pos="0.2 0 0"/>', '<site name="B_B0B" pos="2 0 0"/>'
    )
    with pytest.raises(ClosureError, match=r"test cannot be closed from 'home': the loops \(B\) stay .* m apart"):
        Closure(models.model(text))


def test_a_structure_has_no_room_to_move() -> None:
    """Three bars and three joints are a truss: no degree of freedom, and no states to walk over."""
    text = models.mjcf(
        models.link('<site name="s" pos="0.3 0 0"/>', "one")
        + models.link('<site name="e" pos="0.3 0 0"/>', "two", place='pos="0.4 0 0"'),
        '<equality><connect name="top" site1="s" site2="e"/></equality>' + models.key([0.84, 2.3]),
    )
    closure = Closure(models.model(text))
    assert closure.dof == 0
    with pytest.raises(ClosureError):
        closure.states(4)


@pytest.mark.parametrize("joints", [("A0",), ("A0", "A", "B0")])
def test_the_wrong_number_of_driven_coordinates_is_refused(joints: tuple[str, ...]) -> None:
    """A motion must drive as many coordinates as the mechanism has degrees of freedom; the message has both."""
    closure = Closure(models.load("parallelogram-6bar"))
    n = len(joints)
    samples = Samples(np.zeros(1), np.zeros((1, n)), np.zeros((1, n)), np.zeros((1, n)), joints=joints)
    with pytest.raises(ClosureError, match=rf"2 degrees of freedom, but the motion drives {n}: {', '.join(joints)}"):
        closure.follow(samples)


def test_independent_rows_span_all_rows() -> None:
    """A largest independent set: as many as the rank, and every row a combination of them."""
    rng = np.random.default_rng(0)
    matrix = rng.normal(size=(9, 4)) @ rng.normal(size=(4, 12))
    rows = independent_rows(matrix)
    assert len(rows) == 4
    rest = np.linalg.lstsq(matrix[rows].T, matrix.T, rcond=None)[0]
    np.testing.assert_allclose(matrix[rows].T @ rest, matrix.T, atol=1e-10)
    assert len(independent_rows(np.empty((0, 3)))) == 0


def test_joints_may_be_named_in_any_order() -> None:
    """An open chain driven by its joints in another order moves the same way."""
    mechanism = models.load("serial-3r")
    motion = referees.random_motion(mechanism)
    turned = ("J3", "J1", "J2")
    rows = [mechanism.coordinate_index(joint) for joint in turned]
    samples = Samples(motion.time, motion.q[:, rows], motion.v[:, rows], motion.a[:, rows], joints=turned)
    other = Closure(mechanism).follow(samples)
    np.testing.assert_array_equal(other.q, motion.q)
    np.testing.assert_array_equal(other.a, motion.a)
    np.testing.assert_array_equal(other.per_drive @ motion.v[:, rows, None], motion.v[:, :, None])


@pytest.mark.parametrize("name", ["serial-2r", "parallelogram-6bar"])
def test_a_motion_that_is_none_is_refused(name):
    """No sample, or a number that is none, ends in a message and not in one of NumPy's."""
    closure = Closure(models.load(name))
    joints = ("J1", "J2") if name == "serial-2r" else ()
    still = np.zeros((3, 2))
    for position, text in [(np.zeros((0, 2)), "no sample"), (np.full((3, 2), np.nan), "not finite at t = 0 s")]:
        time = np.arange(float(len(position)))
        samples = Samples(time, position, still[: len(time)], still[: len(time)], joints)
        with pytest.raises(DataError, match=text):
            closure.follow(samples)


DELTA = models.load("delta")
HOME = [f"{q} 0" if joint[0] == "S" else f"{q}" for q, joint in zip(DELTA.home, DELTA.coordinates, strict=True)]
SPIN = re.sub(
    r'(<joint name="S(\w+)" type="hinge" axis="0 0 1"/>)', r'\1<joint name="spin_\2" axis="1 0 0"/>', DELTA.text
)
ROD_SPINS = re.sub(r'qpos="[^"]*"', f'qpos="{" ".join(HOME)}"', SPIN)
"""The delta with ball joints at both ends of its rods: each may spin about its own axis."""


def test_rods_that_spin_idly_change_nothing() -> None:
    """Force, moment, torque and the workspace's objective of the delta are those without the six idle freedoms."""
    free, fixed = models.model(ROD_SPINS), DELTA
    closure = Closure(free)
    assert (closure.dof, closure.idle) == (9, tuple(f"spin_{k}{side}" for k in (1, 2, 3) for side in "ab"))
    samples = load_motion("delta").sample(200.0)
    one, other = (simulate(model, Closure(model).follow(samples)) for model in (free, fixed))
    assert Closure(free).follow(samples).idle == closure.idle
    np.testing.assert_allclose(one.force, other.force, atol=1e-9)
    np.testing.assert_allclose(one.moment, other.moment, atol=1e-9)
    np.testing.assert_allclose(list(one.torque.values()), list(other.torque.values()), atol=1e-9)
    value = workspace_objective(fixed).value(fixed)
    assert workspace_objective(free).value(free) == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("times", [1e-4, 1e4])
def test_rods_spin_idly_in_a_machine_of_any_size(times: float) -> None:
    """Of a delta of 30 um, and of kilometres."""
    free, scaled = (Closure(models.model(text)) for text in (ROD_SPINS, models.scaled(ROD_SPINS, times)))
    assert (scaled.dof, scaled.idle) == (free.dof, free.idle)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('pos="0.16 0 0" mass="0.05"', 'pos="0.16 0.01 0" mass="0.05"'),
        ('<site name="C1a"', '<site name="counter_rod" pos="0.1 0.01 0"/><site name="C1a"'),
    ],
)
def test_a_rod_that_would_swing_is_not_idle(old: str, new: str) -> None:
    """A centre of mass, or a place for a counter-mass, off the line it spins about: refused, its coordinate named."""
    model = models.model(ROD_SPINS.replace(old, new, 1))
    with pytest.raises(ClosureError, match=r"9 degrees of freedom, idle spin_1b, .*; nothing moves spin_1a"):
        Closure(model).follow(load_motion("delta").sample(200.0))


def test_a_mass_with_which_an_idle_rod_would_swing_is_refused_for_one_payload_and_for_several() -> None:
    """Sets that only grow had masses there, sized as if the rod were fixed."""
    model = models.model(ROD_SPINS.replace('<site name="C1a"', '<site name="off" pos="0.1 0.02 0"/><site name="C1a"'))
    with pytest.raises(SizingError, match="with masses at off, bodies that turn idly"):
        study_sizing(model, sites=["off"])
    with pytest.raises(SizingError, match="with masses at off, bodies that turn idly"):
        study_nested(model, [{"platform": 0.2}, {"platform": 0.4}], sites=["off"])


@pytest.mark.parametrize("joint", ['type="hinge" axis="0 0 1"', 'type="ball"'])
def test_a_wheel_that_turns_freely_is_not_idle(joint: str) -> None:
    """Fixed to what carries it, it would weigh into torques, which a free bearing keeps from it: refused."""
    wheel = f'<body name="wheel"><joint name="W" {joint}/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>'
    arm = models.mjcf(models.link(wheel, "arm"))
    closure = Closure(models.model(arm))
    time = np.linspace(0.0, 1.0, 11)
    with pytest.raises(ClosureError, match=r"nothing moves W"):
        closure.follow(Samples(time, *np.zeros((3, 11, 1)), joints=("arm",)))
