"""The amplitudes of one condition, with and without counter-masses, each from one run or from repeats.

How sure a mean of repeats is follows from the scatter of all repeats of the campaign (``repeatability``), from the
condition's own repeats where their noise is unknown or they do not fit the others, else from the noise of its run.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.estimation.estimate import student_quantile

from ..errors import AnalysisError
from ..quality.clipping import is_dead
from ..recording import Finding
from ..runs.si_run import SIRun
from .amplitude import Amplitude, MetricStatistic, Place, amplitudes_of_run
from .amplitude_likelihood import AmplitudeLikelihood
from .metrics import Measure
from .repeatability import Group, Repeatability
from .run_pairs import Pair

if TYPE_CHECKING:
    from ..store import Run

FAR = 10.0
"""Distance from zero from which the bound at zero has no effect [standard deviations]."""
_REACH = 5.0
"""Half width of the grid of amplitudes [standard deviations]."""
_STEEP = 25.0
"""Largest half width of the grid of amplitudes [natural logarithm]."""
_FINE = 401
"""Points of the grid of amplitudes."""


@dataclass(frozen=True)
class ConditionAmplitude:
    """One run, or n repeats, whose mean deviation has the variance v / n.

    Without ``repeats`` v is 1, since deviations are in standard deviations of one run's noise. With them v is pooled
    over the campaign; with ``own_scatter`` it is that of these repeats alone.
    """

    group: Group
    repeats: Repeatability | None = None
    own_scatter: bool = False
    """Whether these repeats alone give the variance: their noise is unknown, or they are outlying."""

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
    def floor(self) -> float | None:
        """What the metric would read of noise alone [unit]; None where the noise of a run is unknown."""
        known = [run.floor for run in self.runs if run.floor is not None]
        return self.statistic.amplitude(float(np.mean(known))) if len(known) == len(self.runs) else None

    @property
    def amplitude(self) -> float:
        """The amplitude whose expected reading is the mean reading; zero where noise alone reads as much [unit]."""
        return self.group.amplitude

    def deviation(self, amplitude: Floats) -> Floats:
        """The mean reading less what each amplitude (k,) [unit] would read, (k,) [standard deviations]."""
        return self.group.deviations(amplitude).mean(axis=0) / self._error

    def distance(self, amplitude: Floats) -> Floats:
        """What each amplitude (k,) [unit] reads above zero amplitude, at most FAR, (k,) [standard deviations]."""
        risen = np.mean([run.distance(amplitude) for run in self.runs], axis=0)
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
        return pooled_degrees_of_freedom((self,), (1.0,))

    @cached_property
    def variance(self) -> float:
        """Variance of one reading [in variances of its noise]."""
        if self.own_scatter:
            return self.group.variance
        return 1.0 if self.repeats is None else self.repeats.variance(self.group.signal_to_noise)

    @property
    def relative_sensitivity(self) -> Floats:
        """Derivative of the logarithm of the variance by each pooled component, (2,) [-]."""
        pooled = self.repeats is not None and not self.own_scatter
        return np.array([1.0, self.group.signal_to_noise**2]) / self.variance if pooled else np.zeros(2)

    @property
    def own_degrees_of_freedom(self) -> float:
        """Degrees of freedom of a variance that is not pooled; infinite for one that is."""
        return self.group.degrees_of_freedom if self.own_scatter else np.inf

    @property
    def _error(self) -> float:
        """Standard deviation of the mean deviation."""
        return float((self.variance / len(self.runs)) ** 0.5)


def pooled_degrees_of_freedom(sides: Sequence[ConditionAmplitude], shares: Sequence[float]) -> float:
    """Degrees of freedom of a variance to which each side contributes its share [-].

    Welch and Satterthwaite (JCGM 100:2008, G.4); the pooled components are common to all sides.
    """
    repeats = sides[0].repeats
    pooled = np.sum([share * side.relative_sensitivity for side, share in zip(sides, shares, strict=True)], axis=0)
    doubt = sum(2.0 * share**2 / side.own_degrees_of_freedom for side, share in zip(sides, shares, strict=True))
    doubt += 0.0 if repeats is None else float(pooled @ repeats.covariance @ pooled)
    return max(2.0 / doubt, 1.0) if doubt > 0.0 else np.inf


EQUAL_DURATION = 0.9
"""Share of the longest record of a condition from which the others count as equally long."""
RepeatabilityByPlace = dict[Place, Repeatability | None]
"""Scatter of a campaign's repeats; None where there are too few."""


