"""Masses of least square error: optimality, and how equals are decided."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from balance.balancing import stock_search
from balance.balancing.least_masses import distribute_masses, distribute_within
from balance.balancing.stock_search import best_plates


@pytest.fixture(params=["all", "units", "piles"])
def factor(request, monkeypatch):
    """Of the masses, so that each way of finding plates is taken.

    By looking at all selections, by multiples of a unit, and by piles of plates where masses have none.
    """
    if request.param != "all":
        monkeypatch.setattr(stock_search, "_MOST_SELECTIONS", 0)
    return 2**0.5 if request.param == "piles" else 1.0


TWO_ARMS = np.array([[0.1, 0.2, 0.0, 0.0], [0.0, 0.0, 0.1, 0.1]])
"""Two sites at 0.1 m and 0.2 m on one arm, two at 0.1 m on the other."""


@pytest.mark.parametrize("removable", [False, True])
def test_the_lightest_and_among_equals_even(removable):
    """The far site carries all of its arm's mass; equivalent sites share it evenly."""
    found = distribute_masses(TWO_ARMS, np.array([0.3, 0.4]), removable=removable)
    assert found.masses == pytest.approx([0.0, 1.5, 2.0, 2.0], abs=1e-9)


@pytest.mark.parametrize("seed", [279, 0])
def test_the_lightest_of_small_masses(seed):
    """Two sites act alike but for their lever, the others by themselves: the one with the longer lever is chosen."""
    rng, mass = np.random.default_rng(seed), 2.36117e-3
    columns = rng.standard_normal((3, 4))
    columns[:, 2] = (lever := rng.uniform(0.2, 3.0)) * columns[:, 3]
    alike = [mass / lever, 0.0] if lever > 1.0 else [0.0, mass]
    found = distribute_masses(columns, mass * (columns[:, 1] + columns[:, 3]))
    assert found.masses == pytest.approx([0.0, mass, *alike], abs=1e-12)


def test_limits():
    """What a limited site cannot carry goes to the next."""
    found = distribute_masses(TWO_ARMS, np.array([0.3, 0.4]), np.array([9.0, 1.0, 1.0, 9.0]))
    assert found.masses == pytest.approx([1.0, 1.0, 1.0, 3.0], abs=1e-9)


def test_masses_are_taken_away_only_where_they_may_be():
    """Too much on an arm: nothing is mounted there, or mass is removed where that takes least."""
    target = np.array([-0.3, 0.4])
    assert distribute_masses(TWO_ARMS, target).masses == pytest.approx([0.0, 0.0, 2.0, 2.0], abs=1e-9)
    removed = distribute_masses(TWO_ARMS, target, removable=True).masses
    assert removed == pytest.approx([0.0, -1.5, 2.0, 2.0], abs=1e-9)


def test_masses_change_with_the_target_as_stated():
    """A small change of the target moves the masses by their slopes."""
    target, change = np.array([0.3, 0.4]), np.array([0.001, -0.002])
    before, after = (distribute_masses(TWO_ARMS, t, removable=True) for t in (target, target + change))
    assert after.masses - before.masses == pytest.approx(before.per_target @ change, abs=1e-9)


