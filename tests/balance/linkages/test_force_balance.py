"""Counter-masses, leaves to root."""

import numpy as np
import pytest

from balance.closure import Closure
from balance.dynamics.inverse_dynamics import momentum
from balance.errors import SizingError
from balance.linkages.equivalence_method import balance_linkage
from balance.linkages.expressions import ORIGIN, Point, Symbol, read_length
from balance.linkages.force_balance import solve_force_balance
from balance.linkages.linkage import Place
from balance.linkages.mjcf_writer import linkage_mjcf
from balance.mechanism.mjcf_parser import mechanism_from_text

from .conftest import balanced

HERE = {"a": Symbol(1.0, 0.0)}


def place(name, x, y):
    """A place at a point [m]."""
    return Place(name, Point(read_length(f"{x} a", HERE), read_length(f"{y} a", HERE)))


def solved(first, places):
    """Masses by place."""
    found = solve_force_balance(np.array(first), places, ORIGIN, {"a": 1.0}, "3")
    return {c.place.name: c.mass for c in found}


def test_one_place_opposite_takes_it_all():
    """m* = S / R."""
    assert solved([0.3, 0.0], [place("p", -0.5, 0.0)]) == {"p": pytest.approx(0.6)}


def test_two_places_share_it():
    """m* from two equations."""
    masses = solved([0.3, 0.2], [place("p", -0.5, 0.0), place("q", 0.0, -0.1)])
    assert masses == {"p": pytest.approx(0.6), "q": pytest.approx(2.0)}


def test_the_lightest_of_three_places():
    """Of all choices the one of least mass, which a linear programme confirms."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(3)
    for _ in range(50):
        at, first = rng.normal(size=(5, 2)), rng.normal(size=2)
        best = linprog(np.ones(5), A_eq=at.T, b_eq=-first)
        places = [place(str(k), x, y) for k, (x, y) in enumerate(at)]
        if not best.success:
            with pytest.raises(SizingError):
                solved(first, places)
            continue
        assert sum(solved(first, places).values()) == pytest.approx(best.fun, rel=1e-7)


def test_places_on_the_wrong_side_are_refused_by_name():
    """The message says how much is needed on which side, and where the places are."""
    with pytest.raises(SizingError, match=r"body 3 needs counter-masses of first moment 0\.3 kg m .* side 180 deg"):
        solved([0.3, 0.0], [place("p", 0.5, 0.0)])


def test_momentum_vanishes_at_random_states(random_crank_rocker):
    """With the counter-masses no loop-consistent motion has linear momentum."""
    result = balance_linkage(random_crank_rocker(5), gears=False)
    before, after = (mechanism_from_text(linkage_mjcf(result, stage), "x") for stage in ("before", "force"))
    q = Closure(before).states(20)
    v = Closure(before).velocities(q)
    assert np.abs(momentum(after, q, v)[:, :2]).max() < 1e-13 * np.abs(momentum(before, q, v)[:, :2]).max() * 100


def test_mass_reduced_to_the_ground_is_the_whole_mass(crank_rocker_keys):
    """Point masses that reach the ground add up to the linkage with its counter-masses."""
    result = balanced(crank_rocker_keys, gears=False)
    total = sum(result.values[part.mass] for body in result.linkage.bodies.values() for part in body.parts)
    total += sum(counter.mass for _, counter in result.counters())
    assert sum(result.force[body].mass for body in ("2", "4", "6")) == pytest.approx(total)
