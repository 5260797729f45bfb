"""The blocks of MDF version 4: identifier, links to other blocks, data; read without trusting a link.

Samples lie in one data block or a list of them (DL, HL; LD where each channel is stored on its own), plain (DT, DV,
SD) or deflated (DZ), there also transposed: all first bytes of the records, then all second ones. In a list LD the
invalidation bytes are blocks of their own (DI). Source: ASAM MDF 4.2, chapter "File structure".
"""

import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...recording import Finding, Refusal
from ..byte_source import BLOCK_BYTES, ByteSource
from ..format_findings import cut, damaged
from .records import Bytes, Records

_HEAD = 24
_LONGEST = 64 << 20
_LARGEST_UNPACKED = 256 << 20
_MOST = 1_000_000
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
    """The blocks of a list, each linking to the next; a list that comes back to itself is refused."""
    seen: set[int] = set()
    while address:
        if address in seen or len(seen) > _MOST:
            raise damaged(source.path, f"the list of blocks {kind} comes back to byte {address}")
        seen.add(address)
        block = block_at(source, address, kind)
        yield block
        address = block.links[0]


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
    if first.kind == "LD":
        return _column_blocks(source, address, unfinished)
    if first.kind == "HL":
        if not first.links or not first.links[0]:
            return found, ""
        first = block_at(source, first.links[0], "DL")
    if first.kind != "DL":
        return _data_block(source, first, unfinished)
    for block in block_chain(source, first.address, "DL"):
        for link in filter(None, block.links[1:]):
            try:
                more, missing = _data_block(source, block_at(source, link, "DT", "DV", "DZ", "SD"), unfinished)
            except Refusal as refusal:
                return found, _cut_message(refusal)
            found += more
            if missing:
                return found, missing
    return found, ""


def _column_blocks(source: ByteSource, address: int, unfinished: bool) -> tuple[list[DataBlock], str]:
    """The data blocks of a list LD, each with its invalidation bytes if there are any."""
    found: list[DataBlock] = []
    for block in block_chain(source, address, "LD"):
        flags, count = struct.unpack("<II", source.read(block.begin, 8, "the head of a list LD"))
        has_invalidation = bool(flags & _OWN_INVALIDATION)
        if len(block.links) < 1 + count * (1 + has_invalidation):
            raise damaged(source.path, f"byte {block.address}: a list of {count} with {len(block.links)} links")
        for i in range(count):
            place, bits = block.links[1 + i], block.links[1 + count + i] if has_invalidation else 0
            if not place:
                continue
            try:
                values, missing = _data_block(source, block_at(source, place, "DT", "DV", "DZ"), unfinished)
                flagged, lacking = list[DataBlock](), ""
                if bits:
                    flagged, lacking = _data_block(source, block_at(source, bits, "DI", "DZ"), unfinished)
            except Refusal as refusal:
                return found, _cut_message(refusal)
            if missing or lacking:
                return found if lacking else [*found, *values], missing or lacking
            found += [replace(one, invalidation=flagged[0] if flagged else None) for one in values]
    return found, ""


def _cut_message(refusal: Refusal) -> str:
    """What is missing, if a block is not there because the file is cut. Raises any other refusal again."""
    if refusal.finding.code != "cut_file":
        raise refusal
    return refusal.finding.message


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
        if block.columns is not None:
            yield _unpacked(source, block)
            continue
        for begin in range(block.begin, block.end, BLOCK_BYTES):
            yield source.read(begin, min(BLOCK_BYTES, block.end - begin), "samples")


def _unpacked(source: ByteSource, block: DataBlock) -> bytes:
    """The bytes of a deflated block, in the order of the records."""
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
    columns = block.columns or 0
    if columns > 1 and len(raw) >= columns:
        whole = len(raw) // columns * columns
        table = np.frombuffer(raw, dtype=np.uint8, count=whole).reshape(columns, -1)
        return table.T.tobytes() + raw[whole:]
    return raw


def is_column_list(source: ByteSource, address: int) -> bool:
    """Whether the samples at ``address`` are a list LD: one channel, stored on its own."""
    return bool(address) and source.read(address, 4, "a block of samples") == b"##LD"


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
        values = _unpacked(source, block) if block.columns is not None else None
        flags = _unpacked(source, bits) if bits and bits.columns is not None else None
        for begin in range(0, count, step):
            end = min(begin + step, count)
            table = np.zeros((end - begin, width + invalidation_width), dtype=np.uint8)
            table[:, :width] = _rows(source, block, values, begin, end, width)
            if bits:
                table[:, width:] = _rows(source, bits, flags, begin, end, invalidation_width)
            yield table.tobytes()


def _rows(source: ByteSource, block: DataBlock, unpacked: bytes | None, begin: int, end: int, width: int) -> Bytes:
    """Rows ``begin`` to before ``end`` of ``width`` bytes."""
    if unpacked is not None:
        raw = unpacked[begin * width : end * width]
    else:
        raw = source.read(block.begin + begin * width, (end - begin) * width, "samples")
    return np.frombuffer(raw, dtype=np.uint8).reshape(-1, width)
