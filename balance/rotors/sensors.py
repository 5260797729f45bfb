"""What a sheet of trial runs says of its sensors: weight or scale of each, and how far its readings scatter."""

from collections.abc import Mapping, Sequence

import numpy as np

from .. import intervals
from ..arrays import Floats
from ..errors import DataError
from ..sheet import Sheet, dimension_of
from .moduli import Complexes

READING = ("length", "velocity", "acceleration")
"""What an instrument may read."""
Half = tuple[float, float]
"""Half widths of a reading's 95 % interval, along and across it."""


class Sensors:
    """The tables ``[[sensors]]``: optional, and so is each key in them."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._items = {item.text("name"): item for item in sheet.sheets("sensors")} if "sensors" in sheet else {}

    def factors(self, dimensions: Mapping[str, str]) -> dict[str, float]:
        """Factor of each sensor's readings: root of its weight, or one over its scale.

        Raises DataError for a sensor that no run reads, and where sensors differ in dimension and one has no scale.
        """
        found, scaled = dict.fromkeys(dimensions, 1.0), set()
        for name, item in self._items.items():
            if name not in found:
                raise item.refuse("name", f"is {name!r}, which no run reads: there are {', '.join(found)}")
            if "scale" in item:
                found[name] = 1.0 / item.quantity("scale", dimensions[name], positive=True)
                scaled.add(name)
            if "weight" in item:
                found[name] *= item.positive("weight") ** 0.5
            item.maybe("within", dimensions[name])
            item.finish()
        if len(set(dimensions.values())) > 1 and scaled != set(found):
            raise DataError(
                f"{self._sheet.where}: sensors read {' and '.join(sorted(set(dimensions.values())))}: give every "
                "sensor a scale, the reading that counts as one, or they cannot be weighed against each other"
            )
        return found

    def within(self, name: str) -> Half | None:
        """Half the interval of a sensor's readings where its table states it, alike in every direction."""
        item = self._items.get(name)
        if item is None or "within" not in item:
            return None
        half = item.quantity("within", dimension_of(str(item.value("within")), *READING), positive=True)
        return half, half


def covariances(values: Complexes, halves: Sequence[Half | None], where: str, names: Sequence[str]) -> Floats | None:
    """Covariance of the parts of each vector, (n, 2, 2); None where no interval is stated.

    Raises DataError where some have an interval and others none.
    """
    bare = [name for name, half in zip(names, halves, strict=True) if half is None]
    if len(bare) == len(halves):
        return None
    if bare:
        raise DataError(
            f"{where}: {bare[0]} has no interval, others have: write for example '170 um ± 2 um @ 112 deg ± 1 deg', "
            "or give its sensor a 'within', or leave all intervals out"
        )
    stated = [half for half in halves if half is not None]
    return np.array([intervals.of_reading(complex(v), *half) for v, half in zip(values, stated, strict=True)])
