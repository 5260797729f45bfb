"""Reading bags of ROS message by message: those of ROS 1, and those of ROS 2 in SQLite in the order of logging.

Newer bags of ROS 2 describe their types; of older ones, types of the usual packages are described by rosbags.
"""

import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags import rosbag1
from rosbags.typesys import Stores, TypesysError, get_typestore

from ..recording import Finding, Recording, Refusal, Report
from .format_findings import cut, damaged
from .ros_messages import RosDecoder, message_fields
from .ros_topics import Decode, Topic, UnknownType, left_out, topic_recording

_MAGIC = b"SQLite format 3\0"
_PAGE_SIZE, _PAGES = slice(16, 18), slice(28, 32)
"""Where the header of SQLite states the size of a page and their number (https://www.sqlite.org/fileformat.html)."""
_SMALLEST_PAGE = 512  # a size of 1 stands for 65536


def open_ros1(path: Path) -> Recording:
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
        text = str(getattr(connections[0].msgdef, "data", connections[0].msgdef))
        decoder = partial(_decoder, text, kind, is_ros2=False)
        topics.append((Topic.of(path, title, decoder, int(bag.start_time)), connections))
    return topics


def _messages(path: Path, report: Report) -> Iterator[tuple[Topic, int, bytes]]:
    with _bag(path) as bag:
        of_connection = {c.id: topic for topic, connections in _topics(path, bag) for c in connections}
        declared, found = int(bag.message_count), 0
        for connection, logged, raw in bag.messages():
            found += 1
            yield of_connection[connection.id], int(logged), raw
        if found != declared:
            report(Finding("count_contradiction", None, None, f"{declared} messages are indexed, {found} are there"))


def open_ros2(path: Path) -> Recording:
    """Look at the first messages of each topic."""
    lost = _lost(path)
    metadata = dict[str, str]()
    topics = dict[int, Topic]()
    for topic, logged, raw in _rows(path, metadata, topics):
        metadata.setdefault("zero", f"{logged} ns since 1970")
        topic.look(raw)
        if all(topic.is_known for topic in topics.values()):
            break
    findings = [*lost, *left_out(topics.values())]
    return topic_recording(path, "ROS 2 bag", topics.values(), findings, metadata, lambda report: _rows(path, {}, {}))


def _lost(path: Path) -> list[Finding]:
    """That the bag is cut. Raises Refusal if messages of it are in another file, or it is no database."""
    page, stated, there = _pages(path)
    beside = path.with_name(f"{path.name}-wal")
    if beside.is_file() and beside.stat().st_size:
        advice = f"`sqlite3 {path.name} vacuum` puts them there"
        raise cut(path, f"its recorder was stopped before it put the messages of {beside.name} into the bag; {advice}")
    if there >= stated:
        return []
    message = (
        f"the file ends at byte {path.stat().st_size}, its header says at {stated * page}; messages that are whole are "
        f"read; `sqlite3 {path.name} .recover | sqlite3 rest.db3` may save more"
    )
    return [Finding("cut_file", None, None, message)]


def _pages(path: Path) -> tuple[int, int, int]:
    """The size of a page [bytes], how many the header states, and how many are there whole."""
    with path.open("rb") as stream:
        head = stream.read(_PAGES.stop)
    if not head.startswith(_MAGIC):
        raise damaged(path, "it does not begin as an SQLite database does")
    page = int.from_bytes(head[_PAGE_SIZE], "big")
    page = page if page >= _SMALLEST_PAGE else 1 << 16
    return page, int.from_bytes(head[_PAGES], "big"), path.stat().st_size // page


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """The database, in which nothing is written and nothing of what it states is run.

    One that is cut is in memory, where its header states no more pages than there are: SQLite would read zeros.
    """
    page, stated, there = _pages(path)
    place = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(place if there >= stated else ":memory:", uri=there >= stated)) as database:
        if there < stated:
            content = bytearray(path.read_bytes()[: there * page])
            content[_PAGES] = there.to_bytes(4, "big")
            database.deserialize(content)
            database.execute("PRAGMA writable_schema = ON")  # of the copy: tables are read where an index is lost
        database.execute("PRAGMA trusted_schema = OFF")
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            message = "the content is an SQLite database, and no bag of ROS 2"
            raise Refusal(path.name, Finding("other_format", None, None, message))
        yield database


def _rows(path: Path, metadata: dict[str, str], topics: dict[int, Topic]) -> Iterator[tuple[Topic, int, bytes]]:
    """Every message with its topic and time of logging; ``metadata`` and ``topics`` are filled before."""
    zero = None
    try:
        with _database(path) as database:
            kinds = {n: list(map(str, row)) for n, *row in database.execute("SELECT id, name, type, "
                     "serialization_format FROM topics")}  # fmt: skip
            texts = _described(database)
            names = Counter(name for name, *_ in kinds.values())
            for number, (name, kind, form) in kinds.items():
                metadata[f"{name}: type"] = kind
                title = name if names[name] == 1 else f"{name} {number}"
                topics[number] = Topic.of(path, title, partial(_ros2_decoder, texts, kind, form))
            for number, logged, raw in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                if number not in topics or not isinstance(raw, bytes) or not isinstance(logged, int):
                    raise damaged(path, f"a message of topic {number!r} at {logged!r}, which is none")
                zero = logged if zero is None else zero
                topics[number].zero = zero
                yield topics[number], logged, raw
    except sqlite3.Error as error:
        if not _lost(path):  # of one that is cut the rest
            raise damaged(path, f"SQLite cannot read it: {error}") from error


def _described(database: sqlite3.Connection) -> dict[str, str]:
    """The descriptions of types that the bag brings, by their names."""
    try:
        rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        return {str(kind): str(text) for kind, encoding, text in rows if encoding == "ros2msg" and text}
    except sqlite3.OperationalError:  # bags before the release of 2023 have none
        return {}


def _ros2_decoder(texts: dict[str, str], kind: str, form: str) -> Decode:
    if form != "cdr":
        raise UnknownType(f"messages are encoded as {form!r}")
    if (text := texts.get(kind)) is None:
        try:
            text, _ = get_typestore(Stores.LATEST).generate_msgdef(kind, ros_version=2)
        except (KeyError, TypesysError) as error:
            message = f"neither the bag nor rosbags describes {kind!r}: convert it by `ros2 bag convert` to MCAP"
            raise UnknownType(message) from error
    return _decoder(text, kind, is_ros2=True)


def _decoder(text: str, kind: str, is_ros2: bool) -> Decode:
    return RosDecoder(message_fields(text, kind, is_ros2), is_cdr=is_ros2).decode
