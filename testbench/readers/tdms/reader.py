"""Reader of NI TDMS: channels of one TDMS group that share length and clock are a group.

npTDMS would be silent on much that is odd, and slower where segments are short; the tests hold this reader against it.
Scales of thermocouples, bridges and tables are npTDMS's.
"""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import recording as model
from ...errors import RecordingError
from ...recording import (
    Block,
    Clock,
    Finding,
    Group,
    Recording,
    Refusal,
    Report,
    Samples,
    StartTime,
    TextLog,
    TimeColumn,
    point_in_time,
)
from ...units import seconds_per
from ..byte_source import ByteSource, as_float64, block_spans
from ..csv.header import is_time_name
from ..format_findings import (
    damaged,
    is_beyond_exact,
    names_listed,
    nothing_to_read,
    refusing,
    rounded_integers,
    watch_nonfinite,
)
from ..header_claims import SINCE_1970, clock_of_step, recorded_time
from ..registry import ReadOptions, needs
from .metadata import (
    TIME,
    Channel,
    Contents,
    Property,
    Reading,
    channel_title,
    path_names,
    read_contents,
    timestamp_remainder,
    timestamp_seconds,
)

_MICROSECONDS_UPTO = 1e-4
"""Timestamps are given to the microsecond where their mean step is not below this [s]."""
_CLOCK = ("wf_increment", "wf_start_offset", "wf_start_time")
Raw = Mapping[int | None, NDArray[Any]]
_Gathered = tuple[Group, Sequence[Channel]]
"""Channels of one clock and length."""
_RAW = 0xFFFFFFFF
_MOST_SCALES = 100


def open_tdms(path: Path, options: ReadOptions) -> Recording:
    """Walk through the segments; samples are read when asked for."""
    with ByteSource(path) as source:
        if source.read(0, 4, "the tag") == b"TDSh":
            message = "this is an index of a TDMS file, without samples; give the .tdms file beside it"
            raise Refusal(path.name, Finding("no_data", None, None, message))
        contents = read_contents(source)
        for channel in contents.channels.values():
            _resolve_times(source, channel)
    findings = [*contents.findings]
    gathered = _channel_groups(contents, path.stem)
    if not gathered:
        raise nothing_to_read(path, findings, "no channel of numbers has samples")
    findings += _channel_findings(contents, gathered)
    texts = TextLog()

    def blocks(report: Report) -> Iterator[Block]:
        rounded: set[str] = set()
        with ByteSource(path) as source:
            for group, members in gathered:
                readings = [_Values(source, member, contents) for member in members]
                for start, end in block_spans(members[0].samples, len(group.channels)):
                    columns = tuple(column for reading in readings for column in reading.next(end - start))
                    yield Block(group, columns, start)
                rounded |= {channel_title(reading.path) for reading in readings if reading.is_rounded}
            _take_texts(source, contents, gathered, texts)
        for name in sorted(rounded):
            report(rounded_integers(name))

    return Recording(
        path=path,
        format="NI TDMS",
        reader="testbench.readers.tdms",
        groups=tuple(group for group, _ in gathered),
        read=lambda report: watch_nonfinite(blocks(report), report),
        metadata={
            ": ".join(filter(None, ["/".join(path_names(path)), name])): str(value)
            for path, properties in contents.properties.items()
            for name, value in properties.items()
        },
        findings=tuple(findings),
        texts=texts,
    )


def _resolve_times(source: ByteSource, channel: Channel) -> None:
    """How fine the timestamps of a channel are to be given, and whether they are finer still."""
    if channel.kind != TIME or not channel.length:
        return
    reading = Reading(source, channel.spans[None], f"channel {channel.path!r}")
    ends = []
    for start, end in block_spans(channel.length, 2):
        timestamps = reading.next(end - start)
        seconds = timestamp_seconds(timestamps)
        ends += [seconds[0], seconds[-1]]
        channel.has_remainder |= bool(timestamp_remainder(timestamps, seconds).any())
    channel.to_microseconds = ends[-1] - ends[0] >= _MICROSECONDS_UPTO * (channel.length - 1)


