"""The estimator of each source: its equations, its least squares, and what its interval contains besides noise."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from balance.arrays import Floats
from balance.estimation.first_moment_imbalance import (
    Imbalance,
    ImbalanceFit,
    Subspace,
    imbalance_fit,
    with_condition_values,
)

from ..errors import AnalysisError
from ..kinematics.base_motion import BaseAcceleration
from ..kinematics.gaps import GAP_FINDING
from ..loads.base_motion_in_torque import known_base, moves_on_base
from ..recording import Finding
from ..rig import Column
from ..rig.sensors import Torque
from ..runs.aligned_run import AlignedRun
from . import sensor_errors
from .base_coupling import BaseCoupling
from .load_regression import (
    CUTOFF_HZ,
    TORQUE_CUTOFF_HZ,
    force_regression,
    torque_channels,
    torque_regression,
)
from .problem import (
    FILE_KNOWN,
    MASS,
    SOURCES,
    NoValidMotion,
    RunEquations,
    Source,
    SourceEstimate,
    TrimProblem,
    parameter_basis,
    shared_unknowns,
    with_shared_unknowns,
)
from .trial_mass_runs import CUTOFF_HZ as TRIALS_CUTOFF_HZ
from .trial_mass_runs import trial_mass_runs_imbalance, without_gaps
from .vibration_regression import (
    ShakenBase,
    shaken_base,
    step_covariance,
    step_readings,
    vibration_regression,
)

T = TypeVar("T")

BASE_UNKNOWN = (
    "no accelerometer on the base: if the base moves, the forces hold the mechanism's inertia against that motion, "
    "which is taken for shaking force, and the intervals do not hold; record one (in the rig an accelerometer "
    'attached_to = "base"), or state that it does not move ([bench] fixed = true)'
)
AXIS_UNKNOWN = (
    "the accelerometers on the base leave out {}, along which the mechanism shakes: how the base moves along it is not "
    "known, so that forces along it tell next to nothing; record it (in the rig a channel {} of an accelerometer "
    'attached_to = "base")'
)
WEIGHTLESS = (
    "the rig's [bench] does not state weight = true: the weight's moment as the bodies move, which tilts the base, is "
    "left out"
)
FILE_MASS = 0.05
"""Standard deviation of the mass that the file gives to the bodies together, payload and counter-masses apart [-]. On a
base that moves, forces hold it, and one that is not known is like a common error of the forces' sensitivity."""
FIXED = "What no mass at the sites can change is taken from the mechanism's file: these runs do not tell it."
FIXED_WITHIN = f"{FIXED} Intervals contain errors of it of up to {FILE_KNOWN:.0%} of the largest first moment."
UNSTATED = (
    "the rig states no resolution of the encoders {}: whether their steps leave what is unexplained is not known, and "
    'no interval contains it; state it, such as resolution = "0.04 deg"'
)
STEPS = "what the encoders' resolution leaves open"
SECOND_ORDER = "all that is of second order in the base's motion (rectangular)"
_ROUNDS, _SETTLED = 10, 0.05
"""Rounds at most about the values found, and by how much of a standard deviation these still change when settled."""
_Round = tuple[list[RunEquations], "_Equations", ImbalanceFit]
"""Equations run by run, those of all, and their fit."""
_LEAST_FREEDOM = 12.0
"""Of the rests of all runs, from which they tell the noise: to a fifth."""


