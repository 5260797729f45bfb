"""Reader of WAV: integers as recorded, never scaled to one; channels have numbers and no unit.

Samples are decoded by scipy, block by block: each block is given to it as a file of its own. scipy stops at the first
chunk of samples and takes the lengths in the headers as they are; where the samples lie, and what contradicts their
headers, is found here.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from ..recording import Block, Channel, Finding, Group, Recording, Samples, UniformClock
from .byte_source import ByteSource, as_float64, block_spans
from .format_findings import damaged, nothing_to_read, watch_nonfinite
from .header_claims import start_in
from .registry import ReadOptions

_FLOAT, _EXTENSIBLE, _UNKNOWN = 3, 0xFFFE, 0xFFFFFFFF
_MOST_CHUNKS, _LONGEST_TEXT = 10_000, 2000


@dataclass(frozen=True)
class _SampleFormat:
    """Format of the samples: byte order, code, channels, frames a second, bytes of a frame, bits of a number."""

    order: str
    code: int
    channels: int
    rate_hz: int
    frame: int
    bits: int

    def columns(self, samples: bytes) -> tuple[Samples, ...]:
        """One column a channel. Integers of one byte are unsigned with zero at 128, all others are signed."""
        from scipy.io import wavfile

        form = struct.pack(f"{self.order}HHIIHH", self.code, self.channels, 0, 0, self.frame, self.bits)
        chunks = b"WAVEfmt " + struct.pack(f"{self.order}I", len(form)) + form
        chunks += b"data" + struct.pack(f"{self.order}I", len(samples)) + samples
        name = b"RIFF" if self.order == "<" else b"RIFX"
        _, values = wavfile.read(BytesIO(name + struct.pack(f"{self.order}I", len(chunks)) + chunks))
        if values.dtype.kind == "i":  # scipy fills up 24 bits to 32 at their lower end
            values = values >> 8 * (values.dtype.itemsize - self.frame // self.channels)
        return tuple(as_float64(values.reshape(-1, self.channels)).T.copy())


@dataclass(frozen=True)
class _SampleChunk:
    """Where the samples lie, how many frames are there, and how many bytes are declared."""

    form: _SampleFormat
    begin: int
    frames: int
    declared: int
    texts: dict[str, str]


def open_wav(path: Path, options: ReadOptions) -> Recording:
    """Read the chunks; the samples are read when asked for."""
    with ByteSource(path) as source:
        chunk = _sample_chunk(source)
        finding = _length_finding(source, chunk)
    findings = () if finding is None else (finding,)
    form = chunk.form
    if not chunk.frames:
        raise nothing_to_read(path, findings, "no sample in it")
    channels = tuple(Channel(f"channel {i}") for i in range(1, form.channels + 1))
    clock = UniformClock(float(form.rate_hz)) if form.rate_hz else None
    group = Group(path.stem, channels, clock, start_in(chunk.texts, "OriginationDate", "OriginationTime"))

    def blocks() -> Iterator[Block]:
        with ByteSource(path) as source:
            for start, end in block_spans(chunk.frames, form.channels):
                begin = chunk.begin + start * form.frame
                raw = source.read(begin, (end - start) * form.frame, "samples")
                yield Block(group, form.columns(raw), start, None, begin + len(raw))

    return Recording(
        path=path,
        format="WAV",
        reader=__name__,
        groups=(group,),
        read=lambda report: watch_nonfinite(blocks(), report),
        settings={"numbers": f"{'float' if form.code == _FLOAT else 'integer'}, {form.bits} bits"},
        metadata=chunk.texts,
        findings=findings,
    )


def _sample_chunk(source: ByteSource) -> _SampleChunk:
    order = ">" if source.read(0, 4, "the name of the format") == b"RIFX" else "<"
    form, end, texts, long_size = None, 12, dict[str, str](), None
    for at, name, size in _chunks(source, 12, order):
        end = at + 8 + size + size % 2
        if name == b"ds64":
            (long_size,) = struct.unpack("<8xQ", source.read(at + 8, 16, "the long sizes"))
        elif name == b"fmt ":
            form = _sample_format(source, source.read(at + 8, min(size, 40), "the format"), order)
        elif name == b"data":
            if form is None:
                raise damaged(source.path, "its samples come before their format")
            size = long_size if size == _UNKNOWN and long_size is not None else size
            there = source.size - at - 8
            if size not in (0, _UNKNOWN):
                there = min(size, there)
            return _SampleChunk(form, at + 8, there // form.frame, size, texts)
        elif name == b"bext":
            texts |= _broadcast_texts(source.read(at + 8, min(size, source.size - at - 8, 338), "texts"))
        elif name == b"LIST":
            texts |= _texts(source.read(at + 8, min(size, source.size - at - 8, 1 << 16), "texts"), order)
    raise damaged(source.path, f"no chunk of samples up to byte {min(end, source.size)}")


def _chunks(source: ByteSource, at: int, order: str) -> Iterator[tuple[int, bytes, int]]:
    """Where each chunk begins from ``at`` on, its name, and its size."""
    for _ in range(_MOST_CHUNKS):
        if at + 8 > source.size:
            return
        name, size = struct.unpack(f"{order}4sI", source.read(at, 8, "a chunk"))
        yield at, name, size
        at += 8 + size + size % 2


def _sample_format(source: ByteSource, raw: bytes, order: str) -> _SampleFormat:
    """The format, if scipy decodes it."""
    if len(raw) < 16:
        raise damaged(source.path, f"a format of {len(raw)} bytes")
    code, channels, rate, _, frame, bits = struct.unpack_from(f"{order}HHIIHH", raw)
    if code == _EXTENSIBLE and len(raw) >= 26:
        (code,) = struct.unpack_from(f"{order}I", raw, 24)
    form = _SampleFormat(order, code & 0xFFFF, channels, rate, frame, bits)
    try:
        if not channels or frame % channels or not 0 < bits <= 8 * frame // channels:
            raise ValueError("its frames are no whole numbers of samples")
        form.columns(bytes(frame))
    except (ValueError, TypeError) as error:
        message = f"format {code} of {channels} channels, {bits} bits, {frame} bytes a frame is not read ({error})"
        raise damaged(source.path, message) from error
    return form


def _broadcast_texts(raw: bytes) -> dict[str, str]:
    """The texts of a broadcast extension (EBU Tech 3285): date and time of day may have any sign between numbers."""
    plain = raw.ljust(338, b"\0").decode("latin-1")
    parts = {"Description": plain[:256], "Originator": plain[256:288], "OriginatorReference": plain[288:320],
             "OriginationDate": re.sub(r"\D", "-", plain[320:330]),
             "OriginationTime": re.sub(r"\D", ":", plain[330:338])}  # fmt: skip
    return {key: text for key, value in parts.items() if (text := value.split("\0")[0].strip()).strip("-:")}


def _texts(raw: bytes, order: str) -> dict[str, str]:
    """The texts of a LIST of INFO."""
    found, at = {}, 4
    while raw[:4] == b"INFO" and at + 8 <= len(raw):
        name, size = struct.unpack_from(f"{order}4sI", raw, at)
        text = raw[at + 8 : at + 8 + min(size, _LONGEST_TEXT)].split(b"\0")[0]
        found[name.decode("latin-1")] = text.decode("utf-8", "replace")
        at += 8 + size + size % 2
    return found


def _length_finding(source: ByteSource, chunk: _SampleChunk) -> Finding | None:
    """Another length than is declared; more samples behind, as a second chunk or as nothing that is a chunk at all."""
    there, frame = source.size - chunk.begin, chunk.form.frame
    if chunk.declared == _UNKNOWN or (chunk.declared == 0 and there >= frame):
        message = f"the length of its samples was never written; {there // frame} frames are there"
        return Finding("cut_file", None, None, message)
    declared = chunk.declared // frame
    if chunk.declared > there:
        message = f"{declared} frames are declared, {chunk.frames} whole ones are there"
        return Finding("cut_file", None, None, message)
    if chunk.declared % frame:
        message = f"{chunk.declared} bytes are declared, which are {declared} frames and a part of one"
        return Finding("count_contradiction", None, None, message)
    behind = chunk.begin + chunk.declared
    behind += chunk.declared % 2 if not _is_name(source, behind) else 0
    for at, name, _ in _chunks(source, behind, chunk.form.order):
        if name == b"data" or not _is_name(source, at):
            more = "a second chunk of samples" if name == b"data" else "more samples than declared, it seems"
            message = f"{source.size - at} bytes behind the {chunk.frames} frames declared: {more}; they are not read"
            return Finding("count_contradiction", None, f"byte {at}", message)
    return None


def _is_name(source: ByteSource, at: int) -> bool:
    """Whether a chunk has its name there: four letters, digits, marks or blanks."""
    return at + 8 <= source.size and all(32 <= letter < 127 for letter in source.read(at, 4, "a name"))
