"""Splitting over holes: closed form, and stock weights against brute force."""

from itertools import product

import numpy as np
import pytest

from balance.balancing.stock_plates import Plate
from balance.errors import SizingError
from balance.rotors import weight_splitting


def _polar(size, degrees):
    return size * np.exp(1j * np.radians(degrees))


@pytest.mark.parametrize(
    ("target", "count", "first", "expected"),
    [
        ((30.0, 100.0), 12, 0.0, {3: 20.521209, 4: 10.418891}),
        ((45.5, 10.0), 8, 15.0, {7: 5.6081859, 0: 41.361272}),
        ((1.3375176, 348.04083), 8, 0.0, {7: 0.39195376, 0: 1.0313343}),
    ],
)
def test_two_holes_about_the_correction(target, count, first, expected):
    """Weights of any size go into the two neighbours, w = U sin(b - t) / sin(b - a)."""
    split = weight_splitting.split_freely(_polar(*target), weight_splitting.evenly_spaced(count, np.radians(first)))
    used = {i: w for i, w in enumerate(split.weights) if w}
    assert used == pytest.approx(expected, rel=1e-6)
    assert split.residual() < 1e-13 * target[0]


def test_a_limit_spreads_the_correction():
    """With a limit more holes are used, the correction is still made; too small a limit is refused."""
    holes = weight_splitting.evenly_spaced(12, 0.0)
    split = weight_splitting.split_freely(_polar(30.0, 100.0), holes, limit=12.0)
    assert max(split.weights) <= 12.0 + 1e-12
    assert split.residual() < 1e-12
    with pytest.raises(SizingError, match="cannot make"):
        weight_splitting.split_freely(_polar(30.0, 100.0), holes, limit=3.0)
    with pytest.raises(SizingError, match="cannot make"):
        weight_splitting.split_freely(_polar(30.0, 200.0), holes[:3])


def _brute(target, holes, sizes, quantity, most):
    """Least residual over all fillings with at most one weight a hole."""
    unit, best = weight_splitting.hole_directions(holes), np.inf
    for filling in product(range(len(sizes) + 1), repeat=len(holes)):
        counts = [filling.count(i + 1) for i in range(len(sizes))]
        if sum(f > 0 for f in filling) > most or any(c > q for c, q in zip(counts, quantity, strict=True)):
            continue
        weights = np.array([0.0, *sizes])[list(filling)]
        best = min(best, abs(target - weights @ unit))
    return best


@pytest.mark.parametrize("seed", range(6))
def test_stock_weights_are_as_good_as_brute_force(seed):
    """Random corrections, angles, weights and stock: no filling leaves less."""
    rng = np.random.default_rng(seed)
    holes = tuple(weight_splitting.Hole(str(i), a) for i, a in enumerate(rng.uniform(0, 2 * np.pi, 6)))
    sizes, quantity = rng.uniform(1, 10, 3), rng.integers(1, 4, 3)
    most, target = int(rng.integers(2, 7)), complex(_polar(rng.uniform(3, 20), rng.uniform(0, 360)))
    stock = [Plate(str(i), float(s), int(q)) for i, (s, q) in enumerate(zip(sizes, quantity, strict=True))]
    split = weight_splitting.split_from_stock(target, holes, stock, weight_splitting.SplitRules(1, most))
    assert split.residual() == pytest.approx(_brute(target, holes, sizes, quantity, most), rel=1e-6)
    assert split.is_optimal(1e-6)
    assert sum(len(p) > 0 for p in split.pieces) <= most
    used = [name for hole in split.pieces for name in hole]
    assert all(used.count(plate.name) <= plate.quantity for plate in stock)


def test_of_equal_sets_the_lightest():
    """A weight and its opposite twin add nothing: they are left out."""
    split = weight_splitting.split_from_stock(
        10.0 + 0j,
        weight_splitting.evenly_spaced(4, 0.0),
        [Plate("ten", 10.0, 4)],
        weight_splitting.SplitRules(1, None),
    )
    assert split.weights == (10.0, 0.0, 0.0, 0.0)


def test_a_small_enough_residual_gives_the_lightest_set():
    """With a residual that is small enough, the lightest set within it, against brute force."""
    holes, sizes, target = weight_splitting.evenly_spaced(6, 0.2), (2.0, 3.0, 5.0), complex(_polar(9.0, 70.0))
    stock = [Plate(str(m), m, 9) for m in sizes]
    split = weight_splitting.split_from_stock(target, holes, stock, weight_splitting.SplitRules(1, None, 0.2))
    unit, lightest = weight_splitting.hole_directions(holes), np.inf
    for filling in product((0.0, *sizes), repeat=6):
        if abs(target - np.array(filling) @ unit) <= 1.8:
            lightest = min(lightest, sum(filling))
    assert split.residual() <= 1.8 * (1 + 1e-6)
    assert sum(split.weights) == pytest.approx(lightest)
