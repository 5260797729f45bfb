"""What every reader must keep, built-in or from another package; to be called from the tests of either."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from balance.errors import CounterpoiseError

from ..recording import MEANING, ContentDigest, Group, Recording, TimeColumn
from .registry import HEAD_BYTES, Reader, ReadOptions, find_reader

_HEADS = (b"", b"\0" * 64, b"\xff" * HEAD_BYTES, b"a,b\n1,2\n", bytes(range(256)) * 16)


def violations(reader: Reader, example: Path | None = None) -> list[str]:
    """Where ``reader`` does not keep the contract, tested by itself and by reading ``example``; empty if it does."""
    found = list(_of_reader(reader))
    if example is not None:
        found += _of_file(reader, example)
        found += _of_damage(reader, example)
    return found


def _of_reader(reader: Reader) -> Iterator[str]:
    """Its name and extensions; that it identifies any bytes without an error."""
    if not reader.name.strip():
        yield "it has no name"
    for extension in reader.extensions:
        if not extension.startswith(".") or extension != extension.lower():
            yield f"extension {extension!r}: expected a point and lower case, such as .csv"
    for head in _HEADS:
        try:
            answer: object = reader.identify(head)
        except Exception as error:
            yield f"identify fails with {error!r} on {len(head)} bytes"
        else:
            if not isinstance(answer, bool):
                yield f"identify gives {answer!r}; expected True or False"


def _of_file(reader: Reader, example: Path) -> Iterator[str]:
    """The header, the blocks, and that reading again gives the same."""
    if find_reader(example).name != reader.name:
        yield f"{example.name} is read by {find_reader(example).name!r}: identify does not know its content"
    recording = reader.open(example, ReadOptions())
    names = [group.name for group in recording.groups]
    if not names:
        yield "the recording has no group"
    if len(set(names)) != len(names):
        yield f"groups of one name: {names}"
    for group in recording.groups:
        yield from _of_group(group)
    if not recording.format or not recording.reader:
        yield "format or reader is empty"
    digests = []
    for _ in range(2):
        digest = hashlib.sha256()
        yield from dict.fromkeys(_of_blocks(reader.open(example, ReadOptions()), digest))
        digests.append(digest.hexdigest())
    if digests[0] != digests[1]:
        yield "reading it twice gives different numbers"


def _of_group(group: Group) -> Iterator[str]:
    if not group.channels or not group.name:
        yield f"group {group.name!r} has no name or no channel"
    for channel in group.channels:
        if not channel.name or channel.unit == "":
            yield f"group {group.name!r}: channel {channel.name!r} of unit {channel.unit!r}; a missing unit is None"
        if "\0" in channel.name + (channel.unit or ""):
            yield f"group {group.name!r}: NUL in the name or unit of channel {channel.name!r}"
    if isinstance(group.clock, TimeColumn) and not 0 <= group.clock.index < len(group.channels):
        yield f"group {group.name!r}: its time is channel {group.clock.index} of {len(group.channels)}"


def _of_blocks(recording: Recording, digest: "hashlib._Hash") -> Iterator[str]:
    """Blocks that follow one another, of equal columns of float64; findings, in the header and on the way, are known.

    Where the reader gives a digest of all bytes that it read, that is the file's.
    """
    content = recording.content or ContentDigest()
    content.wanted = True
    findings, done = [*recording.findings], Counter[str]()
    for block in recording.blocks(findings.append):
        group, name = block.group, block.group.name
        if len(block.columns) != len(group.channels):
            yield f"group {name!r}: {len(block.columns)} columns for {len(group.channels)} channels"
        if any(c.dtype != np.float64 or c.ndim != 1 or len(c) != len(block) for c in block.columns) or not len(block):
            yield f"group {name!r}: columns are not float64 of one length that is not zero"
        if block.start != done[name]:
            yield f"group {name!r}: a block begins at sample {block.start}, expected {done[name]}"
        done[name] += len(block)
        digest.update(name.encode("utf-8", "replace"))
        for column in block.columns:
            digest.update(np.ascontiguousarray(column).tobytes())
        if group not in recording.groups:
            yield from _of_group(group)
    if recording.content is not None and content.sha256 != hashlib.sha256(recording.path.read_bytes()).hexdigest():
        yield "the digest of what it read is not that of the file"
    for finding in findings:
        if finding.code not in MEANING:
            yield f"finding {finding.code!r} is no code of testbench.recording"
        if not finding.message:
            yield f"finding {finding.code!r} has no message"
    for group in recording.groups:
        if not done[group.name]:
            yield f"group {group.name!r} is announced and has no sample"


def _of_damage(reader: Reader, example: Path) -> Iterator[str]:
    """Cut, emptied and overwritten copies end in an error that says so, or in a recording, and never otherwise."""
    whole = example.read_bytes()
    half = len(whole) // 2
    copies = {
        "cut to its first bytes": whole[:40],
        "cut in half": whole[:half],
        "cut by one byte": whole[:-1],
        "zeroed in its middle": whole[: half // 2] + bytes(half) + whole[half // 2 + half :],
        "followed by zeros": whole + bytes(1000),
        "followed by itself": whole + whole,
        "with its halves exchanged": whole[half:] + whole[:half],
        "with a piece from elsewhere": whole[:half] + whole[half // 3 : half // 3 + 100] + whole[half:],
        "behind a byte order mark": b"\xff\xfe" + whole,
        "with a line without end": whole[:half] + b"7" * (1 << 20) + whole[half:],
    }
    copy = example.with_name(f"damaged{example.suffix}")
    for how, content in copies.items():
        copy.write_bytes(content)
        try:
            for _ in reader.open(copy, ReadOptions()).blocks(lambda finding: None):
                pass
        except CounterpoiseError:
            continue
        except Exception as error:
            yield f"{how}: {error!r}; expected a CounterpoiseError"
        finally:
            copy.unlink()
