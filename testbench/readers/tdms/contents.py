"""The objects of a whole file: properties, and where the samples of each channel lie."""

import re
from dataclasses import dataclass, field

import numpy as np

from ...findings import Finding
from ..stream import ByteSource, damaged
from . import types
from .metadata import Declared, Index, Property, Unreadable, parse
from .segments import Segment, segments
from .spans import Spans

_NAME = re.compile(r"/'((?:[^']|'')*)'")


@dataclass
class Channel:
    """A channel: its spans by scale (None: raw numbers without DAQmx scalers), and its type.

    Timestamps are given to the microsecond, or to the last digit of float64 where they are too close for that;
    ``has_remainder`` says that they are finer still.
    """

    path: str
    kind: int
    spans: dict[int | None, Spans] = field(default_factory=dict)
    texts: int = 0
    to_microseconds: bool = True
    has_remainder: bool = False

    @property
    def length(self) -> int:
        """Number of samples, of each raw number if there are several."""
        return min((spans.length for spans in self.spans.values()), default=0)


_OF_SAMPLES = re.compile(r"wf_increment|wf_start_offset|wf_start_time|unit_string|NI_UnitDescription|NI_Scale\[.*")
"""Properties that say what the samples of a channel are."""


@dataclass(frozen=True)
class Change:
    """That a property of a channel was another one for its first ``samples``."""

    path: str
    name: str
    before: Property
    after: Property
    samples: int


@dataclass
class Contents:
    """All that a file declares, in the order in which it does."""

    properties: dict[str, dict[str, Property]] = field(default_factory=dict)
    channels: dict[str, Channel] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)

    @property
    def is_cut(self) -> bool:
        """Whether the file ends before its own structure says."""
        return any(finding.code == "cut_file" for finding in self.findings)

    @property
    def contradicted(self) -> list[Change]:
        """Changes in the midst of samples; one behind the last sample is a correction of all of them."""
        return [change for change in self.changes if change.samples < self.channels[change.path].length]

    def declare(self, path: str, properties: dict[str, Property]) -> None:
        """Take new properties of an object, and note which change what its samples so far are."""
        known, channel = self.properties.setdefault(path, {}), self.channels.get(path)
        if channel is not None and channel.length:
            for name in filter(_OF_SAMPLES.fullmatch, properties):
                if name in known and known[name] != properties[name]:
                    self.changes.append(Change(path, name, known[name], properties[name], channel.length))
        known.update(properties)


def names(path: str) -> list[str]:
    """``/'Group'/'Channel'`` as its names; quotes inside are doubled."""
    return [name.replace("''", "'") for name in _NAME.findall(path)]


def title(path: str) -> str:
    """The last name of a path; all of a path that is none."""
    return (names(path) or [path])[-1] or path


def changed(contents: Contents) -> list[Finding]:
    """Properties that change in the midst of the samples; by the format the last one holds for all."""
    found = []
    for change in contents.contradicted:
        last = "there is no rate" if change.name == "wf_increment" else "the last one of the file is taken for all"
        message = (
            f"{change.name} is {change.before!r} up to sample {change.samples} and {change.after!r} from there: {last}"
        )
        found.append(Finding("header_contradiction", title(change.path), f"sample {change.samples}", message))
    return found


def read(source: ByteSource) -> Contents:
    """Walk through all segments."""
    contents, known = Contents(), dict[str, Index | None]()
    objects: dict[str, Index | None] = {}
    raw: dict[str, Index] = {}
    last: tuple[bytes, str, bool] | None = None
    for segment in segments(source):
        before = {} if segment.is_whole else {path: channel.length for path, channel in contents.channels.items()}
        now = (segment.metadata(source), segment.order, segment.is_new_list) if segment.has_metadata else last
        if now is not None and now != last:  # the same once more, as many writers repeat it, says nothing new
            last = now
            try:
                declared = parse(now[0], segment.order, known)
            except Unreadable as error:
                if segment.is_whole:
                    raise damaged(source.path, f"the metadata of segment {segment.number}: {error}") from error
                contents.findings.append(_cut(segment, contents, {}, before))
                break
            objects = _objects(objects, declared, segment)
            known |= declared.indexes
            for path, properties in declared.properties.items():
                contents.declare(path, properties)
            raw = {path: index for path, index in objects.items() if index is not None}
            for path, index in raw.items():
                contents.channels.setdefault(path, Channel(path, index.kind))
        if segment.has_raw_data:
            _locate(source, segment, raw, contents)
        if not segment.is_whole:
            contents.findings.append(_cut(segment, contents, raw if segment.has_raw_data else {}, before))
    return contents


def _objects(objects: dict[str, Index | None], declared: Declared, segment: Segment) -> dict[str, Index | None]:
    """The objects whose raw data a segment holds, in their order."""
    return dict(declared.indexes) if segment.is_new_list else {**objects, **declared.indexes}


