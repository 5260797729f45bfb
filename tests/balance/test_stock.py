"""Stock plates from CSV; wrong rows are named."""

from pathlib import Path

import pytest

from balance import stock
from balance.errors import DataError


def test_shipped_stock() -> None:
    """Four plates, two of each."""
    plates = stock.load("kiper2019")
    assert plates[0] == stock.Plate("M1", 5.02746, 2)
    assert len(plates) == 4
    assert stock.mass_of(["M1", "M2", "M4"], plates) == pytest.approx(17.24375)


def test_a_file_as_spreadsheets_write_it(tmp_path: Path) -> None:
    """A byte-order mark, CRLF and blanks do not matter; the columns may stand in any order."""
    path = tmp_path / "plates.csv"
    path.write_bytes("\ufeffquantity,name,mass_kg\r\n3, small ,0.5\r\n".encode())
    assert stock.load(path) == [stock.Plate("small", 0.5, 3)]


WRONG = {
    "no rows": ("name,mass_kg,quantity\n", "at least one plate"),
    "other columns": ("name,mass,quantity\nM1,5,2\n", "expected the columns name,mass_kg,quantity"),
    "semicolons": ("name;mass_kg;quantity\nM1;5;2\n", "expected the columns"),
    "empty": ("", "expected the columns"),
    "decimal comma": ('name,mass_kg,quantity\nM1,"5,02",2\n', "plate 1: expected a name, a mass in kg"),
    "half a plate": ("name,mass_kg,quantity\nM1,5,2\nM2,5,1.5\n", "plate 2: expected a name, a mass in kg and a whole"),
    "negative mass": ("name,mass_kg,quantity\nM1,-5,2\n", "a mass above zero"),
    "no mass": ("name,mass_kg,quantity\nM1,nan,2\n", "a mass above zero"),
    "grams": ("name,mass_kg,quantity\nM1,5027 g,2\n", "a mass in kg"),
    "negative quantity": ("name,mass_kg,quantity\nM1,5,-2\n", "a quantity of zero or more"),
    "nameless": ("name,mass_kg,quantity\n ,5,2\n", "expected a name"),
    "short row": ("name,mass_kg,quantity\nM1,5\n", "plate 1"),
    "long row": ("name,mass_kg,quantity\nM1,5,2,7\n", "plate 1"),
    "long second row": ("name,mass_kg,quantity\nM1,5,2\nM2,6,2,7\n", "plate 2: more cells than columns"),
    "twice": ("name,mass_kg,quantity\nM1,5,2\nM1,6,2\n", "two plates have the same name"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_stock_is_refused(tmp_path: Path, case: str) -> None:
    """File, row, what was found and what was expected."""
    content, message = WRONG[case]
    (tmp_path / "plates.csv").write_text(content, encoding="utf-8")
    with pytest.raises(DataError, match=rf"plates\.csv.*{message}"):
        stock.load(tmp_path / "plates.csv")


def test_not_text_and_not_there(tmp_path: Path) -> None:
    """A file in another encoding, and a stock that is not shipped."""
    (tmp_path / "plates.csv").write_bytes("name,mass_kg,quantity\nÇelik,5,2\n".encode("cp1254"))
    with pytest.raises(DataError, match=r"plates\.csv: not a CSV file in UTF-8"):
        stock.load(tmp_path / "plates.csv")
    with pytest.raises(DataError, match=r"shelf: no such file.*kiper2019"):
        stock.load("shelf")


def test_unknown_plates_are_listed() -> None:
    """A plate that is not in stock."""
    with pytest.raises(DataError, match="no plate 'M9' in stock: there are M1, M2, M3, M4"):
        stock.mass_of(["M1", "M9"], stock.load("kiper2019"))
