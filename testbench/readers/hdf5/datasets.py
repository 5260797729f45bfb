"""A dataset of HDF5 as a series of samples: its long side is the samples, its short one the channels.

What its attributes state: unit, packing by the conventions of netCDF, and the axis along which its samples lie, in
NeXus by attributes of the group, in netCDF by dimension scales.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from ...recording import Channel, Samples
from ..array_grouping import Series
from ..byte_source import as_float64
from .safe_walk import plain

MOST_CHANNELS = 4096
_UNITS = ("units", "unit", "Units", "Unit", "UNITS", "unit_string")
_MEANT = frozenset(
    (
        *_UNITS,
        "scale_factor",
        "add_offset",
        "_FillValue",
        "missing_value",
        "_Unsigned",
        "NAME",
        "MATLAB_class",
        "MATLAB_empty",
    )
)
_MOST_ATTRIBUTES = 500
_LONGEST_TEXT = 2000
AttributeValue = str | float | int
"""What an attribute says that is one text or number."""
Reopened = Callable[[h5py.Reference], h5py.Dataset]
"""Opens the dataset of a reference, once more if need be: thousands are not kept open, each with its cache."""


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


def sample_axis(shape: Sequence[int]) -> tuple[int, int, bool] | None:
    """Length, width, and whether samples run along the last side; None if there are more than two sides."""
    long = [int(side) for side in shape if side != 1]
    if len(long) > 2:
        return None
    if len(long) < 2:
        return (long[0] if long else 1), 1, False
    length, width = max(long), min(long)
    return length, width, long[0] < long[1]


def number_columns(dtype: np.dtype[Any]) -> list[tuple[str, str]] | None:
    """The columns of one element: field and part (``real``, ``imag``); None if it is no number."""
    if dtype.names:
        if set(dtype.names) == {"real", "imag"}:
            return [("real", "real"), ("imag", "imag")]
        plain_fields = [name for name in dtype.names if dtype[name].kind in "iufb" and not dtype[name].shape]
        return [(name, "") for name in plain_fields] or None
    if dtype.kind == "c":
        return [("", "real"), ("", "imag")]
    return [("", "")] if dtype.kind in "iufb" else None


def left_out_fields(dtype: np.dtype[Any]) -> list[str]:
    """The fields of one element that are no columns: texts, arrays, further fields."""
    kept = {field for field, _ in number_columns(dtype) or [] if field}
    return [plain(name) for name in dtype.names or () if name not in kept and name not in ("real", "imag")]


def series(
    dataset: h5py.Dataset, stated: Mapping[str, AttributeValue], name: str, root: str, reopened: Reopened
) -> Series | None:
    """The dataset with the attributes ``stated`` as a series of samples; None if it is none."""
    shape = dataset.shape
    form, parts = sample_axis(shape), number_columns(dataset.dtype)
    if form is None or parts is None or form[1] * len(parts) > MOST_CHANNELS or form[0] * form[1] != math.prod(shape):
        return None
    length, width, along = form
    unit, packed, reference = unit_of(stated), stated_packing(stated, dataset.dtype), dataset.ref
    channels = tuple(
        Channel(f"{_indexed(name, i, width, along)}{_suffix(field, part)}", unit)
        for field, part in parts
        for i in range(width)
    )

    def block(begin: int, end: int) -> Sequence[Samples]:
        rows = _read(reopened(reference), begin, end, along, width)
        return [packed(_part(column, field, part)) for field, part in parts for column in rows]

    return Series(root, channels, length, block, may_be_time=len(channels) == 1)


def _indexed(name: str, i: int, width: int, along: bool) -> str:
    if width == 1:
        return name
    return f"{name}[{i},:]" if along else f"{name}[:,{i}]"


def _suffix(field: str, part: str) -> str:
    if part:
        return f" ({part})"
    return f".{plain(field)}" if field else ""


def _read(dataset: h5py.Dataset, begin: int, end: int, along: bool, width: int) -> list[np.ndarray[Any, Any]]:
    """Samples ``begin`` to before ``end``, one array a column."""
    long = [axis for axis, side in enumerate(dataset.shape) if side != 1]
    axis = (long[-1] if along else long[0]) if long else 0
    where = tuple(slice(begin, end) if i == axis else slice(None) for i in range(dataset.ndim))
    table = dataset[where].reshape((width, -1) if along else (-1, width))
    return list(table if along else table.T)


def _part(column: np.ndarray[Any, Any], field: str, part: str) -> Samples:
    if column.dtype.names:
        column = column[field]
    elif part:
        column = column.real if part == "real" else column.imag
    return as_float64(column)


def unit_of(stated: Mapping[str, AttributeValue]) -> str | None:
    """The unit in the attributes; None if there is none."""
    for key in _UNITS:
        value = stated.get(key)
        if isinstance(value, str) and value.strip():
            return value.strip()
    return None


def attribute(node: h5py.Group | h5py.Dataset, name: str) -> AttributeValue | None:
    """An attribute that is one text or number; None for anything else, or if it is not there."""
    attrs = node.attrs
    return _value(attrs, name) if name in attrs else None


def _value(attrs: h5py.AttributeManager, name: str) -> AttributeValue | None:
    found = attrs.get_id(name)
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


_NOT_A_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


class NexusAxes:
    """The first axis that each group of NXdata, NXlog or NXdetector names; a group is asked once."""

    def __init__(self) -> None:
        self._known: dict[str, str] = {}

    def of(self, group: str, dataset: h5py.Dataset) -> str:
        """The name of the axis in the group at a path that holds ``dataset``; empty if there is none."""
        if group not in self._known:
            self._known[group] = _named_axis(dataset.parent)
        return self._known[group]


def stated_axis(
    path: str, dataset: h5py.Dataset, stated: Mapping[str, AttributeValue], nexus: NexusAxes
) -> tuple[str, bool]:
    """The path of the axis along which the samples of a dataset lie (empty: none), and if it is the dataset itself."""
    if (scale := _by_scale(path, dataset, stated)) is not None:
        return scale
    group, _, name = path.rpartition("/")
    axis = nexus.of(group, dataset)
    return (f"{group}/{axis}", name == axis) if axis else ("", False)


def _by_scale(path: str, dataset: h5py.Dataset, stated: Mapping[str, AttributeValue]) -> tuple[str, bool] | None:
    """The dimension scale of the long side."""
    if dataset.is_scale:
        return None if is_netcdf_dimension(stated) else (path, True)
    if not dataset.shape or "DIMENSION_LIST" not in dataset.attrs:
        return None
    side = max(range(dataset.ndim), key=lambda axis: dataset.shape[axis])
    if len(dataset.dims[side]):
        scale = dataset.dims[side][0]
        if scale.shape == (dataset.shape[side],):
            return plain(scale.name), False
    return None


def _named_axis(group: h5py.Group) -> str:
    """The first of the axes that the group of NXdata names."""
    kind = attribute(group, "NX_class")
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
    return str(stated.get("NAME", "")).startswith(_NOT_A_VARIABLE)
