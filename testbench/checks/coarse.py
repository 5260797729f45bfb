"""What is said of steps of one and of two last places: times in too few digits, or samples lost."""

from .rounding import Grid
from .sampling import MANY, Sampling

_FEW = 10
"""So few gaps are said as they are."""


def is_cause(shown: Sampling) -> bool:
    """Whether the steps scatter because the times are rounded so coarsely."""
    return shown.rounded and shown.evenness is not None and shown.evenness.rounded


def doubt(shown: Sampling, rate_hz: float, unit: str) -> str:
    """That the times were taken as rounded, and what would look the same."""
    assert shown.grid is not None
    place, one_in = shown.grid.place, 1.0 + 1.0 / shown.grid.longer_share
    return (
        f"steps of {_kinds(shown.grid, unit)} come as evenly as those of times rounded to {place:.6g} {unit}: the rate "
        f"is {rate_hz:.6g} Hz by their mean. A logger of {rate_hz * shown.step / place:.6g} Hz that lost one sample in "
        f"{one_in:.3g} as evenly would look the same; a rate in the log's header tells"
    )


def about_gaps(shown: Sampling, gaps: int, steps: int, unit: str) -> str:
    """What the gaps may be besides, or where samples may be lost though no step is a gap; empty if there is no more."""
    kinds, even = shown.grid, shown.evenness
    if is_cause(shown) and even is not None:
        missing = "the steps do not come as evenly as rounding makes them: samples may be lost there"
        return f"in {even.uneven} of {even.judged} pieces of the column {missing}" if even.uneven else ""
    if kinds is not None and not shown.settled and gaps >= _FEW:
        return (
            f"steps of {_kinds(kinds, unit)}: whether samples were lost, or none and the times have too few digits "
            f"(then a sample takes {kinds.mean:.6g} {unit}), cannot be told; a rate in the log's header tells"
        )
    if shown.rounded or gaps <= MANY * steps:
        return ""
    if kinds is None or kinds.short > 1 or even is None or not even.judged:
        return "so many are samples lost all over, or times in too few digits: then the rate is wrong too"
    return "so many are samples lost all over" + ("" if even.rounded else ": they do not come as evenly as rounding")


def _kinds(steps: Grid, unit: str) -> str:
    return f"{steps.short * steps.place:.6g} and {(steps.short + 1) * steps.place:.6g} {unit}"
