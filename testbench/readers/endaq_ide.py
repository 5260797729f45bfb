"""enDAQ recordings (``.IDE``): EBML elements one behind the other, read by idelib in a process of its own.

idelib passes over what it cannot read and is silent on a cut, so that the elements are walked first: is each whole?
Each channel of the recorder is a group, calibrated by the recorder's polynomials, with its time as recorded.
"""

import logging
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..recording import Block, Channel, Finding, Group, Recording, StartTime, TimeColumn, point_in_time
from .byte_source import ByteSource, block_spans
from .format_findings import damaged, nothing_to_read, watch_nonfinite

_DATA_BLOCK = 0xA1
_WINDOW = 12


def whole_elements(source: ByteSource) -> tuple[int, Finding | None]:
    """Up to which byte the elements are whole, and why not to the end: a file that ends inside one is cut."""
    at, number, blocks = 0, 0, 0
    while at < source.size:
        head = source.read(at, min(_WINDOW, source.size - at), "an element")
        if not head.strip(b"\0") or not head.strip(b"\xff"):
            return at, _filled(source, at)
        identifier, used = _integer(head, keep_mark=True)
        size, more = _integer(head[used:], keep_mark=False)
        is_element, end = bool(used and more), at + used + more + size
        if not is_element and len(head) == _WINDOW:
            raise damaged(source.path, f"byte {at}: {head[:4].hex()} begins no element")
        if not is_element or end > source.size:
            message = f"the file ends at byte {source.size} inside element {number + 1}, which begins at byte {at}; "
            message += f"{blocks} whole blocks of samples come before it"
            return at, Finding("cut_file", None, f"byte {at}", message)
        at, number, blocks = end, number + 1, blocks + (identifier == _DATA_BLOCK)
    if not blocks:
        return at, Finding("no_data", None, None, f"{number} elements, and no block of samples among them")
    return at, None


def _integer(raw: bytes, keep_mark: bool) -> tuple[int, int]:
    """A number of EBML, whose leading zero bits say its length; and how many bytes it takes, 0 if it is none."""
    if not raw or not raw[0]:
        return 0, 0
    length = 9 - raw[0].bit_length()
    if length > len(raw) or (keep_mark and length > 4):
        return 0, 0
    value = int.from_bytes(raw[:length], "big")
    return (value if keep_mark else value & (1 << 7 * length) - 1), length


def _filled(source: ByteSource, at: int) -> Finding:
    """The rest of the file, if it is all zero or all one, was set aside and never written."""
    for begin in range(at, source.size, 1 << 20):
        piece = source.read(begin, min(1 << 20, source.size - begin), "the end")
        if piece.strip(b"\0") and piece.strip(b"\xff"):
            raise damaged(source.path, f"byte {at}: {source.size - at} bytes that are no element")
    message = f"from byte {at} on the file was set aside and never written: {source.size - at} empty bytes"
    return Finding("cut_file", None, f"byte {at}", message)


def open_library(path: Path) -> Recording:
    """Open the recording; idelib goes through the whole file for that."""
    with ByteSource(path) as source:
        end, cut = whole_elements(source)
    findings = [] if cut is None else [cut]
    with _dataset(path, end, findings) as dataset:
        found = list(_sources(dataset, path.stem))
        metadata = {str(key): str(value) for key, value in (dataset.recorderInfo or {}).items()}
        metadata |= {f"session {s.sessionId}: start UTC": str(s.utcStartTime) for s in dataset.sessions}
    if not found:
        raise nothing_to_read(path, findings, "no channel has samples")
    message = "values are calibrated by the polynomials that the recorder wrote, as idelib applies them; means are kept"

    def blocks() -> Iterator[Block]:
        with _dataset(path, end, []) as dataset:
            for group, events in _sources(dataset, path.stem):
                for begin, stop in block_spans(len(events), len(group.channels)):
                    rows = events.arraySlice(begin, stop, display=False)
                    yield Block(group, tuple(np.asarray(rows, dtype=np.float64)), begin)

    return Recording(
        path=path,
        format="enDAQ IDE",
        reader="testbench.readers.ide",
        groups=tuple(group for group, _ in found),
        read=lambda report: watch_nonfinite(blocks(), report),
        metadata=metadata,
        findings=(*findings, Finding("calibration_applied", None, None, message)),
    )


@contextmanager
def _dataset(path: Path, end: int, findings: list[Finding]) -> Iterator[Any]:
    """The file's whole elements as idelib reads them; what it passes over in silence is a finding."""
    from idelib import importer

    passed_over: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: passed_over.append(record.getMessage())  # type: ignore[method-assign]
    logging.getLogger("idelib").addHandler(handler)
    with path.open("rb") as whole, tempfile.NamedTemporaryFile(suffix=".ide") as shorter:
        stream: Any = whole
        if end < path.stat().st_size:
            shutil.copyfileobj(whole, shorter)
            shorter.truncate(end)
            shorter.seek(0)
            stream = shorter
        dataset = importer.openFile(stream, quiet=True)
        importer.readData(dataset)
        if passed_over or dataset.fileDamaged:
            stated = f": {passed_over[0]}" if passed_over else ""
            message = f"idelib passed over {max(1, len(passed_over))} elements that it could not read{stated}"
            findings.append(Finding("damaged_file", None, None, message))
        yield dataset


def _sources(dataset: Any, stem: str) -> Iterator[tuple[Group, Any]]:  # noqa: ANN401
    """The group of each channel and session that has samples, and what gives them."""
    taken: set[str] = set()
    for channel in dataset.channels.values():
        for session in dataset.sessions:
            events = channel.getSession(session.sessionId)
            if not len(events):
                continue
            name = str(channel.displayName or channel.name or stem)
            if len(dataset.sessions) > 1:
                name = f"{name} session {session.sessionId}"
            if name in taken:
                name = f"{name} {channel.id}"
            taken.add(name)
            events.removeMean = False
            channels = (
                Channel(str(sub.displayName or sub.name), str((sub.units or ("", ""))[1]) or None)
                for sub in channel.subchannels
            )
            yield Group(name, (Channel("Time", "µs"), *channels), TimeColumn(0, 1e-6), _zero(session)), events


def _zero(session: Any) -> StartTime | None:  # noqa: ANN401
    """When the recorder's microseconds are zero: the session states when it began in UTC, in whole seconds."""
    start = session.utcStartTime
    return point_in_time(round(start * 10**6) * 1000, "UTC start of the session", 1.0) if start else None
