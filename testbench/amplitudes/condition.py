"""The runs that are compared with each other, judged at each place, and what the repeats of a campaign say of them."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ..checks.clipping import is_dead
from ..errors import AnalysisError
from ..findings import Finding
from ..pairing import Pair
from ..runs.si_run import SIRun
from ..vibration import Measure
from .amplitude import Amplitude
from .judged import Judged
from .recorded import Place, amplitudes
from .repeatability import Group, Repeatability
from .side import Side

if TYPE_CHECKING:
    from ..store import Run

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

    def sides(self, place: Place, scatter: Scatter) -> tuple[Side, Side]:
        """With and without counter-masses.

        Repeats whose noise is not known, and such as scatter unlike others, say alone how sure they are.
        """
        groups, repeats = self.groups[place], scatter[place]
        if not (self.noisy(place) and repeats):
            own = self.repeated and not self.noisy(place)
            return Side(groups[0], own=own), Side(groups[1], own=own)
        balanced, unbalanced = (Side(group, repeats, own=repeats.leaves_out(group)) for group in groups)
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
    names, judged = tuple(run.name for run in pair.runs), tuple(map(Judged.of, runs))
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
