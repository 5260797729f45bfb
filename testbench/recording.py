"""A recording: groups of channels with their clock, data in blocks, and findings about what is odd in it.

A finding has a code, which says how grave it is. An ``error`` cannot be distinguished from loss: the log is refused
until a person accepts it. A ``warning`` is kept and flagged. A ``note`` is stated, and no reason to stop.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from balance.results import Brief, Key, document, first_of

from .errors import RecordingError


class Severity(IntEnum):
    """How grave a finding is."""

    NOTE = 0
    WARNING = 1
    ERROR = 2


_ERRORS = {
    "empty_file": "The file has no content.",
    "no_data": "There is a header, and no row of numbers under it.",
    "not_text": "The content is no text: an archive, a spreadsheet, a binary file.",
    "other_format": "A format that no installed reader reads.",
    "text_row": "A row of text between the rows of numbers, such as another header.",
    "nul_bytes": "NUL bytes inside the text, as a logger leaves them when its power fails.",
    "line_too_long": "A line longer than any logger writes.",
    "unknown_encoding": "The encoding of the text cannot be determined.",
    "unknown_dialect": "Delimiter and decimal mark cannot be determined.",
    "decimal_mark_changes": "Some numbers carry another decimal mark than the first lines.",
    "ambiguous_number": "A number in another notation than the first ones, or with marks that may be of thousands.",
    "ambiguous_date": "Dates in which day and month cannot be distinguished; their times are left out if accepted.",
    "ragged_row": "A row with more or fewer fields than the header; its values are NaN if accepted.",
    "time_not_increasing": "Time that falls or stands still.",
    "time_unit_contradiction": "The time column carries no unit, and seconds contradict a stated rate or the motion.",
    "origin_contradiction": "The log says simulated, the run table says otherwise.",
    "count_contradiction": "The header declares another number of samples than the file holds.",
    "cut_file": "The file ends before its own structure says: samples that were recorded are missing.",
    "damaged_file": "A structure that contradicts itself; nothing of it can be trusted.",
    "too_large": "More declared or unpacked than such a file can hold; refused to protect the machine.",
    "stored_run": "A run that a campaign holds, or its archive, and no log.",
    "not_stored": "The run could not be stored, for a reason that lies not in the log alone.",
    "rig_contradiction": "The rig names channels that the recording does not hold, or other units than its.",
    "channel_not_found": "The import description names a channel that no log of the command holds.",
    "logger_twice": "Two logs of a run hold the same channels of a logger, as where a run table uses one name twice.",
    "calibration_contradiction": "A calibration of the rig that does not lead from the log's unit to what is measured.",
    "unknown_site": "The run table puts a counter-mass or payload where the rig's mechanism has no such site or body.",
}
_WARNINGS = {
    "cut_last_row": "The file ends inside a row, or in a number that may be cut, which is left out.",
    "not_a_number": "Cells that are no finite number. Kept as inf where so written, otherwise as NaN. Analyses "
    "interpolate up to 3 in a row, away from peaks, leave out as many rows at the ends of a record, and refuse more.",
    "text_channel": "A channel of text that is not kept.",
    "repeated_header": "The header comes again inside the file: several recordings, kept as separate groups.",
    "no_header": "The first row is data; the columns are named col0, col1, ...",
    "duplicate_names": "Several channels of one name.",
    "several_clocks": "Several columns of time in one table: each with the columns behind it is a group of its own.",
    "time_unit_unknown": "The unit of the time column is no unit of time; there is no rate.",
    "time_coarse": "Times written so coarsely that they repeat: a channel, and no clock.",
    "time_unreadable": "Times that are no finite number; the steps next to them are not counted.",
    "time_gap": "A step of time much longer than the others.",
    "time_irregular": "Steps of time too scattered for a sampling rate.",
    "time_set_aside": "A column named as time that is no clock: the rate of the import description is taken.",
    "event_times": "A column of times alone: events, such as edges, and no sampled signal.",
    "no_clock": "Neither a time column nor a declared rate.",
    "rate_doubtful": "Times in few digits, taken as rounded: samples lost as evenly would look the same.",
    "time_unit_assumed": "The time column carries no unit: seconds were assumed, which nothing of the run shows.",
    "rate_contradiction": "The rates of the header, the import description and the steps of the time column differ.",
    "clipping": "Samples at the limit of the sensor's range.",
    "clipping_suspected": "Flat tops at the largest or smallest value, as a saturated sensor leaves them.",
    "coded_values": "Codes of overflow or of missing values among the samples, such as 9.9E37 or -9999; kept.",
    "constant_channel": "A channel of one single value: a dead, stuck or unused one.",
    "not_finalized": "The logger left counts and lengths unwritten, and says so; all whole records are read.",
    "appended_blocks": "More samples than declared, in whole blocks: each is a group of its own.",
    "header_contradiction": "A header that says something else than the data, which are whole and read as they are.",
    "duplicate_dof": "Several channels of one node and direction.",
    "unit_doubtful": "A unit that does not go with the channel's name, such as a force in g; kept as written.",
    "invalid_samples": "Samples that the file itself marks as invalid; NaN.",
    "not_exact": "Integers beyond 2**53, which do not fit float64 to the last digit.",
    "left_out": "Something that is no series of numbers; it is not kept as data.",
    "outside_reference": "An object that lies in another file, which is never opened; left out.",
    "broken_link": "A link inside the file that leads nowhere; left out.",
    "cyclic_link": "A link inside the file that leads back to where it comes from; left out.",
    "already_stored": "The campaign holds this recording already; nothing was written.",
    "run_not_opened": "A run of the campaign cannot be opened; whether it holds this recording too is unknown.",
    "log_missing": "The run table names a log that was not given: its run is not stored yet.",
    "condition_contradiction": "A peak acceleration of a kind that the motion has not, or a payload without a body.",
    "duration_contradiction": "A log that lasts less than a tenth of the motion that the run table names.",
    "unknown_motion": "A motion of the run table that is no file, and nearly the name of one; none is stored.",
    "input_not_stored": "The mechanism or the motion of the run cannot be read, so it is not stored with the run.",
    "conditions_differ": "The run table has another run, origin or condition than is stored, which never changes.",
    "rig_differs": "The run is stored with another rig, or without one, and never changes: take another folder.",
    "rate_contradicts_rig": "A log's rate is not the one that the rig states for its logger; the log's is taken.",
    "sensor_not_recorded": "The rig describes a logger of which no log of the run holds a channel.",
    "few_samples": "One to three samples of a logger of the rig: its sensors say nothing in this run.",
    "uncalibrated": "Raw values, such as volts, of a sensor without a calibration: no analysis can use them yet.",
    "interrupted": "The ingest was stopped; what it had acknowledged was recovered, what came after is not in the run.",
    "incomplete": "The log of a stored run has more than was stored; its next version is not stored yet.",
    "unit_unknown": "Brackets in a header that hold no unit that is understood; kept as written.",
}
_NOTES = {
    "continued": "The log has grown since its beginning was stored; the run holds all of it, and counts instead.",
    "simulated": "The log says that it is simulated.",
    "dialect": "Delimiter, decimal mark and encoding as detected in the first lines.",
    "missing_values": "Samples that are none, by the words and numbers of the import description; NaN.",
    "normal_finding": "A finding that the import description calls normal for its logger.",
    "text_kept": "A channel of text, kept beside the numbers: each text with the sample from which on it stands.",
    "hidden_cells": "Rows, columns or a worksheet that the spreadsheet hides; they are kept.",
    "calculated_cells": "Values that the spreadsheet program calculated, as it stored them.",
    "encoding_inferred": "The encoding was inferred from typical letters; it is declared nowhere.",
    "unit_missing": "Channels without a unit.",
    "unit_inferred": "Units behind a slash in names, such as F/N, as ISO 80000-1 has quantity and unit.",
    "no_final_newline": "The last line has no end, but every number of it is as long as those above.",
    "comment_inside": "Comment lines between the rows.",
    "blank_lines": "Blank lines between the rows.",
    "time_as_text": "Times that are no plain numbers, such as 12:00:01.5: exactly the seconds from the first one.",
    "thousands_marks": "Numbers with marks between thousands, which were taken off beyond doubt.",
    "number_notation": "Numbers such as 1.5D+03, 0x1F, or with a typographic minus, read as what they say.",
    "time_jitter": "Steps of time that scatter.",
    "time_unit_confirmed": "The time column carries no unit: seconds, by a stated rate, another clock or the motion.",
    "empty_group": "Channels without a single sample; left out.",
    "rate_rounded": "Rate or step of time is written in few digits, or differs a little from the time column.",
    "time_resolution": "Timestamps are finer than seconds in float64; what is finer is in a channel of its own.",
    "sensor_elsewhere": "A logger of the rig whose channels another log of the same command holds, a run of its own.",
    "channel_elsewhere": "A channel that the import description names, and that another log of the same command holds.",
    "calibration_applied": "Values are in physical units by the calibration that the file itself carries.",
}

MEANING = {**_ERRORS, **_WARNINGS, **_NOTES}
"""Every code, and what it means."""


@dataclass(frozen=True)
class Finding:
    """Something odd: its code, the channel and place (``line 62``) where there is one, and a message.

    ``group`` is the channel's, where the run has several and the channel does not say which; see ``findings_by_group``.

    >>> import testbench
    >>> sorted({finding.code for finding in testbench.open_run("campaign/r001.h5").findings})
    ['dialect', 'simulated']
    """

    code: Annotated[str, Key()]
    channel: Annotated[str | None, Key()]
    where: Annotated[str | None, Key()]
    message: Annotated[str, Key()]
    group: Annotated[str | None, Key(optional=True)] = None

    @property
    def severity(self) -> Severity:
        """How grave findings of this code are."""
        if self.code in _ERRORS:
            return Severity.ERROR
        return Severity.WARNING if self.code in _WARNINGS else Severity.NOTE

    def as_dict(self) -> dict[str, str | None]:
        """The finding as it is printed and stored; the group only where there is one."""
        return document(self)


def worst_severity(findings: Iterable[Finding]) -> Severity:
    """The gravest severity among ``findings``; a note if there are none."""
    return max((f.severity for f in findings), default=Severity.NOTE)


def refusing_findings(findings: Iterable[Finding], accepted: Iterable[str] = ()) -> list[Finding]:
    """The findings for which a recording is refused, unless a person accepts their codes."""
    allowed = frozenset(accepted)
    return [f for f in findings if f.severity is Severity.ERROR and f.code not in allowed]


class Refusal(RecordingError):
    """A file that cannot be read at all, with the finding that says why: ``no_data`` where it is no error by itself."""

    def __init__(self, name: str, finding: Finding) -> None:
        if finding.severity is not Severity.ERROR:
            finding = replace(finding, code="no_data")
        place = f", {finding.where}" if finding.where else ""
        super().__init__(f"{name}{place}: {finding.message}")
        self.finding = finding


Origin = Literal["measured", "simulated", "unstated"]


def common_origin(origins: "Iterable[Origin]") -> "Origin":
    """That of several recordings: measured only if every one is; simulated if any is."""
    every = set(origins)
    if len(every) == 1:
        return every.pop()
    return "simulated" if "simulated" in every else "unstated"


Samples = NDArray[np.float64]
Report = Callable[[Finding], None]


class Conditions(TypedDict, total=False):
    """What a run was made with, from the run table; what it leaves empty is absent."""

    payload_kg: float
    payloads: dict[str, float]
    counter_masses: dict[str, float]
    motion: str
    peak_acceleration_g: float
    peak_acceleration_rad_s2: float
    repeat: int


_PAYLOAD = re.compile(r'<text name="payload" data="([^" ]+)" */>')
"""How a mechanism's text names one body as its payload."""


