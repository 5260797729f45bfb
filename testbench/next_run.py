"""Which run to make next: how far each candidate would narrow what is asked of a campaign, before it is made.

A **reduction**: the variance of the logarithm of each amplitude falls with the number of its repeats, and another
repeat of anything makes the scatter that is pooled over the campaign better known (Student's t).

A **first moment**, or the counter-mass that has it: readings = W c + noise, and what a run says of c is W' W over the
variance of the noise, nuisances solved for (Fedorov, Theory of Optimal Experiments, 1972; the criterion is c-optimal:
the variance of the one combination that is asked). W of a run that was not made comes from the simulated bench of the
rig that is stored with the runs: its motion, its loggers, its clocks; the noise is that of the runs that were made, as
is the factor by which the jackknife finds more variance than white noise would leave.
"""

import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from balance import datasets
from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.estimation.estimate import Estimate, coverage_factor, effective_degrees_of_freedom
from balance.estimation.first_moment_imbalance import Imbalance, masses_per_value
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.regression import RegressionFit
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import load_motion
from balance.results import Key
from balance.units import G0

from .campaign_plan import Condition, Plan
from .errors import AnalysisError
from .ingest import Ingest
from .ingest.run_table import plan_runs
from .runs.aligned_run import AlignedRun, recorded_clocks
from .runs.si_run import SIRun
from .simulator.campaign import RUN_TABLE, simulate_campaign
from .simulator.run import payload_body
from .store import open_campaign
from .trim import trim_runs
from .trim.estimators import ESTIMATORS, present_sources
from .trim.missing_masses import lacking, trim_problem
from .trim.problem import NAMES, Source, TrimProblem

if TYPE_CHECKING:
    from .store import Run

Question = Literal["reduction", "first-moment", "counter-mass"]
_NOTHING = 0.02
"""Share of a half width by which a run must narrow it to be worth making."""


@dataclass(frozen=True)
class Candidate:
    """A run that may be made next."""

    payload_kg: Annotated[float | None, Key("", "payload kg", lambda kg: "-" if kg is None else f"{kg:g}")]
    counter_masses: Annotated[dict[str, float], Key("counter_masses_kg", "counter-masses kg", lambda m: _masses(m))]
    motion: Annotated[str, Key("", "motion")]
    peak_acceleration_g: Annotated[float, Key("", "peak g0", "g")]
    repeats: Annotated[str | None, Key("repeats", "repeat of", lambda name: name or "new")]
    """The run that it would repeat; None for one unlike any that was made."""

    def __str__(self) -> str:
        what = f"motion {self.motion} at {self.peak_acceleration_g:g} g0"
        mounted = "with" if any(self.counter_masses.values()) else "without"
        place = "" if self.payload_kg is None else f"{self.payload_kg:g} kg, "
        return f"{'repeat ' + self.repeats if self.repeats else 'a new run'} ({place}{what}, {mounted} counter-masses)"


@dataclass(frozen=True)
class Proposal:
    """A candidate, and what of the asked it would narrow most."""

    candidate: Annotated[Candidate, Key("run", "run", str)]
    quantity: Annotated[str, Key("", "narrows")]
    now: Annotated[float | None, Key("half_width_now", "half width now", lambda h: "-" if h is None else f"{h:.3g}")]
    """Of its 95 % interval, in the unit of the design; None where the runs do not determine it."""
    after: Annotated[float, Key("half_width_after", "after", ".3g")]
    """The same, predicted with the candidate."""
    share: Annotated[float, Key("remaining_share", "all asked, mean share that remains", ".2f")]
    """Geometric mean of after / now over all that is asked."""


@dataclass(frozen=True)
class Design:
    """All candidates, the best first."""

    question: Annotated[Question, Key("for")]
    unit: Annotated[str, Key()]
    """Of the half widths."""
    proposals: Annotated[tuple[Proposal, ...], Key()]
    notes: Annotated[tuple[str, ...], Key()] = ()

    @property
    def verdict(self) -> Annotated[str, Key()]:
        """Which run narrows what from how much to how much."""
        best = self.proposals[0]
        if best.now is not None and best.share > 1.0 - _NOTHING:
            return f"no single run narrows it by more than {_NOTHING:.0%}: {best.candidate} would do most"
        before = "from nothing known" if best.now is None else f"from {best.now:.3g}"
        return f"{best.candidate} narrows {best.quantity} {before} to {best.after:.3g} {self.unit} (half of 95 %)"


def _masses(masses: Mapping[str, float]) -> str:
    return " + ".join(f"{mass:g}" for mass in masses.values()) or "none"


def _ranked(question: Question, unit: str, proposals: Sequence[Proposal], notes: Sequence[str]) -> Design:
    if not proposals:
        raise AnalysisError("no run can be proposed: " + "; ".join(notes))
    order = sorted(proposals, key=lambda one: (one.share, one.after))
    return Design(question, unit, tuple(order), tuple(notes))


