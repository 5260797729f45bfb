"""Which cut-off, and which delay between the torques and the positions, by a rule that is fixed beforehand.

The rule: of CUTOFFS_HZ and of delays up to LONGEST_DELAY_S either way, those with the least torque error on stretches
that were held out. The record is cut into STRETCHES equal stretches; parameters identified without two of them predict
the torque **as recorded** there. Too low a cut-off smears the motion, too high a one lets in noise of accelerations;
both show there. No published value has a part in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Indices
from balance.identification import BlockSums
from balance.mechanism import Mechanism
from balance.observability import Observability

from ..derivatives import HIGHEST_CUTOFF
from ..errors import AnalysisError
from .evidence import POSITION_BANDWIDTH, Evidence, gather
from .record import JointRecord

CUTOFFS_HZ = tuple(1.25 * 2 ** (k / 2) for k in range(11))
"""Half octaves from 1.25 to 40 Hz: what arms and linkages of this size do and what their encoders resolve."""
LEAST_PERIODS = 10.0
"""Periods of the cut-off that the records must last, so that there are stretches to take an interval from."""
LONGEST_DELAY_S = 0.02
"""Either way: a few turns of a control loop [s]."""
STRETCHES = 10
FOLDS = 5
"""Each holds out two stretches that are half a record apart."""
GUARD_PERIODS = 0.25
"""Periods of the cut-off left out beside what is held out, over which a low-pass would carry its torque."""


@dataclass(frozen=True)
class Candidate:
    """A cut-off [Hz] and a delay [s] with their torque error on held-out stretches, as a part of the torque's rms."""

    cutoff: float
    delay: float
    error: float


@dataclass(frozen=True)
class Choice:
    """The chosen candidate, the best of each cut-off beside it, and what the choice saw of the chosen one."""

    chosen: Candidate
    best_of_each: tuple[Candidate, ...]
    evidence: Evidence
    predicted: Floats
    """Torque of each stretch as predicted without it, (n, joints) [N m, N]."""
    predicted_smooth: Floats
    """The same from low-passed columns, to stand beside the low-passed torque."""


def choose(records: Sequence[JointRecord], mechanism: Mechanism, observability: Observability) -> Choice:
    """Apply the rule. Raises AnalysisError if the records are too short for any cut-off."""
    best = [_best(gather(records, mechanism, cutoff), observability) for cutoff in possible_cutoffs(records)]
    chosen, evidence = min(best, key=lambda pair: pair[0].error)
    held_out = HeldOut(evidence, observability)
    parameters = held_out.parameters(chosen.delay)
    return Choice(
        chosen,
        tuple(candidate for candidate, _ in best),
        evidence,
        held_out.predict(parameters, held_out.columns),
        held_out.predict(parameters, held_out.smooth_columns),
    )


def possible_cutoffs(records: Sequence[JointRecord]) -> list[float]:
    """The CUTOFFS_HZ for which the records are long enough and densely enough sampled."""
    seconds = sum(record.grid.count * record.grid.step for record in records)
    rate = min(record.grid.rate for record in records)
    possible = [
        cutoff
        for cutoff in CUTOFFS_HZ
        if cutoff * seconds >= LEAST_PERIODS and 2 * POSITION_BANDWIDTH * cutoff <= HIGHEST_CUTOFF * rate
    ]
    if not possible:
        raise AnalysisError(
            f"{', '.join(record.name for record in records)}: {seconds:.3g} s at {rate:.4g} samples per second: too "
            f"short or too sparse for any cut-off from {CUTOFFS_HZ[0]:g} to {CUTOFFS_HZ[-1]:g} Hz, of which "
            f"{LEAST_PERIODS:g} periods are needed"
        )
    return possible


def delays(records: Sequence[JointRecord]) -> list[float]:
    """Whole samples up to LONGEST_DELAY_S either way [s]."""
    step = max(record.grid.step for record in records)
    most = int(LONGEST_DELAY_S / step + 1e-6)
    return [k * step for k in range(-most, most + 1)]


def _best(evidence: Evidence, observability: Observability) -> tuple[Candidate, Evidence]:
    held_out = HeldOut(evidence, observability)
    found = [
        Candidate(evidence.cutoff, delay, held_out.error(delay))
        for delay in delays([part.record for part in evidence.parts])
    ]
    return min(found, key=lambda candidate: candidate.error), evidence


class HeldOut:
    """Predictions for stretches from the rest of the record."""

    def __init__(self, evidence: Evidence, observability: Observability) -> None:
        self.evidence = evidence
        pivots = list(observability.pivots)
        self.columns = evidence.columns[:, :, pivots]
        self.smooth_columns = evidence.low_passed_columns(pivots)
        self.fold = np.arange(len(self.columns)) * STRETCHES // len(self.columns) % FOLDS
        self._training = [_training(self.fold == k, evidence) for k in range(FOLDS)]

    def parameters(self, delay: float) -> Floats:
        """Base parameters identified without each fold, (FOLDS, r)."""
        torque = self.evidence.low_passed_torque(delay)
        whole = np.zeros(len(torque), dtype=np.intp)
        sums = (BlockSums.of(self.smooth_columns, torque, whole, used) for used in self._training)
        return np.array([one.solve(np.ones(1))[1] for one in sums])

    def predict(self, parameters: Floats, columns: Floats) -> Floats:
        """Torque of every stretch, from the parameters that were identified without it, (n, joints) [N m, N]."""
        return np.einsum("njr,nr->nj", columns, parameters[self.fold])

    def error(self, delay: float) -> float:
        """Rms over the joints of the torque error on held-out stretches, as a part of the torque's rms."""
        torque = self.evidence.torque(delay)
        shares = unexplained(torque, self.predict(self.parameters(delay), self.columns), self.evidence.moving)
        return float(np.sqrt(np.mean(shares**2)))


def unexplained(torque: Floats, predicted: Floats, used: Floats) -> Floats:
    """Rms of what a prediction leaves of the torque, as a part of the torque's rms, of each joint, (joints,)."""
    left = np.sum(used * (torque - predicted) ** 2, axis=0)
    return np.sqrt(left / np.maximum(np.sum(used * torque**2, axis=0), np.finfo(float).tiny))


def _training(held_out: Indices, evidence: Evidence) -> Floats:
    from scipy.ndimage import maximum_filter1d

    guard = int(GUARD_PERIODS / evidence.cutoff / evidence.parts[0].record.grid.step)
    near = maximum_filter1d(held_out.astype(float), 2 * guard + 1)
    return evidence.moving * (1.0 - near)[:, None]
