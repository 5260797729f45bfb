"""Where the headers of an LVM file lie, found in one fast pass; all other lines are rows of data."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..csv.text_blocks import Encoding, read_blocks
from ..stream import damaged

END = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_LETTERS = np.frombuffer(b"*ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz", dtype=np.uint8)
_NUMBER_WORD = re.compile(r"(?:nan|inf)", re.IGNORECASE)
_MOST_HEADER_LINES = 200_000


@dataclass(frozen=True)
class Head:
    """The lines of one header, and the file's lines (from 1) of the data below it: ``first`` to before ``end``."""

    lines: tuple[str, ...]
    first: int
    end: int


def heads(path: Path, encoding: Encoding) -> list[Head]:
    """The header of the file, then that of each segment with the lines of its data."""
    words, total = _lines_of_words(path, encoding)
    found: list[Head] = []
    begin = 0
    for i, (number, text) in enumerate(words):
        names_follow = i + 1 < len(words) and words[i + 1][0] == number + 1 and words[i + 1][1].startswith("X_Value")
        if not text.startswith(END):
            continue
        last = i + 2 if names_follow else i + 1
        end = words[last][0] if last < len(words) else total + 1
        found.append(Head(tuple(t for _, t in words[begin:last]), words[last - 1][0] + 1, end))
        begin = last
    if not found:
        raise damaged(path, f"no {END} in it; expected one below the header")
    return found


def _lines_of_words(path: Path, encoding: Encoding) -> tuple[list[tuple[int, str]], int]:
    """The lines that begin with a letter or a star, special blocks left out; and how many lines there are."""
    words: list[tuple[int, str]] = []
    total, skipping = 0, False
    for number, raw in _candidates(path, encoding):
        total = number
        text = raw.decode("latin-1" if not encoding.keeps_ascii else encoding.name, "replace").rstrip("\r\n")
        if text.startswith(_SPECIAL):
            skipping = text.startswith(_SPECIAL[0])
        elif text and not skipping and not _NUMBER_WORD.match(text):
            words.append((number, text))
        if len(words) > _MOST_HEADER_LINES:
            raise damaged(path, f"more than {_MOST_HEADER_LINES} lines of header; this is no LVM file")
    return words, total


def _candidates(path: Path, encoding: Encoding) -> Iterator[tuple[int, bytes]]:
    """Lines that begin with a letter or a star with their number; at last an empty one with the last number."""
    number = 0
    for lines in read_blocks(path, encoding, 1):
        text = lines.text + lines.rest
        data = np.frombuffer(text, dtype=np.uint8)
        ends = np.flatnonzero(data == ord("\n")) + 1
        starts = np.concatenate(([0], ends))[: len(ends) + bool(lines.rest)]
        for i in np.flatnonzero(np.isin(data[starts], _LETTERS)):
            yield lines.first + int(i), text[starts[i] : ends[i] if i < len(ends) else len(text)]
        number = lines.first + len(starts) - 1
    yield number, b""
