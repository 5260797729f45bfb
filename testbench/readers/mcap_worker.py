"""Reading MCAP record by record, in the order of the file, whole or cut."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, duration_pb2, message_factory, timestamp_pb2
from google.protobuf.message import DecodeError
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.exceptions import McapError
from mcap.stream_reader import CRCValidationError, StreamReader

from ..recording import Finding, Recording
from .format_findings import damaged
from .ros_messages import DEEPEST, RosDecoder, message_fields
from .ros_topics import (
    MOST_NUMBERS,
    Decode,
    Message,
    Number,
    TooManyNumbers,
    Topic,
    UnknownType,
    Unreadable,
    json_message,
    topic_recording,
)

_POINTS = {"google.protobuf.Timestamp": True, "google.protobuf.Duration": False}
"""Types that are times, and whether they are points in time."""


class ProtobufDecoder:
    """Decodes messages of Protocol Buffers of one type, such as those of Foxglove."""

    def __init__(self, descriptors: bytes, name: str) -> None:
        """``descriptors`` is the FileDescriptorSet that holds the type ``name``. Raises UnknownType if it does not."""
        pool = descriptor_pool.DescriptorPool()
        try:
            files = {file.name: file for file in descriptor_pb2.FileDescriptorSet.FromString(descriptors).file}
            added: set[str] = set()
            for file in files:
                _add_file(pool, file, files, added)
            self._type = pool.FindMessageTypeByName(name)
            self._class = message_factory.GetMessageClass(self._type)
        except (DecodeError, TypeError, KeyError, ValueError, RecursionError) as error:
            message = f"messages are encoded as 'protobuf', and its descriptors do not hold {name}: {error}"
            raise UnknownType(message) from error

    def decode(self, raw: bytes) -> Message:
        """The numbers of a message; a field that was not sent is zero, or NaN where it may be unset."""
        found = Message()
        try:
            body = self._class.FromString(raw)
        except DecodeError as error:
            raise Unreadable(f"a message of {len(raw)} bytes: {error}") from error
        _take_fields(body, self._type, "", found, (self._type.full_name,))
        return found


def _add_file(pool: Any, name: str, files: Mapping[str, Any], added: set[str]) -> None:  # noqa: ANN401
    """Add a file of descriptors behind those that it builds on; those of times are known where they are not there."""
    if name in added:
        return
    added.add(name)
    if name in files:
        for other in files[name].dependency:
            _add_file(pool, other, files, added)
        pool.Add(files[name])
    for known in (timestamp_pb2.DESCRIPTOR, duration_pb2.DESCRIPTOR):
        if name == known.name and name not in files:
            pool.AddSerializedFile(known.serialized_pb)


def _take_fields(body: Any, kind: Any, prefix: str, found: Message, inside: tuple[str, ...]) -> None:  # noqa: ANN401
    """The numbers of a message of this type; all are NaN where there is no message."""
    if body is not None and any(each.field_number in kind.fields_by_number for each in UnknownFieldSet(body)):
        raise Unreadable(f"a field of {kind.full_name} is of another kind than its descriptor says")
    for each in kind.fields:
        path = prefix + each.name
        if each.message_type is not None:
            _take_messages(body, each, path, found, inside)
        elif each.cpp_type == each.CPPTYPE_STRING:
            if body is not None and each.type == each.TYPE_STRING and not each.is_repeated:
                found.texts[path] = getattr(body, each.name)
        elif each.is_repeated:
            numbers = [] if body is None else getattr(body, each.name)
            _add(found, {f"{path}[{i}]": number for i, number in enumerate(numbers)})
        else:
            is_set = body is not None and (not each.has_presence or body.HasField(each.name))
            _add(found, {path: getattr(body, each.name) if is_set else None})


def _take_messages(body: Any, each: Any, path: str, found: Message, inside: tuple[str, ...]) -> None:  # noqa: ANN401
    """Messages within; one that was not sent is NaN throughout, if it does not hold itself."""
    kind = each.message_type
    if kind.GetOptions().map_entry:
        value = kind.fields_by_name["value"]
        entries = {} if body is None else getattr(body, each.name)
        for key in sorted(entries):
            if value.message_type is not None:
                _take_fields(entries[key], value.message_type, f"{path}[{key}].", found, (*inside, kind.full_name))
            elif value.cpp_type != value.CPPTYPE_STRING:
                _add(found, {f"{path}[{key}]": entries[key]})
        return
    if each.is_repeated:
        bodies = {f"{path}[{i}]": inner for i, inner in enumerate([] if body is None else getattr(body, each.name))}
    else:
        bodies = {path: getattr(body, each.name) if body is not None and body.HasField(each.name) else None}
    for name, inner in bodies.items():
        if (is_point := _POINTS.get(kind.full_name)) is not None:
            value = 0 if inner is None else int(inner.seconds) * 1_000_000_000 + int(inner.nanos)
            if is_point:  # one of zero was not set
                found.times.append(len(found.numbers))
            _add(found, {name: value if inner is not None and (value or not is_point) else None})
        elif (inner is not None or kind.full_name not in inside) and len(inside) <= DEEPEST:
            _take_fields(inner, kind, f"{name}.", found, (*inside, kind.full_name))


def _add(found: Message, numbers: dict[str, Number | None]) -> None:
    if len(found.numbers) + len(numbers) > MOST_NUMBERS:
        raise TooManyNumbers(f"more than {MOST_NUMBERS} values")
    found.names += numbers
    found.numbers += numbers.values()


_MAGIC = b"\x89MCAP0\r\n"
_LARGEST_RECORD = 256 << 20
_ENCODINGS = {("ros1msg", "ros1"), ("ros2msg", "cdr")}


@dataclass
class _File:
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
            with path.open("rb") as again:
                again.seek(max(0, path.stat().st_size - len(_MAGIC)))
                is_closed = again.read() == _MAGIC
            if is_closed or isinstance(error, CRCValidationError):
                raise damaged(path, f"{type(error).__name__}: {error}") from error
            total = sum(file.counts.values())
            message = f"the file ends too early ({type(error).__name__}); {total} whole messages are before that"
            file.findings.append(Finding("cut_file", None, None, message))


def _record(record: Any, file: _File, path: Path) -> Iterator[tuple[Topic, int, bytes]]:  # noqa: ANN401
    kind = type(record).__name__
    if kind == "Header":
        file.metadata |= {"profile": record.profile, "library": record.library}
    elif kind == "Schema":
        file.schemas[record.id] = record
    elif kind == "Channel" and record.id not in file.topics:
        file.topics[record.id] = _topic(path, record, file)
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


def _topic(path: Path, channel: Any, file: _File) -> Topic:  # noqa: ANN401
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

    return Topic.of(path, name, decoder)
