"""Reading Parquet with polars, batch by batch.

Columns of a table as numbers: integers and floats as they are, points in time counted from a stated zero.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars

from ..recording import (
    Block,
    Channel,
    Finding,
    Group,
    Recording,
    Refusal,
    Report,
    Samples,
    StartTime,
    TimeColumn,
    point_in_time,
)
from .byte_source import block_samples
from .csv.header import is_time_name, named_channels
from .format_findings import damaged, rounded_integers, text_channel, watch_nonfinite
from .header_claims import recorded_time

_UNITS = {"ns": "ns", "us": "µs", "ms": "ms"}
_EXACT = 2.0**53


@dataclass(frozen=True)
class Column:
    """A column that is read: its name in the file, the channel that it becomes, and its numbers.

    ``zero`` is subtracted from what is counted in nanoseconds since 1970, which float64 does not hold.
    """

    name: str
    channel: Channel
    is_point_in_time: bool = False
    zero: int = 0
    has_zone: bool = False

    def numbers(self, series: polars.Series) -> Samples:
        """The values as float64; NaN where there is none."""
        if series.dtype.is_temporal():
            series = series.to_physical()
        if self.zero:
            series = series.cast(polars.Int64) - self.zero
        return np.asarray(series.cast(polars.Float64).to_numpy(), dtype=np.float64)


def column(name: str, kind: polars.DataType, table: polars.LazyFrame) -> Column | None:
    """How a column of ``table`` is read; None if it holds no numbers."""
    if isinstance(kind, polars.Datetime):
        first = None
        if kind.time_unit == "ns":
            first = table.select(polars.col(name).to_physical().drop_nulls().first()).collect().item()
        return Column(name, Channel(name, _UNITS[kind.time_unit]), True, int(first or 0), kind.time_zone is not None)
    if isinstance(kind, polars.Duration | polars.Time | polars.Date):
        unit = "day" if isinstance(kind, polars.Date) else _UNITS[getattr(kind, "time_unit", "ns")]
        return Column(name, Channel(name, unit))
    if kind.is_numeric() or isinstance(kind, polars.Boolean):
        return Column(name, named_channels([name], [""])[0])
    return None


def is_rounded(series: polars.Series) -> bool:
    """Whether it holds whole numbers of which float64 may round one."""
    is_wide = isinstance(series.dtype, polars.Int64 | polars.UInt64 | polars.Int128)
    return is_wide and bool((series.cast(polars.Float64).abs() >= _EXACT).any())


def clock(columns: list[Column]) -> TimeColumn | None:
    """The column of time: named so, or else the only one of points in time."""
    named = [i for i, c in enumerate(columns) if is_time_name(c.channel.name)]
    points = [i for i, c in enumerate(columns) if c.is_point_in_time]
    found = named[:1] or (points if len(points) == 1 else [])
    return recorded_time(found[0], columns[found[0]].channel.unit) if found else None


def _zero(time: Column) -> StartTime | None:
    """When the times are zero: points in time are counted from 1970, or from the first one."""
    if not time.is_point_in_time:
        return None
    return point_in_time(time.zero, f"column {time.name}", None, 0 if time.has_zone else None)


_MOST_COLUMNS, _LONGEST_TEXT = 10_000, 2000


def open_library(path: Path) -> Recording:
    """Read schema and metadata; the rows are read when asked for."""
    try:
        table = _table(path)
        schema = table.collect_schema()
        metadata = polars.read_parquet_metadata(path)
        rows = int(table.select(polars.len()).collect().item())
    except _ERRORS as error:
        raise damaged(path, f"polars cannot read it: {error}") from error
    if len(schema) > _MOST_COLUMNS:
        raise Refusal(path.name, Finding("too_large", None, None, f"{len(schema)} columns"))
    findings: list[Finding] = []
    kept: list[Column] = []
    for name, kind in schema.items():
        if (found := column(name, kind, table)) is not None:
            kept.append(found)
        elif isinstance(kind, polars.String | polars.Categorical | polars.Enum):
            findings.append(text_channel(name))
        else:
            findings.append(Finding("left_out", name, None, f"holds {kind}, not one number a row"))
    if not kept or not rows:
        stated = "; ".join(f"{f.channel} {f.message}" for f in findings[:10])
        message = f"{len(kept)} columns of numbers with {rows} rows{f' ({stated})' if stated else ''}"
        raise Refusal(path.name, Finding("no_data", None, None, message))
    zeros = {f"{c.name}: zero": f"{c.zero} ns since 1970" for c in kept if c.zero}
    zeros |= {key: text[:_LONGEST_TEXT] for key, text in metadata.items() if key != "ARROW:schema"}
    time = clock(kept)
    group = Group(path.stem, tuple(c.channel for c in kept), time, None if time is None else _zero(kept[time.index]))
    return Recording(
        path=path,
        format="Parquet",
        reader="testbench.readers.parquet",
        groups=(group,),
        read=lambda report: watch_nonfinite(_blocks(path, group, kept, report), report),
        metadata=zeros,
        findings=tuple(findings),
    )


_ERRORS = (polars.exceptions.PolarsError, OSError, ValueError, TypeError)


def _table(path: Path) -> polars.LazyFrame:
    """The one file, whatever stars its name holds."""
    return polars.scan_parquet(path, glob=False, hive_partitioning=False)


def _blocks(path: Path, group: Group, kept: list[Column], report: Report) -> Iterator[Block]:
    start, rounded = 0, set[str]()
    try:
        for frame in _batches(_table(path).select([c.name for c in kept]), block_samples(len(kept))):
            if not frame.height:
                continue
            series = [frame.get_column(c.name) for c in kept]
            rounded |= {c.name for c, s in zip(kept, series, strict=True) if is_rounded(s)}
            yield Block(group, tuple(c.numbers(s) for c, s in zip(kept, series, strict=True)), start)
            start += frame.height
    except _ERRORS as error:
        raise damaged(path, f"polars cannot read its rows from {start} on: {error}") from error
    for name in sorted(rounded):
        report(rounded_integers(name))


def _batches(table: polars.LazyFrame, rows: int) -> Iterator[polars.DataFrame]:
    """The rows in batches; a polars that has none of its own gives slices."""
    if hasattr(table, "collect_batches"):
        yield from table.collect_batches(chunk_size=rows, maintain_order=True)
        return
    start = 0
    while (frame := table.slice(start, rows).collect()).height:
        yield frame
        start += frame.height
