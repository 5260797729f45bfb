"""Cells of a spreadsheet (.xlsx) as texts, by openpyxl, which the extra ``excel`` installs.

Values are those that the spreadsheet program stored; nothing is computed, linked or run. What is unpacked is bounded.
"""

import zipfile
import zlib
from datetime import date, datetime, time
from importlib.util import find_spec
from lzma import LZMAError
from pathlib import Path
from typing import Any

from balance.input_files import LARGEST_FILE

from ..errors import RigError

LARGEST_UNPACKED = 10 * LARGEST_FILE
"""Size limit of all that the file unpacks to [bytes]."""
MOST_ROWS, MOST_COLUMNS = 20_000, 200
WORKSHEET = "runs"
"""Name of the worksheet that is read where there are several."""


def spreadsheet_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Number and cells of each row that is not blank, numbers by the shortest text that reads back to them.

    Raises RigError for a file that is none, that is too large, or whose cell has no value of its own.
    """
    if find_spec("openpyxl") is None:
        raise RigError(
            f"{path.name}: reading a spreadsheet needs openpyxl: pip install 'counterpoise[excel]', or save it as CSV"
        )
    import openpyxl

    _check_archive(path)
    try:
        values, formulas = (openpyxl.load_workbook(path, read_only=True, data_only=stored) for stored in (True, False))
        names = values.sheetnames
        if len(names) > 1 and WORKSHEET not in names:
            listed = ", ".join(names)
            raise RigError(f"{path.name}: has the worksheets {listed}: name that of the run table {WORKSHEET!r}")
        name = WORKSHEET if WORKSHEET in names else names[0]
        rows = values[name].iter_rows(max_row=MOST_ROWS + 1, max_col=MOST_COLUMNS + 1)
        behind = formulas[name].iter_rows(max_row=MOST_ROWS + 1, max_col=MOST_COLUMNS + 1)
        found = []
        for number, (cells, sources) in enumerate(zip(rows, behind, strict=True), 1):
            texts = [_text(path, number, *pair) for pair in zip(cells, sources, strict=True)]
            while texts and not texts[-1]:
                texts.pop()
            if texts:
                found.append((number, texts))
        values.close()
        formulas.close()
    except (KeyError, ValueError, TypeError, AttributeError, IndexError, SyntaxError, OSError) as error:
        raise RigError(f"{path.name}: not a spreadsheet that can be read: {error}; save it as CSV") from error
    if found and (found[-1][0] > MOST_ROWS or max(len(texts) for _, texts in found) > MOST_COLUMNS):
        raise RigError(f"{path.name}: expected at most {MOST_ROWS} rows and {MOST_COLUMNS} columns")
    return found


def _check_archive(path: Path) -> None:
    """Raise RigError for what is no archive, unpacks to too much, or declares entities."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise RigError(f"{path.name}: expected at most {LARGEST_FILE / 1e6:.0f} MB")
        with zipfile.ZipFile(path) as archive:
            if sum(part.file_size for part in archive.infolist()) > LARGEST_UNPACKED:
                raise RigError(f"{path.name}: unpacks to more than {LARGEST_UNPACKED / 1e6:.0f} MB")
            for part in archive.infolist():
                if part.filename.endswith((".xml", ".rels")) and b"<!DOCTYPE" in archive.read(part):
                    raise RigError(f"{path.name}: {part.filename} has a document type: not what a spreadsheet holds")
    except FileNotFoundError as missing:
        raise RigError(f"no such file {path.name!r}") from missing
    except (zipfile.BadZipFile, zlib.error, LZMAError, OSError, EOFError, ValueError, RuntimeError) as error:
        raise RigError(f"{path.name}: not a spreadsheet (.xlsx): {error}; save it as .xlsx or CSV") from error


def _text(path: Path, row: int, cell: Any, source: Any) -> str:  # noqa: ANN401
    """A cell as text; a whole number without a decimal point."""
    value = cell.value
    if source.data_type == "f" and value is None:
        raise RigError(
            f"{path.name}, line {row}: cell {source.coordinate} is a formula without a stored value: open and save the "
            "file in a spreadsheet program, or write the value"
        )
    if value is None:
        return ""
    if cell.data_type == "e":
        raise RigError(f"{path.name}, line {row}: cell {cell.coordinate} shows {value}: expected a value")
    if isinstance(value, datetime | date | time):
        raise RigError(f"{path.name}, line {row}: cell {cell.coordinate} is a date: expected a text or a number")
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value).strip()
