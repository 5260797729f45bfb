"""Universal files (UFF, ``.unv``): datasets 58 and 58b, functions at nodes, and 55, data at nodes.

A dataset lies between two lines ``-1``. Functions of one kind, abscissa and time of measurement are channels of one
group; their numbers are text or binary, evenly spaced or each with its abscissa, read in pieces. Dataset 55, such as a
mode shape, is a group with one row a node. Writers that declare another number of bytes than they wrote are read by
the layout after which a closing line follows. Source: SDRC, Universal File Formats (https://www.ceas3.uc.edu/sdrluff).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..recording import Block, Channel, Finding, Group, Recording, Samples, StartTime
from . import header_claims
from .byte_source import ByteSource, as_float64, block_samples, decoded
from .format_findings import damaged, nothing_to_read, refusing, watch_nonfinite
from .header_claims import clock_of_step, recorded_time, start_at
from .registry import ReadOptions

_DELIMITER = re.compile(rb"[ \t]*-1[ \t]*\r?\n?")
_END = re.compile(rb"(?:\A|(?<=\n))[ \t]*-1[ \t]*(?:\r?\n|\r?\Z)")
_KIND = re.compile(rb"[ \t]*(\d{1,6})([bB]?)([^\r\n]*)\r?\n")
_DATE = re.compile(r"(\d{1,2})-([A-Za-z]{3})-(\d{2}|\d{4})(?:\s+(\d\d:\d\d:\d\d))?")
_FIRST_YEAR = 70
"""Years of two digits from here on are of the last century."""
_PIECE = _TEXT_BYTES = 1 << 20
_LONGEST_LINE = 4096
_MOST = 1_000_000


@dataclass(frozen=True)
class Dataset:
    """One dataset: its number and the file's bytes of its content.

    ``rows`` is how a sample of a binary function lies, ``agrees`` false where the header declares another number of
    bytes than follow. ``whole`` is false without the closing line: the file ends inside the dataset.
    """

    kind: int
    begin: int
    end: int
    whole: bool = True
    rows: np.dtype[Any] | None = None
    agrees: bool = True


def _line_at(source: ByteSource, offset: int) -> bytes:
    """The line from ``offset`` on, with its end."""
    data = source.read(offset, min(_LONGEST_LINE, source.size - offset), "a line")
    end = data.find(b"\n") + 1
    return data[:end] if end else data


def _lines(source: ByteSource, offset: int, count: int) -> tuple[list[bytes], int]:
    """``count`` lines, fewer if the file ends; and where they end."""
    lines: list[bytes] = []
    while len(lines) < count and offset < source.size:
        lines.append(_line_at(source, offset))
        offset += len(lines[-1])
    return lines, offset


def _datasets(source: ByteSource) -> Iterator[Dataset]:
    """All datasets in turn; at last one that is not whole, if the file is cut."""
    offset = 0
    for _ in range(_MOST):
        while offset < source.size and not (line := _line_at(source, offset)).strip():
            offset += len(line)
        if offset >= source.size:
            return
        if not _DELIMITER.fullmatch(line):
            raise damaged(source.path, f"byte {offset}: {line[:40]!r}; expected a line '-1' before the next dataset")
        offset += len(line)
        line = _line_at(source, offset) if offset < source.size else b""
        if (kind := _KIND.fullmatch(line)) is None:
            if line.endswith(b"\n"):
                raise damaged(source.path, f"byte {offset}: {line[:40]!r} is no number of a dataset")
            yield Dataset(0, offset, source.size, whole=False)
            return
        found = _dataset(source, kind, offset + kind.end())
        yield found
        if not found.whole:
            return
        offset = found.end + len(_line_at(source, found.end))
    raise damaged(source.path, f"more than {_MOST} datasets")


def _dataset(source: ByteSource, kind: re.Match[bytes], begin: int) -> Dataset:
    """The dataset whose content lies from ``begin`` on; a binary one ends where a closing line follows."""
    number, cut = int(kind[1]), Dataset(int(kind[1]), begin, source.size, whole=False)
    if not kind[2]:
        end = _end(source, begin)
        return cut if end is None else Dataset(number, begin, end)
    try:
        order, form, lines, declared = (int(text) for text in kind[3].split()[:4])
        heads, data = _lines(source, begin, min(lines, 100))
        if len(heads) < lines:
            return cut
        layouts = _layouts(heads[6].split(), "<" if order == 1 else ">") if number == 58 else [(None, declared)]
    except (ValueError, IndexError) as error:
        raise damaged(source.path, f"byte {begin}: header of dataset {number}b cannot be read ({error})") from error
    where = f"dataset {number}b at byte {begin}"
    if number == 58 and (order not in (1, 2) or form != 2):
        message = f"byte order {order} and floating-point format {form}; expected 1 or 2, and 2 (IEEE 754)"
        raise damaged(source.path, f"{where}: {message}")
    for rows, count in sorted(layouts, key=lambda layout: layout[1] != declared):
        if (closing := _closing(source, data + count)) is not None:
            return Dataset(number, begin, closing, rows=rows, agrees=count == declared)
    if data + declared >= source.size:
        return cut
    message = f"{declared} bytes of data are declared, but no '-1' follows them"
    if declared not in (count for _, count in layouts):
        message += f"; its samples take {layouts[0][1]} bytes"
    raise damaged(source.path, f"{where}: {message}")


def _layouts(form: list[bytes], order: str) -> list[tuple[np.dtype[Any] | None, int]]:
    """How a sample may lie, and the bytes that all take; the standard's layout first.

    The standard has abscissae of single precision; there are programs that write doubles whatever they declare.
    """
    kind, count, uneven = int(form[0]), int(form[1]), int(form[2]) == 0
    parts = ("re", "im") if kind in (5, 6) else ("re",)
    sizes = [(4, 8), (8, 8)] if kind in (4, 6) else [(4, 4), (4, 8), (8, 8)]
    rows = [
        np.dtype([*([("x", f"{order}f{x}")] if uneven else []), *((part, f"{order}f{size}") for part in parts)])
        for x, size in sizes
    ]
    return [(each, count * each.itemsize) for each in rows]


def _closing(source: ByteSource, end: int) -> int | None:
    """Where the closing line is if one lies at ``end``; some writers put a line feed before it."""
    if end >= source.size:
        return None
    line = _line_at(source, end)
    if not line.strip() and end + len(line) < source.size:
        end += len(line)
        line = _line_at(source, end)
    return end if _DELIMITER.fullmatch(line) else None


def _end(source: ByteSource, begin: int) -> int | None:
    """Where the closing line of a text dataset begins; None if there is none."""
    offset, keep = begin, b""
    while offset < source.size:
        piece = keep + source.read(offset, min(_PIECE, source.size - offset), "a dataset")
        start = offset - len(keep)
        offset += len(piece) - len(keep)
        whole = piece if offset >= source.size else piece[: piece.rfind(b"\n") + 1]
        if (match := _END.search(whole)) is not None:
            return start + match.start()
        keep = piece[len(whole) :]
        if len(keep) > _PIECE:
            raise damaged(source.path, f"byte {start}: a line longer than any in a universal file")
    return None


_TIME = 17
"""Specific data type of an abscissa of time."""
_NAMES = {
    0: "General", 1: "Time response", 2: "Auto spectrum", 3: "Cross spectrum", 4: "Frequency response",
    5: "Transmissibility", 6: "Coherence", 7: "Auto correlation", 8: "Cross correlation",
    9: "Power spectral density", 10: "Energy spectral density", 11: "Probability density", 12: "Spectrum",
    13: "Cumulative frequency distribution", 14: "Peaks valley", 15: "Stress per cycles", 16: "Strain per cycles",
    17: "Orbit", 18: "Mode indicator function", 19: "Force pattern", 20: "Partial power", 21: "Partial coherence",
    22: "Eigenvalue", 23: "Eigenvector", 24: "Shock response spectrum", 25: "Finite impulse response filter",
    26: "Multiple coherence", 27: "Order function", 28: "Phase compensation",
}  # fmt: skip
_AXES = {17: "Time", 18: "Frequency", 16: "Temperature", 20: "Order"}
_DIRECTIONS = {0: "scalar", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


class _Axis(NamedTuple):
    """Specific data type, label and unit of an axis, as written; None where the file says NONE."""

    kind: int
    label: str | None
    unit: str | None


@dataclass(frozen=True)
class Function:
    """The header of one function; ``step_text`` is the abscissa's step as written, ``data`` where the numbers begin.

    ``node`` and ``reference`` are name, number and direction; ``declared`` the samples that the header declares where
    the text holds fewer.
    """

    ids: list[str]
    kind: int
    node: tuple[str, int, int]
    reference: tuple[str, int, int]
    is_complex: bool
    is_double: bool
    samples: int
    even: bool
    start: float
    step: float
    step_text: str
    abscissa: _Axis
    quantity: str
    unit: str | None
    dataset: Dataset
    data: int
    declared: int | None = None

    @property
    def name(self) -> str:
        """The first line of identification, or node and direction if there is none."""
        return self.ids[0] if self.ids[0] and self.ids[0] != "NONE" else self.dof

    @property
    def dof(self) -> str:
        """Node and direction of the response, such as ``node 1 +Z``."""
        _, node, direction = self.node
        sign = _DIRECTIONS.get(abs(direction), str(direction))
        return f"node {node} {sign.replace('+', '-') if direction < 0 else sign}"

    @property
    def channels(self) -> list[Channel]:
        """Its channels, real and imaginary part."""
        return [
            Channel(f"{self.name}{part}", self.unit) for part in ((" (real)", " (imag)") if self.is_complex else ("",))
        ]

    @property
    def width(self) -> int:
        """Numbers of a sample."""
        return (not self.even) + 1 + self.is_complex

    @property
    def widths(self) -> tuple[int, ...]:
        """Letters of each number in a full line, by the standard's formats E13.5 and E20.12."""
        if not self.is_double:
            return (13,) * 6
        return (20,) * 4 if self.even else (13, 20, 20) if self.is_complex else (13, 20, 13, 20)


