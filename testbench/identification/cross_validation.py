"""Which cut-off, and which delay between the torques and the positions; and how the methods compare: on held-out data.

The rule is fixed beforehand: of CUTOFFS_HZ and of delays up to LONGEST_DELAY_S either way, those with the least torque
error on blocks that were held out. The records are cut into BLOCKS equal blocks, each record into two at least, whose
offsets are known without either; parameters identified without every fifth block predict the torque **as recorded**
there. Too low a cut-off smears the motion, too high a one lets in noise of accelerations; both show there. No published
value has a part in it.

The methods are compared at that cut-off and delay, each block predicted without it, by two errors: of torque, as
recorded against the model along the recorded motion; and of angle, the block simulated forward, torque in, angles out,
against the recorded ones. Torque error favours least squares, which minimizes it; how far a simulation strays does not.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from balance.arrays import Floats, Indices
from balance.dynamics.forward_dynamics import refuse_loops, simulate_forward
from balance.dynamics.regressor import JOINT_TERMS, joint_friction_regressor, torque_regressor
from balance.errors import ModelError
from balance.estimation.base_parameters import BaseParameters
from balance.estimation.identifiability import RANK_LIMIT, Identifiability
from balance.mechanism.mechanism import Mechanism
from balance.results import Key

from ..errors import AnalysisError
from ..kinematics.gaps import gap_reach
from ..kinematics.smoothing_and_derivatives import ALMOST, DRY_PART, HIGHEST_CUTOFF
from .estimators import NAMES, Method, Methods, NotSimulated, allowed
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
"""Periods of the cut-off left out about what is held out, over which a low-pass would carry its torque."""
_REWEIGHTINGS = 5
"""Of rows in the choice of cut-off and delay."""
_EXACT = 1e-4
"""Residual of a row, as a part of its readings' rms, below which it earns no more weight."""
WINDOW_S = 1.0
"""Longest time that is simulated from a recorded state [s]."""
RULE = (
    f"least torque error of least squares, as recorded, on {BLOCKS} held-out blocks, of cut-offs "
    f"{CUTOFFS_HZ[0]:g} to {CUTOFFS_HZ[-1]:g} Hz and delays up to {LONGEST_DELAY_S * 1e3:g} ms"
)


@dataclass(frozen=True)
class Candidate:
    """A cut-off and a delay with their torque error on held-out blocks, as a part of the torque's rms."""

    cutoff: Annotated[float, Key("cutoff_Hz")]
    delay: Annotated[float, Key("delay_s")]
    error: Annotated[float, Key("rms_ratio")]


class CrossValidation:
    """Predictions for blocks from the rest of the records, at one cut-off."""

    def __init__(self, equations: RegressionEquations, mechanism: Mechanism, identifiable: Identifiability) -> None:
        from scipy.ndimage import maximum_filter1d

        self.equations, self.mechanism, self.identifiable = equations, mechanism, identifiable
        self.columns = identifiable.base_columns(equations.columns)
        self.smooth_columns = equations.low_passed_columns(identifiable.pivots)
        self.fold = equations.equal_parts(BLOCKS) % FOLDS
        guard = 2 * int(GUARD_PERIODS / equations.cutoff / equations.records[0].grid.step) + 1
        near = [maximum_filter1d((self.fold == k).astype(float), guard) for k in range(FOLDS)]
        self._training = [(1.0 - one)[:, None] for one in near]
        self._methods: dict[float, Methods] = {}

    def at(self, delay: float) -> Methods:
        """The methods at a delay [s]."""
        if delay not in self._methods:
            made = Methods(self.equations, self.mechanism, self.identifiable, delay, self.smooth_columns)
            self._methods[delay] = made
        return self._methods[delay]

    def parameters(self, delay: float, method: Method = "ls") -> Floats:
        """Base parameters identified without each fold, (FOLDS, r) [SI]."""
        return self.at(delay).held_out(method, self._training)

    def predict(self, parameters: Floats, columns: Floats) -> Floats:
        """Torque of every block, from the parameters that were identified without it, (n, joints) [N m, N]."""
        return np.einsum("njr,nr->nj", columns, parameters[self.fold])

    def errors(self, delays: Sequence[float], common: Floats) -> list[float]:
        """Of least squares at each delay, rms over the rows of the held-out torque error as a part of the torque's rms.

        ``common`` is one where samples count, (n, 1) [-]. All delays share the columns' sums, so that one costs little.
        """
        smooth, recorded = (
            np.stack([of(delay) for delay in delays], axis=2)
            for of in (self.equations.low_passed_torque, self.equations.torque)
        )
        used = self.equations.moving
        whole = _sums(self.smooth_columns, smooth, used)
        left, total = 0.0, 0.0
        for k, training in enumerate(self._training):
            lost, held = training[:, 0] == 0.0, self.fold == k
            part = _sums(self.smooth_columns[lost], smooth[lost], used[lost])
            values = _weighted_solution(*(every - some for every, some in zip(whole, part, strict=True)))
            counts = (used * common)[held]
            away = recorded[held] - np.einsum("njr,rc->njc", self.columns[held], values)
            left = left + np.einsum("nj,njc->jc", counts, away**2)
            total = total + np.einsum("nj,njc->jc", counts, recorded[held] ** 2)
        shares = left / np.maximum(total, np.finfo(float).tiny)
        return [float(error) for error in np.sqrt(np.mean(shares, axis=0))]