class _Equations:
    """The records of a source, what the rigs state of its sensors' errors among the unknowns."""

    def __init__(self, problem: TrimProblem, runs: Sequence[RunEquations]) -> None:
        """Noise below a cut-off lasts half of its period: so many samples a prior counts for."""
        of_mass = {MASS: FILE_MASS * problem.mechanism.total_mass / problem.mounted.total_mass}
        deviations = [sensor_errors.stated_deviations(run.run) | of_mass for run in problem.runs]
        effects = [run.effects for run in runs]
        self.problem = problem
        self.records, self.entries = sensor_errors.with_error_columns(
            [run.record for run in runs], effects, deviations, [run.explained for run in runs]
        )
        others = self.records[0].columns.shape[2] - problem.conditions.rank - len(self.entries)
        self.prior = np.r_[np.zeros(others), np.full(len(self.entries), 0.5 * np.mean([run.period for run in runs]))]

    @classmethod
    def channel_by_channel(
        cls, problem: TrimProblem, runs: Sequence[RunEquations], columns: Sequence[Sequence[Column]], shared: Floats
    ) -> "_Equations":
        """Of rows that are channels, exposed to what explains them without errors; ``shared`` (p, k) as excited."""
        records = with_shared_unknowns([run.record for run in runs], problem.conditions.rank, shared)
        runs = [replace(run, record=record) for run, record in zip(runs, records, strict=True)]
        deviations = [sensor_errors.stated_deviations(run.run) for run in problem.runs]
        if any(deviations):
            explained = imbalance_fit(records, problem.conditions).regression.explained()
            effects = map(sensor_errors.reading_effects, explained, columns, deviations)
            runs = [replace(run, effects={**run.effects, **own}) for run, own in zip(runs, effects, strict=True)]
        return cls(problem, runs)

    @classmethod
    def of_forces(cls, problem: TrimProblem, runs: Sequence[RunEquations]) -> "_Equations":
        """Of rows that are sums over the supports, whose sensors are exposed to what they show less what is left."""
        first = cls(problem, runs)
        if first.entries in ([], [MASS]):
            return first
        left = first.fit().regression.residual()
        supports = problem.runs[0].rig.supports
        exposed = [
            replace(r, effects=sensor_errors.without_residual(r, own, supports))
            for r, own in zip(runs, left, strict=True)
        ]
        return cls(problem, exposed)

    def fit(self, free: Subspace | None = None) -> ImbalanceFit:
        """Values of the conditions."""
        return imbalance_fit(self.records, self.problem.conditions, free, self.prior)

    def fit_all_or_at_sites(self) -> tuple[ImbalanceFit, tuple[str, ...]]:
        """All conditions where the records determine them; else those that they tell better than the file, and what
        masses at the sites can change.
        """
        problem = self.problem
        if problem.free is not None:
            found = self.fit(None if problem.free.is_whole else problem.free)
            return found, () if problem.free.is_whole else (FIXED_WITHIN,)
        whole, at_sites = self.fit(), problem.at_sites
        wider = problem.free_directions(whole.imbalance, whole.imbalance.estimate)
        found = whole if wider.is_whole else self.fit(wider)
        of_moments = at_sites.directions * [unit != "kg" for unit in problem.conditions.units]
        own = [found.imbalance.coordinates(row, len(found.regression.values)) for row in of_moments]
        if not all(map(found.regression.determines, own)):
            wider, found = at_sites, self.fit(at_sites)
        return found, () if wider.is_whole else (FIXED_WITHIN,)

    def _by_file(self, found: ImbalanceFit) -> Floats:
        """Of the conditions' values, (rank, rank) [kg m], by what the file may be wrong by in what is fixed: in first
        moments of bodies, alike and along all axes, so that what one body lacks is wrong by FILE_KNOWN at most.
        """
        space, conditions = found.imbalance.subspace, self.problem.conditions
        every, largest = np.eye(conditions.rank), self.problem.largest
        pairs = zip(found.gains(), self.records, strict=True)
        followed = np.sum([np.einsum("nrk,nrj->kj", g, r.columns[:, :, : len(every)]) for g, r in pairs], axis=0)
        per_fixed = (every - followed) @ (every - space.directions.T @ space.directions)
        moments = conditions.matrix.reshape(len(every), -1, 10)[:, :, 1:4].reshape(len(every), -1)
        moments /= max(np.linalg.norm(conditions.lacking @ moments, 2, axis=(1, 2)).max(), 1e-300)
        of_masses = np.diag([unit != "kg m" for unit in conditions.units])
        errors = np.hstack([moments, of_masses]) * largest[:, None] * (FILE_KNOWN / 3.0**0.5)
        return np.asarray(per_fixed @ np.transpose(np.linalg.qr(errors.T, mode="r")))

    def widened(self, found: ImbalanceFit) -> tuple[Imbalance, list[str]]:
        """With what the errors leave open, and what that is called."""
        covariance, by_file, within = found.imbalance.covariance, None, []
        if not found.imbalance.subspace.is_whole:
            by_file = self._by_file(found)
            covariance = covariance + by_file @ by_file.T
            largest = self.problem.conditions.residual("kg m", self.problem.mechanism)
            within.append(f"up to {FILE_KNOWN * largest:.2g} kg m in what the file tells")
        if self.entries:
            covariance = covariance + sensor_errors.error_covariance(found, self.records, len(self.entries))
            if names := ", ".join(dict.fromkeys(entry[0] for entry in self.entries if entry != MASS)):
                within.append(f"the errors of calibration and cross-talk that rig and calibration state of {names}")
            if MASS in self.entries:
                within.append(f"what the file's masses may be wrong by, {FILE_MASS:.0%} (standard deviation)")
        return replace(found.imbalance, covariance=covariance, by_file=by_file), within


