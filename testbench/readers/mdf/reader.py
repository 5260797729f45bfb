"""Reader of ASAM MDF 3 and 4: each channel group is a group, with its own time.

Channel groups whose time lies in another one (remote master, as where each channel is stored on its own) are read in
step with it, as one group.
"""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...recording import Block, Channel, Finding, Group, Recording, Report, Samples, TextLog
from ..byte_source import ByteSource, block_spans
from ..format_findings import (
    damaged,
    is_beyond_exact,
    names_listed,
    nothing_to_read,
    rounded_integers,
    watch_nonfinite,
)
from ..header_claims import recorded_time
from ..registry import ReadOptions
from .records import (
    LONGEST_FRAME,
    LONGEST_TEXT,
    Bytes,
    DataGroup,
    File,
    Member,
    Records,
    TextMember,
    UnknownIdentifier,
    record_parts,
    sorted_records,
)
from .version3 import read_version3
from .version4 import read_version4

_NO_ROWS: Bytes = np.empty((0, 0), dtype=np.uint8)


Streams = Sequence[tuple[DataGroup, Records]]
"""Records of one group, each in its own stream; the first hold the time."""


def _rows_in_step(streams: Streams) -> Iterator[list[Bytes]]:
    """Successive records of all streams, as many of each; what one has more than another is dropped."""
    pieces = [(rows for _, rows in record_parts(group) if len(rows)) for group, _ in streams]
    waiting = [next(piece, _NO_ROWS) for piece in pieces]
    while count := min(map(len, waiting)):
        yield [rows[:count] for rows in waiting]
        rest = [rows[count:] for rows in waiting]
        waiting = [rows if len(rows) else next(piece, _NO_ROWS) for rows, piece in zip(rest, pieces, strict=True)]


def _column_sets(path: Path, file: File) -> list[Streams]:
    """The groups of a file that are stored by column. Raises Refusal for one whose time is not there."""
    every = [(group, records) for group in file.groups for records in group.records]
    by_address = {records.address: (group, records) for group, records in every}
    followers: dict[int, list[tuple[DataGroup, Records]]] = {}
    for group, records in every:
        if records.master:
            followers.setdefault(records.master, []).append((group, records))
    found: list[Streams] = []
    for address, members in followers.items():
        streams = [*([by_address[address]] if address in by_address else []), *members]
        unmixed = all(not group.identifier_size and len(group.records) == 1 for group, _ in streams)
        if len(streams) == len(members) or streams[0][1].master or not unmixed:
            lost = members[0][1].name or "without a name"
            raise damaged(path, f"channel group {lost!r}: its time lies in another group, which cannot be read with it")
        found.append(streams)
    return found


_MARKS = (b"MDF     ", b"UnFinMF ")
_MOST_VIRTUAL = 100_000_000


@dataclass
class _Odd:
    """Texts, samples that are marked as invalid, channels that float64 rounds, as they are met in reading."""

    texts: TextLog
    invalid: Counter[str] = field(default_factory=Counter)
    rounded: dict[str, None] = field(default_factory=dict)


def open_mdf(path: Path, options: ReadOptions) -> Recording:
    """Walk through the blocks; the records are read when asked for."""
    with ByteSource(path) as source:
        head = source.read(0, 64, "the identification")
        (version,) = struct.unpack_from("<H", head, 28)
        unfinished = head[:8] == _MARKS[1]
        file = (read_version4 if version >= 400 else read_version3)(source, unfinished)
    for i, data in enumerate(file.groups):
        if unfinished or any(records.frames for records in data.records):
            file.groups[i] = _counted(path, data, file, unfinished)
    sets = _column_sets(path, file)
    groups, texts = _groups(path.stem, file, sets), TextLog()
    findings = [*file.findings, *_header_findings(file, groups, sets)]
    if unfinished:
        (flags, custom) = struct.unpack_from("<HH", head, 60)
        code, message = "cut_file", "its writer never finished the file: what was in memory then is lost"
        if version >= 400 and flags and not custom:
            code, message = "not_finalized", "the logger left the file to be finalized, with counts and lengths "
            message += "unwritten; whole records are read"
        findings.insert(0, Finding(code, None, None, message))
    if not groups:
        raise nothing_to_read(path, findings, "no channel has samples")
    return Recording(
        path=path,
        format="ASAM MDF",
        reader="testbench.readers.mdf",
        groups=tuple(groups.values()),
        read=lambda report: watch_nonfinite(_blocks(path, file, sets, groups, texts, report), report),
        settings={"version": file.version},
        metadata=file.metadata,
        findings=tuple(findings),
        texts=texts,
    )


