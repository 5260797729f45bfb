"""MATLAB 7.3 in HDF5: structures are groups, texts are numbers, cells are references, arrays lie turned round."""

from collections.abc import Iterator, Mapping

import h5py
import numpy as np

from .arrays import Said
from .walk import plain

_OWN = ("/#refs#", "/#subsystem#")
_LONGEST_TEXT, _MOST_CELLS = 1 << 16, 10_000


def is_own(path: str) -> bool:
    """Whether an object is MATLAB's own keeping, which variables refer to."""
    return path.startswith(_OWN)


def name_of(path: str) -> str:
    """A path as MATLAB writes it: ``/run/acc`` is ``run.acc``."""
    return path.strip("/").replace("/", ".")


def text(dataset: h5py.Dataset, said: Mapping[str, Said]) -> str | None:
    """The text of a variable of letters; None if it is none."""
    if said.get("MATLAB_class") != "char" or dataset.size is None or dataset.size > _LONGEST_TEXT:
        return None
    if is_empty(said) or dataset.dtype.kind not in "iu":
        return ""
    codes = np.asarray(dataset[()]).T.ravel()
    return "".join(map(chr, codes.tolist()))


def is_empty(said: Mapping[str, Said]) -> bool:
    """Whether a variable of these attributes has no value; its numbers are then its size."""
    return bool(said.get("MATLAB_empty"))


def cells(path: str, dataset: h5py.Dataset, file: h5py.File) -> Iterator[tuple[str, h5py.Dataset]]:
    """The datasets that a variable of cells refers to, within this file."""
    if h5py.check_ref_dtype(dataset.dtype) is not h5py.Reference or not 0 < dataset.size <= _MOST_CELLS:
        return
    for i, reference in enumerate(np.asarray(dataset[()]).T.ravel(), 1):
        if reference and isinstance(node := file[reference], h5py.Dataset):
            yield f"{path}{{{i}}}", node


def turned(name: str) -> str:
    """``acc[0,:]`` of HDF5 is ``acc(:,1)`` in MATLAB."""
    base, bracket, index = plain(name).rpartition("[")
    if not bracket:
        return name
    index, part = index.split("]")
    first, second = index.split(",")
    where = f"(:,{int(first) + 1})" if second == ":" else f"({int(second) + 1},:)"
    return f"{base}{where}{part}"
