"""A digital calibration certificate (DCC of PTB, schema 2 and 3) as the calibration of a sensor.

Read are the certificate's number, laboratory, date, serial numbers, and the quantities of its results that have values
with units of D-SI (``\\volt\\per\\metre\\second\\tothe{2}``) and expanded or standard uncertainties. A signature is not
verified. The file is data: no document type, and so no entity, is accepted, nothing is fetched, its size is bounded.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from balance.arrays import Floats
from balance.errors import UnitError
from balance.input_files import read_text, xml_root
from balance.units import SI_UNITS

from ..errors import RigError
from .definition import electrical_name, si_unit

LARGEST_BYTES = 64 << 20
"""Of a certificate, which may hold its printed form."""
DCC, SI = "{https://ptb.de/dcc}", "{https://ptb.de/si}"
_PREFIXES = {
    "pico": "p", "nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k", "mega": "M", "giga": "G",
}  # fmt: skip
_UNITS = {
    "one": "", "percent": "%", "metre": "m", "second": "s", "kilogram": "kg", "gram": "g", "newton": "N", "volt": "V",
    "ampere": "A", "coulomb": "C", "ohm": "ohm", "hertz": "Hz", "radian": "rad", "degree": "deg", "kelvin": "K",
    "degreecelsius": "degC", "pascal": "Pa", "farad": "F", "joule": "J", "watt": "W", "minute": "min", "hour": "h",
}  # fmt: skip


@dataclass(frozen=True)
class CertifiedQuantity:
    """One quantity of a certificate, with its values."""

    name: str
    values: Floats
    """(n,), in ``unit``."""
    unit: str
    """As this product writes units, ``1`` for a pure number; as the certificate has it where it is not known."""
    standard: Floats | None
    """Standard uncertainties, (n,), in the same unit; None where none is stated."""
    factor: float | None
    """Coverage factor by which they were stated; None where they were standard ones."""
    group: int
    """Which table of results it is in."""


@dataclass(frozen=True)
class Certificate:
    """What a certificate says."""

    number: str
    laboratory: str
    date: str
    """Last day of the calibration, ISO 8601; empty where it states none."""
    serials: tuple[str, ...]
    sha256: str
    quantities: tuple[CertifiedQuantity, ...]

    @property
    def reference(self) -> str:
        """Certificate and laboratory, with the digest of the file, for a record."""
        return ", ".join(filter(None, (f"DCC {self.number}", self.laboratory, f"SHA-256 {self.sha256[:16]}")))

    def calibration(
        self, dimensions: Sequence[str], frequency_hz: float | None = None, name: str = ""
    ) -> dict[str, Any]:
        """Keys of a calibration: the sensitivity to what has one of these ``dimensions``, and its uncertainty.

        Of several frequencies the nearest to ``frequency_hz``; of several sensitivities the one with ``name`` in its
        name. Raises RigError where that leaves none, or more than one.
        """
        found = [q for q in self.quantities if _is_sensitivity(q.unit, dimensions) and name in q.name]
        if len(found) != 1:
            there = "; ".join(f"{q.name or '(no name)'} [{q.unit}]" for q in found or self.quantities) or "none"
            named = f" with {name!r} in the name" if name else ""
            raise RigError(
                f"certificate {self.number}: {len(found)} sensitivities to {' or '.join(dimensions)}{named}: expected "
                f"one; name it with --quantity. There are: {there}"
            )
        (quantity,) = found
        at = self._row(quantity, frequency_hz)
        value = float(quantity.values[at])
        keys: dict[str, Any] = {"sensitivity": f"{value!r} {quantity.unit}", "reference": self.reference}
        if self.date:
            keys["date"] = self.date
        if quantity.standard is not None:
            standard = float(quantity.standard[at])
            keys["uncertainty"] = (
                {"standard": f"{standard!r} {quantity.unit}"}
                if quantity.factor is None
                else {"expanded": f"{quantity.factor * standard!r} {quantity.unit}", "coverage_factor": quantity.factor}
            )
        return keys

    def _row(self, quantity: CertifiedQuantity, frequency_hz: float | None) -> int:
        if len(quantity.values) == 1:
            return 0
        beside = [
            q for q in self.quantities
            if q.group == quantity.group and len(q.values) == len(quantity.values) and q.unit.endswith("Hz")
        ]  # fmt: skip
        if not beside:
            raise RigError(
                f"certificate {self.number}: {quantity.name}: {len(quantity.values)} values without frequencies: "
                "expected one value, or frequencies in Hz in the same table; give --sensitivity and --uncertainty"
            )
        given = beside[0].values * si_unit(beside[0].unit, ()).value / si_unit("Hz", ()).value
        rows = np.flatnonzero(given > 0.0)  # a static value has no place among them
        given = given[rows]
        if not rows.size:
            raise RigError(
                f"certificate {self.number}: {quantity.name}: no frequency above 0 Hz: give --sensitivity and "
                "--uncertainty"
            )
        if frequency_hz is None:
            raise RigError(
                f"certificate {self.number}: {quantity.name}: values at {given.min():g} to {given.max():g} Hz: give "
                "--frequency, that of the vibration"
            )
        if not given.min() <= frequency_hz <= given.max():
            raise RigError(
                f"certificate {self.number}: {frequency_hz:g} Hz is outside of {given.min():g} to {given.max():g} Hz, "
                "for which it was calibrated: give another --frequency"
            )
        return int(rows[np.argmin(np.abs(np.log(given / frequency_hz)))])


def read_certificate(path: Path) -> Certificate:
    """Read a certificate. Raises RigError, saying what was expected, for a file that is none or not safe to read."""
    text = read_text(path, RigError, LARGEST_BYTES)
    try:
        root = xml_root(text, path.name, RigError)
        if root.tag != f"{DCC}digitalCalibrationCertificate":
            raise RigError(f"{path.name}: its root is {root.tag[:80]!r}: expected dcc:digitalCalibrationCertificate")
        core = f"{DCC}administrativeData/{DCC}coreData/{DCC}"
        items = root.iterfind(f"{DCC}administrativeData/{DCC}items//{DCC}identification")
        serials = tuple(
            value
            for one in items
            if "serial" in f"{one.get('refType', '')} {_name(one)}".casefold()
            and (value := one.findtext(f"{DCC}value", "").strip())
        )
        day = root.findtext(f"{core}endPerformanceDate") or root.findtext(f"{core}beginPerformanceDate") or ""
        return Certificate(
            root.findtext(f"{core}uniqueIdentifier", "").strip(),
            _name(root.find(f"{DCC}administrativeData/{DCC}calibrationLaboratory/{DCC}contact")),
            day.strip()[:10],
            serials,
            hashlib.sha256(path.read_bytes()).hexdigest(),
            tuple(_quantities(root)),
        )
    except (ValueError, UnitError) as error:
        raise RigError(f"{path.name}: {error}: expected a digital calibration certificate (DCC, XML)") from error


def _name(element: Element | None) -> str:
    """The first text of an element's name."""
    return "" if element is None else element.findtext(f"{DCC}name/{DCC}content", "").strip()


