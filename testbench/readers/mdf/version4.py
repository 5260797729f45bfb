"""MDF version 4: data groups, channel groups, channels, conversions, and their blocks (ASAM MDF 4.2).

A block has an identifier, links to other blocks, and data; no link is trusted. Samples lie in one data block or a list
of them (DL, HL; LD where each channel is stored on its own), plain (DT, DV, SD) or deflated (DZ), there also
transposed: all first bytes of the records, then all second ones. In a list LD the invalidation bytes are blocks of
their own (DI).
"""

import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Literal

import numpy as np

from ...recording import Finding, Refusal, point_in_time
from ..byte_source import BLOCK_BYTES, ByteSource
from ..format_findings import cut, damaged
from . import conversions
from .conversions import Conversion
from .records import LONGEST_FRAME, DataGroup, File, Frames, Member, Records, TextMember, linked

_HEAD = 24
_LONGEST = 64 << 20
_LARGEST_UNPACKED = 256 << 20
_OWN_INVALIDATION = 1 << 31
_MOST_RATIO, _ALWAYS_ALLOWED = 200, 1 << 30
_TAGS = re.compile(r"<[^>]*>")
_LEAST = {"HD": (6, 24), "DG": (4, 24), "CG": (6, 56), "CN": (8, 48), "CC": (4, 48), "EV": (5, 56), "DL": (1, 24),
          "LD": (1, 32)}  # fmt: skip
"""Links that a block has at least, and bytes beside them."""


@dataclass(frozen=True)
class Block:
    """A block's identifier without its signs ``##``, its links, and where its data lie."""

    kind: str
    links: tuple[int, ...]
    begin: int
    end: int
    address: int


def block_at(source: ByteSource, address: int, *kinds: str) -> Block:
    """The block at ``address``, which must be one of ``kinds``."""
    raw = source.read(address, _HEAD, f"a block {' or '.join(kinds)}")
    mark, length, count = struct.unpack("<4s4xQQ", raw)
    kind = mark[2:].decode("latin-1")
    if mark[:2] != b"##" or kind not in kinds:
        message = f"byte {address}: {mark!r}; expected a block {' or '.join(kinds)}"
        raise damaged(source.path, message)
    fewest, least = _LEAST.get(kind, (0, 0))
    if 8 * count > min(length, _LONGEST) or count < fewest or length - 8 * count < least:
        raise damaged(source.path, f"byte {address}: block {kind} of {length} bytes with {count} links")
    links = struct.unpack(f"<{count}Q", source.read(address + _HEAD, 8 * count, f"the links of {kind}"))
    return Block(kind, links, address + _HEAD + 8 * count, address + length, address)


def block_data(source: ByteSource, block: Block) -> bytes:
    """The data of a block that is no block of samples."""
    if block.end - block.begin > _LONGEST:
        raise damaged(source.path, f"byte {block.address}: block {block.kind} of {block.end - block.begin} bytes")
    return source.read(block.begin, max(0, block.end - block.begin), f"the block {block.kind}")


def block_chain(source: ByteSource, address: int, kind: str) -> Iterator[Block]:
    """The blocks of a list, each linking to the next."""
    return linked(source.path, address, kind, lambda at: block_at(source, at, kind), lambda block: block.links[0])


def block_text(source: ByteSource, address: int) -> str:
    """The text of a TX or MD block, without the tags of XML; empty if there is none."""
    if not address:
        return ""
    block = block_at(source, address, "TX", "MD")
    raw = block_data(source, block).split(b"\0")[0].decode("utf-8", "replace")
    if block.kind == "TX":
        return raw.strip()
    comment = re.search(r"<TX[^>]*>(.*?)</TX>", raw, re.DOTALL)
    return " ".join(_TAGS.sub(" ", comment[1] if comment else raw).split())


