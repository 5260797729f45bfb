"""The amplitudes of one condition, with and without counter-masses, each from one run or from repeats.

How sure a mean of repeats is follows from the noise of the campaign, rests and what does not repeat taken together
(``CampaignNoise``), and from what the repeats differ by beyond it (``repeatability``).
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import student_quantile
from balance.task_pool import HERE, TaskPool

from ..errors import AnalysisError
from ..recording import Finding
from ..runs.si_run import SIRun
from .amplitude import Amplitude, MetricStatistic, Place
from .amplitude_likelihood import AmplitudeLikelihood
from .metrics import Measure
from .noise_floor import Noise, Segment
from .noise_in_motion import LOUDER, exceeds_rest, noise_in_motion
from .noise_over_time import NoiseOverTime
from .repeatability import Group, Repeatability, Synchronous, gain_error, unlike
from .run_amplitudes import AmplitudesOfRun, amplitudes_of_run, amplitudes_or_reason
from .run_pairs import Pair
from .tonal_lines import SHORTEST_S

if TYPE_CHECKING:
    from ..signal.filters import Band
    from ..store import Run

FAR = 10.0
"""Distance from zero from which the bound at zero has no effect [standard deviations]."""
_REACH = 5.0
"""Half width of the grid of amplitudes [standard deviations]."""
_STEEP = 25.0
"""Largest half width of the grid of amplitudes [natural logarithm]."""
_FINE = 401
"""Points of the grid of amplitudes."""
_TOGGLES = 0.04
"""Of a rest [steps], from which it toggles: one of a thousand samples lies beyond three standard deviations."""


@dataclass(frozen=True)
class ConditionAmplitude:
    """One run, or repeats; deviations are in standard deviations of one run's noise."""

    group: Group
    repeats: Repeatability = field(default_factory=Repeatability)

    @property
    def runs(self) -> tuple[AmplitudeLikelihood, ...]:
        """One run, or its repeats."""
        return self.group.runs

    @property
    def saturated(self) -> bool:
        """Whether the sensor reached the end of its range in any run."""
        return any(run.saturated for run in self.runs)

    @property
    def statistic(self) -> MetricStatistic:
        """What is read of each run."""
        return self.runs[0].statistic

    @cached_property
    def floor(self) -> float:
        """What the metric would read of noise alone [unit]."""
        return self.statistic.amplitude(float(np.mean([run.floor for run in self.runs])))

    @property
    def amplitude(self) -> float:
        """Of the group [unit]."""
        return self.group.amplitude

    def deviation(self, amplitude: Floats) -> Floats:
        """The mean reading less what each amplitude (k,) [unit] would read, (k,) [standard deviations]."""
        each = zip(self.runs, self.group.shares, strict=True)
        return np.asarray(sum(run.deviation(amplitude * share) for run, share in each) / (len(self.runs) * self._error))

    def distance(self, amplitude: Floats) -> Floats:
        """What each amplitude (k,) [unit] reads above zero amplitude, at most FAR, (k,) [standard deviations]."""
        each = zip(self.runs, self.group.shares, strict=True)
        risen = np.asarray(sum(run.distance(amplitude * share) for run, share in each)) / len(self.runs)
        return np.clip(risen / self._error, 0.0, FAR)

    @cached_property
    def amplitudes(self) -> Floats:
        """Grid around the amplitude, (k,) [unit]: even in the logarithm far above the noise."""
        tables = np.array([run.amplitudes[[0, -1]] for run in self.runs])
        scale = float(np.mean([run.noise_scale for run in self.runs]))
        reach = max(_REACH, 1.5 * student_quantile(0.9975, self.degrees_of_freedom)) * self._error
        around = min(0.25 * reach * scale / float(np.hypot(self.amplitude, scale)), _STEEP) * np.array([-1.0, 1.0])
        low, high = np.maximum(np.arcsinh(self.amplitude / scale) + around, 0.0)
        low, high = min(low, np.arcsinh(tables[:, 0].min() / scale)), max(high, np.arcsinh(tables[:, 1].max() / scale))
        return scale * np.sinh(np.linspace(low, high, _FINE))

    @property
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom of the variance."""
        return self.repeats.degrees_of_freedom_of(self.group)

    @cached_property
    def _error(self) -> float:
        """Standard deviation of the mean deviation."""
        return float(self.repeats.variance(self.group) ** 0.5)


def pooled_degrees_of_freedom(sides: Sequence[ConditionAmplitude], shares: Sequence[float]) -> float:
    """Degrees of freedom of a variance to which each side contributes its share [-].

    Welch and Satterthwaite (JCGM 100:2008, G.4); a pooled share of the amplitude is common to all sides.
    """
    if sides[0].repeats.share > 0.0:
        return max(sides[0].degrees_of_freedom, 1.0)
    doubt = sum(share**2 / side.degrees_of_freedom for side, share in zip(sides, shares, strict=True))
    return max(1.0 / doubt, 1.0) if doubt > 0.0 else np.inf


EQUAL_DURATION = 0.9
"""Share of the longest record of a condition from which the others count as equally long."""


@dataclass(frozen=True)
class Side:
    """Repeats of a condition, with counter-masses or without."""

    stored: tuple["Run", ...]
    records: tuple[AmplitudesOfRun, ...]

    @property
    def key(self) -> tuple[int, ...]:
        """The same for runs that are compared with several sets of counter-masses."""
        return tuple(map(id, self.stored))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the runs."""
        return tuple(run.name for run in self.stored)


