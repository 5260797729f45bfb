"""What the header and the parameters of a C3D file say of its data, one against the other."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...findings import Finding
from ..stream import ByteSource, damaged
from . import parameters
from .parameters import BLOCK, Parameters


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
class Head:
    """Layout, parameters and what is odd about them."""

    layout: Layout
    parameters: Parameters
    findings: tuple[Finding, ...]


def read(source: ByteSource) -> Head:
    """Header and parameters."""
    raw = source.read(0, BLOCK, "the header")
    if raw[1] != 0x50 or raw[0] == 0:
        raise damaged(source.path, f"begins with {raw[:2].hex()}; expected the parameters' block and 50 (hexadecimal)")
    given = parameters.read(source, raw[0])
    points, analog, first, last = struct.unpack_from(f"{given.order}4H", raw, 2)
    data_block, per_frame = struct.unpack_from(f"{given.order}2H", raw, 16)
    scale, rate = parameters.floats(raw[12:16] + raw[20:24], given.processor)
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
    return Head(layout, given, tuple(findings))


def _agreed(what: str, header: float, parameter: float | None, findings: list[Finding]) -> float:
    """The parameter's value, which is what programs keep; that the header has another is said."""
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


def labels(given: Sequence[str], count: int, otherwise: str) -> list[str]:
    """A label for each of ``count`` columns; those without one are numbered."""
    padded = [*given[:count], *[""] * (count - len(given))]
    return [label or f"{otherwise} {i}" for i, label in enumerate(padded, 1)]
