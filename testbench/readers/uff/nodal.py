"""Dataset 55: data at nodes, such as mode shapes; one row a node."""

from dataclasses import dataclass

import numpy as np

from ...recording import Channel, Group, Samples
from ..stream import ByteSource, damaged
from .index import Dataset
from .values import parsed

_COMPONENTS = {
    2: ("x", "y", "z"),
    3: ("x", "y", "z", "rx", "ry", "rz"),
    4: ("xx", "xy", "yy", "xz", "yz", "zz"),
}
_MOST_BYTES = 1 << 28


@dataclass(frozen=True)
class Nodal:
    """The rows of one dataset 55, and what its header says."""

    group: Group
    columns: tuple[Samples, ...]
    metadata: dict[str, str]


def parse(source: ByteSource, dataset: Dataset, name: str) -> Nodal:
    """The data at nodes that ``dataset`` holds."""
    if dataset.end - dataset.begin > _MOST_BYTES:
        raise damaged(source.path, f"dataset 55 at byte {dataset.begin} is larger than {_MOST_BYTES >> 20} MiB")
    text = source.read(dataset.begin, dataset.end - dataset.begin, "dataset 55")
    try:
        return _parsed(text.decode("latin-1").splitlines(), name)
    except (ValueError, IndexError) as error:
        raise damaged(source.path, f"dataset 55 at byte {dataset.begin}: cannot be read ({error})") from error


def _parsed(lines: list[str], name: str) -> Nodal:
    form = [int(text) for text in lines[5].split()]
    characteristic, kind, values = form[2], form[4], form[5]
    if kind not in (2, 5) or not 0 < values <= 1000:
        raise ValueError(f"data type {kind} with {values} values a node")
    width = values * (2 if kind == 5 else 1)
    begin = _first_node(lines)
    data, nodes, rows = lines[begin:], [], []
    per_node = -(-width // 6)
    if len(data) % (per_node + 1):
        raise ValueError(f"{len(data)} lines of data; expected {per_node + 1} a node")
    for i in range(0, len(data), per_node + 1):
        nodes.append(float(int(data[i].split()[0])))
        row = parsed("\n".join(data[i + 1 : i + 1 + per_node]).encode("latin-1"), (13,) * 6)
        if len(row) != width:
            raise ValueError(f"node {nodes[-1]:g} has {len(row)} numbers, expected {width}")
        rows.append(row)
    table = np.array(rows, dtype=np.float64).reshape(len(nodes), width).T
    labels = _COMPONENTS.get(characteristic, ())
    labels = labels if len(labels) == values else tuple(f"value {i + 1}" for i in range(values))
    if kind == 5:
        labels = tuple(f"{label} ({part})" for label in labels for part in ("real", "imag"))
    group = Group(name, tuple(Channel(label) for label in ("node", *labels)))
    said = {f"line {i + 1}": line.strip() for i, line in enumerate(lines[:5]) if line.strip() not in ("", "NONE")}
    said["real values"] = " ".join(" ".join(lines[7:begin]).split())
    return Nodal(group, (np.array(nodes), *table), said)


def _first_node(lines: list[str]) -> int:
    """The line of the first node: after the integers and the reals that record 7 counts."""
    integers, reals = (int(text) for text in lines[6].split()[:2])
    return 6 + -(-(2 + integers) // 8) + -(-reals // 6)