@dataclass(frozen=True)
class DataBlock:
    """Samples of a data group: bytes ``begin`` to before ``end`` of the file, and their size once unpacked.

    ``columns`` is None for plain bytes, 0 for deflated ones, else the number of columns that were transposed before.
    ``invalidation`` holds the invalidation bytes where they are stored on their own.
    """

    begin: int
    end: int
    unpacked: int
    columns: int | None = None
    invalidation: "DataBlock | None" = None


def data_blocks(source: ByteSource, address: int, unfinished: bool) -> tuple[list[DataBlock], str]:
    """All data blocks of the samples at ``address``, and what of them is missing because the file is cut."""
    found: list[DataBlock] = []
    if not address:
        return found, ""
    first = block_at(source, address, "DT", "DV", "DZ", "DL", "HL", "LD", "SD")
    if first.kind == "HL":
        if not first.links or not first.links[0]:
            return found, ""
        first = block_at(source, first.links[0], "DL")
    if first.kind not in ("DL", "LD"):
        return _data_block(source, first, unfinished)
    kinds = ("DT", "DV", "DZ", "SD") if first.kind == "DL" else ("DT", "DV", "DZ")
    for block in block_chain(source, first.address, first.kind):
        for place, bits in _listed(source, block):
            flagged, lacking = list[DataBlock](), ""
            try:
                values, missing = _data_block(source, block_at(source, place, *kinds), unfinished)
                if bits:
                    flagged, lacking = _data_block(source, block_at(source, bits, "DI", "DZ"), unfinished)
            except Refusal as refusal:
                if refusal.finding.code != "cut_file":
                    raise
                return found, refusal.finding.message
            if missing or lacking:
                return found if lacking else [*found, *values], missing or lacking
            found += [replace(one, invalidation=flagged[0] if flagged else None) for one in values]
    return found, ""


def _listed(source: ByteSource, block: Block) -> Iterator[tuple[int, int]]:
    """Where the data blocks of a list lie, and the invalidation bytes of each, 0 if it has none of its own."""
    if block.kind == "DL":
        yield from ((link, 0) for link in block.links[1:] if link)
        return
    flags, count = struct.unpack("<II", source.read(block.begin, 8, "the head of a list LD"))
    has_invalidation = bool(flags & _OWN_INVALIDATION)
    if len(block.links) < 1 + count * (1 + has_invalidation):
        raise damaged(source.path, f"byte {block.address}: a list of {count} with {len(block.links)} links")
    bits = block.links[1 + count :] if has_invalidation else (0,) * count
    yield from ((place, own) for place, own in zip(block.links[1 : 1 + count], bits, strict=False) if place)


def _data_block(source: ByteSource, block: Block, unfinished: bool) -> tuple[list[DataBlock], str]:
    if block.kind != "DZ":
        end = source.size if unfinished and block.end <= block.begin else block.end
        there = min(end, source.size)
        missing = f"{end - there} of {end - block.begin} bytes of the samples at byte {block.begin}"
        return [DataBlock(block.begin, there, there - block.begin)], missing if end > there else ""
    method, columns, unpacked, packed = struct.unpack(
        "<2xBxIQQ", source.read(block.begin, 24, "the head of compressed samples")
    )
    begin = block.begin + 24
    if unpacked > _LARGEST_UNPACKED or method > 1:
        message = f"byte {block.address}: {packed} bytes that unpack to {unpacked}, by method {method}"
        raise Refusal(source.path.name, Finding("too_large", None, f"byte {block.address}", message))
    if begin + packed > source.size:
        return [], f"{begin + packed - source.size} of {packed} bytes of the compressed samples at byte {begin}"
    return [DataBlock(begin, begin + packed, unpacked, columns if method else 0)], ""


