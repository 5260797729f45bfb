"""Reader of MATLAB files, version 5: arrays of one length are a group, single numbers and texts are said beside."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from ...findings import Finding, Refusal
from ...recording import Block, Recording
from ..nonfinite import watched
from ..registry import Reader, ReadOptions
from ..series import Gathering, Series, gather
from ..stream import ByteSource, damaged
from . import arrays
from .content import Content, Spool, Unpacked
from .elements import COMPRESSED, MATRIX, Array, Other, Walk

_HEADER = 128
_MOST_VARIABLES = 100_000


@dataclass
class _Found:
    """What the variables of a file hold."""

    series: list[Series] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    others: list[Other] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)


def open_mat5(path: Path, options: ReadOptions) -> Recording:
    """Walk through all variables; the numbers of their arrays are read when asked for."""
    with ByteSource(path) as source, Spool() as spool:
        found, result = _understood(source, spool)
    if not result.groups:
        finding = next(iter(found.findings), Finding("no_data", None, None, "no array of numbers in it"))
        raise Refusal(path.name, finding)
    left = [f"{other.path} ({other.what})" for other in found.others]
    if left:
        message = f"no series of samples: {', '.join(left[:10])}{' and more' if len(left) > 10 else ''}"
        found.findings.append(Finding("left_out", None, None, message))
    return Recording(
        path=path,
        format="MATLAB v5",
        reader="testbench.readers.mat5",
        groups=tuple(gathered.group for gathered in result.groups),
        read=lambda report: watched(_blocks(path), report),
        metadata=found.metadata,
        stated_rate_hz=result.stated_rate_hz,
        findings=tuple(found.findings),
    )


def _blocks(path: Path) -> Iterator[Block]:
    """The file is walked through again, so that nothing stays open between."""
    with ByteSource(path) as source, Spool() as spool:
        for gathered in _understood(source, spool)[1].groups:
            yield from gathered.blocks()


def _understood(source: ByteSource, spool: Spool) -> tuple[_Found, Gathering]:
    found = _Found()
    order = _order(source)
    found.metadata["header"] = source.read(0, 116, "the header").decode("latin-1").strip(" \0")
    for walk, offset in _variables(source, spool, order, found.findings):
        for each in walk.arrays(offset):
            _take(each, order, found)
    return found, gather(source.path.stem, found.series, found.scalars)


def _order(source: ByteSource) -> str:
    mark = source.read(0, _HEADER, "the header")[126:128]
    if mark not in (b"IM", b"MI"):
        raise damaged(source.path, f"byte order {mark!r} at byte 126; expected IM or MI")
    return "<" if mark == b"IM" else ">"


def _variables(source: ByteSource, spool: Spool, order: str, findings: list[Finding]) -> Iterator[tuple[Walk, int]]:
    """Each variable: what reads it, and where its tag lies. A cut file ends them with a finding."""
    top = Walk(Content(source, 0, source.size), order)
    offset, last = _HEADER, ""
    for _ in range(_MOST_VARIABLES):
        if offset == source.size:
            return
        if offset + 8 > source.size or (element := top.element(offset)).begin + element.count > source.size:
            findings.append(_cut(source, order, offset, last))
            return
        if element.kind == COMPRESSED:
            content: Content = Unpacked(source, element.begin, element.begin + element.count, spool)
            walk, begin = Walk(content, order), 0
            offset = element.begin + element.count
        elif element.kind == MATRIX:
            walk, begin = Walk(Content(source, 0, element.begin + element.count), order), offset
            offset = element.next if element.next <= source.size else source.size
        else:
            raise damaged(source.path, f"byte {offset}: an element of type {element.kind}; expected a variable")
        last = _name(walk, begin) or last
        yield walk, begin
    raise damaged(source.path, f"more than {_MOST_VARIABLES} variables")


def _name(walk: Walk, offset: int) -> str:
    matrix = walk.element(offset)
    if matrix.kind != MATRIX or not matrix.count:
        return ""
    name = walk.element(walk.element(walk.element(matrix.begin).next).next)
    return walk.raw(name).decode("latin-1")


def _cut(source: ByteSource, order: str, offset: int, last: str) -> Finding:
    """That the file ends inside a variable, which one if its name is there, and which is the last whole one."""
    name = ""
    with contextlib.suppress(Refusal):
        name = _name(Walk(Content(source, 0, source.size), order), offset)
    whole = f"the last whole variable is {last!r}" if last else "no variable is whole"
    inside = f"variable {name!r}" if name else "a variable"
    message = f"the file ends at byte {source.size} inside {inside}, which begins at byte {offset}; {whole}"
    return Finding("cut_file", name or None, f"byte {offset}", message)


def _take(each: Array | Other, order: str, found: _Found) -> None:
    """Sort an array: a series of samples, a number, a text, or something else."""
    if isinstance(each, Other):
        if each.path:
            found.others.append(each)
    elif (said := arrays.text(each, order)) is not None:
        found.metadata[each.path] = said
    elif (number := arrays.scalar(each, order)) is not None:
        found.metadata[each.path] = repr(number)
        if isinstance(number, float):
            found.scalars[each.path] = number
    elif not each.size or not each.path:
        return
    elif (series := arrays.series(each, order)) is not None:
        found.series.append(series)
        if arrays.is_beyond_exact(each, series):
            message = "holds integers beyond 2**53, which float64 rounds"
            found.findings.append(Finding("not_exact", each.path, None, message))
    else:
        found.others.append(Other(each.path, f"an array of {' x '.join(map(str, each.dimensions))}"))


READER = Reader(
    name="MATLAB v5",
    extensions=(".mat",),
    identify=lambda head: head.startswith(b"MATLAB 5.0") or (len(head) >= 128 and head[124:128] == b"\x00\x01IM"),
    open=open_mat5,
)