@dataclass(frozen=True)
class Condition:
    """A pair and the records of its runs, resampled to what the band needs."""

    pair: Pair
    measure: Measure
    balanced: tuple[AmplitudesOfRun, ...]
    unbalanced: tuple[AmplitudesOfRun, ...]
    findings: tuple[Finding, ...] = ()
    """Runs that are left out, sensors that failed in a run, records of unequal length."""
    doubts: tuple[Finding, ...] = ()
    """Findings of ingest about the accelerometers on the base."""

    @property
    def timed(self) -> bool:
        """Whether command or encoders tell on the accelerometers' clock when any run without counter-masses moves."""
        return all(one.timed for run in self.unbalanced for one in run.values())

    @classmethod
    def of(
        cls, pair: Pair, measure: Measure, known: Mapping[int, AmplitudesOfRun | str] = MappingProxyType({})
    ) -> "Condition":
        """From every run of a pair that can be read; what is ``known`` of a run, or why nothing is, is not read again.

        Raises AnalysisError where no run with, or none without counter-masses can be read, or where their rigs differ
        in the accelerometers on the base.
        """
        pair, found, unread, doubts = _readable(pair, measure, known)
        for run, some in zip(pair.runs, found, strict=True):
            if some.keys() != found[0].keys():
                raise AnalysisError(
                    f"{run.name}: its rig has other accelerometers on the base than that of {pair.runs[0].name}: "
                    "ingest both with one rig"
                )
        count = len(pair.balanced)
        problems = (*unread, *_failed(pair, found), *unequal_durations(pair, found))
        return cls(pair, measure, tuple(found[:count]), tuple(found[count:]), problems, tuple(doubts))

    @property
    def places(self) -> tuple[Place, ...]:
        """Sensors and axes."""
        return tuple(self.balanced[0])

    @property
    def runs(self) -> tuple[AmplitudesOfRun, ...]:
        """In the order of the pair's."""
        return (*self.balanced, *self.unbalanced)

    @property
    def sides(self) -> "tuple[Side, Side]":
        """Runs with counter-masses, and without."""
        return Side(self.pair.balanced, self.balanced), Side(self.pair.unbalanced, self.unbalanced)

    def dead(self, place: Place) -> bool:
        """Whether the channel shows one value only in a run."""
        return any(run[place].dead for run in self.runs)

    def resolution(self, place: Place) -> float:
        """Step of the channel [m/s2]; zero where none is known."""
        return max(run[place].step for run in self.runs)


