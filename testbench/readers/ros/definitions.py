"""The text that describes a message, as a tree of fields."""

import re
from dataclasses import dataclass

PRIMITIVES = {
    "bool": "?", "byte": "b", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
TEXTS = ("string", "wstring")
TIME, DURATION = "time", "duration"
_TIMES = {"builtin_interfaces/Time": TIME, "builtin_interfaces/Duration": DURATION}
_HEADER = "uint32 seq\ntime stamp\nstring frame_id"
_HEADER_2 = "builtin_interfaces/Time stamp\nstring frame_id"
_FIELD = re.compile(r"([A-Za-z][\w/]*)(<=\d+)?(?:\[(<=)?(\d*)\])?\s+([A-Za-z]\w*)(?:\s+[^=\s].*)?")
_PART = re.compile(r"^={20,}\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)
_DEEPEST, _LONGEST, _MOST_FIELDS = 20, 1 << 20, 10_000


class Unclear(Exception):
    """A description that cannot be understood; the text says why."""


@dataclass(frozen=True)
class Field:
    """A field: its type (a primitive, a text, a time, or fields of its own), and how many of it.

    ``count`` is 1 for one value, the length of an array, or -1 for an array that brings its length.
    """

    name: str
    kind: "str | tuple[Field, ...]"
    count: int = 1
    is_array: bool = False


def parse(text: str, name: str, is_ros2: bool) -> tuple[Field, ...]:
    """The fields of the message ``name`` that ``text`` describes, with what it contains below lines of ``=``."""
    if len(text) > _LONGEST:
        raise Unclear(f"a description of {len(text)} letters")
    pieces = _PART.split(text.replace("\r\n", "\n"))
    texts = {"std_msgs/Header": _HEADER_2 if is_ros2 else _HEADER, _short(name): pieces[0]}
    texts |= {_short(title): body for title, body in zip(pieces[1::2], pieces[2::2], strict=True)}
    return _fields(_short(name), texts, 0, [0])


def _short(name: str) -> str:
    """``pkg/msg/Type`` as ``pkg/Type``."""
    parts = [part for part in name.split("/") if part != "msg"]
    return "/".join(parts)


def _fields(name: str, texts: dict[str, str], depth: int, seen: list[int]) -> tuple[Field, ...]:
    if depth > _DEEPEST:
        raise Unclear(f"messages nested more than {_DEEPEST} deep")
    found = []
    for line in texts[name].split("\n"):
        plain = line.split("#")[0].strip()
        if not plain or re.match(r"[A-Za-z][\w/<=]*\s+\w+\s*=", plain):  # a constant takes no bytes
            continue
        match = _FIELD.fullmatch(plain)
        seen[0] += 1
        if match is None or seen[0] > _MOST_FIELDS:
            raise Unclear(f"{name}: {plain[:80]!r} is no field")
        kind, _, _, length, label = match.groups()
        is_array = "[" in plain.split()[0]
        count = int(length) if is_array and length and "<=" not in match[0].split("[")[1] else -1 if is_array else 1
        found.append(Field(label, _kind(kind, name, texts, depth, seen), count, is_array))
    return tuple(found)


def _kind(kind: str, inside: str, texts: dict[str, str], depth: int, seen: list[int]) -> str | tuple[Field, ...]:
    if kind in PRIMITIVES or kind in TEXTS or kind in (TIME, DURATION):
        return kind
    package = inside.rpartition("/")[0]
    for name in (_short(kind), f"{package}/{kind}", f"std_msgs/{kind}"):
        if name in _TIMES:
            return _TIMES[name]
        if name in texts:
            return _fields(name, texts, depth + 1, seen)
    raise Unclear(f"{inside}: the type {kind!r} is described nowhere")
