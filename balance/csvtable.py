"""A small table in a CSV file: its header and its rows with their lines, for tables that sheets refer to."""

import csv
from pathlib import Path

from .errors import DataError


def read(path: Path, key: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Cells of the header; line and cells of each row that is not blank.

    ``key`` is what the sheet calls the file. Raises DataError, with that key or the file's name.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(file, strict=True)
            return next(lines, []), [(lines.line_num, row) for row in lines if any(c.strip() for c in row)]
    except FileNotFoundError as error:
        raise DataError(f"{key}: no such file {path.name!r}") from error
    except OSError as error:
        raise DataError(f"{key}: cannot read {path.name!r}: {error.strerror}") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise DataError(f"{path.name}: not a CSV file in UTF-8: {error}") from error
