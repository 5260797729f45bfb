"""Where the datasets of a universal file lie: each between two lines ``-1``."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from ..stream import ByteSource, damaged

_DELIMITER = re.compile(rb"[ \t]*-1[ \t]*\r?\n?")
_END = re.compile(rb"(?:\A|(?<=\n))[ \t]*-1[ \t]*(?:\r?\n|\r?\Z)")
_KIND = re.compile(rb"[ \t]*(\d{1,6})([bB]?)([^\r\n]*)\r?\n")
_PIECE = 1 << 20
_LONGEST_LINE = 4096
_MOST = 1_000_000


@dataclass(frozen=True)
class Binary:
    """How the numbers of a binary function lie: byte order and sizes of abscissa (0: none) and number [bytes].

    ``agrees`` is false where the header declares another number of bytes than follow.
    """

    order: str
    abscissa: int
    number: int
    agrees: bool = True


@dataclass(frozen=True)
class Dataset:
    """One dataset: its number, the file's bytes of its content, and how a binary one is laid out.

    ``whole`` is false for a dataset without its closing line: the file ends inside it.
    """

    kind: int
    binary: Binary | None
    begin: int
    end: int
    whole: bool = True


def line_at(source: ByteSource, offset: int) -> bytes:
    """The line from ``offset`` on, with its end."""
    data = source.read(offset, min(_LONGEST_LINE, source.size - offset), "a line")
    end = data.find(b"\n") + 1
    return data[:end] if end else data


def datasets(source: ByteSource) -> Iterator[Dataset]:
    """All datasets in turn; at last one that is not whole, if the file is cut."""
    offset = 0
    for _ in range(_MOST):
        while offset < source.size and not (line := line_at(source, offset)).strip():
            offset += len(line)
        if offset >= source.size:
            return
        if not _DELIMITER.fullmatch(line):
            raise damaged(source.path, f"byte {offset}: {line[:40]!r}; expected a line '-1' before the next dataset")
        offset += len(line)
        kind = _KIND.fullmatch(line_at(source, offset)) if offset < source.size else None
        if kind is None:
            if offset >= source.size or not line_at(source, offset).endswith(b"\n"):
                yield Dataset(0, None, offset, source.size, False)
                return
            raise damaged(source.path, f"byte {offset}: {line_at(source, offset)[:40]!r} is no number of a dataset")
        found = _dataset(source, kind, offset + kind.end())
        yield found
        if not found.whole:
            return
        offset = found.end + len(line_at(source, found.end))
    raise damaged(source.path, f"more than {_MOST} datasets")


def _dataset(source: ByteSource, kind: re.Match[bytes], begin: int) -> Dataset:
    number = int(kind[1])
    if not kind[2]:
        end = _end(source, begin)
        return Dataset(number, None, begin, source.size if end is None else end, end is not None)
    try:
        order, form, lines, declared = (int(text) for text in kind[3].split()[:4])
        heads, data = _lines(source, begin, min(lines, 100))
        if len(heads) < lines:
            return Dataset(number, Binary("<", 0, 4), begin, source.size, False)
        layouts = _layouts(heads[6].split()) if number == 58 else {}
    except (ValueError, IndexError) as error:
        raise damaged(source.path, f"byte {begin}: header of dataset {number}b cannot be read ({error})") from error
    if number == 58 and (order not in (1, 2) or form != 2):
        message = f"byte order {order} and floating-point format {form}; expected 1 or 2, and 2 (IEEE 754)"
        raise damaged(source.path, f"dataset 58b at byte {begin}: {message}")
    return _closed(source, number, begin, data, declared, "<" if order == 1 else ">", layouts)


def _lines(source: ByteSource, offset: int, count: int) -> tuple[list[bytes], int]:
    """``count`` lines, fewer if the file ends; and where they end."""
    lines: list[bytes] = []
    while len(lines) < count and offset < source.size:
        lines.append(line_at(source, offset))
        offset += len(lines[-1])
    return lines, offset


def _layouts(form: list[bytes]) -> dict[tuple[int, int], int]:
    """Bytes that the data take, by the sizes of abscissa and number; the standard's layout first.

    The standard has abscissae of single precision; there are programs that write doubles whatever they declare.
    """
    kind, count, uneven = int(form[0]), int(form[1]), int(form[2]) == 0
    numbers = 2 if kind in (5, 6) else 1
    sizes = [(4, 8), (8, 8)] if kind in (4, 6) else [(4, 4), (4, 8), (8, 8)]
    return {(x * uneven, size): count * (x * uneven + numbers * size) for x, size in sizes}


def _closed(
    source: ByteSource,
    number: int,
    begin: int,
    data: int,
    declared: int,
    order: str,
    layouts: dict[tuple[int, int], int],
) -> Dataset:
    """The binary dataset whose end is where a closing line follows."""
    fitting = [(sizes, count) for sizes, count in layouts.items() if count == declared]
    others = [(sizes, count) for sizes, count in layouts.items() if count != declared]
    for (x, size), count in [*fitting, *others] if number == 58 else [((0, 0), declared)]:
        end = data + count
        if (closing := _closing(source, end)) is not None:
            return Dataset(number, Binary(order, x, size, count == declared), begin, closing)
    if data + declared >= source.size:
        return Dataset(number, Binary(order, 0, 4), begin, source.size, False)
    message = f"{declared} bytes of data are declared, but no '-1' follows them"
    if layouts and declared not in layouts.values():
        message += f"; its samples take {next(iter(layouts.values()))} bytes"
    raise damaged(source.path, f"dataset {number}b at byte {begin}: {message}")


def _closing(source: ByteSource, end: int) -> int | None:
    """Where the closing line is if one lies at ``end``; some writers put a line feed before it."""
    if end >= source.size:
        return None
    line = line_at(source, end)
    if not line.strip() and end + len(line) < source.size:
        end += len(line)
        line = line_at(source, end)
    return end if _DELIMITER.fullmatch(line) else None


def _end(source: ByteSource, begin: int) -> int | None:
    """Where the closing line of a text dataset begins; None if there is none."""
    offset, keep = begin, b""
    while offset < source.size:
        piece = keep + source.read(offset, min(_PIECE, source.size - offset), "a dataset")
        start = offset - len(keep)
        offset += len(piece) - len(keep)
        last = offset >= source.size
        whole = piece if last else piece[: piece.rfind(b"\n") + 1]
        if (match := _END.search(whole)) is not None:
            return start + match.start()
        keep = piece[len(whole) :]
        if len(keep) > _PIECE:
            raise damaged(source.path, f"byte {start}: a line longer than any in a universal file")
    return None
