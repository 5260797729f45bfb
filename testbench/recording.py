"""What a reader gives: groups of channels with their clock, then the data in blocks."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from .findings import Finding as Finding

Origin = Literal["measured", "simulated", "unstated"]
Samples = NDArray[np.float64]
Report = Callable[[Finding], None]


class Conditions(TypedDict, total=False):
    """What a run was made with, from the sheet; what the sheet leaves empty is absent."""

    payload_kg: float
    counter_masses: dict[str, float]
    motion: str
    peak_acceleration_g: float
    repeat: int


LONGEST_NAME = 1000
"""Letters of a name or unit; what is longer is cut, and ends with dots."""


def storable(text: str) -> str:
    """A name that HDF5 can hold: no NUL, no half of a letter, and no more than a thousand letters."""
    plain = text.replace("\0", "\N{SYMBOL FOR NULL}").encode("utf-8", "replace").decode("utf-8")
    return plain if len(plain) <= LONGEST_NAME else f"{plain[: LONGEST_NAME - 3]}..."


@dataclass(frozen=True)
class Channel:
    """One column, with its name and unit exactly as the logger wrote them, and the name without the unit."""

    name: str
    unit: str | None = None
    label: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", storable(self.name))
        object.__setattr__(self, "label", storable(self.label or self.name))
        if self.unit is not None:
            object.__setattr__(self, "unit", storable(self.unit) or None)


@dataclass(frozen=True)
class UniformClock:
    """A declared rate: sample ``i`` was taken at ``start_s + i / rate_hz``."""

    rate_hz: float
    start_s: float = 0.0

    def times(self, begin: int, end: int) -> Samples:
        """Time of the samples from ``begin`` to ``end``, (end - begin,) [s]; each by its index, so that none drifts."""
        found = np.arange(begin, end, dtype=np.float64)
        found /= self.rate_hz
        found += self.start_s
        return found


@dataclass(frozen=True)
class TimeColumn:
    """A recorded time: the channel of this index, the seconds in one of its units (None: unknown unit).

    ``assumed`` says that the column carries no unit and seconds were taken.
    """

    index: int
    seconds_per_unit: float | None = 1.0
    assumed: bool = False


Clock = UniformClock | TimeColumn


@dataclass(frozen=True)
class SensorRange:
    """A range from -limit to +limit in ``unit``, digitised to ``bits``; channels of that unit lie within it."""

    limit: float
    unit: str
    bits: int | None = None


@dataclass(frozen=True)
class Group:
    """Channels sampled together; the time column, if there is one, is among them."""

    name: str
    channels: tuple[Channel, ...]
    clock: Clock | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", storable(self.name))


def placed(findings: Iterable[Finding], groups: Sequence[Group], several: bool) -> list[Finding]:
    """Findings about a file's ``groups``, each with its group where there are ``several`` and it can be told.

    A check knows its group; what a reader says of a channel is of the only group that holds one of this name.
    """
    return [replace(finding, group=_holder(finding, groups) if several else None) for finding in findings]


def _holder(finding: Finding, groups: Sequence[Group]) -> str | None:
    if finding.group is not None or finding.channel is None:
        return finding.group
    holders = [g.name for g in groups if any(finding.channel in {c.name, c.label} for c in g.channels)]
    return holders[0] if len(holders) == 1 else None


@dataclass(frozen=True)
class Block:
    """Successive samples of one group: one float64 column a channel, all (n,).

    ``lines`` holds the file's line of each sample where the file has lines; ``bytes_read`` how far in the file
    the block ends, for a progress bar.
    """

    group: Group
    columns: tuple[Samples, ...]
    start: int
    lines: "range | NDArray[np.int64] | None" = None
    bytes_read: int = 0

    def __len__(self) -> int:
        return len(self.columns[0])

    def where(self, i: int) -> str:
        """The place of the block's sample ``i``, for a person to find."""
        return f"sample {self.start + i}" if self.lines is None else f"line {self.lines[i]}"


@dataclass(frozen=True)
class Recording:
    """A log file, its header read and its data not yet.

    ``read`` yields the data and reports what it finds on the way; a later block may bring a group that the
    header did not announce (a second recording appended to the file).
    """

    path: Path
    format: str
    reader: str
    groups: tuple[Group, ...]
    read: Callable[[Report], Iterator[Block]]
    origin: Origin = "unstated"
    settings: Mapping[str, str] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    comments: tuple[str, ...] = ()
    ranges: tuple[SensorRange, ...] = ()
    stated_rate_hz: float | None = None
    findings: tuple[Finding, ...] = ()

    def blocks(self, report: Report) -> Iterator[Block]:
        """The data in blocks of bounded size; findings on the way go to ``report``."""
        return self.read(report)
