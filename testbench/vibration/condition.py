"""The runs that are compared with each other, judged at each place, and what the repeats of a campaign say of them.

The amplitude of a condition, with or without counter-masses, from one run or from repeats.
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
from .amplitude import Amplitude, MetricStatistic, Place, amplitudes
from .amplitude_likelihood import AmplitudeLikelihood
from .metrics import Measure
from .repeatability import Group, Repeatability
from .run_pairs import Pair

if TYPE_CHECKING:
    from ..store import Run

FAR = 10.0
"""Distance from zero at which the bound is not felt [standard deviations]."""
_REACH = 5.0
"""How far from what was read amplitudes are tried [standard deviations]."""
_STEEP = 25.0
"""Most logarithms that amplitudes of repeats are tried above and below what was read."""
_FINE = 401
"""Amplitudes that are tried."""


@dataclass(frozen=True)
class ConditionAmplitude:
    """One run, or repeats of it, whose mean deviation has the variance v / n.

    Without ``repeats`` v is 1, since a deviation is in standard deviations of what noise does to one run. With them
    v is that of the repeatability that is pooled over a campaign; of the side's own repeats alone where their noise is
    not known, or where they are not pooled.
    """

    group: Group
    repeats: Repeatability | None = None
    own: bool = False
    """Whether the scatter of the side's own repeats alone says how sure it is."""

    @property
    def runs(self) -> tuple[AmplitudeLikelihood, ...]:
        """One, or repeats."""
        return self.group.runs

    @property
    def bound(self) -> bool:
        """Whether a sensor was at the end of its range."""
        return any(run.bound for run in self.runs)

    @property
    def statistic(self) -> MetricStatistic:
        """What is read of each run."""
        return self.runs[0].statistic

    @cached_property
    def floor(self) -> float | None:
        """What the metric would show of noise alone [unit]; None where a run shows no noise."""
        known = [run.floor for run in self.runs if run.floor is not None]
        return self.statistic.amplitude(float(np.mean(known))) if len(known) == len(self.runs) else None

    @property
    def amplitude(self) -> float:
        """The amplitude that reads as was read, middle value; zero where noise alone reads as much [unit]."""
        return self.group.middle

    def deviation(self, amplitude: Floats) -> Floats:
        """By how many standard deviations the mean reading lies above what each amplitude (k,) would read."""
        return self.group.deviations(amplitude).mean(axis=0) / self._error

    def distance(self, amplitude: Floats) -> Floats:
        """How many standard deviations each amplitude (k,) reads above none, at most FAR."""
        risen = np.mean([run.distance(amplitude) for run in self.runs], axis=0)
        return np.clip(risen / self._error, 0.0, FAR)

    @cached_property
    def tried(self) -> Floats:
        """Amplitudes around what was read, rising, (_FINE,) [unit]; evenly far above the noise in their logarithms."""
        tables = np.array([run.tried[[0, -1]] for run in self.runs])
        scale = float(np.mean([run.scale for run in self.runs]))
        reach = max(_REACH, 1.5 * student_quantile(0.9975, self.freedom)) * self._error
        around = min(0.25 * reach * scale / float(np.hypot(self.amplitude, scale)), _STEEP) * np.array([-1.0, 1.0])
        low, high = np.maximum(np.arcsinh(self.amplitude / scale) + around, 0.0)
        low, high = min(low, np.arcsinh(tables[:, 0].min() / scale)), max(high, np.arcsinh(tables[:, 1].max() / scale))
        return scale * np.sinh(np.linspace(low, high, _FINE))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of its own variance."""
        return freedom_of((self,), (1.0,))

    @cached_property
    def variance(self) -> float:
        """Of one reading [1, in units of the noise]."""
        if self.own:
            return self.group.variance
        return 1.0 if self.repeats is None else self.repeats.variance(self.group.clearness)

    @property
    def components(self) -> Floats:
        """By how much of itself the variance grows with each of the pooled components, (2,)."""
        pooled = self.repeats is not None and not self.own
        return np.array([1.0, self.group.clearness**2]) / self.variance if pooled else np.zeros(2)

    @property
    def own_freedom(self) -> float:
        """Degrees of freedom of what is not pooled."""
        return self.group.freedom if self.own else np.inf

    @property
    def _error(self) -> float:
        """Standard deviation of the mean deviation."""
        return float((self.variance / len(self.runs)) ** 0.5)


def freedom_of(sides: Sequence[ConditionAmplitude], shares: Sequence[float]) -> float:
    """Degrees of freedom of a variance to which each side brings its share.

    Welch and Satterthwaite (JCGM 100:2008, G.4), but that what is pooled is the same on all sides.
    """
    repeats = sides[0].repeats
    pooled = np.sum([share * side.components for side, share in zip(sides, shares, strict=True)], axis=0)
    doubt = sum(2.0 * share**2 / side.own_freedom for side, share in zip(sides, shares, strict=True))
    doubt += 0.0 if repeats is None else float(pooled @ repeats.covariance @ pooled)
    return max(2.0 / doubt, 1.0) if doubt > 0.0 else np.inf


ALIKE = 0.9
"""Share of the longest record of a condition that the others last, as long as its motion is whole in all of them."""
Scatter = dict[Place, Repeatability | None]
"""What repeats of a campaign say; None where there are too few."""


@dataclass(frozen=True)
class Condition:
    """A pair, and how each of its runs is judged; the records themselves are let go."""

    pair: Pair
    measure: Measure
    groups: dict[Place, tuple[Group, Group]]
    """Runs with and without counter-masses."""
    noise_stated: dict[Place, bool]
    """Whether the noise of any run is what the rig states."""
    resolution: dict[Place, float]
    """Step of the channel [m/s2]; zero where none is known."""
    dead: dict[Place, tuple[str, ...]] = field(default_factory=dict)
    """Runs in which the channel shows one value only."""
    findings: tuple[Finding, ...] = ()
    """Runs that cannot be read and are left out, sensors that failed in a run, records unlike in length."""
    doubts: tuple[Finding, ...] = ()
    """What ingest found wrong with the accelerometers on the base."""

    @classmethod
    def of(cls, pair: Pair, measure: Measure) -> "Condition":
        """Judge every run that can be read.

        Raises AnalysisError where none with, or none without counter-masses can be read, or their rigs have not the
        same accelerometers on the base.
        """
        pair, found, unread, doubts = _readable(pair, measure)
        for run, some in zip(pair.runs, found, strict=True):
            if some.keys() != found[0].keys():
                raise AnalysisError(
                    f"{run.name}: its rig has other accelerometers on the base than {pair.runs[0].name}"
                )
        lent = {place: _lent([some[place] for some in found]) for place in found[0]}
        return cls(
            pair,
            measure,
            {place: _groups(pair, some) for place, some in lent.items()},
            {place: any(r.noise is not None and r.noise is r.stated for r in some) for place, some in lent.items()},
            {place: max((r.noise.step for r in some if r.noise), default=0.0) for place, some in lent.items()},
            {place: _dead(pair, some) for place, some in lent.items()},
            (*unread, *_failed(pair, found), *unlike_in_length(pair, found)),
            tuple(doubts),
        )

    def sides(self, place: Place, scatter: Scatter) -> tuple[ConditionAmplitude, ConditionAmplitude]:
        """With and without counter-masses.

        Repeats whose noise is not known, and such as scatter unlike others, say alone how sure they are.
        """
        groups, repeats = self.groups[place], scatter[place]
        if not (self.noisy(place) and repeats):
            own = self.repeated and not self.noisy(place)
            return ConditionAmplitude(groups[0], own=own), ConditionAmplitude(groups[1], own=own)
        balanced, unbalanced = (ConditionAmplitude(group, repeats, own=repeats.leaves_out(group)) for group in groups)
        return balanced, unbalanced

    def judgeable(self, place: Place) -> bool:
        """Whether noise or repeats say how sure the amplitudes are, and anything was read."""
        if self.dead.get(place):
            return False
        read = all(run.reading > 0.0 for group in self.groups[place] for run in group.runs)
        return read and (self.repeated or self.noisy(place))

    def noisy(self, place: Place) -> bool:
        """Whether the noise of every run is known."""
        return all(group.noisy for group in self.groups[place])

    @property
    def repeated(self) -> bool:
        """Whether there are repeats on both sides."""
        return min(len(self.pair.balanced), len(self.pair.unbalanced)) > 1


def scatter_of(conditions: Iterable[Condition]) -> Scatter:
    """What all repeats of a campaign say of each place; runs that are compared with several sets count once."""
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
    """The pair of the runs that can be read, their records, why the others cannot, and doubts about those that can."""
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
                records.append(amplitudes(si, measure))
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


def unlike_in_length(pair: Pair, found: list[dict[Place, Amplitude]]) -> list[Finding]:
    """Runs of one condition that were not recorded equally long: a peak may lie outside, an RMS is over the record."""
    lengths = [min(one.seconds for one in places.values()) for places in found]
    (short, brief), (long, name) = ((end(lengths), pair.runs[lengths.index(end(lengths))].name) for end in (min, max))
    if short >= ALIKE * long:
        return []
    message = (
        f"{pair.key}: the base was recorded for {short:.3f} s in {brief}, for {long:.3f} s in {name}: "
        "a motion that is not whole in a record, or an RMS over more rest, is compared with another"
    )
    return [Finding("durations_differ", None, f"{brief} {name}", message)]


def _lent(found: list[Amplitude]) -> list[Amplitude]:
    """A run whose rest shows no noise has that of another with the same rate, or else the rig's: it is one channel."""
    known = {run.rate_hz: run.noise for run in reversed(found) if run.noise is not None}
    return [run if run.noise else replace(run, noise=known.get(run.rate_hz, run.stated), rested=False) for run in found]
