"""What both versions of MDF come to: data groups of records, channels in records, laws of conversion."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from ...recording import Finding, Samples

Law = Callable[[Samples], Samples]
Pieces = Callable[[], Iterator[bytes]]


@dataclass(frozen=True)
class Member:
    """A channel: where its bits lie in a record, and the law that makes its number physical.

    ``kind``: unsigned, signed or floating-point number, or ``index``, the number of the record. ``invalid_bit`` is
    the bit behind the record's data that marks a sample as invalid, -1 for always; None if there is none.
    """

    name: str
    unit: str | None
    kind: Literal["u", "i", "f", "index"]
    order: Literal["<", ">"]
    byte: int
    bit: int
    bits: int
    law: Law | None = None
    is_time: bool = False
    invalid_bit: int | None = None


@dataclass(frozen=True)
class Records:
    """Records of one kind: their size without identifier [bytes], the size of their data, how many are declared.

    ``size`` is None for texts of varying length, which are passed over. ``master`` is the address of the records that
    hold their time, 0 if they do themselves.
    """

    name: str
    identifier: int
    size: int | None
    data: int
    declared: int | None
    members: tuple[Member, ...]
    address: int = 0
    master: int = 0


@dataclass(frozen=True)
class DataGroup:
    """Records in one stream of bytes, each after its identifier (and before it again: ``trailing``) if it has one."""

    identifier_size: int
    trailing: bool
    order: Literal["<", ">"]
    records: tuple[Records, ...]
    pieces: Pieces
    bytes: int


@dataclass
class File:
    """All that a file declares."""

    version: str
    groups: list[DataGroup] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    converted: int = 0


"""Channels with a law of conversion."""
