"""What goes through the pipe: a length, a JSON document, and columns of float64."""

import json
import struct
from collections.abc import Mapping
from typing import IO, Any

import numpy as np

from ..recording import Block, Channel, Clock, Finding, Group, Samples, SensorRange, TimeColumn, UniformClock

_HEAD = struct.Struct("<IQ")
_LONGEST_DOCUMENT, _LONGEST_COLUMNS = 256 << 20, 2 << 30


class Broken(Exception):
    """The pipe ended, or brought something that is no frame."""


def write_frame(stream: IO[bytes], document: Mapping[str, Any], columns: tuple[Samples, ...] = ()) -> None:
    """Send a document and columns of one length."""
    text = json.dumps(document).encode()
    data = [np.ascontiguousarray(column, dtype=np.float64) for column in columns]
    stream.write(_HEAD.pack(len(text), sum(column.nbytes for column in data)) + text)
    for column in data:
        stream.write(column.data)
    stream.flush()


def read_frame(stream: IO[bytes]) -> tuple[dict[str, Any], Samples]:
    """The next document, and its columns one behind the other."""
    text_length, data_length = _HEAD.unpack(_exactly(stream, _HEAD.size))
    if text_length > _LONGEST_DOCUMENT or data_length > _LONGEST_COLUMNS or data_length % 8:
        raise Broken(f"a frame of {text_length} and {data_length} bytes")
    try:
        document = json.loads(_exactly(stream, text_length))
    except ValueError as error:
        raise Broken(f"no JSON: {error}") from error
    return document, np.frombuffer(_exactly(stream, data_length), dtype=np.float64)


def _exactly(stream: IO[bytes], count: int) -> bytes:
    data = stream.read(count)
    if len(data) != count:
        raise Broken("the pipe ended")
    return data


def group_as_dict(group: Group) -> dict[str, Any]:
    """A group for the pipe."""
    clock: dict[str, Any] | None = None
    if isinstance(group.clock, UniformClock):
        clock = {"rate_hz": group.clock.rate_hz, "start_s": group.clock.start_s}
    elif group.clock is not None:
        factor = group.clock.seconds_per_unit
        clock = {"index": group.clock.index, "seconds_per_unit": factor, "assumed": group.clock.assumed}
    return {
        "name": group.name,
        "channels": [[channel.name, channel.unit, channel.label] for channel in group.channels],
        "clock": clock,
    }


def group_from_dict(document: Mapping[str, Any]) -> Group:
    """A group from the pipe."""
    clock: Clock | None = None
    if (stated := document["clock"]) is not None:
        clock = TimeColumn(**stated) if "index" in stated else UniformClock(**stated)
    return Group(document["name"], tuple(Channel(*channel) for channel in document["channels"]), clock)


def block_as_dict(block: Block) -> dict[str, Any]:
    """All of a block but its columns."""
    return {"group": block.group.name, "start": block.start, "columns": len(block.columns), "read": block.bytes_read}


def finding_from_dict(stated: Mapping[str, Any]) -> Finding:
    """A finding from the pipe."""
    return Finding(stated["code"], stated["channel"], stated["where"], stated["message"])


def range_from_list(stated: tuple[float, str, int | None]) -> SensorRange:
    """A sensor range from the pipe."""
    return SensorRange(*stated)
