"""Reading ULog, the logs of PX4 autopilots, by pyulog: one group a topic and instance.

pyulog passes over what it cannot read and says little of it; the messages are counted here, so that nothing is lost
unsaid (https://docs.px4.io/main/en/dev_log/ulog_file_format.html).
"""

import json
import struct
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from pyulog import ULog
from pyulog.exceptions import ULogException

from ..recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Refusal,
    Report,
    StartTime,
    TextLog,
    TimeColumn,
    point_in_time,
)
from .byte_source import as_float64, block_spans
from .format_findings import cut, nothing_to_read, refusing, rounded_integers, watch_nonfinite
from .ros_topics import MOST_NUMBERS

_HEADER, _HEAD = 16, struct.Struct("<HB")
"""Bytes of the file's header; head of a message: its length [bytes] and its kind."""
_FLAGS, _APPENDED = ord("B"), struct.Struct("<16x3Q")
_DATA, _TIME, _MICROSECOND = ord("D"), "timestamp", "us"
_UTC = "time_utc_usec"
"""Field of the receivers of satellites: time by the calendar at the message's own time [us]."""
_LONGEST_LIST = 64


def open_library(path: Path) -> Recording:
    """Read the whole log, which pyulog holds in memory."""
    if path.stat().st_size < _HEADER:
        raise cut(path, "the file ends inside its header")
    raw = path.read_bytes()
    with refusing(path, "its messages", ULogException):
        if wide := _too_wide(ULog(_Stream(raw), parse_header_only=True).message_formats):
            message = f"messages {wide} of more than {MOST_NUMBERS} numbers"
            raise Refusal(path.name, Finding("too_large", None, None, message))
        log = ULog(_Stream(raw))
    given = [one for one in log.data_list if any(f.type_str != "char" for f in one.field_data)]
    names, series = Counter(one.name for one in given), dict[str, Any]()
    for one in given:  # with the number of the instance where a topic has several
        title = one.name if names[one.name] == 1 else f"{one.name} {one.multi_id}"
        series[title if title not in series else f"{title} ({one.msg_id})"] = one
    findings = _findings(raw, log, series)
    if not series:
        raise nothing_to_read(path, findings, "no message with numbers")
    start = _start(log)
    groups = {title: _group(title, one, start) for title, one in series.items()}
    texts = TextLog()

    def read(report: Report) -> Iterator[Block]:
        for title, one in series.items():
            yield from _blocks(groups[title], one, texts, report)

    return Recording(
        path=path,
        format="ULog",
        reader="testbench.readers.ulog",
        groups=tuple(groups.values()),
        read=lambda report: watch_nonfinite(read(report), report),
        metadata=_metadata(log, findings),
        findings=tuple(findings),
        texts=texts,
    )


class _Stream(BytesIO):
    """The bytes of a log, read only so often: in some that are damaged pyulog goes back without end."""

    def __init__(self, raw: bytes) -> None:
        super().__init__(raw)
        self._left = 4 * len(raw) + 1000

    def read(self, size: int | None = -1, /) -> bytes:
        """The next bytes. Raises ULogException where more was read than a pass over all messages needs."""
        self._left -= 1
        if self._left < 0:
            raise ULogException("they come to no end")
        return super().read(size)


def _too_wide(formats: dict[str, Any]) -> str:
    """The name of a format of messages of too many numbers, or that holds itself; empty if there is none."""
    widths = dict[str, int]()

    def width(name: str, above: tuple[str, ...]) -> int:
        if name in above or len(above) > _LONGEST_LIST:
            return MOST_NUMBERS + 1
        if name not in widths:
            fields = formats[name].fields if name in formats else []
            widths[name] = sum(
                max(1, count) * (width(kind, (*above, name)) if kind in formats else 1) for kind, count, _ in fields
            )
        return widths[name]

    return next((repr(name) for name in formats if width(name, ()) > MOST_NUMBERS), "")


