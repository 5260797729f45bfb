"""Input sheets in TOML: each key is read once, with its unit; what is missing, wrong or unknown is refused by name."""

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from .errors import DataError, UnitError
from .quantities import factor_to_si, parse, parse_unit

_WITHIN = re.compile(r"\s*(?:±|\+/?-)\s*")
"""Between a value and the half width of its interval."""
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_TURNING = {"radian", "degree", "turn", "revolution", "revolutions_per_minute", "grade", "arcminute"}
_SPELLINGS = {
    "length": {"mil": "thou", "mils": "thou"},
    "first moment": {"gmm": "g mm", "kgmm": "kg mm", "gcm": "g cm", "ozin": "oz in"},
}
"""A mil of a vibration instrument is a thousandth of an inch; elsewhere it is an angle."""


class Sheet:
    """One table of a sheet, which knows where it stands and which of its keys were read."""

    def __init__(self, table: Mapping[str, object], where: str) -> None:
        self._table, self.where = table, where
        self._read: set[str] = set()
        self._asked: set[str] = set()

    @classmethod
    def load(cls, path: Path) -> "Sheet":
        """Read a TOML file. Raises DataError if it is none."""
        try:
            return cls(tomllib.loads(path.read_text(encoding="utf-8")), path.name)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise DataError(f"{path.name}: not a TOML file in UTF-8: {error}") from error

    def __contains__(self, key: str) -> bool:
        self._asked.add(key)
        return key in self._table

    def refuse(self, key: str, what: str) -> DataError:
        """An error about one key, to be raised."""
        return DataError(f"{self.where}: {key} {what}")

    def value(self, key: str) -> object:
        """What stands under a key, or DataError if nothing does."""
        self._read.add(key)
        if key not in self._table:
            raise self.refuse(key, "is missing")
        return self._table[key]

    def text(self, key: str, default: str | None = None, among: Sequence[str] = ()) -> str:
        """A text, one of ``among`` where that is given."""
        if default is not None and key not in self:
            return default
        found = self.value(key)
        if not isinstance(found, str) or (among and found not in among):
            expected = " or ".join(repr(word) for word in among) or "a text"
            raise self.refuse(key, f"is {found!r}: expected {expected}")
        return found

    def flag(self, key: str) -> bool:
        """True or false; there is no default."""
        found = self.value(key)
        if not isinstance(found, bool):
            raise self.refuse(key, f"is {found!r}: expected true or false")
        return found

    def number(self, key: str, default: float | None = None) -> float:
        """A plain number."""
        if default is not None and key not in self:
            return default
        return self._number(self.value(key), key)

    def positive(self, key: str) -> float:
        """A plain number above zero."""
        found = self.number(key)
        if not found > 0.0:
            raise self.refuse(key, f"is {found:g}: expected more than zero")
        return found

    def quantity(self, key: str, dimension: str, default: float | None = None, positive: bool = False) -> float:
        """A text with a unit, such as ``80 mm``, in SI."""
        if default is not None and key not in self:
            return default
        return self._quantity(self.value(key), key, dimension, positive)

    def maybe(self, key: str, dimension: str, positive: bool = True) -> float | None:
        """A quantity in SI, or None where the key is absent."""
        return self.quantity(key, dimension, positive=positive) if key in self else None

    def quantities(self, key: str, dimension: str) -> list[float]:
        """A list of texts with units, in SI."""
        return [self._quantity(item, f"{key}[{i}]", dimension) for i, item in enumerate(self._list(key))]

    def numbers(self, key: str) -> list[float]:
        """A list of plain numbers."""
        return [self._number(item, f"{key}[{i}]") for i, item in enumerate(self._list(key))]

    def vector(self, key: str, *dimensions: str) -> complex:
        """A magnitude and a direction such as ``170 um @ 112 deg``, as a complex number in SI."""
        found = self.value(key)
        if not isinstance(found, str):
            raise self.refuse(key, f"is {found!r}: expected a text such as '1 g @ 30 deg'")
        try:
            return vector(found, *dimensions)
        except UnitError as error:
            raise self._unread(key, found, error) from error

    def uncertain(self, key: str, *dimensions: str) -> tuple[complex, tuple[float, float] | None]:
        """A vector that may have intervals, see ``uncertain``."""
        found = self.value(key)
        if not isinstance(found, str):
            raise self.refuse(key, f"is {found!r}: expected a text such as '1 um ± 0.1 um @ 30 deg ± 2 deg'")
        try:
            return uncertain(found, *dimensions)
        except UnitError as error:
            raise self._unread(key, found, error) from error

    def sheet(self, key: str) -> "Sheet":
        """A table within the sheet."""
        found = self.value(key)
        if not isinstance(found, dict):
            raise self.refuse(key, f"is {found!r}: expected a table")
        return Sheet(found, f"{self.where}, {key}")

    def sheets(self, key: str) -> "list[Sheet]":
        """A list of tables within the sheet, at least one, each called by its name where it has one.

        Two of one name are refused: one of them is likely there by mistake, such as a line copied twice.
        """
        found = self._list(key)
        if not found or not all(isinstance(item, dict) for item in found):
            raise self.refuse(key, f"is {found!r}: expected one or more tables [[{key}]]")
        tables = [item for item in found if isinstance(item, dict)]
        names = [table["name"] for table in tables if "name" in table]
        if again := [name for name in names if names.count(name) > 1]:
            raise self.refuse(key, f"has {again[0]!r} twice: give each a name of its own")
        return [Sheet(t, f"{self.where}, {key}[{i}] {t.get('name', '')}".rstrip()) for i, t in enumerate(tables)]

    def keys(self) -> list[str]:
        """Names of all keys, for tables whose keys are names."""
        return list(self._table)

    def finish(self) -> None:
        """Refuse what was never read."""
        if unknown := [key for key in self._table if key not in self._read]:
            known = ", ".join(sorted(self._read | self._asked))
            raise DataError(f"{self.where}: unknown key {unknown[0]!r}: expected {known}")

    def _unread(self, key: str, text: str, error: UnitError) -> DataError:
        """An error about the text under a key, said once where the key is the text."""
        said = str(error) if repr(text) in str(error) else f"{text!r}: {error}"
        return DataError(f"{self.where}: {said}" if key == text else f"{self.where}: {key}: {said}")

    def _list(self, key: str) -> list[object]:
        found = self.value(key)
        if not isinstance(found, list):
            raise self.refuse(key, f"is {found!r}: expected a list")
        return found

    def _number(self, found: object, key: str) -> float:
        if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
            raise self.refuse(key, f"is {found!r}: expected a number")
        return float(found)

    def _quantity(self, found: object, key: str, dimension: str, positive: bool = False) -> float:
        if not isinstance(found, str):
            raise self.refuse(key, f"is {found!r}: expected a text with a unit")
        try:
            result = quantity(found, dimension)
        except UnitError as error:
            raise self._unread(key, found, error) from error
        if positive and not result > 0.0:
            raise self.refuse(key, f"is {found!r}: expected more than zero")
        return result


