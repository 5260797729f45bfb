"""Parquet: one table a group; units, origin and provenance as JSON in the metadata of the file."""

from pathlib import Path

from balance.table_files import write_parquet

from ..store import Run
from .columns import columns, line, provenance, unique

KEY = "counterpoise"
"""Key of the metadata."""


def write(run: Run, groups: list[str], target: Path) -> list[str]:
    """Write one group."""
    (group,) = groups
    found = columns(run, group)
    names = unique([column.channel.name for column in found])
    units = {name: column.channel.unit for name, column in zip(names, found, strict=True)}
    table = {name: column.values for name, column in zip(names, found, strict=True)}
    write_parquet(target, table, {KEY: line({"group": group, **provenance(run), "units": units})})
    return []
