"""What a file itself says is the axis of an array: NeXus by attributes of the group, netCDF by dimension scales."""

import h5py

from .arrays import attribute
from .walk import plain


def stated(path: str, dataset: h5py.Dataset) -> tuple[str, bool]:
    """The path of the axis along which the samples of a dataset lie (empty: none), and if it is the dataset itself."""
    return _by_scale(path, dataset) or _by_nexus(path, dataset) or ("", False)


def _by_scale(path: str, dataset: h5py.Dataset) -> tuple[str, bool] | None:
    """The dimension scale of the long side."""
    if dataset.is_scale:
        name = attribute(dataset, "NAME")
        if isinstance(name, str) and name.startswith("This is a netCDF dimension but not a netCDF variable"):
            return None
        return path, True
    if not dataset.shape:
        return None
    side = max(range(dataset.ndim), key=lambda axis: dataset.shape[axis])
    if len(dataset.dims[side]):
        scale = dataset.dims[side][0]
        if scale.shape == (dataset.shape[side],):
            return plain(scale.name), False
    return None


def _by_nexus(path: str, dataset: h5py.Dataset) -> tuple[str, bool] | None:
    """The first of the axes that the group of NXdata names."""
    group, _, name = path.rpartition("/")
    parent = dataset.parent
    if attribute(parent, "NX_class") not in ("NXdata", "NXlog", "NXdetector"):
        return None
    axes = parent.attrs.get("axes")
    if axes is None:
        axis = "time" if attribute(parent, "NX_class") == "NXlog" else ""
    else:
        axis = plain(axes if isinstance(axes, str | bytes) else (list(axes) or [""])[0]).split(":")[0].strip("[]")
    if not axis or axis == "." or axis not in parent:
        return None
    return f"{group}/{axis}", name == axis


def is_netcdf_dimension(dataset: h5py.Dataset) -> bool:
    """Whether a dataset is a mere length, without values."""
    name = attribute(dataset, "NAME")
    return isinstance(name, str) and name.startswith("This is a netCDF dimension but not a netCDF variable")
