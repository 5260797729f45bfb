"""What first moment is missing on which arm, and which mass to add, from the runs of a mechanism."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Literal

import numpy as np

from balance.balancing import conditions
from balance.balancing.conditions import UndecidedRank, row_space
from balance.balancing.stock_plates import Plate
from balance.closure import Closure
from balance.dynamics.regressor import driven_torque_regressor
from balance.errors import ClosureError, CounterpoiseError
from balance.estimation.first_moment_imbalance import CombinedImbalance, can_be_met, combine, masses_per_value
from balance.estimation.identifiability import NotIdentifiable
from balance.mechanism.mechanism import Mechanism
from balance.motion import Samples
from balance.results import first_of

from ..errors import AnalysisError
from ..kinematics.gaps import Gaps
from ..recording import common_origin, mounted_masses, payload_text
from ..runs.aligned_run import AlignedRun, trigger_notes
from .estimators import ESTIMATORS, further_sources, present_sources
from .problem import SOURCES, Source, SourceEstimate, TrimProblem
from .result import Share, Trim

_STATES = 40
"""States of a motion for each of the mechanism's coordinates."""
_AMPLITUDES, _NO_PART = (1.2, 0.6, 0.3, 0.1), 1e-6
"""Of motions of the drives, the largest that can be followed counts [rad, m]; parts of conditions that are rounding."""
COMPROMISE = (
    "No masses at these sites meet all conditions: of an open chain what is missing along the sites is told, of loops "
    "what leaves the least momentum over the workspace, by the inertias of its file. Before masses are removed compare "
    "with `balance size --motion`, the least force of one motion."
)
SLIDES = (
    "What slides move along their own axes shakes the base whatever is mounted, and what is mounted adds to it: the "
    "first moments are made zero. `balance size --motion` finds the least force of one motion."
)
RESOLUTION = 0.25
"""Half of an interval, as a part of the largest first moment that a site lacks without counter-masses, from which a
record cannot tell what is missing."""


def trim_runs(
    runs: Sequence[AlignedRun],
    sites: Sequence[str] = (),
    plates: Sequence[Plate] = (),
    source: Source | Sequence[Source] | None = None,
    cutoff: float | None = None,
) -> Trim:
    """What is missing where, from runs of one mechanism.

    By what the rig has, unless named: force sensors and motor torques of runs of one mounting, together where both
    determine it; the base's vibration where they are not there or cannot tell; trial masses where mountings differ.
    Raises AnalysisError or NotIdentifiable where the runs cannot tell.
    """
    problem = trim_problem(runs, sites, cutoff)
    mounted, names = problem.mounted, problem.sites
    named = [source] if isinstance(source, str) else list(dict.fromkeys(source or ()))
    found, failed = _estimated(problem, _sources(problem, named), bool(named))
    both = combine([one.imbalance for one in found]) if len(found) > 1 else None
    measured = both.imbalance if both else found[0].imbalance
    bare, carried = _unbalanced(problem.runs[0]), mounted_masses(problem.runs[0].conditions, "counter_masses")
    shares = [
        Share(
            source=one.source,
            missing=tuple(one.imbalance.missing(mounted, names)),
            unexplained=one.imbalance.unexplained,
            by_steps=one.by_steps,
            of_unbalanced=one.imbalance.unexplained_of(problem.conditions.values(bare)),
            over_rest=one.over_rest,
        )
        for one in found
    ]
    return Trim(
        conditions=problem.conditions,
        mechanism=mounted,
        runs=tuple(run.name for run in runs),
        origin=common_origin(run.run.origin for run in runs),
        shares=tuple(shares),
        missing=tuple(measured.missing(mounted, names)),
        imbalance=measured,
        about=tuple(dict.fromkeys([*_about(problem, found), *failed])),
        doubts_before=(*(doubt for one in found for doubt in one.doubts), *_contradiction(both)),
        consensus=both,
        plates=tuple(plates),
        findings=tuple(finding for one in found for finding in one.findings),
        estimates=tuple(one.imbalance for one in found),
        unbalanced=problem.conditions.first_moment_residual(bare),
        removable={
            site: carried.get(site, 0.0) * bare.lever_arm(site) + max(-moment, 0.0)
            for site, moment in zip(names, lacking(problem), strict=True)
        },
    )


