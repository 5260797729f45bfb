"""Reader of C3D: analog channels and points are groups of their own, since they have rates of their own."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...findings import Finding, Refusal
from ...recording import Block, Channel, Clock, Group, Recording, Report, Samples
from ..declared import by_rate
from ..nonfinite import watched
from ..registry import ReadOptions
from ..stream import ByteSource
from . import frames, header
from .header import Head
from .parameters import Parameters

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
        head = header.read(source)
        if not head.layout.frames:
            raise Refusal(path.name, Finding("no_data", None, None, "the header declares no frame"))
        groups = _groups(path.stem, head, frames.informative_residuals(source, head))
    return Recording(
        path=path,
        format="C3D",
        reader="testbench.readers.c3d",
        groups=groups.all,
        read=lambda report: _blocks(path, head, groups, report),
        metadata=_metadata(head),
        findings=(*head.findings, *_rate(head)),
    )


def _groups(stem: str, head: Head, residuals: tuple[int, ...]) -> _Groups:
    """Analog channels, points, and fourth words that say more than seen or not seen, each if there are any."""
    layout, given = head.layout, head.parameters
    start = max(layout.first_frame - 1, 0) / layout.rate_hz if layout.rate_hz > 0 else 0.0
    analog = points = residual = None
    if layout.channels:
        names = header.labels(given.texts("ANALOG:LABELS"), layout.channels, "analog")
        units = [*given.texts("ANALOG:UNITS"), *[""] * layout.channels]
        channels = tuple(Channel(name, unit or None) for name, unit in zip(names, units, strict=False))
        analog = Group(f"{stem} analog", channels, _clock(layout.rate_hz * layout.per_frame, start))
    if layout.points:
        names = header.labels(given.texts("POINT:LABELS"), layout.points, "point")
        others = _units_of_points(given)
        length = next(iter(given.texts("POINT:UNITS")), "") or None
        axes = tuple(Channel(f"{name} {axis}", others.get(name, length)) for name in names for axis in "XYZ")
        points = Group(f"{stem} points", axes, _clock(layout.rate_hz, start))
        if residuals:
            words = tuple(Channel(f"{names[i]} residual") for i in residuals)
            residual = Group(f"{stem} residuals", words, _clock(layout.rate_hz, start))
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


def _clock(rate_hz: float, start: float) -> Clock | None:
    return by_rate(rate_hz, start)


def _blocks(path: Path, head: Head, groups: _Groups, report: Report) -> Iterator[Block]:
    """Frames as blocks of each group; what is no number among the analog channels is reported by channel."""

    def unwatched() -> Iterator[Block]:
        missing = 0
        with ByteSource(path) as source:
            for piece in frames.blocks(source, head):
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

    return watched(unwatched(), report, but=groups.points)


def _seen(points: Samples) -> tuple[Samples, ...]:
    """Coordinates of all points; NaN for one that was not seen, whose fourth word is negative."""
    unseen = points[:, 3] < 0
    return tuple(np.where(unseen[:, None], np.nan, points[:, :3]).reshape(3 * len(points), -1))


def _rate(head: Head) -> list[Finding]:
    """The analog rate that the parameters state against frame rate times samples a frame."""
    stated, rate = head.parameters.number("ANALOG:RATE"), head.layout.rate_hz * head.layout.per_frame
    if stated is None or not head.layout.channels or stated == rate:
        return []
    message = f"the analog rate is {stated:g} Hz in the parameters, and {rate:g} Hz by frame rate and samples a frame"
    code = "rate_rounded" if rate and abs(stated / rate - 1) < 1e-6 else "rate_contradiction"
    return [Finding(code, None, None, message)]


def _metadata(head: Head) -> dict[str, str]:
    """All parameters but those that name and scale the channels."""
    known = ("LABELS", "UNITS", "DESCRIPTIONS", "SCALE", "OFFSET", "GAIN")
    metadata = {}
    for name, value in head.parameters.values.items():
        if not name.rpartition(":")[2].rstrip("0123456789").startswith(known):
            text = "; ".join(value if isinstance(value, tuple) else (f"{number:.9g}" for number in value))
            if text.strip("; "):
                metadata[name] = text[:_LONGEST_TEXT]
    return metadata
