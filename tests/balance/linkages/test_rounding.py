"""Intervals from the last digits of the inputs."""

import numpy as np
import pytest

from balance.linkages.equivalence_method import balance_linkage, rounding_intervals
from balance.linkages.linkage_files import load_linkage


def test_random_inputs_within_their_rounding_stay_in_the_interval():
    """Whatever digits were cut off, the result lies where the interval says, up to second order."""
    result = balance_linkage(load_linkage("knife"))
    bounds, rng = rounding_intervals(result), np.random.default_rng(1)
    for _ in range(30):
        moved = {n: s.value + s.half_unit * rng.uniform(-1, 1) for n, s in result.linkage.symbols.items()}
        for name, value in balance_linkage(result.linkage, moved, tree=result.tree).results().items():
            low, high = bounds[name]
            assert low - 0.1 * (high - low) <= value <= high + 0.1 * (high - low)


def test_one_input_alone_gives_its_own_share():
    """m6* = m6 L6 / (2 R6): the interval of a product is the sum of relative half units, to first order."""
    result = balance_linkage(load_linkage("dwell"))
    symbols = result.linkage.symbols
    share = sum(symbols[name].half_unit / symbols[name].value for name in ("m6", "L6", "R6"))
    low, high = rounding_intervals(result)["m6*"]
    assert (high - low) / 2 == pytest.approx(result.results()["m6*"] * share, rel=1e-3)