@dataclass
class _Shown:
    """What runs with one setting of the logger show of the noise of a place."""

    least: float = 0.0
    """Density below which none is [unit^2/Hz]."""
    rests: list[Segment] = field(default_factory=list)
    residuals: list[Segment] = field(default_factory=list)
    """What does not repeat."""
    rounded: list[Segment] = field(default_factory=list)
    """What steps that no noise dithers add to it."""
    unsure: list[Segment] = field(default_factory=list)
    """What the lines of the mains may be wrong by that were taken out."""
    undithered: list[Amplitude] = field(default_factory=list)

    def add(self, one: Amplitude, repeated: bool) -> None:
        """Take in a run; ``repeated``: it is among aligned repeats."""
        self.least = max(self.least, one.hidden_density)
        if one.resting is not None and not one.dead:
            self.rests.append(one.resting)
            self.undithered += [one] if one.rounded is not None else []
        if repeated:
            self.rounded += [one.rounded] if one.rounded is not None else []
            self.unsure += one.unsure_lines

    def noise(self, band: "Band | None") -> tuple[Noise | None, bool]:
        """The noise of rests and of what does not repeat; of the latter alone where that is louder, and whether it is.

        What does not repeat shows steps that no noise dithers too, which have an error of their own: it is louder only
        if it is so than rests and ``rounded`` together, and then what these add is taken off; else rests alone show
        the noise. It shows too by how much the lines of the mains were wrong that were taken out, of which records are
        drawn by themselves: what the ``unsure`` lines may be wrong by is taken off first.
        """
        least, rests = self.least, self.rests
        hidden = bool(rests) and len(self.undithered) == len(rests)
        if hidden and all(one.toggles is not None for one in self.undithered):
            least, rests = noise_behind_steps(self.undithered)
        longest = max((len(one.values) for one in (*rests, *self.residuals) if one.usable), default=0)
        shown = (rests, self.residuals, self.rounded, self.unsure)
        at_rest, moving, steps, lines = (Noise.of(some, least, longest) for some in shown)
        if moving is not None and lines is not None:
            moving = moving.without_lines(lines)
        if moving is None or (steps is None and at_rest is None):
            return at_rest or moving, False
        if steps is None:
            louder = at_rest is not None and moving.exceeds(at_rest, band)
            if louder:
                return moving, True
            both = Noise.of([*rests, *self.residuals], least)
            return both.without_lines(lines) if both and lines else both, False
        quiet = at_rest or replace(moving, density=np.full_like(moving.density, least))
        louder = moving.exceeds(steps.plus(quiet), band)
        return moving.without(steps, quiet) if louder else quiet, louder


