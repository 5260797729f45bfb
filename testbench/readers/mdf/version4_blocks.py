"""The blocks of MDF version 4: identifier, links to other blocks, data; read without trusting a link."""

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...recording import Finding, Refusal
from ..byte_source import BLOCK_BYTES, ByteSource, cut, damaged

_HEAD = 24
_LONGEST = 64 << 20
_LARGEST_UNPACKED = 256 << 20
_MOST = 1_000_000
_INVALIDATION_APART = 1 << 31
_MOST_RATIO, _ALWAYS_ALLOWED = 200, 1 << 30
_TAGS = re.compile(r"<[^>]*>")


@dataclass(frozen=True)
class Block:
    """A block's identifier without its signs ``##``, its links, and where its data lie."""

    kind: str
    links: tuple[int, ...]
    begin: int
    end: int
    address: int


def head(source: ByteSource, address: int, *kinds: str) -> Block:
    """The block at ``address``, which must be one of ``kinds``."""
    raw = source.read(address, _HEAD, f"a block {' or '.join(kinds)}")
    mark, length, count = struct.unpack("<4s4xQQ", raw)
    kind = mark[2:].decode("latin-1")
    if mark[:2] != b"##" or kind not in kinds:
        message = f"byte {address}: {mark!r}; expected a block {' or '.join(kinds)}"
        raise damaged(source.path, message)
    if 8 * count > min(length, _LONGEST):
        raise damaged(source.path, f"byte {address}: block {kind} of {length} bytes with {count} links")
    links = struct.unpack(f"<{count}Q", source.read(address + _HEAD, 8 * count, f"the links of {kind}"))
    return Block(kind, links, address + _HEAD + 8 * count, address + length, address)


def data(source: ByteSource, block: Block) -> bytes:
    """The data of a block that is no block of samples."""
    if block.end - block.begin > _LONGEST:
        raise damaged(source.path, f"byte {block.address}: block {block.kind} of {block.end - block.begin} bytes")
    return source.read(block.begin, max(0, block.end - block.begin), f"the block {block.kind}")


def chain(source: ByteSource, address: int, kind: str) -> Iterator[Block]:
    """The blocks of a list, each linking to the next; a list that comes back to itself is refused."""
    seen: set[int] = set()
    while address:
        if address in seen or len(seen) > _MOST:
            raise damaged(source.path, f"the list of blocks {kind} comes back to byte {address}")
        seen.add(address)
        block = head(source, address, kind)
        if not block.links:
            raise damaged(source.path, f"byte {address}: block {kind} without links")
        yield block
        address = block.links[0]


def block_text(source: ByteSource, address: int) -> str:
    """The text of a TX or MD block, without the tags of XML; empty if there is none."""
    if not address:
        return ""
    block = head(source, address, "TX", "MD")
    raw = data(source, block).split(b"\0")[0].decode("utf-8", "replace")
    if block.kind == "TX":
        return raw.strip()
    comment = re.search(r"<TX[^>]*>(.*?)</TX>", raw, re.DOTALL)
    return " ".join(_TAGS.sub(" ", comment[1] if comment else raw).split())


@dataclass(frozen=True)
class Stored:
    """A stretch of samples: its bytes in the file; unpacked size and columns that were turned, if it is packed.

    ``beside`` are the bytes of its invalidation bits, where these are stored apart.
    """

    begin: int
    end: int
    unpacked: int
    columns: int | None = None
    beside: "Stored | None" = None

    @property
    def is_packed(self) -> bool:
        """Whether it is compressed."""
        return self.columns is not None


def stored(source: ByteSource, address: int, unfinished: bool) -> tuple[list[Stored], str]:
    """All stretches of the samples at ``address``, and what of them is missing because the file is cut."""
    found: list[Stored] = []
    if not address:
        return found, ""
    kinds = ("DT", "DV", "DZ", "DL", "HL", "LD", "SD")
    first = head(source, address, *kinds)
    if first.kind == "LD":
        return _by_column(source, address, unfinished)
    if first.kind == "HL":
        first = head(source, first.links[0], "DL") if first.links and first.links[0] else first
        if first.kind == "HL":
            return found, ""
    if first.kind != "DL":
        return _one(source, first, unfinished)
    for block in chain(source, first.address, "DL"):
        for link in block.links[1:]:
            if not link:
                continue
            try:
                more, missing = _one(source, head(source, link, "DT", "DV", "DZ", "SD"), unfinished)
            except Refusal as refusal:
                if refusal.finding.code != "cut_file":
                    raise
                return found, refusal.finding.message
            found += more
            if missing:
                return found, missing
    return found, ""


