"""Reader of Parquet, by polars in a process of its own."""

from pathlib import Path

from ...recording import Recording
from ..registry import Reader, ReadOptions, needs
from ..subprocess_reader import open_in_subprocess


def open_parquet(path: Path, options: ReadOptions) -> Recording:
    """Read schema and metadata; the rows are read when asked for."""
    return open_in_subprocess(path, "testbench.readers.parquet.library", extra="parquet")


READER = Reader(
    name="Parquet",
    extensions=(".parquet", ".pq"),
    identify=lambda head: head.startswith(b"PAR1"),
    open=open_parquet,
    needs=needs("parquet"),
)
