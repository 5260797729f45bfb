"""The sheets of a workbook (.xlsx, .xlsm) as texts, by openpyxl: a line a row, the values that were stored.

Nothing is computed, run or followed. Numbers are the shortest texts that read back to them, times such as
2024-03-01 12:00:00.250000; a formula without a stored value is its own text.
"""

import re
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime, timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any

import openpyxl
from openpyxl.styles.numbers import BUILTIN_FORMATS, is_datetime
from openpyxl.styles.numbers import BUILTIN_FORMATS_MAX_SIZE as _OWN
from openpyxl.utils import column_index_from_string, get_column_letter
from openpyxl.worksheet._reader import CELL_TAG, FORMULA_TAG, VALUE_TAG, WorkSheetParser

from ..recording import Finding, Refusal
from ..units import is_unit
from .csv.cell_syntax import as_number
from .format_findings import cut, damaged

MOST_ROWS, MOST_COLUMNS = 1 << 20, 1 << 14
"""Those of a sheet, by the format."""
_SMALL, _TIMES = 64 << 20, 200
"""What a workbook may unpack to whatever its size [bytes], and how many times its size if that is more."""
_HEAD = 400
"""Rows in which names are looked for; merged cells are of interest there alone."""
_TRUE = ("1", "true")
_YEAR = 366
"""Days below which a time is one of a day or of a stop watch, and none of the calendar."""
_LITERAL = re.compile(r'"[^"]*"|\[[^]]*\]|[\\_*].')
"""What a format of numbers shows as it is."""
_PLAIN = str.maketrans(
    {'"': "\N{DOUBLE PRIME}", "\0": None} | dict.fromkeys("\t\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029", " ")
)
"""What a line of cells cannot hold."""


def as_texts(path: Path, folder: str) -> dict[str, Any]:
    """Write each sheet to ``folder``, as ``1.txt``, ``2.txt``, ...; what else is known of them, and of the workbook."""
    most = _most_bytes(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with (
            path.open("rb") as file,  # by its name openpyxl would refuse what is called otherwise
            closing(openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)) as book,
        ):
            sheets = []
            for number, sheet in enumerate(book.worksheets, 1):
                told = _Sheet(path, book, sheet).write(Path(folder, f"{number}.txt"), most)
                sheets.append({"title": sheet.title, "is_hidden": sheet.sheet_state != "visible", **told})
            stated = book.properties
    names = ("title", "subject", "creator", "description", "keywords", "created", "modified")
    given = {name: str(value) for name in names if (value := getattr(stated, name)) is not None}
    return {"worksheets": sheets, "metadata": given}


def _most_bytes(path: Path) -> int:
    """What a sheet may be as text [bytes]. Raises Refusal for what is no workbook, or unpacks to too much."""
    most = max(_SMALL, _TIMES * path.stat().st_size)
    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
    except zipfile.BadZipFile as error:
        raise cut(path, f"the list of its parts, with which it ends, cannot be read: {error}") from error
    packed = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # zipfile unpacks no more of these than is declared
    if sum(part.file_size for part in parts) > most or any(part.compress_type not in packed for part in parts):
        message = f"unpacks to more than {most >> 20} MiB, or is packed in a way that no workbook is"
        raise Refusal(path.name, Finding("too_large", None, None, message))
    if not any(part.filename.lstrip("/") == "xl/workbook.xml" or "workbook" in part.filename for part in parts):
        raise damaged(path, "it holds no workbook")
    return most


