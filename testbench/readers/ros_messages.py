"""Numbers of messages of ROS 1 and ROS 2 (CDR), by the descriptions that a file carries.

rosbags reads the descriptions. Its own decoders are Python code that it writes from them and runs; what a file says is
never run here, so the bytes are decoded below.
"""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

from .ros_topics import MOST_NUMBERS, Message, Number, TooManyNumbers, UnknownType, Unreadable

_PADDING = 7
"""Bytes with which CDR may fill up a message."""
_PRIMITIVES = {
    "bool": "?", "byte": "b", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_TEXT, _TIME, _DURATION = "string", "time", "duration"
_TIMES = {"builtin_interfaces/msg/Time": _TIME, "builtin_interfaces/msg/Duration": _DURATION}
_STAMP = ("stamp", (Nodetype.NAME, "builtin_interfaces/msg/Time"))
_FRAME = ("frame_id", (Nodetype.BASE, (_TEXT, 0)))
_SEQUENCE = ("seq", (Nodetype.BASE, ("uint32", 0)))
_SEPARATOR = re.compile(r"(?m)^={20,}[ \t]*\n(?=MSG:)")
_CONSTANT = re.compile(r"(?m)^[ \t]*[A-Za-z][\w/<=]*[ \t]+\w+[ \t]*=.*$")
DEEPEST, _LONGEST, _MOST_FIELDS = 20, 1 << 20, 10_000


@dataclass(frozen=True)
class Field:
    """A field: its type (a primitive, a text, a time, or fields of its own), and how many of it.

    ``count`` is 1 for one value, the length of an array, or -1 for an array that brings its length.
    """

    name: str
    kind: "str | tuple[Field, ...]"
    count: int = 1
    is_array: bool = False


@lru_cache(maxsize=32)
def message_fields(text: str, name: str, is_ros2: bool) -> tuple[Field, ...]:
    """The fields of the message ``name`` that ``text`` describes, with what it contains below lines of ``=``."""
    if len(text) > _LONGEST:
        raise UnknownType(f"a description of {len(text)} letters")
    text = _SEPARATOR.sub("=" * 80 + "\n", _CONSTANT.sub("", text.replace("\r\n", "\n")))
    try:
        found = get_types_from_msg(text, name)
    except (TypesysError, RecursionError) as error:
        raise UnknownType(f"{name}: rosbags cannot read its description ({str(error)[:200]})") from error
    types: dict[str, Any] = {"std_msgs/msg/Header": [*([] if is_ros2 else [_SEQUENCE]), _STAMP, _FRAME]}
    types |= {title: fields for title, (_, fields) in found.items()}
    return _fields(next(iter(found)), types, 0, [0])


def _fields(name: str, types: dict[str, Any], depth: int, seen: list[int]) -> tuple[Field, ...]:
    if name not in types:
        raise UnknownType(f"the type {name!r} is described nowhere")
    if depth > DEEPEST:
        raise UnknownType(f"messages nested more than {DEEPEST} deep")
    found = []
    for label, (node, of) in types[name]:
        seen[0] += 1
        if seen[0] > _MOST_FIELDS:
            raise UnknownType(f"more than {_MOST_FIELDS} fields")
        is_array, count = node in (Nodetype.ARRAY, Nodetype.SEQUENCE), 1
        if is_array:
            count = of[1] if node == Nodetype.ARRAY else -1
            node, of = of[0]
        kind = of[0] if node == Nodetype.BASE else _TIMES.get(of) or _fields(of, types, depth + 1, seen)
        found.append(Field(label, kind, count, is_array))
    return tuple(found)


class RosDecoder:
    """Decodes messages of one description."""

    def __init__(self, fields: Sequence[Field], is_cdr: bool) -> None:
        self._fields, self._is_cdr = fields, is_cdr

    def decode(self, raw: bytes) -> Message:
        """The numbers of a message."""
        state = _State(raw, self._is_cdr)
        try:
            state.fields(self._fields, "")
        except struct.error as error:
            raise Unreadable(f"a message of {len(raw)} bytes ends too early") from error
        rest = len(raw) - state.at
        if rest > (_PADDING if self._is_cdr else 0):
            raise Unreadable(f"a message of {len(raw)} bytes is {rest} longer than its description says")
        return state.message


class _State:
    """Where in the bytes of a message, and what was found up to there."""

    def __init__(self, raw: bytes, is_cdr: bool) -> None:
        self.raw, self.is_cdr, self.message = raw, is_cdr, Message()
        self.at, self.base, self.order = 0, 0, "<"
        if is_cdr:
            if len(raw) < 4 or raw[1] not in (0, 1):
                raise Unreadable(f"CDR begins with {raw[:4].hex()}")
            self.order = "<" if raw[1] else ">"
            self.at = self.base = 4

    def take(self, form: str, count: int = 1) -> tuple[Number, ...]:
        """``count`` primitives; CDR aligns each to its size."""
        size = struct.calcsize(form)
        if self.is_cdr and count:
            self.at += -(self.at - self.base) % size
        if count * size > len(self.raw) - self.at:
            raise Unreadable(f"{count} values at byte {self.at} go beyond the {len(self.raw)} bytes of a message")
        values = struct.unpack_from(f"{self.order}{count}{form}", self.raw, self.at)
        self.at += count * size
        return values

    def text(self) -> str:
        """A length and as many bytes."""
        length = int(self.take("I")[0])
        if length > len(self.raw) - self.at:
            raise Unreadable(f"a text of {length} bytes at byte {self.at} goes beyond the message")
        raw = self.raw[self.at : self.at + length]
        self.at += length
        return raw.decode("utf-8", "replace").rstrip("\0")

    def fields(self, fields: Sequence[Field], prefix: str) -> None:
        """All fields of a message; arrays that come with a list of names are called by them."""
        labels: list[str] = []
        for each in fields:
            path = prefix + each.name
            count = int(self.take("I")[0]) if each.count < 0 else each.count
            if each.kind == _TEXT:
                if count > len(self.raw):
                    raise Unreadable(f"{count} texts in a message of {len(self.raw)} bytes")
                texts = [self.text() for _ in range(count)]
                if not each.is_array:
                    self.message.texts[path] = texts[0]
                elif each.name == "name":
                    labels = texts
            else:
                self._values(each, path, count, labels)

    def _values(self, each: Field, path: str, count: int, labels: list[str]) -> None:
        if count > MOST_NUMBERS or len(self.message.numbers) + count > MOST_NUMBERS:
            raise TooManyNumbers(f"{path} has {count} values")
        names = [path]
        if each.is_array:
            names = [f"{path}[{i}]" for i in (labels if len(labels) == count else range(count))]
        if isinstance(each.kind, tuple):
            if self.is_cdr and not each.kind:  # DDS knows no structure without a member: a byte stands for it
                self.take("B", count)
            for name in names:
                self.fields(each.kind, f"{name}.")
            return
        self.message.names += names
        if each.kind not in (_TIME, _DURATION):
            self.message.numbers += self.take(_PRIMITIVES[each.kind], count)
            return
        is_point = each.kind == _TIME
        for _ in names:  # seconds and nanoseconds
            seconds = int(self.take("I" if is_point and not self.is_cdr else "i")[0])
            value = seconds * 1_000_000_000 + int(self.take("I" if is_point or self.is_cdr else "i")[0])
            if is_point:
                self.message.times.append(len(self.message.numbers))
            self.message.numbers.append(None if is_point and not value else value)  # one of zero was not set