def _function(source: ByteSource, dataset: Dataset) -> Function:
    raw, offset = _lines(source, dataset.begin, 11)
    with refusing(source.path, f"the header of dataset 58 at byte {dataset.begin}", ValueError, IndexError):
        lines = [decoded(line).rstrip("\r\n") for line in raw]
        dof, form = lines[5], lines[6].split()
        kind, count = int(form[0]), int(form[1])
        if kind not in (2, 4, 5, 6) or not 0 <= count < 1 << 40:
            raise ValueError(f"data type {kind} with {count} values")
        ordinate, over = _axis(lines[8]), _axis(lines[9]).unit
        start, step = (float(text.replace("D", "E")) for text in form[3:5])
        found = Function(
            ids=[line.strip() for line in lines[:5]],
            kind=_integer(dof[0:5]),
            node=(dof[31:41].strip(), _integer(dof[41:51]), _integer(dof[51:55])),
            reference=(dof[56:66].strip(), _integer(dof[66:76]), _integer(dof[76:80])),
            is_complex=kind in (5, 6),
            is_double=kind in (4, 6),
            samples=count,
            even=int(form[2]) != 0,
            start=start,
            step=step,
            step_text=form[4],
            abscissa=_axis(lines[7]),
            quantity=ordinate.label or "",
            unit=f"{ordinate.unit}/{over}" if ordinate.unit is not None and over is not None else ordinate.unit,
            dataset=dataset,
            data=offset,
        )
        there = dataset.end - offset
        if dataset.rows is not None or there > _TEXT_BYTES or 2 * found.width * count <= there:
            return found
        numbers = parsed_numbers(source.read(offset, there, "its numbers"), found.widths)
        return replace(found, samples=len(numbers) // found.width, declared=count)


def _axis(line: str) -> _Axis:
    """Label and unit in their columns: of letters, or of bytes where a letter stands in the blank before the unit."""
    columns = [line[26:46], line[47:67]]
    if line[46:47].strip():
        raw = line.encode("utf-8")
        columns = [raw[a : a + 20].decode("utf-8", "replace") for a in (26, 47)]
    label, unit = (None if text.strip() in ("", "NONE") else text.strip() for text in columns)
    return _Axis(_integer(line[0:10]), label, unit)


def _integer(text: str) -> int:
    return int(text) if text.strip() else 0


def _pieces(source: ByteSource, function: Function, samples: int) -> Iterator[NDArray[np.float64]]:
    """The samples in pieces of ``samples``, each (p, n) [units of the function]: abscissa, real, imaginary part."""
    what, rows = f"function {function.name!r}", function.dataset.rows
    if rows is None:
        yield from _text_pieces(source, function, samples, what)
        return
    for begin in range(0, function.samples, samples):
        count = min(samples, function.samples - begin)
        raw = source.read(function.data + begin * rows.itemsize, count * rows.itemsize, what)
        table = np.frombuffer(raw, dtype=rows)
        yield np.stack([as_float64(table[name]) for name in rows.names or ()])


def _text_pieces(source: ByteSource, function: Function, samples: int, what: str) -> Iterator[NDArray[np.float64]]:
    width, end = function.width, function.dataset.end
    offset, keep, waiting, found = function.data, b"", np.empty(0), 0
    while offset < end:
        text = keep + source.read(offset, min(_TEXT_BYTES, end - offset), what)
        offset = min(offset + _TEXT_BYTES, end)
        whole = len(text) if offset == end else text.rfind(b"\n") + 1
        keep = text[whole:]
        with refusing(source.path, what, ValueError):
            waiting = np.concatenate([waiting, parsed_numbers(text[:whole], function.widths)])
        while len(waiting) >= samples * width:
            yield waiting[: samples * width].reshape(-1, width).T
            waiting, found = waiting[samples * width :], found + samples
    found += len(waiting) // width
    if len(waiting) % width or found != function.samples:
        raise damaged(source.path, f"{what}: declares {function.samples} samples, {found} are there")
    if len(waiting):
        yield waiting.reshape(-1, width).T


def parsed_numbers(text: bytes, widths: tuple[int, ...]) -> NDArray[np.float64]:
    """The numbers of a text (n,) [as written]: separated by blanks, or else by their ``widths`` where they touch."""
    text = text.replace(b"D", b"E").replace(b"d", b"e")
    try:
        return np.array(text.split(), dtype=np.bytes_).astype(np.float64)
    except ValueError:
        spans = list(pairwise([0, *np.cumsum(widths).tolist()]))
        cells = [line[a:b].strip() for line in text.splitlines() for a, b in spans]
        return np.array([cell for cell in cells if cell], dtype=np.bytes_).astype(np.float64)


_COMPONENTS = {
    2: ("x", "y", "z"),
    3: ("x", "y", "z", "rx", "ry", "rz"),
    4: ("xx", "xy", "yy", "xz", "yz", "zz"),
}
_MOST_BYTES = 1 << 28


_Shape = tuple[Group, tuple[Samples, ...], dict[str, str]]
"""The rows of one dataset 55, one a node, and the texts of its header."""


def _nodal_data(source: ByteSource, dataset: Dataset, name: str) -> _Shape:
    if dataset.end - dataset.begin > _MOST_BYTES:
        raise damaged(source.path, f"dataset 55 at byte {dataset.begin} is larger than {_MOST_BYTES >> 20} MiB")
    lines = decoded(source.read(dataset.begin, dataset.end - dataset.begin, "dataset 55")).splitlines()
    with refusing(source.path, f"dataset 55 at byte {dataset.begin}", ValueError, IndexError):
        form = [int(text) for text in lines[5].split()]
        characteristic, kind, values = form[2], form[4], form[5]
        if kind not in (2, 5) or not 0 < values <= 1000:
            raise ValueError(f"data type {kind} with {values} values a node")
        width = values * (2 if kind == 5 else 1)
        integers, reals = (int(text) for text in lines[6].split()[:2])
        begin = 6 + -(-(2 + integers) // 8) + -(-reals // 6)  # after the integers and reals that record 7 counts
        data, per_node, nodes, rows = lines[begin:], 1 + -(-width // 6), [], []
        if len(data) % per_node:
            raise ValueError(f"{len(data)} lines of data; expected {per_node} a node")
        for i in range(0, len(data), per_node):
            nodes.append(float(int(data[i].split()[0])))
            row = parsed_numbers("\n".join(data[i + 1 : i + per_node]).encode("latin-1"), (13,) * 6)
            if len(row) != width:
                raise ValueError(f"node {nodes[-1]:g} has {len(row)} numbers, expected {width}")
            rows.append(row)
        table = np.array(rows, dtype=np.float64).reshape(len(nodes), width).T
    labels = _COMPONENTS.get(characteristic, ())
    labels = labels if len(labels) == values else tuple(f"value {i + 1}" for i in range(values))
    if kind == 5:
        labels = tuple(f"{label} ({part})" for label in labels for part in ("real", "imag"))
    texts = {f"line {i + 1}": line.strip() for i, line in enumerate(lines[:5]) if line.strip() not in ("", "NONE")}
    texts["real values"] = " ".join(" ".join(lines[7:begin]).split())
    return Group(name, tuple(Channel(label) for label in ("node", *labels))), (np.array(nodes), *table), texts


_HEADERS = {151: "header", 164: "units"}


def open_uff(path: Path, options: ReadOptions) -> Recording:
    """Find the datasets and read their headers; the numbers are read when asked for."""
    with ByteSource(path) as source:
        found, findings = list(_datasets(source)), list[Finding]()
        whole = [dataset for dataset in found if dataset.whole]
        if len(whole) < len(found):
            place = f"the file ends inside dataset {len(found)}, of kind {found[-1].kind}, which has no closing line"
            message = f"{place}; the {len(whole)} before it are whole"
            findings.append(Finding("cut_file", None, f"byte {found[-1].begin}", message))
        functions = [f for dataset in whole if dataset.kind == 58 and (f := _function(source, dataset)).samples]
        sets = _sets(path.stem, functions)
        nodal = (dataset for dataset in whole if dataset.kind == 55)
        shapes = [_nodal_data(source, each, f"{path.stem} dataset 55 {i}") for i, each in enumerate(nodal, 1)]
        metadata = _metadata(source, whole, functions, shapes)
    if not sets and not shapes:
        raise nothing_to_read(path, findings, "holds no dataset 58, 58b or 55 with values")
    return Recording(
        path=path,
        format="UFF",
        reader="testbench.readers.uff",
        groups=(*(group for group, _ in sets), *(group for group, _, _ in shapes)),
        read=lambda report: watch_nonfinite(_blocks(path, sets, shapes), report),
        metadata=metadata,
        findings=(*findings, *_header_findings(functions, whole)),
    )


def _sets(stem: str, functions: Sequence[Function]) -> list[tuple[Group, list[Function]]]:
    """Functions gathered by kind, abscissa and time of measurement; one with recorded abscissae stands alone."""
    gathered: dict[tuple[object, ...], list[Function]] = {}
    for i, f in enumerate(functions):
        alone = () if f.even else (i,)
        gathered.setdefault((f.kind, f.samples, f.start, f.step, f.abscissa, f.ids[2], *alone), []).append(f)
    sets: dict[str, tuple[Group, list[Function]]] = {}
    for members in gathered.values():
        kind = _NAMES.get(members[0].kind, f"Function {members[0].kind}")
        name = stem if len(gathered) == 1 else f"{stem} {kind}"
        name = next(n for n in (name, *(f"{name} {i}" for i in range(2, len(gathered) + 2))) if n not in sets)
        sets[name] = (_group(name, members), members)
    return list(sets.values())


def _group(name: str, members: Sequence[Function]) -> Group:
    """The group of functions of one abscissa, which is a clock if it is of time, else a channel."""
    first = members[0]
    zero, channels = _start(first.ids[2]), [channel for f in members for channel in f.channels]
    axis = Channel(first.abscissa.label or _AXES.get(first.abscissa.kind, "Abscissa"), first.abscissa.unit)
    clock = recorded_time(0, axis.unit) if first.abscissa.kind == _TIME else None
    if clock is not None and first.even and (factor := clock.seconds_per_unit) is not None:
        return Group(name, tuple(channels), clock_of_step(first.step * factor, first.start * factor), zero)
    return Group(name, (axis, *channels), clock, zero)


def _start(text: str) -> StartTime | None:
    """The date of a function, its third line: ``21-Nov-26 10:00:00`` as the format has it, or another clear one."""
    written = _DATE.fullmatch(text.strip())
    if written is None:
        return start_at(text, "date of the function")
    year = int(written[3]) + (2000 if int(written[3]) < _FIRST_YEAR else 1900 if int(written[3]) < 100 else 0)
    return start_at(f"{written[1]}-{written[2]}-{year} {written[4] or ''}".strip(), "date of the function")


def _blocks(path: Path, sets: Sequence[tuple[Group, Sequence[Function]]], shapes: Sequence[_Shape]) -> Iterator[Block]:
    """The samples of the functions of each group, side by side; then the data at nodes."""
    with ByteSource(path) as source:
        for group, functions in sets:
            first, start, samples = functions[0], 0, block_samples(len(group.channels))
            has_axis = first.even and len(group.channels) > sum(len(f.channels) for f in functions)
            for parts in zip(*(_pieces(source, f, samples) for f in functions), strict=True):
                columns: list[Samples] = [row for part in parts for row in part]
                if has_axis:
                    with np.errstate(all="ignore"):
                        index = np.arange(start, start + len(columns[0]), dtype=np.float64)
                        columns.insert(0, first.start + first.step * index)
                yield Block(group, tuple(columns), start, bytes_read=first.dataset.begin)
                start += len(columns[0])
        for group, columns_of_nodes, _ in shapes:
            if len(columns_of_nodes[0]):
                yield Block(group, columns_of_nodes, 0, bytes_read=source.size)


def _header_findings(functions: Sequence[Function], whole: Sequence[Dataset]) -> list[Finding]:
    """Contradictions, doubles and rounded steps in the headers; kinds of datasets that are not kept."""
    findings: list[Finding] = []
    others = sorted({d.kind for d in whole} - {55, 58, *_HEADERS})
    by_dof: dict[tuple[object, ...], list[Function]] = {}
    for f in functions:
        by_dof.setdefault((f.kind, f.ids[2], f.node, f.reference), []).append(f)
        if not f.dataset.agrees:
            message = "the header declares another number of bytes than its samples take; all of them are there"
            findings.append(Finding("header_contradiction", f.name, None, message))
        if f.declared is not None:
            message = f"declares {f.declared} samples, {f.samples} are there"
            findings.append(Finding("count_contradiction", f.name, None, message))
        if f.even and f.abscissa.kind == _TIME:
            findings += header_claims.step_findings(f.step_text, "the abscissa's step")
    for members in by_dof.values():
        if len(members) > 1 and members[0].node[1]:
            listed = ", ".join(f.name for f in members)
            message = f"{members[0].dof} is that of {listed}: identify them by name, not by node"
            findings.append(Finding("duplicate_dof", members[-1].name, None, message))
    if others:
        message = f"datasets of kind {', '.join(map(str, others))} hold no measured series; they are not kept"
        findings.append(Finding("left_out", None, None, message))
    return list(dict.fromkeys(findings))


def _metadata(
    source: ByteSource, whole: Sequence[Dataset], functions: Sequence[Function], shapes: Sequence[_Shape]
) -> dict[str, str]:
    metadata: dict[str, str] = {}
    for dataset in whole:
        if dataset.kind in _HEADERS:
            raw = source.read(dataset.begin, min(2000, dataset.end - dataset.begin), "a header")
            lines = (" ".join(line.split()) for line in decoded(raw).splitlines())
            metadata[_HEADERS[dataset.kind]] = "; ".join(filter(None, lines))
    for f in functions[:200]:
        ids = [text for text in f.ids[1:] if text not in ("", "NONE")]
        metadata[f"{f.name}: dof"] = f.dof if not f.reference[1] else f"{f.dof}, reference node {f.reference[1]}"
        metadata[f"{f.name}: quantity"] = f.quantity
        metadata |= {f"{f.name}: id": "; ".join(ids)} if ids else {}
    for group, _, texts in shapes[:200]:
        metadata |= {f"{group.name}: {key}": text for key, text in texts.items()}
    return metadata
