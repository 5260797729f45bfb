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


TIME = 17
"""Specific data type of an abscissa of time."""
NAMES = {
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


@dataclass(frozen=True)
class Axis:
    """Specific data type, label and unit of an axis, as written; None where the file says NONE."""

    kind: int
    label: str | None
    unit: str | None


@dataclass(frozen=True)
class Function:
    """The header of one function; ``step_text`` is the abscissa's step as written, ``data`` where the numbers begin."""

    ids: tuple[str, ...]
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
    abscissa: Axis
    ordinate: Axis
    denominator: Axis
    dataset: Dataset
    data: int
    declared: int | None = None
    """Samples that the header declares where the text holds fewer."""

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
    def unit(self) -> str | None:
        """Unit of the ordinate, over that of its denominator if there is one."""
        if self.ordinate.unit is None or self.denominator.unit is None:
            return self.ordinate.unit
        return f"{self.ordinate.unit}/{self.denominator.unit}"


def parse_function(source: ByteSource, dataset: Dataset) -> Function:
    """The header of the dataset 58 that ``dataset`` is."""
    lines, offset = _lines(source, dataset.begin, 11)
    with refusing(source.path, f"the header of dataset 58 at byte {dataset.begin}", ValueError, IndexError):
        found = _parsed([decoded(line).rstrip("\r\n") for line in lines], dataset, offset)
        width = _width(found)
        there = dataset.end - offset
        if dataset.binary or there > _TEXT_BYTES or 2 * width * found.samples <= there:
            return found
        numbers = parsed_numbers(source.read(offset, there, "its numbers"), _widths(found))
        return replace(found, samples=len(numbers) // width, declared=found.samples)


def _parsed(lines: list[str], dataset: Dataset, offset: int) -> Function:
    dof, form = lines[5], lines[6].split()
    kind, count, even = int(form[0]), int(form[1]), int(form[2]) != 0
    if kind not in (2, 4, 5, 6) or not 0 <= count < 1 << 40:
        raise ValueError(f"data type {kind} with {count} values")
    start, step = (float(text.replace("D", "E")) for text in form[3:5])
    return Function(
        ids=tuple(line.strip() for line in lines[:5]),
        kind=_integer(dof[0:5]),
        node=(dof[31:41].strip(), _integer(dof[41:51]), _integer(dof[51:55])),
        reference=(dof[56:66].strip(), _integer(dof[66:76]), _integer(dof[76:80])),
        is_complex=kind in (5, 6),
        is_double=kind in (4, 6),
        samples=count,
        even=even,
        start=start,
        step=step,
        step_text=form[4],
        abscissa=_axis(lines[7]),
        ordinate=_axis(lines[8]),
        denominator=_axis(lines[9]),
        dataset=dataset,
        data=offset,
    )


def _axis(line: str) -> Axis:
    """Label and unit in their columns: of letters, or of bytes where a letter stands in the blank before the unit."""
    if line[46:47].strip():
        line = line.encode("utf-8").decode("latin-1")
        columns = ((line[a : a + 20].encode("latin-1").decode("utf-8", "replace")).strip() for a in (26, 47))
    else:
        columns = (line[a : a + 20].strip() for a in (26, 47))
    label, unit = (None if text in ("", "NONE") else text for text in columns)
    return Axis(_integer(line[0:10]), label, unit)


def _integer(text: str) -> int:
    return int(text) if text.strip() else 0


_TEXT_BYTES = 1 << 20


def function_pieces(source: ByteSource, function: Function, samples: int) -> Iterator[NDArray[np.float64]]:
    """The samples in pieces of ``samples``, each (p, n) [units of the function]: abscissa, real, imaginary part."""
    what = f"function {function.name!r}"
    if (layout := function.dataset.binary) is None:
        yield from _text(source, function, samples, what)
        return
    number = [(name, f"{layout.order}f{layout.number}") for name in ("re", "im")[: 1 + function.is_complex]]
    kind = np.dtype([("x", f"{layout.order}f{layout.abscissa}"), *number] if layout.abscissa else number)
    for begin in range(0, function.samples, samples):
        count = min(samples, function.samples - begin)
        raw = source.read(function.data + begin * kind.itemsize, count * kind.itemsize, what)
        rows = np.frombuffer(raw, dtype=kind)
        yield np.stack([as_float64(rows[name]) for name in kind.names or ()])


def _text(source: ByteSource, function: Function, samples: int, what: str) -> Iterator[NDArray[np.float64]]:
    width = _width(function)
    offset, keep, waiting, found = function.data, b"", np.empty(0), 0
    while offset < function.dataset.end:
        count = min(_TEXT_BYTES, function.dataset.end - offset)
        text = keep + source.read(offset, count, what)
        offset += count
        whole = len(text) if offset == function.dataset.end else text.rfind(b"\n") + 1
        keep = text[whole:]
        with refusing(source.path, what, ValueError):
            waiting = np.concatenate([waiting, parsed_numbers(text[:whole], _widths(function))])
        while len(waiting) >= samples * width:
            yield waiting[: samples * width].reshape(-1, width).T
            waiting, found = waiting[samples * width :], found + samples
    found += len(waiting) // width
    if len(waiting) % width or found != function.samples:
        raise damaged(source.path, f"{what}: declares {function.samples} samples, {found} are there")
    if len(waiting):
        yield waiting.reshape(-1, width).T


def _width(function: Function) -> int:
    """Numbers of a sample."""
    return (not function.even) + 1 + function.is_complex


def _widths(function: Function) -> tuple[int, ...]:
    """Widths of the numbers in a full line, by the standard's formats E13.5 and E20.12."""
    if not function.is_double:
        return (13,) * 6
    if function.even:
        return (20,) * 4
    return (13, 20, 20) if function.is_complex else (13, 20, 13, 20)


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


@dataclass(frozen=True)
class NodalData:
    """The rows of one dataset 55, one a node, and the texts of its header."""

    group: Group
    columns: tuple[Samples, ...]
    metadata: dict[str, str]


def parse_nodal_data(source: ByteSource, dataset: Dataset, name: str) -> NodalData:
    """The data at nodes that ``dataset`` holds."""
    if dataset.end - dataset.begin > _MOST_BYTES:
        raise damaged(source.path, f"dataset 55 at byte {dataset.begin} is larger than {_MOST_BYTES >> 20} MiB")
    raw = source.read(dataset.begin, dataset.end - dataset.begin, "dataset 55")
    with refusing(source.path, f"dataset 55 at byte {dataset.begin}", ValueError, IndexError):
        return _parsed_nodal(decoded(raw).splitlines(), name)


def _parsed_nodal(lines: list[str], name: str) -> NodalData:
    form = [int(text) for text in lines[5].split()]
    characteristic, kind, values = form[2], form[4], form[5]
    if kind not in (2, 5) or not 0 < values <= 1000:
        raise ValueError(f"data type {kind} with {values} values a node")
    width = values * (2 if kind == 5 else 1)
    integers, reals = (int(text) for text in lines[6].split()[:2])
    begin = 6 + -(-(2 + integers) // 8) + -(-reals // 6)  # after the integers and reals that record 7 counts
    data, nodes, rows = lines[begin:], [], []
    per_node = -(-width // 6)
    if len(data) % (per_node + 1):
        raise ValueError(f"{len(data)} lines of data; expected {per_node + 1} a node")
    for i in range(0, len(data), per_node + 1):
        nodes.append(float(int(data[i].split()[0])))
        row = parsed_numbers("\n".join(data[i + 1 : i + 1 + per_node]).encode("latin-1"), (13,) * 6)
        if len(row) != width:
            raise ValueError(f"node {nodes[-1]:g} has {len(row)} numbers, expected {width}")
        rows.append(row)
    table = np.array(rows, dtype=np.float64).reshape(len(nodes), width).T
    labels = _COMPONENTS.get(characteristic, ())
    labels = labels if len(labels) == values else tuple(f"value {i + 1}" for i in range(values))
    if kind == 5:
        labels = tuple(f"{label} ({part})" for label in labels for part in ("real", "imag"))
    group = Group(name, tuple(Channel(label) for label in ("node", *labels)))
    texts = {f"line {i + 1}": line.strip() for i, line in enumerate(lines[:5]) if line.strip() not in ("", "NONE")}
    texts["real values"] = " ".join(" ".join(lines[7:begin]).split())
    return NodalData(group, (np.array(nodes), *table), texts)


_HEADERS = {151: "header", 164: "units"}


@dataclass(frozen=True)
class _FunctionSet:
    """Functions of one abscissa and the group that they make."""

    group: Group
    functions: tuple[Function, ...]


def open_uff(path: Path, options: ReadOptions) -> Recording:
    """Find the datasets and read their headers; the numbers are read when asked for."""
    with ByteSource(path) as source:
        found, findings = list(datasets(source)), list[Finding]()
        whole = [dataset for dataset in found if dataset.whole]
        if len(whole) < len(found):
            place = f"the file ends inside dataset {len(found)}, of kind {found[-1].kind}, which has no closing line"
            message = f"{place}; the {len(whole)} before it are whole"
            findings.append(Finding("cut_file", None, f"byte {found[-1].begin}", message))
        functions = [parse_function(source, d) for d in whole if d.kind == 58]
        functions = [f for f in functions if f.samples]
        sets = _sets(path.stem, functions)
        shapes = [parse_nodal_data(source, d, f"{path.stem} dataset 55 {i}")
                  for i, d in enumerate((d for d in whole if d.kind == 55), 1)]  # fmt: skip
        metadata = _metadata(source, whole, functions, shapes)
    if not sets and not shapes:
        raise nothing_to_read(path, findings, "holds no dataset 58, 58b or 55 with values")
    groups = (*(s.group for s in sets), *(shape.group for shape in shapes))
    return Recording(
        path=path,
        format="UFF",
        reader="testbench.readers.uff",
        groups=groups,
        read=lambda report: watch_nonfinite(_blocks(path, sets, shapes), report),
        metadata=metadata,
        findings=(*findings, *_header_findings(functions, whole)),
    )


def _sets(stem: str, functions: Sequence[Function]) -> list[_FunctionSet]:
    """Functions gathered by kind, abscissa and time of measurement; one with recorded abscissae stands alone."""
    gathered: dict[tuple[object, ...], list[Function]] = {}
    for i, f in enumerate(functions):
        alone = () if f.even else (i,)
        gathered.setdefault((f.kind, f.samples, f.start, f.step, f.abscissa, f.ids[2], *alone), []).append(f)
    taken: set[str] = set()
    sets = []
    for members in gathered.values():
        kind = NAMES.get(members[0].kind, f"Function {members[0].kind}")
        name = stem if len(gathered) == 1 else f"{stem} {kind}"
        name = next(n for n in (name, *(f"{name} {i}" for i in range(2, len(gathered) + 2))) if n not in taken)
        taken.add(name)
        sets.append(_FunctionSet(_group(name, members), tuple(members)))
    return sets


def _group(name: str, members: Sequence[Function]) -> Group:
    """The group of functions of one abscissa, which is a clock if it is of time, else a channel."""
    first = members[0]
    zero = _start(first.ids[2])
    channels = [c for f in members for c in _channels(f)]
    clock = None
    axis = Channel(first.abscissa.label or _AXES.get(first.abscissa.kind, "Abscissa"), first.abscissa.unit)
    if first.abscissa.kind == TIME:
        clock = recorded_time(0, axis.unit)
        if first.even and (factor := clock.seconds_per_unit) is not None:
            return Group(name, tuple(channels), clock_of_step(first.step * factor, first.start * factor), zero)
    return Group(name, (axis, *channels), clock, zero)


def _start(text: str) -> StartTime | None:
    """The date of a function, its third line: ``21-Nov-26 10:00:00`` as the format has it, or another clear one."""
    written = _DATE.fullmatch(text.strip())
    if written is None:
        return start_at(text, "date of the function")
    year = int(written[3]) + (2000 if int(written[3]) < _FIRST_YEAR else 1900 if int(written[3]) < 100 else 0)
    return start_at(f"{written[1]}-{written[2]}-{year} {written[4] or ''}".strip(), "date of the function")


def _channels(f: Function) -> list[Channel]:
    if not f.is_complex:
        return [Channel(f.name, f.unit)]
    return [Channel(f"{f.name} ({part})", f.unit, f"{f.name} ({part})") for part in ("real", "imag")]


def _blocks(path: Path, sets: Sequence[_FunctionSet], shapes: Sequence[NodalData]) -> Iterator[Block]:
    with ByteSource(path) as source:
        for each in sets:
            yield from _set_blocks(source, each)
        for shape in shapes:
            if len(shape.columns[0]):
                yield Block(shape.group, shape.columns, 0, bytes_read=source.size)


def _set_blocks(source: ByteSource, each: _FunctionSet) -> Iterator[Block]:
    """The samples of the functions of one group, side by side."""
    first, samples = each.functions[0], block_samples(len(each.group.channels))
    readers = [function_pieces(source, f, samples) for f in each.functions]
    has_axis = len(each.group.channels) > sum(len(_channels(f)) for f in each.functions)
    start = 0
    for parts in zip(*readers, strict=True):
        columns: list[Samples] = [row for part in parts for row in part]
        if has_axis and first.even:
            with np.errstate(all="ignore"):
                index = np.arange(start, start + len(columns[0]), dtype=np.float64)
                columns.insert(0, first.start + first.step * index)
        yield Block(each.group, tuple(columns), start, bytes_read=first.dataset.begin)
        start += len(columns[0])


def _header_findings(functions: Sequence[Function], whole: Sequence[Dataset]) -> list[Finding]:
    """Contradictions, doubles and rounded steps in the headers; kinds of datasets that are not kept."""
    findings: list[Finding] = []
    others = sorted({d.kind for d in whole} - {55, 58, *_HEADERS})
    by_dof: dict[tuple[object, ...], list[str]] = {}
    for f in functions:
        by_dof.setdefault((f.kind, f.ids[2], f.node, f.reference), []).append(f.name)
        if f.dataset.binary and not f.dataset.binary.agrees:
            message = "the header declares another number of bytes than its samples take; all of them are there"
            findings.append(Finding("header_contradiction", f.name, None, message))
        if f.declared is not None:
            message = f"declares {f.declared} samples, {f.samples} are there"
            findings.append(Finding("count_contradiction", f.name, None, message))
        if f.even and f.abscissa.kind == TIME:
            findings += header_claims.step_findings(f.step_text, "the abscissa's step")
    for (_, _, node, _), names in by_dof.items():
        if len(names) > 1 and isinstance(node, tuple) and node[1]:
            dof = next(f.dof for f in functions if f.node == node)
            message = f"{dof} is that of {', '.join(names)}: identify them by name, not by node"
            findings.append(Finding("duplicate_dof", names[-1], None, message))
    if others:
        message = f"datasets of kind {', '.join(map(str, others))} hold no measured series; they are not kept"
        findings.append(Finding("left_out", None, None, message))
    return list(dict.fromkeys(findings))


def _metadata(
    source: ByteSource, whole: Sequence[Dataset], functions: Sequence[Function], shapes: Sequence[NodalData]
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
        metadata[f"{f.name}: quantity"] = f.ordinate.label or ""
        metadata |= {f"{f.name}: id": "; ".join(ids)} if ids else {}
    for shape in shapes[:200]:
        metadata |= {f"{shape.group.name}: {key}": text for key, text in shape.metadata.items()}
    return metadata
