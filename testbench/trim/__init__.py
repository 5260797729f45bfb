"""What first moment is missing on which arm, and which mass to add, from the runs of a mechanism."""

from collections.abc import Sequence

from balance.balancing import conditions
from balance.balancing.stock_plates import Plate
from balance.errors import CounterpoiseError
from balance.estimation.covariance_weighting import CombinedImbalance, combine
from balance.estimation.first_moment_imbalance import Imbalance, MissingMass, masses_per_value
from balance.estimation.identifiability import NotIdentifiable

from ..errors import AnalysisError
from ..recording import Origin
from ..runs.aligned_run import AlignedRun
from .estimators import ESTIMATORS, LONGER, MORE_RUNS, present_sources
from .force_regression import CUTOFF_HZ
from .problem import NAMES, Source, SourceEstimate, TrimProblem
from .result import Share, Trim, refuse_blur

__all__ = ["CUTOFF_HZ", "NAMES", "Share", "Source", "Trim", "trim_runs"]

_HINTS: dict[Source, str] = {
    "wrench": MORE_RUNS, "torque": LONGER, "vibration": MORE_RUNS, "trials": "use heavier trial masses, or more runs",
}  # fmt: skip


def trim_runs(
    runs: Sequence[AlignedRun],
    sites: Sequence[str] = (),
    plates: Sequence[Plate] = (),
    source: Source | Sequence[Source] | None = None,
    cutoff: float | None = None,
) -> Trim:
    """What is missing where, from runs of one mechanism.

    By what the rig has, unless named: force sensors and motor torques of runs of one mounting, together where both
    tell; else the base's vibration; trial masses where mountings differ. Raises AnalysisError or NotIdentifiable where
    the runs cannot tell.
    """
    mechanism, mounted = runs[0].unloaded, runs[0].mechanism
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise AnalysisError(
            f"{mechanism.name} has no site named counter...: name sites, there are "
            f"{', '.join(mechanism.sites) or 'none'}"
        )
    mounted.with_counter_mass(dict.fromkeys(names, 0.0))
    problem = TrimProblem(runs, conditions.balance_conditions(mounted), names, cutoff)
    return _result(problem, _estimated(problem, _wanted(problem, source)), plates)


def _wanted(problem: TrimProblem, named: Source | Sequence[Source] | None) -> tuple[list[Source], bool]:
    """The sources to ask, and whether they were named."""
    wanted: list[Source] = [named] if isinstance(named, str) else list(dict.fromkeys(named or ()))
    differs = _differs(problem)
    if "trials" in wanted and len(wanted) > 1:
        raise AnalysisError("trial masses are runs of several mountings, other sources take runs of one: name one")
    if wanted and wanted != ["trials"] and differs:
        raise AnalysisError(f"{differs}: expected runs of one mounting")
    if wanted == ["trials"] and not differs:
        raise AnalysisError(f"{problem.names}: all of one mounting: trial masses must differ from run to run")
    if wanted:
        return wanted, True
    _refuse_other_payloads(problem)
    if differs and not problem.runs[0].rig.base_accelerometers:
        raise AnalysisError(f"{differs}: expected runs of one mounting, or an accelerometer on the base")
    found = present_sources(problem, not differs)
    if not found:
        raise AnalysisError(
            f"{problem.runs[0].name}: its rig has neither force sensors nor motor torques, nor accelerometers on a "
            "base that it states: nothing tells what is missing"
        )
    return found, False


def _refuse_other_payloads(problem: TrimProblem) -> None:
    first = problem.runs[0]
    for run in problem.runs[1:]:
        here, there = (r.conditions.get("payload_kg") for r in (run, first))
        if here != there:
            raise AnalysisError(
                f"{run.name}: payload_kg is {here}, that of {first.name} {there}: expected runs of one mounting"
            )


