"""Records of each group from the bytes of their data group: of one kind, or of several by their identifiers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..stream import BLOCK_BYTES
from .model import DataGroup, Records
from .numbers import Bytes


class Torn(Exception):
    """An identifier that is none of the group's: from there on nothing can be told apart."""


@dataclass(frozen=True)
class Part:
    """Successive records of one kind, (n, size), or (n, 0) where all of it is virtual."""

    records: Records
    rows: Bytes


def parts(group: DataGroup) -> Iterator[Part]:
    """The records of a data group as they come; what is no whole record at the end is left."""
    if not group.identifier_size:
        yield from _one_kind(group)
    else:
        yield from _several(group)


def _one_kind(group: DataGroup) -> Iterator[Part]:
    records = group.records[0]
    if not records.size:
        if records.declared and records.size == 0:
            yield Part(records, np.empty((records.declared, 0), dtype=np.uint8))
        return
    keep = b""
    for piece in group.pieces():
        data = keep + piece if keep else piece
        count = len(data) // records.size
        keep = data[count * records.size :]
        if count:
            rows = np.frombuffer(data, dtype=np.uint8, count=count * records.size)
            yield Part(records, rows.reshape(count, records.size))


def _several(group: DataGroup) -> Iterator[Part]:
    """Records of several kinds, sorted within each piece of bytes."""
    by_identifier = {records.identifier: records for records in group.records}
    order = "little" if group.order == "<" else "big"
    head, tail = group.identifier_size, group.identifier_size if group.trailing else 0
    keep = b""
    for piece in group.pieces():
        data, at = keep + piece, 0
        found: dict[int, list[bytes]] = {}
        while at + head <= len(data):
            identifier = int.from_bytes(data[at : at + head], order)  # type: ignore[arg-type]
            records = by_identifier.get(identifier)
            if records is None:
                raise Torn(f"a record has the identifier {identifier}, which no channel group has")
            begin, size = at + head, records.size
            if size is None:
                if begin + 4 > len(data):
                    break
                begin, size = begin + 4, int.from_bytes(data[begin : begin + 4], order)  # type: ignore[arg-type]
            if begin + size + tail > len(data):
                break
            if records.size:
                found.setdefault(identifier, []).append(data[begin : begin + size])
            at = begin + size + tail
        keep = data[at:]
        if len(keep) > 64 * BLOCK_BYTES:
            raise Torn(f"a record of more than {64 * BLOCK_BYTES >> 20} MiB")
        for identifier, rows in found.items():
            records = by_identifier[identifier]
            yield Part(records, np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(len(rows), -1))
