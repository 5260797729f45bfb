"""What a source publishes for a linkage, compared with what its published inputs give; differences have a reason."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Annotated

from ..errors import DataError
from ..results import Key, given
from .equivalence_method import LinkageBalance, balance_linkage, rounding_intervals
from .expressions import Symbol, symbol
from .linkage import Contradiction

COLUMNS = ("Fx_N", "Fy_N", "Mz_Nm", "torque_Nm")
"""Columns of the published RMS values."""
STAGES = ("before", "force", "complete")
"""Without counter-masses, with them, with them and gears."""


@dataclass(frozen=True)
class PublishedRow:
    """One published number and ours."""

    name: Annotated[str, Key("symbol")]
    """Symbol, such as m2* or I_z1."""
    published: Annotated[Symbol, Key("printed_{0.unit}", to=attrgetter("value"))]
    computed: Annotated[float, Key("computed_{0.unit}")]
    """From the published inputs [kg, kg m2]."""
    interval: Annotated[tuple[float, float], Key("rounding_interval_{0.unit}")]
    """By the rounding of the published inputs [kg, kg m2]."""
    why: Annotated[str, Key(to=given)] = ""
    """Why it differs, where the source contradicts itself or its own equations."""
    explained: Annotated[float | None, Key("computed_as_the_source_did_{0.unit}")] = None
    """What the method gives without the terms that the source omits [kg, kg m2]."""
    explained_interval: tuple[float, float] | None = None
    """The same by the rounding of the published inputs [kg, kg m2]."""

    @property
    def agrees(self) -> bool:
        """Whether the published number, as rounded, is one that the published inputs, as rounded, can give."""
        return self._reached(self.interval, 1.0)

    @property
    def cut(self) -> bool:
        """Whether it agrees only as a number whose further digits were cut off, not rounded."""
        return not self.agrees and self._reached(self.interval, 2.0)

    @property
    def is_explained(self) -> bool:
        """Whether the omitted terms account for the published number."""
        return self.explained_interval is not None and self._reached(self.explained_interval, 1.0)

    @property
    def unit(self) -> str:
        """Of its values, as in keys."""
        return "kg" if self.name.startswith("m") else "kgm2"

    @property
    def verdict(self) -> Annotated[str, Key()]:
        """``agrees``, ``agrees, cut off`` or ``differs``."""
        return "agrees" if self.agrees else "agrees, cut off" if self.cut else "differs"

    def _reached(self, interval: tuple[float, float], halves: float) -> bool:
        slack = halves * self.published.half_unit * (1 + 1e-9)
        return interval[0] - slack <= self.published.value <= interval[1] + slack


@dataclass(frozen=True)
class Comparison:
    """All that a source publishes for a linkage, compared."""

    rows: Annotated[tuple[PublishedRow, ...], Key("values")]
    rms: Annotated[Mapping[str, Mapping[str, float]], Key()]
    """Published RMS values by stage and column, [N, N m]."""
    restored: Annotated[Mapping[str, str], Key()]
    """What had to be restored in the published copy."""
    contradictions: Annotated[tuple[Contradiction, ...], Key(to=lambda one: one.model_dump(include={"about", "why"}))]


def compare_published(result: LinkageBalance) -> Comparison | None:
    """Compare a balance with what its linkage's source publishes; None where there is nothing published."""
    published = result.linkage.published
    if published is None:
        return None
    bounds, ours = rounding_intervals(result), result.results()
    reasons = {entry.about: entry for entry in published.contradiction}
    rows = tuple(_row(result, name, text, ours, bounds, reasons.get(name)) for name, text in published.values.items())
    rms = {str(stage): dict(zip(COLUMNS, values, strict=True)) for stage, values in published.rms.items()}
    return Comparison(rows, rms, published.restored, published.contradiction)


def _row(
    result: LinkageBalance,
    name: str,
    text: str,
    ours: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    reason: Contradiction | None,
) -> PublishedRow:
    if name not in ours:
        raise DataError(f"printed.values: {name!r} is not a result: there are {', '.join(ours)}")
    number = symbol(text, "mass" if name.startswith("m") else "inertia")
    row = PublishedRow(name, number, ours[name], bounds[name], reason.why if reason else "")
    if reason is None or not reason.omit:
        return row
    omit = _omitted(result, reason)
    other = balance_linkage(result.linkage, result.values, omit=omit, tree=result.tree)
    return replace(row, explained=other.results()[name], explained_interval=rounding_intervals(other, omit)[name])


def _omitted(result: LinkageBalance, reason: Contradiction) -> dict[str, Sequence[str]]:
    """Omitted terms by body. Raises DataError for a term that is not in its sum."""
    omitted: dict[str, Sequence[str]] = {}
    assert result.moment is not None
    for link, terms in reason.omit.items():
        body = result.linkage.body(link).name
        known = [term.text for term in result.moment.bodies[body].terms]
        for term in terms:
            if term not in known:
                raise DataError(
                    f"contradiction {reason.about}: {term!r} is no term of {body}: there are {', '.join(known)}"
                )
        omitted[body] = terms
    return omitted
