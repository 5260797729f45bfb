"""Reader of universal files: functions of one abscissa are channels of one group."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...findings import Finding, Refusal
from ...recording import Block, Channel, Clock, Group, Recording, Samples, TimeColumn
from ...units import seconds_per
from .. import doubt
from ..declared import by_step
from ..nonfinite import watched
from ..registry import ReadOptions
from ..stream import ByteSource, block_samples
from . import function, nodal, values
from .function import TIME, Function
from .index import Dataset, datasets
from .nodal import Nodal

_SAID = {151: "header", 164: "units"}


@dataclass(frozen=True)
class _Set:
    """Functions of one abscissa and the group that they make."""

    group: Group
    functions: tuple[Function, ...]


def open_uff(path: Path, options: ReadOptions) -> Recording:
    """Find the datasets and read their headers; the numbers are read when asked for."""
    with ByteSource(path) as source:
        found = list(datasets(source))
        whole, findings = _whole(found)
        functions = [function.parse(source, d) for d in whole if d.kind == 58]
        functions = [f for f in functions if f.samples]
        sets = _sets(path.stem, functions)
        shapes = [nodal.parse(source, d, f"{path.stem} dataset 55 {i}")
                  for i, d in enumerate((d for d in whole if d.kind == 55), 1)]  # fmt: skip
        metadata = _metadata(source, whole, functions, shapes)
    if not sets and not shapes:
        message = "holds no dataset 58, 58b or 55 with values"
        raise Refusal(path.name, findings[0] if findings else Finding("no_data", None, None, message))
    groups = (*(s.group for s in sets), *(shape.group for shape in shapes))
    return Recording(
        path=path,
        format="UFF",
        reader="testbench.readers.uff",
        groups=groups,
        read=lambda report: watched(_blocks(path, sets, shapes), report),
        metadata=metadata,
        findings=(*findings, *_said(functions), *_others(whole)),
    )


def _whole(found: Sequence[Dataset]) -> tuple[list[Dataset], list[Finding]]:
    """The whole datasets, and that the last one is cut if it is."""
    whole = [dataset for dataset in found if dataset.whole]
    if len(whole) == len(found):
        return whole, []
    last = found[-1]
    place = f"the file ends inside dataset {len(found)}, of kind {last.kind}, which has no closing line"
    message = f"{place}; the {len(whole)} before it are whole"
    return whole, [Finding("cut_file", None, f"byte {last.begin}", message)]


def _sets(stem: str, functions: Sequence[Function]) -> list[_Set]:
    """Functions gathered by kind, abscissa and time of measurement; one with recorded abscissae stands alone."""
    gathered: dict[tuple[object, ...], list[Function]] = {}
    for i, f in enumerate(functions):
        alone = () if f.even else (i,)
        gathered.setdefault((f.kind, f.samples, f.start, f.step, f.abscissa, f.ids[2], *alone), []).append(f)
    taken: set[str] = set()
    sets = []
    for members in gathered.values():
        kind = function.NAMES.get(members[0].kind, f"Function {members[0].kind}")
        name = stem if len(gathered) == 1 else _free(f"{stem} {kind}", taken)
        sets.append(_Set(_group(name, members), tuple(members)))
    return sets


def _free(name: str, taken: set[str]) -> str:
    numbered, n = name, 1
    while numbered in taken:
        n += 1
        numbered = f"{name} {n}"
    taken.add(numbered)
    return numbered


def _group(name: str, members: Sequence[Function]) -> Group:
    """The group of functions of one abscissa, which is a clock if it is of time, else a channel."""
    first = members[0]
    channels = [c for f in members for c in _channels(f)]
    clock: Clock | None = None
    axis = Channel(first.axis_name, first.abscissa.unit)
    if first.abscissa.kind == TIME:
        factor = 1.0 if axis.unit is None else seconds_per(axis.unit)
        if first.even and factor is not None:
            return Group(name, tuple(channels), by_step(first.step * factor, first.start * factor))
        clock = TimeColumn(0, factor, assumed=axis.unit is None)
    return Group(name, (axis, *channels), clock)


def _channels(f: Function) -> list[Channel]:
    if not f.is_complex:
        return [Channel(f.name, f.unit)]
    return [Channel(f"{f.name} ({part})", f.unit, f"{f.name} ({part})") for part in ("real", "imag")]


def _blocks(path: Path, sets: Sequence[_Set], shapes: Sequence[Nodal]) -> Iterator[Block]:
    with ByteSource(path) as source:
        for each in sets:
            yield from _of_set(source, each)
        for shape in shapes:
            if len(shape.columns[0]):
                yield Block(shape.group, shape.columns, 0, bytes_read=source.size)


def _of_set(source: ByteSource, each: _Set) -> Iterator[Block]:
    """The samples of the functions of one group, side by side."""
    first, samples = each.functions[0], block_samples(len(each.group.channels))
    readers = [values.pieces(source, f, samples) for f in each.functions]
    has_axis = len(each.group.channels) > sum(len(_channels(f)) for f in each.functions)
    start = 0
    for pieces in zip(*readers, strict=True):
        columns: list[Samples] = [row for piece in pieces for row in piece]
        if has_axis and first.even:
            with np.errstate(all="ignore"):
                index = np.arange(start, start + len(columns[0]), dtype=np.float64)
                columns.insert(0, first.start + first.step * index)
        yield Block(each.group, tuple(columns), start, bytes_read=first.dataset.begin)
        start += len(columns[0])


def _said(functions: Sequence[Function]) -> list[Finding]:
    """What is odd in the headers."""
    findings: list[Finding] = []
    by_dof: dict[tuple[object, ...], list[str]] = {}
    for f in functions:
        by_dof.setdefault((f.kind, f.ids[2], f.node, f.reference), []).append(f.name)
        if f.dataset.binary and not f.dataset.binary.agrees:
            message = "the header declares another number of bytes than its samples take; all of them are there"
            findings.append(Finding("header_contradiction", f.name, None, message))
        if f.even and f.abscissa.kind == TIME:
            findings += doubt.step_as_text(f.step_text, "the abscissa's step")
    for (_, _, node, _), names in by_dof.items():
        if len(names) > 1 and isinstance(node, tuple) and node[1]:
            dof = next(f.dof for f in functions if f.node == node)
            message = f"{dof} is that of {', '.join(names)}: tell them apart by name, not by node"
            findings.append(Finding("duplicate_dof", names[-1], None, message))
    return list(dict.fromkeys(findings))


def _others(whole: Sequence[Dataset]) -> list[Finding]:
    kinds = sorted({d.kind for d in whole} - {55, 58, *_SAID})
    if not kinds:
        return []
    message = f"datasets of kind {', '.join(map(str, kinds))} hold no measured series; they are not kept"
    return [Finding("left_out", None, None, message)]


def _metadata(
    source: ByteSource, whole: Sequence[Dataset], functions: Sequence[Function], shapes: Sequence[Nodal]
) -> dict[str, str]:
    metadata: dict[str, str] = {}
    for dataset in whole:
        if dataset.kind in _SAID:
            text = source.read(dataset.begin, min(2000, dataset.end - dataset.begin), "a header").decode("latin-1")
            lines = (" ".join(line.split()) for line in text.splitlines())
            metadata[_SAID[dataset.kind]] = "; ".join(filter(None, lines))
    for f in functions[:200]:
        said = [text for text in f.ids[1:] if text not in ("", "NONE")]
        metadata[f"{f.name}: dof"] = f.dof if not f.reference[1] else f"{f.dof}, reference node {f.reference[1]}"
        metadata[f"{f.name}: quantity"] = f.ordinate.label or ""
        metadata |= {f"{f.name}: id": "; ".join(said)} if said else {}
    for shape in shapes[:200]:
        metadata |= {f"{shape.group.name}: {key}": text for key, text in shape.metadata.items()}
    return metadata
