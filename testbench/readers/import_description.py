"""Import descriptions: what a person states of one logger's logs where the reader is not to detect it.

Rows of names and units, columns of time with unit, zone, wrap and parts, words and numbers for no value, names and
units of channels, findings that are normal for this logger. What is particular to texts replaces its detection; all
else is applied to what any reader gives.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Annotated, Literal, Self
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from balance import datasets
from balance.errors import DataError, suggestion
from balance.input_files import (
    Count,
    OneOrMore,
    Positive,
    Quantity,
    Table,
    Text,
    model_from_table,
    read_text,
    toml_tables,
)

from ..errors import RecordingError
from ..recording import (
    MEANING,
    Block,
    Channel,
    Clock,
    Finding,
    Group,
    Recording,
    Report,
    Samples,
    StartTime,
    TimeColumn,
    UniformClock,
    by_name,
    point_in_time,
)
from ..units import seconds_per
from .csv.cell_syntax import as_number
from .csv.dialect import DELIMITERS
from .csv.header import named_channels, time_column
from .header_claims import ONE_RATE, SINCE_1970, start_at

_SINCE = " since "
_OFFSET = re.compile(r"([+-])(\d\d):?(\d\d)|Z|UTC", re.IGNORECASE)
_OF_OTHER_CLOCKS = ("time_coarse", "several_clocks")
"""Findings on the columns of time that the reader would have taken."""
_FEW_FALLS = 0.01
"""Share of steps up to which times that fall or stand still are faults of a clock, and not of a column that is none."""
_STRAY = "the setting {} stands below [channels], where names are of channels: write it above that line"
DECIMALS = {"point": ".", "comma": ","}
"""Decimal marks as a person calls them."""


class ImportDescription(Table):
    """How the logs of one logger are read; what is left out is detected."""

    name: str = ""
    """Name of the logger."""
    encoding: str = ""
    """Encoding of its texts, such as cp1254."""
    delimiter: Literal["comma", "semicolon", "tab", "bar", "blanks"] | None = None
    """What stands between the cells of a row."""
    decimal: Literal["point", "comma"] | None = None
    """Decimal mark."""
    date_order: Literal["dmy", "mdy", "ymd"] | None = None
    """Order of day, month and year where the notation leaves it open."""
    names: Annotated[list[Count], OneOrMore] | None = None
    """Line of the names, counted from 1, or lines whose cells are joined; [] if there are none."""
    units: Count | None = None
    """Line of the units."""
    data: Count | None = None
    """First line of the data; else the first row of numbers below names and units."""
    rate: Annotated[float, Quantity("frequency", above=0.0)] | None = None
    """Sampling rate where no column in a unit of time increases."""
    time: Annotated[list[Text], OneOrMore] = Field(default_factory=list)
    """Column of time by its name, or columns whose sum it is, such as a time of day and milliseconds; [] for none."""
    time_unit: Annotated[list[Text], OneOrMore] = Field(default_factory=list)
    """Unit of each such column, such as us, or ``day since 1899-12-30``, ``ms since 1970``; of a column of text: s."""
    time_wraps: Positive | None = None
    """Number at which the first column of time starts again from zero, such as 4294967296."""
    time_zone: str = ""
    """Zone of times that state none: an offset such as +03:00, or a name such as Europe/Istanbul."""
    missing: list[str | float] = Field(default_factory=list)
    """Words and numbers that stand for no value, such as OVERFLOW or -9999."""
    channels: dict[str, Text] = Field(default_factory=dict)
    """Names of channels as written, and instead of each a name with its unit in brackets.

    Where several have one name, ``channel 4`` is the fourth of the log if it is one of them, ``GROUP/channel 4`` that
    of a group.
    """
    dbc: str = ""
    """Database of a CAN bus in the same folder, by which its frames are decoded; they are kept too."""
    normal: list[str] = Field(default_factory=list)
    """Codes of findings that are normal for this logger: they are said as notes."""
    text: SkipJsonSchema[str] = Field(default="", exclude=True)
    """The file as written."""
    folder: SkipJsonSchema[Path | None] = Field(default=None, exclude=True)
    """Where it lies."""

    def _check(self) -> None:
        if wrong := [code for code in self.normal if code not in MEANING]:
            raise DataError(f"normal: {wrong[0]!r} is no code of a finding{suggestion(wrong[0], MEANING)}")
        if len(self.time_unit) > len(self.time):
            raise DataError(f"time_unit: {len(self.time_unit)} units for {len(self.time)} columns of time")
        for unit in self.time_unit:
            if seconds_per(unit.split(_SINCE)[0]) is None:
                expected = "one such as us, or day since 1899-12-30"
                raise DataError(f"time_unit: {unit!r} is no unit of time: expected {expected}")
            if _SINCE in unit and _point(unit.split(_SINCE)[1]) is None:
                raise DataError(f"time_unit: {unit!r}: expected a date after since, such as 1970-01-01")
        if self.time_zone and not _OFFSET.fullmatch(self.time_zone):
            try:
                ZoneInfo(self.time_zone)
            except (ZoneInfoNotFoundError, ValueError, OSError):
                expected = "an offset such as +03:00, or a name such as Europe/Istanbul"
                raise DataError(f"time_zone: {self.time_zone!r}: expected {expected}") from None

    @classmethod
    def load(cls, name: str) -> Self:
        """A file, or a shipped description by its name. Raises RecordingError, naming the key that is wrong."""
        try:
            path = datasets.find_dataset(name, "loggers", ".toml")
        except DataError as error:
            raise RecordingError(str(error)) from error
        text = read_text(path, RecordingError)
        table = toml_tables(text, path.name, RecordingError)
        if own := {"text", "folder"} & table.keys():
            raise RecordingError(f"{path.name}: {min(own)}: unknown key")
        renamed = table.get("channels")
        for key, value in renamed.items() if isinstance(renamed, dict) else ():
            if key in cls.model_fields and not isinstance(value, str):
                raise RecordingError(f"{path.name}: channels.{key}: {_STRAY.format(key)}")
        return model_from_table(cls, table | {"text": text, "folder": path.parent}, path.name, RecordingError)

    @property
    def states_time(self) -> bool:
        """Whether it says which columns are time, or that none is."""
        return "time" in self.model_fields_set

    @property
    def words(self) -> frozenset[str]:
        """The words for no value."""
        return frozenset(word for word in self.missing if isinstance(word, str) and as_number(word) is None)

    @property
    def codes(self) -> tuple[float, ...]:
        """The numbers for no value, also as float32 holds them."""
        numbers = [number for each in self.missing if (number := as_number(each)) is not None]
        with np.errstate(over="ignore"):
            return tuple(dict.fromkeys(x for n in numbers for x in (n, float(np.float32(n)))))

    @property
    def options(self) -> dict[str, str | None]:
        """What it states of a text, by the names of the options for reading; None: detect."""
        delimiter, decimal = DELIMITERS.get(self.delimiter or ""), DECIMALS.get(self.decimal or "")
        found = {"encoding": self.encoding or None, "delimiter": delimiter, "decimal": decimal}
        return found | {"date_order": self.date_order}

    def renamed(self, written: Collection[str]) -> set[str]:
        """What it calls channels of these names as written, with and without the unit."""
        stated = [new for key, new in self.channels.items() if key in written]
        return {name for new in stated for name in named_channels([new], [""])[0].names}

    def with_normal_as_notes(self, findings: Iterable[Finding]) -> list[Finding]:
        """Findings, of which those that are normal for the logger are notes that name them."""
        return [
            replace(f, code="normal_finding", message=f"{f.code}: {f.message}") if f.code in self.normal else f
            for f in findings
        ]

    def applied(self, recording: Recording) -> Recording:
        """The recording as the description has it; a channel that is not there is a finding.

        Raises RecordingError for a column of time that is not there, and for a setting that stands below [channels].
        """
        is_named = self.time_zone and not _OFFSET.fullmatch(self.time_zone)
        firsts = _first_times(recording, self.time[0]) if is_named and any(_SINCE in u for u in self.time_unit) else {}
        may_be_timed = self.channels or any(isinstance(group.clock, TimeColumn) for group in recording.groups)
        begun = {} if self.rate is None or not may_be_timed else _beginnings(recording)
        known = [_Plan(self, group, recording, firsts, begun.get(group.name)) for group in recording.groups]
        channels = [channel for group in recording.groups for channel in group.channels]
        names = list(dict.fromkeys(channel.name for channel in channels))
        lacking = list[Finding]()
        for key in self.channels:
            if any(key in channel.names for channel in channels) or any(key in plan.by_place for plan in known):
                continue
            place = f"the import description's channels.{key}"
            if key in type(self).model_fields:
                raise RecordingError(f"{recording.path.name}: {place}: {_STRAY.format(key)}")
            message = f"{place}: the log has no channel of this name{suggestion(key, names)}; there are "
            lacking.append(Finding("channel_not_found", key, None, message + ", ".join(names[:20])))
        if self.time and not any(plan.places for plan in known):
            missing = next((n for n in self.time if not any(_place(g, n) is not None for g in recording.groups)), "")
            raise RecordingError(
                f"{recording.path.name}: no column {missing or self.time!r} with the others of time in one group"
                f"{suggestion(missing, names)}; there are {', '.join(names[:20])}"
            )

        announced = {group.name for group in recording.groups}

        def read(report: Report) -> Iterator[Block]:
            plans: dict[str, _Plan] = {}
            for block in recording.read(report):
                if (name := block.group.name) not in plans:
                    plans[name] = _Plan(self, block.group, recording, firsts)
                    for finding in plans[name].findings if name not in announced else ():
                        report(finding)
                yield plans[name].block(block)
            for plan in plans.values():
                plan.report(report)

        left = _OF_OTHER_CLOCKS if self.states_time else ()
        kept = (finding for finding in recording.findings if finding.code not in left)
        found = replace(
            recording,
            groups=tuple(plan.group for plan in known),
            read=read,
            settings={**recording.settings, "import_description": self.text or self.name},
            findings=tuple(dict.fromkeys([*kept, *lacking, *(finding for plan in known for finding in plan.findings)])),
            stated_rate_hz=recording.stated_rate_hz if self.rate is None else self.rate,
            rate_stated_by=recording.rate_stated_by if self.rate is None else "the import description",
        )
        if not self.dbc:
            return found
        from .bus_decoding import BusDatabase

        if Path(self.dbc).name != self.dbc:
            raise RecordingError(f"dbc: {self.dbc!r}: expected the name of a file in its folder")
        return BusDatabase.load((self.folder or Path()) / self.dbc).applied(found)


class _Plan:
    """What the description makes of one group: its channels, its clock, and of its blocks their columns.

    ``firsts`` is the first time of a group where the zone's offset from UTC must be that of then, ``begun`` its first
    samples where a rate is stated; ``findings`` are on what is stated and what is there.
    """

    def __init__(
        self,
        description: ImportDescription,
        before: Group,
        recording: Recording,
        firsts: Mapping[str, float],
        begun: Sequence[Samples] | None = None,
    ) -> None:
        header = before.clock.rate_hz if isinstance(before.clock, UniformClock) else recording.stated_rate_hz
        rate, self.findings = description.rate, list[Finding]()
        if rate and header and abs(rate / header - 1.0) > ONE_RATE:
            message = f"the header states {header:g} Hz, the import description {rate:g} Hz, which goes before it"
            self.findings.append(Finding("rate_contradiction", None, None, message))
        self.description, self.before, self._stated = description, before, recording.metadata
        named = [_place(before, name) for name in description.time]
        self.places = [i for i in named if i is not None] if None not in named else []
        units = [before.channels[i].unit for i in self.places]  # of each column of time: as stated, else its own
        self._units = [*description.time_unit, *units[len(description.time_unit) :]]
        self._seconds = [None if unit is None else seconds_per(unit.split(_SINCE)[0]) for unit in self._units]
        channels = list(before.channels)
        if len(self.places) > 1 and None in self._seconds:
            unknown = channels[self.places[self._seconds.index(None)]].name
            raise RecordingError(
                f"{recording.path.name}: the column of time {unknown!r} has no unit of time, and is one of a sum: "
                'state time_unit, a unit for each column, such as ["s", "ms"]'
            )
        if self.places and self._units[0] is not None:
            first = channels[self.places[0]]
            channels[self.places[0]] = Channel(first.name, self._units[0].split(_SINCE)[0], first.label)
        stated, alone = description.channels, len(recording.groups) == 1
        shared = [place for places in by_name(channels).values() if len(places) > 1 for place in places]
        self.by_place = {f"{before.name}/channel {place + 1}": place for place in shared}
        self.by_place |= {f"channel {place + 1}": place for place in shared if alone}
        of_place = {place: stated[key] for key, place in self.by_place.items() if key in stated}
        for i, channel in enumerate(channels):
            if (other := of_place.get(i) or stated.get(channel.name) or stated.get(channel.label)) is not None:
                renamed = named_channels([other], [""])[0]
                channels[i] = replace(renamed, unit=renamed.unit or channel.unit)
        zero = self._zero(firsts.get(before.name, 0.0))
        self.group = replace(before, channels=tuple(channels), clock=self._clock(channels, begun), zero=zero)
        self._missing, self._first = Counter[int](), dict[int, str]()
        self._turns, self._last = 0, -np.inf

    def _clock(self, channels: Sequence[Channel], begun: Sequence[Samples] | None) -> Clock | None:
        """That of the columns of time that are stated, or of the one that is known; where that is none, of the rate."""
        if self.places:
            seconds = self._seconds[0]
            return TimeColumn(self.places[0], 1.0 if seconds is None else seconds, assumed=seconds is None)
        found, rate = self._known(channels), self.description.rate
        if rate is None:
            return found
        if not isinstance(found, TimeColumn):
            return UniformClock(rate)
        if not (why := _no_clock(found, None if begun is None else begun[found.index])):
            return found
        message = (
            f"{why}: the clock is the rate of the import description, {rate:g} Hz, and the column a channel; say there "
            "time = [] if no column is time, or time and time_unit if this one is"
        )
        self.findings.append(Finding("time_set_aside", channels[found.index].name, None, message))
        return UniformClock(rate)

    def _known(self, channels: Sequence[Channel]) -> Clock | None:
        """That of the reader, or of a column that is renamed to a name and unit of time.

        A column of time that is renamed to something else is none, and none is where ``time`` says so.
        """
        before, own = self.before.clock, self.before.channels
        if self.description.states_time and not self.description.time:
            return None if isinstance(before, TimeColumn) else before
        renamed = [i for i, (new, old) in enumerate(zip(channels, own, strict=True)) if new != old]
        taken = [replace(found, index=i) for i in renamed if (found := time_column([channels[i]])) is not None]
        taken = sorted(
            (found for found in taken if found.seconds_per_unit is not None), key=lambda found: found.assumed
        )
        if isinstance(before, TimeColumn) and before.index in renamed:
            seconds = seconds_per((channels[before.index].unit or "").split(_SINCE)[0])
            before = None if seconds is None else TimeColumn(before.index, seconds)
        return taken[0] if taken and (before is None or not taken[0].assumed) else before

    def _zero(self, first: float) -> StartTime | None:
        """When the group's time is zero, as its unit says, else as its log; in the zone that is stated."""
        found, zone, factor = self.before.zero, self.description.time_zone, 1.0
        if self.places:
            name, unit, factor = self.before.channels[self.places[0]].name, self._units[0], self._seconds[0] or 1.0
            begun = self._stated.get(f"zero of {name}", "")  # counted from there by the reader
            if found is None and (found := start_at(begun, "log")) is not None:  # text that is no clock by itself
                found = replace(found, source=f"first time of {name}")
            if unit is not None and _SINCE in unit and (found := _point(unit.split(_SINCE)[1])) is not None:
                with suppress(InvalidOperation):
                    counted = int(Decimal(begun.replace(",", ".")) * Decimal(repr(factor)) * 10**9)
                    found = point_in_time(found.nanoseconds + counted, unit, None, 0 if found.has_zone else None)
        return None if found is None else _in_zone(found, zone, found.later(first * factor) or found)

    def block(self, block: Block) -> Block:
        """The block with times unwrapped and summed, and no value where the description says so."""
        columns = list(block.columns)
        codes = self.description.codes
        for i, column in enumerate(columns):
            if codes and i not in self.places and (mask := np.isin(column, codes)).any():
                self._first.setdefault(i, block.where(int(np.argmax(mask))))
                self._missing[i] += int(mask.sum())
                columns[i] = np.where(mask, np.nan, column)
        if self.places:
            columns[self.places[0]] = self._times([block.columns[i] for i in self.places])
        return replace(block, group=self.group, columns=tuple(columns))

    def _times(self, parts: Sequence[Samples]) -> Samples:
        """Times in the unit of the first part."""
        times, wraps = parts[0], self.description.time_wraps
        if wraps is not None:
            finite = np.flatnonzero(np.isfinite(times))
            falls = np.diff(times[finite], prepend=self._last) < -0.5 * wraps
            turns = self._turns + np.cumsum(falls)
            times = times.copy()
            if len(finite):
                self._last, self._turns = float(times[finite[-1]]), int(turns[-1])
            times[finite] += turns * wraps
        for part, seconds in zip(parts[1:], self._seconds[1:], strict=True):
            times = times + part * ((seconds or 1.0) / (self._seconds[0] or 1.0))
        return times

    def report(self, report: Report) -> None:
        """Report how many samples are none by the description."""
        for i, count in self._missing.items():
            message = f"{count} samples are numbers that the import description calls missing: NaN"
            report(Finding("missing_values", self.group.channels[i].name, self._first[i], message))


