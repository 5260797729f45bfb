"""Reading MCAP record by record, in the order of the file, whole or cut."""

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.stream_reader import CRCValidationError, StreamReader

from ..recording import Finding, Recording
from .format_findings import damaged, refusing
from .protobuf_messages import ProtobufDecoder
from .ros_messages import RosDecoder, message_fields
from .ros_topics import Decode, Topic, UnknownType, Unreadable, json_message, topic_recording

_MAGIC = b"\x89MCAP0\r\n"
_LARGEST_RECORD = 256 << 20
_ENCODINGS = {("ros1msg", "ros1"), ("ros2msg", "cdr")}


@dataclass
class _File:
    """The topics of a file and what is known of them."""

    topics: dict[int, Topic] = field(default_factory=dict)
    schemas: dict[int, Any] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    metadata: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    zero: int = 0
    declared: int | None = None


def open_library(path: Path) -> Recording:
    """Go through the file once, looking at the first messages of each topic."""
    file = _File()
    for topic, _, raw in _messages(path, file):
        with refusing(path, f"topic {topic.name!r}", Unreadable):
            topic.look(raw)
    findings, found = file.findings, sum(file.counts.values())
    for key, topic in file.topics.items():
        if topic.reason and file.counts[key]:
            message = f"{file.counts[key]} messages are not kept: {topic.reason}"
            findings.append(Finding("left_out", topic.name, None, message))
    if file.declared not in (None, found):
        message = f"the summary counts {file.declared} messages, {found} are there"
        findings.append(Finding("count_contradiction", None, None, message))
    metadata = file.metadata | {"zero": f"{file.zero} ns since 1970"}
    topics = file.topics.values()
    return topic_recording(path, "MCAP", topics, findings, metadata, lambda report: _messages(path, _File()))


def _messages(path: Path, file: _File) -> Iterator[tuple[Topic, int, bytes]]:
    """Every message with its topic and time of logging; a file that ends too early ends them with a finding."""
    with path.open("rb") as stream:
        records = StreamReader(stream, validate_crcs=True, record_size_limit=_LARGEST_RECORD).records
        try:
            for record in records:
                yield from _record(record, file, path)
        except (McapError, ValueError, struct.error) as error:
            if _is_closed(path) or isinstance(error, CRCValidationError):
                raise damaged(path, f"{type(error).__name__}: {error}") from error
            total = sum(file.counts.values())
            message = f"the file ends too early ({type(error).__name__}); {total} whole messages are before that"
            file.findings.append(Finding("cut_file", None, None, message))


def _is_closed(path: Path) -> bool:
    """Whether the file ends as MCAP does."""
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - len(_MAGIC)))
        return stream.read() == _MAGIC


def _record(record: Any, file: _File, path: Path) -> Iterator[tuple[Topic, int, bytes]]:  # noqa: ANN401
    kind = type(record).__name__
    if kind == "Header":
        file.metadata |= {"profile": record.profile, "library": record.library}
    elif kind == "Schema":
        file.schemas[record.id] = record
    elif kind == "Channel" and record.id not in file.topics:
        file.topics[record.id] = _topic(record, file)
    elif kind == "Metadata":
        file.metadata |= {f"{record.name}: {key}": text for key, text in record.metadata.items()}
    elif kind == "Statistics":
        file.declared = record.message_count
    elif kind == "Message":
        if record.channel_id not in file.topics:
            raise damaged(path, f"a message of channel {record.channel_id}, which was never declared")
        if not file.counts:
            file.zero = record.log_time
        file.counts[record.channel_id] += 1
        topic = file.topics[record.channel_id]
        topic.zero = file.zero
        yield topic, record.log_time, record.data


def _topic(channel: Any, file: _File) -> Topic:  # noqa: ANN401
    """A topic and how its messages are decoded; a reason if they are not."""
    schema = file.schemas.get(channel.schema_id)
    encodings = (schema.encoding if schema else "", channel.message_encoding)
    taken = [topic.name for topic in file.topics.values()]
    name = channel.topic if channel.topic not in taken else f"{channel.topic} {channel.id}"

    def decoder() -> Decode:
        if channel.message_encoding == "json":
            return json_message
        if schema is not None and encodings == ("protobuf", "protobuf"):
            return ProtobufDecoder(schema.data, schema.name).decode
        if schema is None or encodings not in _ENCODINGS:
            raise UnknownType(f"messages are encoded as {encodings[1]!r} with {encodings[0]!r}")
        is_cdr = encodings[1] == "cdr"
        return RosDecoder(message_fields(schema.data.decode("utf-8", "replace"), schema.name, is_cdr), is_cdr).decode

    return Topic.of(name, decoder)