def _about(problem: TrimProblem, found: Sequence[SourceEstimate]) -> list[str]:
    """How it was found, by each source where there are several, and what no masses at the sites can meet."""
    about = [line for one in found for line in one.about]
    if len(found) > 1:
        about = [f"By {SOURCES[o.source].name}: {text[0].lower()}{text[1:]}" for o in found for text in o.about]
    asked = problem.conditions, problem.mounted, problem.sites
    without_slides = problem.conditions.on_first_moments
    unmet = [] if can_be_met(*asked) else [SLIDES if can_be_met(*asked, without_slides) else COMPROMISE]
    return [*about, *trigger_notes(problem.runs), *unmet]


def _contradiction(both: CombinedImbalance | None) -> list[str]:
    """The doubt of sources that contradict each other."""
    if both is None or both.agrees:
        return []
    return [
        f"the sources contradict each other: chi-square {both.chi_square:.3g} with {both.degrees_of_freedom} degrees "
        f"of freedom, probability {both.probability:.1g}; see what each says, and trust none before the reason is found"
    ]


def trim_problem(runs: Sequence[AlignedRun], sites: Sequence[str], cutoff: float | None) -> TrimProblem:
    """What is asked of runs of one mechanism. Raises AnalysisError without a site, ModelError for an unknown one."""
    mechanism, mounted = runs[0].unloaded, runs[0].mechanism
    names = list(dict.fromkeys(sites)) or mechanism.counter_sites
    if not names:
        raise AnalysisError(
            f"{mechanism.name} has no site named counter...: name sites, there are "
            f"{', '.join(mechanism.sites) or 'none'}"
        )
    mounted.with_counter_mass(dict.fromkeys(names, 0.0))
    return TrimProblem(runs, conditions.balance_conditions(mounted), names, cutoff)


def _sources(problem: TrimProblem, named: list[Source]) -> list[Source]:
    """The sources that are named, if the runs are fit for them, else those that the rig has for these runs."""
    payload, masses = _differs(problem, "payload"), _differs(problem, "counter-masses")
    if "trials" in named and len(named) > 1:
        raise AnalysisError("trial masses are runs of several mountings, other sources take runs of one: name one")
    if named == ["trials"]:
        if not (payload or masses):
            raise AnalysisError(f"{problem.names}: all of one mounting: trial masses must differ from run to run")
        return named
    if payload or (masses and named):
        raise AnalysisError(
            f"{payload or masses}: expected runs of one mounting: trim each by itself; testbench identify takes both"
        )
    rig, first = problem.runs[0].rig, problem.runs[0].name
    if masses and not rig.base_accelerometers:
        raise AnalysisError(f"{masses}: expected runs of one mounting, or an accelerometer on the base")
    if found := named or present_sources(problem, not masses):
        return found
    raise AnalysisError(
        f"{first}: its rig has neither force sensors nor motor torques, nor accelerometers on a base that it states: "
        "nothing tells what is missing"
    )


def _differs(problem: TrimProblem, what: Literal["payload", "counter-masses"]) -> str:
    """What differs between the mountings; empty if nothing does."""

    def carried(run: AlignedRun) -> tuple[object, str]:
        if what == "payload":  # however it is stated
            return _unbalanced(run).parameters.tolist(), payload_text(run.conditions)
        masses = mounted_masses(run.conditions, "counter_masses")
        return masses, payload_text({"payloads": masses})

    first, *others = problem.runs
    for run in others:
        (here, text), (there, other) = carried(run), carried(first)
        if here != there:
            return f"{run.name}: {what} {text or 'none'}, that of {first.name} {other or 'none'}"
    return ""


def _estimated(problem: TrimProblem, sources: list[Source], named: bool) -> tuple[list[SourceEstimate], list[str]]:
    """What the sources determine, and why others do not; one that was named must."""
    found: list[SourceEstimate] = []
    failed: dict[Source, CounterpoiseError] = {}
    for source in [*sources, *([] if named else further_sources(problem, sources))]:
        if found and source not in sources:
            break
        try:
            estimate = ESTIMATORS[source](problem)
            _refuse_wide(estimate, problem)
            found.append(estimate)
        except CounterpoiseError as error:
            failed[source] = error
            if named:
                break
    if not found or (named and failed):
        raise _with_gaps(problem, next(iter(failed.values())))
    return found, [f"{SOURCES[source].name.capitalize()} cannot tell: {error}" for source, error in failed.items()]


