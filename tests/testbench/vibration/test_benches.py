"""In brief what ``studies.reductions`` counts at length: intervals of simulated campaigns with known truth hold it."""

import pytest

from studies.reductions import CASES, tally

from ..coverage import assert_holds


@pytest.mark.parametrize(("bench", "axis", "seeds", "repeats"), [("stiff", "y", 6, 1), ("soft", "z", 4, 2)])
def test_intervals_hold(bench, axis, seeds, repeats):
    """Of simulated campaigns 95 % hold the truth in every metric, far above the noise and near it."""
    for counted in tally(CASES[bench], range(seeds), repeats, axis).values():
        assert_holds(counted.hits, counted.count)