def _locate(source: ByteSource, segment: Segment, raw: dict[str, Index], contents: Contents) -> None:
    """Note where the samples of all whole chunks of a segment lie, and what is left behind them."""
    unit = _locate_chunks(source, segment, raw, contents)
    left = (segment.end - segment.raw) % unit if unit else segment.end - segment.raw
    if segment.is_whole and left:
        where, whole = f"byte {segment.begin}", "rows" if segment.is_interleaved else "chunks"
        message = (
            f"segment {segment.number} holds {left} bytes behind its whole {whole} of {unit} bytes; they are not read"
        )
        contents.findings.append(Finding("count_contradiction", None, where, message))


def _locate_chunks(source: ByteSource, segment: Segment, raw: dict[str, Index], contents: Contents) -> int:
    """Note where the samples lie; the bytes of what repeats: a row of all channels, or a chunk."""
    if any(index.scalers for index in raw.values()):
        return _locate_daqmx(source, segment, raw, contents)
    sizes = {path: _bytes(source, index, segment) for path, index in raw.items()}
    there = segment.end - segment.raw
    if segment.is_interleaved:
        width = sum(size // max(index.values, 1) for size, index in zip(sizes.values(), raw.values(), strict=True))
        if width:
            at = segment.raw
            for path, index in raw.items():
                kind = types.number(index.kind, segment.order)
                if kind is None:
                    raise damaged(source.path, f"segment {segment.number}: {path} is interleaved, but is no number")
                _spans(contents.channels[path], None, kind).add(at, there // width, width, 1, 0)
                at += kind.itemsize
        return width
    chunk = sum(sizes.values())
    chunks, at = there // chunk if chunk else 0, segment.raw
    for path, index in raw.items():
        kind = types.number(index.kind, segment.order)
        if kind is None:
            contents.channels[path].texts += chunks * index.values
        else:
            _spans(contents.channels[path], None, kind).add(at, index.values, kind.itemsize, chunks, chunk)
        at += sizes[path]
    return chunk


def _bytes(source: ByteSource, index: Index, segment: Segment) -> int:
    """Bytes of an object in one chunk."""
    if index.kind == types.STRING:
        return index.bytes
    kind = types.number(index.kind, segment.order)
    if kind is None:
        message = f"values of type {index.kind:#x}, which are not read"
        raise damaged(source.path, f"segment {segment.number}: {message}")
    return index.values * kind.itemsize


def _locate_daqmx(source: ByteSource, segment: Segment, raw: dict[str, Index], contents: Contents) -> int:
    """Rows of DAQmx buffers: in each chunk one buffer follows the other, in each buffer the channels alternate.

    Gives the bytes of a chunk.
    """
    first = next(iter(raw.values()))
    if any(index.widths != first.widths or not index.scalers for index in raw.values()):
        raise damaged(source.path, f"segment {segment.number}: DAQmx channels of different buffers")
    rows = [
        max((i.values for i in raw.values() for s in i.scalers if s.buffer == buffer), default=0)
        for buffer in range(len(first.widths))
    ]
    sizes = [count * width for count, width in zip(rows, first.widths, strict=True)]
    begins, chunk = np.concatenate(([0], np.cumsum(sizes, dtype=object)))[:-1], sum(sizes)
    chunks = (segment.end - segment.raw) // chunk if chunk else 0
    for path, index in raw.items():
        for scaler in index.scalers:
            kind = types.daqmx_number(scaler.kind, segment.order)
            if kind is None or scaler.offset + kind.itemsize > first.widths[scaler.buffer]:
                raise damaged(source.path, f"segment {segment.number}: {path} has DAQmx numbers of type {scaler.kind}")
            at = segment.raw + int(begins[scaler.buffer]) + scaler.offset
            spans = _spans(contents.channels[path], scaler.scale, kind)
            spans.add(at, index.values, first.widths[scaler.buffer], chunks, chunk)
    return int(chunk)


def _spans(channel: Channel, scale: int | None, kind: "np.dtype[np.void]") -> Spans:
    return channel.spans.setdefault(scale, Spans(kind))


def _cut(segment: Segment, contents: Contents, raw: dict[str, Index], before: dict[str, int]) -> Finding:
    """That the file ends inside a segment: what is declared, what is there, of which channels."""
    if segment.declared_end is None:
        inside = f"segment {segment.number} at byte {segment.begin}, which its writer never finished"
    else:
        ends = f"whose header says that it ends {segment.declared_end - segment.end} bytes later"
        inside = f"segment {segment.number} at byte {segment.begin}, {ends}"
    missing = [
        f"{title(path)} {contents.channels[path].length} of {before.get(path, 0) + index.values} declared"
        for path, index in raw.items()
    ]
    whole = [f"{title(path)} {channel.length}" for path, channel in contents.channels.items() if path not in raw]
    samples = f"; samples that are there: {', '.join([*missing, *whole])}" if missing or whole else ""
    message = f"the file ends at byte {segment.end} inside {inside}{samples}"
    return Finding("cut_file", None, f"byte {segment.begin}", message)
