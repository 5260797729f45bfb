"""Samples that are stored by column (list LD): the bytes of one channel, its invalidation bits apart."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..stream import BLOCK_BYTES, ByteSource, damaged
from .model import Records
from .numbers import Bytes
from .v4blocks import Stored, unpacked


def is_by_column(source: ByteSource, address: int) -> bool:
    """Whether the samples at ``address`` are a list LD."""
    return bool(address) and source.read(address, 4, "a block of samples") == b"##LD"


def records(given: Records, stretches: Sequence[Stored]) -> Records:
    """The records as they are stored: without invalidation bytes where the list has none."""
    if given.size is None or any(stretch.beside for stretch in stretches):
        return given
    members = tuple(m if m.invalid_bit == -1 else replace(m, invalid_bit=None) for m in given.members)
    return replace(given, size=given.data, members=members)


def pieces(source: ByteSource, stretches: Sequence[Stored], data: int, invalidation: int) -> Iterator[bytes]:
    """Records of ``data`` bytes, each with its ``invalidation`` bytes behind, in pieces of bounded size."""
    for stretch in stretches:
        count = stretch.unpacked // data if data else 0
        bits = stretch.beside
        if data * count != stretch.unpacked or (bits and bits.unpacked != count * invalidation):
            message = (
                f"byte {stretch.begin}: {stretch.unpacked} bytes are no whole records of {data} bytes with their bits"
            )
            raise damaged(source.path, message)
        step = max(1, BLOCK_BYTES // (data + invalidation))
        values = _whole(source, stretch)
        flags = _whole(source, bits) if bits else None
        for begin in range(0, count, step):
            end = min(begin + step, count)
            table = np.zeros((end - begin, data + invalidation), dtype=np.uint8)
            table[:, :data] = _rows(source, stretch, values, begin, end, data)
            if bits:
                table[:, data:] = _rows(source, bits, flags, begin, end, invalidation)
            yield table.tobytes()


def _whole(source: ByteSource, stretch: Stored) -> bytes | None:
    """All bytes of a stretch that is packed; None if it can be read in parts."""
    return unpacked(source, stretch) if stretch.is_packed else None


def _rows(source: ByteSource, stretch: Stored, whole: bytes | None, begin: int, end: int, width: int) -> Bytes:
    """Rows ``begin`` to before ``end`` of ``width`` bytes."""
    if whole is not None:
        raw = whole[begin * width : end * width]
    else:
        raw = source.read(stretch.begin + begin * width, (end - begin) * width, "samples")
    return np.frombuffer(raw, dtype=np.uint8).reshape(-1, width)
