"""C3D: markers and analog channels of movement laboratories, force plates among them.

A header of 512 bytes, parameters (groups of named values), then frames: of each point x, y, z and a fourth word, then
some samples of each analog channel. Points and analog channels are groups of their own, since their rates differ.
Header and parameters state much twice: the parameters are taken, and a contradiction is reported. Numbers are those of
Intel, DEC or SGI machines. Source: The C3D File Format (https://www.c3d.org/docs/C3D_User_Guide.pdf).
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Channel, Finding, Group, Recording, Refusal, Report, Samples
from .byte_source import ByteSource, as_float64, block_samples
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


def read_parameters(source: ByteSource, first_block: int) -> Parameters:
    """The parameter section that begins at block ``first_block`` (from 1)."""
    begin = (first_block - 1) * BLOCK
    head = source.read(begin, 4, "the head of the parameters")
    blocks, processor = head[2], head[3]
    if processor not in (INTEL, DEC, SGI):
        raise damaged(source.path, f"processor {processor} at byte {begin + 3}; expected 84, 85 or 86")
    section = source.read(begin, min(max(1, blocks) * BLOCK, source.size - begin), "the parameters")
    try:
        return Parameters(processor, _parsed(section, processor))
    except (struct.error, IndexError, ValueError) as error:
        raise damaged(source.path, f"the parameters from byte {begin} on cannot be read ({error})") from error


def _parsed(section: bytes, processor: int) -> dict[str, Values]:
    order = ">" if processor == SGI else "<"
    groups: dict[int, str] = {}
    found: list[tuple[int, str, Values]] = []
    at = 4
    while at + 2 <= len(section):
        length, number = struct.unpack_from("bb", section, at)
        if length == 0 or number == 0:
            break
        name = section[at + 2 : at + 2 + abs(length)].decode("latin-1").strip().upper()
        after = at + 2 + abs(length)
        (offset,) = struct.unpack_from(f"{order}H", section, after)
        if number < 0:
            groups[-number] = name
        else:
            found.append((number, name, _value(section, after + 2, processor)))
        if offset < 3:
            break
        at = after + offset
    return {f"{groups.get(number, number)}:{name}": value for number, name, value in found}


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
        return tuple(parameter_text(raw[i : i + width]) for i in range(0, count, width)) if width else ()
    if kind == 4:
        return floats(raw, processor)
    order = ">" if processor == SGI else "<"
    return np.frombuffer(raw, dtype="i1" if abs(kind) == 1 else f"{order}i2").astype(np.float64)


def parameter_text(raw: bytes) -> str:
    """A text without the blanks that fill it up; in UTF-8, or else in the letters of Western Europe."""
    try:
        return raw.decode("utf-8").strip(" \0")
    except UnicodeDecodeError:
        return raw.decode("cp1252", "replace").strip(" \0")


@dataclass(frozen=True)
class Layout:
    """How a frame lies in the file: points of four words, then ``per_frame`` samples of each analog channel."""

    begin: int
    frames: int
    first_frame: int
    points: int
    channels: int
    per_frame: int
    rate_hz: float
    scale: float
    is_float: bool

    @property
    def words(self) -> int:
        """Numbers of a frame."""
        return 4 * self.points + self.channels * self.per_frame

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame."""
        return self.words * (4 if self.is_float else 2)


@dataclass(frozen=True)
class Header:
    """Layout, parameters and the findings about them."""

    layout: Layout
    parameters: Parameters
    findings: tuple[Finding, ...]


def read_header(source: ByteSource) -> Header:
    """Header and parameters."""
    raw = source.read(0, BLOCK, "the header")
    if raw[1] != 0x50 or raw[0] == 0:
        raise damaged(source.path, f"begins with {raw[:2].hex()}; expected the parameters' block and 50 (hexadecimal)")
    given = read_parameters(source, raw[0])
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
    channels = analog // per_frame if per_frame else 0
    frames = _frames(given, first, last, findings)
    layout = Layout(
        (data_block - 1) * BLOCK, frames, first, points, channels, per_frame, float(rate), abs(float(scale)), scale < 0
    )
    if not layout.words or data_block < 1:
        raise damaged(
            source.path, f"{points} points and {channels} analog channels from block {data_block} on: no data"
        )
    findings += _against_size(source, layout)
    return Header(layout, given, tuple(findings))


