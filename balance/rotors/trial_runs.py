"""Trial runs, and the correction weights that they give.

Here phase counts as lead of the vibration and weight angles with the sense of rotation, whatever the file counts;
``in_file_sense`` and ``in_file_phase`` turn results back.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import DataError
from ..results import Key, given
from .correction_uncertainty import (
    CoefficientCovariance,
    CorrectionUncertainty,
    covariance_of_runs,
    covariance_of_stated,
    propagate,
)
from .influence_coefficients import Coefficients, Solution, influence_coefficients, solve_weights, weight_effect


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
    """Those of them that were put on for this run, (planes,) [kg or kg m]."""
    stayed_on: bool | None
    """Whether they stayed on after it; None where nothing was put on."""
    readings: Complexes
    """Readings, (rows,) [m, m/s or m/s2]."""
    errors: Floats | None = None
    """Covariance of the components of each reading, (rows, 2, 2), where the file states their intervals."""
    common_phase: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of the common-mode error of all phases at a speed, by speed [rad]."""


@dataclass(frozen=True)
class TrialRuns:
    """The trial runs of a file, in the sense of lead and with rotation."""

    name: Annotated[str, Key()]
    source: Annotated[str, Key(to=given)]
    phase: Annotated[str, Key()]
    """What the phases of the file count: ``lead`` or ``lag``."""
    angles: Annotated[str, Key()]
    """How the file counts weight angles: ``with rotation`` or ``against rotation``."""
    amplitude: Annotated[str, Key()]
    """Metric of the readings, such as ``peak_to_peak``."""
    planes: tuple[TrialPlane, ...]
    rows: tuple[tuple[str, str], ...]
    """Sensor and speed of each row."""
    factors: Floats
    """Factor of each row in the cost, (rows,) [-] or, with scales, [1/r]."""
    reading: str
    """Dimension of the readings; ``mixed`` where sensors differ and each has its scale."""
    weight: str
    """Dimension of the weights: ``mass`` or ``first moment``."""
    runs: tuple[TrialRun, ...]
    """Empty where the file states the coefficients."""
    stated: Coefficients | None
    """Coefficients where the file states them."""
    least_effect: float
    published: Mapping[str, complex]
    """Weights by plane that the source publishes, in the sense of the file [kg or kg m]."""
    note: Annotated[str, Key(to=given)]
    stated_errors: Floats | None = None
    """Covariances of stated readings and coefficients, (planes + 1, rows, 2, 2), where intervals are stated."""

    @property
    def mounted(self) -> Complexes:
        """Weights that are still on after the last run, (planes,) [kg or kg m]."""
        on = np.zeros(len(self.planes), dtype=complex)
        for run in self.runs:
            on = on + (run.trial if run.stayed_on else 0.0)
        return on

    def coefficients(self) -> Coefficients:
        """Influence coefficients; a trial weight with too little effect is refused by name."""
        if self.stated is not None:
            return self.stated
        for run, effect in self.effects().items():
            if effect < self.least_effect:
                raise DataError(
                    f"{self.name}: the trial weight of run {run!r} changed no reading by more than "
                    f"{100 * effect:.1f} % (expected {100 * self.least_effect:g} %): too little effect to compute "
                    "from; repeat the run with a larger trial weight, or state a smaller least_effect in the file"
                )
        return influence_coefficients(*self._weights_and_readings())

    def _weights_and_readings(self) -> tuple[Complexes, Complexes]:
        """Weights (runs, planes) and readings (runs, rows) of all runs."""
        return np.array([run.weights for run in self.runs]), np.array([run.readings for run in self.runs])

    def uncertainty(self, solution: Solution) -> CorrectionUncertainty | None:
        """Intervals of a solution of these runs; None where neither stated intervals nor repeated runs give them."""
        covariance = self.coefficient_covariance()
        if covariance is None:
            return None
        return propagate(solution, covariance, lambda coefficients: self._solved(coefficients, solution.method))

    def coefficient_covariance(self) -> CoefficientCovariance | None:
        """Covariance of the coefficients by stated intervals of readings, else by repeated runs; None by neither."""
        if self.stated is not None:
            return None if self.stated_errors is None else covariance_of_stated(self.stated_errors)
        errors = [run.errors for run in self.runs if run.errors is not None]
        modes = []
        for i, run in enumerate(self.runs):
            for speed, deviation in run.common_phase.items():
                mode = np.zeros((len(self.runs), len(self.rows)))
                mode[i] = [deviation * (at == speed) for _, at in self.rows]
                modes.append(mode)
        weights, readings = self._weights_and_readings()
        return covariance_of_runs(
            weights, readings, np.array(errors) if errors else None, np.array(modes) if modes else None
        )

    def effects(self) -> dict[str, float]:
        """Largest change of a reading by each trial weight, relative to the last run with the same other weights."""
        effects = {}
        for i, run in enumerate(self.runs):
            if run.stayed_on is None:
                continue
            others = run.weights - run.trial
            tiny = 1e-9 * float(np.abs(run.trial).max())
            before = [r for r in self.runs[:i] if np.allclose(r.weights, others, rtol=0.0, atol=tiny)]
            effects[run.name] = weight_effect(before[-1].readings * self.factors, run.readings * self.factors)
        return effects

    def solve(self, method: str) -> Solution:
        """Correction weights, in the sense of lead and with rotation."""
        return self._solved(self.coefficients(), method)

    def _solved(self, coefficients: Coefficients, method: str) -> Solution:
        return solve_weights(coefficients, method, self.factors, [plane.limit for plane in self.planes])

    def in_file_sense(self, weights: Complexes) -> Complexes:
        """Weights (planes,) [kg or kg m] with their angles counted as the file counts them, of the same shape."""
        return weights if self.angles == "with rotation" else weights.conj()

    def in_file_phase(self, readings: Complexes) -> Complexes:
        """Readings (rows,) [m, m/s or m/s2] with their phases counted as the file counts them, of the same shape."""
        return readings if self.phase == "lead" else readings.conj()
