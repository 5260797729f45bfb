"""The Basic TEDS: 64 bits, put together by hand."""

import pytest
from pydantic import ValidationError

from testbench.calibration.definition import Teds, basic_teds
from testbench.errors import RigError

BITS = 0
for VALUE, AT in ((43, 0), (7115, 14), (2, 29), (1, 34), (2007, 40)):
    BITS |= VALUE << AT
"""Manufacturer 43, model 7115, version B 1, serial 2007: each from its bit on."""


def test_fields_of_the_basic_teds():
    """14 bits of manufacturer, 15 of model, 5 of letter, 6 of version, 24 of serial number."""
    teds = basic_teds(BITS.to_bytes(8, "little"))
    assert teds.document() == {
        "manufacturer_id": 43, "model_number": 7115, "version_letter": "B", "version": 1, "serial": "2007",
    }  # fmt: skip


@pytest.mark.parametrize("content", [b"", bytes(8), b"\xff" * 8, bytes(7), (3).to_bytes(8, "little")])
def test_what_is_no_teds(content):
    """An absent memory, a part of one, a manufacturer that there cannot be."""
    with pytest.raises(RigError, match="Basic TEDS"):
        basic_teds(content)


def test_a_rig_may_give_the_bits():
    """Hexadecimal, as a reader prints them, with further fields beside; nothing is said twice."""
    bits = BITS.to_bytes(8, "little")
    teds = Teds.model_validate({"basic": bits.hex(), "calibration_initials": "AB"})
    assert teds == basic_teds(bits).model_copy(update={"calibration_initials": "AB"})
    with pytest.raises(ValidationError, match="serial is in basic already"):
        Teds.model_validate({"basic": bits.hex(), "serial": "7"})
    for wrong in ("zz", "00" * 8, "ab"):
        with pytest.raises(ValidationError, match="expected 16 hexadecimal digits"):
            Teds.model_validate({"basic": wrong})
