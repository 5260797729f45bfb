"""Which run to make next: how far each candidate would narrow what is asked of a campaign, before it is made.

A **reduction**: its interval with one more run on a side, whose noise and scatter are those of the campaign.

A **first moment**, or the counter-mass that has it: readings = W c + noise, and what a run says of c is W' W over the
variance of the noise, nuisances solved for (Fedorov, Theory of Optimal Experiments, 1972; the criterion is c-optimal:
the variance of the one combination that is asked). W of a run that was not made comes from the simulated bench of the
rig that is stored with the runs: its motion, its loggers, its clocks; the noise is that of the runs that were made, as
is the factor by which the jackknife finds more variance than white noise would leave. What an interval contains besides
(file, stated errors of sensors, steps of encoders) is what the estimator adds of the runs with the candidate.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from balance import datasets
from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.estimation.estimate import Estimate, coverage_factor, effective_degrees_of_freedom
from balance.estimation.first_moment_imbalance import Imbalance, Subspace, masses_per_value
from balance.estimation.identifiability import NotIdentifiable
from balance.estimation.regression import RegressionFit
from balance.input_files import Measured
from balance.motion import Motion
from balance.motion.motion_files import load_motion, motion_from_texts
from balance.results import INLINE, Key, Shown
from balance.units import G0

from .errors import AnalysisError
from .kinematics.encoder_motion import mechanism_of
from .recording import mounted_masses, payload_body
from .runs.aligned_run import AlignedRun, recorded_clocks, trigger_notes
from .runs.si_run import SIRun
from .simulator.loggers import record_log
from .simulator.run import simulate_run
from .simulator.sensors import true_signals
from .simulator.simulated_logs import memory_run, written_values
from .store import Run
from .synchronization.clock_map import ClockMap
from .trimming import trim_runs
from .trimming.estimators import ESTIMATORS, further_sources, present_sources
from .trimming.missing_masses import lacking, trim_problem
from .trimming.problem import SOURCES, Source, TrimProblem
from .vibration.metrics import Measure
from .vibration.reduction import Reduction, analyze
from .vibration.run_pairs import ConditionKey, stated_of

Question = Literal["reduction", "first-moment", "counter-mass"]
_SEED = 0
"""Of the noise of simulated runs, of which only the motion counts."""
_NOTHING = 0.05
"""Share of a half width by which a run must narrow it to be worth making."""
_SIDES: tuple[Literal[0], Literal[1]] = (0, 1)
"""With counter-masses and without."""


@dataclass(frozen=True)
class Candidate:
    """A run that may be made next."""

    key: Annotated[ConditionKey, INLINE]
    counter_masses: Annotated[dict[str, float], Key("counter_masses_kg")]
    """By site [kg]; empty without."""
    repeats: Annotated[str | None, Key()]
    """The run that it would repeat; None for one unlike any that was made."""

    def __str__(self) -> str:
        mounted = "with" if any(self.counter_masses.values()) else "without"
        what = f"repeat {self.repeats}" if self.repeats else "a new run"
        return f"{what} ({self.key}, {mounted} counter-masses)"


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
class Design(Shown, rows="proposals"):
    """All runs that may be made next, the best first.

    >>> import testbench
    >>> design = testbench.plan_next("campaign", axes=["y"])
    >>> design.proposals[0].now > design.proposals[0].after
    True
    """

    question: Annotated[Question, Key("for")]
    unit: Annotated[str, Key()]
    """Of the half widths."""
    proposals: Annotated[tuple[Proposal, ...], Key()]
    notes: Annotated[tuple[str, ...], Key()] = ()
    remedy: str = ""
    """What would narrow it where no single run does."""

    @property
    def verdict(self) -> Annotated[str, Key()]:
        """Which run narrows what from how much to how much."""
        best = self.proposals[0]
        if all(one.now is not None and one.after > (1.0 - _NOTHING) * one.now for one in self.proposals):
            most = f"no single run narrows it by more than {_NOTHING:.0%}: {best.candidate} would do most"
            return f"{most}; {self.remedy}" if self.remedy else most
        before = "from nothing known" if best.now is None else f"from {best.now:.3g}"
        return f"{best.candidate} narrows {best.quantity} {before} to {best.after:.3g} {self.unit} (half of 95 %)"


def _widens(one: Proposal) -> str:
    """What is added to what a run narrows, where it would not."""
    return " (would not narrow)" if one.now is not None and one.after >= one.now else ""


def _ranked(
    question: Question,
    unit: str,
    proposals: Sequence[tuple[Proposal, Proposal]],
    notes: Sequence[str],
    remedy: str = "",
) -> Design:
    """By what remains of all that is asked, each with what it leaves of the least sure of it, which the best one tells
    where that is something else.
    """
    order = sorted(proposals, key=lambda one: (one[0].share, one[0].after))
    best, widest = order[0]
    if best.quantity != widest.quantity:
        wide = "not known yet" if widest.now is None else f"{widest.now:.3g} {unit} (half of 95 %)"
        notes = [f"Least sure is {widest.quantity}, {wide}: this run leaves {widest.after:.3g}.", *notes]
    said = [replace(one, quantity=one.quantity + _widens(one)) for one, _ in order]
    return Design(question, unit, tuple(said), tuple(notes), remedy)


def next_for_reduction(
    runs: Iterable[Run],
    measure: Measure,
    payloads: Sequence[tuple[str, float]] = (),
    motions: Sequence[str] = (),
    peaks: Sequence[Measured[float]] = (),
    axes: Sequence[str] = (),
    accept: Sequence[str] = (),
) -> Design:
    """The repeat that narrows the reductions of a campaign most, or those of some conditions and axes [points].

    ``payloads`` [kg] are by body or site, by an empty name that which has none. Raises AnalysisError where there is
    none with an interval.
    """
    runs = list(runs)
    analysis = analyze(runs, measure, accept)
    wanted = [
        one
        for one in analysis.reductions
        if _carries(one.key.payload_kg, one.key.payloads_kg, _asked(payloads, runs), _named(runs))
        and (not motions or one.key.motion in motions)
        and (not peaks or any(_has_peak(one.key, peak) for peak in peaks))
        and (not axes or one.axis in axes)
    ]
    rows = [one for one in wanted if one.interval is not None and one.uncertainty is not None]
    if not wanted and analysis.reductions:
        conditions = "; ".join(dict.fromkeys(str(one.key) for one in analysis.reductions))
        along = ", ".join(dict.fromkeys(one.axis for one in analysis.reductions))
        raise AnalysisError(f"no reduction is of what is asked; there are those of {conditions}; along {along}")
    if not rows:
        reasons = "; ".join(dict.fromkeys(finding.message for finding in analysis.findings)) or "none is of them"
        raise AnalysisError(f"no reduction that is asked has an interval to narrow: {reasons}")
    sides = dict.fromkeys(_of_side(one, side) for one in rows for side in _SIDES)
    lost = len(wanted) - len(rows)
    notes = [f"{lost} reduction{' has' if lost == 1 else 's have'} no interval to narrow."] if lost else []
    if all(one.method == "propagation" for one in rows):
        notes.append(
            "No run is repeated: what repeats differ by beyond noise is not known, and not in the predictions."
        )
    widest = max(rows, key=_half_width)
    least_sure = {_of_side(widest, side): _proposed(widest, side, 1.0) for side in _SIDES}
    kept = replace(least_sure[_of_side(widest, 0)], after=_half_width(widest))
    proposals = [(_repeat(side, rows), least_sure.get(side, kept)) for side in sides]
    return _ranked("reduction", "points", proposals, notes, "several repeats on both sides would")


def _named(runs: Iterable[Run]) -> set[str]:
    """Bodies and sites whose payload the run table states, of some run."""
    return {name for run in runs for name in run.conditions.get("payloads", {})}


def _asked(payloads: Iterable[tuple[str, float]], runs: Iterable[Run]) -> list[tuple[str, float]]:
    """The same with an empty name for the one body that carries the payload."""
    bodies = {payload_body(run.inputs) for run in runs}
    return [("" if name in bodies else name, mass) for name, mass in payloads]


def _carries(
    payload_kg: float | None,
    payloads_kg: Mapping[str, float],
    asked: Sequence[tuple[str, float]],
    named: Collection[str] = (),
) -> bool:
    """Whether what a run table states of payloads [kg] is what is asked; where it names one alone, without name too.

    Those that it has ``named`` for other runs alone are zero.
    Of several that are named none is meant without its name, nor is then the payload without a name 0 kg.
    """
    unnamed = [payload_kg] if payload_kg is not None else list(payloads_kg.values()) or [0.0]
    stated = {**dict.fromkeys(named, 0.0), **({"": unnamed[0]} if len(unnamed) == 1 else {}), **payloads_kg}
    return all(name in stated and bool(np.isclose(stated[name], mass)) for name, mass in asked)


def _has_peak(key: ConditionKey, peak: Measured[float]) -> bool:
    """Whether a condition has this peak acceleration."""
    if peak.dimension == "acceleration":
        return key.peak_acceleration_g is not None and bool(np.isclose(key.peak_acceleration_g * G0, peak.value))
    return key.peak_acceleration_rad_s2 is not None and bool(np.isclose(key.peak_acceleration_rad_s2, peak.value))


def _repeat(repeated: tuple[str, ...], rows: Sequence[Reduction]) -> Proposal:
    """One more of the runs of a side of a condition."""
    sides = [(one, side) for one in rows for side in _SIDES if _of_side(one, side) == repeated]
    shares = [_share(one, side) for one, side in sides]
    mean = float(np.exp(np.sum(np.log(np.maximum(shares, 1e-9))) / len(rows)))
    _, best = max(enumerate(sides), key=lambda at: _half_width(at[1][0]) * (1.0 - shares[at[0]]))
    return _proposed(*best, mean)


def _of_side(one: Reduction, side: Literal[0, 1]) -> tuple[str, ...]:
    """The runs with counter-masses, or those without."""
    return one.runs[: one.n[0]] if side == 0 else one.runs[one.n[0] :]


def _half_width(one: Reduction) -> float:
    assert one.interval is not None
    return 0.5 * (one.interval[1] - one.interval[0])


def _share(one: Reduction, side: Literal[0, 1]) -> float:
    """What remains of the half width with one more run of a side [-]."""
    assert one.uncertainty is not None
    return one.uncertainty.with_one_more(side)


def _proposed(one: Reduction, side: Literal[0, 1], mean: float) -> Proposal:
    """One more run of a side of a reduction, of which the ``mean`` share of all that is asked remains [-]."""
    candidate = Candidate(one.key, one.counter_masses if side == 0 else {}, _of_side(one, side)[-1])
    now, quantity = _half_width(one), f"the reduction at {one.key}, {one.sensor} along {one.axis}"
    return Proposal(candidate, quantity, now, now * _share(one, side), mean)


def next_for_first_moment(
    runs: Sequence[Run],
    question: Question = "first-moment",
    sites: Sequence[str] = (),
    payloads: Sequence[tuple[str, float]] = (),
    motions: Sequence[str] = (),
    peaks: Sequence[Measured[float]] = (),
    sources: Sequence[Source] = (),
) -> Design:
    """The run that tells most of what first moment is missing at the sites [kg m], or which counter-mass [kg].

    Of the mounting (payload and counter-masses) with the most runs, or with the most among those of ``payloads``, as
    for :func:`next_for_reduction`. By the ``sources`` that are named; else by those that the rig has, and where they
    cannot tell by the base's vibration. Raises AnalysisError where nothing that a run shows depends on it, or no run
    can be simulated.
    """
    mounted, notes = _of_one_mounting(runs, payloads)
    model = mechanism_of(mounted[0], None)
    made = [AlignedRun(run, model, recorded_clocks(run)) for run in mounted]
    problem = trim_problem(made, sites, None)
    if "trials" in sources:
        raise AnalysisError("trial masses are runs of several mountings, a next run is of one: expected another source")
    if not (tried := list(sources) or present_sources(problem, one_mounting=True)):
        raise AnalysisError(
            f"{problem.names}: nothing that these runs show depends on what is missing: expected force sensors, motor "
            "torques, or accelerometers on a base that the rig states"
        )
    candidates = list(_candidates(mounted, motions, peaks))
    simulated = [_simulated(one, made[0], mounted) for one in candidates]
    try:
        known = _Knowledge.of(problem, simulated, tried, named=bool(sources))
    except AnalysisError:
        if sources or not (further := further_sources(problem, tried)):
            raise
        known = _Knowledge.of(problem, simulated, further)
    sited = [_by_site(candidate, known, number, question) for number, candidate in enumerate(candidates)]
    widest = max(range(len(problem.sites)), key=lambda place: math.inf if (now := sited[0][place].now) is None else now)
    unit = "kg m" if question == "first-moment" else "kg"
    proposals = [(_proposal(one), one[widest]) for one in sited]
    return _ranked(question, unit, proposals, [*notes, *known.notes, *trigger_notes(made)], known.remedy(widest))


def _proposal(by_site: Sequence[Proposal]) -> Proposal:
    """What a candidate narrows most, of the sites."""
    share = float(np.exp(np.mean([np.log(one.share) for one in by_site])))
    return replace(min(by_site, key=lambda one: one.share), share=share)


def _by_site(candidate: Candidate, known: "_Knowledge", number: int, question: Question) -> list[Proposal]:
    """What the candidate leaves of each site; where one is undetermined, relative to what it lacks without."""
    found = []
    what = "the first moment missing" if question == "first-moment" else "the counter-mass missing"
    for place, site in enumerate(known.problem.sites):
        now, after = known.half_widths(place, number)
        scale = 1.0 if question == "first-moment" else 1.0 / known.levers[place]
        wide = known.lacking[place] if now is None else now
        before = None if now is None else scale * now
        found.append(Proposal(candidate, f"{what} at {site}", before, scale * after, after / wide))
    return found


def _of_one_mounting(runs: Sequence[Run], payloads: Sequence[tuple[str, float]]) -> tuple[list[SIRun], list[str]]:
    """The runs of the mounting with the most, bound to their rigs, and what is left out."""
    groups: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        stated = stated_of(run)
        payload, named = stated.get("payload_kg"), mounted_masses(stated, "payloads")
        if (
            _carries(payload, named, _asked(payloads, runs), _named(runs))
            and run.rig is not None
            and "motion" in run.conditions
        ):
            masses = mounted_masses(run.conditions, "counter_masses")
            groups.setdefault((payload, tuple(sorted(named.items())), *sorted(masses.items())), []).append(run)
    if not groups:
        wanted = "".join(f" of {name + ' ' if name else ''}{mass:g} kg" for name, mass in payloads)
        raise AnalysisError(
            f"no run{wanted} has a rig and a motion: the rig says what a run would show; ingest with --rig and --runs"
        )
    most = max(groups.values(), key=len)
    names = ", ".join(run.name for run in most)
    return [SIRun.of(run) for run in most], [f"Of the mounting of {names}; runs of other mountings do not add to it."]


def _candidates(
    mounted: Sequence[SIRun], motions: Sequence[str], peaks: Sequence[Measured[float]]
) -> Iterator[Candidate]:
    """Repeats of what was made, and every motion with every peak acceleration of its kind."""
    made: dict[ConditionKey, str] = {}
    for run in mounted:
        made.setdefault(ConditionKey.of(run.recorded), run.name)
    first, given = next(iter(made)), [motion_of(run) for run in mounted]
    shipped = () if motions else datasets.dataset_names("motions", ".toml")
    others = [*motions, *(name for name in shipped if any(_alike(load_motion(name), motion) for motion in given))]
    sizes = [(key.peak_acceleration_g, key.peak_acceleration_rad_s2) for key in made]
    sizes += [(p.value / G0, None) if p.dimension == "acceleration" else (None, p.value) for p in peaks]
    masses = mounted_masses(mounted[0].conditions, "counter_masses")
    for motion in dict.fromkeys([*(key.motion for key in made), *others]):
        own = [size for key, size in zip(made, sizes, strict=False) if key.motion == motion] or [(None, None)]
        recorded = _motion(motion, mounted).recorded is not None  # whose peak acceleration is what it is
        for linear, turning in dict.fromkeys(own if recorded else sizes):
            key = replace(first, motion=motion, peak_acceleration_g=linear, peak_acceleration_rad_s2=turning)
            yield Candidate(key, masses, made.get(key))


def _simulated(candidate: Candidate, first: AlignedRun, mounted: Sequence[SIRun]) -> AlignedRun:
    """What the loggers would record of a candidate, on the simulated bench of the rig."""
    key, rig = candidate.key, first.rig
    planned = key.planned(candidate.repeats or "next", candidate.counter_masses)
    bench = simulate_run(rig, first.unloaded, planned, motion=_motion(key.motion, mounted))
    shown, recorded, paces = true_signals(rig, bench), {}, {}
    for number, (name, logger) in enumerate(rig.loggers.items()):
        if columns := list(rig.columns(name)):
            log = record_log(logger, columns, bench.time, shown, (_SEED, number))
            recorded[name] = {"Time": log.time} | written_values(log, rig, name)
            paces[name] = np.polyfit(log.time, log.true_time, 1)
    run = SIRun.of(memory_run("next/next.h5", rig, planned, recorded))
    return AlignedRun(run, first.unloaded, _aligned_as(first, run, paces))


def _aligned_as(first: AlignedRun, run: SIRun, paces: Mapping[str, Floats]) -> dict[str, ClockMap]:
    """Clocks of a simulated run on that of its encoders, where those of the ``first`` run are known, as surely.

    ``paces`` are slope [-] and start [s] of true time over each logger's own. Other clocks are found as those of any
    run: by what both recorded.
    """
    pace, start = paces[first.rig.sensors[first.encoders[0].sensor].logger]
    found = {}
    for logger, (own_pace, own_start) in paces.items():
        groups = {first.run.group_of(column) for column in first.rig.columns(logger) if first.run.holds(column)}
        known = [one for group in groups - {first.reference} if (one := first.related_clock(group)) is not None]
        if known:
            drift = float(own_pace / pace) - 1.0
            found[logger] = replace(known[0], at_own=0.0, at_reference=float((own_start - start) / pace), drift=drift)
    return found


def _alike(one: Motion, other: Motion) -> bool:
    """Whether two motions drive the same, and have places in common."""
    same = (one.joints, one.point, one.axes) == (other.joints, other.point, other.axes)
    return same and one.recorded is None and other.recorded is None and _overlap(one.waypoints, other.waypoints)


def _motion(name: str, mounted: Sequence[SIRun]) -> Motion:
    """The motion of this name, as stored with a run of it where there is one."""
    own = next((run for run in mounted if run.conditions["motion"] == name), None)
    return load_motion(name) if own is None else motion_of(own)


def motion_of(run: SIRun) -> Motion:
    """The motion stored with a run, else the shipped one that its conditions name. Raises DataError for neither."""
    own = run.recorded.inputs.get("motion")
    return load_motion(run.conditions["motion"]) if own is None else motion_from_texts(*own)


def _overlap(one: Floats, other: Floats) -> bool:
    """Whether two motions, by way-points (k, d) [m or rad], have places in common."""
    return bool(np.all(one.min(axis=0) <= other.max(axis=0)) and np.all(other.min(axis=0) <= one.max(axis=0)))


@dataclass(frozen=True)
class _Source:
    """What one source says of the conditions by some runs, made or simulated, in the noise of those made."""

    imbalance: Imbalance
    regression: RegressionFit
    noise: RegressionFit
    """Of the runs that were made, where these determine anything."""
    of_steps: Floats | None = None
    """Part of the covariance that the encoders' steps make, (rank, rank) [kg2 m2]."""

    @classmethod
    def of(cls, source: Source, problem: TrimProblem, made: "_Source | None") -> "_Source":
        """Of the problem's runs. Raises CounterpoiseError where they tell nothing."""
        found = ESTIMATORS[source](problem)
        measured = found.imbalance
        assert measured.regression is not None
        return cls(measured, measured.regression, measured.regression if made is None else made.noise, found.of_steps)

    @classmethod
    def predicted(cls, source: Source, problem: TrimProblem, made: "_Source | None") -> "_Source":
        """The same of runs of which one is simulated: what they determine is told by their design, not by readings."""
        everything = Subspace.all_values(problem.conditions)
        found = cls.of(source, replace(problem, free=everything), made)
        free = problem.free_directions(found.imbalance, found.estimate)
        free = free if made is None else free.joined([*made.imbalance.subspace.directions])
        return found if free.is_whole else cls.of(source, replace(problem, free=free), made)

    def estimate(self, combination: Floats) -> Estimate | None:
        """How surely the runs give a combination (rank,) of the conditions' values; None: not at all."""
        own = self.imbalance.coordinates(combination, len(self.regression.values))
        try:
            white = self.regression.designed_estimate(own, self.noise.residual_rms)
        except NotIdentifiable:
            return None
        by_noise, added = self.noise.excess_variance * white.standard_uncertainty**2, self.added(combination)
        freedom = white.degrees_of_freedom * min(1.0 + added / max(by_noise, 1e-300), 1e3) ** 2
        return Estimate.single(0.0, (by_noise + added) ** 0.5, freedom)

    def variance(self, combination: Floats) -> float:
        """Of a combination (rank,), readings of simulated runs and all."""
        return float(combination @ self.imbalance.covariance @ combination)

    def added(self, combination: Floats) -> float:
        """The part of the same that the jackknife does not tell: by file, sensors' stated errors, encoders' steps."""
        own = self.imbalance.coordinates(combination, len(self.regression.values))
        return max(self.variance(combination) - float(own @ self.regression.covariance @ own), 0.0)


