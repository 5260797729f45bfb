"""Dimension scales: which dataset is the axis of which others, as HDF5 and netCDF tools look it up."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import h5py


def attach(datasets: "Sequence[h5py.Dataset]", scale: "h5py.Dataset") -> None:
    """Make ``scale``, which is one already, the first dimension of one-dimensional ``datasets``.

    The two attributes of HDF5's dimension scales, each written once: HDF5's own call writes the scale's list anew for
    every dataset, gigabytes for some ten thousand of them.
    https://docs.hdfgroup.org/hdf5/v1_14/group___h5_d_s.html
    """
    import h5py

    if not datasets:
        return
    axis = np.empty(1, dtype=object)
    axis[0] = np.array([scale.ref], dtype=h5py.ref_dtype)
    for dataset in datasets:
        dataset.attrs.create("DIMENSION_LIST", axis, dtype=h5py.vlen_dtype(h5py.ref_dtype))
    member = np.dtype([("dataset", h5py.ref_dtype), ("dimension", np.uint32)], align=True)
    users = np.array([(dataset.ref, 0) for dataset in datasets], dtype=member)
    scale.attrs.create("REFERENCE_LIST", users, dtype=member)
