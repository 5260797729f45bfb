"""Reader of Parquet, by polars in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..isolated import open_isolated
from ..registry import Reader, ReadOptions


def open_parquet(path: Path, options: ReadOptions) -> Recording:
    """Read schema and metadata; the rows are read when asked for."""
    return open_isolated(path, "testbench.readers.parquet.library", "open_library")


READER = Reader(
    name="Parquet",
    extensions=(".parquet", ".pq"),
    identify=lambda head: head.startswith(b"PAR1"),
    open=open_parquet,
)
