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
from balance.estimation.identifiability import Identifiability
from balance.mechanism import Mechanism

from ..errors import AnalysisError
from ..motion.derivatives import HIGHEST_CUTOFF
from ..motion.gaps import reach_of
from .evidence import POSITION_BANDWIDTH, Evidence, gather
from .methods import Method, Methods
from .record import LONGEST_DELAY_S, JointRecord

CUTOFFS_HZ = tuple(1.25 * 2 ** (k / 2) for k in range(11))
"""Half octaves from 1.25 to 40 Hz: what arms and linkages of this size do and what their encoders resolve."""
LEAST_PERIODS = 10.0
"""Periods of the cut-off that the records must last, so that there are stretches to take an interval from."""
STRETCHES = 10
FOLDS = 5
"""Each holds out two stretches that are half a record apart."""
MOST_DELAYS = 10
"""Tried either way, evenly."""
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

    method: Method
    chosen: Candidate
    best_of_each: tuple[Candidate, ...]
    held_out: "HeldOut"
    predicted: Floats
    """Rows of each stretch as predicted without it, (n, rows) [N m, N]."""
    predicted_smooth: Floats
    """The same from low-passed columns, to stand beside the low-passed torque."""

    @property
    def evidence(self) -> Evidence:
        """At the chosen cut-off."""
        return self.held_out.evidence


def choose(
    records: Sequence[JointRecord], mechanism: Mechanism, identifiable: Identifiability, method: Method = "ls"
) -> Choice:
    """Apply the rule, by least squares whatever the method. Raises AnalysisError for records that are too short."""
    cutoffs = possible_cutoffs(records)
    common = _common(records, min(cutoffs))
    found = [_best(gather(records, mechanism, cutoff), mechanism, identifiable, common) for cutoff in cutoffs]
    chosen, held_out = min(found, key=lambda pair: pair[0].error)
    parameters = held_out.parameters(chosen.delay, method)
    return Choice(
        method,
        chosen,
        tuple(candidate for candidate, _ in found),
        held_out,
        held_out.predict(parameters, held_out.columns),
        held_out.predict(parameters, held_out.smooth_columns),
    )


def _common(records: Sequence[JointRecord], lowest: float) -> Floats:
    """One at the instants by which all cut-offs are compared, those that no gap touches at the lowest one, (n, 1).

    If that leaves none, each is compared by its own.
    """
    reach = reach_of(POSITION_BANDWIDTH * lowest)
    sound = np.concatenate([r.sound(reach)[r.edge : r.grid.count - r.edge] for r in records])
    return sound if sound.any() else np.ones_like(sound)


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
    """Whole samples, zero among them, up to LONGEST_DELAY_S either way; none where there are forces alone [s]."""
    if not records[0].torque.shape[1]:
        return [0.0]
    step = max(record.grid.step for record in records)
    most = int(LONGEST_DELAY_S / step + 1e-6)
    stride = max(1, -(-most // MOST_DELAYS))
    return [k * step for k in range(-(most // stride) * stride, most + 1, stride)]


def _best(
    evidence: Evidence, mechanism: Mechanism, identifiable: Identifiability, common: Floats
) -> "tuple[Candidate, HeldOut]":
    held_out = HeldOut(evidence, mechanism, identifiable)
    found = [
        Candidate(evidence.cutoff, delay, held_out.error(delay, common))
        for delay in delays([part.record for part in evidence.parts])
    ]
    return min(found, key=lambda candidate: candidate.error), held_out


class HeldOut:
    """Predictions for stretches from the rest of the record."""

    def __init__(self, evidence: Evidence, mechanism: Mechanism, identifiable: Identifiability) -> None:
        self.evidence = evidence
        self.mechanism, self.identifiable = mechanism, identifiable
        pivots = list(identifiable.pivots)
        self.columns = evidence.columns[:, :, pivots]
        self.smooth_columns = evidence.low_passed_columns(pivots)
        self.fold = np.arange(len(self.columns)) * STRETCHES // len(self.columns) % FOLDS
        self._methods: dict[float, Methods] = {}
        self._training = [_training(self.fold == k, evidence) for k in range(FOLDS)]

    def parameters(self, delay: float, method: Method = "ls") -> Floats:
        """Base parameters identified without each fold, (FOLDS, r)."""
        return self.at(delay).held_out(method, self._training)

    def at(self, delay: float) -> Methods:
        """The methods at a delay [s]."""
        if delay not in self._methods:
            made = Methods(self.evidence, self.mechanism, self.identifiable, delay, self.smooth_columns)
            self._methods[delay] = made
        return self._methods[delay]

    def predict(self, parameters: Floats, columns: Floats) -> Floats:
        """Torque of every stretch, from the parameters that were identified without it, (n, joints) [N m, N]."""
        return np.einsum("njr,nr->nj", columns, parameters[self.fold])

    def error(self, delay: float, common: Floats | float = 1.0) -> float:
        """Rms over the rows of the torque error on held-out stretches, as a part of the torque's rms, where ``common``.

        That is one where samples count, (n, 1).
        """
        torque = self.evidence.torque(delay)
        predicted = self.predict(self.parameters(delay), self.columns)
        shares = unexplained(torque, predicted, self.evidence.moving * common)
        return float(np.sqrt(np.mean(shares**2)))


def unexplained(torque: Floats, predicted: Floats, used: Floats) -> Floats:
    """Rms of what a prediction leaves of the torque, as a part of the torque's rms, of each joint, (joints,)."""
    left = np.sum(used * (torque - predicted) ** 2, axis=0)
    return np.sqrt(left / np.maximum(np.sum(used * torque**2, axis=0), np.finfo(float).tiny))


def _training(held_out: Indices, evidence: Evidence) -> Floats:
    from scipy.ndimage import maximum_filter1d

    guard = int(GUARD_PERIODS / evidence.cutoff / evidence.parts[0].record.grid.step)
    near = maximum_filter1d(held_out.astype(float), 2 * guard + 1)
    return (1.0 - near)[:, None]
