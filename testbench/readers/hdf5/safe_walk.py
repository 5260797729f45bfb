"""All objects of an HDF5 file, each once, and whether a dataset of it can be read safely.

No link is followed out of the file, to nowhere, or round in a circle. A dataset is not read where its data lie in
another file, where it declares more than is stored, or where it needs a filter that HDF5 does not bring.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import h5py

from ...recording import Finding

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


def refusal(path: str, dataset: h5py.Dataset) -> Finding | None:
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
