"""MDF version 4: the data groups of a file, their channel groups, channels and conversions (ASAM MDF 4.2)."""

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Literal

from ...recording import Finding, point_in_time
from ..byte_source import ByteSource
from ..format_findings import damaged
from . import conversions
from .conversions import Conversion
from .records import LONGEST_FRAME, DataGroup, File, Frames, Member, Records, TextMember
from .version4_blocks import (
    Block,
    DataBlock,
    block_at,
    block_chain,
    block_data,
    block_text,
    column_pieces,
    column_records,
    data_blocks,
    data_pieces,
    is_column_list,
    refuse_oversized,
)

_VLSD, _REMOTE_MASTER = 1, 8
_MASTER, _VIRTUAL_MASTER, _VIRTUAL, _TIME = 2, 3, 6, 1
_TEXTS = {6: "latin-1", 7: "utf-8", 8: "utf-16-le", 9: "utf-16-be"}
"""Encodings by data type."""
_LARGEST_SIGNAL = 16 << 20
"""Texts of varying length beyond this are not kept [bytes]."""
_LOCAL_TIME, _KNOWN_OFFSETS = 1, 2
_SYNC = {1: "s", 2: "rad", 3: "m"}
"""Units of the axis on which an event lies; of others it is the number of the record."""
_BYTES, _TEXT_WITH_MARK = 10, 17
"""Data type of an array of bytes."""
_INVALID_ALL, _INVALID_BIT = 1, 2
_TO_TEXT = (7, 8, 9, 10, 11)
_DEEPEST = 16
_KINDS: tuple[Literal["u", "i", "f"], ...] = ("u", "u", "i", "i", "f", "f")
"""Of the data types from 0 on."""


def read_version4(source: ByteSource, unfinished: bool) -> File:
    """All blocks of the file but its samples."""
    file = File(source.read(8, 8, "the version").decode("latin-1").strip(" \0"))
    header = block_at(source, 64, "HD")
    start, zone, summer, flags = struct.unpack_from("<QhhB", block_data(source, header).ljust(13, b"\0"))
    file.metadata["start_time_ns"] = str(start)
    if start:
        minutes = None if flags & _LOCAL_TIME else zone + summer if flags & _KNOWN_OFFSETS else 0
        file.zero = point_in_time(start, "start time of the header", 1e-9, minutes)
    if comment := block_text(source, header.links[5]):
        file.metadata["comment"] = comment
    for i, event in enumerate(block_chain(source, header.links[4], "EV"), 1):
        # When an event was, and what the file says of it.
        raw = block_data(source, event)
        base, factor = struct.unpack_from("<qd", raw, 16)
        place = f"{base * factor:.9g} {_SYNC.get(raw[1], '')}".strip()
        said = (block_text(source, event.links[3]), block_text(source, event.links[4]))
        file.metadata[f"event {i}"] = f"at {place}: {'; '.join(filter(None, said))}"
    for group in block_chain(source, header.links[0], "DG"):
        _data_group(source, group, file, unfinished)
    return file


def _data_group(source: ByteSource, block: Block, file: File, unfinished: bool) -> None:
    identifier_size = block_data(source, block)[:1] or b"\0"
    records = tuple(_records(source, group, file) for group in block_chain(source, block.links[1], "CG"))
    if not records:
        return
    if identifier_size[0] not in (0, 1, 2, 4, 8):
        raise damaged(source.path, f"byte {block.address}: identifiers of {identifier_size[0]} bytes")
    blocks, missing = data_blocks(source, block.links[2], unfinished)
    refuse_oversized(source, blocks)
    if is_column_list(source, block.links[2]):
        records = tuple(column_records(each, blocks) for each in records)
    widths = records[0].data, (records[0].size or 0) - records[0].data
    group = DataGroup(
        identifier_size[0], False, "<", records, partial(_pieces, source.path, blocks, widths),
        sum(one.unpacked + (one.invalidation.unpacked if one.invalidation else 0) for one in blocks),
    )  # fmt: skip
    first, size = records[0], 0 if identifier_size[0] else records[0].size or 0
    found = group.bytes // size if size else 0  # samples of one kind, without reading them
    if missing:
        there = f"; {found} of {first.declared} samples of group {first.name!r} are there" if size else ""
        file.findings.append(Finding("cut_file", None, None, f"the file is cut: missing are {missing}{there}"))
    elif size and not unfinished and (found != first.declared or group.bytes % size):
        message = f"group {first.name!r} declares {first.declared} samples, its {group.bytes} bytes hold {found}"
        file.findings.append(Finding("count_contradiction", None, None, message))
    file.groups.append(group)


