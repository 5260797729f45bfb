"""C3D: markers and analog channels of movement laboratories, force plates among them.

A header of 512 bytes, parameters (groups of named values), then frames: of each point x, y, z and a fourth word, then
some samples of each analog channel. Points and analog channels are groups of their own, since their rates differ.
Header and parameters state much twice: the parameters are taken, and a contradiction is reported. Numbers are those of
Intel, DEC or SGI machines. Source: The C3D File Format (https://www.c3d.org/docs/C3D_User_Guide.pdf).
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Channel, Finding, Group, Recording, Refusal, Report, Samples
from .byte_source import ByteSource, as_float64, block_spans, decoded
from .format_findings import damaged, watch_nonfinite
from .header_claims import clock_of_rate
from .registry import ReadOptions

BLOCK = 512
INTEL, DEC, SGI = 84, 85, 86
Values = NDArray[np.float64] | tuple[str, ...]


@dataclass(frozen=True)
class Parameters:
    """Values by ``GROUP:NAME`` in capitals, numbers in Fortran's order; the processor whose numbers the file holds."""

    processor: int
    values: Mapping[str, Values]

    @property
    def order(self) -> str:
        """Byte order of integers."""
        return ">" if self.processor == SGI else "<"

    def numbers(self, name: str) -> NDArray[np.float64]:
        """The numbers of a parameter, (n,) [unit of the parameter]; none if there is no such one."""
        found = self.values.get(name, ())
        return found if isinstance(found, np.ndarray) else np.empty(0)

    def number(self, name: str) -> float | None:
        """The first number of a parameter."""
        found = self.numbers(name)
        return float(found[0]) if len(found) else None

    def texts(self, name: str) -> tuple[str, ...]:
        """The texts of a parameter and of those that continue it: LABELS, LABELS2, LABELS3, ..."""
        found: tuple[str, ...] = ()
        for key in [name, *(f"{name}{i}" for i in range(2, 100))]:
            value = self.values.get(key)
            if not isinstance(value, tuple):
                break
            found += value
        return found


def floats(raw: bytes, processor: int) -> NDArray[np.float64]:
    """Four-byte floats (n,) [unit of what they state] of a processor.

    DEC's F float has its 16-bit halves swapped and an exponent larger by two: value = IEEE(halves swapped) / 4.
    """
    if processor == DEC:
        swapped = np.frombuffer(raw, dtype="<u2").reshape(-1, 2)[:, ::-1].copy()
        return as_float64(swapped.view("<f4").ravel()) / 4.0
    return as_float64(np.frombuffer(raw, dtype=">f4" if processor == SGI else "<f4"))


def _parameters(source: ByteSource, head: bytes) -> Parameters:
    """The parameter section to which the file's header leads; it ends at the data where it is declared shorter."""
    begin = (head[0] - 1) * BLOCK
    _, _, blocks, processor = source.read(begin, 4, "the head of the parameters")
    if processor not in (INTEL, DEC, SGI):
        raise damaged(source.path, f"processor {processor} at byte {begin + 3}; expected 84, 85 or 86")
    order = ">" if processor == SGI else "<"
    end = max(begin + max(1, blocks) * BLOCK, (struct.unpack_from(f"{order}H", head, 16)[0] - 1) * BLOCK)
    section = source.read(begin, min(end, source.size) - begin, "the parameters")
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Values]] = []
    at = 4
    try:
        while at + 2 <= len(section):
            length, number = struct.unpack_from("bb", section, at)
            if length == 0 or number == 0:
                break
            after = at + 2 + abs(length)
            name = section[at + 2 : after].decode("latin-1").strip().upper()
            (offset,) = struct.unpack_from(f"{order}H", section, after)
            if number < 0:
                groups[-number] = name
            else:
                found.append((number, name, _value(section, after + 2, processor)))
            if offset < 3:
                break
            at = after + offset
    except (struct.error, IndexError, ValueError) as error:
        raise damaged(source.path, f"the parameters from byte {begin} on cannot be read ({error})") from error
    return Parameters(processor, {f"{groups.get(number, number)}:{name}": value for number, name, value in found})


