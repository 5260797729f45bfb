"""Reading Parquet with polars, batch by batch."""

from collections.abc import Iterator
from pathlib import Path

import polars

from ...findings import Finding, Refusal
from ...recording import Block, Group, Recording, Report
from ..nonfinite import watched
from ..stream import block_samples, damaged
from . import columns as columns_
from .columns import Column

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
        if (found := columns_.column(name, kind, lambda name: _first(table, name))) is not None:
            kept.append(found)
        elif isinstance(kind, polars.String | polars.Categorical | polars.Enum):
            findings.append(Finding("text_channel", name, None, "holds text, not numbers; it is not kept"))
        else:
            findings.append(Finding("left_out", name, None, f"holds {kind}, not one number a row"))
    if not kept or not rows:
        said = "; ".join(f"{f.channel} {f.message}" for f in findings[:10])
        message = f"{len(kept)} columns of numbers with {rows} rows{f' ({said})' if said else ''}"
        raise Refusal(path.name, Finding("no_data", None, None, message))
    zeros = {f"{c.name}: zero": f"{c.zero} ns since 1970" for c in kept if c.zero}
    zeros |= {key: text[:_LONGEST_TEXT] for key, text in metadata.items() if key != "ARROW:schema"}
    group = Group(path.stem, tuple(c.channel for c in kept), columns_.clock(kept))
    return Recording(
        path=path,
        format="Parquet",
        reader="testbench.readers.parquet",
        groups=(group,),
        read=lambda report: watched(_blocks(path, group, kept, report), report),
        metadata=zeros,
        findings=tuple(findings),
    )


_ERRORS = (polars.exceptions.PolarsError, OSError, ValueError, TypeError)


def _table(path: Path) -> polars.LazyFrame:
    """The one file, whatever stars its name holds."""
    return polars.scan_parquet(path, glob=False, hive_partitioning=False)


def _first(table: polars.LazyFrame, name: str) -> int | None:
    found = table.select(polars.col(name).to_physical().drop_nulls().first()).collect().item()
    return None if found is None else int(found)


def _blocks(path: Path, group: Group, kept: list[Column], report: Report) -> Iterator[Block]:
    start, rounded = 0, set[str]()
    try:
        for frame in _batches(_table(path).select([c.name for c in kept]), block_samples(len(kept))):
            if not frame.height:
                continue
            series = [frame.get_column(c.name) for c in kept]
            rounded |= {
                c.name
                for c, s in zip(kept, series, strict=True)
                if columns_.is_wide(s.dtype) and columns_.is_beyond_exact(s)
            }
            yield Block(group, tuple(c.numbers(s) for c, s in zip(kept, series, strict=True)), start)
            start += frame.height
    except _ERRORS as error:
        raise damaged(path, f"polars cannot read its rows from {start} on: {error}") from error
    for name in sorted(rounded):
        report(Finding("not_exact", name, None, "holds integers beyond 2**53, which float64 rounds"))


def _batches(table: polars.LazyFrame, rows: int) -> Iterator[polars.DataFrame]:
    """The rows in batches; a polars that has none of its own gives slices."""
    if hasattr(table, "collect_batches"):
        yield from table.collect_batches(chunk_size=rows, maintain_order=True)
        return
    start = 0
    while (frame := table.slice(start, rows).collect()).height:
        yield frame
        start += frame.height
