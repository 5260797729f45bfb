"""What a TDMS file declares: its segments, their objects and properties, and where the samples of each channel lie.

Properties that change in the midst of samples, segments that are cut or hold more than whole chunks are findings. The
spans of bytes in which the raw numbers of a channel lie are read in windows.
"""

import re
import struct
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...recording import Finding, Samples
from ..byte_source import ByteSource
from ..format_findings import damaged

LEAD_IN = 28
METADATA, NEW_LIST, RAW_DATA, INTERLEAVED, BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 3, 1 << 5, 1 << 6
"""What a segment has, or how it lies: flags of its lead-in."""
_UNFINISHED = 0xFFFFFFFFFFFFFFFF
_LONGEST_METADATA = 256 << 20
_WINDOW = 16 << 20
"""Bytes of the file that are read at once."""
_SPARSE = 64
"""Spans that fill less than one part in so many of the file are read one by one."""


@dataclass(frozen=True)
class Segment:
    """One segment: where it begins, where its metadata and raw data lie, and where it ends by its lead-in.

    ``end`` is that of the file where it is cut; ``declared_end`` is None where the writer never finished it.
    """

    number: int
    begin: int
    raw: int
    end: int
    declared_end: int | None
    flags: int

    @property
    def order(self) -> str:
        """Byte order."""
        return ">" if self.flags & BIG_ENDIAN else "<"

    @property
    def raw_bytes(self) -> int:
        """Bytes of its raw data that are there; in a file that is cut they may begin beyond its end."""
        return max(0, self.end - self.raw)

    @property
    def is_whole(self) -> bool:
        """Whether the file holds all of it."""
        return self.declared_end == self.end

    def metadata(self, source: ByteSource) -> bytes:
        """The bytes of its metadata, as far as they are there."""
        begin = self.begin + LEAD_IN
        count = min(self.raw, self.end) - begin
        if count > _LONGEST_METADATA:
            raise damaged(source.path, f"segment {self.number} has {count} bytes of metadata")
        return source.read(begin, max(count, 0), f"the metadata of segment {self.number}")


def segments(source: ByteSource) -> Iterator[Segment]:
    """All segments; one that is cut is the last."""
    begin, number = 0, 1
    while begin < source.size:
        if begin + LEAD_IN > source.size:
            yield Segment(number, begin, source.size, source.size, begin + LEAD_IN, 0)
            return
        tag, flags, _, size, raw = struct.unpack("<4s2I2Q", source.read(begin, LEAD_IN, "a lead-in"))
        if tag != b"TDSm":
            raise damaged(source.path, f"byte {begin}: {tag!r}; expected the next segment to begin with b'TDSm'")
        if flags & BIG_ENDIAN:
            _, size, raw = struct.unpack(">I2Q", source.read(begin + 8, LEAD_IN - 8, "a lead-in"))
        declared = None if size == _UNFINISHED else begin + LEAD_IN + size
        end = source.size if declared is None else min(declared, source.size)
        if raw > size:
            raise damaged(source.path, f"segment {number} at byte {begin}: its raw data begin behind its end")
        yield Segment(number, begin, begin + LEAD_IN + raw, end, declared, flags)
        begin, number = end, number + 1


@dataclass
class Spans:
    """Numbers of one kind: for each span its first byte, how many numbers, and the bytes from one to the next."""

    kind: np.dtype[Any]
    offsets: "array[int]" = field(default_factory=lambda: array("q"))
    counts: "array[int]" = field(default_factory=lambda: array("q"))
    strides: "array[int]" = field(default_factory=lambda: array("q"))
    length: int = 0

    def add(self, offset: int, count: int, stride: int, chunks: int, chunk_bytes: int) -> None:
        """``chunks`` spans, each ``chunk_bytes`` behind the other; those that touch become one."""
        if chunks > 1 and count * stride == chunk_bytes:
            count, chunks = count * chunks, 1
        if not count or not chunks:
            return
        self.offsets.extend(range(offset, offset + chunks * chunk_bytes, chunk_bytes) if chunks > 1 else (offset,))
        self.counts.extend([count] * chunks)
        self.strides.extend([stride] * chunks)
        self.length += count * chunks


