"""Numbers of messages of Protocol Buffers, such as those of Foxglove, by the descriptors that a file carries."""

from collections.abc import Mapping
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, duration_pb2, message_factory, timestamp_pb2
from google.protobuf.message import DecodeError
from google.protobuf.unknown_fields import UnknownFieldSet

from .ros_messages import DEEPEST
from .ros_topics import MOST_NUMBERS, Message, Number, TooManyNumbers, UnknownType, Unreadable

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
        if kind.full_name in _POINTS:
            _take_time(inner, name, found, is_point=_POINTS[kind.full_name])
        elif (inner is not None or kind.full_name not in inside) and len(inside) <= DEEPEST:
            _take_fields(inner, kind, f"{name}.", found, (*inside, kind.full_name))


def _take_time(body: Any, name: str, found: Message, is_point: bool) -> None:  # noqa: ANN401
    """Seconds and nanoseconds; a point in time of zero was not set."""
    value = 0 if body is None else int(body.seconds) * 1_000_000_000 + int(body.nanos)
    if is_point:
        found.times.append(len(found.numbers))
    _add(found, {name: value if body is not None and (value or not is_point) else None})


def _add(found: Message, numbers: dict[str, Number | None]) -> None:
    if len(found.numbers) + len(numbers) > MOST_NUMBERS:
        raise TooManyNumbers(f"more than {MOST_NUMBERS} values")
    found.names += numbers
    found.numbers += numbers.values()
