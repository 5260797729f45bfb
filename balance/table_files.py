"""Tables of numbers as CSV and as Parquet.

CSV is written here: twice as fast as by pandas and by Python's csv module, number for number the same text. Parquet is
written by pyarrow, which the extra ``parquet`` installs.
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
    """Whether pyarrow is installed; it is not imported."""
    return find_spec("pyarrow") is not None


def write_parquet(path: str | Path, columns: Mapping[str, Column], metadata: Mapping[str, str] | None = None) -> None:
    """Write ``columns``, (n,) each, under their names, which say the unit [SI or -]; ``metadata`` are texts by key.

    Raises CounterpoiseError where pyarrow is not installed, OSError where the file cannot be written.
    """
    if not can_write_parquet():
        raise CounterpoiseError(f"{path}: writing Parquet needs pyarrow: pip install 'counterpoise[parquet]'")
    import pyarrow
    from pyarrow import parquet

    table = pyarrow.table(dict(columns)).replace_schema_metadata(dict(metadata or {}))
    with Path(path).open("wb") as stream:
        parquet.write_table(table, stream, use_dictionary=False)  # measured values hardly repeat


def read_parquet(path: str | Path) -> dict[str, Column]:
    """The columns of a table that was written by :func:`write_parquet`, (n,) each, under their names [SI or -]."""
    from pyarrow import parquet

    table = parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}