def next_for_first_moment(
    runs: "Sequence[Run]",
    question: Question = "first-moment",
    sites: Sequence[str] = (),
    payload_kg: float | None = None,
    motions: Sequence[str] = (),
    accelerations_g: Sequence[float] = (),
) -> Design:
    """The run that tells most of what first moment is missing at the sites [kg m], or which counter-mass [kg].

    Of the mounting (payload and counter-masses) with the most runs, or with the most among those of a payload. Raises
    AnalysisError where nothing that a run shows depends on it, or no run can be simulated.
    """
    mounted, notes = _of_one_mounting(runs, payload_kg)
    bench = mounted[0].rig
    model = load_mechanism(bench.mechanism)
    made = [AlignedRun(run, model, recorded_clocks(run)) for run in mounted]
    problem = trim_problem(made, sites, None)
    if not (sources := present_sources(problem, one_mounting=True)):
        raise AnalysisError(
            f"{problem.names}: nothing that these runs show depends on what is missing: expected force sensors, motor "
            "torques, or accelerometers on a base that the rig states"
        )
    with tempfile.TemporaryDirectory(prefix="counterpoise-next-") as folder:
        candidates, simulated = _simulated(made[0], mounted, motions, accelerations_g, Path(folder))
        known = _Knowledge.of(problem, simulated, sources)
        proposals = [_proposal(candidate, known, number, question) for number, candidate in enumerate(candidates)]
    return _ranked(question, "kg m" if question == "first-moment" else "kg", proposals, [*notes, *known.notes])


def _proposal(candidate: Candidate, known: "_Knowledge", number: int, question: Question) -> Proposal:
    """What the candidate narrows most, of the sites; where one is undetermined, relative to what it lacks without."""
    rows = []
    for place, site in enumerate(known.problem.sites):
        now, after = known.half_widths(place, number)
        scale = 1.0 if question == "first-moment" else 1.0 / known.levers[place]
        wide = known.lacking[place] if now is None else now
        rows.append((after / wide, site, None if now is None else scale * now, scale * after))
    _, site, now, after = min(rows)
    what = "the first moment missing" if question == "first-moment" else "the counter-mass missing"
    share = float(np.exp(np.mean([np.log(row[0]) for row in rows])))
    return Proposal(candidate, f"{what} at {site}", now, after, share)


def _of_one_mounting(runs: "Sequence[Run]", payload_kg: float | None) -> tuple[list[SIRun], list[str]]:
    """The runs of the mounting with the most, bound to their rigs, and what is left out."""
    groups: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        c = run.conditions
        if run.rig is None or "motion" not in c or "peak_acceleration_g" not in c:
            continue
        payload = c.get("payload_kg")
        if payload_kg is None or (payload is not None and np.isclose(payload, payload_kg)):
            groups.setdefault((payload, *sorted(c.get("counter_masses", {}).items())), []).append(run)
    if not groups:
        wanted = "" if payload_kg is None else f" of {payload_kg:g} kg"
        raise AnalysisError(
            f"no run{wanted} has a rig, a motion and a peak acceleration: the rig says what a run would show; ingest "
            "with --rig and --runs"
        )
    most = max(groups.values(), key=len)
    bound = [SIRun.of(run) for run in most]
    names = ", ".join(run.name for run in most)
    return bound, [f"Of the mounting of {names}; runs of other mountings do not add to it."]


def _simulated(
    first: AlignedRun, mounted: Sequence[SIRun], motions: Sequence[str], accelerations_g: Sequence[float], folder: Path
) -> tuple[list[Candidate], list[AlignedRun]]:
    """The candidates, and runs of them on the simulated bench of the rig, seen by its loggers."""
    conditions = first.conditions
    masses = {site: mass for site, mass in conditions.get("counter_masses", {}).items() if mass > 0.0}
    made = {(run.conditions["motion"], round(run.conditions["peak_acceleration_g"], 9)): run.name for run in mounted}
    accelerations = [*dict.fromkeys([*accelerations_g, *(peak for _, peak in made)])]
    payload = conditions.get("payload_kg")
    plan = Plan.model_construct(
        mechanism=first.rig.mechanism,
        conditions=[
            Condition.model_construct(
                payload=[payload or first.unloaded.mass(payload_body(first.unloaded))],
                counter_masses=masses,
                motion=list(dict.fromkeys([*(m for m, _ in made), *(motions or _like(next(iter(made))[0]))])),
                peak_acceleration=[peak * G0 for peak in accelerations],
                also_without=False,
            )
        ],
    )
    logs = simulate_campaign(plan, first.rig, folder / "logs")
    (folder / "runs").mkdir()
    ingest = Ingest(folder / "runs", first.rig)
    for planned in plan_runs(logs, folder / "logs" / RUN_TABLE):
        for outcome in ingest.run(planned):
            if outcome.status != "stored":
                raise AnalysisError(f"{outcome.source}: the simulated run cannot be stored: {outcome.message}")
    bound = [SIRun.of(run).preloaded([]) for run in open_campaign(folder / "runs").runs]
    candidates = [
        Candidate(payload, masses, c["motion"], c["peak_acceleration_g"],
                  made.get((c["motion"], round(c["peak_acceleration_g"], 9))))
        for c in (run.conditions for run in bound)
    ]  # fmt: skip
    return candidates, [AlignedRun(run, first.unloaded) for run in bound]


