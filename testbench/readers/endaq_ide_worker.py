"""Reading an enDAQ recording with idelib: each of its channels is a group, calibrated, with its time as recorded."""

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..recording import Block, Channel, Finding, Group, Recording, Refusal, TimeColumn
from . import endaq_ide
from .byte_source import ByteSource, block_samples, watch_nonfinite

_MICROSECOND = "µs"


def open_library(path: Path) -> Recording:
    """Open the recording; idelib goes through the whole file for that."""
    with ByteSource(path) as source:
        whole = endaq_ide.check(source)
    findings = list(whole.findings)
    with _dataset(path, whole.end, findings) as dataset:
        found = list(_sources(dataset, path.stem))
        metadata = {str(key): str(value) for key, value in (dataset.recorderInfo or {}).items()}
        metadata |= {f"session {s.sessionId}: start UTC": str(s.utcStartTime) for s in dataset.sessions}
    if not found:
        raise Refusal(path.name, next(iter(findings), Finding("no_data", None, None, "no channel has samples")))
    message = "values are calibrated by the polynomials that the recorder wrote, as idelib applies them; means are kept"
    return Recording(
        path=path,
        format="enDAQ IDE",
        reader="testbench.readers.ide",
        groups=tuple(group for group, _ in found),
        read=lambda report: watch_nonfinite(_blocks(path, whole.end), report),
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
            _copy(whole, shorter, end)
            stream = shorter
        dataset = importer.openFile(stream, quiet=True)
        importer.readData(dataset)
        if passed_over or dataset.fileDamaged:
            said = f": {passed_over[0]}" if passed_over else ""
            message = f"idelib passed over {max(1, len(passed_over))} elements that it could not read{said}"
            findings.append(Finding("damaged_file", None, None, message))
        yield dataset


def _copy(source: IO[bytes], target: IO[bytes], count: int) -> None:
    while count and (piece := source.read(min(count, 1 << 20))):
        target.write(piece)
        count -= len(piece)
    target.seek(0)


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
            yield Group(name, (Channel("Time", _MICROSECOND), *_channels(channel)), TimeColumn(0, 1e-6)), events


def _channels(channel: Any) -> list[Channel]:  # noqa: ANN401
    return [
        Channel(str(sub.displayName or sub.name), str((sub.units or ("", ""))[1]) or None)
        for sub in channel.subchannels
    ]


def _blocks(path: Path, end: int) -> Iterator[Block]:
    with _dataset(path, end, []) as dataset:
        for group, events in _sources(dataset, path.stem):
            step = block_samples(len(group.channels))
            for begin in range(0, len(events), step):
                rows = events.arraySlice(begin, min(begin + step, len(events)), display=False)
                yield Block(group, tuple(np.asarray(rows, dtype=np.float64)), begin)
