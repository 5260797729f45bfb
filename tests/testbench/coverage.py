"""Whether intervals hold what they promise."""

from scipy.stats import binomtest


def assert_holds(hits: int, count: int) -> None:
    """95 % is not rejected by a two-sided binomial test at 0.1 %."""
    assert binomtest(int(hits), count, 0.95).pvalue > 1e-3, f"{hits} of {count} intervals hold the truth"