def _no_clock(column: TimeColumn, times: Samples | None) -> str:
    """Why a column is no clock beside a rate that is stated, by its first ``times``; empty if it is one."""
    if column.assumed or column.seconds_per_unit is None:
        return "is named as time, and has no unit of time"
    steps = np.diff(np.empty(0) if times is None else times[np.isfinite(times)])
    stands = int(np.count_nonzero(steps <= 0))
    if times is not None and len(times) > 1 and (not len(steps) or stands > max(1.0, _FEW_FALLS * len(steps))):
        return f"is named as time, and falls or stands still in {stands} of its first {len(steps)} steps"
    return ""


def _place(group: Group, name: str) -> int | None:
    """The only channel of this name as written, or without its unit."""
    places = by_name(group.channels).get(name, [])
    return places[0] if len(places) == 1 else None


def _point(text: str) -> StartTime | None:
    """The point in time from which a unit counts; also dates before the age of loggers, as of serial days."""
    text = text.strip()
    if text == "1970":
        return SINCE_1970
    if (found := start_at(text, f"since {text}")) is not None:
        return replace(found, uncertainty_s=None)
    return StartTime(f"{text}T00:00:00", f"since {text}") if re.fullmatch(r"1[6-9]\d\d-\d\d-\d\d", text) else None


