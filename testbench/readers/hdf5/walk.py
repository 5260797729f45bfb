"""All objects of a file, each once, without following a link out of it, to nowhere, or round in a circle."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import h5py

from ...findings import Finding

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
        """What was not followed: a web of thousands of links alike is one finding with their number."""
        return [finding for alike in self._links.values() for finding in _counted(alike)]

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
            if self._is_own(group, key, here):
                yield from self._object(group, key, here, above)

    def _object(
        self, group: h5py.Group, key: str, path: str, above: tuple[int, ...]
    ) -> Iterator[tuple[str, h5py.Dataset]]:
        node = group[key]
        if not isinstance(node, h5py.Group | h5py.Dataset):
            return
        address = _address(node)
        if address in above:
            self._found("cyclic_link", path, "leads back to a group that holds it; it is left out")
        elif address not in self._done:
            self._done.add(address)
            if isinstance(node, h5py.Dataset):
                yield path, node
            else:
                yield from self._below(node, path, (*above, address))

    def _is_own(self, group: h5py.Group, key: str, path: str) -> bool:
        """Whether the link leads to an object here; soft links are names of objects that are met anyhow."""
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.HardLink):
            return True
        if isinstance(link, h5py.ExternalLink):
            target = f"{plain(link.filename)}:{plain(link.path)}"
            self._found("outside_reference", path, f"is a link to {target} in another file; it is never opened")
        elif isinstance(link, h5py.SoftLink):
            self._judge_soft(group, plain(link.path), path)
        else:
            self._found("outside_reference", path, "is a link of a kind that is not known; it is never followed")
        return False

    def _judge_soft(self, group: h5py.Group, target: str, path: str) -> None:
        """A soft link that leads nowhere, or back to where it comes from."""
        absolute = target if target.startswith("/") else f"{path.rpartition('/')[0]}/{target}"
        end = _resolved(self.file, absolute)
        if end is None:
            self._found("broken_link", path, f"is a link to {target}, which is not there")
        elif end == "outside":
            self._found("outside_reference", path, f"is a link by {target} out of the file; it is never followed")
        elif end == "circle" or f"{path}/".startswith(f"{end.rstrip('/')}/"):
            self._found("cyclic_link", path, f"is a link to {target}, which holds it; it is left out")

    def _found(self, code: str, path: str, message: str) -> None:
        self._links.setdefault(code, []).append(Finding(code, path, None, message))


def _counted(alike: list[Finding]) -> list[Finding]:
    """Findings of one code: each while they are few, else the first one with how many there are."""
    if len(alike) <= _NAMED:
        return alike
    others = ", ".join(str(finding.channel) for finding in alike[1:4])
    message = f"{alike[0].message}; and {len(alike) - 1} more links like it, such as {others}"
    return [Finding(alike[0].code, alike[0].channel, None, message)]


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
