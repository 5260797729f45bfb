"""The numbers of a message from its bytes, in the order of its fields; ROS 1 and ROS 2 (CDR)."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from .definitions import DURATION, PRIMITIVES, TEXTS, TIME, Field

MOST_NUMBERS = 4096
"""A message of more numbers is a picture or a cloud of points, and no sample."""
_PADDING = 7
"""Bytes with which CDR may fill up a message."""
Number = float | int | bool


class Unreadable(Exception):
    """Bytes that are no message of their description."""


class TooLong(Exception):
    """A message of more numbers than a sample has."""


@dataclass
class Message:
    """The numbers of one message, in order, and their names; times are integers of nanoseconds since 1970."""

    numbers: list[Number | None] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    times: list[int] = field(default_factory=list)


class Decoder:
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
        left = len(raw) - state.at
        if left > (_PADDING if self._is_cdr else 0):
            raise Unreadable(f"a message of {len(raw)} bytes is {left} longer than its description says")
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
        """All fields of a message; arrays beside a list of names are called by them."""
        labels: list[str] = []
        for each in fields:
            path = prefix + each.name
            count = int(self.take("I")[0]) if each.count < 0 else each.count
            if each.kind in TEXTS:
                if count > len(self.raw):
                    raise Unreadable(f"{count} texts in a message of {len(self.raw)} bytes")
                texts = [self.text() for _ in range(count)]
                labels = texts if each.name == "name" and each.is_array else labels
            else:
                self._values(each, path, count, labels)

    def _values(self, each: Field, path: str, count: int, labels: list[str]) -> None:
        if count > MOST_NUMBERS or len(self.message.numbers) + count > MOST_NUMBERS:
            raise TooLong(f"{path} has {count} values")
        names = [path]
        if each.is_array:
            names = [f"{path}[{label}]" for label in labels] if len(labels) == count else _numbered(path, count)
        if isinstance(each.kind, tuple):
            for name in names:
                self.fields(each.kind, f"{name}.")
            return
        if each.kind in (TIME, DURATION):
            for name in names:
                self._time(each.kind, name)
            return
        self.message.numbers += self.take(PRIMITIVES[each.kind], count)
        self.message.names += names

    def _time(self, kind: str, name: str) -> None:
        """Seconds and nanoseconds; a time of zero was not set."""
        seconds = int(self.take("I" if kind == TIME and not self.is_cdr else "i")[0])
        nanoseconds = int(self.take("I" if kind == TIME or self.is_cdr else "i")[0])
        value = seconds * 1_000_000_000 + nanoseconds
        if kind == TIME:
            self.message.times.append(len(self.message.numbers))
        self.message.numbers.append(None if kind == TIME and not value else value)
        self.message.names.append(name)


def _numbered(path: str, count: int) -> list[str]:
    return [f"{path}[{i}]" for i in range(count)]
