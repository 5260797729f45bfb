"""HDF5 of other people, by h5py: plain, NeXus, netCDF 4, MATLAB 7.3.

Which objects are series of samples, which are metadata, which are left out; what the attributes of a dataset state of
its unit, its packing (netCDF) and the axis of its samples (NeXus, netCDF). MATLAB 7.3 is HDF5: structures are groups,
texts are numbers, cells are references, and arrays lie transposed.

No link is followed out of the file, to nowhere, or round in a circle. A dataset is not read where its data lie in
another file, where it declares more than is stored, or where it needs a filter that HDF5 does not bring.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..recording import Finding, Recording, Refusal, Samples
from .array_grouping import MATLAB_INDEX, PYTHON_INDEX, Contents, Series, TextArray, array_series, number_columns
from .format_findings import damaged

_DEEPEST, _MOST = 64, 200_000
_NAMED = 8
"""Links of one fault that are findings each; more of them are one finding, with how many there are."""


class TooMuch(Exception):
    """More objects, or deeper ones, than a log has."""


@dataclass
class Walk:
    """Goes through the objects of ``file``; what it does not follow are findings."""

    file: h5py.File
    seen: int = 0
    _links: dict[str, list[Finding]] = field(default_factory=dict)
    _done: set[int] = field(default_factory=set)

    @property
    def findings(self) -> list[Finding]:
        """What was not followed: each link while they are few; thousands of one fault are one with their number."""
        found = []
        for code, links in self._links.items():
            if len(links) > _NAMED:
                others = ", ".join(str(finding.channel) for finding in links[1:4])
                message = f"{links[0].message}; and {len(links) - 1} more links like it, such as {others}"
                links = [Finding(code, links[0].channel, None, message)]
            found += links
        return found

    def datasets(self) -> Iterator[tuple[str, h5py.Dataset]]:
        """Each dataset with its path, in the order of the file."""
        yield from self._below(self.file["/"], "", (_address(self.file["/"]),))

    def _below(self, group: h5py.Group, path: str, above: tuple[int, ...]) -> Iterator[tuple[str, h5py.Dataset]]:
        if len(above) > _DEEPEST:
            raise TooMuch(f"{path}: groups nested more than {_DEEPEST} deep")
        for key in group:
            self.seen += 1
            if self.seen > _MOST:
                raise TooMuch(f"more than {_MOST} objects")
            here = f"{path}/{plain(key)}"
            node = group[key] if self._is_own(group, key, here) else None
            if not isinstance(node, h5py.Group | h5py.Dataset):
                continue
            address = _address(node)
            if address in above:
                self._found("cyclic_link", here, "leads back to a group that holds it; it is left out")
            elif address not in self._done:
                self._done.add(address)
                if isinstance(node, h5py.Dataset):
                    yield here, node
                else:
                    yield from self._below(node, here, (*above, address))

    def _is_own(self, group: h5py.Group, key: str, path: str) -> bool:
        """Whether the link leads to an object here; soft links are names of objects that are met anyhow."""
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.HardLink):
            return True
        if isinstance(link, h5py.ExternalLink):
            target = f"{plain(link.filename)}:{plain(link.path)}"
            self._found("outside_reference", path, f"is a link to {target} in another file; it is never opened")
        elif isinstance(link, h5py.SoftLink):
            target = plain(link.path)
            end = _resolved(self.file, target if target.startswith("/") else f"{path.rpartition('/')[0]}/{target}")
            if end is None:
                self._found("broken_link", path, f"is a link to {target}, which is not there")
            elif end == "outside":
                self._found("outside_reference", path, f"is a link by {target} out of the file; it is never followed")
            elif end == "circle" or f"{path}/".startswith(f"{end.rstrip('/')}/"):
                self._found("cyclic_link", path, f"is a link to {target}, which holds it; it is left out")
        else:
            self._found("outside_reference", path, "is a link of a kind that is not known; it is never followed")
        return False

    def _found(self, code: str, path: str, message: str) -> None:
        self._links.setdefault(code, []).append(Finding(code, path, None, message))


def _resolved(file: h5py.File, path: str) -> str | None:
    """Where an absolute path of links ends; None nowhere, or ``outside`` or ``circle``."""
    parts, done = [part for part in path.split("/") if part not in ("", ".")], ""
    for _ in range(1000):
        if not parts:
            return done or "/"
        node = file[done or "/"]
        link = node.get(parts[0], getlink=True) if isinstance(node, h5py.Group) else None
        if link is None:
            return None
        if isinstance(link, h5py.SoftLink):
            target = plain(link.path)
            onward = [part for part in target.split("/") if part not in ("", ".")]
            done, parts = ("" if target.startswith("/") else done), onward + parts[1:]
        elif isinstance(link, h5py.HardLink):
            done, parts = f"{done}/{parts[0]}", parts[1:]
        else:
            return "outside"
    return "circle"


def _address(node: h5py.Group | h5py.Dataset) -> int:
    return int(h5py.h5o.get_info(node.id).addr)


def plain(name: str | bytes) -> str:
    """A name that can be printed and stored: bytes that are no UTF-8 become question marks."""
    if isinstance(name, bytes):
        return name.decode("utf-8", "replace")
    return name.encode("utf-8", "replace").decode("utf-8")


_LARGEST_CHUNK = 256 << 20
_MOST_RATIO, _ALWAYS_ALLOWED = 200, 64 << 20
_OWN_FILTERS = frozenset((h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32,
                          h5py.h5z.FILTER_NBIT, h5py.h5z.FILTER_SCALEOFFSET, h5py.h5z.FILTER_SZIP,
                          h5py.h5z.FILTER_LZF))  # fmt: skip


def _refusal(path: str, dataset: h5py.Dataset) -> Finding | None:
    """Why a dataset is not read; None if it is."""
    plist = dataset.id.get_create_plist()
    if plist.get_layout() == h5py.h5d.VIRTUAL:
        sources = sorted({plain(source.file_name) for source in dataset.virtual_sources()})
        message = f"is virtual, of {', '.join(sources) or 'other datasets'}; they are never opened"
        return Finding("outside_reference", path, None, message)
    if count := plist.get_external_count():
        names = sorted({plain(plist.get_external(i)[0]) for i in range(min(count, 100))})
        message = f"lies in {', '.join(names)}, another file, which is never opened"
        return Finding("outside_reference", path, None, message)
    if dataset.shape is not None and (found := _declares_too_much(path, dataset, plist)) is not None:
        return found
    for i in range(plist.get_nfilters()):
        code, _, _, name = plist.get_filter(i)
        if code not in _OWN_FILTERS:  # which would load a plugin that the file names
            message = f"is packed with filter {code} ({plain(name) or 'without a name'}), which HDF5 lacks"
            return Finding("left_out", path, None, message)
    return None


def _declares_too_much(path: str, dataset: h5py.Dataset, plist: h5py.h5p.PropDCID) -> Finding | None:
    """Sizes that are not there: never written, unpacking to far more than is stored, or in giant chunks."""
    there, layout, item = int(dataset.id.get_storage_size()), plist.get_layout(), int(dataset.dtype.itemsize)
    declared = math.prod(map(int, dataset.shape)) * item
    chunk = math.prod(map(int, plist.get_chunk())) * item if layout == h5py.h5d.CHUNKED else 0
    if layout == h5py.h5d.CONTIGUOUS and not there and plist.fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED:
        return Finding("left_out", path, None, "none of its values was ever written: all are its fill value")
    if layout == h5py.h5d.CONTIGUOUS and there < declared:
        message = f"declares {declared} bytes and holds {there}: it was never written whole"
        return Finding("cut_file", path, None, message)
    if chunk > _LARGEST_CHUNK or declared > max(_ALWAYS_ALLOWED, _MOST_RATIO * there):
        message = f"declares {declared} bytes in chunks of {chunk}, and holds {there}"
        return Finding("too_large", path, None, message)
    return None


_UNITS = ("units", "unit", "Units", "Unit", "UNITS", "unit_string")
_PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned")
_MEANT = frozenset((*_UNITS, *_PACKING, "NAME", "MATLAB_class", "MATLAB_empty"))
_MOST_ATTRIBUTES = 500
_LONGEST_STATED = 2000
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
    with np.errstate(over="ignore"):  # -999.9 as stored in float32 is not that of float64
        stored = [float(np.array(fill).astype(dtype)) if dtype.kind == "f" else float(fill) for fill in fills]
    return Packing(
        float(scale) if isinstance(scale, int | float) else 1.0,
        float(offset) if isinstance(offset, int | float) else 0.0,
        tuple(dict.fromkeys(each for each, fill in zip(stored, fills, strict=True) if not np.isnan(fill))),
        2.0 ** (8 * dtype.itemsize) if is_unsigned else 0.0,
    )


def unit_of(stated: Mapping[str, AttributeValue]) -> str | None:
    """The unit in the attributes; None if there is none."""
    values = (stated.get(key) for key in _UNITS)
    return next((value.strip() for value in values if isinstance(value, str) and value.strip()), None)


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
        return plain(value)[:_LONGEST_STATED].strip("\0")
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
    with _refusing(path), path.open("rb") as stream:
        is_matlab = stream.read(10) == b"MATLAB 7.3"
        file = h5py.File(path, "r")
        found = _File(is_matlab=is_matlab, reopened=lru_cache(_OPEN_AT_ONCE)(file.__getitem__))
        found.metadata |= {name: str(value) for name, value in attributes(file["/"]).items()}
        walk = Walk(file)
        for where, dataset in walk.datasets():
            if not (is_matlab and where.startswith(_OWN)):
                _take(file, where, dataset, found)
        found.findings[:0] = walk.findings
        kind = "MATLAB v7.3" if is_matlab else "HDF5"
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


def _take(file: h5py.File, path: str, dataset: h5py.Dataset, found: _File) -> None:
    """Sort a dataset: a series of samples, a number, a text, or something else."""
    dotted, (parent, _, last) = path.strip("/").replace("/", "."), path.rpartition("/")
    name = dotted if found.is_matlab else last
    stated, is_text = attributes(dataset), h5py.check_string_dtype(dataset.dtype) is not None
    is_empty = found.is_matlab and bool(stated.get("MATLAB_empty"))  # its numbers are then its size
    if is_netcdf_dimension(stated):
        return
    if (reason := _refusal(path, dataset)) is not None:
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
        elif is_text and dataset.id.get_storage_size() <= 1 << 16:
            element = np.asarray(dataset[()]).ravel()[0]
            found.metadata[dotted] = plain(element)[:2000].strip("\0") if isinstance(element, bytes | str) else ""
    else:
        place, opened = parent.strip("/"), partial(found.reopened, dataset.ref)
        # what series must share to be a group is the group in HDF5, the variable in MATLAB
        root, index = (place.split("/")[0], MATLAB_INDEX[::-1]) if found.is_matlab else (place, PYTHON_INDEX)
        packing, unit = stated_packing(stated, dataset.dtype), unit_of(stated)
        series = array_series(name, root, dataset.shape, dataset.dtype, opened, index, unit, packing)
        if series is not None:
            _keep(path, dataset, stated, packing, series, found)
        elif is_text and len(dataset.shape) == 1:
            found.texts.append(TextArray(place, name, dataset.size, lambda begin, end: _texts(opened(), begin, end)))
        else:
            what = "texts" if is_text else str(dataset.dtype)
            found.left_out.append(f"{path} ({' x '.join(map(str, dataset.shape))} of {what})")


def _texts(dataset: h5py.Dataset, begin: int, end: int) -> list[str]:
    """The texts from ``begin`` to before ``end``; bytes that are no letters are shown as such."""
    cells = np.asarray(dataset[begin:end], dtype=object).tolist()
    return [cell.decode("utf-8", "backslashreplace") if isinstance(cell, bytes) else str(cell) for cell in cells]


def _keep(
    path: str,
    dataset: h5py.Dataset,
    stated: Mapping[str, AttributeValue],
    packing: Packing,
    series: Series,
    found: _File,
) -> None:
    """Take a series, with what its attributes say of its numbers."""
    if not found.is_matlab:
        axis, is_axis = stated_axis(path, dataset, stated, found.nexus)
        series = replace(series, axis=axis, is_axis=is_axis)
    columns = {of for of, _ in number_columns(dataset.dtype)} | {"real", "imag"}
    found.left_out += [f"{path}.{plain(name)}" for name in dataset.dtype.names or () if name not in columns]
    channel, said = series.channels[0].name, []
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
