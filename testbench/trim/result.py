"""What is missing at each site and what to add there, with the verdict."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance import sizing
from balance.arrays import Floats
from balance.combinations import text_of
from balance.conditions import Conditions
from balance.estimation.covariance_weighting import CombinedImbalance
from balance.estimation.estimate import Estimate
from balance.estimation.first_moment_imbalance import Imbalance, with_condition_values
from balance.estimation.identifiability import NotIdentifiable
from balance.mechanism import Mechanism
from balance.stock import Plate

from ..findings import Finding
from ..motion.gaps import CODE as GAP
from ..recording import Origin
from .case import Source
from .missing import Missing, Share

_MEASURED: dict[Source, str] = {
    "wrench": "force", "torque": "torque", "vibration": "vibration", "trials": "vibration",
}  # fmt: skip


@dataclass(frozen=True)
class Trim:
    """What runs say of a mechanism as it was mounted."""

    conditions: Conditions
    mechanism: Mechanism
    """As mounted, by its file and the sheet of runs."""
    bare: Mechanism
    """Without payload and counter-masses."""
    runs: tuple[str, ...]
    origin: Origin
    shares: tuple[Share, ...]
    """By source."""
    missing: tuple[Missing, ...]
    """By all sources, weighted."""
    imbalance: Imbalance
    """The conditions' values, by all sources."""
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts_before: tuple[str, ...]
    consensus: CombinedImbalance | None = None
    """Whether several sources agree."""
    plates: tuple[Plate, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def source(self) -> str:
        """What tells: ``wrench``, ``torque``, ``vibration``, ``trials``, several joined by ``+``."""
        return "+".join(share.source for share in self.shares)

    @property
    def unexplained(self) -> float:
        """The largest share of what a source measured that stays unexplained."""
        return max(share.unexplained for share in self.shares)

    @cached_property
    def values(self) -> tuple[tuple[str, Estimate | None], ...]:
        """The balance conditions, left-hand sides as measured; None where the runs do not determine one."""
        return tuple(
            (text_of(self.conditions.coefficients(row)), self._estimate(unit))
            for row, unit in enumerate(np.eye(self.conditions.rank))
        )

    @cached_property
    def addition(self) -> sizing.Sizing:
        """What to add to the sites that are told to lack something: from the plates, else of any mass."""
        lacking = [m.site for m in self.missing if m.told and m.first_moment > 0.0]
        if not lacking:
            return sizing.given(self.conditions, self._measured, {})
        if self.plates:
            return sizing.from_stock(self.conditions, self._measured, self.plates, lacking)
        return sizing.exact(self.conditions, self._measured, lacking)

    @property
    def removal(self) -> tuple[Missing, ...]:
        """Sites that are told to have too much."""
        return tuple(m for m in self.missing if m.told and m.first_moment < 0.0)

    @property
    def predicted_residual(self) -> float:
        """First-moment residual with the addition: what the determined conditions keep [kg m]."""
        return self.addition.residual()

    @property
    def predicted_residual_interval(self) -> tuple[float, float]:
        """From the least to the most that the conditions' intervals of 95 % leave of it [kg m]."""
        left = np.abs(self.conditions.values(self.addition.after))
        half = np.array([0.0 if e is None else e.half_width() for _, e in self.values])
        return float(np.maximum(left - half, 0.0).max(initial=0.0)), float((left + half).max(initial=0.0))

    def left(self) -> list[Missing]:
        """What each site lacks still, with the addition."""
        added = {c.site: c.mass * float(np.linalg.norm(c.position)) for c in self.addition.counter_masses}
        return [
            Missing(m.site, m.position, m.first_moment - by, (m.interval[0] - by, m.interval[1] - by))
            for m in self.missing
            for by in [added.get(m.site, 0.0)]
        ]

    @property
    def _measured(self) -> Mechanism:
        by_file = self.conditions.values(self.mechanism)
        values = [file if e is None else e.value for (_, e), file in zip(self.values, by_file, strict=True)]
        return with_condition_values(self.conditions, self.mechanism, np.array(values))

    def _estimate(self, combination: Floats) -> Estimate | None:
        if self.imbalance.is_fixed(combination):
            return None
        try:
            return self.imbalance.estimate(combination)
        except NotIdentifiable:
            return None

    @property
    def interval_level(self) -> float | None:
        """Of the intervals; None where they do not hold what a source leaves unexplained, or no source is trusted."""
        doubted = any(share.doubtful for share in self.shares) or bool(self.doubts_before)
        return None if doubted else 0.95

    def doubts(self) -> list[str]:
        """Why the result is doubtful; empty if it is not."""
        found = list(self.doubts_before)
        for share in self.shares:
            if share.doubtful:
                found.append(
                    f"{share.unexplained:.0%} of the measured {_MEASURED[share.source]} stays unexplained: more than "
                    "noise leaves; what is systematic (sensors, levers, the model) may exceed the intervals"
                )
        return found + [finding.message for finding in self.findings if finding.code != GAP]

    @property
    def gaps(self) -> tuple[str, ...]:
        """What was left out for gaps in records: said, and no doubt by itself."""
        return tuple(dict.fromkeys(finding.message for finding in self.findings if finding.code == GAP))

    @property
    def verdict(self) -> str:
        """``add``, ``remove`` (a site has too much), ``nothing told`` (every interval holds zero), or ``doubtful``."""
        if self.doubts():
            return "doubtful"
        told = [m.first_moment for m in self.missing if m.told]
        if not told:
            return "nothing told"
        return "remove" if min(told) < 0.0 else "add"
