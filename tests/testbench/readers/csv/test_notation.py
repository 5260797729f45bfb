"""Numbers in the notation of Fortran, typography and counters are the numbers that they say; codes stay texts."""

import numpy as np
import pytest

from testbench.readers.csv.cell_syntax import MINUS, is_number_like, plain_number

from .. import reading

VALUES = np.array([1500.0, -0.088, 0.0, 2.5e-7, -1234.5, 31.0] * 60)


def read(tmp_path, texts, delimiter=",", decimal="."):
    """A log of a time and these texts, read to its end."""
    rows = "".join(f"0{decimal}{i:03d}{delimiter}{text}\n" for i, text in enumerate(texts))
    (tmp_path / "log.csv").write_text(f"Time (s){delimiter}F (N)\n{rows}", encoding="utf-8")
    return reading.read(tmp_path / "log.csv")


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", ".")])
@pytest.mark.parametrize("letter", ["D", "d"])
def test_exponents_of_fortran(tmp_path, delimiter, decimal, letter):
    """1.5D+03 is 1500, in the bits that ``float()`` gives 1.5E+03."""
    texts = [f"{v:.17E}".replace("E", letter).replace(".", decimal) for v in VALUES]
    found = read(tmp_path, texts, delimiter, decimal)
    assert found.column("F (N)").tolist() == VALUES.tolist()
    assert not [f for f in found.findings if f.severity > 0]
    assert "number_notation" in found.codes


def test_a_typographic_minus(tmp_path):
    """U+2212 is a minus, also in a column whose first negative number comes late."""
    texts = [f"{i}.25,{i - 500}.75".replace("-", MINUS) for i in range(1000)]
    texts[999] = f"{MINUS}1.5,2"
    rows = "".join(f"{i},{text}\n" for i, text in enumerate(texts))
    (tmp_path / "log.csv").write_text(f"Time (s),p (N),q (N)\n{rows}", encoding="utf-8")
    found = reading.read(tmp_path / "log.csv")
    assert found.column("p (N)")[-1] == -1.5
    assert found.column("q (N)")[:2].tolist() == [-500.75, -499.75]
    assert not [f for f in found.findings if f.severity > 0]


def test_hexadecimal_counts(tmp_path):
    """Counts of a converter in base 16."""
    found = read(tmp_path, [f"0x{i:04X}" for i in range(300)])
    assert found.column("F (N)").tolist() == list(range(300))


@pytest.mark.parametrize("text", ["12D4", "0x", "0xFG", "0x12345678901234", "D5", "1.5D", "1.5D+1234", "1e5D2", "--1"])
def test_codes_stay_as_they_are(text):
    """What may be the name of a part, or is no number at all, is none."""
    assert plain_number(text) == text
    assert not is_number_like(text)


def test_in_a_file_of_nothing_else(tmp_path):
    """Rows of such numbers alone are rows of data."""
    rows = "".join(f"{i / 100:.4E} {v:.6E}\n".replace("E", "D") for i, v in enumerate(VALUES))
    (tmp_path / "log.txt").write_text("Time F\n" + rows)
    assert reading.read(tmp_path / "log.txt").column("F").tolist() == [float(f"{v:.6E}") for v in VALUES]
