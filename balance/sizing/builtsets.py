"""The sets of plates that the source built, beside which ours are shown; never returned as ours."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .. import datasets, stock
from ..conditions import Conditions
from ..mechanism import Mechanism
from .result import given


@dataclass(frozen=True)
class BuiltSet:
    """The set that the source built for a payload, the same on each arm."""

    payload: float
    """[kg]"""
    plates: tuple[str, ...]
    mass: float
    """Of its plates [kg]."""
    residual: float
    """First-moment residual that it leaves [kg m], computed."""


def printed_increments() -> tuple[float, ...]:
    """What the source prints as added for the second and third payload [kg]: differences of its computed masses."""
    return tuple(float(value) for value in _sheet()["nested_increments_kg"].values())


def built(conditions: Conditions, mechanisms: Sequence[Mechanism], payloads: Sequence[float]) -> tuple[BuiltSet, ...]:
    """What the source built for exactly these payloads of its manipulator; empty for any others."""
    sheet = _sheet()
    if list(payloads) != [float(key) for key in sheet["built_counter_mass_kg_per_arm"]]:
        return ()
    plates = stock.load("kiper2019")
    found = []
    for mechanism, payload, names in zip(mechanisms, payloads, sheet["built_sets"].values(), strict=True):
        mass = stock.mass_of(names, plates)
        left = given(conditions, mechanism, dict.fromkeys(mechanism.counter_sites, mass))
        found.append(BuiltSet(payload, tuple(names), mass, left.residual()))
    return tuple(found)


def _sheet() -> dict[str, Any]:
    text = datasets.find("kiper2019", "published", ".json").read_text(encoding="utf-8")
    sheet: dict[str, Any] = json.loads(text)["sizing_sheet_A_as_built"]
    return sheet
