"""Torques and forces of runs that had no part in an identification, beside what its parameters predict of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from balance.arrays import Floats
from balance.errors import ModelError

from ..errors import AnalysisError
from .cross_validation import FOLDS, SimulationError, simulation_errors, unexplained
from .records import JointRecord
from .regression_equations import RegressionEquations, regression_equations
from .result import DOUBTFUL_RATIO, Identification

OWN_FACTOR = 2.0
NEGLIGIBLE = 0.05
"""What stays unexplained may be so many times what did on held-out stretches of the identifying runs, or so little."""


@dataclass(frozen=True)
class Validation:
    """How well an identification foretells separate runs."""

    result: Identification
    runs: tuple[str, ...]
    evidence: RegressionEquations
    """Of the separate runs, at the cut-off of the identification."""

    @cached_property
    def rms_ratio(self) -> Floats:
        """Part of each row as recorded that stays unexplained, (rows,)."""
        predicted = self.result.identified.predict(self.evidence.columns)
        return unexplained(self.evidence.torque(self._delay), predicted, self.evidence.moving)

    @cached_property
    def rms_ratio_in_band(self) -> Floats:
        """The same below the cut-off, (rows,)."""
        found = self.result.identified
        predicted = self.evidence.low_passed_columns(found.identifiability.pivots) @ found.values
        return unexplained(self.evidence.low_passed_torque(self._delay), predicted, self.evidence.moving)

    @cached_property
    def angles(self) -> SimulationError | None:
        """How far simulated angles stray; None for loops, and where there are no torques."""
        if not self.result.joints:
            return None
        found = self.result.identified
        same = np.tile(found.values, (FOLDS, 1))
        try:
            return simulation_errors(
                self.evidence, self.result.mechanism, found.identifiability.pivots, [same], self._delay
            )[0]
        except ModelError:
            return None

    def doubts(self) -> list[str]:
        """Rows that the parameters do not foretell."""
        doubts = []
        for row, ratio, own in zip(
            self.result.rows, self.rms_ratio_in_band, self.result.rms_ratio_in_band, strict=True
        ):
            if ratio > min(DOUBTFUL_RATIO, max(NEGLIGIBLE, OWN_FACTOR * own)):
                doubts.append(
                    f"{', '.join(self.runs)}: {ratio:.0%} of {self.result.named(row)} below the cut-off stays "
                    f"unexplained, {own:.0%} did in the runs identified from"
                )
        return doubts

    @property
    def _delay(self) -> float:
        return self.result.chosen.delay


def validate(result: Identification, records: Sequence[JointRecord]) -> Validation:
    """Hold an identification against records of the same sensors.

    Raises AnalysisError if a record is among those identified from, or measured something else.
    """
    names = tuple(record.name for record in records)
    if twice := set(names) & set(result.runs):
        raise AnalysisError(f"{', '.join(sorted(twice))}: identified from, so it proves nothing: expected other runs")
    for record in records:
        if record.rows(result.mechanism) != result.rows:
            raise AnalysisError(
                f"{record.name}: measured {', '.join(record.rows(result.mechanism))}, expected {', '.join(result.rows)}"
            )
    return Validation(result, names, regression_equations(records, result.mechanism, result.chosen.cutoff))