class _Sheet(WorkSheetParser):  # type: ignore[misc]
    """The rows of one sheet, read once from its beginning to its end."""

    def __init__(self, path: Path, book: Any, sheet: Any) -> None:  # noqa: ANN401
        self._path, self._book, self._sheet = path, book, sheet
        super().__init__(None, sheet._shared_strings, data_only=True)  # no formats of dates: numbers stay numbers
        own, ids = book._number_formats, [style.numFmtId for style in book._cell_styles]
        forms = [own[i - _OWN] if _OWN <= i < _OWN + len(own) else BUILTIN_FORMATS.get(i) or "" for i in ids]
        self._kinds = ["%" if "%" in _LITERAL.sub("", form) else is_datetime(form.lower()) for form in forms]
        self._in_percent, self._shares = set[int](), set[int]()
        self._used, self._formulas, self._rows, self._hidden_rows = set[int](), Counter[int](), 0, 0
        self._letters = dict[str, int]()

    def parse_row(self, row: Any) -> tuple[int, dict[int, str]]:  # noqa: ANN401
        """Number of the row, and the text of each cell that holds something by its column."""
        self.row_counter = int(row.get("r", self.row_counter + 1))  # type: ignore[has-type]
        self.col_counter = 0
        self._hidden_rows += row.get("hidden") in _TRUE
        given = dict[int, str]()
        for element in row.iterfind(CELL_TAG):
            column, text = self._number(element) or self._cell(element)
            if column in given or not 0 < column <= MOST_COLUMNS:
                row = f"two cells of row {self.row_counter} are one, or of no column"
                raise damaged(self._path, f"worksheet {self._sheet.title!r}: {row}")
            if text:
                given[column] = text
        return self.row_counter, given

    def _number(self, element: Any) -> tuple[int, str] | None:  # noqa: ANN401
        """A cell of nothing but a number, of which there are most."""
        at = element.get("r")
        if element.get("t", "n") != "n" or len(element) != 1 or element[0].tag != VALUE_TAG or not at:
            return None
        text = (element[0].text or "").strip()
        letters = at.rstrip("0123456789")
        try:
            number, self.col_counter = float(text), self._letters.get(letters) or column_index_from_string(letters)
        except ValueError:
            return None
        self._letters[letters] = self.col_counter
        shown = self._kinds[int(element.get("s") or 0)]
        written = text if text.isdecimal() else repr(number)  # without the digits that Excel adds
        return self.col_counter, (shown and self._shown(number, shown)) or written

    def _cell(self, element: Any) -> tuple[int, str]:  # noqa: ANN401
        """Any other cell."""
        cell, formula = self.parse_cell(element), element.find(FORMULA_TAG)
        value, kind = cell["value"], cell["data_type"]
        if formula is not None:
            self._formulas[cell["column"]] += 1
        if value is None:
            text = "" if formula is None else f"={formula.text or ''}"
        elif kind == "n":
            shown = self._kinds[cell["style_id"]]
            text = (shown and self._shown(value, shown)) or repr(value)
        elif isinstance(value, datetime):
            text = value.isoformat(" ", "microseconds")
        else:  # of an error without the sign with which comments begin
            text = str(value).lstrip("#" if kind == "e" else "")
            if "%" in text:
                self._in_percent.add(cell["column"])
        return cell["column"], text.translate(_PLAIN).strip()

    def _shown(self, number: float, kind: str) -> str | None:
        """The text of a number that is shown as percent, or of days as a time; None if it is as it is stored.

        Percent are a hundred times what is stored in a column whose head has %, and shares elsewhere.
        """
        if kind == "%":
            if self.col_counter in self._in_percent:
                return str(Decimal(repr(number)).scaleb(2))
            self._shares.add(self.col_counter)
            return None
        days, whole, part = number, int(number // 1), number % 1
        if days < 0 or (days < _YEAR and kind == "date"):
            return None
        if days < _YEAR:
            decimals = 9 if days < 1 else 6
            units = round(part * 86_400 * 10**decimals)
            seconds, fraction = divmod(whole * 86_400 * 10**decimals + units, 10**decimals)
            return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}.{fraction:0{decimals}}"
        try:
            moment = self._book.epoch + timedelta(days=whole, microseconds=round(part * 86_400e6))
        except OverflowError:
            return None
        return str(moment.date()) if kind == "date" and not part else moment.isoformat(" ", "microseconds")

    def _filled(self) -> Iterator[tuple[int, list[str]]]:
        """Number and cells of each row that holds something."""
        last = 0
        with self._sheet._get_source() as self.source:
            for number, given in self.parse():
                if not last < number <= MOST_ROWS:
                    raise damaged(self._path, f"worksheet {self._sheet.title!r}: row {number} behind row {last}")
                last = number
                if given:
                    self._rows += 1
                    self._used |= given.keys()
                    yield number, [given.get(i, "") for i in range(1, max(given) + 1)]

    def write(self, to: Path, most: int) -> dict[str, Any]:
        """Write the rows as lines of as many cells each, without columns that are empty throughout.

        Those below the first rows wait in a file beside it until it is known which columns there are.
        """
        head, line, written = dict[int, list[str]](), _HEAD, 0
        with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace", newline="\n", dir=to.parent) as body:
            for number, cells in self._filled():
                written += sum(map(len, cells)) + len(cells)
                if max(written, self._rows * len(self._used)) > most:
                    message = f"worksheet {self._sheet.title!r} is more than {most >> 20} MiB as text"
                    raise Refusal(self._path.name, Finding("too_large", None, None, message))
                if number <= _HEAD:
                    head[number] = cells
                else:
                    body.write("\n" * (number - line - 1) + "\t".join(cells) + "\n")
                    line = number
            joined, places = self._unmerge(head), [i - 1 for i in sorted(self._used)]
            body.seek(0)
            with to.open("w", encoding="utf-8", errors="replace", newline="\n") as out:
                begun = False  # lines above the table are shorter than its rows, as in other texts
                for number in range(1, (_HEAD if line > _HEAD else max(head, default=0)) + 1):
                    cells = head.get(number, [])
                    begun = begun or 2 * sum(map(bool, cells)) >= len(places)
                    text = _line(cells, places)
                    out.write(text if begun else text.rstrip("\t\n") + "\n")
                out.writelines(_line(text[:-1].split("\t"), places) for text in body)
        named = max(map(len, head.values()), default=MOST_COLUMNS)
        beyond = [get_column_letter(i) for i in sorted(self._used) if i > named]
        hidden = [key for key, given in self.column_dimensions.items() if given.get("hidden") in _TRUE]
        formulas = {get_column_letter(i): n for i, n in sorted(self._formulas.items())}
        told = {"formulas": formulas, "hidden_columns": hidden, "joined": joined, "beyond": beyond}
        return {"hidden_rows": self._hidden_rows, **told}

    def _unmerge(self, head: dict[int, list[str]]) -> list[int]:
        """Give each merged cell its text in all its places, and put it before names below it: the rows of such."""
        merged = [] if self.merged_cells is None else self.merged_cells.mergeCell
        first, last, texts = min(self._used, default=1), max(self._used, default=1), []
        for top, left, bottom, right in sorted((r.min_row, r.min_col, r.max_row, r.max_col) for r in merged):
            text = "".join(head.get(top, [])[left - 1 : left])
            if not text or as_number(text) is not None or (left <= first and right >= last):  # a title
                continue
            right = min(right, last)
            if "%" in text and self._shares.intersection(range(left, right + 1)):
                message = f"worksheet {self._sheet.title!r}: {text!r} is merged above cells that are shown as percent"
                raise damaged(self._path, f"{message}: expected % in the head of each column")
            texts.append((bottom, left, right))
            for row in range(top, min(bottom, _HEAD) + 1):
                cells = head.setdefault(row, [])
                cells += [""] * (right - len(cells))
                cells[left - 1 : right] = [text] * (right - left + 1)
        joined = set[int]()
        for bottom, left, right in texts:
            below = head.get(bottom + 1, [])[left - 1 : right]
            are_names = len(below) == right - left + 1 > 1 and all(cell and as_number(cell) is None for cell in below)
            if are_names and not all(map(is_unit, below)):
                head[bottom + 1][left - 1 : right] = [f"{head[bottom][left - 1]} {cell}" for cell in below]
                joined.add(bottom)
        return sorted(joined)


def _line(cells: list[str], places: list[int]) -> str:
    """A row of cells in these places as a line; an empty one where there are none."""
    return "\t".join(cells[i] if i < len(cells) else "" for i in places) + "\n" if any(cells) else "\n"
