"""Tables of numbers as CSV and as Parquet.

CSV is written here: twice as fast as by pandas and by Python's csv module, number for number the same text. Parquet is
written by polars, which the extra ``parquet`` installs.
"""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

from numpy.typing import NDArray

from .errors import CounterpoiseError

_ROWS = 1 << 15
"""Rows of CSV that are spelled at once."""
Column = NDArray[Any]


def write_csv(
    stream: IO[bytes],
    columns: Sequence[Column],
    separator: str = ",",
    decimals: int | None = None,
    decimal_comma: bool = False,
) -> None:
    """Write rows of ``columns``, (n,) each, units as the caller names them, e.g. [m/s2], dimensionless [-].

    With so many ``decimals``, or else by the shortest text of each number that reads back to it.
    """
    form = separator.join([f"%.{decimals}f" if decimals is not None else "%r"] * len(columns)) + "\n"
    for begin in range(0, len(columns[0]) if columns else 0, _ROWS):
        rows = zip(*(column[begin : begin + _ROWS].tolist() for column in columns), strict=True)
        text = "".join([form % row for row in rows])
        stream.write((text.replace(".", ",") if decimal_comma else text).encode())


def write_csv_file(path: str | Path, columns: Mapping[str, Column], comment: str = "") -> None:
    """Write ``columns``, (n,) each, under their names, which say the unit [SI or -]; below a ``comment`` if given."""
    with Path(path).open("wb") as stream:
        stream.write((comment + ",".join(columns) + "\n").encode())
        write_csv(stream, list(columns.values()))


def can_write_parquet() -> bool:
    """Whether polars is installed; it is not imported."""
    return find_spec("polars") is not None


def write_parquet(path: str | Path, columns: Mapping[str, Column], metadata: Mapping[str, str] | None = None) -> None:
    """Write ``columns``, (n,) each, under their names, which say the unit [SI or -]; ``metadata`` are texts by key.

    Raises CounterpoiseError where polars is not installed, OSError where the file cannot be written.
    """
    if not can_write_parquet():
        raise CounterpoiseError(f"{path}: writing Parquet needs polars: pip install 'counterpoise[parquet]'")
    import polars

    with Path(path).open("wb") as stream:
        try:
            polars.DataFrame(dict(columns)).write_parquet(stream, metadata=dict(metadata or {}))
        except polars.exceptions.ComputeError as error:  # as polars calls a disk that is full
            raise OSError(str(error)) from error