def _value(section: bytes, at: int, processor: int) -> Values:
    kind, dimensions = struct.unpack_from("bB", section, at)
    if abs(kind) not in (1, 2, 4):
        raise ValueError(f"type {kind}")
    sizes = [int(size) for size in section[at + 2 : at + 2 + dimensions]]
    count = int(np.prod(sizes, dtype=np.int64)) if sizes else 1
    begin = at + 2 + dimensions
    raw = section[begin : begin + count * abs(kind)]
    if len(sizes) != dimensions or len(raw) != count * abs(kind):
        raise ValueError(f"{count} values at byte {begin} lie beyond its end")
    if kind == -1:
        width = sizes[0] if sizes else 1
        return tuple(decoded(raw[i : i + width]).strip(" \0") for i in range(0, count, width)) if width else ()
    if kind == 4:
        return floats(raw, processor)
    order = ">" if processor == SGI else "<"
    return np.frombuffer(raw, dtype="i1" if abs(kind) == 1 else f"{order}i2").astype(np.float64)


@dataclass(frozen=True)
class Header:
    """How a frame lies in the file: points of four words, then ``per_frame`` samples of each analog channel.

    With the parameters, and the findings about both.
    """

    parameters: Parameters
    begin: int
    frames: int
    first_frame: int
    points: int
    channels: int
    per_frame: int
    rate_hz: float
    scale: float
    is_float: bool
    findings: tuple[Finding, ...] = ()

    @property
    def words(self) -> int:
        """Numbers of a frame."""
        return 4 * self.points + self.channels * self.per_frame

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame."""
        return self.words * (4 if self.is_float else 2)


def _header(source: ByteSource) -> Header:
    raw = source.read(0, BLOCK, "the header")
    if raw[1] != 0x50 or raw[0] == 0:
        raise damaged(source.path, f"begins with {raw[:2].hex()}; expected the parameters' block and 50 (hexadecimal)")
    given = _parameters(source, raw)
    points, analog, first, last = struct.unpack_from(f"{given.order}4H", raw, 2)
    data_block, per_frame = struct.unpack_from(f"{given.order}2H", raw, 16)
    scale, rate = floats(raw[12:16] + raw[20:24], given.processor)
    findings: list[Finding] = []
    scale = _agreed("scale of points", scale, given.number("POINT:SCALE"), findings)
    rate = _agreed("frame rate", rate, given.number("POINT:RATE"), findings)
    if not np.isfinite([scale, rate]).all():
        raise damaged(source.path, f"scale {scale} and frame rate {rate}; expected numbers")
    if (points or analog) and data_block == 0:
        data_block = int(given.number("POINT:DATA_START") or 0)
    channels, begin = analog // per_frame if per_frame else 0, (data_block - 1) * BLOCK
    used = int(given.number("ANALOG:USED") or 0)
    if analog == used != channels:  # some programs write the channels where their samples of a frame belong
        message = f"the header counts {analog} samples of analog channels a frame, which are the channels themselves"
        findings.append(Finding("header_contradiction", None, None, message))
        channels = used
    frames, scale = _frames(given, first, last, findings), float(scale)
    head = Header(given, begin, frames, first, points, channels, per_frame, float(rate), abs(scale), scale < 0)
    if not head.words or data_block < 1:
        what = f"{points} points and {channels} analog channels from block {data_block} on: no data"
        raise damaged(source.path, what)
    there = max(0, source.size - begin)
    whole = there // head.frame_bytes
    if whole < frames:
        message = f"{frames} frames are declared, {whole} whole ones are in the file's {source.size} bytes"
        findings.append(Finding("cut_file", None, None, message))
    elif there - frames * head.frame_bytes >= max(head.frame_bytes, BLOCK):
        message = f"{frames} frames are declared, the file has room for {whole}"
        findings.append(Finding("count_contradiction", None, None, message))
    stated, rate = given.number("ANALOG:RATE"), head.rate_hz * per_frame
    if stated is not None and channels and stated != rate:
        message = f"the analog rate is {stated:g} Hz in the parameters, "
        message += f"and {rate:g} Hz by frame rate and samples a frame"
        code = "rate_rounded" if rate and abs(stated / rate - 1) < 1e-6 else "rate_contradiction"
        findings.append(Finding(code, None, None, message))
    return replace(head, findings=tuple(findings))


def _agreed(what: str, header: float, parameter: float | None, findings: list[Finding]) -> float:
    """The parameter's value, which is what programs keep; that the header has another is a finding."""
    if parameter is None or header == parameter:
        return float(header)
    message = f"{what} is {header:g} in the header and {parameter:g} in the parameters, which are taken"
    findings.append(Finding("header_contradiction", None, None, message))
    return parameter


