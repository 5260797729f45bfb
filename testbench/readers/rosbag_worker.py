"""Reading a bag of ROS 1 message by message."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags import rosbag1

from ..recording import Block, Finding, Recording, Report
from .format_findings import cut, damaged, nothing_to_read, refusing, watch_nonfinite
from .ros_messages import RosDecoder, message_fields
from .ros_topics import Message, Topic, UnknownType, Unreadable


def open_library(path: Path) -> Recording:
    """Look at the first message of each topic."""
    with _bag(path) as bag:
        topics, zero = _topics(bag), int(bag.start_time)
        declared = int(bag.message_count)
        findings = []
        for topic, connections in topics:
            _look(path, bag, topic, connections)
            if topic.reason:
                message = f"its messages are not kept: {topic.reason}"
                findings.append(Finding("left_out", topic.name, None, message))
        types = {f"{c.topic}: type": str(c.msgtype) for c in bag.connections}
    groups = [shape.group for topic, _ in topics for shape in topic.shapes.values()]
    if not groups:
        raise nothing_to_read(path, findings, "no message with numbers")
    return Recording(
        path=path,
        format="ROS 1 bag",
        reader="testbench.readers.ros_files",
        groups=tuple(groups),
        read=lambda report: watch_nonfinite(_blocks(path, declared, report), report),
        metadata=types | {"zero": f"{zero} ns since 1970"},
        findings=tuple(findings),
    )


@contextmanager
def _bag(path: Path) -> Iterator[Any]:
    """The bag; one without an index was never closed."""
    try:
        with rosbag1.Reader(path) as bag:
            yield bag
    except rosbag1.ReaderError as error:
        if "not indexed" in str(error):
            message = "its recorder never closed it, so that it has no index; `rosbag reindex` makes one"
            raise cut(path, message) from error
        raise damaged(path, f"rosbags cannot read it: {error}") from error


def _topics(bag: Any) -> list[tuple[Topic, list[Any]]]:  # noqa: ANN401
    """Each topic with its connections; those of one topic and type belong together."""
    gathered: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.connections:
        gathered.setdefault((connection.topic, connection.msgtype), []).append(connection)
    topics: list[tuple[Topic, list[Any]]] = []
    for (name, kind), connections in gathered.items():
        title = name if [n for n, _ in gathered].count(name) == 1 else f"{name} {kind}"
        definition = connections[0].msgdef
        text = str(getattr(definition, "data", definition))
        try:
            fields = message_fields(text, kind, is_ros2=False)
            topic = Topic(title, RosDecoder(fields, is_cdr=False).decode, int(bag.start_time))
        except UnknownType as error:
            topic = Topic(title, lambda raw: Message(), int(bag.start_time), reason=str(error))
        topics.append((topic, connections))
    return topics


def _look(path: Path, bag: Any, topic: Topic, connections: list[Any]) -> None:  # noqa: ANN401
    """The shape of a topic's first message."""
    if topic.reason:
        return
    with refusing(path, f"topic {topic.name!r}", Unreadable):
        for _, _, raw in bag.messages(connections):
            topic.look(raw)
            break


def _blocks(path: Path, declared: int, report: Report) -> Iterator[Block]:
    with _bag(path) as bag:
        topics = _topics(bag)
        of_connection = {c.id: topic for topic, connections in topics for c in connections}
        found = 0
        for connection, logged, raw in bag.messages():
            found += 1
            with refusing(path, f"topic {connection.topic!r}", Unreadable):
                block = of_connection[connection.id].take(int(logged), raw)
            if block is not None:
                yield block
        for topic, _ in topics:
            yield from topic.remaining_blocks(report)
        if found != declared:
            report(Finding("count_contradiction", None, None, f"{declared} messages are indexed, {found} are there"))