def refuse_oversized(source: ByteSource, blocks: Sequence[DataBlock]) -> None:
    """Refuse data blocks that overlap, or that unpack to far more than the file holds."""
    blocks = [*blocks, *(block.invalidation for block in blocks if block.invalidation)]
    plain = sum(block.unpacked for block in blocks if block.columns is None)
    packed = sum(block.end - block.begin for block in blocks if block.columns is not None)
    unpacked = sum(block.unpacked for block in blocks if block.columns is not None)
    if plain + packed > source.size or unpacked > max(_ALWAYS_ALLOWED, _MOST_RATIO * packed):
        message = f"{plain + unpacked} bytes of samples are declared in a file of {source.size} bytes"
        raise Refusal(source.path.name, Finding("too_large", None, None, message))


def data_pieces(source: ByteSource, blocks: Sequence[DataBlock]) -> Iterator[bytes]:
    """The bytes of all data blocks, in pieces of bounded size."""
    for block in blocks:
        content = _content(source, block)
        for begin in range(0, block.unpacked, BLOCK_BYTES):
            yield content(begin, min(begin + BLOCK_BYTES, block.unpacked))


def _content(source: ByteSource, block: DataBlock) -> Callable[[int, int], bytes]:
    """What gives the bytes of a data block from one to before another, in the order of the records."""
    if block.columns is None:
        return lambda begin, end: source.read(block.begin + begin, end - begin, "samples")
    packed = source.read(block.begin, block.end - block.begin, "compressed samples")
    unpack = zlib.decompressobj()
    try:
        raw = unpack.decompress(packed, block.unpacked + 1)
    except zlib.error as error:
        raise damaged(source.path, f"byte {block.begin}: compressed samples cannot be unpacked ({error})") from error
    if len(raw) != block.unpacked:
        is_short = len(raw) < block.unpacked
        message = f"{block.unpacked} bytes are declared, {f'only {len(raw)}' if is_short else 'more'} are there"
        raise (cut if is_short else damaged)(source.path, f"byte {block.begin}: compressed samples: {message}")
    if 1 < block.columns <= len(raw):
        whole = len(raw) // block.columns * block.columns
        table = np.frombuffer(raw, dtype=np.uint8, count=whole).reshape(block.columns, -1)
        raw = table.T.tobytes() + raw[whole:]
    return lambda begin, end: raw[begin:end]


def column_records(declared: Records, blocks: Sequence[DataBlock]) -> Records:
    """The records of a list LD as they are stored: without invalidation bytes where the list has none."""
    if declared.size is None or any(block.invalidation for block in blocks):
        return declared
    members = tuple(m if m.invalid_bit == -1 else replace(m, invalid_bit=None) for m in declared.members)
    return replace(declared, size=declared.data, members=members)


def column_pieces(
    source: ByteSource, blocks: Sequence[DataBlock], width: int, invalidation_width: int
) -> Iterator[bytes]:
    """Records of ``width`` bytes, each followed by its ``invalidation_width`` bytes, in pieces of bounded size."""
    for block in blocks:
        count = block.unpacked // width if width else 0
        bits = block.invalidation
        if width * count != block.unpacked or (bits and bits.unpacked != count * invalidation_width):
            what = f"{block.unpacked} bytes are no whole records of {width} bytes with their bits"
            raise damaged(source.path, f"byte {block.begin}: {what}")
        step = max(1, BLOCK_BYTES // (width + invalidation_width))
        values, flags = _content(source, block), bits and _content(source, bits)
        for begin in range(0, count, step):
            end = min(begin + step, count)
            table = np.zeros((end - begin, width + invalidation_width), dtype=np.uint8)
            table[:, :width] = np.frombuffer(values(begin * width, end * width), np.uint8).reshape(-1, width)
            if flags:
                own = flags(begin * invalidation_width, end * invalidation_width)
                table[:, width:] = np.frombuffer(own, np.uint8).reshape(-1, invalidation_width)
            yield table.tobytes()


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
    if block.links[2] and source.read(block.links[2], 4, "a block of samples") == b"##LD":  # each channel on its own
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
