"""Reader of Cortex ``.forces`` text: rate and number of samples above tab-separated forces of each plate.

The file names no units. By Cortex's convention they are N, mm and N mm, with Y upright, which is left to the rig.
"""

from collections.abc import Iterator
from pathlib import Path

from ..recording import Block, Channel, Finding, Group, Recording, Refusal, Report, UniformClock
from .csv.cell_syntax import as_number
from .csv.dialect import Dialect
from .csv.row_parser import RowParser
from .csv.table import Table
from .csv.text_blocks import read_first_lines
from .header_claims import key_value_pairs
from .registry import ReadOptions

_NAMES = "#Sample\t"


def open_forces(path: Path, options: ReadOptions) -> Recording:
    """Read the head of a ``.forces`` file; its rows are read when asked for."""
    encoding, lines = read_first_lines(path, options.encoding)
    named = next((i for i, line in enumerate(lines) if line.startswith(_NAMES)), None)
    if named is None:
        message = f"expected a line of names that begins with {_NAMES.strip()!r}"
        raise Refusal(path.name, Finding("no_data", None, None, message))
    stated = key_value_pairs(lines[:named])
    names = lines[named].rstrip("\t").split("\t")
    rate, declared = _number(path, stated, "SampleRate"), int(_number(path, stated, "NumberOfSamples"))
    group = Group(path.stem, tuple(Channel(name) for name in names), UniformClock(rate))
    form = RowParser(Dialect("\t", "."), len(names))
    table = Table(path, encoding, form, group, tuple(range(len(names))), named + 2, lines[named])

    def read(report: Report) -> Iterator[Block]:
        found = 0
        for block in table.blocks(report):
            found += len(block)
            yield block
        if found != declared:
            message = f"the header declares {declared} samples, the file holds {found}"
            report(Finding("count_contradiction", None, None, message))

    return Recording(path, "Cortex forces", __name__, (group,), read, metadata=stated)


def _number(path: Path, stated: dict[str, str], key: str) -> float:
    value = as_number(stated.get(key, "")) or 0.0
    if not 0.0 < value < float("inf"):
        message = f"{key} is {stated.get(key, 'missing')!r}; expected a positive number above the names"
        raise Refusal(path.name, Finding("no_data", None, None, message))
    return value