def _channel_groups(contents: Contents, stem: str) -> list[_Gathered]:
    """Groups of channels of one TDMS group, clock and length."""
    by_group: dict[str, list[Channel]] = {}
    for path, channel in contents.channels.items():
        if channel.length:
            by_group.setdefault(next(iter(path_names(path)), stem), []).append(channel)
    found: list[_Gathered] = []
    is_cut = any(finding.code == "cut_file" for finding in contents.findings)
    for name, channels in by_group.items():
        longest = max(channel.length for channel in channels)
        for channel in channels if is_cut else ():  # some end up to a chunk before others: with NaN there
            if all(longest - spans.length <= max(spans.counts) for spans in channel.spans.values()):
                channel.lacking = longest - channel.length
        parts: dict[tuple[object, ...], list[Channel]] = {}
        for channel in channels:
            stated = contents.properties.get(channel.path, {})
            parts.setdefault((channel.samples, _seconds_per(stated), *(stated.get(key) for key in _CLOCK)), []).append(
                channel
            )
        changed = {(change.path, change.name) for change in contents.contradicted}
        for members in parts.values():
            whole = name if len(parts) == 1 else f"{name} {channel_title(members[0].path)}"
            own = tuple(c for m in members for c in _channels(m, contents.properties.get(m.path, {})))
            stated = dict(contents.properties.get(members[0].path, {}))
            if any((member.path, "wf_increment") in changed for member in members):
                stated.pop("wf_increment", None)
            group = Group(whole, own, _clock(members, own, stated), _zero(members, stated, contents))
            found.append((group, members))
    return found


def _channels(member: Channel, stated: dict[str, Property]) -> list[model.Channel]:
    name = channel_title(member.path)
    unit = str(stated.get("unit_string") or stated.get("NI_UnitDescription") or "") or None
    if member.kind == TIME:
        return [model.Channel(name, "s"), *([model.Channel(f"{name} remainder", "s")] if member.has_remainder else [])]
    if any(spans.kind.kind == "c" for spans in member.spans.values()):
        return [model.Channel(f"{name} ({part})", unit) for part in ("real", "imag")]
    return [model.Channel(name, unit)]


def _clock(members: Sequence[Channel], channels: Sequence[model.Channel], stated: dict[str, Property]) -> Clock | None:
    """A recorded time, as timestamps or named so; else the declared step."""
    timestamps = [channel_title(member.path) for member in members if member.kind == TIME]
    if len(timestamps) == 1:
        return TimeColumn([channel.name for channel in channels].index(timestamps[0]), 1.0)
    named = [i for i, channel in enumerate(channels) if is_time_name(channel.label)]
    if len(named) == 1 and len(channels) > 1:
        return recorded_time(named[0], channels[named[0]].unit)
    step, start = stated.get("wf_increment"), stated.get("wf_start_offset", 0.0)
    factor = _seconds_per(stated)
    if isinstance(step, float) and factor is not None and isinstance(start, int | float):
        return clock_of_step(step * factor, start * factor)
    return None


def _zero(members: Sequence[Channel], stated: dict[str, Property], contents: Contents) -> StartTime | None:
    """When the time of a group is zero: 1970 of timestamps, else its first ``wf_start_time``."""
    if sum(member.kind == TIME for member in members) == 1:
        return SINCE_1970
    changed = [c.before for c in contents.contradicted if (c.path, c.name) == (members[0].path, "wf_start_time")]
    start = next(iter(changed), stated.get("wf_start_time"))
    if not isinstance(start, float):
        return None
    return point_in_time(round(start * 1e6) * 1000, "wf_start_time", 1e-6)


