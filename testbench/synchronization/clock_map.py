"""How one clock runs against another, with an interval for every instant."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import coverage_factor

PPM = 1e-6
ASSUMED_DRIFT = 1e-4
"""Half of the 95 % interval of a drift that was not estimated: that of an ordinary crystal."""
MANY_DEGREES_OF_FREEDOM = 1000
"""Degrees of freedom of a known standard deviation."""


@dataclass(frozen=True)
class ClockMap:
    """reference = at_reference + (1 + drift) (own - at_own); all in s."""

    at_own: float
    at_reference: float
    drift: float
    """Of the reference clock against the own one: positive where the own clock is slow."""
    covariance: Floats
    """Of ``at_reference`` [s] and ``drift``, (2, 2)."""
    degrees_of_freedom: int
    """Degrees of freedom of Student's t."""
    span: tuple[float, float]
    """Start and end of what both recorded, on the own clock [s]."""

    def to_reference(self, own: Floats) -> Floats:
        """Instants (n,) [s] of the own clock on the reference's, (n,) [s]."""
        return self.at_reference + (1.0 + self.drift) * (own - self.at_own)

    def half_width(self, own: float) -> float:
        """Half of the 95 % interval of an instant's time on the reference's clock [s]."""
        share = np.array([1.0, own - self.at_own])
        return coverage_factor(self.degrees_of_freedom) * float(np.sqrt(share @ self.covariance @ share))

    @property
    def deviation(self) -> float:
        """Standard deviation of an instant in the middle of what both recorded [s]."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def offset(self) -> float:
        """The reference's time when the own clock shows zero [s]."""
        return float(self.to_reference(np.zeros(1))[0])

    @property
    def offset_interval(self) -> tuple[float, float]:
        """95 % interval of the offset [s]."""
        half = self.half_width(0.0)
        return self.offset - half, self.offset + half

    @property
    def drift_interval(self) -> tuple[float, float]:
        """95 % interval of the drift [-]."""
        half = coverage_factor(self.degrees_of_freedom) * float(np.sqrt(self.covariance[1, 1]))
        return self.drift - half, self.drift + half

    @property
    def uncertainty(self) -> float:
        """Largest half of a 95 % interval within what both recorded [s]."""
        return max(self.half_width(end) for end in self.span)

    def as_dict(self) -> dict[str, Any]:
        """The map as a JSON document, as it is stored."""
        return {
            "offset_s": self.offset,
            "offset_interval_s": list(self.offset_interval),
            "drift_ppm": self.drift / PPM,
            "drift_interval_ppm": [end / PPM for end in self.drift_interval],
            "uncertainty_s": self.uncertainty,
            "at_own_s": self.at_own,
            "at_reference_s": self.at_reference,
            "covariance": self.covariance.tolist(),
            "freedom": self.degrees_of_freedom,
            "own_span_s": list(self.span),
        }

    @classmethod
    def from_dict(cls, stored: dict[str, Any]) -> "ClockMap":
        """The map that :meth:`as_dict` gave."""
        first, last = stored["own_span_s"]
        return cls(
            float(stored["at_own_s"]),
            float(stored["at_reference_s"]),
            PPM * float(stored["drift_ppm"]),
            np.array(stored["covariance"], dtype=float),
            int(stored["freedom"]),
            (float(first), float(last)),
        )


def same_clock(span: tuple[float, float]) -> ClockMap:
    """The map of a clock onto itself."""
    return ClockMap(0.0, 0.0, 0.0, np.zeros((2, 2)), MANY_DEGREES_OF_FREEDOM, span)
