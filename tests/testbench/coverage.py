"""Whether intervals hold what they promise."""

from dataclasses import dataclass

from scipy.stats import binomtest


@dataclass
class Tally:
    """How often the truth was held, of how many 95 % intervals."""

    held: int = 0
    count: int = 0

    def hold(self, held: bool) -> None:
        """Count one interval."""
        self.count += 1
        self.held += bool(held)

    @property
    def pvalue(self) -> float:
        """Of 95 %, two-sided; 1 where nothing was counted."""
        return float(binomtest(self.held, self.count, 0.95).pvalue) if self.count else 1.0


def assert_holds(hits: int, count: int) -> None:
    """95 % is not rejected by a two-sided binomial test at 0.1 %."""
    assert binomtest(int(hits), count, 0.95).pvalue > 1e-3, f"{hits} of {count} intervals hold the truth"