def _like(name: str) -> Iterator[str]:
    """Shipped motions that drive the same from the same place as one of the campaign's."""
    given = load_motion(name)
    for other in datasets.dataset_names("motions", ".toml"):
        motion = load_motion(other)
        same = (motion.joints, motion.point, motion.axes) == (given.joints, given.point, given.axes)
        if same and motion.recorded is None and given.recorded is None and _overlap(motion.waypoints, given.waypoints):
            yield other


def _overlap(one: Floats, other: Floats) -> bool:
    """Whether two motions, by way-points (k, d) [m or rad], have places in common."""
    return bool(np.all(one.min(axis=0) <= other.max(axis=0)) and np.all(other.min(axis=0) <= one.max(axis=0)))


@dataclass(frozen=True)
class _Source:
    """What one source says of the conditions: of all runs, made and simulated, and the noise of those made."""

    imbalance: Imbalance
    regression: RegressionFit
    residual_rms: Mapping[str, float]
    """By row, of the runs that were made."""
    excess: float
    """Variance that the jackknife finds in them, as a multiple of what white noise would leave [-]."""

    def estimate(self, combination: Floats, records: Collection[int]) -> Estimate | None:
        """How surely some of the records give a combination (rank,) of the conditions' values; None: not at all."""
        own = self.imbalance.coordinates(combination, len(self.regression.values))
        try:
            white = self.regression.designed_estimate(own, records, self.residual_rms)
        except NotIdentifiable:
            return None
        return Estimate.single(0.0, self.excess**0.5 * white.standard_uncertainty, white.degrees_of_freedom)


@dataclass(frozen=True)
class _Knowledge:
    """What the runs that were made say of the sites, and what they and each candidate would."""

    problem: TrimProblem
    made: tuple[float | None, ...]
    """Half widths of the first moments missing at the sites [kg m]; None where the runs do not determine them."""
    sources: tuple[_Source, ...]
    rows: Floats
    """Mass missing at each site per unit of each condition's value, (sites, rank) [1/m]."""
    levers: tuple[float, ...]
    """Of the sites [m]."""
    lacking: tuple[float, ...]
    """First moments that the sites lack without counter-masses, by the model [kg m]."""
    notes: tuple[str, ...]

    @classmethod
    def of(cls, problem: TrimProblem, simulated: Sequence[AlignedRun], sources: Sequence[Source]) -> "_Knowledge":
        """From the runs that were made and those of the candidates. Raises AnalysisError where no source is left."""
        notes, found = [], []
        for source in sources:
            try:
                found.append(_source(source, problem, replace(problem, runs=[*problem.runs, *simulated])))
            except CounterpoiseError as error:
                notes.append(f"{NAMES[source].capitalize()} would not tell: {error}")
        if not found:
            raise AnalysisError(" ".join(notes))
        known: list[float | None] = [None] * len(problem.sites)
        try:
            known = [one.first_moment.half_width() for one in trim_runs(problem.runs, problem.sites).missing]
        except CounterpoiseError as error:
            notes.append(f"Now: {error}.")
        mounted, sites = problem.mounted, problem.sites
        rows = masses_per_value(problem.conditions, mounted, sites, problem.conditions.values(mounted))
        levers = tuple(mounted.lever_arm(site) for site in sites)
        return cls(problem, tuple(known), tuple(found), rows, levers, tuple(map(abs, lacking(problem))), tuple(notes))

    def half_widths(self, place: int, number: int) -> tuple[float | None, float]:
        """Of the first moment missing at a site, now and with a candidate [kg m]; infinite: still undetermined."""
        combination, count = self.levers[place] * self.rows[place], len(self.problem.runs)
        before = self._designed(combination, range(count))
        after = self._designed(combination, [*range(count), count + number])
        now = self.made[place]
        return now, after if now is None else now * after / before

    def _designed(self, combination: Floats, records: Collection[int]) -> float:
        """Half width by all sources together, weighted [the combination's unit]."""
        each = [found for one in self.sources if (found := one.estimate(combination, records)) is not None]
        precision = np.array([one.standard_uncertainty**-2.0 for one in each])
        if not each:
            return np.inf
        freedom = effective_degrees_of_freedom(precision, np.array([one.degrees_of_freedom for one in each]))
        return coverage_factor(freedom) / float(np.sqrt(precision.sum()))


def _source(source: Source, problem: TrimProblem, both: TrimProblem) -> _Source:
    """One source over all runs, with the noise of those that were made where these determine anything."""
    imbalance = ESTIMATORS[source](both).imbalance
    assert imbalance.regression is not None
    try:
        alone = ESTIMATORS[source](problem).imbalance.regression or imbalance.regression
    except CounterpoiseError:
        alone = imbalance.regression
    return _Source(imbalance, imbalance.regression, alone.residual_rms, alone.excess_variance)
