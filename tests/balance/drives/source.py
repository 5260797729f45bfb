"""The source's drive, as the tests set it up, and reference values worked out with independent code."""

import json
from functools import cache
from pathlib import Path

import numpy as np

from balance.drives.drive_files import load_drive
from balance.drives.machine import Machine
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism

REFERENCE = json.loads((Path(__file__).parent / "reference.json").read_text(encoding="utf-8"))
RPM = np.pi / 30.0


@cache
def mechanism() -> Mechanism:
    """The inverted slider-crank."""
    return load_mechanism("inverted-slider-crank")


@cache
def machine(nominal_rpm: float, reading: str = "ungeared") -> Machine:
    """The source's machine at a nominal speed."""
    drive = load_drive("inverted-slider-crank")
    return next(m for m in drive.machines(mechanism(), reading=reading) if abs(m.nominal - nominal_rpm * RPM) < 1e-6)