def _quantities(root: Element) -> Iterator[CertifiedQuantity]:
    for group, result in enumerate(root.iterfind(f".//{DCC}result")):
        for quantity in result.iterfind(f".//{DCC}quantity"):
            name = " ".join(filter(None, (_name(result), _name(quantity), quantity.get("id"), quantity.get("refType"))))
            in_units = quantity.find(f"{SI}hybrid")  # one quantity in several units, the first that of SI
            for one in quantity if in_units is None else [*in_units][:1]:
                if one.tag in (f"{SI}real", f"{SI}realListXMLList"):
                    yield _quantity(one, name, group)


def _quantity(one: Element, name: str, group: int) -> CertifiedQuantity:
    """One value, or a list; uncertainties as D-SI 1 (``expandedUnc``) or D-SI 2 writes them."""
    many = "XMLList" if one.tag.endswith("XMLList") else ""
    values = _numbers(one, f"value{many}", name)
    units = (one.findtext(f"{SI}unit{many}") or "").split()
    if len(set(units)) != 1:
        raise ValueError(f"{name}: {len(set(units))} units: expected one for all values")
    expanded, factors, standard = (
        next((found for path in paths if (found := _numbers(one, path, name)).size), None)
        for paths in (
            (f"expandedUnc{many}/{SI}uncertainty{many}",
             f"measurementUncertaintyUnivariate{many}/{SI}expandedMU{many}/{SI}valueExpandedMU{many}"),
            (f"expandedUnc{many}/{SI}coverageFactor{many}",
             f"measurementUncertaintyUnivariate{many}/{SI}expandedMU{many}/{SI}coverageFactor{many}"),
            (f"measurementUncertaintyUnivariate{many}/{SI}standardMU{many}/{SI}valueStandardMU{many}",),
        )
    )  # fmt: skip
    factor = None
    if expanded is not None:
        if factors is None or len(set(factors)) != 1 or not factors[0] > 0.0:
            raise ValueError(f"{name}: an expanded uncertainty without a coverage factor, or with several")
        factor, standard = float(factors[0]), expanded / factors[0]
    if standard is not None:
        if len(standard) not in (1, len(values)) or standard.min() < 0.0:
            raise ValueError(f"{name}: {len(standard)} uncertainties of {len(values)} values, or a negative one")
        standard = np.broadcast_to(standard, values.shape)
    try:
        unit = unit_of_dsi(units[0])
    except UnitError:
        unit = units[0]  # as written: it is no sensitivity that can be used, and the others can
    return CertifiedQuantity(name, values, unit, standard, factor, group)


