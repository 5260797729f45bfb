"""Opening HDF5 without letting the file make us open another one, loop, or read what was never written."""

import math
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import StoreError
from . import atomic_files, chunk_io

if TYPE_CHECKING:
    import h5py

Check = Callable[[int, NDArray[np.float64]], None]
"""Given the first sample and values (n,) [as recorded]."""
_DEFLATE, _SHUFFLE, _FLETCHER32 = 1, 2, 3
_FILTERS = frozenset({_DEFLATE, _SHUFFLE, _FLETCHER32})
"""Numbers of the filters that every HDF5 library has."""
_CHECKSUM = 4
"""Bytes that Fletcher-32 adds to a chunk."""
_OF_THE_SYSTEM = re.compile(r"error message = '([^']*)'")
"""What the system said, in what HDF5 says of a read that failed."""
_LARGEST_RATIO = 1040
"""Times that deflated values may be larger than what holds them: no such stream grows by more than 1032."""


@contextmanager
def open_for_reading(path: Path) -> Iterator["h5py.File"]:
    """The HDF5 file at ``path``; whatever HDF5 finds wrong in it becomes a StoreError."""
    import h5py

    if path.is_dir():
        raise StoreError(f"{path}: is a folder; expected one stored run (.h5), such as a campaign holds")
    if not path.is_file():
        what = "is no file but a device or a broken link" if path.exists() or path.is_symlink() else "no such file"
        raise StoreError(f"{path}: {what}; expected a stored run (.h5), or a campaign's folder")
    if not os.access(path, os.R_OK):
        raise StoreError(f"{path}: cannot be read: no permission; ask its owner, or make it readable")
    if not h5py.is_hdf5(path):
        if atomic_files.digest_file(path).exists():
            raise StoreError(f"{path.name}: damaged: no HDF5 file, but it has a digest file: testbench verify")
        raise StoreError(
            f"{path.name}: not a stored run, or damaged: no HDF5 file; a log is stored first: testbench ingest"
        )
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        failed = _OF_THE_SYSTEM.search(str(error))
        what = f"cannot be read ({failed[1]})" if failed else f"not a stored run, or damaged: {error}"
        raise StoreError(f"{path.name}: {what}") from error
    except MemoryError as error:
        raise StoreError(f"{path.name}: does not fit into this machine's memory ({error or 'none is left'})") from error


def member(group: "h5py.Group", path: str) -> Any:  # noqa: ANN401
    """The object at ``path`` below ``group``; links to elsewhere on the way are refused by name."""
    import h5py

    node = _sound(group, path)
    kinds = {h5py.h5d.DatasetID: h5py.Dataset, h5py.h5g.GroupID: h5py.Group}
    return kinds.get(type(node), h5py.Datatype)(node)


def shape(group: "h5py.Group", path: str) -> tuple[int, ...]:
    """That of the dataset at ``path`` below ``group``."""
    found: tuple[int, ...] = _sound(group, path).shape
    return found


def _sound(group: "h5py.Group", path: str) -> Any:  # noqa: ANN401
    """What h5py's lower level has at ``path``.

    Refused are data that lie in another file, that need a foreign filter, or that were never written.
    """
    import h5py

    node = _followed(group, path)
    if not isinstance(node, h5py.h5d.DatasetID):
        return node
    plist, shape, stored = node.get_create_plist(), node.shape, node.get_storage_size()
    kind = plist.get_layout()
    if kind == h5py.h5d.VIRTUAL or plist.get_external_count():
        raise StoreError(f"{_where(group, path)} lies in another file, which is refused")
    filters = {plist.get_filter(n)[0] for n in range(plist.get_nfilters())}
    if not filters <= _FILTERS:
        raise StoreError(f"{_where(group, path)} needs a filter that is not a standard one")
    ratio, item = _LARGEST_RATIO if _DEFLATE in filters else 1, node.dtype.itemsize
    holes = False  # a chunk that was never written: HDF5 would make up its values
    if kind == h5py.h5d.CHUNKED:
        chunk = plist.get_chunk()
        count = math.prod(-(-length // size) for length, size in zip(shape, chunk, strict=True))
        if _DEFLATE in filters:
            holes = int(node.get_num_chunks()) < count
        else:
            holes = stored < count * (math.prod(chunk) * item + (_CHECKSUM if _FLETCHER32 in filters else 0))
    if holes or math.prod(shape) * item > ratio * stored:
        raise StoreError(f"{_where(group, path)} declares more values than the file holds")
    return node


def _where(group: "h5py.Group", path: str) -> str:
    return f"{group.file.filename}: {(group.name or '').rstrip('/')}/{path}"


def _followed(group: "h5py.Group", path: str) -> Any:  # noqa: ANN401
    from h5py import h5l, h5o

    node = group.id  # group[name] and its objects take four times as long
    for name in path.encode().split(b"/"):
        try:
            link = node.links.get_info(name)
        except RuntimeError:
            raise StoreError(f"{group.file.filename}: holds no {path}; it is not a stored run, or damaged") from None
        if link.type != h5l.TYPE_HARD:
            raise StoreError(f"{_where(group, path)}: {name.decode()} is a link to elsewhere, which is refused")
        node = h5o.open(node, name)
    return node


def texts(group: "h5py.Group", path: str, largest: int) -> list[str]:
    """The texts of a dataset, of fixed length each; of no more than ``largest`` bytes together if they are deflated."""
    from h5py import h5s

    dataset = _sound(group, path)
    kind, stored = dataset.dtype, dataset.get_storage_size()
    if kind.kind != "S" or math.prod(dataset.shape) * kind.itemsize > max(largest, stored):
        raise StoreError(f"{group.file.filename}: {path} does not hold texts as we store them")
    found = np.empty(dataset.shape, kind)
    if found.size:
        dataset.read(h5s.ALL, h5s.ALL, found)
    return [bytes(text).decode("utf-8") for text in found]


def numbers(
    group: "h5py.Group", path: str, begin: int, end: int, block: int = 0, check: Check = lambda first, values: None
) -> NDArray[np.float64]:
    """The samples of a dataset of numbers, from ``begin`` to ``end``, (n,) [as recorded].

    ``check`` is given them, and refuses those that are not as written; long ones in parts of ``block`` samples.
    """
    import h5py

    node = _sound(group, path)
    if node.dtype.kind not in "fiu" or len(node.shape) != 1:
        raise StoreError(f"{group.file.filename}: {path} does not hold one number a sample")
    if block and (begin, end) == (0, *node.shape) and chunk_io.is_possible(node, block):
        return chunk_io.read_chunks(node, block, check)
    values = np.asarray(h5py.Dataset(node)[begin:end], dtype=np.float64)
    check(begin, values)
    return values


def whole_numbers(group: "h5py.Group", path: str, kind: str, begin: int = 0, end: int | None = None) -> NDArray[Any]:
    """What a dataset of whole numbers of this kind holds from ``begin`` to ``end``, (n,) [-], all of it there."""
    dataset = member(group, path)
    if dataset.dtype != np.dtype(kind) or dataset.ndim != 1 or (end or 0) > len(dataset):
        raise StoreError(f"{group.file.filename}: {path} does not hold the numbers that its description declares")
    return np.asarray(dataset[begin:end])


def has(group: "h5py.Group", path: str) -> bool:
    """Whether there is an object at ``path`` below ``group``, without following any link to find out."""
    try:
        _followed(group, path)
    except (StoreError, AttributeError):  # not there, a link, or below what is no group
        return False
    return True
