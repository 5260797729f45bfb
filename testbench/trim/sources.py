"""What tells what is missing: force sensors, motor torques, vibration of the base, alone or by trial masses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from balance import trim
from balance.conditions import Conditions
from balance.mechanism import Mechanism
from balance.observability import NotObservable

from ..errors import AnalysisError
from ..findings import Finding
from ..joint_motion import loaded
from ..rig.sensors import Torque
from .evidence import CUTOFF_HZ, RunEvidence, run_evidence
from .torque import CUTOFF_HZ as TORQUE_CUTOFF_HZ
from .torque import torque_records
from .trials import CUTOFF_HZ as TRIALS_CUTOFF_HZ
from .trials import trials_imbalance
from .vibration import states_base, vibration_records

if TYPE_CHECKING:
    from ..clocks.mapping import ClockMap
    from ..rig import Rig
    from ..store import Run

Source = Literal["wrench", "torque", "vibration", "trials"]
NAMES: dict[Source, str] = {
    "wrench": "force sensors",
    "torque": "motor torques",
    "vibration": "vibration of the base, by the base that the rig states",
    "trials": "vibration of the base, by trial masses",
}
BASE_UNKNOWN = (
    "no accelerometer on the base: if the base moves, the forces hold the mechanism's inertia against that motion, "
    "which is taken for shaking force, and the intervals do not hold"
)
MORE_RUNS = (
    "add runs in another direction (the triangle), with more acceleration, or a second accelerometer on the base"
)
LONGER = "give longer runs that move more, or runs of several motions (x, y, triangle)"
HELD = "What no mass at the sites can change is taken from the mechanism's file: these runs do not tell it."
STEP_DRAWS = 10
"""Of the encoders' steps, for what they add to an interval."""
TELLS = 0.02
"""Half of an interval of a condition, as a part of the largest of the mechanism without counter-masses, up to which a
source tells it; else the file's value is taken where no mass at the sites changes it."""


@dataclass(frozen=True)
class Case:
    """What is asked."""

    runs: "Sequence[Run]"
    rigs: "Sequence[Rig]"
    mechanism: Mechanism
    """Without payload and counter-masses."""
    conditions: Conditions
    """Of the mechanism as mounted in the first run."""
    sites: Sequence[str]
    cutoff: float | None
    """Highest frequency [Hz]; None: as is best for the source."""
    clocks: "Mapping[Path, Mapping[str, ClockMap]]"

    @property
    def mounted(self) -> Mechanism:
        """As mounted in the first run."""
        return loaded(self.runs[0], self.mechanism)

    @property
    def names(self) -> str:
        """Of the runs."""
        return ", ".join(run.name for run in self.runs)


@dataclass(frozen=True)
class Told:
    """What one source tells."""

    source: Source
    imbalance: trim.Imbalance
    about: tuple[str, ...]
    """How it was found, for people."""
    doubts: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()


def present(case: Case, one_mounting: bool) -> list[Source]:
    """The sources that the rig has for these runs; the base's vibration counts where there is nothing better."""
    rig = case.rigs[0]
    if not one_mounting:
        return ["trials"]
    driven = {column.component for name, s in rig.of_kind(Torque).items() for column in s.columns(name)}
    found: list[Source] = ["wrench"] if rig.supports else []
    if driven and driven >= set(case.mounted.driven):
        found.append("torque")
    if not found and rig.base_accelerometers and states_base(rig):
        found.append("vibration")
    return found


def told_by(source: Source, case: Case) -> Told:
    """What a source tells. Raises AnalysisError, DataError or NotObservable, saying why, where it cannot tell."""
    return _WAYS[source](case)


def _wrench(case: Case) -> Told:
    cutoff = case.cutoff or CUTOFF_HZ
    every: list[RunEvidence] = []
    findings: list[Finding] = []
    for run, rig in zip(case.runs, case.rigs, strict=True):
        try:
            every.append(run_evidence(run, rig, case.mechanism, case.conditions, cutoff, case.clocks.get(run.path)))
        except AnalysisError as error:
            if len(case.runs) == 1:
                raise
            findings.append(Finding("not_aligned", None, run.name, f"left out: {error}"))
    if not every:
        raise AnalysisError("no run can tell:\n" + "\n".join(f"  {f.message}" for f in findings))
    measured = trim.measure([one.record for one in every], case.conditions)
    base = "the base's motion taken out." if every[0].base_known else "the base taken for still."
    about = (f"Forces and model low-passed alike at {cutoff:g} Hz, clocks of the loggers aligned, {base}",)
    doubts = () if all(one.base_known for one in every) else (BASE_UNKNOWN,)
    return Told("wrench", measured, (*about, _jackknife(measured)), doubts, tuple(findings))