def payload_body(inputs: Mapping[str, Sequence[str]]) -> str | None:
    """The one body that the mechanism stored with a run, of ``Run.inputs``, names as its payload; None without one."""
    found = _PAYLOAD.search(inputs["mechanism"][1]) if "mechanism" in inputs else None
    return found[1] if found else None


def with_one_payload(stated: Conditions, body: str | None) -> Conditions:
    """The same with a payload above zero that is stated of ``body``, which carries the payload, as ``payload_kg``."""
    rest = dict(stated.get("payloads", {}))
    if body is None or "payload_kg" in stated or not rest.get(body, 0.0) > 0.0:
        return stated
    found: Conditions = {**stated, "payload_kg": rest.pop(body), "payloads": rest}
    if not rest:
        del found["payloads"]
    return found


def mounted_masses(stated: Conditions, key: Literal["payloads", "counter_masses"]) -> dict[str, float]:
    """Those above zero, by body or site [kg]: zero is none, as where the run table names none."""
    return {name: mass for name, mass in stated.get(key, {}).items() if mass > 0.0}


def payload_text(stated: Conditions) -> str:
    """``5 kg, tip 0.1 kg``; empty where none is stated."""
    whole = [f"{stated['payload_kg']:g} kg"] if "payload_kg" in stated else []
    return ", ".join([*whole, *(f"{name} {mass:g} kg" for name, mass in stated.get("payloads", {}).items())])


