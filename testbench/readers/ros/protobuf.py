"""Messages of Protocol Buffers, such as those of Foxglove, by the descriptors that the file carries."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from . import wire
from .decode import MOST_NUMBERS, Message, Number, TooLong, Unreadable
from .definitions import Unclear
from .wire import BYTES, Raw, varint

_FIXED = {1: "<d", 2: "<f", 6: "<Q", 7: "<I", 15: "<i", 16: "<q"}
_SIGNED, _ZIGZAG, _BOOL = (3, 5, 14), (17, 18), 8
_TEXTS, _MESSAGE, _GROUP = (9, 12), 11, 10
_REPEATED, _OPTIONAL = 3, 1
_TIME, _DURATION = ".google.protobuf.Timestamp", ".google.protobuf.Duration"
_DEEPEST = 20


@dataclass(frozen=True)
class Field:
    """A field of a message: its name, type, the message that it is, whether there are many, whether it may be unset."""

    name: str
    number: int
    kind: int
    of: str
    repeated: bool
    may_be_unset: bool


@dataclass
class Decoder:
    """Decodes messages of the type ``name`` by the descriptors of all ``types``."""

    name: str
    types: dict[str, tuple[Field, ...]] = field(default_factory=dict)

    def decode(self, raw: bytes) -> Message:
        """The numbers of a message; a field that was not sent is zero, or NaN where it may be unset."""
        message = Message()
        self._message(wire.fields(raw), self.types[self.name], "", message, (self.name,))
        return message

    def _message(
        self,
        found: dict[int, list[tuple[int, Raw]]] | None,
        fields: tuple[Field, ...],
        prefix: str,
        message: Message,
        inside: tuple[str, ...],
    ) -> None:
        for each in fields:
            path = prefix + each.name
            sent = [] if found is None else found.get(each.number, [])
            if each.kind == _MESSAGE:
                self._inner(each, sent, path, message, inside)
            elif each.kind not in _TEXTS:
                numbers = [number for one in sent for number in _numbers(one, each.kind)]
                if each.repeated:
                    _add(message, {f"{path}[{i}]": number for i, number in enumerate(numbers)})
                else:
                    unset = None if found is None or each.may_be_unset else 0
                    _add(message, {path: numbers[-1] if numbers else unset})

    def _inner(
        self, each: Field, sent: list[tuple[int, Raw]], path: str, message: Message, inside: tuple[str, ...]
    ) -> None:
        """Messages within; one that was not sent is NaN throughout, if it does not hold itself."""
        if any(kind != BYTES for kind, _ in sent):
            raise Unreadable(f"{path} is no message")
        bodies = [wire.fields(body) for _, body in sent if isinstance(body, bytes)]
        names = [f"{path}[{i}]" for i in range(len(bodies))] if each.repeated else [path]
        for i, name in enumerate(names):
            body = bodies[i if each.repeated else -1] if bodies else None
            if each.of in (_TIME, _DURATION):
                _time(body, name, message, is_point=each.of == _TIME)
            elif (body is not None or each.of not in inside) and len(inside) <= _DEEPEST:
                self._message(body, self.types[each.of], f"{name}.", message, (*inside, each.of))


def _add(message: Message, numbers: dict[str, Number | None]) -> None:
    if len(message.numbers) + len(numbers) > MOST_NUMBERS:
        raise TooLong(f"more than {MOST_NUMBERS} values")
    message.names += numbers
    message.numbers += numbers.values()


def _time(body: dict[int, list[tuple[int, Raw]]] | None, name: str, message: Message, is_point: bool) -> None:
    """Seconds and nanoseconds; a point in time of zero was not set."""
    parts = [_numbers(one[-1], 3)[-1] if body and (one := body.get(i)) else 0 for i in (1, 2)]
    value = int(parts[0]) * 1_000_000_000 + int(parts[1])
    if is_point:
        message.times.append(len(message.numbers))
    _add(message, {name: value if body is not None and (value or not is_point) else None})


def _numbers(one: tuple[int, Raw], kind: int) -> list[Number]:
    """The numbers of a field as sent: one, or many packed to bytes."""
    sent, value = one
    if kind in _FIXED:
        form = _FIXED[kind]
        if not isinstance(value, bytes) or len(value) % struct.calcsize(form):
            raise Unreadable(f"numbers of {struct.calcsize(form)} bytes in a field of another kind")
        return [number for (number,) in struct.iter_unpack(form, value)]
    integers = [value] if isinstance(value, int) else list(_varints(value))
    if isinstance(value, bytes) and sent != BYTES:
        raise Unreadable(f"an integer in a field of kind {sent}")
    return [_integer(integer, kind) for integer in integers]


def _varints(packed: bytes) -> Iterator[int]:
    at = 0
    while at < len(packed):
        value, at = varint(packed, at)
        yield value


def _integer(value: int, kind: int) -> Number:
    if kind in _ZIGZAG:
        return (value >> 1) ^ -(value & 1)
    if kind in _SIGNED and value >> 63:
        return value - (1 << 64)
    return bool(value) if kind == _BOOL else value


def parse(descriptors: bytes, name: str) -> Decoder:
    """The decoder of the message ``name`` that a FileDescriptorSet describes."""
    types: dict[str, tuple[Field, ...]] = {}
    try:
        for _, file in wire.fields(descriptors).get(1, []):
            said = wire.fields(_bytes(file))
            package = _text(said, 2)
            is_proto3 = _text(said, 12) == "proto3"
            for _, described in said.get(4, []):
                _describe(_bytes(described), f".{package}" if package else "", types, is_proto3, 0)
    except Unreadable as error:
        raise Unclear(f"its descriptors cannot be read: {error}") from error
    missing = {each.of for fields in types.values() for each in fields if each.kind == _MESSAGE} - types.keys()
    if f".{name}" not in types or missing - {_TIME, _DURATION}:
        raise Unclear(f"its descriptors do not hold {', '.join(sorted({f'.{name}', *missing} - types.keys()))}")
    return Decoder(f".{name}", types)


def _describe(raw: bytes, package: str, types: dict[str, tuple[Field, ...]], is_proto3: bool, depth: int) -> None:
    """A message and those that are defined within it."""
    if depth > _DEEPEST:
        raise Unreadable(f"messages defined more than {_DEEPEST} deep")
    said = wire.fields(raw)
    name = f"{package}.{_text(said, 1)}"
    found = tuple(_field(_bytes(one), is_proto3) for _, one in said.get(2, []))
    if any(each.kind == _GROUP for each in found):
        raise Unreadable(f"{name} holds groups")
    types[name] = found
    for _, inner in said.get(3, []):
        _describe(_bytes(inner), name, types, is_proto3, depth + 1)


def _field(raw: bytes, is_proto3: bool) -> Field:
    said = wire.fields(raw)
    number, label, kind = (_whole(said, i) for i in (3, 4, 5))
    has_presence = not is_proto3 or bool(_whole(said, 17)) or 9 in said
    return Field(_text(said, 1), number, kind, _text(said, 6), label == _REPEATED, has_presence and label == _OPTIONAL)


def _bytes(value: Raw) -> bytes:
    if not isinstance(value, bytes):
        raise Unreadable("an integer where a message is expected")
    return value


def _text(said: dict[int, list[tuple[int, Raw]]], number: int) -> str:
    return _bytes(said[number][-1][1]).decode("utf-8", "replace") if number in said else ""


def _whole(said: dict[int, list[tuple[int, Raw]]], number: int) -> int:
    value = said[number][-1][1] if number in said else 0
    return value if isinstance(value, int) else 0
