"""What sites lack, by each source and by all; refused where the record tells next to nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from balance.arrays import Floats

from ..errors import AnalysisError
from .case import Source

RESOLUTION = 0.25
"""Half of an interval, as a part of the first moment that the site lacks without counter-masses, from which a record
cannot tell what is missing."""
DOUBTFUL_SHARE: dict[Source, float] = {"wrench": 0.1, "torque": 0.15, "vibration": 0.1, "trials": np.inf}
"""Of what was measured that stays unexplained, from which a result is doubtful: noise leaves half of that where
sensors are as their data sheets say, and what is systematic is not in the intervals; of trial masses it is noise, which
they contain."""


@dataclass(frozen=True)
class Missing:
    """What a site lacks; negative where it has too much."""

    site: str
    position: Floats
    """In its body's frame, (3,) [m]."""
    first_moment: float
    """Mass times distance from the body's joint [kg m]."""
    interval: tuple[float, float]
    """Of 95 % [kg m]."""

    @property
    def mass(self) -> float:
        """[kg]"""
        return self.first_moment / float(np.linalg.norm(self.position))

    @property
    def told(self) -> bool:
        """Whether the interval leaves out zero."""
        return not self.interval[0] <= 0.0 <= self.interval[1]

    def as_dict(self) -> dict[str, Any]:
        """The row as it is printed."""
        return {
            "site": self.site,
            "first_moment_kgm": self.first_moment,
            "interval": list(self.interval),
            "mass_kg": self.mass,
            "position_m": [float(x) for x in self.position],
        }


@dataclass(frozen=True)
class Share:
    """What one source says, where several do or one does."""

    source: Source
    missing: tuple[Missing, ...]
    unexplained: float
    """Share of what it measured."""

    @property
    def doubtful(self) -> bool:
        """Whether too much stays unexplained."""
        return self.unexplained > DOUBTFUL_SHARE[self.source]

    def as_dict(self) -> dict[str, Any]:
        """The source as it is printed."""
        return {
            "source": self.source,
            "missing": [m.as_dict() for m in self.missing],
            "unexplained": self.unexplained,
        }


def refuse_blur(missing: Sequence[Missing], bare: Sequence[float], runs: Sequence[str], hint: str) -> None:
    """Refuse intervals so wide that the record tells next to nothing; ``bare`` is what each site lacks without any."""
    largest = max((abs(value) for value in bare), default=0.0)
    for one in missing:
        half = 0.5 * (one.interval[1] - one.interval[0])
        if half > RESOLUTION * largest:
            raise AnalysisError(
                f"{', '.join(runs)}: cannot tell what is missing at {one.site}: {one.first_moment:.3g} kg m, known to "
                f"{half:.2g} kg m only, where the mechanism without counter-masses lacks {largest:.3g} kg m; {hint}"
            )