def _agreed(what: str, header: float, parameter: float | None, findings: list[Finding]) -> float:
    """The parameter's value, which is what programs keep; that the header has another is a finding."""
    if parameter is None or header == parameter:
        return float(header)
    message = f"{what} is {header:g} in the header and {parameter:g} in the parameters, which are taken"
    findings.append(Finding("header_contradiction", None, None, message))
    return parameter


def _frames(given: Parameters, first: int, last: int, findings: list[Finding]) -> int:
    """Number of frames. 16 bits hold 65535 of them; the parameters of TRIAL hold more."""
    header = last - first + 1
    start, end = given.numbers("TRIAL:ACTUAL_START_FIELD"), given.numbers("TRIAL:ACTUAL_END_FIELD")
    if len(start) == 2 and len(end) == 2:
        trial = _long(end) - _long(start) + 1
        if trial > 0 and (trial == header or trial > 0xFFFF or last == 0xFFFF):
            return trial
    counted = given.number("POINT:FRAMES")
    if counted is not None and int(counted) & 0xFFFF != header & 0xFFFF:
        message = f"the header counts {header} frames ({first} to {last}), the parameters {int(counted) & 0xFFFF}"
        findings.append(Finding("header_contradiction", None, None, message))
    return max(header, 0)


def _long(words: NDArray[np.float64]) -> int:
    """A 32-bit number from its two 16-bit words, the low one first."""
    return (int(words[0]) & 0xFFFF) | (int(words[1]) & 0xFFFF) << 16


def _against_size(source: ByteSource, layout: Layout) -> list[Finding]:
    """The declared frames against the bytes that are there."""
    there = max(0, source.size - layout.begin)
    whole = there // layout.frame_bytes
    if whole < layout.frames:
        message = f"{layout.frames} frames are declared, {whole} whole ones are in the file's {source.size} bytes"
        return [Finding("cut_file", None, None, message)]
    if there - layout.frames * layout.frame_bytes >= max(layout.frame_bytes, BLOCK):
        message = f"{layout.frames} frames are declared, the file has room for {whole}"
        return [Finding("count_contradiction", None, None, message)]
    return []


def _labels(given: Sequence[str], count: int, otherwise: str) -> list[str]:
    """A label for each of ``count`` columns; those without one are numbered."""
    padded = [*given[:count], *[""] * (count - len(given))]
    return [label or f"{otherwise} {i}" for i, label in enumerate(padded, 1)]


_LARGEST = 1e300
"""A scale beyond this is none; it must not overflow."""


@dataclass(frozen=True)
class Frames:
    """Successive frames: ``points`` (p, 4, m), coordinates [POINT:UNITS] and fourth word [-]; ``analog`` (c, n)."""

    points: Samples
    analog: Samples
    start: int
    end_byte: int