def by_wrench(problem: TrimProblem) -> SourceEstimate:
    """By force sensors."""
    if below := problem.runs[0].rig.under_base:
        raise AnalysisError(f"{problem.names}: {below}")
    cutoff = problem.cutoff or CUTOFF_HZ
    every, problem, findings = _each(
        problem, AnalysisError, lambda run: force_regression(run, problem.conditions, cutoff)
    )
    findings += [f for one in every for f in one.findings]

    def fitted(every: list[RunEquations]) -> _Round:
        equations = _Equations.of_forces(problem, every)
        return every, equations, equations.fit()

    def about(values: Floats) -> _Round:
        return fitted([force_regression(run, problem.conditions, cutoff, values) for run in problem.runs])

    last = fitted(every)
    every, equations, found = _settled(last, about) if any(one.about_values for one in every) else last
    measured, within = equations.widened(found)
    base = _base_text([run.base for run in problem.runs])
    how = f"Forces and model low-passed alike at {cutoff:g} Hz, clocks of the loggers aligned, {base}"
    doubts = [] if all(run.base is not None or run.rig.bench.fixed for run in problem.runs) else [BASE_UNKNOWN]
    shaken = {str(row)[1] for one in every for row in one.record.rows}
    shown = [{column.component for column in run.base.columns} for run in problem.runs if run.base is not None]
    if left_out := " and ".join(sorted(axis for axis in shaken if any(axis not in one for one in shown))):
        doubts.append(AXIS_UNKNOWN.format(left_out, left_out))
    return SourceEstimate(
        "wrench", measured, (how, _jackknife(measured, within)), tuple(doubts), tuple(findings), problem.runs,
        over_rest=_over_rest(measured, every),
    )  # fmt: skip


def _settled(last: _Round, about: Callable[[Floats], _Round]) -> _Round:
    """Equations ``about`` the values that they give; what the last round changed is in the covariance."""
    for _ in range(_ROUNDS):
        before, last = last[2].imbalance.values, about(last[2].imbalance.values)
        found = last[2].imbalance
        change = found.values - before
        if (np.abs(change) <= _SETTLED * np.sqrt(np.diag(found.covariance))).all():
            break
    whole = replace(found, covariance=found.covariance + np.outer(change, change))
    return last[0], last[1], replace(last[2], imbalance=whole)


def _base_text(bases: Sequence[BaseAcceleration | None]) -> str:
    """What of the base's motion was done with each run."""
    if all(base is None for base in bases):
        return "the base taken for still."
    return f"the base's motion taken out{' of the runs that show it' * (None in bases)}."


def _over_rest(measured: Imbalance, every: Sequence[RunEquations]) -> float:
    """Largest residual of a row over what it shows in the rests of all runs; infinite where those tell too little."""
    squares, freedom = defaultdict[str, float](float), defaultdict[str, float](float)
    for one in every:
        for row, square in zip(one.record.rows, () if one.at_rest is None else one.at_rest, strict=False):
            squares[str(row)] += float(square)
            freedom[str(row)] += one.freedom_at_rest
    left = {} if measured.regression is None else measured.regression.residual_rms
    if not left or any(freedom[row] < _LEAST_FREEDOM for row in left):
        return np.inf
    return max(left[row] / max(squares[row] / freedom[row], 1e-300) ** 0.5 for row in left)


