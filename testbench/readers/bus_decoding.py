"""Frames of a CAN bus decoded by a database (DBC) through cantools: a group for each message, beside the frames.

Frames are those of groups with channels ``ID``, ``DataLength`` and ``DataBytes[0]``, ..., as bus loggers write MDF.
Messages of SAE J1939 are found by their parameter group, whoever sends them.
"""

import hashlib
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import RecordingError
from ..recording import Block, Channel, Finding, Group, Recording, Report, Samples, TimeColumn
from .byte_source import decoded
from .format_findings import names_listed

if TYPE_CHECKING:
    from cantools.database.can import Message

LARGEST_BYTES = 20 << 20
"""Of a database."""
_EXTENDED = 1 << 29
_DATA = [f"DataBytes[{k}]" for k in range(64)]


@dataclass(frozen=True)
class BusDatabase:
    """Messages by their identifier, those of J1939 by their parameter group; name and SHA-256 of the file."""

    name: str
    sha256: str
    by_identifier: "dict[tuple[int, bool], Message]"
    by_parameter_group: "dict[int, Message]"

    @classmethod
    def load(cls, path: Path) -> "BusDatabase":
        """Read a DBC, in UTF-8 or Windows-1252. Raises RecordingError for one that is none."""
        try:
            import cantools
        except ModuleNotFoundError as error:
            raise RecordingError("decoding a bus needs cantools: pip install 'counterpoise[can]'") from error
        try:
            with path.open("rb") as stream:
                raw = stream.read(LARGEST_BYTES + 1)
        except OSError as error:
            raise RecordingError(f"{path.name}: cannot be read: {error.strerror or error}") from error
        if len(raw) > LARGEST_BYTES:
            raise RecordingError(f"{path.name}: larger than {LARGEST_BYTES >> 20} MiB: expected a database (DBC)")
        logging.getLogger("cantools").addHandler(logging.NullHandler())  # which else speaks on stderr
        try:
            database: Any = cantools.database.load_string(decoded(raw), "dbc")
            messages: list[Any] = list(database.messages)
        except Exception as error:  # cantools has no one error for texts that are no DBC
            raise RecordingError(f"{path.name}: not a DBC: {str(error)[:200]}") from error
        j1939 = [message for message in messages if message.protocol == "j1939"]
        return cls(
            path.name,
            hashlib.sha256(raw).hexdigest(),
            {(message.frame_id, message.is_extended_frame): message for message in messages},
            {_parameter_group(message.frame_id): message for message in j1939},
        )

    def message(self, identifier: int, is_extended: bool) -> "tuple[Message, str] | None":
        """The message of a frame and a name for it, with the sender's address where that is not the database's."""
        found = self.by_identifier.get((identifier, is_extended))
        if found is not None:
            same = sum(message.name == found.name for message in self.by_identifier.values())
            return found, found.name if same == 1 else f"{found.name} {identifier:#x}"
        found = self.by_parameter_group.get(_parameter_group(identifier)) if is_extended else None
        return None if found is None else (found, f"{found.name} of {identifier & 0xFF:#04x}")

    def applied(self, recording: Recording) -> Recording:
        """The recording with a group for each message that is met. Raises RecordingError where it has no frames."""
        if not any(_places(group) for group in recording.groups):
            raise RecordingError(f"{recording.path.name}: holds no frames of a bus, which {self.name} could decode")

        def read(report: Report) -> Iterator[Block]:
            decoders: dict[str, _Decoder] = {}
            for block in recording.read(report):
                yield block
                if places := _places(block.group):
                    decoder = decoders.setdefault(block.group.name, _Decoder(self, block.group, places))
                    yield from decoder.blocks(block)
            for decoder in decoders.values():
                decoder.report(report)

        settings = {**recording.settings, "dbc": f"{self.name}, SHA-256 {self.sha256}"}
        return replace(recording, read=read, settings=settings)


def _parameter_group(identifier: int) -> int:
    """The parameter group of an identifier of 29 bits (SAE J1939-21): below 240 the next byte is an address."""
    group = identifier >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= 240 else group & 0x3FF00


def _places(group: Group) -> dict[str, int]:
    """The places of the channels of a group by the last part of their name; none if it holds no frames."""
    places = {channel.name.rpartition(".")[2]: i for i, channel in enumerate(group.channels)}
    return places if {"ID", "DataLength"} <= places.keys() and any(name in places for name in _DATA) else {}


@dataclass
class _Decoder:
    """Decodes the frames of one group, and counts on the samples of each message."""

    database: BusDatabase
    group: Group
    places: dict[str, int]
    _samples: Counter[str] = field(default_factory=Counter)
    _unknown: Counter[int] = field(default_factory=Counter)
    _failed: Counter[str] = field(default_factory=Counter)

    def blocks(self, block: Block) -> Iterator[Block]:
        """A block for each message in a block of frames."""
        columns = {name: block.columns[i] for name, i in self.places.items()}
        identifiers, lengths = (columns[name].astype(np.int64) for name in ("ID", "DataLength"))
        extended = columns["IDE"] != 0 if "IDE" in columns else identifiers > 0x7FF
        parts = [columns[name] for name in _DATA if name in columns]
        data = np.nan_to_num(np.column_stack(parts)).astype(np.uint8)
        keys = identifiers % _EXTENDED + _EXTENDED * extended
        for key in np.unique(keys).tolist():
            rows = np.flatnonzero(keys == key).tolist()
            found = self.database.message(key % _EXTENDED, key >= _EXTENDED)
            if found is None:
                self._unknown[key % _EXTENDED] += len(rows)
            else:
                yield self._decoded(*found, rows, [data[i, : lengths[i]].tobytes() for i in rows], block)

    def _decoded(self, message: "Message", name: str, rows: list[int], data: list[bytes], block: Block) -> Block:
        names = [signal.name for signal in message.signals]
        table = np.full((len(names), len(rows)), np.nan)
        for k, raw in enumerate(data):
            try:
                values = message.decode(raw, decode_choices=False, allow_truncated=True)
            except Exception:  # cantools has no one error for frames that are none of the message
                self._failed[name] += 1
                continue
            table[:, k] = [float(values.get(signal, np.nan)) for signal in names]  # type: ignore[union-attr, arg-type]
        clock = self.group.clock
        time = [clock.index] if isinstance(clock, TimeColumn) else []
        channels = [self.group.channels[i] for i in time]
        channels += [Channel(signal.name, signal.unit or None) for signal in message.signals]
        own = replace(clock, index=0) if isinstance(clock, TimeColumn) else None
        group = Group(f"{self.group.name} {name}", tuple(channels), own, self.group.zero)
        columns: list[Samples] = [block.columns[i][rows] for i in time]
        start = self._samples[name]
        self._samples[name] += len(rows)
        return Block(group, (*columns, *table), start, None, block.bytes_read)

    def report(self, report: Report) -> None:
        """Report what was decoded, and what was not."""
        listed = names_listed([f"{name} ({count})" for name, count in self._samples.items()])
        message = f"frames decoded by {self.database.name}: {listed or 'none'}"
        if self._unknown:
            message += f"; {self._unknown.total()} frames of {len(self._unknown)} identifiers are in no message of it"
        report(Finding("calibration_applied", None, None, message, self.group.name))
        for name, count in self._failed.items():
            text = f"{count} frames of message {name!r} cannot be decoded: NaN; the frames are kept"
            report(Finding("invalid_samples", None, None, text, self.group.name))
