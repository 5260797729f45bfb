"""How one clock runs against another, with an interval for every instant."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import LEVEL_TEXT, coverage_factor
from balance.results import Key

PPM = 1e-6
ASSUMED_DRIFT = 1e-4
"""Half of the 95 % interval of a drift that was not estimated: that of an ordinary crystal."""
DRIFT_FROM_S = 5.0
"""Duration from which a drift between clocks matters and can be estimated [s]."""
MANY_DEGREES_OF_FREEDOM = 1000
"""Degrees of freedom of a known standard deviation."""


def _ppm(share: float) -> float:
    return share / PPM


def _seconds(ends: tuple[float, float]) -> str:
    return " .. ".join(f"{end:.6f}" for end in ends)


def _ends(ends: tuple[float, float]) -> str:
    return " .. ".join(f"{_ppm(end):.1f}" for end in ends)


@dataclass(frozen=True)
class ClockMap:
    """reference = at_reference + (1 + drift) (own - at_own); all in s."""

    at_own: Annotated[float, Key("at_own_s")]
    at_reference: Annotated[float, Key("at_reference_s")]
    drift: Annotated[float, Key("drift_ppm", "drift [ppm]", ".1f", to=_ppm)]
    """Of the reference clock against the own one: positive where the own clock is slow."""
    covariance: Annotated[Floats, Key()]
    """Of ``at_reference`` [s] and ``drift``, (2, 2)."""
    degrees_of_freedom: Annotated[int, Key("freedom")]
    """Degrees of freedom of Student's t."""
    span: Annotated[tuple[float, float], Key("own_span_s")]
    """Start and end of what both recorded, on the own clock [s]."""

    def to_reference(self, own: Floats) -> Floats:
        """Instants (n,) [s] of the own clock on the reference's, (n,) [s]."""
        return self.at_reference + (1.0 + self.drift) * (own - self.at_own)

    def to_own(self, reference: Floats) -> Floats:
        """Instants (n,) [s] of the reference's clock on the own one, (n,) [s]."""
        return self.at_own + (reference - self.at_reference) / (1.0 + self.drift)

    def then(self, onward: "ClockMap") -> "ClockMap":
        """The map onto the reference of ``onward``, whose own clock is the reference of this one."""
        share = np.array([[1.0, self.at_reference - onward.at_own], [0.0, 1.0]])
        there = float(onward.to_reference(np.array([self.at_reference]))[0])
        drift = (1.0 + self.drift) * (1.0 + onward.drift) - 1.0
        covariance = self.covariance + share @ onward.covariance @ share.T
        freedom = min(self.degrees_of_freedom, onward.degrees_of_freedom)
        return ClockMap(self.at_own, there, drift, covariance, freedom, self.span)

    @property
    def inverse(self) -> "ClockMap":
        """The map of the reference's clock onto the own one; a drift's square is left out of its covariance."""
        first, last = (float(at) for at in self.to_reference(np.array(self.span)))
        drift, freedom = 1.0 / (1.0 + self.drift) - 1.0, self.degrees_of_freedom
        return ClockMap(self.at_reference, self.at_own, drift, self.covariance, freedom, (first, last))

    def half_width(self, own: float) -> float:
        """Half of the 95 % interval of an instant's time on the reference's clock [s]."""
        share = np.array([1.0, own - self.at_own])
        return coverage_factor(self.degrees_of_freedom) * float(np.sqrt(share @ self.covariance @ share))

    @property
    def deviation(self) -> float:
        """Standard deviation of an instant in the middle of what both recorded [s]."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def offset(self) -> Annotated[float, Key("offset_s", "offset [s]", ".6f")]:
        """The reference's time when the own clock shows zero [s]."""
        return float(self.to_reference(np.zeros(1))[0])

    @property
    def offset_interval(
        self,
    ) -> Annotated[tuple[float, float], Key("offset_interval_s", f"{LEVEL_TEXT} interval", _seconds)]:
        """95 % interval of the offset [s]."""
        half = self.half_width(0.0)
        return self.offset - half, self.offset + half

    @property
    def drift_interval(
        self,
    ) -> Annotated[tuple[float, float], Key("drift_interval_ppm", f"{LEVEL_TEXT} interval", _ends, to=_ppm)]:
        """95 % interval of the drift [-]."""
        half = coverage_factor(self.degrees_of_freedom) * float(np.sqrt(self.covariance[1, 1]))
        return self.drift - half, self.drift + half

    @property
    def uncertainty(self) -> Annotated[float, Key("uncertainty_s", "within [ms]", lambda s: f"{1e3 * s:.3f}")]:
        """Largest half of a 95 % interval within what both recorded [s]."""
        return max(self.half_width(end) for end in self.span)

    @classmethod
    def from_dict(cls, stored: dict[str, Any]) -> "ClockMap":
        """The map of a document."""
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