def frame_blocks(source: ByteSource, head: Header) -> Iterator[Frames]:
    """All whole frames, in blocks of bounded size."""
    layout = head.layout
    frames = min(layout.frames, (source.size - layout.begin) // layout.frame_bytes)
    step = block_samples(layout.words)
    scale, offset = analog_law(head)
    for start in range(0, frames, step):
        count = min(step, frames - start)
        begin = layout.begin + start * layout.frame_bytes
        raw = source.read(begin, count * layout.frame_bytes, f"frames {start} to {start + count - 1}")
        words = _numbers(raw, head).reshape(count, layout.words)
        points = words[:, : 4 * layout.points].reshape(count, layout.points, 4).transpose(1, 2, 0).copy()
        if not layout.is_float:
            points[:, :3] *= min(layout.scale, _LARGEST)  # coordinate = integer * scale
        analog = words[:, 4 * layout.points :].reshape(count * layout.per_frame, layout.channels).T
        if not layout.is_float and _is_unsigned(head):
            analog = np.where(analog < 0, analog + 65536.0, analog)
        # value = (number - offset) * scale of the channel * general scale
        with np.errstate(all="ignore"):
            physical = (analog - offset) * scale
        yield Frames(points, physical, start, begin + len(raw))


def _numbers(raw: bytes, head: Header) -> Samples:
    if head.layout.is_float:
        return floats(raw, head.parameters.processor)
    return np.frombuffer(raw, dtype=f"{head.parameters.order}i2").astype(np.float64)


def analog_law(head: Header) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scale [unit of the channel] and offset [-] of the analog channels, each (c, 1); 1 and 0 where none is stated."""
    given, channels = head.parameters, head.layout.channels
    general = given.number("ANALOG:GEN_SCALE")
    with np.errstate(all="ignore"):
        scale = _filled(given.numbers("ANALOG:SCALE"), channels, 1.0) * (1.0 if general is None else general)
    offset = _filled(given.numbers("ANALOG:OFFSET"), channels, 0.0)
    if _is_unsigned(head):
        offset = np.where(offset < 0, offset + 65536.0, offset)
    return scale[:, None], offset[:, None]


def _is_unsigned(head: Header) -> bool:
    return any(word.upper() == "UNSIGNED" for word in head.parameters.texts("ANALOG:FORMAT"))


def _filled(values: NDArray[np.float64], count: int, otherwise: float) -> NDArray[np.float64]:
    return np.concatenate([values[:count], np.full(max(0, count - len(values)), otherwise)])


def informative_residuals(source: ByteSource, head: Header) -> tuple[int, ...]:
    """The points whose fourth word is anything but 0 (seen) and -1 (not seen)."""
    found = np.zeros(head.layout.points, dtype=bool)
    if head.layout.points:
        for piece in frame_blocks(source, head):
            words = piece.points[:, 3]
            found |= ((words != 0) & (words != -1)).any(axis=1)
    return tuple(int(i) for i in np.flatnonzero(found))


_LONGEST_TEXT = 2000


@dataclass(frozen=True)
class _Groups:
    """The groups of a file, each with its kind; ``residuals`` are the points whose fourth word is kept."""

    analog: Group | None
    points: Group | None
    residual: Group | None
    residuals: tuple[int, ...]

    @property
    def all(self) -> tuple[Group, ...]:
        return tuple(group for group in (self.analog, self.points, self.residual) if group is not None)


def open_c3d(path: Path, options: ReadOptions) -> Recording:
    """Read header and parameters; the frames are read when asked for."""
    with ByteSource(path) as source:
        head = read_header(source)
        if not head.layout.frames:
            raise Refusal(path.name, Finding("no_data", None, None, "the header declares no frame"))
        groups = _groups(path.stem, head, informative_residuals(source, head))
    return Recording(
        path=path,
        format="C3D",
        reader="testbench.readers.c3d",
        groups=groups.all,
        read=lambda report: _blocks(path, head, groups, report),
        metadata=_metadata(head),
        findings=(*head.findings, *_rate(head)),
    )


def _groups(stem: str, head: Header, residuals: tuple[int, ...]) -> _Groups:
    """Analog channels, points, and fourth words that state more than seen or not seen, each if there are any."""
    layout, given = head.layout, head.parameters
    start = max(layout.first_frame - 1, 0) / layout.rate_hz if layout.rate_hz > 0 else 0.0
    analog = points = residual = None
    if layout.channels:
        names = _labels(given.texts("ANALOG:LABELS"), layout.channels, "analog")
        units = [*given.texts("ANALOG:UNITS"), *[""] * layout.channels]
        channels = tuple(Channel(name, unit or None) for name, unit in zip(names, units, strict=False))
        analog = Group(f"{stem} analog", channels, clock_of_rate(layout.rate_hz * layout.per_frame, start))
    if layout.points:
        names = _labels(given.texts("POINT:LABELS"), layout.points, "point")
        others = _units_of_points(given)
        length = next(iter(given.texts("POINT:UNITS")), "") or None
        axes = tuple(Channel(f"{name} {axis}", others.get(name, length)) for name in names for axis in "XYZ")
        points = Group(f"{stem} points", axes, clock_of_rate(layout.rate_hz, start))
        if residuals:
            words = tuple(Channel(f"{names[i]} residual") for i in residuals)
            residual = Group(f"{stem} residuals", words, clock_of_rate(layout.rate_hz, start))
    return _Groups(analog, points, residual, residuals)


def _units_of_points(given: Parameters) -> dict[str, str | None]:
    """Units of points that are no positions: angles, forces, moments, powers, as the file sorts them."""
    kinds = given.texts("POINT:TYPE_GROUPS")
    kinds = kinds or ("ANGLES", "ANGLE", "FORCES", "FORCE", "MOMENTS", "MOMENT", "POWERS", "POWER", "SCALARS", "SCALAR")
    units: dict[str, str | None] = {}
    for several, one in zip(kinds[::2], kinds[1::2], strict=False):
        unit = next(iter(given.texts(f"POINT:{one}_UNITS")), "") or None
        units |= dict.fromkeys(given.texts(f"POINT:{several}"), unit)
    return units


def _blocks(path: Path, head: Header, groups: _Groups, report: Report) -> Iterator[Block]:
    """Frames as blocks of each group; what is no number among the analog channels is reported by channel."""

    def unwatched() -> Iterator[Block]:
        missing = 0
        with ByteSource(path) as source:
            for piece in frame_blocks(source, head):
                if groups.analog:
                    start = piece.start * head.layout.per_frame
                    yield Block(groups.analog, tuple(piece.analog), start, None, piece.end_byte)
                if groups.points:
                    missing += int((piece.points[:, 3] < 0).sum())
                    yield Block(groups.points, _seen(piece.points), piece.start, None, piece.end_byte)
                if groups.residual:
                    words = tuple(piece.points[i, 3].copy() for i in groups.residuals)
                    yield Block(groups.residual, words, piece.start, None, piece.end_byte)
        if missing:
            message = f"{missing} positions are marked as not seen (their fourth word is negative): NaN"
            report(Finding("invalid_samples", None, None, message))

    return watch_nonfinite(unwatched(), report, but=groups.points)


def _seen(points: Samples) -> tuple[Samples, ...]:
    """Coordinates of all points; NaN for one that was not seen, whose fourth word is negative."""
    unseen = points[:, 3] < 0
    return tuple(np.where(unseen[:, None], np.nan, points[:, :3]).reshape(3 * len(points), -1))


def _rate(head: Header) -> list[Finding]:
    """The analog rate that the parameters state against frame rate times samples a frame."""
    stated, rate = head.parameters.number("ANALOG:RATE"), head.layout.rate_hz * head.layout.per_frame
    if stated is None or not head.layout.channels or stated == rate:
        return []
    message = f"the analog rate is {stated:g} Hz in the parameters, and {rate:g} Hz by frame rate and samples a frame"
    code = "rate_rounded" if rate and abs(stated / rate - 1) < 1e-6 else "rate_contradiction"
    return [Finding(code, None, None, message)]


def _metadata(head: Header) -> dict[str, str]:
    """All parameters but those that name and scale the channels."""
    known = ("LABELS", "UNITS", "DESCRIPTIONS", "SCALE", "OFFSET", "GAIN")
    metadata = {}
    for name, value in head.parameters.values.items():
        if not name.rpartition(":")[2].rstrip("0123456789").startswith(known):
            text = "; ".join(value if isinstance(value, tuple) else (f"{number:.9g}" for number in value))
            if text.strip("; "):
                metadata[name] = text[:_LONGEST_TEXT]
    return metadata
