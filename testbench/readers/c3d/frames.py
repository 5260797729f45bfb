"""The data of a C3D file: blocks of frames as columns."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recording import Samples
from ..stream import ByteSource, block_samples
from . import parameters
from .header import Head

_LARGEST = 1e300
"""A scale beyond this is none; it must not overflow."""


@dataclass(frozen=True)
class Frames:
    """Successive frames. ``points`` (points, 4, frames): coordinates and the fourth word; ``analog`` (channels, n)."""

    points: Samples
    analog: Samples
    start: int
    end_byte: int


def blocks(source: ByteSource, head: Head) -> Iterator[Frames]:
    """All whole frames."""
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


def _numbers(raw: bytes, head: Head) -> Samples:
    if head.layout.is_float:
        return parameters.floats(raw, head.parameters.processor)
    return np.frombuffer(raw, dtype=f"{head.parameters.order}i2").astype(np.float64)


def analog_law(head: Head) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scale and offset of the analog channels, each (channels, 1); 1 and 0 where the parameters name none."""
    given, channels = head.parameters, head.layout.channels
    general = given.number("ANALOG:GEN_SCALE")
    with np.errstate(all="ignore"):
        scale = _filled(given.numbers("ANALOG:SCALE"), channels, 1.0) * (1.0 if general is None else general)
    offset = _filled(given.numbers("ANALOG:OFFSET"), channels, 0.0)
    if _is_unsigned(head):
        offset = np.where(offset < 0, offset + 65536.0, offset)
    return scale[:, None], offset[:, None]


def _is_unsigned(head: Head) -> bool:
    return any(word.upper() == "UNSIGNED" for word in head.parameters.texts("ANALOG:FORMAT"))


def _filled(values: NDArray[np.float64], count: int, otherwise: float) -> NDArray[np.float64]:
    return np.concatenate([values[:count], np.full(max(0, count - len(values)), otherwise)])


def informative_residuals(source: ByteSource, head: Head) -> tuple[int, ...]:
    """The points whose fourth word is anything but 0 (seen) and -1 (not seen)."""
    found = np.zeros(head.layout.points, dtype=bool)
    if head.layout.points:
        for piece in blocks(source, head):
            words = piece.points[:, 3]
            found |= ((words != 0) & (words != -1)).any(axis=1)
    return tuple(int(i) for i in np.flatnonzero(found))