def _numbers(one: Element, path: str, name: str) -> Floats:
    found = np.array([float(word) for word in (one.findtext(f"{SI}{path}") or "").split()])
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: {path.rpartition('}')[2]}: expected finite numbers")
    return found


def unit_of_dsi(text: str) -> str:
    """A unit of D-SI, such as ``\\milli\\volt\\per\\metre``, as this product writes it. Raises UnitError for others.

    ``\\per`` is about the next unit alone.
    """
    words = re.findall(r"\\([A-Za-z]+)(?:\{([^}]*)\})?", text)
    if "".join(f"\\{word}" + (f"{{{power}}}" if power else "") for word, power in words) != text:
        raise UnitError(f"unit {text[:80]!r}: expected one of D-SI, such as '\\volt\\per\\metre\\second\\tothe{{2}}'")
    above: list[str] = []
    under: list[str] = []
    beyond: list[str] = []
    last: list[str] = []
    parts, prefix = above, ""
    for word, power in words:
        if word == "per":
            parts = under
        elif word in _PREFIXES:
            prefix = _PREFIXES[word]
        elif word == "tothe" and last and re.fullmatch(r"-?[0-9]", power):
            last[-1] += f"^{power}"
        elif word in _UNITS:
            parts.append(prefix + _UNITS[word] or "1")
            last, parts, prefix = parts, beyond if under else above, ""
        else:
            raise UnitError(f"unit {text[:80]!r}: \\{word} is not known")
    over = "*".join(above) or "1"
    if beyond:  # V s2 / m is written V/(m/s^2), as data sheets have it
        return f"{over}/({'/'.join(['*'.join(under), *beyond])})"
    return "/".join([over, *under])


def _is_sensitivity(unit: str, dimensions: Sequence[str]) -> bool:
    """Whether a unit is electrical per unit of one of the dimensions."""
    if unit == "1" or unit.startswith("\\"):
        return False
    own = si_unit(unit, ())
    return any(electrical_name((own * si_unit(SI_UNITS[d], ())).units) is not None for d in dimensions)
