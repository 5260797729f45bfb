"""Peaks and medians of samples."""

import numpy as np
import pytest

from balance.arrays import parabola_peak, upper_median


@pytest.mark.parametrize("true", [-0.5, -0.31, 0.0, 0.5])
def test_vertex_of_a_parabola_is_exact(true: float) -> None:
    """Samples of a parabola give its own vertex, also across the seam of periodic samples."""
    values = 2.0 - 3.0 * (np.arange(-3.0, 4.0) - true) ** 2
    assert parabola_peak(values, 3) == pytest.approx((true, 2.0), abs=1e-14)
    assert parabola_peak(np.roll(values, 4), 0, periodic=True) == pytest.approx((true, 2.0), abs=1e-14)


def test_ends_and_level_samples_stay() -> None:
    """There is nothing to interpolate at an end, nor where samples are equal."""
    assert parabola_peak(np.array([3.0, 2.0, 1.0]), 0) == (0.0, 3.0)
    assert parabola_peak(np.array([1.0, 2.0]), 1) == (0.0, 2.0)
    assert parabola_peak(np.ones(5), 2) == (0.0, 1.0)


def test_median_of_nothing_and_of_what_is_no_number() -> None:
    """The upper of two; NaN counts as the largest; nothing has none."""
    assert upper_median(np.array([4.0, 1.0, 3.0, 2.0])) == 3.0
    assert upper_median(np.array([1.0, np.nan, 2.0])) == 2.0
    with pytest.raises(IndexError):
        upper_median(np.array([]))
