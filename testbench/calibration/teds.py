"""Transducer electronic data sheets (IEEE 1451.4): as fields in a rig, or as the 64 bits of the Basic TEDS."""

from typing import Any

from pydantic import Field, model_validator

from balance.input_files import Table

from ..errors import RigError
from .definition import Day, PerComponent

BASIC_BYTES = 8
_FIELDS = (("manufacturer_id", 14), ("model_number", 15), ("version_letter", 5), ("version", 6), ("serial", 24))
"""Of the Basic TEDS of IEEE 1451.4, in bits, least significant first."""
_FIRST_MANUFACTURER = 17


class Teds(Table):
    """Transducer electronic data sheet. It is stored and shown; applied is the sensor's ``calibration`` alone."""

    manufacturer: str | None = None
    """Maker."""
    manufacturer_id: int | None = Field(default=None, ge=_FIRST_MANUFACTURER, lt=1 << 14)
    """Number of the maker."""
    model: str | None = None
    """Model."""
    model_number: int | None = Field(default=None, ge=0, lt=1 << 15)
    """Number of the model."""
    version_letter: str | None = Field(default=None, pattern="^[A-Z]$")
    """Letter of the version."""
    version: int | None = Field(default=None, ge=0, lt=1 << 6)
    """Number of the version."""
    serial: str | None = None
    """Serial number."""
    sensitivity: PerComponent | None = None
    """As on the data sheet, such as ``10.2 mV/g``."""
    calibration_date: Day | None = None
    """Day of the calibration."""
    calibration_initials: str | None = Field(default=None, max_length=3)
    """Initials of who calibrated."""
    calibration_period_days: int | None = Field(default=None, ge=0, le=4095)
    """Days until the next calibration."""

    @model_validator(mode="before")
    @classmethod
    def _with_basic(cls, given: Any) -> Any:  # noqa: ANN401
        """``basic``, the 64 bits as a reader prints them in hexadecimal, in place of the fields that they hold."""
        if not isinstance(given, dict) or "basic" not in given:
            return given
        try:
            read = basic_teds(bytes.fromhex(str(given["basic"])))
        except (ValueError, RigError) as error:
            raise ValueError(f"basic = {given['basic']!r}: expected 16 hexadecimal digits: {error}") from error
        rest = {key: value for key, value in given.items() if key != "basic"}
        if twice := sorted(rest.keys() & read.document().keys()):
            raise ValueError(f"{twice[0]} is in basic already: remove one of them")
        return {**read.document(), **rest}

    def document(self) -> dict[str, Any]:
        """The fields that are stated."""
        return self.model_dump(exclude_none=True)


def basic_teds(content: bytes) -> Teds:
    """Read the Basic TEDS: manufacturer, model, version letter (A is 1), version, serial number; least bit first.

    Raises RigError if there are not 64 bits, or all are equal, as of an absent memory.
    """
    if len(content) != BASIC_BYTES:
        raise RigError(f"Basic TEDS: {len(content)} bytes: expected {BASIC_BYTES}")
    if content in {bytes(BASIC_BYTES), b"\xff" * BASIC_BYTES}:
        raise RigError("Basic TEDS: all bits are equal: an empty or absent memory")
    bits, values = int.from_bytes(content, "little"), {}
    for name, width in _FIELDS:
        values[name] = bits & ((1 << width) - 1)
        bits >>= width
    letter, maker = values["version_letter"], values["manufacturer_id"]
    if maker < _FIRST_MANUFACTURER or letter > 26:
        raise RigError(f"Basic TEDS: manufacturer {maker}, version letter {letter}: there are no such ones")
    return Teds(
        manufacturer_id=maker,
        model_number=values["model_number"],
        version_letter=chr(ord("A") + letter - 1) if letter else None,
        version=values["version"],
        serial=str(values["serial"]),
    )