def _seconds_per(stated: dict[str, Property]) -> float | None:
    """Seconds in the unit of the abscissa; None if that is no time, as of a spectrum."""
    unit, name = stated.get("wf_xunit_string"), stated.get("wf_xname") or "Time"
    return seconds_per(str(unit)) if unit else 1.0 if is_time_name(str(name)) else None


def _take_texts(source: ByteSource, contents: Contents, gathered: Sequence[_Gathered], texts: TextLog) -> None:
    """The texts of each channel of text: in a chunk the ends of all, numbers of 32 bits, then their letters."""
    names = {next(iter(path_names(members[0].path)), ""): group.name for group, members in reversed(gathered)}
    for path, channel in contents.channels.items():
        title, sample = channel_title(path), 0
        group = names.get(next(iter(path_names(path)), ""), "/")
        for span in channel.texts:
            raw = source.read(span.offset, span.bytes, f"the texts of {title!r}")
            if span.bytes < 4 * span.texts:
                raise damaged(source.path, f"channel {title!r}: {span.texts} texts in {span.bytes} bytes")
            ends = np.frombuffer(raw, f"{span.order}u4", span.texts).tolist()
            letters = raw[4 * span.texts :]
            for begin, end in pairwise([0, *ends]):
                if not texts.take(group, title, sample, letters[begin:end].decode("utf-8", "replace")):
                    break
                sample += 1


class _Values:
    """The physical values of one channel, from first to last."""

    def __init__(self, source: ByteSource, member: Channel, contents: Contents) -> None:
        self.path, self.is_rounded, self._member = member.path, False, member
        self._file, self._what = source.path, f"channel {channel_title(member.path)!r}"
        self._readings = {scale: Reading(source, spans, self._what) for scale, spans in member.spans.items()}
        group = member.path[: member.path.rfind("/'")]
        owners = (contents.properties.get(p, {}) for p in (member.path, group, "/"))
        self._scaling = Scaling(next((stated for stated in owners if "NI_Number_Of_Scales" in stated), {}))
        self._left = member.length

    def next(self, count: int) -> tuple[Samples, ...]:
        """The next values, NaN behind the last one: one column, or two of complex numbers."""
        there = min(count, self._left)
        self._left -= there
        columns = self._there(there) if there else (np.empty(0),) * len(_channels(self._member, {}))
        return columns if there == count else tuple(np.append(c, np.full(count - there, np.nan)) for c in columns)

    def _there(self, count: int) -> tuple[Samples, ...]:
        raw = {scale: reading.next(count) for scale, reading in self._readings.items()}
        first = next(iter(raw.values()))
        if first.dtype.names:
            seconds = timestamp_seconds(first, self._member.to_microseconds)
            return (seconds, timestamp_remainder(first, seconds)) if self._member.has_remainder else (seconds,)
        if first.dtype.kind == "c":
            return (as_float64(first.real), as_float64(first.imag))
        if first.dtype.kind in "iu" and first.dtype.itemsize == 8:
            self.is_rounded |= is_beyond_exact(first.astype(np.float64))
        errors = (KeyError, ValueError, TypeError, IndexError, OverflowError)
        with refusing(self._file, f"the scale of {self._what}", *errors), np.errstate(all="ignore"):
            values = self._scaling.physical(raw)
        if len(values) != count:
            raise damaged(self._file, f"{self._what}: its scale gives {len(values)} values of {count}")
        return (values,)