def _pieces(path: Path, blocks: Sequence[DataBlock], widths: tuple[int, int]) -> Iterator[bytes]:
    with ByteSource(path) as source:
        if any(block.invalidation for block in blocks):
            yield from column_pieces(source, blocks, *widths)
        else:
            yield from data_pieces(source, blocks)


def _records(source: ByteSource, block: Block, file: File) -> Records:
    raw = block_data(source, block)
    identifier, declared, flags, _, size, invalidation = struct.unpack_from("<QQHH4xII", raw)
    name = block_text(source, block.links[2]) or block_text(source, block.links[5])
    if flags & _VLSD:
        return Records(name, identifier, None, 0, declared, (), block.address)
    master = block.links[6] if flags & _REMOTE_MASTER and len(block.links) > 6 else 0
    if flags & _REMOTE_MASTER and not master:
        raise damaged(source.path, f"channel group {name!r}: its time lies in another group, which is not named")
    found = list(_members(source, block.links[1], file, size, ""))
    members = tuple(each for each in found if isinstance(each, Member))
    texts = tuple(each for each in found if isinstance(each, TextMember))
    frames = [
        replace(each, place=sum(isinstance(before, Member) for before in found[:i]))
        for i, each in enumerate(found)
        if isinstance(each, Frames)
    ]
    file.texts += [each.name for each in frames[1:]]
    own = frames[0] if frames else None
    return Records(name, identifier, size + invalidation, size, declared, members, block.address, master, own, texts)


def _members(
    source: ByteSource, address: int, file: File, size: int, prefix: str, depth: int = 0
) -> Iterator[Member | Frames | TextMember]:
    """The channels of a list, and those that they are composition of."""
    if depth > _DEEPEST:
        raise damaged(source.path, f"channels within channels, {depth} deep")
    for block in block_chain(source, address, "CN"):
        name = prefix + block_text(source, block.links[2])
        composition = block.links[1]
        if composition and source.read(composition, 4, "a composition") == b"##CN":
            yield from _members(source, composition, file, size, f"{name}.", depth + 1)
            continue
        if composition:
            file.left_out.append(f"{name} (an array)")
            continue
        yield from _own_members(source, block, file, size, name)