def quantity(text: str, dimension: str) -> float:
    """Read a quantity in SI; finite, and a speed of rotation never in Hz, which would be taken for rad/s."""
    number, unit = _split(text)
    if dimension == "angular velocity" and unit and (parsed := parse_unit(unit)) is not None:
        names = {name for name, _ in parsed._units.items()}
        if not names & _TURNING:
            raise UnitError(f"{text!r} does not say whether it counts turns or radians: write rpm, turn/s or rad/s")
    spelled = _SPELLINGS.get(dimension, {}).get(unit)
    found = parse(f"{number} {spelled}" if spelled else text, dimension)
    if not math.isfinite(found):
        raise UnitError(f"{text!r} is too large to be a {dimension}")
    return found


def vector(text: str, *dimensions: str) -> complex:
    """Read ``magnitude @ angle``, such as ``133.75 kg mm @ 348 deg``, of any of ``dimensions``, in SI.

    The angle is required: a magnitude alone is no vector.
    """
    size, separator, angle = text.partition("@")
    if not separator or not angle.strip():
        raise UnitError(f"{text!r} has no angle: write 'magnitude unit @ angle unit', such as '1 g @ 30 deg'")
    magnitude = quantity(size.strip(), dimension_of(size.strip(), *dimensions))
    if magnitude < 0.0:
        raise UnitError(f"{text!r} has a negative magnitude: turn the angle by 180 degrees instead")
    turned = quantity(angle.strip(), "angle")
    return magnitude * complex(math.cos(turned), math.sin(turned))


def uncertain(text: str, *dimensions: str) -> tuple[complex, tuple[float, float] | None]:
    """Read ``170 um ± 2 um @ 112 deg ± 1 deg``: a vector in SI, and half its interval along and across, in SI.

    ``± 2 %`` is of the magnitude. Without an interval of the angle that of the magnitude holds in every direction;
    without any there is None.
    """
    size, separator, angle = text.partition("@")
    magnitude, *within = _WITHIN.split(size)
    turned, *about = _WITHIN.split(angle)
    found = vector(f"{magnitude.strip()} {separator} {turned.strip()}", *dimensions)
    if len(within) > 1 or len(about) > 1 or (about and not within):
        raise UnitError(f"{text!r}: expected ± once after the magnitude, and once after the angle if at all")
    if not within:
        return found, None
    along = _half_width(within[0].strip(), dimension_of(magnitude.strip(), *dimensions), abs(found))
    return found, (along, abs(found) * _half_width(about[0].strip(), "angle", 0.0) if about else along)


def _half_width(text: str, dimension: str, whole: float) -> float:
    """Half an interval, in SI; per cent are of the ``whole``, where there is one."""
    number, unit = _split(text)
    half = float(number) / 100.0 * whole if number and unit == "%" and whole else quantity(text, dimension)
    if not 0.0 < half < math.inf:
        raise UnitError(f"± {text}: expected more than zero")
    return half


def dimension_of(text: str, *dimensions: str) -> str:
    """Which of ``dimensions`` a quantity has; the first where it has none of them, so that reading it says so."""
    unit = _split(_WITHIN.split(text.partition("@")[0])[0])[1]
    for dimension in dimensions:
        try:
            factor_to_si(_SPELLINGS.get(dimension, {}).get(unit, unit), dimension)
        except UnitError:
            continue
        return dimension
    return dimensions[0]


def _split(text: str) -> tuple[str, str]:
    """Number and unit, apart; a text that begins with no number is all unit."""
    match = _NUMBER.match(text)
    return (match[0].strip(), text[match.end() :].strip()) if match else ("", text.strip())
