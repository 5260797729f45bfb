"""Why an identification is doubtful."""

from typing import TYPE_CHECKING

from .record import LONGEST_DELAY_S

if TYPE_CHECKING:
    from .result import Identification

DOUBTFUL_RATIO = 0.3
"""Part of the torque, low-passed like the model, that may stay unexplained before a result is doubtful."""
FAIR_CONDITION = 30.0
POOR_CONDITION = 100.0
"""Of the base columns, scaled to unit length, from which an excitation is no longer good, and poor (Gautier, Khalil,
Int. J. Robot. Res. 11, 1992)."""
DOUBTFUL_WIDTH = 0.5
"""Half of an interval, as a part of the largest first moment, from which a first moment is doubtful."""


def doubts(result: "Identification") -> list[str]:
    """What makes a result doubtful; empty if nothing does."""
    found = [
        f"{ratio:.0%} of {result.named(row)} below {result.chosen.cutoff:.3g} Hz stays unexplained"
        for row, ratio in zip(result.rows, result.rms_ratio_in_band, strict=True)
        if ratio > DOUBTFUL_RATIO
    ]
    seen = result.identified.observability
    if seen.condition > POOR_CONDITION:
        found.append(
            f"the motion tells the parameters poorly apart: condition {seen.condition:.3g}, expected below "
            f"{POOR_CONDITION:g}; weakest: {seen.weakest}"
        )
    if abs(result.chosen.delay) > LONGEST_DELAY_S - 0.5 * result.choice.evidence.parts[0].record.grid.step:
        found.append(f"the delay of the torques, {result.chosen.delay * 1e3:.3g} ms, is at the end of what is tried")
    found += [f"{text} is not determined by this record" for text in result.undetermined_moments()]
    largest = max((abs(value.value) for value in result.first_moments()), default=0.0)
    for value in result.first_moments():
        low, high = value.interval
        if (high - low) / 2 > DOUBTFUL_WIDTH * largest:
            found.append(f"{value.name} is known to {(high - low) / 2:.2g} kg m only")
    return found