def _first_times(recording: Recording, name: str) -> dict[str, float]:
    """The first time of the first group that has this column."""
    for block in recording.blocks(lambda finding: None):
        place = _place(block.group, name)
        times = block.columns[place] if place is not None else np.empty(0)
        if len(given := times[np.isfinite(times)]):
            return {block.group.name: float(given[0])}
    return {}


def _beginnings(recording: Recording) -> dict[str, tuple[Samples, ...]]:
    """The first block of each group of which the columns of time are to be judged."""
    found: dict[str, tuple[Samples, ...]] = {}
    for block in recording.blocks(lambda finding: None):
        found.setdefault(block.group.name, block.columns)
        if all(group.name in found for group in recording.groups):
            break
    return found


def _in_zone(point: StartTime, zone: str, then: StartTime) -> StartTime:
    """A point of local time in the zone that is stated, with the offset from UTC that the zone had ``then``."""
    if point.has_zone or not zone:
        return point
    offset = zone.upper().replace("UTC", "Z")
    if (stated := _OFFSET.fullmatch(zone)) is None:
        local = datetime.fromisoformat(then.time[:26]).replace(tzinfo=ZoneInfo(zone))
        offset = local.isoformat()[-6:]
    elif stated[1]:
        offset = f"{stated[1]}{stated[2]}:{stated[3]}"
    return replace(point, time=f"{point.time}{offset}")
