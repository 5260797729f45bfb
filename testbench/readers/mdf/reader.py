"""Reader of ASAM MDF 3 and 4: each channel group is a group, with its own time."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ...findings import Finding, Refusal
from ...recording import Block, Channel, Group, Recording, Report, Samples, TimeColumn
from ...units import seconds_per
from ..nonfinite import watched
from ..registry import Reader, ReadOptions
from ..stream import ByteSource, block_samples, damaged
from . import v3, v4
from .model import DataGroup, File, Records
from .numbers import Bytes, column, invalid
from .records import Torn, parts

_MARKS = (b"MDF     ", b"UnFinMF ")
_MOST_VIRTUAL = 100_000_000


def open_mdf(path: Path, options: ReadOptions) -> Recording:
    """Walk through the blocks; the records are read when asked for."""
    with ByteSource(path) as source:
        head = source.read(0, 64, "the identification")
        (version,) = struct.unpack_from("<H", head, 28)
        unfinished = head[:8] == _MARKS[1]
        file = (v4 if version >= 400 else v3).read(source, unfinished)
    groups = _groups(path.stem, file, unfinished)
    findings = [*file.findings, *_said(file, groups)]
    if unfinished:
        message = "its writer never finished the file: what was in memory then is lost"
        findings.insert(0, Finding("cut_file", None, None, message))
    if not groups:
        raise Refusal(path.name, next(iter(findings), Finding("no_data", None, None, "no channel has samples")))
    return Recording(
        path=path,
        format="ASAM MDF",
        reader="testbench.readers.mdf",
        groups=tuple(groups.values()),
        read=lambda report: watched(_blocks(path, file, groups, unfinished, report), report),
        settings={"version": file.version},
        metadata=file.metadata,
        findings=tuple(findings),
    )


def _groups(stem: str, file: File, unfinished: bool) -> dict[int, Group]:
    """A group for each kind of records that has channels and samples; the key is that of its records."""
    kept = [r for g in file.groups for r in g.records if r.members and _has_samples(g, r, unfinished)]
    names = Counter(r.name for r in kept)
    groups, numbers = {}, Counter[str]()
    for records in kept:
        numbers[records.name] += 1
        name = records.name or (stem if names[records.name] == 1 else f"{stem} group")
        if names[records.name] > 1:
            name = f"{name} {numbers[records.name]}"
        channels = tuple(Channel(member.name, member.unit) for member in records.members)
        groups[id(records)] = Group(name, channels, _clock(records))
    return groups


def _has_samples(group: DataGroup, records: Records, unfinished: bool) -> bool:
    if records.size == 0:
        return 0 < (records.declared or 0) <= _MOST_VIRTUAL
    return bool(group.bytes and (records.declared or unfinished))


def _clock(records: Records) -> TimeColumn | None:
    for i, member in enumerate(records.members):
        if member.is_time:
            return TimeColumn(i, seconds_per(member.unit) if member.unit else 1.0, assumed=member.unit is None)
    return None


def _blocks(path: Path, file: File, groups: Mapping[int, Group], unfinished: bool, report: Report) -> Iterator[Block]:
    invalid_samples = Counter[str]()
    for data in file.groups:
        done: Counter[int] = Counter()
        try:
            for part in parts(data):
                if (group := groups.get(id(part.records))) is not None:
                    yield from _of_part(part.records, part.rows, group, done, invalid_samples)
        except Torn as error:
            raise damaged(path, str(error)) from error
        for records in data.records:
            declared, found = records.declared, done[id(records)]
            if data.identifier_size and id(records) in groups and found != declared and not unfinished:
                message = f"group {groups[id(records)].name!r} declares {declared} samples, {found} are there"
                report(Finding("count_contradiction", None, None, message))
    for name, number in invalid_samples.items():
        message = f"{number} samples are marked as invalid in the file: NaN"
        report(Finding("invalid_samples", name, None, message))


def _of_part(
    records: Records, rows: Bytes, group: Group, done: Counter[int], invalid_samples: Counter[str]
) -> Iterator[Block]:
    """Records as blocks of bounded size."""
    step = block_samples(len(group.channels))
    for begin in range(0, len(rows), step):
        piece, first = rows[begin : begin + step], done[id(records)]
        columns: list[Samples] = []
        for member in records.members:
            values = column(member, piece, first)
            if (bad := invalid(member, piece, records)) is not None and bad.any():
                values = np.where(bad, np.nan, values)
                invalid_samples[member.name] += int(bad.sum())
            columns.append(values)
        yield Block(group, tuple(columns), first)
        done[id(records)] += len(piece)


def _said(file: File, groups: Mapping[int, Group]) -> list[Finding]:
    findings = []
    if file.converted:
        message = f"raw numbers of {file.converted} channels were made physical by the laws in the file"
        findings.append(Finding("calibration_applied", None, None, message))
    for name in dict.fromkeys(file.texts):
        findings.append(Finding("text_channel", name, None, "holds text, not numbers; it is not kept"))
    if file.left_out:
        listed = ", ".join(file.left_out[:10]) + (" and more" if len(file.left_out) > 10 else "")
        findings.append(Finding("left_out", None, None, f"no series of numbers: {listed}"))
    empty = [r.name or "without a name" for g in file.groups for r in g.records if r.members and id(r) not in groups]
    if empty:
        listed = ", ".join(empty[:10]) + (" and more" if len(empty) > 10 else "")
        findings.append(Finding("empty_group", None, None, f"no sample in {len(empty)} groups: {listed}"))
    return findings


READER = Reader(
    name="ASAM MDF",
    extensions=(".mf4", ".mdf"),
    identify=lambda head: head.startswith(_MARKS),
    open=open_mdf,
)
