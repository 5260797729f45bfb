"""What a cell may be: a number with a decimal point or comma, one with doubtful marks, a missing value, a text."""

import re

_POINT = re.compile(r"[+-]?(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+(?:[eE][+-]?\d+)?", re.ASCII)
_LOOSE = re.compile(
    r"[+-]?(?:(?=[.,'’]*\d)[\d.,'’]++|\d{1,3}(?:[ \u00a0\u202f]\d{3})+(?:[.,]\d*)?)(?:[eE][+-]?\d+)?", re.ASCII
)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
MINUS = "\N{MINUS SIGN}"
_FORTRAN = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+))[dD]([+-]?\d{1,3})", re.ASCII)
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,13}", re.ASCII)
_BARE_HEXADECIMAL = re.compile(r"(?=.*\d)(?=.*[A-Fa-f])(?![Ee]\d+$)(?:\d[\dA-Fa-f]{2,15}|[\dA-Fa-f]{4,16})", re.ASCII)
_DRESSED = re.compile(
    r"""[("']?\s*[+-]?\s*(?=[.,\d]*\d)[\d.,_]++(?:[eEdD][+-]?\d+|(?<=[.,\d]{3})[+-]\d{2,3})?\s?"""
    r"""(?:[)"'-]|[%°]?[A-Za-zµ]{0,3})"""
)
_MISSING_WORDS = "nan +nan -nan inf +inf -inf infinity -infinity na n/a #n/a null none - -- --- ? *"
_MISSING = frozenset(_MISSING_WORDS.split())


def mark_of(cell: str) -> str | None:
    """``.`` or ``,`` if the cell is a number with that decimal mark; ``""`` for an integer; None otherwise."""
    cell = cell.strip()
    if _INTEGER.fullmatch(cell):
        return ""
    if _POINT.fullmatch(cell):
        return "."
    return "," if _COMMA.fullmatch(cell) else None


def may_be_thousands(cell: str) -> bool:
    """Whether the one mark of ``1.234`` may be of thousands: one to three digits, then exactly three."""
    return _THOUSANDS.fullmatch(cell.strip()) is not None


def is_ambiguous(cell: str) -> bool:
    """Digits with several marks, such as ``1.234,5``, ``1'234`` or ``1 234``: no number in any dialect."""
    return mark_of(cell) is None and _LOOSE.fullmatch(cell.strip()) is not None


def is_numberish(cell: str) -> bool:
    """Whether the cell has the look of a number, in whatever dialect."""
    return _LOOSE.fullmatch(usual(cell.strip())) is not None


def is_word(cell: str) -> bool:
    """Whether the cell begins with a letter, and stands for no number and no missing value."""
    return cell.strip()[:1].isalpha() and not is_missing(cell) and not is_numberish(cell)


def is_bare_hexadecimal(cell: str) -> bool:
    """Whether the cell has digits and letters up to F, such as ``01C3``; ``E5`` and ``E005`` are codes of errors."""
    return mark_of(cell) is None and _BARE_HEXADECIMAL.fullmatch(cell.strip()) is not None


def is_dressed(cell: str) -> bool:
    """Whether the cell is one number with signs beside it: ``"1.5"``, ``(1.5)``, ``1.5-``, ``1.5D+03``, ``1.5 k``."""
    return usual(cell.strip()) != cell.strip() or _DRESSED.fullmatch(cell.strip()) is not None


def usual(cell: str) -> str:
    """The number ``−1.5D+03`` as ``-1.5e+03``, ``0x1F`` as ``31``; every other cell as it is.

    ``12D4`` stays, for it may be the name of a part: a decimal mark or a sign tells an exponent.
    """
    if _HEXADECIMAL.fullmatch(cell):
        return str(int(cell, 16))
    plain = cell.replace(MINUS, "-")
    if (match := _FORTRAN.fullmatch(plain)) and (set(match[1]) & set(".,") or match[2][0] in "+-"):
        plain = f"{match[1]}e{match[2]}"
    return plain if mark_of(plain) is not None else cell


def is_missing(cell: str) -> bool:
    """Whether the cell is empty or a usual word for no value."""
    cell = cell.strip().casefold()
    return not cell or cell in _MISSING or cell.startswith(("1.#", "-1.#"))
