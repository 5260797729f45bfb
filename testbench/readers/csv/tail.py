"""The last line where it has no end: a whole row, or one that was cut?"""

import re
from collections.abc import Sequence

from ...findings import Finding
from .parse import Form

_SHAPE = re.compile(rb"[+-]?\d*[.,](\d+)(?:[eE][+-]?(\d+))?")
_ROWS_COMPARED = 1000


def last_row(form: Form, rest: bytes, before: bytes, line: int) -> tuple[bytes, Finding | None]:
    """The last row of the file if it is whole, else nothing; and what is to be said.

    ``rest`` is the text after the last line feed, ``before`` rows above it, both plain. A number that may be cut is
    never used: the row is whole only if its last number has as many decimals as every one above it, or if something
    comes after that number.
    """
    text = rest.rstrip(b"\x1a")
    if not text.strip():
        return b"", None
    where = f"line {line}"
    if b"\0" in text:
        message = f"the file ends in {text.count(0)} NUL bytes, as after a power failure of the logger"
        return b"", Finding("nul_bytes", None, where, message)
    cells = text.split(form.separator.encode())
    if len(cells) != form.fields:
        message = f"has {len(cells)} of {form.fields} fields and no line end: the file ends inside it; it is left out"
        return b"", Finding("cut_last_row", None, where, f"line {line} {message}")
    if text.endswith(b"\r"):
        return text + b"\n", None
    rows = [row.split(form.separator.encode()) for row in before.split(b"\n")[-1 - _ROWS_COMPARED : -1]]
    if _same_shape(cells[-1], [row[-1] for row in rows if len(row) == form.fields]):
        message = "has no line end; it is whole, since its last number has as many decimals as those above"
        return text + b"\n", Finding("no_final_newline", None, where, f"line {line} {message}")
    message = "has no line end, so that its last number may be cut; the row is left out"
    return b"", Finding("cut_last_row", None, where, f"line {line} {message}")


def _same_shape(cell: bytes, above: Sequence[bytes]) -> bool:
    """Whether a number has as many decimals, and digits of the exponent, as all those above it; or all are empty."""
    shapes = {_shape(other) for other in above}
    return len(shapes) == 1 and None not in shapes and _shape(cell) in shapes


def _shape(cell: bytes) -> tuple[int, int] | None:
    match = _SHAPE.fullmatch(cell.strip())
    if not cell.strip():
        return (0, 0)
    return None if match is None else (len(match[1]), len(match[2] or b""))