def _differs(problem: TrimProblem) -> str:
    """What differs between the mountings; empty if nothing does."""
    first = problem.runs[0]
    for run in problem.runs[1:]:
        for key in ("payload_kg", "counter_masses"):
            if run.conditions.get(key) != first.conditions.get(key):
                return (
                    f"{run.name}: {key} is {run.conditions.get(key)}, that of {first.name} {first.conditions.get(key)}"
                )
    return ""


def _estimated(problem: TrimProblem, wanted: tuple[list[Source], bool]) -> tuple[list[SourceEstimate], list[str]]:
    """What the sources tell, and why others do not; one that was named must tell."""
    sources, named = wanted
    found: list[SourceEstimate] = []
    silent: list[tuple[Source, CounterpoiseError]] = []
    for source in sources:
        try:
            told = ESTIMATORS[source](problem)
            _refuse_silent(told, problem)
            found.append(told)
        except CounterpoiseError as error:
            if named or len(sources) == 1:
                raise
            silent.append((source, error))
    if not found:
        raise silent[0][1]
    return found, [f"{NAMES[source].capitalize()} cannot tell: {error}" for source, error in silent]


def _refuse_silent(told: SourceEstimate, problem: TrimProblem) -> None:
    hint = "; ".join([_HINTS[told.source], *(finding.message for finding in told.findings)])
    try:
        missing = _missing(told.imbalance, problem)
    except NotIdentifiable as error:
        raise AnalysisError(f"{problem.names}: {error}; {hint}") from error
    refuse_blur(missing, _lacking(problem), [run.name for run in problem.runs], hint)


def _missing(measured: Imbalance, problem: TrimProblem) -> list[MissingMass]:
    return measured.missing(problem.mounted, problem.sites)


def _result(problem: TrimProblem, told: tuple[list[SourceEstimate], list[str]], plates: Sequence[Plate]) -> Trim:
    found, silent = told
    both = combine([one.imbalance for one in found]) if len(found) > 1 else None
    measured = both.imbalance if both else found[0].imbalance
    return Trim(
        problem.conditions,
        problem.mounted,
        problem.mechanism,
        tuple(run.name for run in problem.runs),
        _origin(problem.runs),
        tuple(Share(one.source, tuple(_missing(one.imbalance, problem)), one.imbalance.unexplained) for one in found),
        tuple(_missing(measured, problem)),
        measured,
        tuple(dict.fromkeys([*_about(found), *silent])),
        tuple(doubt for one in found for doubt in one.doubts) + _contradiction(both),
        both,
        tuple(plates),
        tuple(finding for one in found for finding in one.findings),
    )


def _about(found: list[SourceEstimate]) -> list[str]:
    """How it was found, each line with its source where there are several."""
    if len(found) == 1:
        return list(found[0].about)
    return [f"By {NAMES[one.source]}: {line[0].lower()}{line[1:]}" for one in found for line in one.about]


def _contradiction(both: CombinedImbalance | None) -> tuple[str, ...]:
    if both is None or both.agrees:
        return ()
    return (
        f"the sources contradict each other: chi-square {both.chi_square:.3g} with {both.degrees_of_freedom} degrees "
        f"of freedom, probability {both.probability:.1g}; see what each says, and trust none before the reason is "
        "found",
    )


def _lacking(problem: TrimProblem) -> list[float]:
    """What each site lacks without counter-masses, by the model [kg m]."""
    payload = problem.runs[0].conditions.get("payload_kg")
    bare = problem.mechanism
    bare = bare if payload is None else bare.with_payload({bare.payload_bodies[0]: payload})
    values = problem.conditions.values(bare)
    masses = masses_per_value(problem.conditions, bare, problem.sites, values) @ values
    return [float(mass) * bare.lever_arm(site) for mass, site in zip(masses, problem.sites, strict=True)]


def _origin(runs: Sequence[AlignedRun]) -> Origin:
    """Measured only if every run is; simulated if any is."""
    origins = {run.run.origin for run in runs}
    if len(origins) == 1:
        return origins.pop()
    return "simulated" if "simulated" in origins else "unstated"
