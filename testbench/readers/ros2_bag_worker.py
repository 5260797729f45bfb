"""Reading a bag of ROS 2 in SQLite message by message, in the order in which they were logged.

Newer bags describe their types; of older ones, types of the usual packages are described by rosbags.
"""

import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from urllib.parse import quote

from rosbags.typesys import Stores, TypesysError, get_typestore

from ..recording import Finding, Recording, Refusal, Report
from .format_findings import cut, damaged
from .ros_messages import RosDecoder, message_fields
from .ros_topics import Decode, Topic, UnknownType, left_out, topic_recording

_MAGIC = b"SQLite format 3\0"
_PAGE_SIZE, _PAGES = slice(16, 18), slice(28, 32)
"""Where the header of SQLite states the size of a page and their number (https://www.sqlite.org/fileformat.html)."""
_SMALLEST_PAGE = 512  # a size of 1 stands for 65536


def open_library(path: Path) -> Recording:
    """Look at the first messages of each topic."""
    lost = _lost(path)
    metadata = dict[str, str]()
    topics = dict[int, Topic]()
    for number, logged, raw in _rows(path, metadata, topics):
        metadata.setdefault("zero", f"{logged} ns since 1970")
        topics[number].look(raw)
        if all(topic.is_known for topic in topics.values()):
            break

    def messages(report: Report) -> Iterator[tuple[Topic, int, bytes]]:
        anew = dict[int, Topic]()
        for number, logged, raw in _rows(path, {}, anew):
            yield anew[number], logged, raw

    return topic_recording(path, "ROS 2 bag", topics.values(), [*lost, *left_out(topics.values())], metadata, messages)


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


def _rows(path: Path, metadata: dict[str, str], topics: dict[int, Topic]) -> Iterator[tuple[int, int, bytes]]:
    """Every message: number of its topic, time of logging, bytes; ``metadata`` and ``topics`` are filled before."""
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
                topics[number] = Topic.of(path, title, partial(_decoder, texts, kind, form))
            for number, logged, raw in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                if number not in topics or not isinstance(raw, bytes) or not isinstance(logged, int):
                    raise damaged(path, f"a message of topic {number!r} at {logged!r}, which is none")
                zero = logged if zero is None else zero
                topics[number].zero = zero
                yield number, logged, raw
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


def _decoder(texts: dict[str, str], kind: str, form: str) -> Decode:
    if form != "cdr":
        raise UnknownType(f"messages are encoded as {form!r}")
    if (text := texts.get(kind)) is None:
        try:
            text, _ = get_typestore(Stores.LATEST).generate_msgdef(kind, ros_version=2)
        except (KeyError, TypesysError) as error:
            message = f"neither the bag nor rosbags describes {kind!r}: convert it by `ros2 bag convert` to MCAP"
            raise UnknownType(message) from error
    return RosDecoder(message_fields(text, kind, is_ros2=True), is_cdr=True).decode
