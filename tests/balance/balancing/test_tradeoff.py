"""The front of force, moment, torque and added mass."""

import numpy as np
import pytest
from scipy.optimize import minimize

from balance.balancing.conditions import balance_conditions
from balance.balancing.objective import motion_objective
from balance.balancing.sizing import exact_sizing
from balance.balancing.tradeoff import tradeoff_front
from balance.dynamics.inverse_dynamics import simulate
from balance.front_door import follow

from .. import models


@pytest.fixture(scope="module")
def four_bar():
    """The four-bar, its motion, and its front."""
    mechanism = models.load("four-bar")
    trajectory = follow(mechanism, "four-bar")
    return mechanism, trajectory, tradeoff_front(mechanism, trajectory)


def values_of(point):
    """The four quantities."""
    return np.array([point.force, point.moment, point.torque, point.added_mass])


def test_points_are_what_simulation_gives(four_bar):
    """Force, moment, torque of some points by inverse dynamics."""
    mechanism, trajectory, front = four_bar
    for point in front[:: len(front) // 3]:
        response = simulate(mechanism.with_counter_mass(point.masses), trajectory)
        torque = np.array(list(response.torque.values())).T
        expected = [np.sqrt(np.mean(np.sum(x**2, axis=1))) for x in (response.force, response.moment, torque)]
        assert [point.force, point.moment, point.torque] == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert point.added_mass == pytest.approx(sum(point.masses.values()))


def test_no_design_betters_a_point(four_bar):
    """Two thousand random designs: none is better than a point of the front in all four."""
    mechanism, trajectory, front = four_bar
    assert len(front) > 40
    rng = np.random.default_rng(0)
    sites = mechanism.counter_sites
    objectives = [motion_objective(mechanism, trajectory, {name: 1.0}) for name in ("force", "moment", "torque")]
    systems = [objective.system(mechanism, sites) for objective in objectives]
    points = np.array([values_of(point) for point in front])
    for masses in rng.uniform(0.0, 4.0, (2000, len(sites))):
        design = np.array([*(np.linalg.norm(c @ masses - t) for c, t in systems), masses.sum()])
        assert not (design < points * (1.0 - 1e-6)).all(axis=1).any()


def test_the_ends_of_the_front(four_bar):
    """Nothing mounted at one end; at the other the least force, which sizing finds."""
    mechanism, trajectory, front = four_bar
    assert min(point.added_mass for point in front) == 0.0
    sized = exact_sizing(balance_conditions(mechanism), mechanism, objective=motion_objective(mechanism, trajectory))
    before, least = sized.root_mean_squares()
    assert front[0].force == pytest.approx(least, abs=1e-9 * before)  # the mean square's rounding, 1e-16, of its root


def test_torque_is_of_the_drives_that_turn():
    """A SCARA whose quill slides: the torques of its arms, N m, without the quill's force, N."""
    mechanism = models.load("scara-quill")
    trajectory = follow(mechanism, "scara-quill")
    front = tradeoff_front(mechanism, trajectory, points=4)
    response = simulate(mechanism, trajectory)
    torques = [values for joint, values in response.torque.items() if joint not in response.sliding]
    assert 0 < len(torques) < len(response.torque)
    bare = next(point for point in front if point.added_mass == 0.0)
    assert bare.torque == pytest.approx(np.sqrt(np.mean(np.sum(np.square(torques), axis=0))), rel=1e-9)


def test_limits_hold(four_bar):
    """No point exceeds a limit."""
    mechanism, trajectory, _ = four_bar
    front = tradeoff_front(mechanism, trajectory, limits={"counter_A0A": 0.5}, points=30)
    assert max(point.masses["counter_A0A"] for point in front) <= 0.5


def test_points_are_spread_over_the_front(four_bar):
    """Each of forty points has a neighbour near it, between any two forces one lies: even weights leave holes."""
    mechanism, trajectory, _ = four_bar
    front = np.array([values_of(point) for point in tradeoff_front(mechanism, trajectory, points=40)])
    assert len(front) > 35
    front = (front - front.min(axis=0)) / np.ptp(front, axis=0)
    assert np.diff(front[:, 0]).max() < 0.12
    apart = np.linalg.norm(front[:, None] - front, axis=2) + 9.0 * np.eye(len(front))
    assert apart.min(axis=1).max() < 0.2


def test_with_a_limit_of_the_added_mass(four_bar):
    """Nothing adds more than is allowed; the first point is the least force with so much, by another solver."""
    mechanism, trajectory, front = four_bar
    most = 0.4 * max(point.added_mass for point in front)
    capped = tradeoff_front(mechanism, trajectory, points=30, added=most)
    assert len(capped) > 20
    assert most * (1.0 - 1e-6) < max(point.added_mass for point in capped) <= most
    assert capped[0].force == pytest.approx(least_force(mechanism, trajectory, most), rel=1e-4)


@pytest.mark.parametrize("points", [12, 300])
def test_points_of_the_least_force_for_their_mass(four_bar, points):
    """Those that are marked, both ends included, by another solver; some others have more force than that."""
    mechanism, trajectory, _ = four_bar
    front = tradeoff_front(mechanism, trajectory, points=points)
    marked = [point for point in front if point.on_curve]
    assert len(marked) > 8
    assert (front[0].on_curve, min(point.added_mass for point in marked)) == (True, 0.0)
    bare = max(point.force for point in front)
    for point in marked:
        assert point.force == pytest.approx(least_force(mechanism, trajectory, point.added_mass), abs=1e-6 * bare)
    others = [point for point in front if not point.on_curve]
    assert max(one.force - least_force(mechanism, trajectory, one.added_mass) for one in others) > 1e-3 * bare


def least_force(mechanism, trajectory, added):
    """With so much added mass in all, by sequential quadratic programming."""
    sites = mechanism.counter_sites
    columns, target = motion_objective(mechanism, trajectory, {"force": 1.0}).system(mechanism, sites)
    triangle = np.linalg.qr(np.column_stack([columns, target]), mode="r")
    columns, target = triangle[:, :-1], triangle[:, -1]
    least = minimize(
        lambda masses: np.sum((columns @ masses - target) ** 2) / np.sum(target**2),
        np.full(len(sites), added / len(sites)),
        jac=lambda masses: 2.0 * columns.T @ (columns @ masses - target) / np.sum(target**2),
        bounds=[(0.0, None)] * len(sites),
        constraints={"type": "ineq", "fun": lambda masses: added - masses.sum()},
        options={"ftol": 1e-14},
    )
    return np.sqrt(least.fun) * np.linalg.norm(target)
