"""What a file itself says is the axis of an array: NeXus by attributes of the group, netCDF by dimension scales."""

from collections.abc import Mapping

import h5py

from .arrays import Said, attribute
from .walk import plain

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


def stated(path: str, dataset: h5py.Dataset, said: Mapping[str, Said], nexus: NexusAxes) -> tuple[str, bool]:
    """The path of the axis along which the samples of a dataset lie (empty: none), and if it is the dataset itself."""
    if (scale := _by_scale(path, dataset, said)) is not None:
        return scale
    group, _, name = path.rpartition("/")
    axis = nexus.of(group, dataset)
    return (f"{group}/{axis}", name == axis) if axis else ("", False)


def _by_scale(path: str, dataset: h5py.Dataset, said: Mapping[str, Said]) -> tuple[str, bool] | None:
    """The dimension scale of the long side."""
    if dataset.is_scale:
        return None if is_netcdf_dimension(said) else (path, True)
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


def is_netcdf_dimension(said: Mapping[str, Said]) -> bool:
    """Whether a dataset of these attributes is a mere length, without values."""
    return str(said.get("NAME", "")).startswith(_NOT_A_VARIABLE)
