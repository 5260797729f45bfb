"""Arrays of a file as groups: those of one place and length belong together, with the one that is their time.

Of a table the long side is the samples, the short one the channels. Time is the axis that the file states, else the
only array that is named for it and grows; a scalar named ``fs`` or ``dt`` states a rate.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Samples,
    StartTime,
    TextLog,
    TimeColumn,
    UniformClock,
    point_in_time,
)
from ..units import seconds_per
from . import header_claims
from .byte_source import as_float64, block_spans
from .csv.header import is_time_name, named_channels
from .format_findings import is_beyond_exact, names_listed, nothing_to_read, rounded_integers, watch_nonfinite
from .header_claims import clock_of_rate

_TIME_LIKE = re.compile(r"(?:.*[. /])?(?:t|time|timestamps?|zeit|zaman)(?:[_ ].*|\d*)", re.IGNORECASE)
_START_LIKE = re.compile(
    r"(?:.*[. /:])?(?:start_?time|time_coverage_start|date_?time|start_?date_?time)", re.IGNORECASE
)
_RATE_LIKE = re.compile(r"(?:.*[._ /])?(?:fs|sample_?rate|sampling_?(?:rate|frequency)|rate_?hz)", re.IGNORECASE)
_STEP_LIKE = re.compile(r"(?:.*[._ /])?(?:dt|ts|delta_?t|sample_?time|sampling_?(?:interval|period))", re.IGNORECASE)
_SAME_RATE = 1e-9
_MOST_CHANNELS = 4096
PYTHON_INDEX, MATLAB_INDEX = ("[{0},:]", "[:,{0}]"), ("({1},:)", "(:,{1})")
"""How the channels of a table are called: the rows of a wide one, the columns of a tall one."""


@dataclass(frozen=True)
class Series:
    """One array of ``length`` samples and one or more channels; ``root`` is what it shares with its neighbours.

    ``block(begin, end)`` gives the samples from ``begin`` to before ``end``, one column a channel. ``axis`` is the
    path of the axis that the file states for it, ``is_axis`` that it is that axis itself.
    """

    root: str
    channels: tuple[Channel, ...]
    length: int
    block: Callable[[int, int], Sequence[Samples]]
    axis: str = ""
    is_axis: bool = False

    def is_rounded(self) -> bool:
        """Whether it holds whole numbers so large that float64 may round them, if it holds such."""
        spans = block_spans(self.length, len(self.channels))
        return any(is_beyond_exact(column) for begin, end in spans for column in self.block(begin, end))


def number_columns(dtype: np.dtype[Any]) -> list[tuple[str, str]]:
    """The columns of one element: field and part (``real``, ``imag``); none if it is no number."""
    if dtype.names:
        if set(dtype.names) == {"real", "imag"}:
            return [("real", "real"), ("imag", "imag")]
        return [(name, "") for name in dtype.names if dtype[name].kind in "iufb" and not dtype[name].shape]
    if dtype.kind == "c":
        return [("", "real"), ("", "imag")]
    return [("", "")] if dtype.kind in "iufb" else []


def array_series(
    name: str,
    root: str,
    shape: Sequence[int],
    dtype: np.dtype[Any],
    array: Callable[[], Any],
    index: Sequence[str],
    unit: str | None = None,
    physical: Callable[[Samples], Samples] = lambda numbers: numbers,
) -> Series | None:
    """An array of up to two sides longer than one as a series; None for any other, or of too many channels.

    ``array`` gives what is cut by slices of samples, as of NumPy or of HDF5; ``index`` names the channels of a table.
    """
    long = [axis for axis, side in enumerate(shape) if side != 1]
    sides, parts = [int(shape[axis]) for axis in long], number_columns(dtype)
    if not parts or len(sides) > 2 or 0 in sides:
        return None
    length, width = max(sides, default=1), min(sides) if len(sides) == 2 else 1
    if max(width, width * len(parts) // 2) > _MOST_CHANNELS:
        return None
    along = len(sides) == 2 and sides[0] < sides[1]
    titles = [name + (index[not along].format(i, i + 1) if width > 1 else "") for i in range(width)]
    suffixes = [f" ({part})" if part else f".{of}" if of else "" for of, part in parts]
    channels = tuple(Channel(title + suffix, unit) for suffix in suffixes for title in titles)

    def block(begin: int, end: int) -> list[Samples]:
        where = [slice(None)] * len(shape)
        if long:
            where[long[-1] if along else long[0]] = slice(begin, end)
        table = array()[tuple(where)].reshape((width, -1) if along else (-1, width))
        rows = table if along else table.T
        return [physical(as_float64(_part(row, of, part))) for of, part in parts for row in rows]

    return Series(root, channels, length, block)


def _part(column: Any, of: str, part: str) -> Any:  # noqa: ANN401
    if column.dtype.names:
        return column[of]
    return column if not part else column.real if part == "real" else column.imag


@dataclass(frozen=True)
class TextArray:
    """An array of ``length`` texts, given by ``cells(begin, end)``; ``root`` is what it shares with its neighbours."""

    root: str
    name: str
    length: int
    cells: Callable[[int, int], Iterable[str]]


@dataclass
class Contents:
    """What the arrays, single numbers and texts of a file come to, and what is neither."""

    series: list[Series] = field(default_factory=list)
    texts: list[TextArray] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def keep(self, series: Series, dtype: np.dtype[Any], channel: str, where: str | None = None) -> None:
        """Take a series of this type; that float64 rounds its integers is found under the name of ``channel``."""
        if dtype.kind in "iu" and dtype.itemsize == 8 and series.is_rounded():
            self.findings.append(rounded_integers(channel, where))
        self.series.append(series)

    def _zero(self, group: Group) -> StartTime | None:
        """When the time of a group is zero: by its unit, ``s since 2024-03-01``, else by the one start stated."""
        unit = group.channels[group.clock.index].unit if isinstance(group.clock, TimeColumn) else None
        if unit and " since " in unit:
            stated = header_claims.start_at(unit.split(" since ")[1], unit)
            # by the conventions of netCDF (CF 4.4) it is in UTC where it says nothing else
            return stated and point_in_time(stated.nanoseconds, unit, None, 0)
        stated_at = [(key, text) for key, text in self.metadata.items() if _START_LIKE.fullmatch(key)]
        starts = {header_claims.start_at(text, key) for key, text in stated_at} - {None}
        return starts.pop() if len(starts) == 1 else None

    def recording(
        self, path: Path, kind: str, reader: str, guard: Callable[[], AbstractContextManager[None]] = nullcontext
    ) -> Recording:
        """The recording of the format ``kind``, whose samples are read within ``guard``. Raises Refusal without any."""
        rate = stated_rate(self.scalars)
        gathered = group_series(path.stem, self.series, rate)
        gathered = [(replace(group, zero=self._zero(group)), members) for group, members in gathered]
        listed = names_listed(self.left_out)
        if not gathered:
            grave = [finding for finding in self.findings if finding.severity > 0]
            raise nothing_to_read(path, grave, f"no array of numbers in it{f'; it holds {listed}' if listed else ''}")
        if listed:
            self.findings.append(Finding("left_out", None, None, f"no series of numbers: {listed}"))

        log = TextLog()
        places = {(members[0].root, members[0].length): group.name for group, members in reversed(gathered)}

        def blocks() -> Iterator[Block]:
            with guard():
                for group, members in gathered:
                    for begin, end in block_spans(members[0].length, len(group.channels)):
                        columns = tuple(column for member in members for column in member.block(begin, end))
                        yield Block(group, columns, begin)
                for text in self.texts:
                    name = places.get((text.root, text.length), " ".join(filter(None, [path.stem, text.root])))
                    for begin, end in block_spans(text.length, 64):
                        log.take_all(name, text.name, begin, text.cells(begin, end))

        return Recording(
            path=path,
            format=kind,
            reader=reader,
            groups=tuple(group for group, _ in gathered),
            read=lambda report: watch_nonfinite(blocks(), report),
            metadata=self.metadata,
            stated_rate_hz=rate,
            findings=tuple(self.findings),
            texts=log,
        )


def group_series(stem: str, series: Sequence[Series], rate_hz: float | None = None) -> list[tuple[Group, list[Series]]]:
    """Groups of the series of one root, length and axis; a stated rate is the clock of the only one."""
    by_place: dict[tuple[str, int, str], list[Series]] = {}
    for each in series:
        by_place.setdefault((each.root, each.length, each.axis), []).append(each)
    of_root = Counter(root for root, _, _ in by_place)
    of_length = Counter((root, length) for root, length, _ in by_place)
    found: dict[str, tuple[Group, list[Series]]] = {}
    for (root, length, axis), members in by_place.items():
        parts = [stem, *([root] if root else []), *([str(length)] if of_root[root] > 1 else [])]
        if of_length[root, length] > 1 and axis:
            parts.append(axis.rpartition("/")[2])
        name = " ".join(parts)
        while name in found:
            name += f" {len(found)}"
        clock = _time(members) or (UniformClock(rate_hz) if rate_hz is not None and len(by_place) == 1 else None)
        channels = tuple(channel for member in members for channel in member.channels)
        found[name] = Group(name, channels, clock), members
    return list(found.values())


def stated_rate(scalars: Mapping[str, float]) -> float | None:
    """The sampling rate [Hz] that scalars such as ``fs`` or ``dt`` state, if they state one."""
    rates = [value for name, value in scalars.items() if _RATE_LIKE.fullmatch(name) and 0 < value < np.inf]
    rates += [1 / value for name, value in scalars.items() if _STEP_LIKE.fullmatch(name) and 1e-300 < value < np.inf]
    if not rates or any(abs(rate / rates[0] - 1) > _SAME_RATE for rate in rates):
        return None
    return float(rates[0]) if clock_of_rate(float(rates[0])) else None


def _time(members: Sequence[Series]) -> TimeColumn | None:
    """The one series that is named for time and grows from sample to sample; plain names before longer ones."""
    found: list[tuple[TimeColumn, str]] = []
    index = 0
    for member in members:
        channel = member.channels[0]
        if len(member.channels) == 1 and _is_time(member):
            name = channel.name.rpartition(".")[2]
            unit = channel.unit or named_channels([name], [""])[0].unit
            clock = TimeColumn(index, seconds_per(unit.split(" since ")[0]) if unit else 1.0, assumed=unit is None)
            first = member.block(0, min(2, member.length))[0] if unit is None else np.empty(0)
            if len(first) > 1 and header_claims.may_be_days(float(first[0]), float(first[1] - first[0])):
                clock = TimeColumn(index, None)
            if member.is_axis:
                return clock
            found.append((clock, name))
        index += len(member.channels)
    plain = [clock for clock, name in found if is_time_name(name)]
    likely = plain or [clock for clock, _ in found]
    return likely[0] if len(likely) == 1 else None


def _is_time(member: Series) -> bool:
    """An axis in a unit of time, or named so, as the file states it; else what is named so and grows."""
    channel = member.channels[0]
    named = _TIME_LIKE.fullmatch(channel.name) is not None
    if member.is_axis:
        return named or (channel.unit is not None and seconds_per(channel.unit.split(" since ")[0]) is not None)
    last = -np.inf
    for begin, end in block_spans(member.length if named else 0, 1):
        column = member.block(begin, end)[0]
        with np.errstate(invalid="ignore"):
            if not column[0] > last or not (np.diff(column) > 0).all():
                return False
        last = float(column[-1])
    return named and member.length > 1