def peak_text(stated: Conditions) -> str:
    """Peak acceleration with its unit, ``3 g0`` or ``60 rad/s2``; empty where none is stated."""
    keys = (("peak_acceleration_g", "g0"), ("peak_acceleration_rad_s2", "rad/s2"))
    return ", ".join(f"{stated[key]:.9g} {unit}" for key, unit in keys if key in stated)  # type: ignore[literal-required]


LONGEST_NAME = 1000
"""Letters of a name or unit; what is longer is cut, and ends with dots."""


def storable_name(text: str) -> str:
    """A name that HDF5 can hold: no NUL, no half of a letter, and no more than a thousand letters."""
    plain = text.replace("\0", "\N{SYMBOL FOR NULL}").encode("utf-8", "replace").decode("utf-8")
    return plain if len(plain) <= LONGEST_NAME else f"{plain[: LONGEST_NAME - 3]}..."


@dataclass(frozen=True)
class Channel:
    """One column, with its name and unit exactly as the logger wrote them, and the name without the unit."""

    name: Annotated[str, Key("", "channel")]
    unit: Annotated[str | None, Key("", "unit")] = None
    label: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", storable_name(self.name))
        object.__setattr__(self, "label", storable_name(self.label or self.name))
        if self.unit is not None:
            object.__setattr__(self, "unit", storable_name(self.unit) or None)

    @property
    def names(self) -> frozenset[str]:
        """What a rig may call it: as written in the log, or without the unit."""
        return frozenset({self.name, self.label})


