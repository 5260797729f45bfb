"""Reading a bag of ROS 1 message by message."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rosbags import rosbag1

from ..recording import Finding, Recording, Report
from .format_findings import cut, damaged
from .ros_messages import RosDecoder, message_fields
from .ros_topics import Decode, Topic, left_out, topic_recording


def open_library(path: Path) -> Recording:
    """Look at the first messages of each topic."""
    with _bag(path) as bag:
        topics = _topics(path, bag)
        metadata = {f"{c.topic}: type": str(c.msgtype) for c in bag.connections}
        metadata["zero"] = f"{int(bag.start_time)} ns since 1970"
        for topic, connections in topics:
            for _, _, raw in () if topic.reason else bag.messages(connections):
                topic.look(raw)
                if topic.is_known:
                    break
    known = [topic for topic, _ in topics]
    return topic_recording(path, "ROS 1 bag", known, left_out(known), metadata, lambda report: _messages(path, report))


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


def _topics(path: Path, bag: Any) -> list[tuple[Topic, list[Any]]]:  # noqa: ANN401
    """Each topic with its connections; those of one topic and type belong together."""
    gathered: dict[tuple[str, str], list[Any]] = {}
    for connection in bag.connections:
        gathered.setdefault((connection.topic, connection.msgtype), []).append(connection)
    names = Counter(name for name, _ in gathered)
    topics = []
    for (name, kind), connections in gathered.items():
        title = name if names[name] == 1 else f"{name} {kind}"
        decoder = partial(_decoder, connections[0], kind)
        topics.append((Topic.of(path, title, decoder, int(bag.start_time)), connections))
    return topics


def _decoder(connection: Any, kind: str) -> Decode:  # noqa: ANN401
    text = str(getattr(connection.msgdef, "data", connection.msgdef))
    return RosDecoder(message_fields(text, kind, is_ros2=False), is_cdr=False).decode


def _messages(path: Path, report: Report) -> Iterator[tuple[Topic, int, bytes]]:
    """Every message with its topic and time of logging."""
    with _bag(path) as bag:
        of_connection = {c.id: topic for topic, connections in _topics(path, bag) for c in connections}
        declared, found = int(bag.message_count), 0
        for connection, logged, raw in bag.messages():
            found += 1
            yield of_connection[connection.id], int(logged), raw
        if found != declared:
            report(Finding("count_contradiction", None, None, f"{declared} messages are indexed, {found} are there"))
