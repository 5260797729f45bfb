"""Trial runs, and the correction weights that they give.

Inside, phase counts as lead of the vibration and weight angles with the sense of rotation, whatever the sheet counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import DataError
from . import influence_coefficients
from .correction_uncertainty import (
    CoefficientCovariance,
    CorrectionUncertainty,
    covariance_of_runs,
    covariance_of_stated,
    propagate,
)


@dataclass(frozen=True)
class TrialPlane:
    """A plane that carries weights."""

    name: str
    limit: float = np.inf
    """Largest weight that may be mounted [kg or kg m]."""


@dataclass(frozen=True)
class TrialRun:
    """One run of the machine."""

    name: str
    weights: Complexes
    """All weights that were on, (planes,) [kg or kg m]."""
    trial: Complexes
    """Those of them that were put on for this run, (planes,)."""
    stayed_on: bool | None
    """Whether they stayed on after it; None where nothing was put on."""
    readings: Complexes
    """Readings, (rows,) [m, m/s or m/s2]."""
    errors: Floats | None = None
    """Covariance of the parts of each reading, (rows, 2, 2), where the sheet states their intervals."""
    shared: Mapping[str, float] = field(default_factory=dict)
    """Deviation of an error that the phases of all readings at a speed share, by speed [rad]."""


@dataclass(frozen=True)
class TrialRuns:
    """A sheet of trial runs, in the sense of lead and with rotation."""

    name: str
    source: str
    phase: str
    """What the sheet's phases count: ``lead`` or ``lag``."""
    angles: str
    """How the sheet counts weight angles: ``with rotation`` or ``against rotation``."""
    amplitude: str
    """Metric of the readings, such as ``peak_to_peak``."""
    planes: tuple[TrialPlane, ...]
    rows: tuple[tuple[str, str], ...]
    """Sensor and speed of each row."""
    factors: Floats
    """Factor of each row in what is made small, (rows,)."""
    reading: str
    """Dimension of the readings; ``mixed`` where sensors differ and each has its scale."""
    weight: str
    """Dimension of the weights: ``mass`` or ``first moment``."""
    runs: tuple[TrialRun, ...]
    """Empty where the sheet gives the coefficients."""
    given: influence_coefficients.Coefficients | None
    """Coefficients where the sheet gives them."""
    least_effect: float
    published: Mapping[str, complex]
    """Weights by plane that the source prints, in the sheet's own sense [kg or kg m]."""
    note: str
    given_errors: Floats | None = None
    """Covariances of given readings and coefficients, (planes + 1, rows, 2, 2), where intervals are stated."""

    @property
    def on_now(self) -> Complexes:
        """Weights that are still on after the last run, (planes,)."""
        on = np.zeros(len(self.planes), dtype=complex)
        for run in self.runs:
            on = on + (run.trial if run.stayed_on else 0.0)
        return on

    def coefficients(self) -> influence_coefficients.Coefficients:
        """Influence coefficients; a trial weight with too little effect is refused by name."""
        if self.given is not None:
            return self.given
        for run, effect in self.effects().items():
            if effect < self.least_effect:
                raise DataError(
                    f"{self.name}: the trial weight of run {run!r} changed no reading by more than "
                    f"{100 * effect:.1f} % (expected {100 * self.least_effect:g} %): too little effect to compute "
                    "from; repeat the run with a larger trial weight, or state a smaller least_effect in the sheet"
                )
        return influence_coefficients.influence_coefficients(*self._stacked())

    def _stacked(self) -> tuple[Complexes, Complexes]:
        """Weights (runs, planes) and readings (runs, rows) of all runs."""
        return np.array([run.weights for run in self.runs]), np.array([run.readings for run in self.runs])

    def scatter(self) -> CoefficientCovariance | None:
        """Covariance of the coefficients by stated intervals of readings, else by repeated runs; None by neither."""
        if self.given is not None:
            return None if self.given_errors is None else covariance_of_stated(self.given_errors)
        stated = [run.errors for run in self.runs if run.errors is not None]
        return covariance_of_runs(*self._stacked(), np.array(stated) if stated else None, self._shared())

    def _shared(self) -> Floats | None:
        """Deviation of each shared error of phase, where it acts, (errors, runs, rows) [rad]; None without any."""
        found = []
        for i, run in enumerate(self.runs):
            for speed, deviation in run.shared.items():
                acts = np.zeros((len(self.runs), len(self.rows)))
                acts[i] = [deviation * (at == speed) for _, at in self.rows]
                found.append(acts)
        return np.array(found) if found else None

    def uncertainty(self, solution: influence_coefficients.Solution) -> CorrectionUncertainty | None:
        """Intervals of a solution of this sheet; None where nothing tells how far readings scatter."""
        found = self.scatter()
        return None if found is None else propagate(solution, found, lambda c: self._solved(c, solution.method))

    def effects(self) -> dict[str, float]:
        """Largest change of a reading by each trial weight, relative to the last run with the same other weights."""
        found = {}
        for i, run in enumerate(self.runs):
            if run.stayed_on is None:
                continue
            others = run.weights - run.trial
            tiny = 1e-9 * float(np.abs(run.trial).max())
            before = [r for r in self.runs[:i] if np.allclose(r.weights, others, rtol=0.0, atol=tiny)]
            found[run.name] = influence_coefficients.weight_effect(
                before[-1].readings * self.factors, run.readings * self.factors
            )
        return found

    def solve(self, method: str) -> influence_coefficients.Solution:
        """Correction weights, in the sense of lead and with rotation."""
        return self._solved(self.coefficients(), method)

    def _solved(
        self, coefficients: influence_coefficients.Coefficients, method: str
    ) -> influence_coefficients.Solution:
        return influence_coefficients.solve_weights(
            coefficients, method, self.factors, [plane.limit for plane in self.planes]
        )

    def in_sheet_sense(self, weights: Complexes) -> Complexes:
        """Weights with their angles counted as the sheet counts them."""
        return weights if self.angles == "with rotation" else weights.conj()

    def as_sheet_phase(self, readings: Complexes) -> Complexes:
        """Readings with their phases counted as the sheet counts them."""
        return readings if self.phase == "lead" else readings.conj()