def by_torque(problem: TrimProblem) -> SourceEstimate:
    """By motor torques."""
    cutoff = problem.cutoff or TORQUE_CUTOFF_HZ
    parts, problem, findings = _each(
        problem, NoValidMotion, lambda run: torque_regression(run, problem.conditions, cutoff)
    )
    findings += [f for part in parts for f in part.findings]
    columns = [torque_channels(run) for run in problem.runs]
    shared = shared_unknowns([part.record for part in parts], problem.conditions.rank)
    equations = _Equations.channel_by_channel(problem, parts, columns, shared)
    found, fixed = equations.fit_all_or_at_sites()
    measured, within = equations.widened(found)
    about = (
        f"Motor torques and model low-passed alike at {cutoff:g} Hz; inertias, friction, offsets, drifts and delays "
        f"estimated with the conditions, {_base_text([known_base(run) for run in problem.runs])}"
    )
    text = (about, *fixed, _jackknife(measured, within))
    return SourceEstimate("torque", measured, text, (), tuple(findings), problem.runs)


def by_vibration(problem: TrimProblem) -> SourceEstimate:
    """By the vibration of the base that the rig states."""
    cutoff = problem.cutoff or CUTOFF_HZ
    bases, problem, findings = _each(problem, NoValidMotion, lambda run: shaken_base(run, cutoff))
    findings += [f for one in bases for f in one.valid.findings]
    parts = [vibration_regression(one, problem.conditions) for one in bases]
    combinations = shared_unknowns([part.record for part in parts], problem.conditions.rank)
    columns = [list(one.sensors.columns) for one in bases]
    equations = _Equations.channel_by_channel(problem, parts, columns, combinations)
    found, fixed = equations.fit_all_or_at_sites()
    second = [np.zeros_like(part.record.readings) for part in parts]
    moving = [(i, bases[i], run) for i, run in enumerate(problem.runs) if moves_on_base(run)]
    free = found.imbalance.subspace if fixed else None

    def about(values: Floats) -> _Round:
        corrected = list(parts)
        for i, base, run in moving:
            coupling = BaseCoupling.of(base, run, with_condition_values(problem.conditions, run.mechanism, values))
            added, second[i] = coupling.readings()
            per_mass = (coupling.with_heavier_joints(problem.conditions, FILE_MASS).readings()[0] - added) / FILE_MASS
            record = replace(parts[i].record, readings=parts[i].record.readings - added)
            corrected[i] = replace(parts[i], record=record, effects={MASS: per_mass})
        own = _Equations.channel_by_channel(problem, corrected, columns, combinations)
        return corrected, own, own.fit(free)

    if moving:
        _, equations, found = _settled((parts, equations, found), about)
    measured, within = equations.widened(found)
    shared = combinations @ found.shared[: combinations.shape[1]]
    pi, gains = parameter_basis(problem.conditions) @ np.concatenate([measured.values, shared]), found.gains()
    # Wider by what the encoders' steps do to the columns, and by what is of second order in the base's motion.
    each = zip(bases, problem.runs, gains, strict=True)
    steps = np.sum([step_covariance(base, run.encoders, gain, pi) for base, run, gain in each], axis=0)
    shift = np.sum([np.einsum("nrk,nr->k", *pair) for pair in zip(gains, second, strict=True)], axis=0)
    measured = replace(measured, covariance=measured.covariance + steps + np.outer(shift, shift) / 3.0)
    within += [SECOND_ORDER] * bool(moving)
    how = (
        "The base's mass, centre, inertia and mounts are those that the rig states: a model that is assumed, whose "
        "errors the intervals do not contain.",
        f"Readings and the base's response low-passed alike at {cutoff:g} Hz; inertias of the mechanism estimated with "
        "the conditions.",
    )
    by_steps = _share_of_steps(bases, problem, found, pi)
    doubts = []
    if by_steps == 0.0 and found.regression.unexplained > SOURCES["vibration"].doubtful_share:
        names = ", ".join(column.sensor for column in problem.runs[0].encoders)
        doubts += [UNSTATED.format(names)] * (not any(column.total_noise for column in problem.runs[0].encoders))
    if any(run.run.origin != "simulated" and not run.rig.bench.weight for run in problem.runs):
        doubts.append(WEIGHTLESS)
    text = (*how, *fixed, _jackknife(measured, [*within, STEPS]))
    runs, rest = problem.runs, _over_rest(measured, parts)
    return SourceEstimate("vibration", measured, text, tuple(doubts), tuple(findings), runs, by_steps, rest, steps)