def by_name(channels: "Iterable[Channel]") -> "dict[str, list[int]]":
    """Places of channels, from zero, by what a rig may call them: several where that does not tell one.

    A name as written comes before another's without its unit.
    """
    labels, names = dict[str, list[int]](), dict[str, list[int]]()
    for place, channel in enumerate(channels):
        labels.setdefault(channel.label, []).append(place)
        names.setdefault(channel.name, []).append(place)
    return labels | names


def of_one_name(channels: "Sequence[Channel]", places: "Sequence[int]") -> str:
    """That channels at these places have one name, and what tells one of them."""
    named = list(dict.fromkeys(channels[place].name for place in places))
    shown = first_of((f"channel {place + 1} ({channels[place].name!r})" for place in places), 4)
    cure = f"name one as it is written, such as {named[0]!r}"
    if len(named) < len(places):
        last, other = places[-1] + 1, f"{channels[places[-1]].label} {len(places)}"
        cure = f'give all but one another name, "channel {last}" = "{other}" and so on, below [channels] of an import '
        cure += "description (testbench describe LOG writes one; --as)"
    return f"{shown} have this name: {cure}"


@dataclass(frozen=True)
class UniformClock:
    """A declared rate: sample ``i`` was taken at ``start_s + i / rate_hz``."""

    rate_hz: float
    start_s: float = 0.0

    def times(self, begin: int, end: int) -> Samples:
        """Time of the samples from ``begin`` to ``end``, (end - begin,) [s]; each by its index, so that none drifts."""
        times = np.arange(begin, end, dtype=np.float64)
        times /= self.rate_hz
        times += self.start_s
        return times


@dataclass(frozen=True)
class TimeColumn:
    """A recorded time: the channel of this index, the seconds in one of its units (None: unknown unit).

    ``assumed`` says that the column carries no unit and seconds were taken.
    """

    index: int
    seconds_per_unit: float | None = 1.0
    assumed: bool = False


Clock = UniformClock | TimeColumn


def clock_from_dict(document: Mapping[str, Any] | None) -> Clock | None:
    """The clock that ``asdict`` of it describes; None of None."""
    if document is None:
        return None
    return UniformClock(**document) if "rate_hz" in document else TimeColumn(**document)


_ZONE = re.compile(r"(?:Z|([+-])(\d\d):(\d\d))$")
_SECOND_NS = 1_000_000_000
_NANOSECONDS_UPTO = 1e5
"""Seconds up to which float64 holds nanoseconds with room to spare; larger ones are taken to the microsecond."""
_EARLIEST_NS, _LATEST_NS = -(10**9) * _SECOND_NS, 8 * 10**9 * _SECOND_NS
"""1938 and 2223 [ns since 1970]: a date beyond them is one that was never set."""