def _by_column(source: ByteSource, address: int, unfinished: bool) -> tuple[list[Stored], str]:
    """The stretches of a list LD, each with its invalidation bits if they are there."""
    found: list[Stored] = []
    for block in chain(source, address, "LD"):
        flags, count = struct.unpack("<II", source.read(block.begin, 8, "the head of a list LD"))
        apart = bool(flags & _INVALIDATION_APART)
        if len(block.links) < 1 + count * (1 + apart):
            raise damaged(source.path, f"byte {block.address}: a list of {count} with {len(block.links)} links")
        for i in range(count):
            place, bits = block.links[1 + i], block.links[1 + count + i] if apart else 0
            if not place:
                continue
            try:
                stretches, missing = _one(source, head(source, place, "DT", "DV", "DZ"), unfinished)
                beside, lacking = _one(source, head(source, bits, "DI", "DZ"), unfinished) if bits else ([], "")
            except Refusal as refusal:
                if refusal.finding.code != "cut_file":
                    raise
                return found, refusal.finding.message
            if missing or lacking:
                return found if lacking else [*found, *stretches], missing or lacking
            found += [replace(stretch, beside=beside[0] if beside else None) for stretch in stretches]
    return found, ""


def _one(source: ByteSource, block: Block, unfinished: bool) -> tuple[list[Stored], str]:
    if block.kind != "DZ":
        end = source.size if unfinished and block.end <= block.begin else block.end
        there = min(end, source.size)
        missing = f"{end - there} of {end - block.begin} bytes of the samples at byte {block.begin}"
        return [Stored(block.begin, there, there - block.begin)], missing if end > there else ""
    turned, columns, unpacked, packed = struct.unpack(
        "<2xBxIQQ", source.read(block.begin, 24, "the head of compressed samples")
    )
    begin = block.begin + 24
    if unpacked > _LARGEST_UNPACKED or turned > 1:
        message = f"byte {block.address}: {packed} bytes that unpack to {unpacked}, by method {turned}"
        raise Refusal(source.path.name, Finding("too_large", None, f"byte {block.address}", message))
    if begin + packed > source.size:
        return [], f"{begin + packed - source.size} of {packed} bytes of the compressed samples at byte {begin}"
    return [Stored(begin, begin + packed, unpacked, columns if turned else 0)], ""


def refuse_bombs(source: ByteSource, stretches: list[Stored]) -> None:
    """Refuse samples that lie over one another, or that unpack to far more than the file holds."""
    stretches = [*stretches, *(stretch.beside for stretch in stretches if stretch.beside)]
    plain = sum(stretch.unpacked for stretch in stretches if not stretch.is_packed)
    packed = sum(stretch.end - stretch.begin for stretch in stretches if stretch.is_packed)
    unpacked = sum(stretch.unpacked for stretch in stretches if stretch.is_packed)
    if plain + packed > source.size or unpacked > max(_ALWAYS_ALLOWED, _MOST_RATIO * packed):
        message = f"{plain + unpacked} bytes of samples are declared in a file of {source.size} bytes"
        raise Refusal(source.path.name, Finding("too_large", None, None, message))


def pieces(source: ByteSource, stretches: list[Stored]) -> Iterator[bytes]:
    """The bytes of all stretches, in pieces of bounded size."""
    for stretch in stretches:
        if stretch.is_packed:
            yield unpacked(source, stretch)
            continue
        for begin in range(stretch.begin, stretch.end, BLOCK_BYTES):
            yield source.read(begin, min(BLOCK_BYTES, stretch.end - begin), "samples")


def unpacked(source: ByteSource, stretch: Stored) -> bytes:
    """One compressed stretch; where its bytes were turned to columns, turned back."""
    packed = source.read(stretch.begin, stretch.end - stretch.begin, "compressed samples")
    unpack = zlib.decompressobj()
    try:
        raw = unpack.decompress(packed, stretch.unpacked + 1)
    except zlib.error as error:
        raise damaged(source.path, f"byte {stretch.begin}: compressed samples cannot be unpacked ({error})") from error
    if len(raw) != stretch.unpacked:
        short = len(raw) < stretch.unpacked
        message = f"{stretch.unpacked} bytes are declared, {'only ' + str(len(raw)) if short else 'more'} are there"
        raise (cut if short else damaged)(source.path, f"byte {stretch.begin}: compressed samples: {message}")
    columns = stretch.columns or 0
    if columns > 1 and len(raw) >= columns:
        whole = len(raw) // columns * columns
        table = np.frombuffer(raw, dtype=np.uint8, count=whole).reshape(columns, -1)
        return table.T.tobytes() + raw[whole:]
    return raw
