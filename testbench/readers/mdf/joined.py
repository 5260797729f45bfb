"""Channel groups whose time lies in another one (remote master, column storage): read side by side, as one group."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .model import DataGroup, File, Member, Records
from .numbers import Bytes
from .records import parts

_NONE: Bytes = np.empty((0, 0), dtype=np.uint8)


@dataclass(frozen=True)
class Columns:
    """Records of one group, each in its own stream; the first hold the time."""

    streams: tuple[tuple[DataGroup, Records], ...]

    @property
    def first(self) -> Records:
        """The records of the master, or the only ones."""
        return self.streams[0][1]

    @property
    def members(self) -> tuple[Member, ...]:
        """All channels, stream by stream."""
        return tuple(member for _, records in self.streams for member in records.members)

    @property
    def declared(self) -> set[int | None]:
        """How many samples the streams declare."""
        return {records.declared for _, records in self.streams}

    def rows(self) -> Iterator[list[Bytes]]:
        """Successive records of all streams, as many of each; what one has more than another is left."""
        pieces = [_rows(group) for group, _ in self.streams]
        waiting = [next(piece, _NONE) for piece in pieces]
        while count := min(map(len, waiting)):
            yield [rows[:count] for rows in waiting]
            rest = [rows[count:] for rows in waiting]
            waiting = [rows if len(rows) else next(piece, _NONE) for rows, piece in zip(rest, pieces, strict=True)]


def _rows(group: DataGroup) -> Iterator[Bytes]:
    return (part.rows for part in parts(group) if len(part.rows))


def joined(file: File) -> tuple[list[Columns], str]:
    """The groups of a file that are stored by column; a name whose master is not there, if there is one."""
    every = [(group, records) for group in file.groups for records in group.records]
    by_address = {records.address: (group, records) for group, records in every}
    followers: dict[int, list[tuple[DataGroup, Records]]] = {}
    for group, records in every:
        if records.master:
            followers.setdefault(records.master, []).append((group, records))
    found = []
    for address, members in followers.items():
        master = by_address.get(address)
        if master is None or master[1].master or not _alone([master, *members]):
            return [], members[0][1].name or "without a name"
        found.append(Columns((master, *members)))
    return found, ""


def _alone(streams: Sequence[tuple[DataGroup, Records]]) -> bool:
    """Whether each stream holds records of one kind."""
    return all(not group.identifier_size and len(group.records) == 1 for group, _ in streams)