@dataclass(frozen=True)
class StartTime:
    """A point in time by the calendar: ISO 8601, with its offset from UTC where the log states one (Z: UTC itself).

    ``source`` is what in the log states it; ``uncertainty_s`` is the last digit as written [s], the error of the
    logger's clock not in it; None: unknown.
    """

    time: Annotated[str, Key()]
    source: Annotated[str, Key()]
    uncertainty_s: Annotated[float | None, Key()] = None

    @property
    def has_zone(self) -> bool:
        """Whether it is the same everywhere, and no local time whose zone nobody states."""
        return _ZONE.search(self.time) is not None

    @property
    def nanoseconds(self) -> int:
        """Since 1970 in UTC, or in its own zone where that is not stated [ns]."""
        return int(np.datetime64(_ZONE.sub("", self.time), "ns").astype(np.int64)) - 60 * self._minutes * _SECOND_NS

    @property
    def _minutes(self) -> int:
        zone = _ZONE.search(self.time)
        return int(f"{zone[1]}1") * (60 * int(zone[2]) + int(zone[3])) if zone and zone[1] else 0

    def __str__(self) -> str:
        known = "" if self.uncertainty_s is None else f", to {self.uncertainty_s:g} s"
        return f"{self.time}{'' if self.has_zone else ', zone not stated'} ({self.source}{known})"

    def later(self, seconds: float) -> "StartTime | None":
        """The point ``seconds`` later; None if it is beyond any that a logger means."""
        step = 1 if abs(seconds) < _NANOSECONDS_UPTO else 1000
        coarse = self.uncertainty_s if step == 1 else max(self.uncertainty_s or 0.0, 1e-6)
        after = round(seconds * _SECOND_NS / step) * step
        return point_in_time(self.nanoseconds + after, self.source, coarse, self._minutes if self.has_zone else None)


def point_in_time(
    nanoseconds: int, source: str, uncertainty_s: float | None = None, minutes: int | None = 0
) -> StartTime | None:
    """The point that lies ``nanoseconds`` after 1970 in UTC; None if it is beyond any that a logger means.

    ``minutes`` is the offset of its zone from UTC; None: no zone is stated, and the nanoseconds are of local time.
    """
    if not _EARLIEST_NS < nanoseconds < _LATEST_NS:
        return None
    local = np.datetime64(nanoseconds + 60 * (minutes or 0) * _SECOND_NS, "ns")
    text = np.datetime_as_string(local).rstrip("0").rstrip(".")
    zone = "" if minutes is None else "Z" if not minutes else f"{'-' if minutes < 0 else '+'}{abs(minutes) // 60:02}:"
    return StartTime(f"{text}{zone}{f'{abs(minutes) % 60:02}' if minutes else ''}", source, uncertainty_s)


def earliest(points: "Iterable[StartTime | None]") -> StartTime | None:
    """The first of the points that are known; local times without a zone count only where none has one."""
    known = [point for point in points if point is not None]
    return min(known, key=lambda point: (not point.has_zone, point.nanoseconds), default=None)


@dataclass(frozen=True)
class SensorRange:
    """A range from -limit to +limit in ``unit``, digitised to ``bits``; channels of that unit lie within it."""

    limit: float
    unit: str
    bits: int | None = None


@dataclass(frozen=True)
class Group:
    """Channels sampled together; the time column, if there is one, is among them.

    ``zero`` is when its own time is zero, where the log states that.
    """

    name: Annotated[str, Key()]
    channels: Annotated[tuple[Channel, ...], Key()]
    clock: Clock | None = None
    zero: StartTime | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", storable_name(self.name))


def group_from_dict(document: Mapping[str, Any]) -> Group:
    """The group that ``asdict`` of it describes, as pipes and journals carry it."""
    channels = tuple(Channel(**channel) for channel in document["channels"])
    zero = document.get("zero")
    return Group(document["name"], channels, clock_from_dict(document["clock"]), zero and StartTime(**zero))


def findings_by_group(findings: Iterable[Finding], groups: Sequence[Group], several: bool) -> list[Finding]:
    """Findings about a file's ``groups``, each with its group where there are ``several`` and it is known.

    A check knows its group; a reader's finding about a channel is of the only group that has one of this name.
    """
    found = []
    for finding in findings:
        holders = [g.name for g in groups if any(finding.channel in channel.names for channel in g.channels)]
        own = finding.group or (holders[0] if len(holders) == 1 else None)
        found.append(replace(finding, group=own if several else None))
    return found


