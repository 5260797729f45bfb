"""Physical values from raw ones, by the scales that the file carries."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ...recording import Samples
from ..registry import needs
from ..stream import as_float64
from .metadata import Property

Raw = Mapping[int | None, NDArray[Any]]
_RAW = 0xFFFFFFFF
_MOST_SCALES = 100


class Scaling:
    """The chain of scales of a channel; the last one gives the physical value."""

    def __init__(self, properties: Mapping[str, Property]) -> None:
        self._said = properties
        count = properties.get("NI_Number_Of_Scales", 0)
        self.count = count if isinstance(count, int) else 0

    @property
    def applies(self) -> bool:
        """Whether raw values are not physical already."""
        return self.count > 0 and self._said.get("NI_Scaling_Status", "unscaled") != "scaled"

    def physical(self, raw: Raw) -> Samples:
        """Physical values of raw numbers."""
        if not self.applies:
            return as_float64(next(iter(raw.values())))
        if self.count > _MOST_SCALES:
            raise ValueError(f"{self.count} scales")
        if not self._is_plain():
            return self._by_library(raw)
        return self._scaled(self.count - 1, raw, 0)

    def _is_plain(self) -> bool:
        """Whether all scales are of the two laws below, or numbers of a DAQmx device as they are."""
        kinds = {self._said.get(f"NI_Scale[{i}]_Scale_Type") for i in range(self.count)}
        return kinds <= {"Linear", "Polynomial", None}

    def _scaled(self, index: int, raw: Raw, depth: int) -> Samples:
        name = f"NI_Scale[{index}]"
        kind = self._said.get(f"{name}_Scale_Type")
        if kind is None:  # the number that a DAQmx device wrote under this scale
            return np.asarray(raw[index] if index in raw else next(iter(raw.values())), dtype=np.float64)
        if depth > self.count:
            raise ValueError(f"{name} takes its input from itself")
        source = int(self._said.get(f"{name}_{kind}_Input_Source", _RAW))
        values = (
            np.asarray(next(iter(raw.values())), dtype=np.float64)
            if source == _RAW
            else self._scaled(source, raw, depth + 1)
        )
        if kind == "Linear":
            # y = slope * x + intercept
            return values * self._number(f"{name}_Linear_Slope") + self._number(f"{name}_Linear_Y_Intercept")
        # y = c0 + c1 x + c2 x^2 + ...
        count = int(self._said.get(f"{name}_Polynomial_Coefficients_Size", 4))
        if not 0 < count <= 100:
            raise ValueError(f"{name} has {count} coefficients")
        coefficients = [self._number(f"{name}_Polynomial_Coefficients[{i}]") for i in range(count)]
        return np.asarray(np.polynomial.polynomial.polyval(values, coefficients), dtype=np.float64)

    def _number(self, name: str) -> float:
        return float(self._said[name])

    def _by_library(self, raw: Raw) -> Samples:
        """Scales of thermocouples, bridges, tables and the like."""
        try:
            library = import_module("nptdms.scaling")  # numbers alone go to it, no bytes of the file
        except ModuleNotFoundError as error:
            raise RecordingError(f"the scales of this TDMS file need npTDMS: pip install '{needs('tdms')}'") from error
        scaling = library.get_scaling(self._said, {}, {})
        if scaling is None:
            kinds = {self._said.get(f"NI_Scale[{i}]_Scale_Type") for i in range(self.count)}
            raise ValueError(f"scales {kinds} are not known")
        scaled = scaling.scale(next(iter(raw.values()))) if None in raw else scaling.scale_daqmx(raw)
        return np.asarray(scaled, dtype=np.float64)
