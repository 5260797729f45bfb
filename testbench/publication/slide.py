"""Printed extremes of the force sensors beside the printed reduction of the acceleration: two numbers that disagree."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

KEY = "force_x_motion_5kg_3g"
"""Of the extremes in a file of published numbers."""
PAYLOAD_KG, MOTION, PEAK_G = 5.0, "x", 3.0


@dataclass(frozen=True)
class ForceSlide:
    """Smallest and largest reading of the force sensors in one condition [N]; the acceleration's printed fall [%]."""

    without: tuple[float, float]
    balanced: tuple[float, float]
    acceleration_percent: float

    @classmethod
    def of(cls, tests: Mapping[str, Any], acceleration_percent: float | None) -> "ForceSlide | None":
        """From the tests of a file of published numbers; None where it has no such slide."""
        if KEY not in tests or acceleration_percent is None:
            return None
        ends = [tuple(map(float, tests[KEY][f"{name}_min_max_N"])) for name in ("unbalanced", "balanced")]
        (low, high), (low_with, high_with) = ends
        return cls((low, high), (low_with, high_with), acceleration_percent)

    @property
    def reductions(self) -> dict[str, float]:
        """By how much each amplitude that extremes allow falls [%]."""
        (low, high), (low_with, high_with) = self.without, self.balanced
        return {
            "peak_to_peak": _fall(high - low, high_with - low_with),
            "positive_peak": _fall(high, high_with),
            "negative_peak": _fall(-low, -low_with),
        }

    @property
    def spans(self) -> tuple[float, float]:
        """Peak to peak, without counter-masses and with [N]."""
        return self.without[1] - self.without[0], self.balanced[1] - self.balanced[0]

    def contradiction(self) -> str:
        """What disagrees, in printed numbers alone."""
        falls, (low, high), (low_with, high_with) = self.reductions, self.without, self.balanced
        return (
            f"Two printed numbers of one condition ({PAYLOAD_KG:g} kg, {MOTION}, {PEAK_G:g} g0) disagree: the base's "
            f"acceleration along {MOTION} falls by {self.acceleration_percent:.1f} %, the force between mechanism and "
            f"base by {falls['peak_to_peak']:.1f} % peak to peak ({self.spans[0]:.1f} to {self.spans[1]:.2f} N). "
            f"Its positive peak goes from {high:.1f} to {high_with:.1f} N, a fall of {falls['positive_peak']:.1f} %, "
            f"its negative one from {low:.1f} to {low_with:.2f} N, a fall of {falls['negative_peak']:.1f} %."
        )


def _fall(without: float, balanced: float) -> float:
    return 100.0 * (1.0 - balanced / without)
