"""How each source is asked: its equations, its least squares, and what its interval holds beside noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from balance.arrays import Floats
from balance.estimation.first_moment_imbalance import Imbalance, ImbalanceFit, Subspace, imbalance_fit
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.regression import RegressionRecord

from ..errors import AnalysisError
from ..findings import Finding
from ..motion.gaps import CODE as GAP
from ..runs.aligned_run import AlignedRun
from . import calibration
from .case import Case, Told
from .evidence import CUTOFF_HZ, run_evidence
from .parts import records, shared
from .sound import NothingLeft
from .steps import step_covariance
from .torque import CUTOFF_HZ as TORQUE_CUTOFF_HZ
from .torque import torque_channels, torque_part
from .trials import CUTOFF_HZ as TRIALS_CUTOFF_HZ
from .trials import trials_imbalance, without_gaps
from .vibration import Shaken, basis_of, part_of, shaken

if TYPE_CHECKING:
    from ..rig import Column

T = TypeVar("T")

BASE_UNKNOWN = (
    "no accelerometer on the base: if the base moves, the forces hold the mechanism's inertia against that motion, "
    "which is taken for shaking force, and the intervals do not hold"
)
HELD = "What no mass at the sites can change is taken from the mechanism's file: these runs do not tell it."
TELLS = 0.02
"""Half of an interval of a condition, as a part of the largest of the mechanism without counter-masses, up to which a
source tells it; else the file's value is taken where no mass at the sites changes it."""


STEPS = "what the encoders' resolution leaves open"


@dataclass(frozen=True)
class _Asked:
    """The records of a source, what the rigs state of its sensors' errors fitted beside."""

    records: list[RegressionRecord]
    entries: list[calibration.Entry]
    """Of the sensitivities, the last columns of the records."""
    prior: Floats

    @classmethod
    def of(
        cls, case: Case, records: list[RegressionRecord], effects: Sequence[calibration.Effects], period: float
    ) -> "_Asked":
        """``period`` is that of the cut-off [samples]: noise below it lasts half of that."""
        joined, entries = calibration.with_errors(records, effects, calibration.stated(run.rig for run in case.runs))
        beside = joined[0].columns.shape[2] - case.conditions.rank - len(entries)
        return cls(joined, entries, np.r_[np.zeros(beside), np.full(len(entries), 0.5 * period)])

    @classmethod
    def channel_by_channel(
        cls, case: Case, records: list[RegressionRecord], columns: "Sequence[Sequence[Column]]", period: float
    ) -> "_Asked":
        """Of records whose rows are channels: these are exposed to what explains them without errors."""
        deviations = calibration.stated(run.rig for run in case.runs)
        if not deviations:
            return cls.of(case, records, [{}] * len(records), period)
        explained = imbalance_fit(records, case.conditions).regression.explained()
        effects = [calibration.of_readings(e, c, deviations) for e, c in zip(explained, columns, strict=True)]
        return cls.of(case, records, effects, period)

    def fit(self, case: Case, free: Subspace | None = None) -> ImbalanceFit:
        """Values of the conditions."""
        return imbalance_fit(self.records, case.conditions, free, self.prior)

    def widened(self, found: ImbalanceFit) -> tuple[Imbalance, list[str]]:
        """With what the errors leave open, and what that is called."""
        if not self.entries:
            return found.imbalance, []
        more = calibration.covariance(found, self.records, len(self.entries))
        names = ", ".join(dict.fromkeys(name for name, *_ in self.entries))
        return (
            replace(found.imbalance, covariance=found.imbalance.covariance + more),
            [f"the errors of calibration and cross-talk that the rig states of {names}"],
        )


def by_wrench(case: Case) -> Told:
    """By force sensors."""
    cutoff = case.cutoff or CUTOFF_HZ
    every, case, findings = _each(
        case,
        AnalysisError,
        lambda run: run_evidence(run, case.conditions, cutoff),
    )
    findings += [f for one in every for f in one.findings if f.code == GAP]
    asked = _Asked.of(case, [one.record for one in every], [one.effects for one in every], every[0].period)
    measured, within = asked.widened(asked.fit(case))
    base = "the base's motion taken out." if every[0].base_known else "the base taken for still."
    about = (f"Forces and model low-passed alike at {cutoff:g} Hz, clocks of the loggers aligned, {base}",)
    doubts = () if all(one.base_known for one in every) else (BASE_UNKNOWN,)
    return Told("wrench", measured, (*about, _jackknife(measured, within)), doubts, tuple(findings))


