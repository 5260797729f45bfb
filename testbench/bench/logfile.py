"""Logs as text: comments that say what they are, a header with units, fixed decimals in the logger's own marks."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from balance.table_files import write_csv

from ..rig import Column
from ..rig.bench import Logger
from .loggers import Log


def write(path: Path, logger: Logger, columns: Sequence[Column], log: Log, about: Mapping[str, str]) -> None:
    """Write a log as CSV; ``about`` goes into comments. Marked as simulated, whatever ``about`` says."""
    timed = logger.clock == "recorded"
    if not timed:
        about = {**about, "rate": f"{logger.rate:g} Hz"}
    comments = "".join(f"# {key}: {value}\n" for key, value in {"origin": "simulated", **about}.items())
    names = ["Time (s)"] * timed + [f"{column.channel} ({column.unit})" for column in columns]
    table = [*([log.time] if timed else []), *log.columns.values()]
    with path.open("wb") as file:
        file.write((comments + logger.delimiter.join(names) + "\n").encode("utf-8"))
        write_csv(file, table, logger.delimiter, logger.decimals, decimal_comma=logger.decimal == ",")