class Reading:
    """The numbers of spans, read from first to last."""

    def __init__(self, source: ByteSource, spans: Spans, what: str) -> None:
        self._source, self._kind, self._what = source, spans.kind, what
        self._offsets = np.frombuffer(spans.offsets, dtype=np.int64)
        self._counts = np.frombuffer(spans.counts, dtype=np.int64)
        self._strides = np.frombuffer(spans.strides, dtype=np.int64)
        self._span, self._within = 0, 0

    def next(self, count: int) -> NDArray[Any]:
        """The next ``count`` numbers (count,) [as stored], which must be there."""
        pieces = list(self._pieces(count))
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def _pieces(self, count: int) -> Iterator[NDArray[Any]]:
        while count:
            here = int(self._counts[self._span]) - self._within
            if self._within or here > count:
                taken = min(here, count)
                yield from self._part(self._span, self._within, taken)
                self._within = self._within + taken if taken < here else 0
                self._span += taken == here
            else:
                taken, stop = self._regular(count)
                yield self._together(self._span, stop)
                self._span = stop
            count -= taken

    def _regular(self, count: int) -> tuple[int, int]:
        """How many numbers, and up to which span, lie in whole spans of one size and distance within a window."""
        i, size, stride = self._span, int(self._counts[self._span]), int(self._strides[self._span])
        most = min(count // size, len(self._counts) - i, 1 << 20)
        offsets = self._offsets[i : i + most]
        same = (self._counts[i : i + most] == size) & (self._strides[i : i + most] == stride)
        steps = np.diff(offsets)
        if len(steps):
            same[1:] &= (steps == steps[0]) & (offsets[1:] - offsets[0] + size * stride <= _WINDOW)
            if steps[0] < size * stride or steps[0] > _SPARSE * size * stride:
                same[1:] = False
        number = int(np.argmin(same)) if not same.all() else len(same)
        number = max(number, 1)
        return number * size, i + number

    def _together(self, first: int, stop: int) -> NDArray[Any]:
        """Whole spans of one size and distance."""
        size, stride = int(self._counts[first]), int(self._strides[first])
        if stop - first == 1:
            return np.concatenate(list(self._part(first, 0, size)))
        begin, step = int(self._offsets[first]), int(self._offsets[first + 1] - self._offsets[first])
        extent = int(self._offsets[stop - 1]) - begin + (size - 1) * stride + self._kind.itemsize
        raw = self._source.read(begin, extent, self._what)
        table = np.ndarray((stop - first, size), self._kind, raw, strides=(step, stride))
        return table.reshape(-1)

    def _part(self, span: int, skip: int, count: int) -> Iterator[NDArray[Any]]:
        """``count`` numbers of one span, behind its first ``skip``."""
        stride = int(self._strides[span])
        begin, most = int(self._offsets[span]) + skip * stride, max(1, _WINDOW // stride)
        for done in range(0, count, most):
            number = min(most, count - done)
            extent = (number - 1) * stride + self._kind.itemsize
            raw = self._source.read(begin + done * stride, extent, self._what)
            yield np.ndarray((number,), self._kind, raw, strides=(stride,))


STRING, BOOLEAN, TIME = 0x20, 0x21, 0x44
_NUMBERS = {
    1: "i1", 2: "i2", 3: "i4", 4: "i8", 5: "u1", 6: "u2", 7: "u4", 8: "u8", 9: "f4", 10: "f8",
    0x19: "f4", 0x1A: "f8", BOOLEAN: "u1", 0x08000C: "c8", 0x10000D: "c16",
}  # fmt: skip
_DAQMX_NUMBERS = {0: "u1", 1: "i1", 2: "u2", 3: "i2", 4: "u4", 5: "i4"}
EPOCH_1904 = -2082844800
"""1904-01-01, from which TDMS counts, in seconds since 1970."""
_PER_MICROSECOND = 2**64 / 1_000_000
_LATEST = 1 << 42
Timestamps = np.ndarray[Any, Any]


@cache
def stored_type(kind: int, order: str, is_daqmx: bool = False) -> np.dtype[Any] | None:
    """The form of a number or timestamp in the file, or of one that a DAQmx device wrote; None for anything else."""
    if kind == TIME and not is_daqmx:
        parts = [("fraction", f"{order}u8"), ("second", f"{order}i8")]
        return np.dtype(parts if order == "<" else parts[::-1])
    form = (_DAQMX_NUMBERS if is_daqmx else _NUMBERS).get(kind)
    return None if form is None else np.dtype(order + form)


def timestamp_seconds(timestamps: Timestamps, to_microseconds: bool = True) -> Samples:
    """Seconds since 1970: to the whole microsecond, as NI's software shows them, or the nearest float64."""
    whole = timestamps["second"].astype(np.int64) + EPOCH_1904
    fraction = timestamps["fraction"].astype(np.float64)  # of 2**-64 s
    if to_microseconds and (np.abs(whole) < _LATEST).all():
        return np.asarray((whole * 1_000_000 + (fraction / _PER_MICROSECOND).astype(np.int64)) / 1e6)
    return np.asarray(whole.astype(np.float64) + fraction * 2.0**-64)


def timestamp_remainder(timestamps: Timestamps, given: Samples) -> Samples:
    """How much later the timestamps are than the seconds ``given``, which are near them, exactly [s].

    Both are multiples of 2**-64 s; their difference is so small that float64 holds it to the last bit.
    """
    fraction = ((given - np.floor(given)) * 2.0**64).astype(np.uint64)
    return np.asarray((timestamps["fraction"].astype(np.uint64) - fraction).astype(np.int64) * 2.0**-64)


Property = str | int | float | bool
_NONE, _SAME = 0xFFFFFFFF, 0
_DAQMX_FORMAT, _DAQMX_LINES = 0x1269, (0x126A, 0x1369)
_SIMPLE = {1: "b", 2: "h", 3: "i", 4: "q", 5: "B", 6: "H", 7: "I", 8: "Q", 9: "f", 10: "d", 0x19: "f", 0x1A: "d",
           BOOLEAN: "?"}  # fmt: skip


@dataclass(frozen=True)
class Scaler:
    """One raw number of a DAQmx channel: its type, buffer, place in a row of the buffer, and scale."""

    kind: int
    buffer: int
    offset: int
    scale: int


@dataclass(frozen=True)
class Index:
    """How the raw data of an object lie in each chunk: type, number of values, bytes if they are no numbers."""

    kind: int
    values: int
    bytes: int = 0
    scalers: tuple[Scaler, ...] = ()
    widths: tuple[int, ...] = ()


class Unreadable(Exception):
    """Metadata that are not what they should be; the text says how."""


class Cursor:
    """Reads values one after the other from the bytes of a segment's metadata."""

    def __init__(self, raw: bytes, order: str) -> None:
        self.raw, self.order, self.at = raw, order, 0

    def take(self, form: str) -> tuple[Any, ...]:
        """Values of a ``struct`` format."""
        try:
            values = struct.unpack_from(self.order + form, self.raw, self.at)
        except struct.error as error:
            raise Unreadable(f"they end inside a value at their byte {self.at}") from error
        self.at += struct.calcsize(self.order + form)
        return values

    def integer(self) -> int:
        """An unsigned integer of 32 bits."""
        value: int = self.take("I")[0]
        return value

    def text(self) -> str:
        """A length and as many bytes of UTF-8."""
        length = self.integer()
        raw = self.raw[self.at : self.at + length]
        if len(raw) < length:
            raise Unreadable(f"a text of {length} bytes at their byte {self.at} goes beyond them")
        self.at += length
        return raw.decode("utf-8", "replace")


def _declared(
    raw: bytes, order: str, known: Mapping[str, Index | None]
) -> tuple[dict[str, Index | None], dict[str, dict[str, Property]]]:
    """The objects that the bytes ``raw`` declare: raw data by path (None: none), and new properties by path.

    ``known`` holds the raw data that each object had before.
    """
    cursor, indexes = Cursor(raw, order), dict[str, Index | None]()
    stated: dict[str, dict[str, Property]] = {}
    for _ in range(cursor.integer()):
        path = cursor.text()
        header = cursor.integer()
        if header == _NONE:
            indexes[path] = None
        elif header == _SAME:
            if path not in known:
                raise Unreadable(f"{path} has raw data as before, but there was nothing before")
            indexes[path] = known[path]
        elif header in _DAQMX_LINES:
            raise Unreadable(f"{path} holds lines of digital DAQmx data, which are not read")
        else:
            indexes[path] = _index(cursor, header == _DAQMX_FORMAT)
        properties = stated.setdefault(path, {})
        for _ in range(cursor.integer()):
            name = cursor.text()
            properties[name] = _property(cursor, name)
    return indexes, stated


def _index(cursor: Cursor, is_daqmx: bool) -> Index:
    kind, dimension, values, *count = cursor.take("IIQI" if is_daqmx else "IIQ")
    if dimension != 1:
        raise Unreadable(f"an array of {dimension} dimensions; expected 1")
    if not is_daqmx:
        return Index(kind, values, cursor.take("Q")[0] if kind == STRING else 0)
    parts = [cursor.take("5I") for _ in range(count[0])]
    scalers = tuple(Scaler(number, buffer, offset, scale) for number, buffer, offset, _, scale in parts)
    widths = tuple(cursor.integer() for _ in range(cursor.integer()))
    if any(scaler.buffer >= len(widths) for scaler in scalers):
        raise Unreadable("a DAQmx channel lies in a buffer that there is not")
    return Index(kind, values, 0, scalers, widths)


def _property(cursor: Cursor, name: str) -> Property:
    kind = cursor.integer()
    if kind == STRING:
        return cursor.text()
    if kind == TIME:
        first, second = cursor.take("Qq") if cursor.order == "<" else cursor.take("qQ")[::-1]
        return float(second + EPOCH_1904) + float(first) * 2.0**-64
    if kind not in _SIMPLE:
        raise Unreadable(f"property {name!r} is of type {kind:#x}, which is not known")
    value: Property = cursor.take(_SIMPLE[kind])[0]
    return value


_NAME = re.compile(r"/'((?:[^']|'')*)'")


class TextSpan(NamedTuple):
    """Texts of one chunk: where they lie, their bytes, how many, and the byte order of the numbers before them."""

    offset: int
    bytes: int
    texts: int
    order: str


@dataclass
class Channel:
    """A channel: its spans by scale (None: raw numbers without DAQmx scalers), and its type.

    Timestamps are given to the microsecond, or to the last digit of float64 where they are too close for that;
    ``has_remainder`` says that they are finer still.
    """

    path: str
    kind: int
    spans: dict[int | None, Spans] = field(default_factory=dict)
    texts: list[TextSpan] = field(default_factory=list)
    to_microseconds: bool = True
    has_remainder: bool = False
    lacking: int = 0
    """Samples of others of its group that this one does not have, for the file is cut; NaN."""

    @property
    def length(self) -> int:
        """Number of samples, of each raw number if there are several."""
        return min((spans.length for spans in self.spans.values()), default=0)

    @property
    def samples(self) -> int:
        """Samples of its group: its own, and those that it lacks."""
        return self.length + self.lacking

    def of_scale(self, scale: int | None, kind: "np.dtype[Any]") -> Spans:
        """The spans of the raw numbers of a scale."""
        return self.spans.setdefault(scale, Spans(kind))


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


def path_names(path: str) -> list[str]:
    """``/'Group'/'Channel'`` as its names; quotes inside are doubled."""
    return [name.replace("''", "'") for name in _NAME.findall(path)]


def channel_title(path: str) -> str:
    """The last name of a path; all of a path that is none."""
    return (path_names(path) or [path])[-1] or path


def read_contents(source: ByteSource) -> Contents:
    """Walk through all segments."""
    contents, known = Contents(), dict[str, Index | None]()
    objects: dict[str, Index | None] = {}
    raw: dict[str, Index] = {}
    last: tuple[bytes, str, int] | None = None
    for segment in segments(source):
        before = {} if segment.is_whole else {path: channel.length for path, channel in contents.channels.items()}
        now = (segment.metadata(source), segment.order, segment.flags & NEW_LIST) if segment.flags & METADATA else last
        if now is not None and now != last:  # the same once more, as many writers repeat it, says nothing new
            last = now
            try:
                indexes, stated = _declared(now[0], segment.order, known)
            except Unreadable as error:
                if segment.is_whole:
                    raise damaged(source.path, f"the metadata of segment {segment.number}: {error}") from error
                contents.findings.append(_cut(segment, contents, {}, before))
                break
            objects = indexes if now[2] else {**objects, **indexes}
            known |= indexes
            for path, properties in stated.items():
                contents.declare(path, properties)
            raw = {path: index for path, index in objects.items() if index is not None}
            for path, index in raw.items():
                contents.channels.setdefault(path, Channel(path, index.kind))
        if segment.flags & RAW_DATA:
            unit = _locate(source, segment, raw, contents)
            rest = segment.raw_bytes % unit if unit else segment.raw_bytes
            if segment.is_whole and rest:
                whole = f"whole {'rows' if segment.flags & INTERLEAVED else 'chunks'} of {unit} bytes"
                message = f"segment {segment.number} holds {rest} bytes behind its {whole}; they are not read"
                contents.findings.append(Finding("count_contradiction", None, f"byte {segment.begin}", message))
        if not segment.is_whole:
            contents.findings.append(_cut(segment, contents, raw if segment.flags & RAW_DATA else {}, before))
    return contents


def _locate(source: ByteSource, segment: Segment, raw: dict[str, Index], contents: Contents) -> int:
    """Note where the samples of a segment lie; the bytes of what repeats: a row of all channels, or a chunk."""
    if any(index.scalers for index in raw.values()):
        return _locate_daqmx(source, segment, raw, contents)
    kinds = {path: stored_type(index.kind, segment.order) for path, index in raw.items()}
    sizes, at, where = dict[str, int](), segment.raw, f"segment {segment.number}"
    for path, index in raw.items():
        if (kind := kinds[path]) is None and index.kind != STRING:
            raise damaged(source.path, f"{where}: values of type {index.kind:#x}, which are not read")
        sizes[path] = index.bytes if kind is None else index.values * kind.itemsize
    if segment.flags & INTERLEAVED:
        width = sum(size // max(index.values, 1) for size, index in zip(sizes.values(), raw.values(), strict=True))
        for path, kind in kinds.items() if width else ():
            if kind is None:
                raise damaged(source.path, f"{where}: {path} is interleaved, but is no number")
            contents.channels[path].of_scale(None, kind).add(at, segment.raw_bytes // width, width, 1, 0)
            at += kind.itemsize
        return width
    chunk = sum(sizes.values())
    chunks = segment.raw_bytes // chunk if chunk else 0
    for path, index in raw.items():
        if (kind := kinds[path]) is None:
            spans = (TextSpan(at + i * chunk, index.bytes, index.values, segment.order) for i in range(chunks))
            contents.channels[path].texts.extend(spans)
        else:
            contents.channels[path].of_scale(None, kind).add(at, index.values, kind.itemsize, chunks, chunk)
        at += sizes[path]
    at = segment.raw + chunks * chunk  # of a chunk in which the file ends there are channels up to somewhere
    for path, index in raw.items() if not segment.is_whole else ():
        kind = kinds[path]
        if kind is None or at >= segment.end:
            break
        here = min(index.values, (segment.end - at) // kind.itemsize)
        contents.channels[path].of_scale(None, kind).add(at, here, kind.itemsize, 1, 0)
        at += sizes[path]
    return chunk


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
    chunks = segment.raw_bytes // chunk if chunk else 0
    for path, index in raw.items():
        for scaler in index.scalers:
            kind = stored_type(scaler.kind, segment.order, is_daqmx=True)
            if kind is None or scaler.offset + kind.itemsize > first.widths[scaler.buffer]:
                raise damaged(source.path, f"segment {segment.number}: {path} has DAQmx numbers of type {scaler.kind}")
            at = segment.raw + int(begins[scaler.buffer]) + scaler.offset
            spans, width = contents.channels[path].of_scale(scaler.scale, kind), first.widths[scaler.buffer]
            spans.add(at, index.values, width, chunks, chunk)
            if not segment.is_whole and len(first.widths) == 1:  # the rows of a chunk in which the file ends
                spans.add(at + chunks * chunk, (segment.raw_bytes - chunks * chunk) // width, width, 1, 0)
    return int(chunk)


def _cut(segment: Segment, contents: Contents, raw: dict[str, Index], before: dict[str, int]) -> Finding:
    """That the file ends inside a segment: what is declared, what is there, of which channels."""
    if segment.declared_end is None:
        inside = f"segment {segment.number} at byte {segment.begin}, which its writer never finished"
    else:
        ends = f"whose header says that it ends {segment.declared_end - segment.end} bytes later"
        inside = f"segment {segment.number} at byte {segment.begin}, {ends}"
    missing = [
        f"{channel_title(path)} {contents.channels[path].length} of {before.get(path, 0) + index.values} declared"
        for path, index in raw.items()
    ]
    whole = [
        f"{channel_title(path)} {channel.length}" for path, channel in contents.channels.items() if path not in raw
    ]
    samples = f"; samples that are there: {', '.join([*missing, *whole])}" if missing or whole else ""
    message = f"the file ends at byte {segment.end} inside {inside}{samples}"
    return Finding("cut_file", None, f"byte {segment.begin}", message)