def by_torque(case: Case) -> Told:
    """By motor torques."""
    cutoff = case.cutoff or TORQUE_CUTOFF_HZ
    parts, case, findings = _each(
        case,
        NothingLeft,
        lambda run: torque_part(run, case.conditions, cutoff),
    )
    findings += [f for part in parts for f in part.findings]
    columns = [torque_channels(run.run, case.mounted) for run in case.runs]
    asked = _Asked.channel_by_channel(case, records(parts), columns, parts[0].shortest)
    found, held = _free_or_held(asked, case)
    measured, within = asked.widened(found)
    about = (
        f"Motor torques and model low-passed alike at {cutoff:g} Hz; inertias, friction, offsets and delays fitted "
        "beside, the base taken for still.",
    )
    return Told("torque", measured, (*about, *held, _jackknife(measured, within)), (), tuple(findings))


def by_vibration(case: Case) -> Told:
    """By the vibration of the base that the rig states."""
    cutoff = case.cutoff or CUTOFF_HZ
    runs, case, findings = _each(case, NothingLeft, lambda run: shaken(run, cutoff))
    findings += [f for run in runs for f in run.sound.findings]
    parts = [part_of(run, case.conditions) for run in runs]
    combinations = shared(parts)
    columns = [list(run.sensors.columns) for run in runs]
    asked = _Asked.channel_by_channel(case, records(parts, combinations), columns, parts[0].shortest)
    found, held = _free_or_held(asked, case)
    measured, within = asked.widened(found)
    measured = _with_encoder_steps(measured, found, case, runs, combinations)
    about = (
        "The base's mass, centre, inertia and mounts are those that the rig states: a model that is assumed, whose "
        "errors the intervals do not contain.",
        f"Readings and the base's response low-passed alike at {cutoff:g} Hz; inertias of the mechanism fitted beside.",
    )
    said = (*about, *held, _jackknife(measured, [*within, STEPS]))
    return Told("vibration", measured, said, (), tuple(findings))


def by_trials(case: Case) -> Told:
    """By the vibration of a base of which nothing is known, in runs with trial masses."""
    cutoff = case.cutoff or TRIALS_CUTOFF_HZ
    whole, findings = without_gaps(case)
    measured = trials_imbalance(whole, case.mounted, cutoff)
    about = (
        f"The base's response below {cutoff:g} Hz is measured by the trial masses, linear and the same in all runs; "
        f"what is missing is said of the mounting of {case.runs[0].name}.",
        HELD,
        f"Intervals: from what the fit leaves, {measured.degrees_of_freedom:.3g} degrees of freedom, and from what two "
        "lengths of the base's memory differ by.",
    )
    return Told("trials", measured, about, (), findings)


def _each(
    case: Case, leaving: type[AnalysisError], made: Callable[[AlignedRun], T]
) -> tuple[list[T], Case, list[Finding]]:
    """What is ``made`` of each run, the case of those runs, and a finding for each that is left out by an error."""
    every: list[T] = []
    kept: list[AlignedRun] = []
    findings: list[Finding] = []
    for run in case.runs:
        try:
            every.append(made(run))
            kept.append(run)
        except leaving as error:
            if len(case.runs) == 1:
                raise
            code = GAP if isinstance(error, NothingLeft) else "not_aligned"
            findings.append(Finding(code, None, run.name, f"left out: {error}"))
    if not every:
        raise AnalysisError("no run can tell:\n" + "\n".join(f"  {f.message}" for f in findings))
    return every, replace(case, runs=kept), findings


def _with_encoder_steps(
    measured: Imbalance, found: ImbalanceFit, case: Case, runs: "Sequence[Shaken]", combinations: Floats
) -> Imbalance:
    """Wider by what the encoders' steps do to the columns."""
    rank, basis = case.conditions.rank, basis_of(case.conditions)
    pi = basis[:, :rank] @ measured.values + basis[:, rank:] @ (combinations @ found.shared[: combinations.shape[1]])
    steps = [
        step_covariance(run, of.encoders, gain, pi)
        for run, of, gain in zip(runs, case.runs, found.gains(), strict=True)
    ]
    return replace(measured, covariance=measured.covariance + np.sum(steps, axis=0))


def _free_or_held(asked: _Asked, case: Case) -> tuple[ImbalanceFit, tuple[str, ...]]:
    """All conditions where the records tell them, else those that masses at the sites can change."""
    whole = asked.fit(case)
    measured = whole.imbalance
    most = TELLS * float(np.abs(case.conditions.values(case.mechanism)).max(initial=0.0))
    try:
        widths = [measured.estimate(row).half_width() for row in np.eye(case.conditions.rank)]
    except NotIdentifiable:
        widths = [np.inf]
    if max(widths) <= most:
        return whole, ()
    free = Subspace.at_sites(case.conditions, case.mounted, case.sites)
    if free.is_whole:
        return whole, ()
    return asked.fit(case, free), (HELD,)


def _jackknife(measured: Imbalance, within: Sequence[str] = ()) -> str:
    said = f"Intervals: delete-block jackknife, {measured.degrees_of_freedom:.3g} degrees of freedom"
    return f"{said}; in them {' and '.join(within)}." if within else f"{said}."