@dataclass(frozen=True)
class Condition:
    """A pair and the likelihood of each run's amplitude; it does not keep the records."""

    pair: Pair
    measure: Measure
    groups: dict[Place, tuple[Group, Group]]
    """Repeats with and without counter-masses."""
    noise_stated: dict[Place, bool]
    """Whether the noise of any run is the one that the rig states."""
    resolution: dict[Place, float]
    """Step of the channel [m/s2]; zero where none is known."""
    dead: dict[Place, tuple[str, ...]] = field(default_factory=dict)
    """Runs in which the channel shows one value only."""
    findings: tuple[Finding, ...] = ()
    """Runs that are left out, sensors that failed in a run, records of unequal length."""
    doubts: tuple[Finding, ...] = ()
    """Findings of ingest about the accelerometers on the base."""

    @classmethod
    def of(cls, pair: Pair, measure: Measure) -> "Condition":
        """From every run of a pair that can be read.

        Raises AnalysisError where no run with, or none without counter-masses can be read, or where their rigs differ
        in the accelerometers on the base.
        """
        pair, found, unread, doubts = _readable(pair, measure)
        for run, some in zip(pair.runs, found, strict=True):
            if some.keys() != found[0].keys():
                raise AnalysisError(
                    f"{run.name}: its rig has other accelerometers on the base than that of {pair.runs[0].name}: "
                    "ingest both with one rig"
                )
        lent = {place: _with_noise([some[place] for some in found]) for place in found[0]}
        return cls(
            pair,
            measure,
            {place: _groups(pair, some) for place, some in lent.items()},
            {
                place: any(r.noise is not None and r.noise is r.stated_noise for r in some)
                for place, some in lent.items()
            },
            {place: max((r.noise.step for r in some if r.noise), default=0.0) for place, some in lent.items()},
            {place: _dead(pair, some) for place, some in lent.items()},
            (*unread, *_failed(pair, found), *unequal_durations(pair, found)),
            tuple(doubts),
        )

    def sides(self, place: Place, scatter: RepeatabilityByPlace) -> tuple[ConditionAmplitude, ConditionAmplitude]:
        """Amplitudes with and without counter-masses, each with the variance that applies to it."""
        groups, repeats = self.groups[place], scatter[place]
        if not (self.noise_known(place) and repeats):
            own = self.repeated and not self.noise_known(place)
            return ConditionAmplitude(groups[0], own_scatter=own), ConditionAmplitude(groups[1], own_scatter=own)
        balanced, unbalanced = (
            ConditionAmplitude(group, repeats, own_scatter=repeats.excludes(group)) for group in groups
        )
        return balanced, unbalanced

    def has_interval(self, place: Place) -> bool:
        """Whether noise or repeats give an uncertainty, and something was read."""
        if self.dead.get(place):
            return False
        read = all(run.reading > 0.0 for group in self.groups[place] for run in group.runs)
        return read and (self.repeated or self.noise_known(place))

    def noise_known(self, place: Place) -> bool:
        """Whether the noise of every run is known."""
        return all(group.noise_known for group in self.groups[place])

    @property
    def repeated(self) -> bool:
        """Whether there are repeats on both sides."""
        return min(len(self.pair.balanced), len(self.pair.unbalanced)) > 1


def campaign_repeatability(conditions: Iterable[Condition]) -> RepeatabilityByPlace:
    """Repeatability at each place over a campaign; runs that are compared with several sets count once."""
    groups: dict[Place, dict[tuple[str, ...], Group]] = {}
    for condition in conditions:
        for place, both in condition.groups.items():
            groups.setdefault(place, {}).update({group.names: group for group in both})
    return {place: Repeatability.of(list(some.values())) for place, some in groups.items()}


def _groups(pair: Pair, runs: list[Amplitude]) -> tuple[Group, Group]:
    names, judged = tuple(run.name for run in pair.runs), tuple(map(AmplitudeLikelihood.of, runs))
    count = len(pair.balanced)
    return Group(judged[:count], names[:count]), Group(judged[count:], names[count:])


def _readable(pair: Pair, measure: Measure) -> tuple[Pair, list[dict[Place, Amplitude]], list[Finding], list[Finding]]:
    """The readable runs as a pair, their amplitudes, findings why others cannot be read, doubts about the readable."""
    records: list[dict[Place, Amplitude]] = []
    unread: list[Finding] = []
    doubts: list[Finding] = []
    errors: list[str] = []
    sides: list[tuple[Run, ...]] = []
    for side in (pair.balanced, pair.unbalanced):
        read = []
        for run in side:
            try:
                si = SIRun.of(run)
                records.append(amplitudes_of_run(si, measure))
                doubts += si.doubts(si.rig.base_columns)
                read.append(run)
            except AnalysisError as error:
                errors.append(str(error))
                unread.append(Finding("not_analyzed", None, run.name, f"{error}; the run is left out"))
        sides.append(tuple(read))
    if not all(sides):
        raise AnalysisError("; ".join(errors))
    return replace(pair, balanced=sides[0], unbalanced=sides[1]), records, unread, doubts


def _dead(pair: Pair, runs: list[Amplitude]) -> tuple[str, ...]:
    return tuple(run.name for run, one in zip(pair.runs, runs, strict=True) if is_dead(one.values))


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


def _with_noise(found: list[Amplitude]) -> list[Amplitude]:
    """Where a run's rest shows no noise: that of another run with the same rate, or else the rig's."""
    known = {run.rate_hz: run.noise for run in reversed(found) if run.noise is not None}
    return [
        run if run.noise else replace(run, noise=known.get(run.rate_hz, run.stated_noise), own_rest=False)
        for run in found
    ]
