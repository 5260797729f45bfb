"""What first moment is missing on which arm, and which mass to add, from the runs of a mechanism."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from balance import conditions, trim
from balance.combinations import text_of
from balance.identification import Estimate
from balance.mechanism import Mechanism
from balance.observability import NotObservable
from balance.stock import Plate

from ..errors import AnalysisError
from ..findings import Finding
from ..joint_motion import loaded
from ..pairing import rig_of
from ..recording import Origin
from ..rig.sensors import Torque
from .evidence import CUTOFF_HZ, RunEvidence, run_evidence
from .result import Missing, Trim, refuse_blur

if TYPE_CHECKING:
    from ..clocks.mapping import ClockMap
    from ..rig import Rig
    from ..store import Run

__all__ = ["CUTOFF_HZ", "Missing", "Trim", "trim_runs"]

BASE_UNKNOWN = (
    "no accelerometer on the base: if the base moves, the forces hold the mechanism's inertia against that motion, "
    "which is taken for shaking force, and the intervals do not hold"
)
MORE_RUNS = (
    "add runs in another direction (the triangle), with more acceleration, or a second accelerometer on the base"
)


def trim_runs(
    runs: "Sequence[Run]",
    mechanism: Mechanism,
    sites: Sequence[str] = (),
    plates: Sequence[Plate] = (),
    by: str | None = None,
    rig: "Rig | None" = None,
    cutoff: float = CUTOFF_HZ,
    clocks: "Mapping[Path, Mapping[str, ClockMap]] | None" = None,
) -> Trim:
    """What is missing where, from runs of one mounting of ``mechanism``, which comes without what the runs mounted.

    By ``wrench`` where the rig has force sensors, else by ``torque``, unless named. Raises AnalysisError or
    NotObservable, saying why, where the runs cannot tell.
    """
    mounted, bare = _mounted(runs, mechanism)
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise AnalysisError(
            f"{mechanism.name} has no site named counter...: name sites, there are "
            f"{', '.join(mechanism.sites) or 'none'}"
        )
    mounted.with_counter_mass(dict.fromkeys(names, 0.0))
    chosen = by or _way(rig or rig_of(runs[0]), runs[0].name)
    found = conditions.find(mounted)
    if chosen == "torque":
        result = _by_torque(runs, mounted, bare, found, names, rig)
    else:
        result = _by_wrench(runs, mechanism, mounted, bare, found, names, rig, cutoff, clocks or {})
    return _with_plates(result, plates)


def _with_plates(result: Trim, plates: Sequence[Plate]) -> Trim:
    from dataclasses import replace

    return replace(result, plates=tuple(plates))


def _mounted(runs: "Sequence[Run]", mechanism: Mechanism) -> tuple[Mechanism, Mechanism]:
    """The mechanism as mounted, and without counter-masses; all runs must have been made with the same."""
    first = runs[0]
    for run in runs[1:]:
        for key in ("payload_kg", "counter_masses"):
            if run.conditions.get(key) != first.conditions.get(key):
                raise AnalysisError(
                    f"{run.name}: {key} is {run.conditions.get(key)}, that of {first.name} "
                    f"{first.conditions.get(key)}: expected runs of one mounting"
                )
    mounted = loaded(first, mechanism)
    payload = first.conditions.get("payload_kg")
    bare = mechanism if payload is None else mechanism.with_payload({mechanism.payload_bodies[0]: payload})
    return mounted, bare


def _way(rig: "Rig", run: str) -> str:
    if rig.supports:
        return "wrench"
    if rig.of_kind(Torque):
        return "torque"
    raise AnalysisError(f"{run}: its rig has neither force sensors nor motor torques: nothing tells what is missing")


def _by_wrench(
    runs: "Sequence[Run]",
    mechanism: Mechanism,
    mounted: Mechanism,
    bare: Mechanism,
    found: conditions.Conditions,
    sites: Sequence[str],
    rig: "Rig | None",
    cutoff: float,
    clocks: "Mapping[Path, Mapping[str, ClockMap]]",
) -> Trim:
    every: list[RunEvidence] = []
    findings: list[Finding] = []
    for run in runs:
        try:
            every.append(run_evidence(run, rig or rig_of(run), mechanism, found, cutoff, clocks.get(run.path)))
        except AnalysisError as error:
            if len(runs) == 1:
                raise
            findings.append(Finding("not_aligned", None, run.name, f"left out: {error}"))
    if not every:
        raise AnalysisError("no run can tell:\n" + "\n".join(f"  {f.message}" for f in findings))
    names = [run.name for run in runs]
    measured = trim.measure([one.record for one in every], found)
    try:
        lacking = measured.missing(mounted, sites)
    except NotObservable as error:
        raise AnalysisError(f"{', '.join(names)}: {error}; {MORE_RUNS}") from error
    missing = [Missing(m.site, m.position, m.first_moment.value, m.first_moment.interval) for m in lacking]
    refuse_blur(missing, _bare(found, bare, sites), names, MORE_RUNS)
    return Trim(
        found,
        mounted,
        bare,
        tuple(names),
        _origin(runs),
        "wrench",
        tuple(missing),
        tuple(_determined(measured, row) for row in range(found.rank)),
        measured.unexplained,
        (
            f"Forces and model low-passed alike at {cutoff:g} Hz, clocks of the loggers aligned, "
            + ("the base's motion taken out." if every[0].base_known else "the base taken for still."),
            f"Intervals: delete-block jackknife, {measured.freedom} degrees of freedom.",
        ),
        () if all(one.base_known for one in every) else (BASE_UNKNOWN,),
        findings=tuple(findings),
    )


def _determined(measured: trim.Imbalance, row: int) -> tuple[str, Estimate | None]:
    text = text_of(measured.conditions.coefficients(row))
    try:
        return text, measured.estimate(np.eye(measured.conditions.rank)[row])
    except NotObservable:
        return text, None


def _by_torque(
    runs: "Sequence[Run]",
    mounted: Mechanism,
    bare: Mechanism,
    found: conditions.Conditions,
    sites: Sequence[str],
    rig: "Rig | None",
) -> Trim:
    from ..identify import identify, joint_record

    names = [run.name for run in runs]
    result = identify([joint_record(run, mounted, rig) for run in runs], mounted)
    try:
        lacking = [(c.site, c.position, c.first_moment) for c in result.counter_masses(sites)]
    except NotObservable as error:
        raise AnalysisError(f"{', '.join(names)}: {error}; the motor torques of these runs cannot tell") from error
    missing = [Missing(site, position, value.value, value.interval) for site, position, value in lacking]
    refuse_blur(missing, _bare(found, bare, sites), names, "give longer runs that move more")
    known = {value.name: value for value in result.first_moments()}
    values: list[tuple[str, Estimate | None]] = []
    for row in range(found.rank):
        text = text_of(found.coefficients(row))
        value = known.get(text)
        half = 0.0 if value is None else 0.5 * (value.interval[1] - value.interval[0])
        values.append((text, None if value is None else Estimate(value.value, value.estimate.standard_error, half)))
    return Trim(
        found,
        mounted,
        bare,
        tuple(names),
        _origin(runs),
        "torque",
        tuple(missing),
        tuple(values),
        float(np.max(result.rms_ratio_in_band)),
        (
            f"Motor torques low-passed at {result.chosen.cutoff:.3g} Hz, chosen by held-out torque error.",
            "Intervals contain half and double that cut-off, and no delay between torque and motion.",
        ),
        (),
    )


def _bare(found: conditions.Conditions, bare: Mechanism, sites: Sequence[str]) -> list[float]:
    """What each site lacks without counter-masses, by the model [kg m]."""
    masses = trim.shares_of(found, bare, sites) @ found.values(bare)
    return [float(m * np.linalg.norm(bare.site(site).position)) for m, site in zip(masses, sites, strict=True)]


def _origin(runs: "Sequence[Run]") -> Origin:
    """Measured only if every run is; simulated if any is."""
    origins = {run.origin for run in runs}
    if len(origins) == 1:
        return origins.pop()
    return "simulated" if "simulated" in origins else "unstated"
