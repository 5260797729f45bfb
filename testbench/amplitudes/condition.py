"""The runs that are compared with each other, judged at each place, and what the repeats of a campaign say of them."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ..errors import AnalysisError
from ..pairing import Pair
from ..vibration import Measure
from .amplitude import Amplitude
from .judged import Judged
from .recorded import Place, amplitudes
from .repeatability import Group, Repeatability
from .side import Side

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

    @classmethod
    def of(cls, pair: Pair, measure: Measure) -> "Condition":
        """Judge every run. Raises AnalysisError where their rigs have not the same accelerometers on the base."""
        found = [amplitudes(run, measure) for run in pair.runs]
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


def _lent(found: list[Amplitude]) -> list[Amplitude]:
    """A run whose rest shows no noise has that of another with the same rate, or else the rig's: it is one channel."""
    known = {run.rate_hz: run.noise for run in reversed(found) if run.noise is not None}
    return [run if run.noise else replace(run, noise=known.get(run.rate_hz, run.stated), rested=False) for run in found]
