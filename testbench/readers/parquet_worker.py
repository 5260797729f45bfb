"""Reading Parquet with pyarrow, batch by batch.

Columns of a table as numbers: integers and floats as they are, points in time counted from a stated zero; texts beside.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import compute, parquet, types

from ..recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Refusal,
    Report,
    Samples,
    TextLog,
    point_in_time,
)
from .byte_source import block_samples
from .csv.header import is_time_name, named_channels
from .format_findings import damaged, is_beyond_exact, rounded_integers, watch_nonfinite
from .header_claims import recorded_time

_UNITS = {"ns": "ns", "us": "µs", "ms": "ms", "s": "s"}
_MOST_COLUMNS, _LONGEST_TEXT = 10_000, 2000
_ERRORS = (pyarrow.ArrowException, OSError, ValueError, TypeError, KeyError)


@dataclass(frozen=True)
class Column:
    """A column that is read: its name in the file, the channel that it becomes, and its numbers; None: of text.

    ``zero`` is subtracted from what is counted in nanoseconds since 1970, which float64 does not hold.
    """

    name: str
    channel: Channel | None
    is_point_in_time: bool = False
    may_be_clock: bool = False
    zero: int = 0
    has_zone: bool = False

    def numbers(self, array: Any) -> Samples:  # noqa: ANN401
        """The values as float64; NaN where there is none."""
        if types.is_temporal(array.type):
            array = array.cast(pyarrow.int32() if array.type.bit_width == 32 else pyarrow.int64()).cast(pyarrow.int64())
        elif types.is_boolean(array.type):
            array = array.cast(pyarrow.uint8())
        if self.zero:
            array = compute.subtract(array, self.zero)
        return np.asarray(array.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False), dtype=np.float64)


def open_library(path: Path) -> Recording:
    """Read schema and metadata; the rows are read when asked for."""
    findings: list[Finding] = []
    try:
        with parquet.ParquetFile(path, pre_buffer=False) as file:
            schema, metadata = file.schema_arrow, file.metadata.metadata or {}
            rows = sum(file.metadata.row_group(i).num_rows for i in range(file.num_row_groups))
            if len(schema) > _MOST_COLUMNS:
                raise Refusal(path.name, Finding("too_large", None, None, f"{len(schema)} columns"))
            given = [_column(file, i, findings) for i in range(len(schema))]
    except _ERRORS as error:
        raise damaged(path, f"pyarrow cannot read it: {error}") from error
    kept = [column for column in given if column is not None]
    numbers = [(column, column.channel) for column in kept if column.channel is not None]
    if not numbers or not rows:
        stated = "; ".join(f"{f.channel} {f.message}" for f in findings[:10])
        message = f"{len(numbers)} columns of numbers with {rows} rows{f' ({stated})' if stated else ''}"
        raise Refusal(path.name, Finding("no_data", None, None, message))
    zeros = {f"{c.name}: zero": f"{c.zero} ns since 1970" for c in kept if c.zero}
    plain = {key.decode("utf-8", "replace"): text.decode("utf-8", "replace") for key, text in metadata.items()}
    zeros |= {key: text[:_LONGEST_TEXT] for key, text in plain.items() if key != "ARROW:schema"}
    # the column of time: named so, or else the only one of points in time that rise
    named = [i for i, (_, channel) in enumerate(numbers) if is_time_name(channel.name)]
    points = [i for i, (column, _) in enumerate(numbers) if column.may_be_clock]
    time, zero = None, None
    for i in named[:1] or (points if len(points) == 1 else []):
        column, channel = numbers[i]
        time = recorded_time(i, channel.unit)
        if column.is_point_in_time:  # counted from 1970, or from the first one
            zero = point_in_time(column.zero, f"column {column.name}", None, 0 if column.has_zone else None)
    group, texts = Group(path.stem, tuple(channel for _, channel in numbers), time, zero), TextLog()
    return Recording(
        path=path,
        format="Parquet",
        reader="testbench.readers.parquet",
        groups=(group,),
        read=lambda report: watch_nonfinite(_blocks(path, group, given, texts, report), report),
        metadata=zeros,
        findings=tuple(findings),
        texts=texts,
    )


def _column(file: parquet.ParquetFile, i: int, findings: list[Finding]) -> Column | None:
    """How the ``i``-th column is read; None if it holds neither numbers nor texts, which is a finding."""
    name, kind = file.schema_arrow.field(i).name, file.schema_arrow.field(i).type
    if types.is_timestamp(kind):
        # The first points in time of a column (n,) [its unit since 1970].
        batches = (batch.column(0).cast(pyarrow.int64()).drop_null() for batch in _batches(file, [i], 1 << 12))
        first = next((np.asarray(times) for times in batches if len(times)), np.empty(0, np.int64))
        zero = int(first[0]) if kind.unit == "ns" and len(first) else 0
        return Column(
            name, Channel(name, _UNITS[kind.unit]), True, bool((np.diff(first) > 0).all()), zero, kind.tz is not None
        )
    if types.is_temporal(kind) and not types.is_interval(kind):
        unit = "day" if types.is_date32(kind) else _UNITS[getattr(kind, "unit", "ms")]
        return Column(name, Channel(name, unit))
    if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_boolean(kind):
        return Column(name, named_channels([name], [""])[0])
    letters = kind.value_type if types.is_dictionary(kind) else kind
    if types.is_string(letters) or types.is_large_string(letters):
        return Column(name, None)
    findings.append(Finding("left_out", name, None, f"holds {kind}, not one number a row"))
    return None


def _batches(file: parquet.ParquetFile, columns: list[int], rows: int) -> Iterator[Any]:
    """Batches of these columns of the table, each of which may lie in the file as several."""
    wanted = [file.schema_arrow.field(i).name for i in columns]
    leaves = [file.schema.column(k).path for k in range(len(file.schema))]
    names = [leaf for leaf in leaves if leaf in wanted or leaf.split(".")[0] in wanted]
    for batch in file.iter_batches(rows, columns=names, use_threads=False):
        if batch.num_columns != len(columns):  # pyarrow takes a column a.b for a part of a column a
            batch = batch.select(wanted)
        if batch.num_rows:
            yield batch


def _blocks(path: Path, group: Group, given: list[Column | None], texts: TextLog, report: Report) -> Iterator[Block]:
    start, rounded = 0, set[str]()
    indices = [i for i, column in enumerate(given) if column is not None]
    try:
        with parquet.ParquetFile(path, pre_buffer=False) as file:
            for batch in _batches(file, indices, block_samples(len(indices))):
                columns = []
                for i, array in zip(indices, batch.columns, strict=True):
                    column = given[i]
                    if column is None or column.channel is None:
                        values = array.cast(pyarrow.string()).to_pylist()
                        texts.take_all(group.name, file.schema_arrow.field(i).name, start, values)
                        continue
                    columns.append(column.numbers(array))
                    is_exact = types.is_integer(array.type) or types.is_decimal(array.type)
                    if is_exact and is_beyond_exact(columns[-1]):
                        rounded.add(column.name)
                yield Block(group, tuple(columns), start)
                start += batch.num_rows
    except _ERRORS as error:
        raise damaged(path, f"pyarrow cannot read its rows from {start} on: {error}") from error
    for name in sorted(rounded):
        report(rounded_integers(name))
