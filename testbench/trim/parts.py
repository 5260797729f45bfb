"""The runs of one mounting as records of one least squares: what is fitted beside is made independent over all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.estimation.regression import RegressionRecord

from ..findings import Finding
from .beside import reduction
from .evidence import stretches_of


@dataclass(frozen=True)
class Part:
    """One run: readings = own @ conditions + beside @ what is shared + nuisance @ what is the run's own."""

    own: Floats
    """Columns of the conditions, (n, channels, rank)."""
    beside: Floats
    """Columns of all that is fitted beside, the same in all runs, (n, channels, p)."""
    seen: Floats
    """The readings, (n, channels) [N m, m/s2]."""
    nuisance: Floats
    """Offsets, delays: of this run alone, (n, channels, k)."""
    used: Floats
    """One where a reading counts, else zero, (n, channels)."""
    rows: tuple[str, ...]
    """Names of the channels."""
    shortest: float
    """Of a stretch of the jackknife [samples]."""
    motion: str
    findings: tuple[Finding, ...] = ()
    """What was left out of the run."""


def shared(parts: Sequence[Part]) -> Floats:
    """The combinations (p, k) of what is fitted beside that the parts together excite."""
    return reduction([part.beside for part in parts])


def records(parts: Sequence[Part], combinations: Floats | None = None) -> list[RegressionRecord]:
    """The parts as records, their shared columns reduced to those combinations: all that they together excite."""
    turned = shared(parts) if combinations is None else combinations
    return [
        RegressionRecord.of(
            np.concatenate([part.own, part.beside @ turned], axis=2),
            part.seen,
            stretches_of(part.own, part.shortest),
            part.nuisance,
            part.used,
            motion=part.motion,
            rows=part.rows,
        )
        for part in parts
    ]
