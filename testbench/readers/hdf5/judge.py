"""Whether a dataset can be read: nothing of it elsewhere, nothing unknown, no more declared than is there."""

import math

import h5py

from ...findings import Finding
from .walk import plain

_LARGEST_CHUNK = 256 << 20
_MOST_RATIO, _ALWAYS_ALLOWED = 200, 64 << 20
_OWN_FILTERS = frozenset((h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32,
                          h5py.h5z.FILTER_NBIT, h5py.h5z.FILTER_SCALEOFFSET, h5py.h5z.FILTER_SZIP,
                          h5py.h5z.FILTER_LZF))  # fmt: skip


def refusal(path: str, dataset: h5py.Dataset) -> Finding | None:
    """Why a dataset is not read; None if it is."""
    plist = dataset.id.get_create_plist()
    for judged in (_elsewhere, _declares_too_much, _unknown_filter):
        if (found := judged(path, dataset, plist)) is not None:
            return found
    return None


def _elsewhere(path: str, dataset: h5py.Dataset, plist: h5py.h5p.PropDCID) -> Finding | None:
    if plist.get_layout() == h5py.h5d.VIRTUAL:
        sources = sorted({plain(source.file_name) for source in dataset.virtual_sources()})
        message = f"is virtual, of {', '.join(sources) or 'other datasets'}; they are never opened"
        return Finding("outside_reference", path, None, message)
    if count := plist.get_external_count():
        names = sorted({plain(plist.get_external(i)[0]) for i in range(min(count, 100))})
        message = f"lies in {', '.join(names)}, another file, which is never opened"
        return Finding("outside_reference", path, None, message)
    return None


def _declares_too_much(path: str, dataset: h5py.Dataset, plist: h5py.h5p.PropDCID) -> Finding | None:
    """Sizes that are not there: never written, unpacking to far more than is stored, or in giant chunks."""
    if dataset.shape is None:  # a dataset without a value, which is whole as it is
        return None
    there, layout, item = int(dataset.id.get_storage_size()), plist.get_layout(), int(dataset.dtype.itemsize)
    declared = math.prod(map(int, dataset.shape or ())) * item
    chunk = math.prod(map(int, plist.get_chunk())) * item if layout == h5py.h5d.CHUNKED else 0
    if layout == h5py.h5d.CONTIGUOUS and there < declared:
        message = f"declares {declared} bytes and holds {there}: it was never written whole"
        return Finding("cut_file", path, None, message)
    if chunk > _LARGEST_CHUNK or declared > max(_ALWAYS_ALLOWED, _MOST_RATIO * there):
        message = f"declares {declared} bytes in chunks of {chunk}, and holds {there}"
        return Finding("too_large", path, None, message)
    return None


def _unknown_filter(path: str, dataset: h5py.Dataset, plist: h5py.h5p.PropDCID) -> Finding | None:
    """Filters that come with HDF5; others would load a plugin that the file names."""
    for i in range(plist.get_nfilters()):
        code, _, _, name = plist.get_filter(i)
        if code not in _OWN_FILTERS:
            message = f"is packed with filter {code} ({plain(name) or 'without a name'}), which HDF5 lacks"
            return Finding("left_out", path, None, message)
    return None