def _with_gaps(problem: TrimProblem, error: CounterpoiseError) -> CounterpoiseError:
    """The error; where records of the runs have gaps of which it says nothing, with each run's, by its own clock."""
    texts = []
    for run in problem.runs:
        used = [
            g.name for g in run.run.groups if g.has_time and any(run.run.holds(c, g.name) for c in run.rig.columns())
        ]
        texts += [f"{run.name}: {text}" for text in Gaps.of({name: run.run.time(name) for name in used}).descriptions]
    if not texts or "in the record of" in str(error):
        return error
    return AnalysisError(
        f"{error}; gaps take part of what the runs tell: {first_of(texts, 4)}: repeat the run, or give others of the "
        "same mounting beside it"
    )


def _unseen_by_torques(problem: TrimProblem) -> list[str]:
    """The conditions of whose left-hand sides the drives' torques hold nothing, or not all, in a motion about home as
    large as the mechanism can follow; none where that is not decided.
    """
    mechanism, rng = problem.mechanism, np.random.default_rng(0)
    time = np.linspace(0.0, 6.0, _STATES * len(mechanism.coordinates))
    home = [float(mechanism.home[mechanism.coordinate_index(joint)]) for joint in mechanism.driven]
    speed = 1j * rng.uniform(1.0, 6.0, (2, 1, len(home)))
    wave = np.exp(speed * time[:, None]) / 2.0
    for amplitude in _AMPLITUDES:
        q, v, a = (amplitude * (speed**k * wave).imag.sum(axis=0) for k in range(3))
        with suppress(ClosureError, UndecidedRank):
            path = Closure(mechanism).follow(Samples(time, home + q, v, a, mechanism.driven))
            rows = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive)
            seen, _ = row_space(rows.reshape(-1, rows.shape[-1]), mechanism.name)
            unseen = problem.conditions.matrix - problem.conditions.matrix @ seen.T @ seen
            return [problem.conditions.left(int(k)) for k in np.flatnonzero(np.abs(unseen).max(axis=1) > _NO_PART)]
    return []


def _refuse_wide(estimate: SourceEstimate, problem: TrimProblem) -> None:
    """Raise AnalysisError where nothing is determined, or intervals are so wide that they say next to nothing."""
    hint = "; ".join([SOURCES[estimate.source].help, *(finding.message for finding in estimate.findings)])
    try:
        missing = estimate.imbalance.missing(problem.mounted, problem.sites)
    except NotIdentifiable as error:
        if estimate.source == "torque" and (unseen := _unseen_by_torques(problem)):
            raise AnalysisError(
                f"{problem.names}: torques of the drives do not show {first_of(unseen, 2)}, whatever the motion: "
                "part of it needs no torque (as of a body turning about an axis along gravity); force sensors "
                "under the mechanism, the vibration of a base that the rig states (--from vibration) or trial masses "
                "(--from trials) show it"
            ) from error
        raise AnalysisError(f"{problem.names}: {error}; {hint}") from error
    largest = max((abs(value) for value in lacking(problem)), default=0.0)
    for one in missing:
        half = one.first_moment.half_width()
        if half > RESOLUTION * largest:
            raise AnalysisError(
                f"{problem.names}: cannot tell what is missing at {one.site}: {one.first_moment.value:.3g} kg m, "
                f"known to {half:.2g} kg m only, where the mechanism without counter-masses lacks {largest:.3g} kg m; "
                f"{hint}"
            )


def _unbalanced(run: AlignedRun) -> Mechanism:
    """With the payload of a run and without counter-masses."""
    return run.unloaded.with_payload(run.conditions.get("payloads", {}), run.conditions.get("payload_kg"))


def lacking(problem: TrimProblem) -> list[float]:
    """What each site lacks without counter-masses, by the model [kg m]."""
    bare = _unbalanced(problem.runs[0])
    values = problem.conditions.values(bare)
    masses = masses_per_value(problem.conditions, bare, problem.sites, values) @ values
    return [float(mass) * bare.lever_arm(site) for mass, site in zip(masses, problem.sites, strict=True)]