def _channel_findings(contents: Contents, gathered: Sequence[_Gathered]) -> list[Finding]:
    """Timestamps finer than float64, scales, properties that change in the midst of samples, empty channels."""
    findings = []
    members = [member for _, own in gathered for member in own]
    for member in members:
        if member.has_remainder:
            name = channel_title(member.path)
            fine = "whole microseconds" if member.to_microseconds else "float64, which resolves 0.24 µs"
            message = f"timestamps are seconds since 1970 to {fine}; what is finer is in {f'{name} remainder'!r}"
            findings.append(Finding("time_resolution", name, None, message))
    for member in members:
        scaling = Scaling(contents.properties.get(member.path, {}))
        if scaling.applies:
            message = f"raw values were made physical by {scaling.count} scales of the file"
            findings.append(Finding("calibration_applied", channel_title(member.path), None, message))
    for change in contents.contradicted:  # by the format the last one holds for all
        last = "there is no rate" if change.name == "wf_increment" else "the last one of the file is taken for all"
        parts = f"{change.before!r} up to sample {change.samples} and {change.after!r} from there"
        message, place = f"{change.name} is {parts}: {last}", f"sample {change.samples}"
        findings.append(Finding("header_contradiction", channel_title(change.path), place, message))
    empty = [channel_title(p) for p, c in contents.channels.items() if not c.length and not c.texts and path_names(p)]
    if empty:
        message = f"no sample in {names_listed(empty)}"
        findings.append(Finding("empty_group", None, None, message))
    return findings


class Scaling:
    """The chain of scales of a channel; the last one gives the physical value."""

    def __init__(self, properties: Mapping[str, Property]) -> None:
        self._properties = properties
        count = properties.get("NI_Number_Of_Scales", 0)
        self.count = count if isinstance(count, int) else 0

    @property
    def applies(self) -> bool:
        """Whether raw values are not physical already."""
        return self.count > 0 and self._properties.get("NI_Scaling_Status", "unscaled") != "scaled"

    def physical(self, raw: Raw) -> Samples:
        """Physical values of raw numbers."""
        if not self.applies:
            return as_float64(next(iter(raw.values())))
        if self.count > _MOST_SCALES:
            raise ValueError(f"{self.count} scales")
        kinds = {self._properties.get(f"NI_Scale[{i}]_Scale_Type") for i in range(self.count)}
        if kinds <= {"Linear", "Polynomial", None}:  # of the laws below, or numbers of a DAQmx device as they are
            return self._scaled(self.count - 1, raw, 0)
        try:  # scales of thermocouples, bridges, tables and the like
            library = import_module("nptdms.scaling")  # numbers alone go to it, no bytes of the file
        except ModuleNotFoundError as error:
            raise RecordingError(f"the scales of this TDMS file need npTDMS: pip install '{needs('tdms')}'") from error
        scaling = library.get_scaling(self._properties, {}, {})
        if scaling is None:
            raise ValueError(f"scales {kinds} are not known")
        scaled = scaling.scale(next(iter(raw.values()))) if None in raw else scaling.scale_daqmx(raw)
        return np.asarray(scaled, dtype=np.float64)

    def _scaled(self, index: int, raw: Raw, depth: int) -> Samples:
        name = f"NI_Scale[{index}]"
        kind = self._properties.get(f"{name}_Scale_Type")
        if kind is None:  # the number that a DAQmx device wrote under this scale
            return np.asarray(raw[index] if index in raw else next(iter(raw.values())), dtype=np.float64)
        if depth > self.count:
            raise ValueError(f"{name} takes its input from itself")
        source = int(self._properties.get(f"{name}_{kind}_Input_Source", _RAW))
        first = np.asarray(next(iter(raw.values())), dtype=np.float64) if source == _RAW else None
        values = self._scaled(source, raw, depth + 1) if first is None else first
        if kind == "Linear":
            # y = slope * x + intercept
            slope, intercept = (float(self._properties[f"{name}_Linear_{key}"]) for key in ("Slope", "Y_Intercept"))
            return values * slope + intercept
        # y = c0 + c1 x + c2 x^2 + ...
        count = int(self._properties.get(f"{name}_Polynomial_Coefficients_Size", 4))
        if not 0 < count <= 100:
            raise ValueError(f"{name} has {count} coefficients")
        coefficients = [float(self._properties[f"{name}_Polynomial_Coefficients[{i}]"]) for i in range(count)]
        return np.asarray(np.polynomial.polynomial.polyval(values, coefficients), dtype=np.float64)
