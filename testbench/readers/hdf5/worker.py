"""Reading HDF5 with h5py: which objects are series of samples, which are metadata, which are left out.

MATLAB 7.3 is HDF5: structures are groups, texts are numbers, cells are references, and arrays lie transposed.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import h5py
import numpy as np

from ...recording import Finding, Recording, Refusal
from ..array_grouping import MATLAB_INDEX, PYTHON_INDEX, Contents, Series, TextArray, array_series
from ..format_findings import damaged
from . import datasets, safe_walk
from .datasets import AttributeValue
from .safe_walk import TooMuch, Walk, plain

_OWN = ("/#refs#", "/#subsystem#")
"""MATLAB's internal objects, to which variables refer."""
_LONGEST_TEXT, _MOST_CELLS = 1 << 16, 10_000
_OPEN_AT_ONCE = 256
"""Datasets that are kept open while they are read, each with HDF5's cache of a mebibyte."""


@dataclass(kw_only=True)
class _File(Contents):
    """What the objects of a file come to; ``reopened`` opens a dataset by its reference, once more if need be."""

    is_matlab: bool
    reopened: Callable[[h5py.Reference], h5py.Dataset]
    nexus: dict[str, str] = field(default_factory=dict)


def open_library(path: Path) -> Recording:
    """Walk through the file; the numbers are read when asked for, from the file as it was opened."""
    with _refusing(path):
        found = _understood(h5py.File(path, "r"), path)
        kind = "MATLAB v7.3" if found.is_matlab else "HDF5"
        return found.recording(path, kind, "testbench.readers.hdf5", partial(_refusing, path))


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Whatever HDF5 finds wrong in a file is a refusal."""
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, UnicodeError, IndexError) as error:
        raise damaged(path, f"HDF5 cannot read it: {error}") from error
    except TooMuch as error:
        raise Refusal(path.name, Finding("too_large", None, None, str(error))) from error


def _understood(file: h5py.File, path: Path) -> _File:
    with path.open("rb") as stream:
        is_matlab = stream.read(10) == b"MATLAB 7.3"
    found = _File(is_matlab=is_matlab, reopened=lru_cache(_OPEN_AT_ONCE)(file.__getitem__))
    found.metadata |= {name: str(value) for name, value in datasets.attributes(file["/"]).items()}
    walk = Walk(file)
    for where, dataset in walk.datasets():
        if not (is_matlab and where.startswith(_OWN)):
            _take(file, where, dataset, found)
    found.findings[:0] = walk.findings
    return found


def _take(file: h5py.File, path: str, dataset: h5py.Dataset, found: _File) -> None:
    """Sort a dataset: a series of samples, a number, a text, or something else."""
    dotted, (parent, _, last) = path.strip("/").replace("/", "."), path.rpartition("/")
    name = dotted if found.is_matlab else last
    stated = datasets.attributes(dataset)
    is_empty = found.is_matlab and bool(stated.get("MATLAB_empty"))  # its numbers are then its size
    if datasets.is_netcdf_dimension(stated):
        return
    if (reason := safe_walk.refusal(path, dataset)) is not None:
        found.findings.append(reason)
    elif dataset.shape is None or not dataset.size or is_empty:
        found.metadata[path.strip("/")] = ""
    elif found.is_matlab and stated.get("MATLAB_class") == "char" and dataset.size <= _LONGEST_TEXT:
        letters = np.asarray(dataset[()]).T.ravel().tolist() if dataset.dtype.kind in "iu" else []
        found.metadata[name] = "".join(map(chr, letters))
    elif found.is_matlab and h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        references = np.asarray(dataset[()]).T.ravel() if dataset.size <= _MOST_CELLS else ()
        for i, reference in enumerate(references, 1):
            if reference and isinstance(node := file[reference], h5py.Dataset):
                _take(file, f"{path}{{{i}}}", node, found)
    elif dataset.size == 1:
        # A single number or text is metadata; a number may state a rate.
        if dataset.dtype.kind in "iufb":
            value = float(np.asarray(dataset[()]).ravel()[0])
            found.metadata[dotted], found.scalars[dotted] = repr(value), value
        elif h5py.check_string_dtype(dataset.dtype) is not None and dataset.id.get_storage_size() <= 1 << 16:
            element = np.asarray(dataset[()]).ravel()[0]
            found.metadata[dotted] = plain(element)[:2000].strip("\0") if isinstance(element, bytes | str) else ""
    elif (series := _series(name, parent.strip("/"), dataset, stated, found)) is not None:
        _keep(path, dataset, stated, series, found)
    elif h5py.check_string_dtype(dataset.dtype) is not None and len(dataset.shape) == 1:
        opened = partial(found.reopened, dataset.ref)
        found.texts.append(
            TextArray(parent.strip("/"), name, dataset.size, lambda begin, end: _texts(opened(), begin, end))
        )
    else:
        what = "texts" if h5py.check_string_dtype(dataset.dtype) else str(dataset.dtype)
        found.left_out.append(f"{path} ({' x '.join(map(str, dataset.shape))} of {what})")


def _series(
    name: str, parent: str, dataset: h5py.Dataset, stated: Mapping[str, AttributeValue], found: _File
) -> Series | None:
    """A dataset as a series; what series must share to be a group is the group in HDF5, the variable in MATLAB."""
    root = parent.split("/")[0] if found.is_matlab else parent
    index = MATLAB_INDEX[::-1] if found.is_matlab else PYTHON_INDEX
    packing, unit = datasets.stated_packing(stated, dataset.dtype), datasets.unit_of(stated)
    opened = partial(found.reopened, dataset.ref)
    return array_series(name, root, dataset.shape, dataset.dtype, opened, index, unit, packing)


def _texts(dataset: h5py.Dataset, begin: int, end: int) -> list[str]:
    """The texts from ``begin`` to before ``end``; bytes that are no letters are shown as such."""
    cells = np.asarray(dataset[begin:end], dtype=object).tolist()
    return [cell.decode("utf-8", "backslashreplace") if isinstance(cell, bytes) else str(cell) for cell in cells]


def _keep(path: str, dataset: h5py.Dataset, stated: Mapping[str, AttributeValue], series: Series, found: _File) -> None:
    """Take a series, with what its attributes say of its numbers."""
    if not found.is_matlab:
        axis, is_axis = datasets.stated_axis(path, dataset, stated, found.nexus)
        series = replace(series, axis=axis, is_axis=is_axis)
    found.left_out += [f"{path}.{name}" for name in datasets.left_out_fields(dataset.dtype)]
    packing, channel = datasets.stated_packing(stated, dataset.dtype), series.channels[0].name
    said = []
    if (packing.scale, packing.offset) != (1.0, 0.0):
        stretched = f"scale_factor {packing.scale:g} and add_offset {packing.offset:g}"
        said.append(("calibration_applied", f"numbers were made physical by {stretched}"))
    if packing.wrap:
        said.append(("calibration_applied", "its integers are unsigned, as _Unsigned states"))
    if packing.fills and not dataset.is_scale:
        key = "_FillValue" if "_FillValue" in stated else "missing_value"
        listed = " and ".join(f"{fill:g}" for fill in packing.fills)
        said.append(("invalid_samples", f"{listed} stands for no value ({key}): NaN"))
    found.findings += [Finding(code, channel, path, message) for code, message in said]
    for key, value in stated.items():
        if not key.isupper() and not key.startswith(("_", "MATLAB")):
            found.metadata[f"{path.strip('/')}: {key}"] = str(value)
            if isinstance(value, int | float):
                found.scalars[f"{path.strip('/')}.{key}"] = float(value)
    found.keep(series, dataset.dtype, channel, path)