def _torque(case: Case) -> Told:
    cutoff = case.cutoff or TORQUE_CUTOFF_HZ
    records = torque_records(case.runs, case.rigs, case.mechanism, case.conditions, cutoff, case.clocks)
    measured, held = _free_or_held(records, case)
    about = (
        f"Motor torques and model low-passed alike at {cutoff:g} Hz; inertias, friction, offsets and delays fitted "
        "beside, the base taken for still.",
    )
    return Told("torque", measured, (*about, *held, _jackknife(measured)))


def _vibration(case: Case) -> Told:
    cutoff = case.cutoff or CUTOFF_HZ
    records = vibration_records(case.runs, case.rigs, case.mechanism, case.conditions, cutoff, case.clocks)
    measured, held = _free_or_held(records, case)
    measured = _with_encoder_steps(measured, case, cutoff)
    about = (
        "The base's mass, centre, inertia and mounts are those that the rig states: a model that is assumed, whose "
        "errors the intervals do not contain.",
        f"Readings and the base's response low-passed alike at {cutoff:g} Hz; inertias of the mechanism fitted beside.",
    )
    jackknife = f"{_jackknife(measured)[:-1]}; in them what the encoders' resolution leaves open."
    return Told("vibration", measured, (*about, *held, jackknife))


def _with_encoder_steps(measured: trim.Imbalance, case: Case, cutoff: float) -> trim.Imbalance:
    """Wider by what the encoders' steps do to the columns: no stretch of a record shows it, they are in all alike.

    Moved evenly within their resolution the readings hold the steps' error once more, so the change of what is found
    has the covariance of that error (JCGM 101).
    """
    rng = np.random.default_rng(0)
    changes = [
        trim.measure(
            vibration_records(case.runs, case.rigs, case.mechanism, case.conditions, cutoff, case.clocks, rng),
            case.conditions,
            measured.free,
        ).values
        - measured.values
        for _ in range(STEP_DRAWS)
    ]
    return replace(measured, covariance=measured.covariance + np.einsum("ki,kj->ij", changes, changes) / STEP_DRAWS)


def _trials(case: Case) -> Told:
    cutoff = case.cutoff or TRIALS_CUTOFF_HZ
    measured = trials_imbalance(case.runs, case.rigs, case.mechanism, case.conditions, case.sites, cutoff, case.clocks)
    about = (
        f"The base's response below {cutoff:g} Hz is measured by the trial masses, linear and the same in all runs; "
        f"what is missing is said of the mounting of {case.runs[0].name}.",
        HELD,
        f"Intervals: from what the fit leaves, {measured.freedom} degrees of freedom.",
    )
    return Told("trials", measured, about)


def _free_or_held(records: Sequence[trim.Record], case: Case) -> tuple[trim.Imbalance, tuple[str, ...]]:
    """All conditions where the records tell them, else those that masses at the sites can change."""
    measured = trim.measure(records, case.conditions)
    most = TELLS * float(np.abs(case.conditions.values(case.mechanism)).max(initial=0.0))
    try:
        widths = [measured.estimate(row).half_width for row in np.eye(case.conditions.rank)]
    except NotObservable:
        widths = [np.inf]
    if max(widths) <= most:
        return measured, ()
    free = trim.Free.at_sites(case.conditions, case.mounted, case.sites)
    if len(free.directions) == case.conditions.rank:
        return measured, ()
    return trim.measure(records, case.conditions, free), (HELD,)


def _jackknife(measured: trim.Imbalance) -> str:
    return f"Intervals: delete-block jackknife, {measured.freedom} degrees of freedom."


_WAYS: dict[Source, Callable[[Case], Told]] = {
    "wrench": _wrench, "torque": _torque, "vibration": _vibration, "trials": _trials,
}  # fmt: skip