def _own_members(
    source: ByteSource, block: Block, file: File, size: int, name: str
) -> Iterator[Member | Frames | TextMember]:
    """The channel of a block; of an array of bytes, such as the data of a bus, one for each byte."""
    raw = block_data(source, block)
    kind, sync, form, bit, byte, bits, flags, invalid = struct.unpack_from("<BBBBIIII", raw)
    if (form == _BYTES or form in _TEXTS) and kind == 1 and source.read(block.links[5], 4, "frames") == b"##CG":
        yield Frames(name, 0, block.links[5], encoding=_TEXTS.get(form, ""))
        return
    if form in _TEXTS or form == _TEXT_WITH_MARK or kind == 1:
        text = _text_member(source, block, name, size) if form in _TEXTS else None
        if text is None:
            file.texts.append(name)
        else:
            yield text
        return
    if form == _BYTES and bits <= 8 * LONGEST_FRAME and not (bits % 8 or bit):
        if byte + bits // 8 > size:
            raise damaged(source.path, f"channel {name!r}: {bits // 8} bytes from byte {byte} of {size} bytes a record")
        for i in range(bits // 8):
            yield Member(f"{name}[{i}]", None, "u", "<", byte + i, 0, 8)
        return
    virtual = kind in (_VIRTUAL_MASTER, _VIRTUAL)
    if not virtual and form > 5:
        file.left_out.append(f"{name} (of data type {form})")
        return
    conversion, stated_unit = _conversion(source, block.links[4], file, name, not virtual and form > 3)
    member = Member(
        name=name,
        unit=(block_text(source, block.links[6]) or stated_unit) or None,
        kind="index" if virtual else _KINDS[form],
        order=">" if form in (1, 3, 5) else "<",
        byte=byte,
        bit=bit,
        bits=bits,
        conversion=conversion,
        is_time=kind in (_MASTER, _VIRTUAL_MASTER) and sync == _TIME,
        invalid_bit=-1 if flags & _INVALID_ALL else invalid if flags & _INVALID_BIT else None,
    )
    if not member.fits(size):
        place = f"{bits} bits from byte {byte}, bit {bit} of {size} bytes a record"
        raise damaged(source.path, f"channel {name!r}: {place}")
    yield member


def _text_member(source: ByteSource, block: Block, name: str, size: int) -> TextMember | None:
    """A channel of text, if its letters are where they can be read: in the records, or in blocks of their own."""
    kind, form, byte, bits = struct.unpack_from("<BxBxII", block_data(source, block))
    width = bits // 8 if kind == 0 else 8
    if kind > 1 or not 0 < width <= size - byte:
        return None
    if kind == 0:
        return TextMember(name, byte, width, _TEXTS[form])
    if not block.links[5] or source.read(block.links[5], 4, "texts") not in (b"##SD", b"##DZ", b"##DL", b"##HL"):
        return None
    blocks, missing = data_blocks(source, block.links[5], unfinished=False)
    refuse_oversized(source, blocks)
    if missing or sum(one.unpacked for one in blocks) > _LARGEST_SIGNAL:
        return None

    @cache
    def letters() -> bytes:
        with ByteSource(path) as again:
            return b"".join(data_pieces(again, blocks))

    path = source.path
    return TextMember(name, byte, width, _TEXTS[form], letters)


def _conversion(
    source: ByteSource, address: int, file: File, name: str, is_float: bool
) -> tuple[Conversion | None, str]:
    """The conversion of a channel and the unit that it states; a table of texts is kept as metadata, not applied."""
    if not address:
        return None, ""
    block = block_at(source, address, "CC")
    raw = block_data(source, block)
    kind, _, _, references, count = struct.unpack_from("<BBHHH", raw)
    if len(raw) < 24 + 8 * count or len(block.links) < 4 + references:
        raise damaged(source.path, f"channel {name!r}: its conversion declares {count} values")
    values = struct.unpack_from(f"<{count}d", raw, 24)
    unit = block_text(source, block.links[1])
    if kind in _TO_TEXT:
        # What the numbers of a status channel mean, as far as they are plain texts.
        links = block.links[4:]
        if kind in (7, 8):  # of one value, or of all from one to another
            size = kind - 6
            spans = (values[i : i + size] for i in range(0, min(len(values), 64 * size), size))
            labels = (" to ".join(f"{value:g}" for value in span) for span in spans)
            file.metadata[f"{name}: meaning"] = "; ".join(
                f"{label} = {block_text(source, link)}"
                for label, link in zip(labels, links, strict=False)
                if link and source.read(link, 4, "a text") == b"##TX"
            )
        return None, unit
    try:
        if kind == _FORMULA:
            conversion: Conversion | None = conversions.formula(block_text(source, block.links[4]))
        elif kind in _LAWS and len(values) >= _LAWS[kind][0]:
            conversion = _LAWS[kind][1](values, is_float)
        else:
            raise ValueError(f"{len(values)} values; it is not known, or has more")
    except (ValueError, IndexError) as error:
        raise damaged(source.path, f"channel {name!r}: its conversion of type {kind}: {error}") from error
    file.converted += conversion is not None
    return conversion, unit


def _ranges(p: Sequence[float], is_float: bool) -> Conversion:
    whole = len(p) // 3 * 3
    return conversions.ranges(p[:whole:3], p[1:whole:3], p[2:whole:3], p[-1], ends_belong=not is_float)


_FORMULA = 3
_LAWS: Mapping[int, tuple[int, Callable[[Sequence[float], bool], Conversion | None]]] = {
    0: (0, lambda p, is_float: None),
    1: (2, lambda p, is_float: conversions.linear(p[0], p[1])),
    2: (6, lambda p, is_float: conversions.rational(p)),
    4: (2, lambda p, is_float: conversions.table(p[::2], p[1::2], interpolate=True)),
    5: (2, lambda p, is_float: conversions.table(p[::2], p[1::2], interpolate=False)),
    6: (1, _ranges),
}
"""How many numbers a conversion of each type has at least, and its law."""
