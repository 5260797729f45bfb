"""Which cut-off, and which delay between the torques and the positions, by a rule that is fixed beforehand.

The rule: of CUTOFFS_HZ and of delays up to LONGEST_DELAY_S either way, those with the least torque error on blocks
that were held out. The record is cut into BLOCKS equal blocks; parameters identified without two of them predict
the torque **as recorded** there. Too low a cut-off smears the motion, too high a one lets in noise of accelerations;
both show there. No published value has a part in it.

Held-out blocks simulated forward: torque in, angles out, beside the angles that were recorded.

Torque error favours least squares, which minimizes it; how far a simulation strays does not. A window is a held-out
block, or its first WINDOW_S; it starts from the recorded state and is left alone. Open chains only.

The methods side by side, by what was stated beforehand: error on held-out blocks, of torque and of angles.

The same cut-off, delay, blocks and starting states for all of them; each block predicted without it. Torque error:
torque as recorded against the model along the recorded motion. Angle error: see ``simulation``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats, Indices
from balance.dynamics.forward_dynamics import InverseDynamics, refuse_loops, simulate_forward
from balance.dynamics.regressor import JOINT_TERMS, joint_friction_regressor, torque_regressor
from balance.errors import ModelError
from balance.estimation.identifiability import Identifiability
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics.gaps import gap_reach
from ..kinematics.smoothing_and_derivatives import HIGHEST_CUTOFF
from .estimators import NAMES, Method, Methods, allowed
from .records import LONGEST_DELAY_S, JointRecord
from .regression_equations import POSITION_BANDWIDTH, RecordEquations, RegressionEquations, regression_equations

CUTOFFS_HZ = tuple(1.25 * 2 ** (k / 2) for k in range(11))
"""Half octaves from 1.25 to 40 Hz: what arms and linkages of this size do and what their encoders resolve."""
LEAST_PERIODS = 10.0
"""Periods of the cut-off that the records must last, so that there are blocks to take an interval from."""
BLOCKS = 10
FOLDS = 5
"""Each holds out two blocks that are half a record apart."""
MOST_DELAYS = 10
"""Tried either way, evenly."""
GUARD_PERIODS = 0.25
"""Periods of the cut-off left out beside what is held out, over which a low-pass would carry its torque."""


@dataclass(frozen=True)
class Candidate:
    """A cut-off [Hz] and a delay [s] with their torque error on held-out blocks, as a part of the torque's rms."""

    cutoff: float
    delay: float
    error: float


@dataclass(frozen=True)
class Choice:
    """The chosen candidate, the best of each cut-off beside it, and what the choice saw of the chosen one."""

    method: Method
    chosen: Candidate
    best_of_each: tuple[Candidate, ...]
    held_out: "CrossValidation"
    predicted: Floats
    """Rows of each block as predicted without it, (n, rows) [N m, N]."""
    predicted_smooth: Floats
    """The same from low-passed columns, to stand beside the low-passed torque."""

    @property
    def evidence(self) -> RegressionEquations:
        """At the chosen cut-off."""
        return self.held_out.evidence


def choose(
    records: Sequence[JointRecord], mechanism: Mechanism, identifiable: Identifiability, method: Method = "ls"
) -> Choice:
    """Apply the rule, by least squares whatever the method. Raises AnalysisError for records that are too short."""
    cutoffs = possible_cutoffs(records)
    common = _common(records, min(cutoffs))
    found = [
        _best(regression_equations(records, mechanism, cutoff), mechanism, identifiable, common) for cutoff in cutoffs
    ]
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
    reach = gap_reach(POSITION_BANDWIDTH * lowest)
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
    evidence: RegressionEquations, mechanism: Mechanism, identifiable: Identifiability, common: Floats
) -> "tuple[Candidate, CrossValidation]":
    held_out = CrossValidation(evidence, mechanism, identifiable)
    found = [
        Candidate(evidence.cutoff, delay, held_out.error(delay, common))
        for delay in delays([part.record for part in evidence.parts])
    ]
    return min(found, key=lambda candidate: candidate.error), held_out


