"""What the attributes of a dataset of HDF5 state: unit, packing by the conventions of netCDF, and the axis along which
its samples lie, in NeXus by attributes of the group, in netCDF by dimension scales.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from ...recording import Samples
from ..array_grouping import number_columns
from .safe_walk import plain

_UNITS = ("units", "unit", "Units", "Unit", "UNITS", "unit_string")
_PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned")
_MEANT = frozenset((*_UNITS, *_PACKING, "NAME", "MATLAB_class", "MATLAB_empty"))
_MOST_ATTRIBUTES = 500
_LONGEST_TEXT = 2000
AttributeValue = str | float | int
"""What an attribute says that is one text or number."""


@dataclass(frozen=True)
class Packing:
    """Packing by the conventions of netCDF: value = number * scale + offset; ``fills`` stand for no value.

    Negative numbers of type ``signed`` are unsigned ones, less ``wrap``.
    """

    scale: float = 1.0
    offset: float = 0.0
    fills: tuple[float, ...] = ()
    wrap: float = 0.0

    def __call__(self, numbers: Samples) -> Samples:
        """The values of packed numbers."""
        is_fill = np.isin(numbers, self.fills) if self.fills else None
        if self.wrap:
            numbers = np.where(numbers < 0, numbers + self.wrap, numbers)
        values = numbers
        if (self.scale, self.offset) != (1.0, 0.0):
            with np.errstate(all="ignore"):
                values = numbers * self.scale + self.offset
        return values if is_fill is None else np.where(is_fill, np.nan, values)


def stated_packing(stated: Mapping[str, AttributeValue], dtype: np.dtype[Any]) -> Packing:
    """The packing that the attributes of a dataset of this type state."""
    scale, offset = (stated.get(key) for key in ("scale_factor", "add_offset"))
    fills = [value for key in ("_FillValue", "missing_value") if isinstance(value := stated.get(key), int | float)]
    is_unsigned = dtype.kind == "i" and str(stated.get("_Unsigned", "")).casefold() == "true"
    return Packing(
        float(scale) if isinstance(scale, int | float) else 1.0,
        float(offset) if isinstance(offset, int | float) else 0.0,
        tuple(dict.fromkeys(_as_stored(fill, dtype) for fill in fills if not np.isnan(fill))),
        2.0 ** (8 * dtype.itemsize) if is_unsigned else 0.0,
    )


def _as_stored(fill: float, dtype: np.dtype[Any]) -> float:
    """A number as one of ``dtype`` is stored: -999.9 of float32 is not that of float64."""
    with np.errstate(over="ignore"):
        return float(np.array(fill).astype(dtype)) if dtype.kind == "f" else float(fill)


def left_out_fields(dtype: np.dtype[Any]) -> list[str]:
    """The fields of one element that are no columns: texts, arrays, further fields."""
    kept = {of for of, _ in number_columns(dtype) if of}
    return [plain(name) for name in dtype.names or () if name not in kept and name not in ("real", "imag")]


def unit_of(stated: Mapping[str, AttributeValue]) -> str | None:
    """The unit in the attributes; None if there is none."""
    for key in _UNITS:
        value = stated.get(key)
        if isinstance(value, str) and value.strip():
            return value.strip()
    return None


def _value(attrs: h5py.AttributeManager, name: str) -> AttributeValue | None:
    found = attrs.get_id(name)
    if not found.get_space().get_simple_extent_npoints():
        return None  # HDF5 fails to say how large an empty one is
    if found.get_storage_size() > 1 << 16 or (found.dtype.kind == "O" and h5py.check_string_dtype(found.dtype) is None):
        return None
    value = attrs[name]
    if isinstance(value, np.ndarray):
        if value.size != 1:
            return None
        value = value.ravel()[0]
    if isinstance(value, bytes | str):
        return plain(value)[:_LONGEST_TEXT].strip("\0")
    if isinstance(value, np.integer | np.bool_ | int):
        return int(value)
    return float(value) if isinstance(value, np.floating | float) else None


def attributes(node: h5py.Group | h5py.Dataset) -> dict[str, AttributeValue]:
    """All attributes that are one text or number: the first 500, and those that have a meaning here."""
    attrs = node.attrs
    names = list(attrs)
    kept = names if len(names) <= _MOST_ATTRIBUTES else [*names[:_MOST_ATTRIBUTES], *(_MEANT & {*names})]
    found = {plain(name): _value(attrs, name) for name in kept}
    return {name: value for name, value in found.items() if value is not None}


def stated_axis(
    path: str, dataset: h5py.Dataset, stated: Mapping[str, AttributeValue], nexus: dict[str, str]
) -> tuple[str, bool]:
    """The path of the axis along which the samples of a dataset lie (empty: none), and if it is the dataset itself.

    By the dimension scale of its long side, else as the group names it; ``nexus`` remembers what groups name.
    """
    if dataset.is_scale:
        if not is_netcdf_dimension(stated):
            return path, True
    elif dataset.shape and "DIMENSION_LIST" in dataset.attrs:
        side = max(range(dataset.ndim), key=lambda axis: dataset.shape[axis])
        if len(dataset.dims[side]) and (scale := dataset.dims[side][0]).shape == (dataset.shape[side],):
            return plain(scale.name), False
    group, _, name = path.rpartition("/")
    if group not in nexus:
        nexus[group] = _named_axis(dataset.parent)
    return (f"{group}/{nexus[group]}", name == nexus[group]) if nexus[group] else ("", False)


def _named_axis(group: h5py.Group) -> str:
    """The first of the axes that a group of NXdata, NXlog or NXdetector names, if it is there; else empty."""
    kind = _value(group.attrs, "NX_class") if "NX_class" in group.attrs else None
    if kind not in ("NXdata", "NXlog", "NXdetector"):
        return ""
    axes = group.attrs.get("axes")
    if axes is None:
        axis = "time" if kind == "NXlog" else ""
    else:
        axis = plain(axes if isinstance(axes, str | bytes) else (list(axes) or [""])[0]).split(":")[0].strip("[]")
    return axis if axis and axis != "." and axis in group else ""


def is_netcdf_dimension(stated: Mapping[str, AttributeValue]) -> bool:
    """Whether a dataset of these attributes is a mere length, without values."""
    return str(stated.get("NAME", "")).startswith("This is a netCDF dimension but not a netCDF variable")