def _sums(columns: Floats, readings: Floats, used: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Normal equations of each row for several choices of readings: matrix, vector, squares, and samples that count.

    Of columns (n, rows, r) and readings (n, rows, choices), where they count (n, rows).
    """
    left = (columns * used[:, :, None]).transpose(1, 2, 0)
    matrix, vector = left @ columns.transpose(1, 0, 2), left @ readings.transpose(1, 0, 2)
    return matrix, vector, np.einsum("nj,njc->jc", used, readings**2), used.sum(axis=0)


def _weighted_solution(matrix: Floats, vector: Floats, square: Floats, samples: Floats) -> Floats:
    """Unknowns (r, choices) of each choice by least squares of ``_sums``, each row weighted by what it leaves."""
    left = square
    for _ in range(_REWEIGHTINGS if len(square) > 1 else 1):
        least = _EXACT**2 * np.maximum(square, np.finfo(float).tiny)
        weights = samples[:, None] / np.maximum(left, least)
        whole = np.einsum("jc,jrs->crs", weights, matrix)
        scale = np.sqrt(np.maximum(np.einsum("crr->cr", whole), np.finfo(float).tiny))
        right = np.einsum("jc,jrc->cr", weights, vector) / scale
        values = (np.einsum("crs,cs->cr", _inverse(whole / scale[:, :, None] / scale[:, None]), right) / scale).T
        made = square - 2.0 * np.einsum("jrc,rc->jc", vector, values)
        left = np.maximum(made + np.einsum("rc,jrs,sc->jc", values, matrix, values), 0.0)
    return np.asarray(values)


def _inverse(matrices: Floats) -> Floats:
    """Of symmetric matrices (choices, r, r); directions that are not excited, where there are any, are left out."""
    with suppress(np.linalg.LinAlgError):
        found = np.linalg.inv(matrices)
        if (np.linalg.norm(matrices, 1, (1, 2)) * np.linalg.norm(found, 1, (1, 2)) < RANK_LIMIT**-2).all():
            return np.asarray(found)
    return np.asarray(np.linalg.pinv(matrices, rcond=RANK_LIMIT**2, hermitian=True))


@dataclass(frozen=True)
class Choice:
    """The chosen candidate, the best one of each cut-off, and what the choice saw of the chosen one."""

    method: Method
    chosen: Candidate
    best_of_each: tuple[Candidate, ...]
    held_out: CrossValidation
    identified: BaseParameters
    """By the method, from all that was recorded."""
    predicted: Floats
    """Rows of each block as predicted without it, (n, rows) [N m, N]."""
    predicted_smooth: Floats
    """The same from low-passed columns, to compare with the low-passed torque."""

    @property
    def equations(self) -> RegressionEquations:
        """At the chosen cut-off."""
        return self.held_out.equations


def choose(
    records: Sequence[JointRecord],
    mechanism: Mechanism,
    identifiable: Identifiability,
    method: Method = "ls",
    done: Callable[[int], None] = lambda steps: None,
) -> Choice:
    """Apply the rule, by least squares whatever the method; ``done`` is told of each cut-off.

    The method is least squares too where the one asked for simulates no motion or does not determine all.
    Raises AnalysisError for records that are too short.
    """
    cutoffs = possible_cutoffs(records)
    reach = gap_reach(POSITION_BANDWIDTH * min(cutoffs))
    common = np.concatenate([r.valid(reach)[r.edge : r.grid.count - r.edge] for r in records])
    if not common.any():  # gaps at the lowest cut-off leave no instant to compare all by: each is compared by its own
        common = np.ones_like(common)
    found = []
    for cutoff in cutoffs:
        held_out = CrossValidation(regression_equations(records, mechanism, cutoff), mechanism, identifiable)
        tried = zip(delays(records), held_out.errors(delays(records), common), strict=True)
        best = min((Candidate(cutoff, *one) for one in tried), key=lambda candidate: candidate.error)
        found.append((best, held_out))
        done(1)
    chosen, held_out = min(found, key=lambda pair: pair[0].error)
    try:
        solved, parameters = held_out.at(chosen.delay).identified(method), held_out.parameters(chosen.delay, method)
    except NotSimulated:
        solved = None
    if solved is None or not solved.determines_all:
        method = "ls"
        solved, parameters = held_out.at(chosen.delay).identified(method), held_out.parameters(chosen.delay)
    predicted = (held_out.predict(parameters, held_out.columns), held_out.predict(parameters, held_out.smooth_columns))
    return Choice(method, chosen, tuple(candidate for candidate, _ in found), held_out, solved, *predicted)


def possible_cutoffs(records: Sequence[JointRecord]) -> list[float]:
    """The CUTOFFS_HZ for which the records are long enough and densely enough sampled.

    One that is exactly at the limit is left out: whether a rate allows it would depend on how its steps are rounded.
    """
    seconds = sum(record.grid.count * record.grid.step for record in records)
    rate = min(record.grid.rate for record in records)
    possible = [
        cutoff
        for cutoff in CUTOFFS_HZ
        if cutoff * seconds >= LEAST_PERIODS and 2 * POSITION_BANDWIDTH * cutoff < ALMOST * HIGHEST_CUTOFF * rate
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


def unexplained(torque: Floats, predicted: Floats, used: Floats) -> Floats:
    """Rms of torque less prediction, (n, joints) [N m, N] each, as a part of the torque's rms, (joints,) [-]."""
    residual = np.sum(used * (torque - predicted) ** 2, axis=0)
    return np.sqrt(residual / np.maximum(np.sum(used * torque**2, axis=0), np.finfo(float).tiny))


@dataclass(frozen=True)
class SimulationError:
    """How far simulated angles stray from recorded ones: medians, which one that topples over does not decide, and rms.

    In each window, of each joint [rad, m].
    """

    all_rms: Annotated[float, Key()]
    """Over windows and joints."""
    windows: Annotated[int, Key()]
    window_s: Annotated[float, Key()]
    median: Annotated[dict[str, float], Key()]
    rms: Annotated[dict[str, float], Key()]


def simulation_errors(
    equations: RegressionEquations,
    mechanism: Mechanism,
    parameters: Sequence[Floats],
    delay: float,
) -> list[SimulationError] | None:
    """Windows of all records, once for each of ``parameters``, (FOLDS, p) [SI] of the fold a window is in.

    A window is a held-out block, or its first WINDOW_S; it starts from the recorded state and is left to itself. Those
    that a gap touches are left out. None where there are no torques, for mechanisms with loops, and without a window.
    """
    if not equations.records[0].torque.shape[1]:
        return None
    try:
        refuse_loops(mechanism)
    except ModelError:
        return None
    block, step = equations.equal_parts(BLOCKS), equations.records[0].grid.step
    pairs = zip(equations.parts, equations.places, strict=True)
    windows = [_windows(part, mechanism, parameters, delay, block[own]) for part, own in pairs]
    errors = np.concatenate(windows, axis=1)
    if not errors.shape[1]:
        return None
    seconds = min(_length(int(n), step) for n in np.bincount(block)) * step
    found = []
    for rms in errors:
        each = (np.median(rms, axis=0), np.sqrt(np.mean(rms**2, axis=0)))
        by_joint = (dict(zip(mechanism.driven, values.tolist(), strict=True)) for values in each)
        found.append(SimulationError(float(np.sqrt(np.mean(rms**2))), len(rms), seconds, *by_joint))
    return found


def _length(samples: int, step: float) -> int:
    """An even number of steps that fit into so many samples."""
    return min(samples - 1, int(WINDOW_S / step)) // 2 * 2


def _windows(
    part: RecordEquations,
    mechanism: Mechanism,
    parameters: Sequence[Floats],
    delay: float,
    block: Indices,
) -> Floats:
    """How far each window of a record strays with each of the parameters, (sets, windows, joints)."""
    labels, firsts, sizes = np.unique(block, return_index=True, return_counts=True)
    place = firsts[:, None] + np.arange(_length(int(sizes.min()), part.record.grid.step) + 1)
    whole = part.inside(part.valid)[place, 0].all(axis=1)
    labels, firsts, place = labels[whole], firsts[whole], place[whole]
    joints = part.record.torque.shape[1]
    torque = part.inside(part.delayed(part.record.measured, delay))[place][:, :, :joints]
    full = part.with_own_offsets(np.array(parameters)[:, labels % FOLDS])
    full[:, :, : len(part.record.mounted)] += part.record.mounted
    used = full.reshape(-1, len(part.names))[:, : len(mechanism.pi) + len(JOINT_TERMS) * len(mechanism.driven)]

    laws = [part.names.index(law.name) for law in part.record.laws]
    known = np.einsum("wnjl,swl->swnj", part.inside(part.whole)[place][:, :, :joints, laws], full[:, :, laws])
    torque = (torque - known).reshape(-1, *torque.shape[1:])

    def inverse(q: Floats, v: Floats, a: Floats) -> Floats:
        """Torques (k n, nv) of k n states, each of n with its own parameters."""
        terms, _ = joint_friction_regressor(mechanism.driven, v, a, DRY_PART * part.rest)
        columns = np.concatenate([torque_regressor(mechanism, q, v, a), terms], axis=2)
        return np.einsum("njp,np->nj", columns, np.tile(used, (len(q) // len(used), 1)))

    q, v = (np.tile(part.inside(x)[firsts], (len(parameters), 1)) for x in (part.motion.q, part.motion.v))
    with np.errstate(over="ignore", invalid="ignore"):
        found = simulate_forward(inverse, q, v, torque, part.record.grid.step)
    away = found.reshape(len(parameters), len(labels), -1, joints) - part.inside(part.record.q)[place[:, ::2]]
    bounded = np.minimum(np.abs(np.nan_to_num(away, nan=np.pi)), np.pi)
    return np.asarray(np.sqrt(np.mean(bounded**2, axis=2)))


@dataclass(frozen=True)
class MethodErrors:
    """One method's errors on held-out blocks."""

    method: Annotated[Method, Key()]
    name: Annotated[str, Key()]
    torque_error: Annotated[float, Key("held_out_torque_rms_ratio")]
    """Part of the rows as recorded that stays unexplained, rms over the rows."""
    by_row: Annotated[dict[str, float], Key()]
    """The same of each row."""
    angles: Annotated[SimulationError | None, Key("simulated_angle_error_rad")]
    """None where nothing is simulated forward: loops, or no torques."""


def compare(choice: Choice, mechanism: Mechanism, identifiable: Identifiability) -> list[MethodErrors]:
    """All methods that the records allow, at the choice's cut-off and delay."""
    equations, delay, held_out = choice.equations, choice.chosen.delay, choice.held_out
    found: dict[Method, Floats] = {}
    for method in allowed(equations):
        with suppress(NotSimulated):
            found[method] = held_out.parameters(delay, method)
    full = [identifiable.over_all(parameters) for parameters in found.values()]
    strayed = simulation_errors(equations, mechanism, full, delay)
    rows, names = equations.torque(delay), equations.records[0].rows(mechanism)
    errors = []
    for k, (method, parameters) in enumerate(found.items()):
        shares = unexplained(rows, held_out.predict(parameters, held_out.columns), equations.moving)
        by_row = dict(zip(names, shares.tolist(), strict=True))
        angles = None if strayed is None else strayed[k]
        errors.append(MethodErrors(method, NAMES[method], float(np.sqrt(np.mean(shares**2))), by_row, angles))
    return errors