def _findings(raw: bytes, log: ULog, series: dict[str, Any]) -> list[Finding]:
    """What of the file is not in the log: messages cut or passed over, those that the logger lost, and times."""
    size, whole, end = len(raw), 0, _HEADER
    sections = [size]
    if size >= _HEADER + _HEAD.size + _APPENDED.size and raw[_HEADER + 2] == _FLAGS:
        offsets = _APPENDED.unpack_from(raw, _HEADER + _HEAD.size)
        sections = [*(offset for offset in offsets if _HEADER < offset < size), size]
    for section in sections:
        while end + _HEAD.size <= section:
            length, kind = _HEAD.unpack_from(raw, end)
            if end + _HEAD.size + length > section:
                break
            whole += kind == _DATA
            end += _HEAD.size + length
        last, end = end, section
    found, kept = [], sum(len(one.data[one.field_data[0].field_name]) for one in log.data_list)
    if last != size:
        message = f"the file ends inside the message at byte {last}; {kept} messages before it are whole"
        found.append(Finding("cut_file", None, None, message))
    if log.file_corruption or kept < whole:
        message = f"bytes that are no messages, or that no format describes: {kept} of some {whole} messages are read"
        found.append(Finding("damaged_file", None, None, message))
    for title, one in series.items():
        if repeats := _repeats(one):
            message = f"{repeats} messages have the time of the one before: a channel, and no clock"
            found.append(Finding("time_coarse", _TIME, None, message, title))
    if log.dropouts:
        lost = [one.duration for one in log.dropouts]
        longest = log.dropouts[lost.index(max(lost))]
        message = (
            f"the logger states {len(lost)} dropouts, {sum(lost) / 1e3:g} s in all, the longest of {max(lost) / 1e3:g} "
            f"s behind {longest.timestamp} us: messages are missing there"
        )
        found.append(Finding("time_gap", None, None, message))
    return found


def _start(log: ULog) -> StartTime | None:
    """When the clock of the log was zero, by the first message of a receiver of satellites that has the time."""
    for one in log.data_list:
        if _UTC in one.data and _TIME in one.data:
            utc, own = one.data[_UTC].astype(object), one.data[_TIME].astype(object)
            known = next((i for i, value in enumerate(utc) if value > own[i]), None)
            if known is not None:
                return point_in_time(1000 * (int(utc[known]) - int(own[known])), f"{_UTC} of {one.name}", 1e-6)
    return None


def _repeats(one: Any) -> int:  # noqa: ANN401
    """How many messages of a topic have the time of the one before, as events have; 0 where time falls."""
    steps = np.diff(one.data[_TIME].astype(np.int64)) if _TIME in one.data else np.empty(0)
    return 0 if (steps < 0).any() else int((steps == 0).sum())


def _group(title: str, one: Any, start: StartTime | None) -> Group:  # noqa: ANN401
    names = [field.field_name for field in one.field_data if field.type_str != "char"]
    channels = tuple(Channel(name, _MICROSECOND if name == _TIME else None) for name in names)
    is_clock = _TIME in names and one.data[_TIME].any() and not _repeats(one)
    clock = TimeColumn(names.index(_TIME), 1e-6) if is_clock else None
    return Group(title, channels, clock, start if clock else None)


def _blocks(group: Group, one: Any, texts: TextLog, report: Report) -> Iterator[Block]:  # noqa: ANN401
    """The messages of one topic; letters of one array are a text."""
    numbers = [field.field_name for field in one.field_data if field.type_str != "char"]
    letters = dict[str, list[str]]()
    for field in one.field_data:
        if field.type_str == "char":
            letters.setdefault(field.field_name.partition("[")[0], []).append(field.field_name)
    columns = [one.data[name] for name in numbers]
    for begin, end in block_spans(len(columns[0]), len(columns)):
        for name, parts in letters.items():
            rows = np.stack([one.data[part][begin:end] for part in parts], axis=1).view(np.uint8)
            words = (row.tobytes().partition(b"\0")[0].decode("utf-8", "replace") for row in rows)
            texts.take_all(group.name, name, begin, words)
        yield Block(group, tuple(as_float64(column[begin:end]) for column in columns), begin)
    for name, column in zip(numbers, columns, strict=True):
        if column.dtype.itemsize == 8 and column.dtype.kind in "iu":
            exact = np.all((column < 1 << 53) & (column > -(1 << 53) if column.dtype.kind == "i" else True))
            if not exact:
                report(rounded_integers(name))


def _metadata(log: ULog, findings: list[Finding]) -> dict[str, str]:
    """What the log says of itself, its parameters, and what was said while it ran."""
    found = dict[str, str]()
    single = [(key, [[value]], "\0") for key, value in log.msg_info_dict.items()]
    for key, lists, padding in (*single, *((key, lists, "") for key, lists in log.msg_info_multiple_dict.items())):
        parts = [part for parts in lists for part in parts]
        if any(isinstance(part, bytes) for part in parts):
            message = f"{sum(map(len, parts))} bytes of information of another kind than text and numbers"
            findings.append(Finding("left_out", key, None, message))
        else:
            found[key] = "\n".join("".join(map(str, parts)).rstrip(padding) for parts in lists)
    if log.initial_parameters:
        found["parameters"] = json.dumps(log.initial_parameters, default=str)
    for time, name, value in log.changed_parameters:
        found[f"parameter {name} from {time} us on"] = str(value)
    tagged = [message for messages in log.logged_messages_tagged.values() for message in messages]
    said = sorted([*log.logged_messages, *tagged], key=lambda message: message.timestamp)
    for i, message in enumerate(said, 1):
        found[f"message {i}"] = f"{message.timestamp} us, {message.log_level_str()}: {message.message}"
    return found
