"""Reading HDF5 with h5py: which objects are series of samples, which are metadata, which are left out.

MATLAB 7.3 is HDF5: structures are groups, texts are numbers, cells are references, and arrays lie transposed.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np

from ...recording import Block, Finding, Recording, Refusal
from ..array_grouping import Grouping, Series, group_series
from ..format_findings import damaged, is_beyond_exact, names_listed, nothing_to_read, rounded_integers, watch_nonfinite
from . import datasets, safe_walk
from .datasets import AttributeValue
from .safe_walk import TooMuch, Walk, plain

_OWN = ("/#refs#", "/#subsystem#")
_LONGEST_TEXT, _MOST_CELLS = 1 << 16, 10_000


def is_internal(path: str) -> bool:
    """Whether an object is one of MATLAB's internal ones, to which variables refer."""
    return path.startswith(_OWN)


def matlab_name(path: str) -> str:
    """A path as MATLAB writes it: ``/run/acc`` is ``run.acc``."""
    return path.strip("/").replace("/", ".")


def variable_text(dataset: h5py.Dataset, stated: Mapping[str, AttributeValue]) -> str | None:
    """The text of a variable of letters; None if it is none."""
    if stated.get("MATLAB_class") != "char" or dataset.size is None or dataset.size > _LONGEST_TEXT:
        return None
    if is_empty(stated) or dataset.dtype.kind not in "iu":
        return ""
    codes = np.asarray(dataset[()]).T.ravel()
    return "".join(map(chr, codes.tolist()))


def is_empty(stated: Mapping[str, AttributeValue]) -> bool:
    """Whether a variable of these attributes has no value; its numbers are then its size."""
    return bool(stated.get("MATLAB_empty"))


def cell_datasets(path: str, dataset: h5py.Dataset, file: h5py.File) -> Iterator[tuple[str, h5py.Dataset]]:
    """The datasets that a variable of cells refers to, within this file."""
    if h5py.check_ref_dtype(dataset.dtype) is not h5py.Reference or not 0 < dataset.size <= _MOST_CELLS:
        return
    for i, reference in enumerate(np.asarray(dataset[()]).T.ravel(), 1):
        if reference and isinstance(node := file[reference], h5py.Dataset):
            yield f"{path}{{{i}}}", node


def matlab_index(name: str) -> str:
    """``acc[0,:]`` of HDF5 is ``acc(:,1)`` in MATLAB."""
    base, bracket, index = plain(name).rpartition("[")
    if not bracket:
        return name
    index, part = index.split("]")
    first, second = index.split(",")
    where = f"(:,{int(first) + 1})" if second == ":" else f"({int(second) + 1},:)"
    return f"{base}{where}{part}"


_OPEN_AT_ONCE = 256
"""Datasets that are kept open while they are read, each with HDF5's cache of a mebibyte."""


@dataclass
class _Found:
    """What the objects of a file hold."""

    is_matlab: bool
    reopened: datasets.Reopened
    nexus: datasets.NexusAxes = field(default_factory=datasets.NexusAxes)
    series: list[Series] = field(default_factory=list)
    scalars: dict[str, float] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


def open_library(path: Path) -> Recording:
    """Walk through the file; the numbers are read when asked for, from the file as it was opened."""
    with _refusing(path):
        found, result = _understood(h5py.File(path, "r"), path)
    if not result.groups:
        grave = [finding for finding in found.findings if finding.severity > 0]
        others = f"; it holds {names_listed(found.others)}" if found.others else ""
        raise nothing_to_read(path, grave, f"no array of numbers in it{others}")
    if found.others:
        found.findings.append(Finding("left_out", None, None, f"no series of numbers: {names_listed(found.others)}"))
    return Recording(
        path=path,
        format="MATLAB v7.3" if found.is_matlab else "HDF5",
        reader="testbench.readers.hdf5",
        groups=tuple(gathered.group for gathered in result.groups),
        read=lambda report: watch_nonfinite(_blocks(path, result), report),
        metadata=found.metadata,
        stated_rate_hz=result.stated_rate_hz,
        findings=tuple(found.findings),
    )