@dataclass(frozen=True)
class CampaignNoise:
    """The noise of every channel, and the repeats of every side, of a campaign."""

    noises: dict[tuple[Place, int], Noise | None]
    """By place and rate [Hz]."""
    in_motion: dict[Place, bool]
    """Whether what does not repeat shows more noise in motion than the rests do."""
    aligned: dict[tuple[int, ...], Synchronous | None]
    """By the side's key."""
    unrepeated: dict[tuple[int, Place], tuple[Noise, NoiseOverTime] | None] = field(default_factory=dict)
    """Louder noise in motion by condition and place, and how it goes over the time of the run with counter-masses, of
    channels of which nothing is repeated; None where no run can tell whether there is any.
    """
    unfelt: set[tuple[int, Place]] = field(default_factory=set)
    """Conditions and places where it is not known when the side with counter-masses moves, nothing is repeated, and it
    shows more than the noise at rest: vibration, or noise in motion.
    """
    rounding_in_common: float = 1.0
    """Share of what steps add that repeats have in common, where noise does not dither them [-]: whether the zero of a
    converter lies at the same place within a step in all runs.
    """

    @classmethod
    def of(cls, conditions: Iterable[Condition], pool: TaskPool = HERE) -> "CampaignNoise":
        """Pooled over all runs with one setting of the logger.

        What differs between repeats that are :func:`unlike` is no noise, unless there are no other repeats.
        """
        conditions = list(conditions)
        sides = {side.key: side for condition in conditions for side in condition.sides}
        aligned = dict(zip(sides, pool.map(Synchronous.of, [s.records for s in sides.values()]), strict=True))
        odd = unlike([*aligned.values()])
        sure = {key: both for (key, both), one in zip(aligned.items(), odd, strict=True) if not one}
        sure = sure if any(sure.values()) else aligned
        shown: dict[tuple[Place, int], _Shown] = defaultdict(_Shown)
        for name, side in sides.items():
            both = sure.get(name)
            for place, one in (item for record in side.records for item in record.items()):
                shown[place, round(one.rate_hz)].add(one, repeated=both is not None)
            for place, some in (both.places if both else {}).items():
                shown[place, round(some.mean.rate_hz)].residuals += some.residuals
        noises: dict[tuple[Place, int], Noise | None] = {}
        in_motion: dict[Place, bool] = {}
        band = conditions[0].measure.band if conditions else None
        for key, (noise, louder) in zip(
            shown, pool.map(partial(_Shown.noise, band=band), [*shown.values()]), strict=True
        ):
            noises[key], in_motion[key[0]] = noise, louder or in_motion.get(key[0], False)
        found = cls(noises, in_motion, aligned, rounding_in_common=rounding_in_common(aligned.values()))
        for condition in conditions:
            for place in (place for place in condition.places if not found.repeated(place)):
                one, axes = condition.balanced[0][place], [other for other in condition.places if other[0] == place[0]]
                at_rest = noises[place, round(one.rate_hz)]
                if at_rest is None or condition.dead(place):
                    continue
                others = [condition.unbalanced[0][axis] for axis in axes if not condition.dead(axis)]
                steps = Noise.of([one.rounded] if one.rounded else [], one.hidden_density)
                known = steps.plus(at_rest) if steps else at_rest
                if one.moving is None and others and others[0].moving is not None:
                    if exceeds_rest(known, one, others[0].moving.stop - others[0].moving.start):
                        found.unfelt.add((id(condition), place))
                    continue
                beyond = noise_in_motion(known, one, others)
                if beyond is None or beyond[0].power(band)[0] > LOUDER * known.power(band)[0]:
                    if beyond and steps:
                        beyond = beyond[0].without(steps, at_rest), beyond[1]
                    found.unrepeated[id(condition), place] = beyond
        return found

    def noise(self, condition: Condition, one: Amplitude, place: Place) -> Noise | None:
        """Of a channel in a run, by what was recorded, else as the rig states; None where neither is."""
        key = id(condition), place
        if key in self.unrepeated:
            return louder[0] if (louder := self.unrepeated[key]) else one.stated
        return self.noises[place, round(one.rate_hz)] or one.stated

    def is_stated(self, condition: Condition, place: Place) -> bool:
        """Whether the noise of a run is known from the rig alone."""
        return any(self.noise(condition, run[place], place) in (None, run[place].stated) for run in condition.runs)

    def repeated(self, place: Place) -> bool:
        """Whether repeats of the campaign show the noise."""
        return any(both is not None and place in both.places for both in self.aligned.values())

    def groups_and_means(
        self, of: tuple[Place, Sequence[Condition]]
    ) -> list[tuple[tuple[Group, Group] | None, tuple[Group | None, Group | None]]]:
        """:meth:`groups` of a place, and the :meth:`mean` of each side, for each condition."""
        place, found = of[0], []
        for condition in of[1]:
            both, (balanced, unbalanced) = self.groups(condition, place), condition.sides
            one, other = (self.mean(condition, place, side) if both else None for side in (balanced, unbalanced))
            found.append((both, (one, other)))
        return found

    def groups(self, condition: Condition, place: Place) -> tuple[Group, Group] | None:
        """Repeats with and without counter-masses; None where the noise is unknown, or nothing was read."""
        found = []
        for side in condition.sides:
            lags = both.lags if (both := self.aligned[side.key]) else (0.0,) * len(side.records)
            rounding = tuple(error for run in side.records for error in run[place].rounding)
            some = [
                (replace(self.in_envelope(condition, place, run[place], lag), rounding=rounding), noise)
                for run, lag in zip(side.records, lags, strict=True)
                for noise in [self.noise(condition, run[place], place)]
            ]
            if condition.dead(place) or any(noise is None or one.reading <= 0.0 for one, noise in some):
                return None
            likelihoods = tuple(AmplitudeLikelihood.of(one, noise) for one, noise in some if noise)
            one = Group(likelihoods, side.names)
            if both and (noise := some[0][1]):
                together = both.places[place]
                mean = self.in_envelope(condition, place, together.mean)
                one = replace(one, gains=together.gains, gain_error=gain_error(mean, together.weights, noise))
            found.append(one)
        return found[0], found[1]

    def mean(self, condition: Condition, place: Place, side: Side) -> Group | None:
        """The mean of the aligned repeats of a side; None without repeats."""
        both = self.aligned[side.key]
        if both is None or condition.dead(place):
            return None
        one = self.in_envelope(condition, place, both.places[place].mean)
        noise = self.noise(condition, one, place)
        if noise is None or noise is one.stated or one.reading <= 0.0:
            return None
        return Group((AmplitudeLikelihood.of(one, noise),), side.names)

    def in_envelope(self, condition: Condition, place: Place, one: Amplitude, lag: float = 0.0) -> Amplitude:
        """A record with the course of its noise over time, where noise acts in motion: that of its own repeats, and
        that of the condition's other side, from the beginning of the motion on.
        """
        shown: list[tuple[NoiseOverTime, float]] = []
        louder = self.unrepeated.get((id(condition), place))
        if louder and one.moving:
            shown.append((louder[1], float(one.moving.start - louder[1].moving.start)))
        for side in condition.sides if self.in_motion[place] else ():
            both, first = self.aligned[side.key], side.records[0][place]
            if both is None:
                continue
            own = one is both.places[place].mean or any(one is run[place] for run in side.records)
            if own:
                shown.append((both.places[place].over_time, lag))
            elif one.moving and first.moving:
                shown.append((both.places[place].over_time, float(one.moving.start - first.moving.start)))
        moving = one.moving or slice(0, len(one.course))
        return replace(one, over_time=NoiseOverTime.pooled(shown, len(one.course), moving)) if shown else one