@dataclass(frozen=True)
class Block:
    """Successive samples of one group: one float64 column a channel, all (n,), each in its channel's unit.

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


def shown(token: str) -> str:
    """A cell's text for a message: short, without control characters."""
    if not token:
        return "an empty cell"
    plain = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in token[:40])
    return f"'{plain}{'...' if len(token) > 40 else ''}'"


_MOST_TEXT = 1 << 20
"""Letters of text beside the numbers that are kept of one log, which are held in memory."""


@dataclass
class TextSeries:
    """A channel of text beside the numbers of a group: each text, and the sample from which on it stands."""

    group: Annotated[str, Key()]
    channel: Annotated[str, Key()]
    samples: Annotated[list[int], Key()] = field(default_factory=list)
    texts: Annotated[list[str], Key()] = field(default_factory=list)

    @property
    def finding(self) -> Finding:
        """That it is kept, with the first of its texts and the sample at which they begin."""
        said = [text for text in dict.fromkeys(self.texts) if text]
        first = self.samples[self.texts.index(said[0])] if said else 0
        listed = ", ".join(map(shown, said[:3] or [""])) + (", ..." if len(said) > 3 else "")
        message = f"holds text ({listed}), not numbers; it is kept as it is, by the samples where it changes"
        return Finding("text_kept", self.channel, f"sample {first}", message, self.group)


@dataclass
class TextLog:
    """The channels of text of a log, gathered while its blocks are read; those that go beyond a limit are given up."""

    series: dict[tuple[str, str], TextSeries] = field(default_factory=dict)
    given_up: set[tuple[str, str]] = field(default_factory=set)
    front: str = ""
    """What stands before the names of groups where logs of one run share them."""
    _letters: int = field(default=0, compare=False)

    @property
    def kept(self) -> list[TextSeries]:
        """The channels of text that are kept."""
        return [replace(s, group=f"{self.front} {s.group}") if self.front else s for s in self.series.values()]

    def take(self, group: str, channel: str, sample: int, text: str) -> bool:
        """Note that from ``sample`` on the text is this one; False where the channel is given up."""
        key = group, channel
        if key in self.given_up:
            return False
        found = self.series.setdefault(key, TextSeries(group, channel))
        if found.texts[-1:] != [text]:
            found.samples.append(sample)
            found.texts.append(text)
            self._letters += len(text) + 8
        if self._letters > _MOST_TEXT:
            self.given_up.add(key)
            self._letters -= sum(len(one) + 8 for one in self.series.pop(key).texts)
            return False
        return True

    def take_all(self, group: str, channel: str, start: int, texts: Iterable[str | None]) -> None:
        """Note the texts of successive samples, the first of which is ``start``; None is no text."""
        known = self.series.get((group, channel))
        last = known.texts[-1] if known else None
        for i, text in enumerate(texts, start):
            if text != last and not self.take(group, channel, i, text or ""):
                return
            last = text

    def clear(self) -> None:
        """Forget what was read: it is read anew."""
        self.series.clear()
        self.given_up.clear()
        self._letters = 0

    def findings(self) -> list[Finding]:
        """The channels that are kept, and those that are not."""
        message = f"holds texts that change too often to be kept: more than {_MOST_TEXT} letters; it is not kept"
        given_up = [Finding("text_channel", channel, None, message, group) for group, channel in sorted(self.given_up)]
        return [series.finding for series in self.kept] + given_up


@dataclass
class ContentDigest:
    """SHA-256 of a log's bytes, taken as they are read for its blocks; empty until all were, or if nobody wants it."""

    wanted: bool = False
    sha256: str = ""


@dataclass(frozen=True)
class Recording(Brief):
    """A log file, its header read and its data not yet.

    ``read`` yields the data and reports what it finds on the way; a later block may bring a group that the
    header did not announce (a second recording appended to the file).

    >>> import testbench
    >>> testbench.read("log.csv").format
    'CSV'
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
    rate_stated_by: str = "the header"
    findings: tuple[Finding, ...] = ()
    texts: TextLog = field(default_factory=TextLog)
    """Channels of text, there once the blocks are read."""
    content: ContentDigest | None = None
    """Of a reader that reads the whole file once, from its first byte to its last."""

    def blocks(self, report: Report) -> Iterator[Block]:
        """The data in blocks of bounded size; findings on the way go to ``report``."""
        self.texts.clear()
        yield from self.read(report)
        for finding in self.texts.findings():
            report(finding)