_WORDS = np.array([1, 1 << 16])
"""Of a 32-bit number as two of 16 bits, the low one first."""


def _frames(given: Parameters, first: int, last: int, findings: list[Finding]) -> int:
    """Number of frames. 16 bits hold 65535 of them; the parameters of TRIAL hold more."""
    header = last - first + 1
    start, end = given.numbers("TRIAL:ACTUAL_START_FIELD"), given.numbers("TRIAL:ACTUAL_END_FIELD")
    if len(start) == 2 and len(end) == 2:
        trial = int(_WORDS @ (end.astype(np.int64) & 0xFFFF)) - int(_WORDS @ (start.astype(np.int64) & 0xFFFF)) + 1
        if trial > 0 and (trial == header or trial > 0xFFFF or last == 0xFFFF):
            return trial
    counted = given.number("POINT:FRAMES")
    if counted is not None and int(counted) & 0xFFFF != header & 0xFFFF:
        message = f"the header counts {header} frames ({first} to {last}), the parameters {int(counted) & 0xFFFF}"
        findings.append(Finding("header_contradiction", None, None, message))
    return max(header, 0)


def _labels(given: Sequence[str], count: int, otherwise: str) -> list[str]:
    """A label for each of ``count`` columns; those without one are numbered."""
    padded = [*given[:count], *[""] * (count - len(given))]
    return [label or f"{otherwise} {i}" for i, label in enumerate(padded, 1)]


_LARGEST = 1e300
"""A scale beyond this is none; it must not overflow."""


