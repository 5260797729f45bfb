"""What the steps of a recorded time column say of its sampling: the step of a sample, and which steps are gaps."""

from dataclasses import dataclass

from . import rounding
from .clock import ClockStats

GAP = 1.5
"""A step longer than this many samples is a gap."""
IRREGULAR = 0.1
"""Steps whose middle half spreads over more than this share of the median are those of no sampled signal."""
RATE_TOLERANCE = 0.005
"""A header's rate and 1 / median step may differ by this share: rates are often printed in three digits."""
_PLACES = 5
"""Steps of rounded times lie in so few places: two, more where they were rounded twice."""
_MATTERS = 1e-4
"""Mean and median step that differ by less than this share are not told apart."""
MANY = 0.05
"""Share of longer steps above which a steady clock whose times are rounded is likelier than samples lost as evenly."""


@dataclass(frozen=True)
class Sampling:
    """The step of a sample, in the unit of the times, and how it was found."""

    step: float
    longest: float
    """Longer steps are gaps."""
    source: str
    """``median_step``, or ``mean_step`` where the times are rounded so that the median is the step of no sample."""
    spread: float
    """Spread of the middle half of the steps, as a share of their median; 0 where their scatter is all of rounding."""
    grid: rounding.Grid | None = None
    """The two kinds of steps, where the times are rounded so coarsely or samples may be lost."""
    evenness: rounding.Evenness | None = None
    settled: bool = True
    """Whether rounded times and samples lost as evenly can be told apart, where there are two kinds of steps."""

    @property
    def is_steady(self) -> bool:
        """Whether the steps are those of a sampled signal."""
        return self.step > 0 and self.spread <= IRREGULAR

    @property
    def rounded(self) -> bool:
        """Whether the step is the mean of rounded ones."""
        return self.source == "mean_step"


def of(clock: ClockStats, stated_step: float | None = None) -> Sampling:
    """The sampling that a column shows; ``stated_step``, in its unit, is that of the header's rate."""
    steps = rounding.grid(clock)
    if steps is None:
        return _by_median(clock)
    even = rounding.evenness(clock, steps)
    if steps.short == 1 and _may_be_lost(steps, even, stated_step):
        told = not even.rounded or _near(stated_step, steps.place)
        return _by_median(clock, steps, even, told)
    if not even.rounded:
        return _by_median(clock, steps, even)
    longest = max(GAP * steps.mean, (steps.short + 1.5) * steps.place)
    mean = even.mean if even.uneven else clock.steps.mean(0.0, longest)
    told = steps.short > 1 or steps.longer_share > 0.5 or _near(stated_step, mean)
    return Sampling(mean, longest, "mean_step", 0.0, steps, even, told)


def _may_be_lost(steps: rounding.Grid, even: rounding.Evenness, stated_step: float | None) -> bool:
    """Whether steps of two places among those of one are read as samples that were lost."""
    if not even.rounded or _near(stated_step, steps.place):
        return True
    return steps.longer_share < MANY and not _near(stated_step, steps.mean)


def _near(stated_step: float | None, step: float) -> bool:
    return stated_step is not None and abs(step / stated_step - 1.0) <= RATE_TOLERANCE


def _by_median(
    clock: ClockStats,
    steps: rounding.Grid | None = None,
    even: rounding.Evenness | None = None,
    settled: bool = True,
) -> Sampling:
    """By the median step; by the mean of those about it where they lie in so few places that times were rounded.

    2048 samples a second with times in four decimals have steps of 0.0004 and 0.0005: their median is that of 2000.
    """
    median = clock.steps.quantile(0.5)
    if not median > 0:
        return Sampling(median, GAP * median, "median_step", 0.0)
    spread = (clock.steps.quantile(0.75) - clock.steps.quantile(0.25)) / median
    known = rounding.known_to(clock, median)
    longest = GAP * median + known
    found = clock.steps.places(median / 2.0 - known, longest, known)
    if found is None or found[0] > _PLACES or abs(found[1] / median - 1.0) <= _MATTERS:
        return Sampling(median, longest, "median_step", spread, steps, even, settled)
    return Sampling(found[1], longest, "mean_step", spread, steps, even, settled)