def rounding_in_common(aligned: Iterable[Synchronous | None]) -> float:
    """Share of what steps add that aligned repeats have in common, by what they do not share on plateaus, where noise
    counts as that. All of it where nothing tells: whether the zeros of a converter are one is one fact of a campaign.
    """
    shown = [
        (*one.plateaus, len(both.lags) - 1)
        for both in filter(None, aligned)
        for one in both.places.values()
        if one.plateaus
    ]
    freedom = sum(count for _, steps, count in shown if steps > 0.0)
    own = sum(min(left / steps, 1.0) * count for left, steps, count in shown if steps > 0.0)
    return 1.0 - own / freedom if freedom else 1.0


def noise_behind_steps(runs: Sequence[Amplitude]) -> tuple[float, list[Segment]]:
    """Density [unit^2/Hz] of white noise that does not dither the steps of a channel, by rests on one value or two next
    to each other, and these rests with the power of that noise, whose spectrum they show.

    How often such a rest toggles tells where the converter's zero lies, not how large the noise is: its standard
    deviation is up to half a step for any noise. It does so where a threshold is within three standard deviations of
    the noise. Of zeros that lie anywhere within a step that is a share of six standard deviations, of which as many
    rests as toggle tell by Laplace's rule of succession; if all do, it may be up to two, with more than two values
    beyond.
    """
    count, toggling = len(runs), sum((one.toggles or 0.0) > _TOGGLES for one in runs)
    square = (toggling + 1.0) * (toggling + 2.0) / ((count + 2.0) * (count + 3.0))
    square += 2.0 / (count + 2.0) * (toggling == count)
    deviation = max(one.step for one in runs) * square**0.5 / 6.0
    rests = [
        replace(rest, values=rest.values * deviation / (one.toggles * one.step))
        if one.toggles and one.toggles > _TOGGLES
        else rest
        for one in runs
        if (rest := one.resting)
    ]
    return 2.0 * deviation**2 / max(one.logger_hz for one in runs), rests


def _readable(
    pair: Pair, measure: Measure, known: Mapping[int, AmplitudesOfRun | str]
) -> tuple[Pair, list[AmplitudesOfRun], list[Finding], list[Finding]]:
    """The readable runs as a pair, their amplitudes, findings why others cannot be read, doubts about the readable."""
    records: list[AmplitudesOfRun] = []
    unread: list[Finding] = []
    doubts: list[Finding] = []
    errors: list[str] = []
    sides: list[tuple[Run, ...]] = []
    for side in (pair.balanced, pair.unbalanced):
        read = []
        for run in side:
            found = known[id(run)] if id(run) in known else amplitudes_or_reason(run, measure)
            if isinstance(found, str):
                errors.append(found)
                unread.append(Finding("not_analyzed", None, run.name, f"{found}; the run is left out"))
                continue
            records.append(found)
            si = SIRun.of(run)
            doubts += si.doubts(si.rig.base_columns)
            read.append(run)
        sides.append(tuple(read))
    if not all(sides):
        raise AnalysisError("; ".join(dict.fromkeys(errors)))
    mains = {place for record in records for place, one in record.items() if one.line_errors is not None}
    for i, run in enumerate((*sides[0], *sides[1]) if mains else ()):
        lacking = [one for place, one in records[i].items() if place in mains and one.line_errors is None]
        if any(one.resting is None or one.resting.seconds < SHORTEST_S for one in lacking):
            records[i] = amplitudes_of_run(SIRun.of(run), measure, mains)
    return replace(pair, balanced=sides[0], unbalanced=sides[1]), records, unread, doubts


def _failed(pair: Pair, found: list[dict[Place, Amplitude]]) -> list[Finding]:
    """Sensors that failed in a run, as its record shows."""
    return [
        Finding(code, None, run.name, f"{run.name}: {sensor} along {axis}: {message}")
        for run, places in zip(pair.runs, found, strict=True)
        for (sensor, axis), one in places.items()
        for code, message in one.faults
    ]


def unequal_durations(pair: Pair, found: list[dict[Place, Amplitude]]) -> list[Finding]:
    """A finding if runs were not recorded equally long: a peak may lie outside, an RMS averages over the record."""
    lengths = [min(one.seconds for one in places.values()) for places in found]
    (short, brief), (long, name) = ((end(lengths), pair.runs[lengths.index(end(lengths))].name) for end in (min, max))
    if short >= EQUAL_DURATION * long:
        return []
    message = (
        f"{pair.key}: the base was recorded for {short:.3f} s in {brief}, for {long:.3f} s in {name}: "
        "a part of the motion, or an RMS over more rest, is compared with another; cut the logs alike or leave one out"
    )
    return [Finding("durations_differ", None, f"{brief} {name}", message)]