def _frame_blocks(source: ByteSource, head: Header) -> Iterator[tuple[int, Samples, Samples, int]]:
    """All whole frames, in blocks of bounded size: the first one's number, points, analog samples, where they end.

    Points are (p, 4, m), coordinates [POINT:UNITS] and fourth word [-]; analog samples (c, n).
    """
    given = head.parameters
    frames = min(head.frames, (source.size - head.begin) // head.frame_bytes)
    is_unsigned = any(word.upper() == "UNSIGNED" for word in given.texts("ANALOG:FORMAT"))
    # value = (number - offset) * scale of the channel * general scale; 0, 1 and 1 where none is stated
    offset, scale = np.zeros((head.channels, 1)), np.ones((head.channels, 1))
    for column, name in ((offset, "OFFSET"), (scale, "SCALE")):
        stated = given.numbers(f"ANALOG:{name}")[: head.channels]
        column[: len(stated), 0] = stated
    offset = np.where(is_unsigned & (offset < 0), offset + 65536.0, offset)
    general = given.number("ANALOG:GEN_SCALE")
    for start, end in block_spans(frames, head.words):
        begin = head.begin + start * head.frame_bytes
        raw = source.read(begin, (end - start) * head.frame_bytes, f"frames {start} to {end - 1}")
        numbers = floats(raw, given.processor) if head.is_float else np.frombuffer(raw, f"{given.order}i2")
        words = as_float64(numbers).reshape(end - start, head.words)
        points = words[:, : 4 * head.points].reshape(end - start, head.points, 4).transpose(1, 2, 0).copy()
        if not head.is_float:
            points[:, :3] *= min(head.scale, _LARGEST)  # coordinate = integer * scale
        analog = words[:, 4 * head.points :].reshape((end - start) * head.per_frame, head.channels).T
        if is_unsigned and not head.is_float:
            analog = np.where(analog < 0, analog + 65536.0, analog)
        with np.errstate(all="ignore"):
            physical = (analog - offset) * (scale * (1.0 if general is None else general))
        yield start, points, physical, begin + len(raw)


_LONGEST_TEXT = 2000
_TYPE_GROUPS = ("ANGLES", "ANGLE", "FORCES", "FORCE", "MOMENTS", "MOMENT", "POWERS", "POWER", "SCALARS", "SCALAR")


def open_c3d(path: Path, options: ReadOptions) -> Recording:
    """Read header and parameters; the frames are read when asked for."""
    with ByteSource(path) as source:
        head = _header(source)
        if not head.frames:
            raise Refusal(path.name, Finding("no_data", None, None, "the header declares no frame"))
        spoken = np.zeros(head.points, dtype=bool)  # fourth words that are anything but 0 (seen) and -1 (not seen)
        for _, points, _, _ in _frame_blocks(source, head) if head.points else ():
            spoken |= ((points[:, 3] != 0) & (points[:, 3] != -1)).any(axis=1)
    residuals = np.flatnonzero(spoken)
    groups = _groups(path.stem, head, residuals)
    known = ("LABELS", "UNITS", "DESCRIPTIONS", "SCALE", "OFFSET", "GAIN")
    metadata = {}
    for name, value in head.parameters.values.items():
        if not name.rpartition(":")[2].rstrip("0123456789").startswith(known):
            text = "; ".join(value if isinstance(value, tuple) else (f"{number:.9g}" for number in value))
            if text.strip("; "):
                metadata[name] = text[:_LONGEST_TEXT]

    def blocks(report: Report) -> Iterator[Block]:
        """Positions that were not seen are NaN, and counted."""
        missing = 0
        with ByteSource(path) as source:
            for start, points, analog, end in _frame_blocks(source, head):
                unseen = points[:, 3] < 0
                missing += int(unseen.sum())
                seen = np.where(unseen[:, None], np.nan, points[:, :3]).reshape(3 * head.points, unseen.shape[1])
                columns = {"analog": analog, "points": seen, "residuals": points[residuals, 3]}
                for kind, group in groups.items():
                    first = start * (head.per_frame if kind == "analog" else 1)
                    yield Block(group, tuple(columns[kind]), first, None, end)
        if missing:
            message = f"{missing} positions are marked as not seen (their fourth word is negative): NaN"
            report(Finding("invalid_samples", None, None, message))

    return Recording(
        path=path,
        format="C3D",
        reader="testbench.readers.c3d",
        groups=tuple(groups.values()),
        read=lambda report: watch_nonfinite(blocks(report), report, but=groups.get("points")),
        metadata=metadata,
        findings=head.findings,
    )


def _groups(stem: str, head: Header, residuals: NDArray[np.intp]) -> dict[str, Group]:
    """Analog channels, points, and fourth words that state more than seen or not seen, each if there are any."""
    given, groups = head.parameters, dict[str, Group]()
    start = max(head.first_frame - 1, 0) / head.rate_hz if head.rate_hz > 0 else 0.0
    clock = clock_of_rate(head.rate_hz, start)
    if head.channels:
        names = _labels(given.texts("ANALOG:LABELS"), head.channels, "analog")
        units = [*given.texts("ANALOG:UNITS"), *[""] * head.channels]
        channels = tuple(Channel(name, unit or None) for name, unit in zip(names, units, strict=False))
        groups["analog"] = Group(f"{stem} analog", channels, clock_of_rate(head.rate_hz * head.per_frame, start))
    if head.points:
        names = _labels(given.texts("POINT:LABELS"), head.points, "point")
        length, others = next(iter(given.texts("POINT:UNITS")), "") or None, dict[str, str | None]()
        # points that are no positions: angles, forces, moments, powers, as the file sorts them
        kinds = given.texts("POINT:TYPE_GROUPS") or _TYPE_GROUPS
        for several, one in zip(kinds[::2], kinds[1::2], strict=False):
            unit = next(iter(given.texts(f"POINT:{one}_UNITS")), "") or None
            others |= dict.fromkeys(given.texts(f"POINT:{several}"), unit)
        axes = tuple(Channel(f"{name} {axis}", others.get(name, length)) for name in names for axis in "XYZ")
        groups["points"] = Group(f"{stem} points", axes, clock)
        if len(residuals):
            words = tuple(Channel(f"{names[i]} residual") for i in residuals)
            groups["residuals"] = Group(f"{stem} residuals", words, clock)
    return groups
