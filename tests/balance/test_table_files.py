"""CSV and Parquet, as others read them."""

import io

import numpy as np
import polars
import pytest

from balance import table_files
from balance.errors import CounterpoiseError
from balance.table_files import write_csv, write_parquet

RANDOM = np.random.default_rng(8)


@pytest.mark.parametrize("rows", [0, 1, 7, 1000])
def test_parquet_reads_back_to_the_same_bits(tmp_path, rows):
    """Floats and integers of both widths, what is no number, texts of the file."""
    columns = {
        "İvme (m/s²)": RANDOM.normal(size=rows),
        "single": RANDOM.normal(size=rows).astype("f4"),
        "count": RANDOM.integers(-(1 << 60), 1 << 60, rows),
        "small": RANDOM.integers(-9, 9, rows, dtype="i4"),
    }
    columns["İvme (m/s²)"][:3] = (np.nan, np.inf, -0.0)[: min(rows, 3)]
    write_parquet(tmp_path / "t.parquet", columns, {"origin": "simulated", "ü": "ğ"})
    table = polars.read_parquet(tmp_path / "t.parquet")
    assert table.columns == list(columns)
    for name, values in columns.items():
        assert table[name].to_numpy().astype(values.dtype).tobytes() == values.tobytes()
    found = polars.read_parquet_metadata(tmp_path / "t.parquet")
    assert (found["origin"], found["ü"]) == ("simulated", "ğ")


def test_parquet_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    """One line, and no file."""
    monkeypatch.setattr(table_files, "find_spec", lambda name: None)
    with pytest.raises(CounterpoiseError, match=r"t\.parquet: .*pip install 'counterpoise\[parquet\]'"):
        write_parquet(tmp_path / "t.parquet", {"a": np.ones(2)})
    assert not list(tmp_path.iterdir())


def test_csv_reads_back_to_the_same_bits(monkeypatch):
    """The shortest text of each number, in blocks; to fixed decimals with a decimal comma."""
    monkeypatch.setattr(table_files, "_ROWS", 7)
    columns = [RANDOM.normal(size=40) * 10.0**power for power in (-300, 0, 300)]
    stream = io.BytesIO()
    write_csv(stream, columns)
    stream.seek(0)
    read = np.loadtxt(stream, delimiter=",").T
    assert [column.tobytes() for column in read] == [column.tobytes() for column in columns]
    stream = io.BytesIO()
    write_csv(stream, [np.array([1.0005, -0.25]), np.array([3.0, 4.0])], ";", decimals=3, decimal_comma=True)
    assert stream.getvalue() == b"1,000;3,000\n-0,250;4,000\n"