def _share_of_steps(bases: Sequence[ShakenBase], problem: TrimProblem, found: ImbalanceFit, pi: Floats) -> float:
    """Share of what was measured that the encoders' steps and noise may leave; zero where little is unexplained."""
    regression = found.regression
    if regression.unexplained <= SOURCES["vibration"].doubtful_share:
        return 0.0
    shown = np.concatenate([step_readings(b, r.encoders, pi) for b, r in zip(bases, problem.runs, strict=True)])
    left = sum(rms**2 for rms in regression.residual_rms.values())
    return regression.unexplained * float(np.sqrt((shown**2).mean(axis=0).sum() / max(left, 1e-300)))


def by_trials(problem: TrimProblem) -> SourceEstimate:
    """By the vibration of a base of which nothing is known, in runs with trial masses."""
    cutoff = problem.cutoff or TRIALS_CUTOFF_HZ
    whole, findings = without_gaps(problem)
    measured = trial_mass_runs_imbalance(whole, problem.mounted, cutoff)
    about = (
        f"The base's response below {cutoff:g} Hz is measured by the trial masses, linear and the same in all runs; "
        f"what is missing is said of the mounting of {problem.runs[0].run.name}.",
        f"{FIXED} Its errors are in no interval.",
        f"Intervals: from what the fit leaves, {measured.degrees_of_freedom:.3g} degrees of freedom, and from what two "
        "lengths of the base's memory differ by.",
    )
    return SourceEstimate("trials", measured, about, (), findings)


ESTIMATORS: dict[Source, Callable[[TrimProblem], SourceEstimate]] = {
    "wrench": by_wrench, "torque": by_torque, "vibration": by_vibration, "trials": by_trials,
}  # fmt: skip
"""By source; each raises AnalysisError, DataError or NotIdentifiable, saying why, where the runs cannot tell."""


def present_sources(problem: TrimProblem, one_mounting: bool) -> list[Source]:
    """The sources that the rig has for these runs; the base's vibration counts where there is nothing better."""
    rig = problem.runs[0].run.rig
    if not one_mounting:
        return ["trials"]
    driven = {column.component for column in rig.columns_of(Torque)}
    found: list[Source] = ["wrench"] if rig.supports else []
    if driven and driven >= set(problem.mounted.driven):
        found.append("torque")
    if found == ["wrench"] and rig.under_base:
        return [*found, *further_sources(problem, found)]
    return found or further_sources(problem, found)


def further_sources(problem: TrimProblem, tried: Sequence[Source]) -> list[Source]:
    """The base's vibration, where the rig has it, for what torques, where these were ``tried``, cannot tell.

    Forces show what shakes the base, as vibration does: where they cannot tell, a motion lacks.
    """
    rig = problem.runs[0].run.rig
    shown = bool(rig.base_accelerometers) and rig.bench.is_stated
    return ["vibration"] if shown and set(tried) <= {"torque"} else []


def _each(
    problem: TrimProblem, left_out_by: type[AnalysisError], made: Callable[[AlignedRun], T]
) -> tuple[list[T], TrimProblem, list[Finding]]:
    """What is ``made`` of each run, the problem of those runs, and a finding for each that is left out by an error."""
    every: list[T] = []
    kept: list[AlignedRun] = []
    findings: list[Finding] = []
    for run in problem.runs:
        try:
            every.append(made(run))
            kept.append(run)
        except left_out_by as error:
            if len(problem.runs) == 1:
                raise
            code = GAP_FINDING if isinstance(error, NoValidMotion) else "not_analyzed"
            findings.append(Finding(code, None, run.name, f"left out: {error}"))
    if not every:
        raise AnalysisError("no run can tell:\n" + "\n".join(f"  {f.message}" for f in findings))
    return every, replace(problem, runs=kept), findings


def _jackknife(measured: Imbalance, within: Sequence[str]) -> str:
    text = f"Intervals: delete-block jackknife, {measured.degrees_of_freedom:.3g} degrees of freedom"
    return f"{text}; in them {' and '.join(within)}." if within else f"{text}."
