"""A recording whose header and data come from a process of its own."""

import weakref
from collections.abc import Iterator
from pathlib import Path

from ...recording import Block, Recording, Report
from . import frames
from .process import Process


class _Waiting:
    """The one process that has sent its header and waits to be asked for the data, which spares opening twice.

    It is the last one that was started; where a run has several files, those before are opened again.
    """

    def __init__(self) -> None:
        self._process: Process | None = None

    def keep(self, process: Process) -> None:
        self.end(self._process)
        self._process = process

    def take(self, process: Process) -> Process | None:
        """The process, if it still waits; it is then the caller's."""
        if self._process is not process:
            return None
        self._process = None
        return process

    def end(self, process: Process | None) -> None:
        if process is not None and self.take(process) is not None:
            process.end()


_WAITING = _Waiting()


def open_isolated(path: Path, module: str, function: str) -> Recording:
    """The recording that ``module.function(path)`` gives, opened and read in a process of its own."""
    process = Process(path, module, function)
    said = process.header()
    _WAITING.keep(process)
    groups = tuple(frames.group_from_dict(group) for group in said["groups"])

    def read(report: Report) -> Iterator[Block]:
        known = {group.name: group for group in groups}
        for document, data in (_WAITING.take(process) or _anew(path, module, function)).data():
            if "finding" in document:
                report(frames.finding_from_dict(document["finding"]))
            elif "group" in document:
                group = frames.group_from_dict(document["group"])
                known[group.name] = group
            elif "block" in document:
                block = document["block"]
                columns = tuple(data.reshape(block["columns"], -1))
                yield Block(known[block["group"]], columns, block["start"], None, block["read"])

    recording = Recording(
        path=path,
        format=said["format"],
        reader=said["reader"],
        groups=groups,
        read=read,
        origin=said["origin"],
        settings=said["settings"],
        metadata=said["metadata"],
        comments=tuple(said["comments"]),
        ranges=tuple(frames.range_from_list(each) for each in said["ranges"]),
        stated_rate_hz=said["stated_rate_hz"],
        findings=tuple(frames.finding_from_dict(finding) for finding in said["findings"]),
    )
    weakref.finalize(recording, _WAITING.end, process)
    return recording


def _anew(path: Path, module: str, function: str) -> Process:
    """A process that has opened the file once more."""
    process = Process(path, module, function)
    process.header()
    return process