def _counted(path: Path, data: DataGroup, file: File, unfinished: bool) -> DataGroup:
    """A data group with its records counted where the file is unfinished, and with the bytes of frames as channels."""
    if not data.identifier_size:
        size = data.records[0].size
        return replace(data, records=(replace(data.records[0], declared=data.bytes // size),)) if size else data
    counts, longest = Counter[int](), Counter[int]()
    try:
        for found in sorted_records(data):
            for identifier, rows in found.items():
                counts[identifier] += len(rows)
                longest[identifier] = max(longest[identifier], *map(len, rows))
    except UnknownIdentifier as error:
        raise damaged(path, str(error)) from error
    by_address = {records.address: longest[records.identifier] for records in data.records}
    records = (replace(r, declared=counts[r.identifier]) if unfinished else r for r in data.records)
    return replace(data, records=tuple(_with_frames(r, by_address, file) for r in records))


def _with_frames(records: Records, longest: Mapping[int, int], file: File) -> Records:
    """Records with a channel for each byte of their frames, or with their text; longer ones are left out by name."""
    if (frames := records.frames) is None:
        return records
    count, size = longest.get(frames.address, 0), records.size or 0
    kind, most = ("text", LONGEST_TEXT) if frames.encoding else ("bytes", LONGEST_FRAME)
    if count > most or frames.address not in longest:
        file.left_out.append(f"{frames.name} ({kind} of records apart, up to {count})")
    if not 0 < count <= most:
        return replace(records, frames=None)
    frames = replace(frames, longest=count)
    if frames.encoding:
        text = TextMember(frames.name, size + 1, count, frames.encoding)
        return replace(records, texts=(*records.texts, text), frames=frames)
    own = [Member(f"{frames.name}[{i}]", None, "u", "<", size + 1 + i, 0, 8, within=(size, i)) for i in range(count)]
    members = (*records.members[: frames.place], *own, *records.members[frames.place :])
    return replace(records, members=members, frames=frames)


def _groups(stem: str, file: File, sets: Sequence[Streams]) -> dict[int, Group]:
    """A group for each kind of records that has channels and samples; the key is that of its records.

    Records stored by column are one group together, whose key is that of the records with their time.
    """
    followers = _followers(sets)
    members = {id(streams[0][1]): [m for _, records in streams for m in records.members] for streams in sets}
    kept = [
        r for g in file.groups for r in g.records if r.members and id(r) not in followers
        and (0 < (r.declared or 0) <= _MOST_VIRTUAL if r.size == 0 else g.bytes and r.declared)
    ]  # fmt: skip
    names = Counter(r.name for r in kept)
    groups, numbers = {}, Counter[str]()
    for records in kept:
        numbers[records.name] += 1
        name = records.name or (stem if names[records.name] == 1 else f"{stem} group")
        if names[records.name] > 1:
            name = f"{name} {numbers[records.name]}"
        own = members.get(id(records), records.members)
        clock = next((recorded_time(i, member.unit or "s") for i, member in enumerate(own) if member.is_time), None)
        groups[id(records)] = Group(name, tuple(Channel(m.name, m.unit) for m in own), clock, file.zero)
    return groups


def _followers(sets: Sequence[Streams]) -> set[int]:
    """Keys of the records whose time lies in others."""
    return {id(records) for streams in sets for _, records in streams[1:]}


def _blocks(
    path: Path, file: File, sets: Sequence[Streams], groups: Mapping[int, Group], texts: TextLog, report: Report
) -> Iterator[Block]:
    odd = _Odd(texts)
    for streams in sets:
        if (group := groups.get(id(streams[0][1]))) is not None:
            yield from _set_blocks(streams, group, odd, report)
    by_column = {id(records) for streams in sets for _, records in streams}
    for data in file.groups:
        if any(id(records) in by_column for records in data.records):
            continue
        done: Counter[int] = Counter()
        try:
            for records, rows in record_parts(data):
                if (group := groups.get(id(records))) is None:
                    continue
                for begin, end in block_spans(len(rows), len(group.channels)):
                    first = done[id(records)]
                    yield Block(group, tuple(_columns(records, rows[begin:end], first, odd, group.name)), first)
                    done[id(records)] += end - begin
        except UnknownIdentifier as error:
            raise damaged(path, str(error)) from error
        for records in data.records:
            declared, found = records.declared, done[id(records)]
            if data.identifier_size and id(records) in groups and found != declared:
                message = f"group {groups[id(records)].name!r} declares {declared} samples, {found} are there"
                report(Finding("count_contradiction", None, None, message))
    for name, number in odd.invalid.items():
        report(Finding("invalid_samples", name, None, f"{number} samples are marked as invalid in the file: NaN"))
    for name in odd.rounded:
        report(rounded_integers(name))


def _set_blocks(streams: Streams, group: Group, odd: _Odd, report: Report) -> Iterator[Block]:
    start = 0
    for rows in _rows_in_step(streams):
        for begin, end in block_spans(len(rows[0]), len(group.channels)):
            columns: list[Samples] = []
            for (_, records), piece in zip(streams, rows, strict=True):
                columns += _columns(records, piece[begin:end], start, odd, group.name)
            yield Block(group, tuple(columns), start)
            start += len(columns[0])
    declared = {records.declared for _, records in streams}
    if declared != {start}:
        listed = ", ".join(sorted(map(str, declared)))
        message = f"group {group.name!r}: its columns declare {listed} samples, {start} of all of them are there"
        report(Finding("count_contradiction", None, None, message))


def _columns(records: Records, rows: Bytes, first: int, odd: _Odd, group: str) -> Iterator[Samples]:
    """The channels of records, of which the first has the number ``first``; the texts of ``group`` are noted."""
    for text in records.texts:
        for i, letters in text.changes(rows):
            if not odd.texts.take(group, text.name, first + i, letters):
                break
    for member in records.members:
        values, bad = member.values(rows, first, records.data)
        if bad is not None and bad.any():
            values = np.where(bad, np.nan, values)
            odd.invalid[member.name] += int(bad.sum())
        if member.may_be_rounded and is_beyond_exact(values):
            odd.rounded[member.name] = None
        yield values


def _header_findings(file: File, groups: Mapping[int, Group], sets: Sequence[Streams]) -> list[Finding]:
    findings = []
    if file.converted:
        message = f"raw numbers of {file.converted} channels were made physical by the conversions in the file"
        findings.append(Finding("calibration_applied", None, None, message))
    alone = [text.name for g in file.groups for r in g.records if not r.members for text in r.texts]
    message = "holds text, not numbers; it is not kept"
    findings += [Finding("text_channel", name, None, message) for name in dict.fromkeys([*file.texts, *alone])]
    if file.left_out:
        findings.append(Finding("left_out", None, None, f"no series of numbers: {names_listed(file.left_out)}"))
    known = groups.keys() | _followers(sets)
    empty = [r.name or "without a name" for g in file.groups for r in g.records if r.members and id(r) not in known]
    if empty:
        findings.append(Finding("empty_group", None, None, f"no sample in {len(empty)} groups: {names_listed(empty)}"))
    return findings
