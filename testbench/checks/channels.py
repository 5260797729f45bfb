"""Numbers of a channel, gathered block by block."""

import math
from dataclasses import dataclass

import numpy as np

from ..recording import Samples


@dataclass
class ChannelStats:
    """Counts and values of one channel, in its unit. ``mean``, ``min`` and ``max`` are of the finite samples."""

    n: int = 0
    not_finite: int = 0
    min: float = math.inf
    max: float = -math.inf
    first: float = math.nan
    last: float = math.nan
    total: float = 0.0

    @property
    def mean(self) -> float:
        """Mean of the finite samples; NaN if there are none."""
        finite = self.n - self.not_finite
        return self.total / finite if finite else math.nan

    @property
    def is_constant(self) -> bool:
        """Whether all samples are one finite value."""
        return self.n > 1 and self.not_finite == 0 and self.min == self.max

    def update(self, samples: Samples) -> tuple[float, float] | None:
        """Take in the next samples; the least and the largest of them if all are finite."""
        if not self.n:
            self.first = float(samples[0])
        self.last = float(samples[-1])
        self.n += len(samples)
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(samples.sum())
        finite = samples
        if not math.isfinite(total):  # a sample is not finite, or the sum overflows
            finite = samples[np.isfinite(samples)]
            self.not_finite += len(samples) - len(finite)
            total = _sum(finite)
        if not len(finite):
            return None
        least, most = float(finite.min()), float(finite.max())
        self.min, self.max = min(self.min, least), max(self.max, most)
        self.total += total
        return (least, most) if len(finite) == len(samples) else None

    def as_dict(self) -> dict[str, float | int | None]:
        """The numbers as they are printed; what is not finite is None."""
        values = {"min": self.min, "max": self.max, "mean": self.mean, "first": self.first, "last": self.last}
        finite = {key: value if math.isfinite(value) else None for key, value in values.items()}
        return {"n": self.n, "nan": self.not_finite, **finite}


def _sum(samples: Samples) -> float:
    try:
        return math.fsum(samples)
    except OverflowError:
        return math.inf
