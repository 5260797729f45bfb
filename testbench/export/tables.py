"""Runs and groups as files of other people's tools.

Universal file, functions (58b): one a channel. Steps are written as uneven, each time with its value in full precision:
an even step has six digits in the header. Layout of the records: https://www.ceas3.uc.edu/sdrluff/

CSV: comments with the origin, a header with units, numbers that read back to the same bits.

MATLAB level 5: a struct a group with name, unit and data of each channel, and time.

Parquet: one table a group; units, origin and provenance as JSON in the metadata of the file.
"""

import csv
import re
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from balance.table_files import write_csv, write_parquet

from ..errors import StoreError
from ..recording import Samples, UniformClock
from ..runs.joined_channels import joined_table
from ..store import Run
from .columns import Column, columns, json_line, provenance, unique, unlisted_findings

_WIDTH = 80
_UNIT_WIDTH = 20
_LITTLE_ENDIAN, _IEEE, _ASCII_LINES = 1, 2, 11
_TIME_RESPONSE, _REAL_DOUBLE, _UNEVEN = 1, 4, 0
_TIME, _UNKNOWN = 17, 0


def export_uff(run: Run, groups: list[str], target: Path) -> list[str]:
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
            parts = (("name", column.channel.name, _WIDTH), ("unit", column.channel.unit or "", _UNIT_WIDTH))
            losses += [
                f"{what} {text!r} is cut, or written in ASCII"
                for what, text, width in parts
                if len(text) > width or not text.isascii()
            ]
    return losses


def _function(stream: BinaryIO, run: Run, column: Column, number: int) -> None:
    """One channel: a header of eleven lines, then time and value of each sample in turn."""
    data = np.column_stack([run.time(column.group), column.values]).astype("<f8")
    sources = ", ".join(source["name"] for source in run.provenance["sources"])
    start = run.group(column.group).start_time
    date = "NONE" if start is None else f"{datetime.fromisoformat(start.time):%d-%b-%y %H:%M:%S}"
    titles = (column.channel.name, f"run {run.name}, group {column.group}", date, f"origin: {run.origin}", sources)
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


def _ascii(text: str, width: int) -> str:
    plain = "".join(c if c.isprintable() else " " for c in text)
    return plain.encode("ascii", "replace").decode("ascii")[:width]


def export_csv(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write one group. Each number is the shortest text that reads back to it."""
    (group,) = groups
    found, clock = columns(run, group), run.group(group).clock
    headers = [" ".join(column.header.splitlines()) for column in found]
    rate = f"# rate: {clock.rate_hz!r} Hz\n" if isinstance(clock, UniformClock) else ""
    _write_csv(target, run, provenance(run), headers, [column.values for column in found], rate)
    losses = [
        f"name {column.header!r} is written on one line"
        for column, header in zip(found, headers, strict=True)
        if column.header != header
    ]
    if all(map(_is_number, headers)):
        losses.append(f"names of group {group!r} are all numbers: some readers take them for the first sample")
    return losses + unlisted_findings(run, "CSV")


def export_joined(run: Run, rate: str, to: str, target: Path) -> list[str]:
    """Write all groups as one table on one clock at ``rate``, a CSV or Parquet file that says how it was made."""
    frame, problem = joined_table(run, rate)
    units, lost = frame.attrs["units"], [problem] if problem else []
    about = {"joined": {key: value for key, value in frame.attrs.items() if key not in ("run", "origin", "units")}}
    about |= provenance(run)
    names = [
        name if not unit or re.search(rf"[(\[]{re.escape(unit)}[)\]]", name) else f"{name} ({unit})"
        for name, unit in units.items()
    ]
    names = unique([str(frame.index.name), *names])
    values = [frame.index.to_numpy(), *(frame[name].to_numpy() for name in units)]
    if to == "parquet":
        write_parquet(target, dict(zip(names, values, strict=True)), {KEY: json_line({**about, "units": units})})
        return lost
    _write_csv(target, run, about, [" ".join(name.splitlines()) for name in names], values)
    return lost + unlisted_findings(run, "CSV")


def _write_csv(
    target: Path, run: Run, about: dict[str, Any], headers: list[str], values: list[Samples], more: str = ""
) -> None:
    """Comments with the origin and what is known ``about`` the values but findings; headers; a row a sample."""
    with target.open("w", encoding="utf-8", newline="") as text:
        text.write(f"# origin: {run.origin}\n")
        known = {key: value for key, value in about.items() if key not in ("origin", "findings")}
        text.writelines(f"# {key} = {json_line(value)}\n" for key, value in known.items())
        text.write(more)
        comment = any("#" in header for header in headers)  # unless it is quoted
        csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_ALL if comment else csv.QUOTE_MINIMAL).writerow(headers)
    with target.open("ab") as stream:
        write_csv(stream, values)


def _is_number(header: str) -> bool:
    try:
        float(header)
    except ValueError:
        return False
    return True


LARGEST = 2**31 - 1
"""Bytes that a variable of level 5 may have: here a struct with all channels of a group."""
LONGEST = 63
"""Characters that MATLAB takes in a name."""


def export_mat(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write all groups; each channel is a field of its HDF5 name with ``name``, ``unit`` and ``data``."""
    from scipy.io import savemat

    names = unique([f"group_{run.group(name).path.rpartition('/')[2]}" for name in groups], LONGEST)
    content: dict[str, Any] = {"counterpoise": json_line(provenance(run))}
    content |= {name: _struct(run, group) for name, group in zip(names, groups, strict=True)}
    savemat(str(target), content, appendmat=False, long_field_names=True)
    return []


def _struct(run: Run, name: str) -> dict[str, Any]:
    """A group; no two channels have one field, however long their names are."""
    group, found = run.group(name), columns(run, name)
    if (size := 8 * group.samples * len(found)) > LARGEST:
        raise StoreError(
            f"{run.path.name}: group {name!r} has {size} bytes of samples, a variable of a MAT file no more than "
            f"{LARGEST}; use parquet"
        )
    keys = ["time_s" if column.index is None else group.keys[column.index] for column in found]
    fields = {
        key: {"name": column.channel.name, "unit": column.channel.unit or "", "data": column.values[:, np.newaxis]}
        for key, column in zip(unique([f"channel_{key}" for key in keys], LONGEST), found, strict=True)
    }
    return {"name": name, **fields}


KEY = "counterpoise"
"""Key of the metadata."""


def export_parquet(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write one group."""
    (group,) = groups
    found = columns(run, group)
    names = unique([column.channel.name for column in found])
    units = {name: column.channel.unit for name, column in zip(names, found, strict=True)}
    table = {name: column.values for name, column in zip(names, found, strict=True)}
    write_parquet(target, table, {KEY: json_line({"group": group, **provenance(run), "units": units})})
    return []
