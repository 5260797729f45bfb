"""By how many per cent counter-masses reduce the vibration of the base, with intervals.

An interval comes from the noise that the campaign shows, in its rests and in what does not repeat between its repeats,
and from what the repeats differ by beyond that noise.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from balance.errors import CounterpoiseError
from balance.estimation.estimate import LEVEL
from balance.results import INLINE, Key, Shown, first_of, grouped_texts
from balance.task_pool import HERE, TaskPool

from ..cross_examination import Examination, Observation
from ..cross_examination.examination import examined, observed_or_why
from ..cross_examination.observation import observed_columns
from ..cross_examination.statement import WITHHOLDING
from ..errors import AnalysisError
from ..published_tables import MANIPULATOR, NO_ORIGINALS
from ..recording import Finding
from ..runs.si_run import SIRun
from . import ConditionAmplitude, Ratio
from .amplitude import Place
from .amplitude_uncertainty import SIDES, AmplitudesUncertainty, Interval
from .condition import CampaignNoise, Condition
from .metrics import Measure
from .repeatability import CLEAR, Group, Repeatability
from .run_amplitudes import AmplitudesOfRun, amplitudes_or_reason
from .run_pairs import ConditionKey, Pair, pairs

if TYPE_CHECKING:
    from balance.mechanism.mechanism import Mechanism

    from ..store import Run

Method = Literal["repeats", "propagation"]
"""Where an interval comes from: what repeats of the campaign differ by, or noise of single runs, propagated."""
Limit = Literal["at_least", "at_most"]
Kind = Literal["number", "at_least", "at_most", "withheld", "no_interval"]
REPEATS_DIFFER = "repeats_differ"
WITHHELD = frozenset({*WITHHOLDING, REPEATS_DIFFER})
"""Doubts after which there is no interval."""
_TELLS = 100.0
"""Percent by which the best lower bound, where residual below noise, may lie below zero and still say something."""
_ENDLESS = 10.0
"""Ratio of the amplitudes, and multiple of the one that is found, from which an upper end says nothing."""
ONE_RUN = (
    "Where nothing is repeated, noise that acts only during the motion, such as that of drives and bearings, is told "
    "by what of one side is no smooth multiple of the other, to a factor of two: make each run at least twice."
)
"""What the intervals of a campaign without repeats stand on."""


def _masses(masses: dict[str, float]) -> str:
    return " + ".join(f"{mass:g}" for mass in masses.values())


def _both(values: tuple[float | None, float | None]) -> str:
    return "/".join("-" if value is None else f"{value:.2g}" for value in values)


@dataclass(frozen=True)
class Reduction:
    """By how many per cent an amplitude is smaller with counter-masses than without.

    >>> import testbench
    >>> reduction = testbench.analyze("campaign").reductions[0]
    >>> reduction.interval[0] < reduction.percent < reduction.interval[1]
    True
    """

    key: Annotated[ConditionKey, INLINE]
    counter_masses: Annotated[dict[str, float], Key("counter_masses_kg", "counter-masses kg", _masses)]
    """Counter-mass by site [kg]."""
    sensor: Annotated[str, Key("", "sensor")]
    axis: Annotated[str, Key("", "axis")]
    measure: Annotated[Measure, INLINE]
    percent: Annotated[float | None, Key("reduction_percent")]
    """Of the amplitudes of each run, without noise; None where nothing vibrated above the noise without
    counter-masses. Whether it is more than an end of what is known is told by ``kind``.
    """
    interval: Annotated[tuple[float, float] | None, Key("interval_percent")]
    """95 % interval of ``percent``; None where there is none."""
    method: Annotated[Method | None, Key("", "interval from")]
    """Where the interval comes from."""
    limit: Annotated[Limit | None, Key()]
    """``at_least``: the residual vibration is below the noise, or the sensor clipped without counter-masses;
    ``at_most``: what vibrates without counter-masses is hardly above the noise, or the sensor clipped with them.
    """
    below_noise: Annotated[bool, Key()]
    """Whether noise alone makes it a bound."""
    amplitudes: Annotated[tuple[float, float], Key("amplitude_m_s2", "with/without m/s2", _both, parts=SIDES)]
    """With and without counter-masses, without noise [m/s2]."""
    noise_floor: Annotated[tuple[float | None, float | None], Key("noise_floor_m_s2", "noise m/s2", _both, parts=SIDES)]
    """Reading of noise alone, with and without counter-masses [m/s2]; None where the noise is unknown."""
    noise_stated: Annotated[bool, Key()]
    """Whether the noise is the one that the rig states, since nothing recorded shows any: then there is no interval."""
    resolution: Annotated[float, Key("resolution_m_s2")]
    """Step of the channel [m/s2]; zero where none is known."""
    n: Annotated[tuple[int, int], Key("", "n", lambda n: f"{n[0]}/{n[1]}", parts=SIDES)]
    """Number of runs with and without counter-masses."""
    runs: Annotated[tuple[str, ...], Key("", "runs", " ".join)]
    synchronous_percent: Annotated[float | None, Key("synchronous_reduction_percent")] = None
    """Of the mean of aligned repeats: what repeats with the command. None without repeats on both sides."""
    synchronous_interval: Annotated[tuple[float, float] | None, Key("synchronous_interval_percent")] = None
    """95 % interval of ``synchronous_percent``."""
    synchronous_amplitudes: Annotated[tuple[float | None, float | None], Key("synchronous_m_s2", parts=SIDES)] = (
        None,
        None,
    )
    """Of the mean of aligned repeats, with and without counter-masses, without noise [m/s2]."""
    uncertainty: AmplitudesUncertainty | None = field(default=None, repr=False, compare=False)
    """What contributes to the intervals; None where there is none."""
    doubts: Annotated[tuple[str, ...], Key("", "doubts", " ".join)] = ()
    """Codes of contradictions about these runs and this channel; after some the number is withheld."""

    @property
    def amplitude_intervals(
        self,
    ) -> Annotated[tuple[Interval | None, Interval | None], Key("amplitude_interval_m_s2", parts=SIDES)]:
        """95 % intervals of ``amplitudes``, the calibration of the sensor in them [m/s2]; None where there is none."""
        known = self.uncertainty
        return (None, None) if known is None else (known.amplitude_interval(0), known.amplitude_interval(1))

    @property
    def at_least(self) -> Annotated[float | None, Key("at_least_percent")]:
        """The lower bound [%], where the reduction is one."""
        return self.interval[0] if self.limit == "at_least" and self.interval else None

    @property
    def hidden(self) -> Annotated[bool, Key("hidden_by_noise")]:
        """Whether it is a lower bound that says nothing: noise hides whether the vibration fell or rose."""
        return self.below_noise and self.at_least is not None and self.at_least < -_TELLS

    @property
    def kind(self) -> Annotated[Kind, Key()]:
        """What is known: a ``number`` with its interval, a bound of it, or why there is neither."""
        if self.interval is None and not WITHHELD.isdisjoint(self.doubts):
            return "withheld"
        if self.at_least is not None:
            return "at_least"
        if self.limit == "at_most":
            return "at_most"
        return "no_interval" if self.percent is None or self.interval is None else "number"

    @property
    def confidence(self) -> Annotated[float, Key("confidence_percent")]:
        """Of the interval [%]."""
        return 100.0 * LEVEL

    @property
    def text(self) -> Annotated[str, Key(None, "reduction % [95 %]")]:
        """``94.2 [93.1, 95.0]``; a lower bound as ``>= 97.2`` with its reason, or ``noise hides it`` of one hidden."""
        if self.hidden:
            return "noise hides it"
        if self.at_least is not None:
            return f">= {self.at_least:.1f} {'< noise' if self.below_noise else 'clipped'}"
        value = "-" if self.percent is None else f"{self.percent:.1f}"
        if self.kind == "withheld" and self.percent is not None:
            return f"withheld ({value})"
        if self.kind == "at_most":
            return f"<= {value} {'< noise' if self.below_noise else 'clipped'}"
        return value if self.interval is None else f"{value} [{self.interval[0]:.1f}, {self.interval[1]:.1f}]"


@dataclass(frozen=True)
class Analysis(Shown, rows="reductions", figure="testbench.figures.reductions:reductions"):
    """All reductions of a campaign, and findings about what could not be analysed or is doubtful.

    >>> import testbench
    >>> analysis = testbench.analyze("campaign")
    >>> analysis.origins
    {'simulated': 2}
    """

    pairs: tuple[Pair, ...]
    reductions: Annotated[tuple[Reduction, ...], Key()]
    findings: Annotated[tuple[Finding, ...], Key()]
    measure: Measure
    examination: Examination | None = field(default=None, repr=False, compare=False)
    """What its sensors and runs state of each other."""
    clocks: tuple[str, ...] = ()
    """What relates the clocks of command or encoders to those of the accelerometers, for people."""

    def report(self, path: "str | Path") -> Path:
        """Write the report of the campaign, one HTML page, with this measure; gives its path."""
        written: Path = import_module("testbench.report").html_report(
            self.pairs[0].runs[0].path.parent,
            path,
            self.measure,
            accept=self.examination.accepted if self.examination else (),
        )
        return written

    @property
    def definition(self) -> Annotated[str, Key()]:
        """What an amplitude is."""
        return (
            f"{self.measure}; reduction: mean over the runs of a side, noise taken off; "
            "synchronous: of the mean of aligned repeats, which is what repeats with the command"
        )

    @property
    def origins(self) -> dict[str, int]:
        """Number of runs by origin."""
        runs = {run.name: str(run.origin) for pair in self.pairs for run in pair.runs}
        return dict(Counter(runs.values()))

    @property
    def notes(self) -> Annotated[list[str], Key()]:
        """Notes for who reads the reductions."""
        simulated = [run for pair in self.pairs for run in pair.runs if run.origin == "simulated"]
        shown = any(SIRun.of(run).rig.mechanism.startswith(MANIPULATOR) for run in simulated)
        lone = any(one.method == "propagation" for one in self.reductions)
        return [*self.clocks, *(note for note, applies in ((NO_ORIGINALS, shown), (ONE_RUN, lone)) if applies)]


def analyze(
    runs: Iterable["Run"],
    measure: Measure,
    accept: Iterable[str] = (),
    mechanism: "Mechanism | None" = None,
    pool: TaskPool = HERE,
    examination: Examination | None = None,
    known: Mapping[int, AmplitudesOfRun | str] | None = None,
) -> Analysis:
    """Every reduction of a campaign. Raises AnalysisError, naming what each run lacks, if there is none.

    What contradicts the run table or the other runs is a doubt of the numbers that it concerns, and withholds those
    that it spoils, unless its code is among those to ``accept``. ``mechanism`` takes the place of the rig's.
    Each run is a task of the ``pool``, its channels read once; an ``examination`` of the same runs is not made again,
    with which amplitudes are ``known`` by the ``id`` of the run, or why there are none.
    """
    runs, accept = list(runs), tuple(accept)
    if examination is None:
        paired = {id(run) for pair in pairs(runs)[0] for run in pair.runs}
        work = partial(_observed_and_read, known={}, given=mechanism)
        tasks = [(run, measure if id(run) in paired else None) for run in runs]
        seen, read = zip(*pool.map(work, tasks, imports=True), strict=True) if tasks else ((), ())
        examination = examined(runs, seen, accept, pool)
        known = {id(run): one for run, one in zip(runs, read, strict=True) if id(run) in paired}
    found, findings = pairs(run for run in runs if run.name not in examination.copied)
    findings += examination.findings
    if not found:
        raise AnalysisError("no two runs can be compared:\n" + "\n".join(f"  {f.message}" for f in findings))
    conditions = _conditions(found, measure, findings, known or {})
    rigs = [SIRun.of(condition.pair.runs[0]).rig for condition in conditions]
    about = {column.channel for rig in rigs for column in rig.base_columns}
    spoilt = [s for s in examination.contradictions if s.concerns(about)]
    mixed = {s.run for s in spoilt if s.code and examination.withheld([s.code])}
    wrong = [not mixed.isdisjoint(run.name for run in condition.pair.runs) for condition in conditions]
    # Repeats of which one is not what it is taken for tell nothing of the other conditions.
    apart = [[c for c, one in zip(conditions, wrong, strict=True) if one is of_mixed] for of_mixed in (False, True)]
    judges = [CampaignLikelihoods.of(some, pool.in_memory) for some in apart]
    known_of = [iter(pool.in_memory.map(one.calibrated, some)) for one, some in zip(judges, apart, strict=True)]
    reductions: list[Reduction] = []
    for condition, of_mixed in zip(conditions, wrong, strict=True):
        judged, some = judges[of_mixed], _doubted(condition.pair, next(known_of[of_mixed]), examination)
        findings += [*condition.findings, *reduction_findings(condition, some)]
        findings += [*judged.scatter_findings(condition), *condition.doubts]
        reductions += some
    unrelated, clocks = _clocks(conditions)
    found_pairs, findings = tuple(condition.pair for condition in conditions), [*unrelated, *findings]
    return Analysis(found_pairs, tuple(reductions), tuple(dict.fromkeys(findings)), measure, examination, clocks)


def _clocks(conditions: Sequence[Condition]) -> tuple[list[Finding], tuple[str, ...]]:
    """Of runs whose motion another clock tells than that of the accelerometers: a finding where nothing relates the two
    though the rig names what might, and a note by what they are related.
    """
    sides = [side for condition in conditions for side in condition.sides]
    runs = [one for side in sides for one in zip(side.names, side.records, strict=True)]
    every = [(name, one.timed, one.clocks) for name, places in runs for one in places.values() if one.clocks]
    unrelated, related = (
        dict(sorted((name, how) for name, told, how in every if told is timed)) for timed in (False, True)
    )
    findings = [
        Finding(
            "clocks_not_related",
            None,
            " ".join(names),
            f"{first_of(names, 4)}: command or encoders tell when they move on a clock that nothing relates closely "
            f"to that of the accelerometers ({names[0]}: {why}): what these show tells it, less surely; see testbench "
            "align",
        )
        for why, names in grouped_texts(unrelated).items()
    ]
    return findings, tuple(
        f"Clocks of {first_of(names, 4)} are related by {how}: command or encoders tell when they move."
        for how, names in grouped_texts(related).items()
    )


def _observed_and_read(
    task: "tuple[Run, Measure | None]", known: dict[object, "Mechanism"], given: "Mechanism | None"
) -> tuple[Observation | str, AmplitudesOfRun | str]:
    """What a run shows, and its amplitudes where a measure asks for them, each or why there is none."""
    run, measure = task
    bound: Run | SIRun = run
    with suppress(CounterpoiseError):  # both say below why a channel cannot be read
        bound = SIRun.of(run)
        bound = bound.preloaded(observed_columns(bound))
    if measure is None:
        return observed_or_why(bound, known, given), ""
    return observed_or_why(bound, known, given), amplitudes_or_reason(bound, measure)


def _doubted(pair: Pair, reductions: Sequence[Reduction], examination: Examination) -> list[Reduction]:
    """Reductions of a pair with their doubts; without a number where these spoil it."""
    channels = {(c.sensor, c.component): c.channel for c in SIRun.of(pair.runs[0]).rig.base_columns}
    marked = [
        replace(r, doubts=tuple(sorted({*r.doubts, *examination.doubts(r.runs, channels[r.sensor, r.axis])})))
        for r in reductions
    ]
    return [
        replace(r, interval=None, method=None, uncertainty=None, synchronous_interval=None)
        if examination.withheld(r.doubts)
        else r
        for r in marked
    ]


def _conditions(
    found: Sequence[Pair], measure: Measure, findings: list[Finding], known: Mapping[int, AmplitudesOfRun | str]
) -> list[Condition]:
    """The pairs that can be analysed, a finding for each other one. Raises AnalysisError if none can."""
    conditions, lacks = [], []
    for pair in found:
        try:
            conditions.append(Condition.of(pair, measure, known))
        except AnalysisError as error:
            where = " ".join(run.name for run in pair.runs)
            lacks.append(Finding("not_analyzed", None, where, f"{pair.key}: {error}"))
    if not conditions:
        raise AnalysisError("\n".join(lack.message for lack in lacks))
    findings += lacks
    return conditions


def reduction_of_pair(pair: Pair, measure: Measure) -> list[Reduction]:
    """The reductions of one pair by itself, for each axis of each accelerometer on the base."""
    condition = Condition.of(pair, measure)
    judged = CampaignLikelihoods.of([condition])
    return judged.calibrated(condition)


@dataclass(frozen=True)
class CampaignLikelihoods:
    """The amplitudes of every condition and place of a campaign, in its noise."""

    noise: CampaignNoise
    groups: dict[tuple[int, Place], tuple[Group, Group] | None]
    """By condition and place."""
    repeats: dict[Place, Repeatability]

    means: dict[tuple[int, Place], tuple[Group | None, Group | None]]
    """Of the aligned repeats of each side, by condition and place."""

    @classmethod
    def of(cls, conditions: Sequence[Condition], pool: TaskPool = HERE) -> "CampaignLikelihoods":
        """Runs that are compared with several sets of counter-masses count once; place by place, for its noise.

        Of so many places as copies of this process share evenly each is one task, so that its noise is drawn once;
        the others are cut finer than that, so that all are done at about the same time.
        """
        found = cls(CampaignNoise.of(conditions, pool), {}, {}, {})
        once: dict[Place, dict[tuple[int, ...], Group]] = {}
        places = list(dict.fromkeys(place for condition in conditions for place in condition.places))
        some = {place: [condition for condition in conditions if place in condition.places] for place in places}
        shared = places[len(places) - len(places) % pool.processes :]
        cuts = {place: -(-len(some[place]) // (2 * pool.processes if place in shared else 1)) for place in places}
        each = [(p, some[p][i : i + cuts[p]]) for p in places for i in range(0, len(some[p]), cuts[p])]
        for (place, part), shown in zip(each, pool.map(found.noise.groups_and_means, each), strict=True):
            for condition, (both, means) in zip(part, shown, strict=True):
                found.groups[id(condition), place], found.means[id(condition), place] = both, means
                sides = zip((side.key for side in condition.sides), both or (), strict=False)
                once.setdefault(place, {}).update(sides)
        alike = found.noise.rounding_in_common
        return replace(found, repeats={p: Repeatability.of([*groups.values()], alike) for p, groups in once.items()})

    def reduction(self, condition: Condition, place: Place) -> Reduction:
        """Of one place of a condition, without what calibrations add."""
        return _at_most_if_endless(self._with_sides(condition, place)[0])

    def _with_sides(
        self, condition: Condition, place: Place
    ) -> tuple[Reduction, tuple[ConditionAmplitude, ConditionAmplitude] | None]:
        """The reduction and the amplitudes that its interval is of; None where nothing shows the noise."""
        pair, groups = condition.pair, self.groups[id(condition), place]
        if groups is None:
            return _reduction_without_noise(condition, place), None
        means = self.means[id(condition), place]
        sides = self._side(groups[0], means[0], place), self._side(groups[1], means[1], place)
        ratio, stated = Ratio(*sides), self.noise.is_stated(condition, place)
        interval = None if ratio.interval is None or stated else _percents(ratio.interval)
        below = ratio.defined and (ratio.below_noise or (id(condition), place) in self.noise.unfelt)
        if below and interval:
            interval = (interval[0], 100.0) if np.isfinite(interval[0]) else None
        nothing = interval is None and not stated
        together = [ConditionAmplitude(mean) for mean in means if mean]
        mean = Ratio(*together) if len(together) == len(means) else None
        found = Reduction(
            pair.key,
            pair.counter_masses,
            *place,
            condition.measure,
            None if ratio.value is None or nothing else _percent(ratio.value),
            _bounded(interval, sides),
            None if interval is None else "repeats" if self.noise.repeated(place) else "propagation",
            _limit(sides[0].saturated, sides[1].saturated, below),
            below,
            (sides[0].amplitude, sides[1].amplitude),
            (sides[0].floor, sides[1].floor),
            stated,
            condition.resolution(place),
            (len(pair.balanced), len(pair.unbalanced)),
            tuple(run.name for run in pair.runs),
            None if mean is None or mean.value is None else _percent(mean.value),
            None if mean is None or mean.interval is None or np.isinf(mean.interval[1]) else _percents(mean.interval),
            (together[0].amplitude, together[1].amplitude) if mean else (None, None),
        )
        return found, None if stated else sides

    def calibrated(self, condition: Condition) -> list[Reduction]:
        """Of all places, with what calibrations add to the interval, and what there is to say of the amplitudes."""
        return [self._judged(condition, place) for place in condition.places]

    def _judged(self, condition: Condition, place: Place) -> Reduction:
        """Of one place: doubtful where repeats of a side differ, without a number where no interval bounds it then."""
        found, sides = self._with_sides(condition, place)
        if sides is None:
            return found
        repeats, groups = self.repeats[place], self.groups[id(condition), place] or ()
        known = AmplitudesUncertainty.of(sides, condition.pair, place)
        one = found if any(map(repeats.withholds, groups)) else _calibrated(found, known)
        if not any(map(repeats.excludes, groups)):
            return one
        if one is found or one.interval is None:
            one = replace(found, interval=None, method=None, synchronous_interval=None)
        return replace(one, doubts=(REPEATS_DIFFER,))

    def _side(self, runs: Group, mean: Group | None, place: Place) -> ConditionAmplitude:
        """By the mean of the aligned repeats near the noise; far above it, or if they differ, by each of them."""
        repeats = self.repeats[place]
        if mean is None or repeats.share > 0.0 or repeats.excludes(runs) or runs.clear or runs.rounded > CLEAR:
            return ConditionAmplitude(runs, repeats)
        return ConditionAmplitude(mean)

    def scatter_findings(self, condition: Condition) -> list[Finding]:
        """A finding for each group of repeats that differ by more than noise, naming the one that differs most."""
        odd = [
            (place, group)
            for place in condition.places
            for group in self.groups[id(condition), place] or ()
            if self.repeats[place].excludes(group)
        ]
        return [
            Finding(
                REPEATS_DIFFER,
                None,
                where := " ".join(group.names),
                f"{condition.pair.key}, {sensor} along {axis}: repeats differ by more than their noise, most "
                f"{group.odd}: the interval is wider for it, or there is none; compare their logs, leave out what is "
                "not like the others; a mode of the floor as loud as the vibration does the same: name a --band "
                f"without it ({where})",
            )
            for (sensor, axis), group in odd
        ]


def _calibrated(found: Reduction, known: AmplitudesUncertainty) -> Reduction:
    interval = found.interval
    if interval is not None and found.percent is not None:
        interval = known.with_calibration(interval, found.percent)
    return _at_most_if_endless(replace(found, interval=interval, uncertainty=known))


def _at_most_if_endless(found: Reduction) -> Reduction:
    """The upper end of the interval alone, where the lower one says nothing; none where that is a bound.

    What vibrates without counter-masses is then so near the noise that its amplitude may be next to nothing.
    """
    if found.interval is None or found.percent is None:
        return found
    if 100.0 - found.interval[0] <= _ENDLESS * max(100.0, 100.0 - found.percent):
        return found
    if found.limit:  # a bound of what may be anything
        return replace(found, percent=None, interval=None, limit=None)
    return replace(found, percent=found.interval[1], interval=None, limit="at_most", below_noise=True)


def _reduction_without_noise(condition: Condition, place: Place) -> Reduction:
    """Of the readings, noise included: nothing shows the noise, or a channel is dead."""
    pair = condition.pair
    read = [[run[place].statistic.amplitude(run[place].reading) for run in side.records] for side in condition.sides]
    saturated = [any(run[place].saturated for run in side.records) for side in condition.sides]
    fell = None if condition.dead(place) else reduction_percent(read[0], read[1])
    return Reduction(
        pair.key, pair.counter_masses, *place, condition.measure, fell, None, None,
        _limit(saturated[0], saturated[1], False), False, (float(np.mean(read[0])), float(np.mean(read[1]))),
        (None, None), False, 0.0, (len(read[0]), len(read[1])), tuple(run.name for run in pair.runs),
    )  # fmt: skip


def _bounded(
    interval: tuple[float, float] | None, sides: tuple[ConditionAmplitude, ConditionAmplitude]
) -> tuple[float, float] | None:
    """The interval with its upper end open if the sensor clipped without counter-masses; none if it did with them."""
    if interval is None or sides[0].saturated:
        return None
    return (interval[0], 100.0) if sides[1].saturated else interval


def _limit(balanced_saturated: bool, unbalanced_saturated: bool, below_noise: bool) -> Limit | None:
    if balanced_saturated:
        return None if unbalanced_saturated else "at_most"
    return "at_least" if unbalanced_saturated or below_noise else None


def _percents(ratios: tuple[float, float]) -> tuple[float, float]:
    return _percent(ratios[1]), _percent(ratios[0])


def _percent(ratio: float) -> float:
    return 100.0 * (1.0 - ratio)


def reduction_percent(balanced: Sequence[float], unbalanced: Sequence[float]) -> float | None:
    """Reduction of amplitudes [%], of means where there are several; None where one without is zero."""
    return None if min(unbalanced) <= 0.0 else _percent(float(np.mean(balanced)) / float(np.mean(unbalanced)))


def reduction_findings(condition: Condition, found: Sequence[Reduction]) -> list[Finding]:
    """Findings about the reductions of a pair that have no value, no interval, or only a bound."""
    pair, dead = condition.pair, {place for place in condition.places if condition.dead(place)}
    where = " ".join(run.name for run in pair.runs)
    alive = [r for r in found if (r.sensor, r.axis) not in dead]
    without = [r for r in alive if r.percent is None and REPEATS_DIFFER not in r.doubts]  # which says why
    alone, repeated = ([r for r in without if (r.n[1] > 1) is several] for several in (False, True))
    remedy = "compare the logs of the repeats, repeat the runs, or name a --band without the noise"
    if repeated and not condition.timed:
        remedy = (
            "nothing tells on the accelerometers' clock when they move (no command or encoder, and no trigger or "
            "alignment that relates one), so that they are aligned by what they show alone, if at all: record a "
            "trigger on both loggers, or see testbench align"
        )
    kinds = [
        (
            "dead_channel",
            [r for r in found if (r.sensor, r.axis) in dead],
            "the channel shows one value only in a run: there is no reduction",
        ),
        (
            "vibrates_more",
            [r for r in alive if (r.percent or 0.0) < 0.0 and _is_rise(r)],
            "it vibrates more with counter-masses than without: check that the run table does not exchange the runs",
        ),
        (
            "below_noise",
            [r for r in found if r.below_noise and r.kind == "at_least"],
            "the residual vibration with counter-masses is not above the noise: the reductions are lower bounds",
        ),
        (
            "below_noise",
            [r for r in found if r.below_noise and r.kind == "at_most"],
            "the vibration without counter-masses is hardly above the noise: the reductions are upper bounds; name a "
            "--band without the noise, or repeat the runs",
        ),
        (
            "no_reduction",
            alone,
            "nothing vibrates above the noise without counter-masses: there is no reduction",
        ),
        (
            "no_reduction",
            repeated,
            "what the repeats without counter-masses share is not above the noise (rests, and what they do not share): "
            f"there is no reduction; {remedy}",
        ),
        (
            "noise_stated",
            [r for r in found if r.noise_stated],
            "nothing recorded shows the noise, at rest and in motion: that which the rig states is subtracted, and "
            "there is no interval; log half a second of rest before the motion, or repeat the runs",
        ),
        (
            "no_noise_floor",
            [r for r in alive if None in r.noise_floor],
            "no rest before the motion is long enough to show the noise, no run is repeated, and the rig states none: "
            "the amplitudes contain it, so that a reduction may be one of noise; log half a second of rest, or repeat "
            "the runs",
        ),
    ]
    return [
        Finding(code, None, where, f"{pair.key}, {sensor} along {', '.join(axes)}: {meaning} ({where})")
        for code, some, meaning in kinds
        for sensor in dict.fromkeys(r.sensor for r in some)
        if (axes := [r.axis for r in some if r.sensor == sensor])
    ]


def _is_rise(one: Reduction) -> bool:
    """Whether all of an interval is below zero; of a bound, or of a reduction that is withheld, its value tells."""
    return one.interval[1] < 0.0 if one.interval else one.limit is not None or one.kind == "withheld"


def sets_differ(reductions: Sequence[Reduction]) -> bool:
    """Whether a condition has several sets of counter-masses."""
    sets: dict[ConditionKey, list[dict[str, float]]] = {}
    for one in reductions:
        sets.setdefault(one.key, []).append(one.counter_masses)
    return any(masses != some[0] for some in sets.values() for masses in some)


def _change(values: Sequence[float]) -> str:
    """``reduced by 1.0 to 2.0 %``, ``raised by`` where the vibration grows, both where it does either."""
    low, high = min(values), max(values)
    if low < 0.0 <= high:
        return f"between raised by {-low:.1f} % and reduced by {high:.1f} %"
    word = "reduced" if low >= 0.0 else "raised"
    least, most = sorted((abs(low), abs(high)))
    return f"{word} by {least:.1f} to {most:.1f} %" if len(values) > 1 else f"{word} by {least:.1f} %"


def upper_bound(percent: float) -> str:
    """``reduced by at most 19.7 %``, ``raised by at least`` where it is below zero."""
    return f"reduced by at most {percent:.1f} %" if percent >= 0.0 else f"raised by at least {-percent:.1f} %"


def verdict(reductions: Sequence[Reduction], examination: Examination | None = None) -> str:
    """By how much each axis is reduced or raised, how many reductions are bounds, withheld, or none, and which runs of
    the others something contradicts by the ``examination`` that nobody accepted.
    """
    kinds = {kind: [r for r in reductions if r.kind == kind] for kind in ("number", "at_least", "at_most", "withheld")}
    sound, bounds, upper, withheld = kinds.values()
    upper = [r for r in upper if r.percent is not None]
    several = len({r.sensor for r in reductions}) > 1
    parts = []
    for place in dict.fromkeys((r.sensor, r.axis) for r in (*sound, *bounds, *upper[: len(upper) == 1])):
        numbers, least, most = ([r for r in some if (r.sensor, r.axis) == place] for some in (sound, bounds, upper))
        said = [_number(numbers)] if numbers else []
        said += _lower_bounds(least, bool(numbers))
        if most and len(upper) == 1:
            why = (
                "hardly above the noise without counter-masses"
                if most[0].below_noise
                else "clipped with counter-masses"
            )
            said.append(f"{upper_bound(most[0].percent or 0.0)} ({why})")
        parts.append(f"{f'{place[0]} ' if several else ''}{place[1]}: {', '.join(said)}")
    of_all = f"of {len(reductions)} reductions"
    counted = ((bounds, "lower bounds, below noise or clipped"), (upper, "upper bounds, near noise or clipped"))
    counts = [f"{len(some)} {of_all} are {name}" for some, name in counted if len(some) > 1]
    if withheld:
        codes = ", ".join(sorted({code for r in withheld for code in r.doubts} & WITHHELD))
        counts.append(f"{len(withheld)} {of_all} are withheld for {codes}: see the findings")
    if differ := [r for r in reductions if REPEATS_DIFFER in r.doubts and r.kind != "withheld"]:
        counts.append(f"{len(differ)} {of_all} are doubtful for {REPEATS_DIFFER}: see the findings")
    others = len(reductions) - len(sound) - len(bounds) - len(upper) - len(withheld)
    counts += [f"{others} {of_all} have no interval"] if others else []
    if examination:
        numbers = [r for r in reductions if r.kind != "withheld"]
        marked = dict.fromkeys(
            (s.code, s.run)
            for s in examination.contradictions
            if s.code not in examination.accepted and any(s.code in r.doubts and s.run in r.runs for r in numbers)
        )
        for code in dict.fromkeys(code for code, _ in marked):
            counts.append(f"{first_of((run for one, run in marked if one == code), 4)} doubtful: {code}")
    return "; ".join([*parts, *counts] or ["no reduction"]) + "."


def _number(some: Sequence[Reduction]) -> str:
    """The reductions of a place, with the lowest and the highest end of their intervals."""
    values = [r.percent for r in some if r.percent is not None]
    ends = [end for r in some for end in r.interval or ()]
    ends = ends if max(values) >= 0.0 else [-end for end in ends]
    between = f"{_change(values)} [{min(ends):.1f}, {max(ends):.1f}]"
    return f"{between} in {len(some)} conditions" if len(some) > 1 else between


def _lower_bounds(some: Sequence[Reduction], more: bool) -> list[str]:
    """What the lower bounds of a place are, ``more`` than numbers of it; how many tell nothing."""
    bounds = sorted((r.at_least or 0.0, r.below_noise) for r in some)
    tells = 0.0 if bounds and bounds[-1][0] >= 0.0 else -_TELLS
    telling = [(bound, noisy) for bound, noisy in bounds if bound >= tells or not noisy]
    rises = [one for one in telling if one[0] < 0.0]
    said = []
    for ones in (telling[len(rises) :], rises):
        if not ones:
            continue
        why = "residual below noise" if ones[0][1] else "clipped without counter-masses"
        size = _change([bound for bound, _ in ones]).replace(" by ", " by at least ")
        size = f"not raised by more than {-ones[0][0]:.1f} %" if ones is rises else size
        size = f"at least {ones[0][0]:.1f} %" if more and ones is not rises else size
        said.append(f"{size} in {len(ones)} conditions" if len(ones) > 1 and not more else f"{size} ({why})")
    if hidden := len(some) - len(telling):
        said.append(f"the noise hides whether it fell or rose in {hidden} condition{'s' * (hidden > 1)}")
    return said