def _blocks(path: Path, gathering: Grouping) -> Iterator[Block]:
    with _refusing(path):
        for gathered in gathering.groups:
            yield from gathered.blocks()


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Whatever HDF5 finds wrong in a file is a refusal."""
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, UnicodeError, IndexError) as error:
        raise damaged(path, f"HDF5 cannot read it: {error}") from error
    except TooMuch as error:
        raise Refusal(path.name, Finding("too_large", None, None, str(error))) from error


def _understood(file: h5py.File, path: Path) -> tuple[_Found, Grouping]:
    with path.open("rb") as stream:
        found = _Found(stream.read(10) == b"MATLAB 7.3", lru_cache(_OPEN_AT_ONCE)(file.__getitem__))
    walk = Walk(file)
    for name, value in datasets.attributes(file["/"]).items():
        found.metadata[name] = str(value)
    for where, dataset in walk.datasets():
        if not (found.is_matlab and is_internal(where)):
            _take(file, where, dataset, found)
    found.findings[:0] = walk.findings
    return found, group_series(path.stem, found.series, found.scalars)


def _take(file: h5py.File, path: str, dataset: h5py.Dataset, found: _Found) -> None:
    """Sort a dataset: a series of samples, a number, a text, or something else."""
    name = matlab_name(path) if found.is_matlab else path.rpartition("/")[2]
    stated = datasets.attributes(dataset)
    if datasets.is_netcdf_dimension(stated):
        return
    if (reason := safe_walk.refusal(path, dataset)) is not None:
        found.findings.append(reason)
    elif dataset.shape is None or not dataset.size or (found.is_matlab and is_empty(stated)):
        found.metadata[path.strip("/")] = ""
    elif found.is_matlab and (text := variable_text(dataset, stated)) is not None:
        found.metadata[name] = text
    elif found.is_matlab and h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        for inner, cell in cell_datasets(path, dataset, file):
            _take(file, inner, cell, found)
    elif dataset.size == 1:
        _scalar(path, dataset, found)
    elif (series := datasets.series(dataset, stated, name, _root(path, found.is_matlab), found.reopened)) is not None:
        _keep(path, dataset, stated, series, found)
    else:
        found.others.append(f"{path} ({_described(dataset)})")


def _root(path: str, is_matlab: bool) -> str:
    """What series must share to be a group: the group in HDF5, the variable in MATLAB."""
    parent = path.rpartition("/")[0].strip("/")
    return parent.split("/")[0] if is_matlab else parent


def _keep(
    path: str, dataset: h5py.Dataset, stated: Mapping[str, datasets.AttributeValue], series: Series, found: _Found
) -> None:
    if found.is_matlab:
        channels = tuple(replace(c, name=matlab_index(c.name), label="") for c in series.channels)
        series = replace(series, channels=channels)
    else:
        axis, is_axis = datasets.stated_axis(path, dataset, stated, found.nexus)
        series = replace(series, axis=axis, is_axis=is_axis)
    found.others += [f"{path}.{field}" for field in datasets.left_out_fields(dataset.dtype)]
    packing = datasets.stated_packing(stated, dataset.dtype)
    if (packing.scale, packing.offset) != (1.0, 0.0):
        message = f"numbers were made physical by scale_factor {packing.scale:g} and add_offset {packing.offset:g}"
        found.findings.append(Finding("calibration_applied", series.channels[0].name, path, message))
    if packing.wrap:
        message = "its integers are unsigned, as _Unsigned states"
        found.findings.append(Finding("calibration_applied", series.channels[0].name, path, message))
    if packing.fills and not dataset.is_scale:
        listed = " and ".join(f"{fill:g}" for fill in packing.fills)
        message = f"{listed} stands for no value ({'_FillValue' if '_FillValue' in stated else 'missing_value'}): NaN"
        found.findings.append(Finding("invalid_samples", series.channels[0].name, path, message))
    if dataset.dtype.kind in "iu" and dataset.dtype.itemsize == 8 and _is_beyond_exact(series):
        found.findings.append(rounded_integers(series.channels[0].name, path))
    for key, value in stated.items():
        if not key.isupper() and not key.startswith(("_", "MATLAB")):
            found.metadata[f"{path.strip('/')}: {key}"] = str(value)
            if isinstance(value, int | float):
                found.scalars[f"{path.strip('/')}.{key}"] = float(value)
    found.series.append(series)


def _is_beyond_exact(series: Series) -> bool:
    step = 1 << 20
    return any(
        is_beyond_exact(column)
        for begin in range(0, series.length, step)
        for column in series.block(begin, min(begin + step, series.length))
    )


def _scalar(path: str, dataset: h5py.Dataset, found: _Found) -> None:
    """A single number or text is metadata; a number may state a rate."""
    name = path.strip("/").replace("/", ".")
    if dataset.dtype.kind in "iufb":
        value = float(np.asarray(dataset[()]).ravel()[0])
        found.metadata[name], found.scalars[name] = repr(value), value
    elif h5py.check_string_dtype(dataset.dtype) is not None and dataset.id.get_storage_size() <= 1 << 16:
        element = np.asarray(dataset[()]).ravel()[0]
        found.metadata[name] = plain(element)[:2000].strip("\0") if isinstance(element, bytes | str) else ""


def _described(dataset: h5py.Dataset) -> str:
    kind = "texts" if h5py.check_string_dtype(dataset.dtype) else str(dataset.dtype)
    return f"{' x '.join(map(str, dataset.shape))} of {kind}"