class CrossValidation:
    """Predictions for blocks from the rest of the record."""

    def __init__(self, evidence: RegressionEquations, mechanism: Mechanism, identifiable: Identifiability) -> None:
        self.evidence = evidence
        self.mechanism, self.identifiable = mechanism, identifiable
        pivots = list(identifiable.pivots)
        self.columns = evidence.columns[:, :, pivots]
        self.smooth_columns = evidence.low_passed_columns(pivots)
        self.fold = np.arange(len(self.columns)) * BLOCKS // len(self.columns) % FOLDS
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
        """Torque of every block, from the parameters that were identified without it, (n, joints) [N m, N]."""
        return np.einsum("njr,nr->nj", columns, parameters[self.fold])

    def error(self, delay: float, common: Floats | float = 1.0) -> float:
        """Rms over the rows of the torque error on held-out blocks, as a part of the torque's rms, where ``common``.

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


def _training(held_out: Indices, evidence: RegressionEquations) -> Floats:
    from scipy.ndimage import maximum_filter1d

    guard = int(GUARD_PERIODS / evidence.cutoff / evidence.parts[0].record.grid.step)
    near = maximum_filter1d(held_out.astype(float), 2 * guard + 1)
    return (1.0 - near)[:, None]


WINDOW_S = 1.0
"""Longest window [s]."""


@dataclass(frozen=True)
class SimulationError:
    """How far simulated angles simulation_errors from recorded ones, of each window and joint."""

    rms: Floats
    """(windows, joints) [rad, m]"""
    seconds: float
    """Length of a window [s]."""

    def document(self, joints: tuple[str, ...]) -> Mapping[str, object]:
        """Median over the windows, which one that topples over does not decide, and rms, of each joint."""
        return {
            "windows": len(self.rms),
            "window_s": self.seconds,
            "median": dict(zip(joints, np.median(self.rms, axis=0).tolist(), strict=True)),
            "rms": dict(zip(joints, np.sqrt(np.mean(self.rms**2, axis=0)).tolist(), strict=True)),
        }

    @property
    def whole(self) -> float:
        """Rms over windows and joints [rad, m]."""
        return float(np.sqrt(np.mean(self.rms**2)))


def simulation_errors(
    evidence: RegressionEquations,
    mechanism: Mechanism,
    pivots: tuple[int, ...],
    parameters: Sequence[Floats],
    delay: float,
) -> list[SimulationError]:
    """Windows of all records, once for each of ``parameters``, base values (FOLDS, r) of the fold a window is in.

    Windows that a gap touches are left out. Raises ModelError for mechanisms with loops, and where no window is left.
    """
    refuse_loops(mechanism)
    count = len(evidence.time)
    block = np.arange(count) * BLOCKS // count
    rms: list[Floats] = []
    first = 0
    for part in evidence.parts:
        inside = slice(first, first + len(part.inside(part.moving)))
        first = inside.stop
        rms.append(_windows(part, mechanism, pivots, parameters, delay, block[inside]))
    if not sum(one.shape[1] for one in rms):
        raise ModelError("gaps touch every held-out block: there is none to simulate")
    step = evidence.parts[0].record.grid.step
    seconds = min(_length(int(n), step) for n in np.bincount(block)) * step
    return [SimulationError(found, seconds) for found in np.concatenate(rms, axis=1)]


def _length(samples: int, step: float) -> int:
    """An even number of steps that fit into so many samples."""
    return min(samples - 1, int(WINDOW_S / step)) // 2 * 2


def _windows(
    part: RecordEquations,
    mechanism: Mechanism,
    pivots: tuple[int, ...],
    parameters: Sequence[Floats],
    delay: float,
    block: Indices,
) -> Floats:
    """How far each window of a record strays with each of the parameters, (sets, windows, joints)."""
    labels, firsts, sizes = np.unique(block, return_index=True, return_counts=True)
    count = _length(int(sizes.min()), part.record.grid.step) + 1
    whole = part.inside(part.sound)[firsts[:, None] + np.arange(count), 0].all(axis=1)
    labels, firsts = labels[whole], firsts[whole]
    place = firsts[:, None] + np.arange(count)
    joints = part.record.torque.shape[1]
    torque = part.inside(part.late(part.record.measured, delay))[place][:, :, :joints]
    full = np.zeros((len(parameters), len(labels), len(part.names)))
    full[:, :, list(pivots)] = np.array(parameters)[:, labels % FOLDS]
    full[:, :, : len(part.record.mounted)] += part.record.mounted
    inverse = _inverse(mechanism, full.reshape(-1, len(part.names)))
    q, v = (np.tile(part.inside(x)[firsts], (len(parameters), 1)) for x in (part.motion.q, part.motion.v))
    with np.errstate(over="ignore", invalid="ignore"):
        found = simulate_forward(inverse, q, v, np.tile(torque, (len(parameters), 1, 1)), part.record.grid.step)
    away = found.reshape(len(parameters), len(labels), -1, joints) - part.inside(part.record.q)[place[:, ::2]]
    bounded = np.minimum(np.abs(np.nan_to_num(away, nan=np.pi)), np.pi)
    return np.asarray(np.sqrt(np.mean(bounded**2, axis=2)))


def _inverse(mechanism: Mechanism, parameters: Floats) -> InverseDynamics:
    """Torques of states, each of n with its own parameters (n, p), of which those of bodies and joints count."""
    counted = parameters[:, : len(mechanism.pi) + len(JOINT_TERMS) * len(mechanism.driven)]

    def torque(q: Floats, v: Floats, a: Floats) -> Floats:
        terms, _ = joint_friction_regressor(mechanism.driven, v, a)
        columns = np.concatenate([torque_regressor(mechanism, q, v, a), terms], axis=2)
        return np.einsum("njp,np->nj", columns, np.tile(counted, (len(q) // len(counted), 1)))

    return torque


@dataclass(frozen=True)
class MethodErrors:
    """One method's errors on held-out blocks."""

    method: Method
    torque: Floats
    """Part of each row as recorded that stays unexplained, (rows,)."""
    angles: SimulationError | None
    """None where nothing is simulated forward: loops, or no torques."""

    @property
    def torque_error(self) -> float:
        """Rms over the rows."""
        return float(np.sqrt(np.mean(self.torque**2)))

    def document(self, rows: Sequence[str], joints: tuple[str, ...]) -> Mapping[str, object]:
        """For the JSON document."""
        return {
            "method": self.method,
            "name": NAMES[self.method],
            "held_out_torque_rms_ratio": self.torque_error,
            "by_row": dict(zip(rows, self.torque.tolist(), strict=True)),
            "simulated_angle_error_rad": None
            if self.angles is None
            else {"all_rms": self.angles.whole} | dict(self.angles.document(joints)),
        }


def compare(choice: Choice, mechanism: Mechanism, identifiable: Identifiability) -> list[MethodErrors]:
    """All methods that the records allow, at the choice's cut-off and delay."""
    evidence, delay = choice.evidence, choice.chosen.delay
    held_out = choice.held_out
    methods = allowed(evidence)
    found = [held_out.parameters(delay, method) for method in methods]
    angles = _strayed(choice, mechanism, identifiable, found)
    rows = evidence.torque(delay)
    shares = [unexplained(rows, held_out.predict(one, held_out.columns), evidence.moving) for one in found]
    return [MethodErrors(*each) for each in zip(methods, shares, angles, strict=True)]


def _strayed(
    choice: Choice, mechanism: Mechanism, identifiable: Identifiability, found: Sequence[Floats]
) -> Sequence[SimulationError | None]:
    if not choice.evidence.parts[0].record.torque.shape[1]:
        return [None] * len(found)
    try:
        return simulation_errors(choice.evidence, mechanism, identifiable.pivots, found, choice.chosen.delay)
    except ModelError:
        return [None] * len(found)
