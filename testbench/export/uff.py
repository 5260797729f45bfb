"""Universal file, functions (58b): one a channel, with the time of every sample in full precision.

Steps are written as uneven, each time beside its value: an even step has six digits in the header. Layout of the
records: https://www.ceas3.uc.edu/sdrluff/
"""

from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import StoreError
from ..store import Run
from .columns import Column, columns, unlisted_findings

_WIDTH = 80
_UNIT_WIDTH = 20
_LITTLE_ENDIAN, _IEEE, _ASCII_LINES = 1, 2, 11
_TIME_RESPONSE, _REAL_DOUBLE, _UNEVEN = 1, 4, 0
_TIME, _UNKNOWN = 17, 0


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write all groups that have a time; returns what a universal file does not hold."""
    losses = unlisted_findings(run, "a universal file")
    if run.conditions:
        losses.append(f"conditions of run {run.name!r}: not in a universal file; parquet and mat hold them")
    found: list[Column] = []
    for name in groups:
        group = run.group(name)
        if not group.has_time:
            losses.append(f"group {name!r} has no time: not in a universal file")
            continue
        measured = set(group.measured)
        found += [column for column in columns(run, name) if column.index in measured]
    if not found:
        raise StoreError(f"{run.path.name}: no channel with a time, which a universal file needs; use csv")
    with target.open("wb") as stream:
        for number, column in enumerate(found, 1):
            _function(stream, run, column, number)
            losses += _cut(column)
    return losses


def _function(stream: BinaryIO, run: Run, column: Column, number: int) -> None:
    """One channel: a header of eleven lines, then time and value of each sample in turn."""
    data = np.column_stack([run.time(column.group), column.values]).astype("<f8")
    sources = ", ".join(source["name"] for source in run.provenance["sources"])
    titles = (column.channel.name, f"run {run.name}, group {column.group}", "NONE", f"origin: {run.origin}", sources)
    binary = f"{_LITTLE_ENDIAN:6}{_IEEE:6}{_ASCII_LINES:12}{data.nbytes:12}{0:6}{0:6}{0:12}{0:12}"
    lines = [
        f"{-1:6}",
        f"{58:6}b{binary}",
        *(f"{_ascii(title, _WIDTH):{_WIDTH}}" for title in titles),
        f"{_TIME_RESPONSE:5}{number:10}{0:5}{0:10} {'NONE':10}{number:10}{0:4} {'NONE':10}{0:10}{0:4}",
        f"{_REAL_DOUBLE:10}{len(data):10}{_UNEVEN:10}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}",
        _axis(_TIME, "Time", "s"),
        _axis(_UNKNOWN, "NONE", _ascii(column.channel.unit or "NONE", _UNIT_WIDTH)),
        _axis(_UNKNOWN, "NONE", "NONE"),
        _axis(_UNKNOWN, "NONE", "NONE"),
    ]
    stream.write("".join(f"{line}\n" for line in lines).encode("ascii"))
    stream.write(data.tobytes())
    stream.write(f"{-1:6}\n".encode("ascii"))


def _axis(kind: int, label: str, unit: str) -> str:
    return f"{kind:10}{0:5}{0:5}{0:5} {label:20} {unit:20}"


def _cut(column: Column) -> list[str]:
    """Names and units that do not fit."""
    parts = (("name", column.channel.name, _WIDTH), ("unit", column.channel.unit or "", _UNIT_WIDTH))
    return [
        f"{what} {text!r} is cut, or written in ASCII"
        for what, text, width in parts
        if len(text) > width or not text.isascii()
    ]


def _ascii(text: str, width: int) -> str:
    plain = "".join(c if c.isprintable() else " " for c in text)
    return plain.encode("ascii", "replace").decode("ascii")[:width]