@dataclass(frozen=True)
class _Knowledge:
    """What the runs that were made say of the sites, and what they and each candidate would."""

    problem: TrimProblem
    made: tuple[float | None, ...]
    """Half widths of the first moments missing at the sites [kg m]; None where the runs do not determine them."""
    now: tuple[_Source, ...]
    """By the runs that were made."""
    next: tuple[tuple[_Source, ...], ...]
    """By these and each candidate."""
    rows: Floats
    """Mass missing at each site per unit of each condition's value, (sites, rank) [1/m]."""
    levers: tuple[float, ...]
    """Of the sites [m]."""
    lacking: tuple[float, ...]
    """First moments that the sites lack without counter-masses, by the model [kg m]."""
    notes: tuple[str, ...]

    @classmethod
    def of(
        cls, problem: TrimProblem, simulated: Sequence[AlignedRun], sources: Sequence[Source], *, named: bool = False
    ) -> "_Knowledge":
        """From the runs that were made and those of the candidates. Raises AnalysisError where no source is left."""
        notes, now, then = [], [], [list[_Source]() for _ in simulated]
        for source in sources:
            made, failed = None, ""
            with suppress(CounterpoiseError):
                made = _Source.of(source, problem, None)
                now.append(made)
            for found, run in zip(then, simulated, strict=True):
                try:
                    found.append(_Source.predicted(source, replace(problem, runs=[*problem.runs, run]), made))
                except CounterpoiseError as error:
                    failed = failed or f"{SOURCES[source].name.capitalize()} would not tell: {error}"
            notes += [failed] * bool(failed)
        if not any(then):
            raise AnalysisError(" ".join(notes))
        known: list[float | None] = [None] * len(problem.sites)
        by = list(sources) if named else None
        try:
            known = [one.first_moment.half_width() for one in trim_runs(problem.runs, problem.sites, (), by).missing]
        except CounterpoiseError as error:
            notes.append(f"Now: {error}.")
        mounted, sites = problem.mounted, problem.sites
        rows = masses_per_value(problem.conditions, mounted, sites, problem.conditions.values(mounted))
        levers = tuple(mounted.lever_arm(site) for site in sites)
        lacks = tuple(map(abs, lacking(problem)))
        return cls(problem, tuple(known), tuple(now), tuple(map(tuple, then)), rows, levers, lacks, tuple(notes))

    def half_widths(self, place: int, number: int) -> tuple[float | None, float]:
        """Of the first moment missing at a site, now and with a candidate [kg m]; infinite: still undetermined."""
        combination, now = self.levers[place] * self.rows[place], self.made[place]
        before, after = (_together(one, combination) for one in (self.now, self.next[number]))
        return now, after if now is None or math.isinf(before) else now * after / before

    def remedy(self, place: int) -> str:
        """What would narrow what is missing at a site where no candidate does."""
        combination = self.levers[place] * self.rows[place]
        told = [one for one in self.now if one.estimate(combination) is not None]
        best = min(told, key=lambda one: one.variance(combination), default=None)
        share = 0.0 if best is None else best.added(combination) / best.variance(combination)
        if best is None or share < 0.5:
            return "a larger motion would (--motion), or many runs"
        most = f"{share:.0%} of the variance at {self.problem.sites[place]} is"
        steps = 0.0 if best.of_steps is None else float(combination @ best.of_steps @ combination)
        if steps > 0.5 * best.added(combination):
            most = f"{steps / best.variance(combination):.0%} of the variance at {self.problem.sites[place]} is"
            return f"{most} steps of the encoders, which no repeat tells: encoders of finer steps would"
        if best.imbalance.subspace.is_whole:
            return f"{most} stated errors of sensors, which no repeat tells: calibrations that state less would"
        return (
            f"{most} what the mechanism's file may be wrong by, which no repeat tells: a larger motion would (--motion)"
        )


def _together(sources: Sequence[_Source], combination: Floats) -> float:
    """Half width of a combination by all sources, weighted [the combination's unit]; infinite: undetermined."""
    each = [found for one in sources if (found := one.estimate(combination)) is not None]
    if not each:
        return np.inf
    precision = np.array([one.standard_uncertainty**-2.0 for one in each])
    freedom = effective_degrees_of_freedom(precision, np.array([one.degrees_of_freedom for one in each]))
    return coverage_factor(freedom) / float(np.sqrt(precision.sum()))