@pytest.mark.parametrize("seed", [0, 63, 258, 570, 2892])
def test_sites_that_act_alike_settle(seed):
    """Eight sites of like effect, all limited: bounds are met and left often; those that hold leave no gap."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((8, 1)) + 0.3 * rng.standard_normal((8, 8))
    target, upper = rng.standard_normal(8), rng.uniform(0.1, 1.0, 8)
    found = distribute_masses(columns / np.linalg.norm(columns, axis=0), target, upper)
    assert found.gap < 1e-20  # rounding of the gradient, 1e-16, squared, times a condition number squared, up to 2e4


def test_sites_that_are_held_stay_while_equals_are_sought():
    """More sites than rows, but the best is unique: the limited site stays at its limit, and no gap is left."""
    rng = np.random.default_rng(4)
    columns, target = rng.standard_normal((4, 6)), 4.0 * rng.standard_normal(4)
    upper = np.array([np.inf, np.inf, 1.3, np.inf, np.inf, 1.0])
    found = distribute_masses(columns, target, upper)
    assert found.gap < 1e-20 * target @ target
    assert np.sum((columns @ found.masses - target) ** 2) > 0.1  # not balanced: the bounds hold


@pytest.mark.parametrize("seed", range(12))
def test_optimality(seed):
    """Bounds, scales over six decades: the Karush-Kuhn-Tucker conditions hold, and the gap is as small."""
    rng = np.random.default_rng(seed)
    sites = int(rng.integers(1, 7))
    columns = rng.normal(size=(int(rng.integers(2, 9)), sites)) * 10.0 ** rng.uniform(-3.0, 3.0, sites)
    target, upper = (
        rng.normal(size=len(columns)),
        np.where(rng.random(sites) < 0.5, rng.uniform(0.0, 1.0, sites), np.inf),
    )
    upper = upper / np.linalg.norm(columns, axis=0)
    found = distribute_masses(columns, target, upper)
    gradient = columns.T @ (columns @ found.masses - target) / np.linalg.norm(columns, axis=0)
    assert ((found.masses >= 0.0) & (found.masses <= upper)).all()
    at = np.where(
        found.masses <= 0.0, gradient.clip(max=0.0), np.where(found.masses >= upper, gradient.clip(min=0.0), gradient)
    )
    np.testing.assert_allclose(at, 0.0, atol=1e-12)  # a gradient of unit columns, times the condition number
    assert found.gap < 1e-20


@pytest.mark.parametrize(
    ("columns", "target", "total", "masses", "price"),
    [
        (np.eye(2), [3.0, 1.0], 5.0, [3.0, 1.0], 0.0),
        (np.eye(2), [3.0, 1.0], 3.0, [2.5, 0.5], 1.0),
        (np.eye(2), [3.0, 1.0], 1.0, [1.0, 0.0], 4.0),
        (np.eye(2), [3.0, 1.0], 0.0, [0.0, 0.0], None),
        (np.array([[1.0, 2.0]]), [4.0], 1.0, [0.0, 1.0], 8.0),
        (np.array([[1.0, 1.0]]), [4.0], 2.0, [1.0, 1.0], 4.0),
    ],
)
def test_a_total_is_shared_where_it_lessens_most(columns, target, total, masses, price):
    """Masses and the price of the total, 2 (target - mass) of a site that is given some, known by hand."""
    no_limit = np.full(2, np.inf)
    found, worth, gap = distribute_within(columns, np.array(target), no_limit, np.ones((1, 2)), np.array([total]))
    assert found == pytest.approx(masses, abs=1e-9)
    assert found.sum() <= total
    assert price is None or worth[0] == pytest.approx(price, abs=1e-9)
    assert gap < 1e-9


@pytest.mark.parametrize("share", [1e-6, 0.1, 0.999999])
@pytest.mark.parametrize("sums", [1, 3])
@pytest.mark.parametrize("seed", range(12))
def test_totals_are_proven(seed, sums, share):
    """Limits, weights, columns over decades, sites alike: totals are kept, used where they cost; hardly a gap is left.

    Of several, the first of all sites and the others of some, as of a site's masses for several payloads.
    """
    rng = np.random.default_rng(seed)
    sites, decades = int(rng.integers(1, 7)), 2.0 / sums
    columns = rng.normal(size=(int(rng.integers(1, 9)), sites)) * 10.0 ** rng.uniform(-decades, decades, sites)
    columns[:, -1] = columns[:, 0]
    target, weights = rng.normal(size=len(columns)), rng.integers(1, 4, (sums, sites)).astype(float)
    weights[1:] *= rng.random((sums - 1, sites)) < 0.5
    weights = weights[weights.any(axis=1)]
    upper = np.where(rng.random(sites) < 0.5, rng.uniform(0.0, 1.0, sites), np.inf) / np.linalg.norm(columns, axis=0)
    totals = share * (weights @ distribute_masses(columns, target, upper).masses)
    found, prices, gap = distribute_within(columns, target, upper, weights, totals)
    np.testing.assert_allclose(prices * (totals - weights @ found), 0.0, atol=1e-9)
    assert (weights @ found <= totals * (1.0 + 1e-14)).all()
    assert ((found >= 0.0) & (found <= upper)).all()
    gradient = (2.0 * columns.T @ (columns @ found - target) + prices @ weights) / np.linalg.norm(columns, axis=0)
    at = np.where(found <= 0.0, gradient.clip(max=0.0), np.where(found >= upper, gradient.clip(min=0.0), gradient))
    np.testing.assert_allclose(at, 0.0, atol=1e-9 if sums == 1 else 1e-6)  # of several, a change of 1e-6 is met first
    assert gap < 1e-9 * target @ target


def by_looking_at_all(columns, target, masses, quantities, limits, equal, turning=None, added=np.inf):
    """Least square error and mass of all selections of plates."""
    kinds = [list(one) for one in product(*(range(q + 1) for q in quantities))]
    found = []
    for rows in product(kinds, repeat=columns.shape[1]):
        counts = np.array(rows)
        made = counts @ masses
        fits = (counts.sum(axis=0) <= quantities).all() and (made <= limits + 1e-9).all() and made.sum() <= added + 1e-9
        if fits and all(np.ptp(made[group]) < 1e-9 for group in equal):
            effect = columns @ made - target
            if turning is not None:
                effect += turning[0] @ (counts * turning[1]).sum(axis=1)
            found.append((round(float(np.sum(effect**2)), 9), round(float(made.sum()), 9)))
    return sorted(set(found))


@pytest.mark.parametrize("seed", range(56))
def test_plates_are_the_best_of_all(seed, factor):
    """Random stocks, limits, equal sites, few rows: none is better, nor as good and lighter; proven.

    From the 24th on plates have inertia of their own, of which a search gives a bound only; from the 32nd on the total
    of the masses is limited, to one that plates make in every other.
    """
    rng = np.random.default_rng(seed)
    sites = int(rng.integers(1, 4))
    columns = rng.normal(size=(int(rng.integers(1, 6)), sites))
    target = 10.0 * rng.normal(size=len(columns))
    kinds = int(rng.integers(1, 4))
    masses, quantities = factor * np.round(rng.uniform(0.3, 5.0, kinds), 2), rng.integers(0, 3, kinds)
    limits = np.where(rng.random(sites) < 0.5, rng.uniform(0.0, 6.0, sites), np.inf)
    equal = [[0, 1]] if sites > 1 and seed % 3 == 0 else []
    turning = (
        (rng.normal(size=columns.shape), masses * rng.uniform(-0.3, 1.0, (sites, kinds))) if seed % 32 >= 24 else None
    )
    added = np.inf if seed < 32 else float(masses[0] if seed % 2 else rng.uniform(0.0, 1.0) * masses @ quantities)
    found = best_plates(
        columns,
        target,
        masses,
        quantities,
        limits,
        equal,
        turning=turning,
        sums=(np.ones((1, len(limits))), np.array([added])),
    )
    all_of_them = by_looking_at_all(columns, target, masses, quantities, limits, equal, turning, added)
    best = found.selections[0]
    if turning is None or stock_search._MOST_SELECTIONS:
        assert (best.value, best.masses.sum()) == pytest.approx(all_of_them[0], abs=1e-8)
        assert found.gap == 0.0
    assert found.bound - 1e-8 <= all_of_them[0][0] <= best.value + 1e-8
    assert (best.counts.sum(axis=0) <= quantities).all()


def test_the_best_few(factor):
    """The first five, in order, of all that plates can make."""
    columns, target = np.array([[1.0, 0.3], [0.0, 0.9]]), np.array([3.1, 2.2])
    masses, quantities = factor * np.array([0.5, 1.2]), np.array([3, 2])
    found = best_plates(columns, target, masses, quantities, best=5)
    every = by_looking_at_all(columns, target, masses, quantities, np.full(2, np.inf), [])
    assert [one.value for one in found.selections] == pytest.approx([value for value, _ in every[:5]], abs=1e-8)


@pytest.mark.parametrize(
    ("rows", "target", "masses", "quantities", "lightest"),
    [
        ([[0.0, 2.0, 0.0, 1.0]], [9.12], [2.28], [4], 4.56),
        ([[2.0, 1.0], [0.0, 0.0]], [1.3333356, 0.0], [0.2222226], [4], 0.6666678),
        ([[1.0, 2.0, -1.0]], [0.832], [0.416, 0.01], [2, 0], 0.416),
        ([[0.888, -0.888], [0.757, -0.757]], [0.9, 0.7], [0.8], [4], 0.8),
    ],
    ids=["alike", "apart", "against each other", "with a remainder"],
)
@pytest.mark.parametrize("best", [1, 3])
def test_of_plates_that_do_equally_well_the_lightest(rows, target, masses, quantities, lightest, best, factor):
    """Where sites do alike many selections leave the same, to rounding: the lightest is the first of the best few."""
    columns, plates = np.array(rows), factor * np.array(masses)
    found = best_plates(columns, factor * np.array(target), plates, np.array(quantities), best=best)
    assert found.selections[0].masses.sum() == pytest.approx(factor * lightest)
    assert found.gap < 1e-12


def test_many_sites_of_one_effect_are_proven():
    """Of 73,500 selections nearly all differ by next to nothing from others: all are looked at."""
    columns, masses, quantities = np.array([[0.9, 0.3, 0.5, 0.7]]), np.array([0.144, 2.375, 2.908]), np.array([4, 2, 4])
    found = best_plates(columns, np.array([7.3]), masses, quantities)
    made = found.selections[0].counts @ masses
    assert (found.selections[0].value, found.gap) == pytest.approx(
        (((columns @ made).item() - 7.3) ** 2, 0.0), abs=1e-12
    )
    assert found.selections[0].value < 1e-5


def test_forty_plates_at_four_sites_with_limits_are_proven():
    """Five kinds of eight, weighed to a gram: the bound is reached, well within the time."""
    rng = np.random.default_rng(1)
    columns = np.linalg.qr(rng.normal(size=(8, 4)), mode="r") @ np.diag(rng.uniform(2.0, 10.0, 4))
    masses, quantities = np.round(rng.uniform(0.2, 2.5, 5), 3), np.full(5, 8)
    wanted = np.array([7.8, 7.0, 9.3, 8.7])
    target = columns @ wanted + rng.normal(size=4)
    found = best_plates(columns, target, masses, quantities, np.array([5.46, np.inf, 13.3, np.inf]))
    assert found.gap == 0.0
    assert found.selections[0].masses[0] <= 5.46


@pytest.mark.parametrize(("step", "noise"), [(3, 0.0), (4, 0.02)])
def test_forty_plates_that_all_differ_are_proven(step, noise):
    """Weighed to a gram, or a tenth: nothing better can be made, also where any mass would balance completely."""
    rng = np.random.default_rng(2)
    columns = np.linalg.qr(rng.normal(size=(8, 4)), mode="r") @ np.diag(rng.uniform(2.0, 10.0, 4))
    masses = np.round(rng.uniform(0.2, 2.5, 40), step)
    target = columns @ rng.uniform(5.0, 11.0, 4) + noise * rng.normal(size=4)
    found = best_plates(columns, target, masses, np.ones(40, dtype=int), np.array([5.46, np.inf, 13.3, np.inf]))
    best = found.selections[0]
    assert found.gap <= 1e-12 * target @ target
    assert best.counts.max(initial=0) == 1
    assert best.counts.sum(axis=0).max() == 1
    for change in product((-1, 0, 1), repeat=4):  # no neighbour on the grid of a step is better: it is the least there
        near = best.masses + 10.0**-step * np.array(change)
        if near[0] <= 5.46 and near[2] <= 13.3:
            assert np.sum((columns @ near - target) ** 2) >= best.value - 1e-12


def test_sites_without_an_effect_of_their_own_are_proven():
    """Forty plates at four sites of which three have the effect of the fourth, at bounds or not."""
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(6, 3)) @ rng.normal(size=(3, 4))
    masses, limits = np.round(rng.uniform(0.03, 2.0, 40), 5), np.array([2.5, 3.0, 2.0, 1.7])
    target = columns @ np.array([0.08, 5.0, 4.0, -1.0]) + rng.normal(size=6)
    found = best_plates(columns, target, masses, np.ones(40, dtype=int), limits)
    least = distribute_masses(columns, target, limits)
    assert found.gap == 0.0
    assert found.selections[0].value == pytest.approx(np.sum((columns @ least.masses - target) ** 2), rel=1e-2)


@pytest.mark.parametrize("time_limit", [stock_search.TIME_LIMIT_S, 0.0])
def test_plates_of_any_mass_come_near_the_bound_or_say_how_far_they_are(time_limit, monkeypatch):
    """Twenty kinds of two: what is found without proof is near the bound; without time it is nothing, and says so."""
    monkeypatch.setattr(stock_search, "TIME_LIMIT_S", time_limit)
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(5, 3))
    masses = rng.uniform(0.2, 2.5, 20)
    target = columns @ np.array([5.0, 8.0, 3.0]) + 0.3 * rng.normal(size=5)
    found = best_plates(columns, target, masses, np.full(20, 2))
    least = distribute_masses(columns, target)
    bound = np.sum((columns @ least.masses - target) ** 2)
    assert bound * (1.0 - 1e-9) <= found.bound <= found.selections[0].value
    near = bound * (1.0 + 1e-5) if time_limit else np.sum(target**2)
    assert found.selections[0].value <= near
    if not time_limit:
        more, unknown = stock_search.with_more(columns, target, masses, np.full(20, 2), found.selections[0].counts)
        assert (more, unknown) == ({}, list(range(20)))


@pytest.mark.parametrize(("step", "kinds"), [(3, 5), (3, 40), (9, 40)])
def test_forty_plates_within_a_total_are_near_the_bound(step, kinds):
    """Half of what is wanted in all: the bound is that of masses of any size with so much, and is all but reached."""
    rng = np.random.default_rng(6)
    columns = np.linalg.qr(rng.normal(size=(8, 4)), mode="r") @ np.diag(rng.uniform(2.0, 10.0, 4))
    masses, total = np.round(rng.uniform(0.2, 2.5, kinds), step), 15.0
    target = columns @ np.array([7.8, 7.0, 9.3, 8.7])
    limits = np.array([5.46, np.inf, 13.3, np.inf])
    found = best_plates(
        columns, target, masses, np.full(kinds, 40 // kinds), limits, sums=(np.ones((1, 4)), np.array([total]))
    )
    any_mass, _, _ = distribute_within(columns, target, limits, np.ones((1, 4)), np.array([total]))
    least = np.sum((columns @ any_mass - target) ** 2)
    assert found.selections[0].masses.sum() <= total + 1e-6
    assert least * (1.0 - 1e-9) <= found.bound <= found.selections[0].value <= least * (1.0 + 1e-3)


def test_scarce_plates_at_many_sites_are_placed_and_bounded(monkeypatch):
    """Eight sites in four directions want twice what forty plates weigh: the bound counts that, and is near."""
    monkeypatch.setattr(stock_search, "TIME_LIMIT_S", 0.4)
    rng = np.random.default_rng(3)
    columns, masses = rng.normal(size=(4, 8)) ** 2, rng.uniform(0.02, 0.4, 40).round(6)
    target = columns @ np.full(8, 0.25 * masses.sum())
    found = best_plates(columns, target, masses, np.ones(40, dtype=int), np.array([1.5, *[np.inf] * 7]))
    assert 0.5 * found.selections[0].value < found.bound <= found.selections[0].value < 0.3 * float(target @ target)
    assert found.selections[0].counts.sum(axis=0).max() == 1
    assert found.selections[0].masses[0] <= 1.5


def test_sets_for_several_loads_are_the_best_of_all_that_grow():
    """Two loads, two sites: what the sets add is one selection of plates, so the sum of both errors is least."""
    rng = np.random.default_rng(5)
    columns, loads = rng.uniform(0.5, 2.0, (3, 2)), np.cumsum(rng.uniform(1.0, 6.0, (2, 3)), axis=0)
    stacked = np.block([[columns, np.zeros_like(columns)], [columns, columns]])
    masses, quantities = np.array([1.1, 2.3]), np.array([2, 2])
    found = best_plates(stacked, loads.ravel(), masses, quantities).selections[0]
    every = by_looking_at_all(stacked, loads.ravel(), masses, quantities, np.full(4, np.inf), [])
    assert (found.value, found.masses.sum()) == pytest.approx(every[0], abs=1e-8)


@pytest.mark.parametrize("seeds", [range(0, 50), range(50, 100), [265]])
def test_the_lightest_of_many_equals_that_little_tells_apart(seeds):
    """More sites than effects, levers and effects two decades apart, rows that depend on others: a linear programme
    tells what the lightest weigh, and they do what the true ones do.
    """
    for seed in seeds:
        rng = np.random.default_rng(seed)
        rank = int(rng.integers(2, 7))
        sites = rank + int(rng.integers(1, 4))
        effects = np.triu(rng.standard_normal((12, rank)) * 10.0 ** rng.uniform(-1, 1, rank))
        mix = rng.standard_normal((rank, sites)) * 10.0 ** rng.uniform(-1, 1, sites)
        turned = np.linalg.qr(rng.standard_normal((12, 12))).Q if seed % 2 else np.eye(12)
        columns = turned @ effects @ mix
        true = np.where(rng.random(sites) < 0.4, 0.0, rng.random(sites) * 10.0 ** rng.uniform(-2, 1, sites))
        if not true.any():
            continue
        found = distribute_masses(columns, columns @ true).masses
        assert np.linalg.norm(columns @ (found - true)) <= 1e-10 * np.linalg.norm(columns @ true), seed
        same = np.linalg.svd(columns, full_matrices=False)[2][:rank]
        least = linprog(np.ones(sites), A_eq=same, b_eq=same @ true, bounds=(0.0, None), method="highs-ds").fun
        assert found.sum() == pytest.approx(least, rel=1e-4), seed  # ties are weighed with 1e-5
