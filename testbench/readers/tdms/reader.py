"""Reader of NI TDMS: channels of one TDMS group that share length and clock are a group."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ... import recording as model
from ...findings import Finding, Refusal
from ...recording import Block, Clock, Group, Recording, Report, Samples, TimeColumn
from ...units import seconds_per
from ..csv.names import is_time
from ..declared import by_step
from ..nonfinite import watched
from ..registry import Reader, ReadOptions, needs
from ..stream import ByteSource, as_float64, block_samples, damaged, refusing
from . import types
from .contents import Channel, Contents, changed, names, read, title
from .metadata import Property
from .scaling import Scaling
from .spans import Reading

_EXACT = 2.0**53
_MICROSECONDS_UPTO = 1e-4
"""Timestamps are given to the microsecond where their mean step is not below this [s]."""
_CLOCK = ("wf_increment", "wf_start_offset", "wf_start_time")


@dataclass(frozen=True)
class _Gathered:
    """Channels of one clock and length."""

    group: Group
    members: tuple[Channel, ...]
    samples: int


def open_tdms(path: Path, options: ReadOptions) -> Recording:
    """Walk through the segments; samples are read when asked for."""
    with ByteSource(path) as source:
        if source.read(0, 4, "the tag") == b"TDSh":
            message = "this is an index of a TDMS file, without samples; give the .tdms file beside it"
            raise Refusal(path.name, Finding("no_data", None, None, message))
        contents = read(source)
        for channel in contents.channels.values():
            _judge_times(source, channel)
    findings = [*contents.findings, *_texts(contents)]
    gathered = _gather(contents, path.stem)
    if not gathered:
        raise Refusal(path.name, next(iter(findings), Finding("no_data", None, None, "no channel has samples")))
    findings += _said(contents, gathered)
    return Recording(
        path=path,
        format="NI TDMS",
        reader="testbench.readers.tdms",
        groups=tuple(each.group for each in gathered),
        read=lambda report: watched(_blocks(path, contents, gathered, report), report),
        metadata=_metadata(contents),
        findings=tuple(findings),
    )


def _judge_times(source: ByteSource, channel: Channel) -> None:
    """How fine the timestamps of a channel are to be given, and whether they are finer still."""
    if channel.kind != types.TIME or not channel.length:
        return
    reading = Reading(source, channel.spans[None], f"channel {channel.path!r}")
    ends, step = [], block_samples(2)
    for start in range(0, channel.length, step):
        stamps = reading.next(min(step, channel.length - start))
        seconds = types.seconds(stamps)
        ends += [seconds[0], seconds[-1]]
        channel.has_remainder |= bool(types.remainder(stamps, seconds).any())
    channel.to_microseconds = ends[-1] - ends[0] >= _MICROSECONDS_UPTO * (channel.length - 1)


def _gather(contents: Contents, stem: str) -> list[_Gathered]:
    """Groups of channels of one TDMS group, clock and length."""
    by_group: dict[str, list[Channel]] = {}
    for path, channel in contents.channels.items():
        if channel.length:
            by_group.setdefault(next(iter(names(path)), stem), []).append(channel)
    found = []
    for name, channels in by_group.items():
        if contents.is_cut:
            _trim(channels)
        parts: dict[tuple[object, ...], list[Channel]] = {}
        for channel in channels:
            said = contents.properties.get(channel.path, {})
            parts.setdefault((channel.length, _seconds_per(said), *(said.get(key) for key in _CLOCK)), []).append(
                channel
            )
        for members in parts.values():
            whole = name if len(parts) == 1 else f"{name} {title(members[0].path)}"
            found.append(_gathered(whole, members, contents))
    return found


def _trim(channels: Sequence[Channel]) -> None:
    """In a cut file some channels end a chunk later than others: all end where the first does."""
    shortest = min(channel.length for channel in channels)
    for channel in channels:
        for spans in channel.spans.values():
            if spans.length - shortest <= max(spans.counts):
                spans.trim(shortest)


def _gathered(name: str, members: Sequence[Channel], contents: Contents) -> _Gathered:
    channels = tuple(c for member in members for c in _channels(member, contents.properties.get(member.path, {})))
    changed = {(change.path, change.name) for change in contents.contradicted}
    said = dict(contents.properties.get(members[0].path, {}))
    if any((member.path, "wf_increment") in changed for member in members):
        said.pop("wf_increment", None)
    clock = _clock(members, channels, said)
    return _Gathered(Group(name, channels, clock), tuple(members), members[0].length)


def _channels(member: Channel, said: dict[str, Property]) -> list[model.Channel]:
    name = title(member.path)
    unit = str(said.get("unit_string") or said.get("NI_UnitDescription") or "") or None
    if member.kind == types.TIME:
        return [model.Channel(name, "s"), *([model.Channel(f"{name} remainder", "s")] if member.has_remainder else [])]
    if any(spans.kind.kind == "c" for spans in member.spans.values()):
        return [model.Channel(f"{name} ({part})", unit) for part in ("real", "imag")]
    return [model.Channel(name, unit)]


def _clock(members: Sequence[Channel], channels: Sequence[model.Channel], said: dict[str, Property]) -> Clock | None:
    """A recorded time, as timestamps or named so; else the declared step."""
    stamps = [title(member.path) for member in members if member.kind == types.TIME]
    if len(stamps) == 1:
        return TimeColumn([channel.name for channel in channels].index(stamps[0]), 1.0)
    named = [i for i, channel in enumerate(channels) if is_time(channel.label)]
    if len(named) == 1 and len(channels) > 1:
        unit = channels[named[0]].unit
        return TimeColumn(named[0], seconds_per(unit) if unit else 1.0, assumed=unit is None)
    step, start = said.get("wf_increment"), said.get("wf_start_offset", 0.0)
    factor = _seconds_per(said)
    if isinstance(step, float) and factor is not None and isinstance(start, int | float):
        return by_step(step * factor, start * factor)
    return None


def _seconds_per(said: dict[str, Property]) -> float | None:
    """Seconds in the unit of the abscissa; None if that is no time, as of a spectrum."""
    unit, name = said.get("wf_xunit_string"), said.get("wf_xname") or "Time"
    return seconds_per(str(unit)) if unit else 1.0 if is_time(str(name)) else None


def _blocks(path: Path, contents: Contents, gathered: Sequence[_Gathered], report: Report) -> Iterator[Block]:
    rounded: set[str] = set()
    with ByteSource(path) as source:
        for each in gathered:
            readings = [_Values(source, member, contents) for member in each.members]
            step = block_samples(len(each.group.channels))
            for start in range(0, each.samples, step):
                count = min(step, each.samples - start)
                columns = tuple(column for reading in readings for column in reading.next(count))
                yield Block(each.group, columns, start)
            rounded |= {title(reading.path) for reading in readings if reading.is_rounded}
    for name in sorted(rounded):
        report(Finding("not_exact", name, None, "holds integers beyond 2**53, which float64 rounds"))


class _Values:
    """The physical values of one channel, from first to last."""

    def __init__(self, source: ByteSource, member: Channel, contents: Contents) -> None:
        self.path, self.is_rounded, self._member = member.path, False, member
        self._file, self._what = source.path, f"channel {title(member.path)!r}"
        self._readings = {scale: Reading(source, spans, self._what) for scale, spans in member.spans.items()}
        group = member.path[: member.path.rfind("/'")]
        owners = (contents.properties.get(p, {}) for p in (member.path, group, "/"))
        self._scaling = Scaling(next((said for said in owners if "NI_Number_Of_Scales" in said), {}))

    def next(self, count: int) -> tuple[Samples, ...]:
        """The next values: one column, or two of complex numbers."""
        raw = {scale: reading.next(count) for scale, reading in self._readings.items()}
        first = next(iter(raw.values()))
        if first.dtype.names:
            seconds = types.seconds(first, self._member.to_microseconds)
            return (seconds, types.remainder(first, seconds)) if self._member.has_remainder else (seconds,)
        if first.dtype.kind == "c":
            return (as_float64(first.real), as_float64(first.imag))
        if first.dtype.kind in "iu" and first.dtype.itemsize == 8:
            self.is_rounded |= bool((np.abs(first.astype(np.float64)) >= _EXACT).any())
        errors = (KeyError, ValueError, TypeError, IndexError, OverflowError)
        with refusing(self._file, f"the scale of {self._what}", *errors), np.errstate(all="ignore"):
            values = self._scaling.physical(raw)
        if len(values) != count:
            raise damaged(self._file, f"{self._what}: its scale gives {len(values)} values of {count}")
        return (values,)


def _said(contents: Contents, gathered: Sequence[_Gathered]) -> list[Finding]:
    """Timestamps finer than float64, scales that were applied, channels without samples."""
    findings = []
    members = [member for each in gathered for member in each.members]
    for member in members:
        if member.has_remainder:
            name = title(member.path)
            fine = "whole microseconds" if member.to_microseconds else "float64, which resolves 0.24 µs"
            message = f"timestamps are seconds since 1970 to {fine}; what is finer is in {f'{name} remainder'!r}"
            findings.append(Finding("time_resolution", name, None, message))
    for member in members:
        said = Scaling(contents.properties.get(member.path, {}))
        if said.applies:
            message = f"raw values were made physical by {said.count} scales of the file"
            findings.append(Finding("calibration_applied", title(member.path), None, message))
    findings += changed(contents)
    empty = [title(p) for p, c in contents.channels.items() if not c.length and not c.texts and names(p)]
    if empty:
        message = f"no sample in {', '.join(empty[:10])}{' and more' if len(empty) > 10 else ''}"
        findings.append(Finding("empty_group", None, None, message))
    return findings


def _texts(contents: Contents) -> list[Finding]:
    return [
        Finding("text_channel", title(path), None, "holds text, not numbers; it is not kept")
        for path, channel in contents.channels.items()
        if channel.texts and names(path)
    ]


def _metadata(contents: Contents) -> dict[str, str]:
    """Properties by path and name, with ``wf_start_time`` in seconds since 1970."""
    return {
        ": ".join(filter(None, ["/".join(names(path)), name])): repr(value) if isinstance(value, float) else str(value)
        for path, properties in contents.properties.items()
        for name, value in properties.items()
    }


READER = Reader(
    name="NI TDMS",
    extensions=(".tdms",),
    identify=lambda head: head.startswith((b"TDSm", b"TDSh")),
    open=open_tdms,
    needs=f"{needs('tdms')} for scales of thermocouples, bridges and tables",
)
