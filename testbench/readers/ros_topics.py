"""The messages of each topic as columns: one row a message, its times in nanoseconds from the zero of the file."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..recording import Block, Channel, Finding, Group, Recording, Report, Samples, TextLog, TimeColumn, point_in_time
from .format_findings import nothing_to_read, refusing, rounded_integers, watch_nonfinite

MOST_NUMBERS = 4096
"""A message of more numbers is a picture or a cloud of points, and no sample."""
Number = float | int | bool
_ROWS = 1 << 13
_LOOKED = 100
"""Messages of a topic at its beginning whose stamps are looked at."""
_MOST_SHAPES = 50
_EXACT = 2.0**53


class Unreadable(Exception):
    """Bytes that are no message of their description."""


class TooManyNumbers(Exception):
    """A message of more numbers than a sample has."""


class UnknownType(Exception):
    """A description of messages that cannot be read; the text says why."""


@dataclass
class Message:
    """The numbers of one message, in order, and their names; times are integers of nanoseconds since 1970.

    Texts lie beside them, by their names.
    """

    numbers: list[Number | None] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    times: list[int] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)


Decode = Callable[[bytes], Message]


@dataclass
class Shape:
    """Messages of one shape: their numbers have the same names."""

    group: Group
    times: list[int]
    rows: list[list[Number | None]] = field(default_factory=list)
    done: int = 0
    rounded: dict[str, None] = field(default_factory=dict)

    def block(self) -> Block:
        """The rows so far as a block."""
        given = list(zip(*self.rows, strict=True))
        columns: list[Samples] = [np.array(column, dtype=np.float64) for column in given]
        for channel, written, column in zip(self.group.channels, given, columns, strict=True):
            large = np.flatnonzero(np.abs(column) >= _EXACT)
            if any(isinstance(written[i], int) for i in large):
                self.rounded[channel.name] = None
        block = Block(self.group, tuple(columns), self.done)
        self.done += len(self.rows)
        self.rows = []
        return block


@dataclass
class Topic:
    """The messages of one topic of the file ``path``. Where their shape changes, another group begins."""

    path: Path
    name: str
    decode: Decode
    zero: int
    shapes: dict[tuple[str, ...], Shape] = field(default_factory=dict)
    reason: str = ""
    is_stamped: bool = True
    """Whether the stamp in the messages, where there is one, is their clock: it rises in the first ones."""
    _looked: int = 0
    _last: Number = 0

    @classmethod
    def of(cls, path: Path, name: str, decoder: Callable[[], Decode], zero: int = 0) -> "Topic":
        """The topic whose messages are decoded as ``decoder`` says; where it raises UnknownType, they are left out."""
        try:
            return cls(path, name, decoder(), zero)
        except UnknownType as error:
            return cls(path, name, lambda raw: Message(), zero, reason=str(error))

    @property
    def is_known(self) -> bool:
        """Whether its first messages were looked at."""
        return bool(self.reason) or self._looked >= _LOOKED

    def look(self, raw: bytes) -> None:
        """Learn the shape of the first message, and whether the stamps of the first ones rise."""
        if self.is_known or (message := self._message(raw)) is None:
            return
        self._looked += 1
        if not self.shapes:
            self._shape(message)
        if (at := _stamp_index(message)) is None or not self.is_stamped:
            return
        stamp = message.numbers[at] or 0
        if self._looked > 1 and stamp <= self._last:
            self.is_stamped = False
            for shape in self.shapes.values():
                shape.group = self._group(shape.group.name, shape.group.channels, None)
        self._last = stamp

    def take(self, logged: int, raw: bytes, texts: TextLog) -> Block | None:
        """Take in a message logged at ``logged`` [ns since 1970]; a block when there are enough."""
        if self.reason or (message := self._message(raw)) is None or (shape := self._shape(message)) is None:
            return None
        numbers = message.numbers
        for i in shape.times:
            value = numbers[i]
            numbers[i] = None if value is None else int(value) - self.zero
        for name, text in message.texts.items():
            texts.take(shape.group.name, name, shape.done + len(shape.rows), text)
        shape.rows.append([logged - self.zero, *(np.nan if n is None else n for n in numbers)])
        return shape.block() if len(shape.rows) >= _ROWS else None

    def _message(self, raw: bytes) -> Message | None:
        with refusing(self.path, f"topic {self.name!r}", Unreadable):
            try:
                return self.decode(raw)
            except TooManyNumbers as error:
                self.reason = str(error)
        return None

    def _shape(self, message: Message) -> Shape | None:
        """The shape of a message; a new one if its names are new."""
        key = tuple(message.names)
        if key not in self.shapes:
            is_empty = not key and not message.texts
            if is_empty or len(self.shapes) >= _MOST_SHAPES:
                several = f"messages of more than {_MOST_SHAPES} shapes"
                self.reason = "neither numbers nor texts" if is_empty else several
                return None
            channels = [Channel("log time", "ns")]
            channels += [Channel(name, "ns" if i in message.times else None) for i, name in enumerate(message.names)]
            number = len(self.shapes) + 1
            name = self.name if number == 1 else f"{self.name} part {number}"
            group = self._group(name, tuple(channels), _stamp_index(message) if self.is_stamped else None)
            self.shapes[key] = Shape(group, list(message.times))
        return self.shapes[key]

    def _group(self, name: str, channels: tuple[Channel, ...], stamp: int | None) -> Group:
        """The group of messages; their own stamp is the clock if it is set and rises, else the time of logging."""
        zero = point_in_time(self.zero, f"time of {'logging' if stamp is None else 'the message'}", 1e-9)
        clock = TimeColumn(0 if stamp is None else stamp + 1, 1e-9)
        return Group(name, channels, clock, zero if self.zero else None)

    def remaining_blocks(self, report: Report) -> Iterator[Block]:
        """The rows that were not given yet; then what was found in all messages is reported."""
        for shape in self.shapes.values():
            if shape.rows:
                yield shape.block()
            for name in shape.rounded:
                report(rounded_integers(name))
        if self.shapes and self.reason:
            message = f"from some message on {self.name!r} is not kept: {self.reason}"
            report(Finding("ragged_row", None, None, message))


def left_out(topics: Iterable[Topic]) -> list[Finding]:
    """The topics whose messages are not kept, and why."""
    return [
        Finding("left_out", topic.name, None, f"its messages are not kept: {topic.reason}")
        for topic in topics
        if topic.reason
    ]


def _stamp_index(message: Message) -> int | None:
    """Which number of a message is its own stamp, if it is set: not that of something within."""
    for i in message.times:
        parent, _, name = message.names[i].rpartition(".")
        if name.endswith("stamp") and parent in ("", "header") and message.numbers[i] is not None:
            return i
    return None


def topic_recording(
    path: Path,
    kind: str,
    topics: Iterable[Topic],
    findings: list[Finding],
    metadata: Mapping[str, str],
    messages: Callable[[Report], Iterator[tuple[Topic, int, bytes]]],
) -> Recording:
    """The recording of ``topics`` that have been looked at; ``messages`` gives the topic, time and bytes of each."""
    known, texts = {topic.name: topic.is_stamped for topic in topics}, TextLog()
    groups = tuple(shape.group for topic in topics for shape in topic.shapes.values())
    if not groups:
        raise nothing_to_read(path, findings, "no message with numbers or texts")

    def blocks(report: Report) -> Iterator[Block]:
        met: dict[int, Topic] = {}
        for topic, logged, raw in messages(report):
            if id(topic) not in met:
                met[id(topic)] = topic
                topic.is_stamped = known[topic.name]
            if (block := topic.take(logged, raw, texts)) is not None:
                yield block
        for topic in met.values():
            yield from topic.remaining_blocks(report)

    return Recording(
        path=path,
        format=kind,
        reader="testbench.readers.ros_files",
        groups=groups,
        read=lambda report: watch_nonfinite(blocks(report), report),
        metadata=metadata,
        findings=tuple(findings),
        texts=texts,
    )


def json_message(raw: bytes) -> Message:
    """The numbers and texts of a JSON document, named by their path."""
    message = Message()
    try:
        _walk(json.loads(raw), "", message, 0)
    except (ValueError, RecursionError) as error:
        raise Unreadable(f"no JSON: {error}") from error
    return message


def _walk(value: object, path: str, message: Message, depth: int) -> None:
    if len(message.numbers) > MOST_NUMBERS or depth > 50:
        raise TooManyNumbers(f"{path} has more than {MOST_NUMBERS} values, or is too deep")
    if isinstance(value, bool | int | float):
        message.numbers.append(value)
        message.names.append(path or "value")
    elif isinstance(value, str):
        message.texts[path or "value"] = value
    elif isinstance(value, dict) and (stamp := _stamp(path, value)) is not None:
        message.times.append(len(message.numbers))
        message.numbers.append(stamp or None)
        message.names.append(path)
    elif isinstance(value, dict):
        for key, inner in value.items():
            _walk(inner, f"{path}.{key}" if path else str(key), message, depth + 1)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            _walk(inner, f"{path}[{i}]", message, depth + 1)


def _stamp(path: str, value: dict[str, object]) -> int | None:
    """A point in time as Foxglove and ROS 2 write it in JSON, in nanoseconds since 1970; None if it is none."""
    seconds, rest = value.get("sec"), value.get("nsec", value.get("nanosec"))
    if len(value) != 2 or not path.endswith("stamp") or type(seconds) is not int or type(rest) is not int:
        return None
    return seconds * 1_000_000_000 + rest
