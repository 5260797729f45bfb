"""Writing a run: beside its place under a hidden name, then flushed, synced, digested and moved there whole.

What is written is noted in a journal meanwhile, so that it survives the death of the process.
"""

import contextlib
import errno
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from ..errors import StoreError
from ..recording import Conditions, Finding, Group, Origin
from . import atomic_files, journal, metadata
from .atomic_files import JOURNAL, PART, place_with_digest, sync
from .encodings import Form
from .group_writer import GroupWriter, OutFile

if TYPE_CHECKING:
    import h5py


class RunWriter:
    """A run while it is written. Leaving the ``with`` block without :meth:`commit` leaves nothing behind.

    ``intent`` is what a person would want to know of the run if this process were killed.
    """

    def __init__(self, campaign: Path, name: str, intent: Mapping[str, Any] | None = None) -> None:
        self.target = campaign / f"{name}.h5"
        self._tag = f"{uuid4().hex[:12]}{PART}"
        self._part = campaign / f".{name}.{self._tag}"
        self._intent = {"run": name, **(intent or {})}
        self._journal: journal.JournalWriter | None = None
        self._out: OutFile | None = None
        self._line = ""
        self._groups: dict[str, GroupWriter] = {}
        self._taken: set[str] = {"conditions", "provenance", "notes"}
        self._file: h5py.File | None = None
        self._made_folder = False
        if self.target.exists():
            raise StoreError(f"{self.target}: there is a run of this name already; stored runs never change")

    def __enter__(self) -> "RunWriter":
        self._made_folder = not self.target.parent.exists()
        try:
            with self._writing():
                self._begin()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    @property
    def part(self) -> Path:
        """The file while it is written."""
        return self._part

    def _begin(self) -> None:
        import h5py

        self.target.parent.mkdir(parents=True, exist_ok=True)
        self._journal = journal.JournalWriter(_journal_of(self._part), self._intent)
        self._out = OutFile(self._part)
        self._file = h5py.File(self._out, "w", libver=("v108", "v110"))
        self._file.attrs.update({"NX_class": "NXroot", "default": metadata.ENTRY, "creator": "counterpoise"})
        self._file.attrs[metadata.MARK] = metadata.LAYOUT
        self._file.create_group(metadata.ENTRY).attrs["NX_class"] = "NXentry"

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """What the system or HDF5 cannot write becomes one clear error."""
        try:
            yield
            if self._out is not None:
                self._out.check()
        except (OSError, RuntimeError) as error:
            cause = (self._out and self._out.error) or error  # HDF5 may stumble later over what was not written
            raise StoreError(
                f"{self.target.parent}: cannot be written ({_reason(cause)}); nothing of run {self.target.stem!r} was "
                "stored, and stored runs are as they were"
            ) from error

    def group(self, group: Group, forms: Sequence[Form] | None = None) -> GroupWriter:
        """The writer of this group's samples; a new one if there is none of its name, that stores in these forms."""
        assert self._file is not None
        assert self._journal is not None
        assert self._out is not None
        if group.name not in self._groups:
            key, number = metadata.safe_name(group.name, self._taken), len(self._groups)
            with self._writing():
                node = self._file[metadata.ENTRY].create_group(key)
                self._journal.group(number, group)
            acknowledge = partial(self._journal.acknowledge, number)
            self._groups[group.name] = GroupWriter(node, group, acknowledge, self._writing, self._out, forms)
        return self._groups[group.name]

    def describe(
        self,
        origin: Origin,
        conditions: Conditions,
        findings: Iterable[Finding],
        provenance: Mapping[str, Any],
        rig: str | None,
    ) -> None:
        """Write what is known of the run beside its data."""
        with self._writing():
            self._describe(origin, conditions, findings, provenance, rig)

    def _describe(
        self,
        origin: Origin,
        conditions: Conditions,
        findings: Iterable[Finding],
        provenance: Mapping[str, Any],
        rig: str | None,
    ) -> None:
        assert self._file is not None
        keys = [writer.key for writer in self._groups.values()]
        default = next((writer.key for writer in self._groups.values() if writer.has_plot), keys[0])
        self._file[metadata.ENTRY].attrs.update({"origin": origin, "groups": keys, "default": default})
        _write_conditions(self._file, conditions)
        node = _collection(self._file, metadata.PROVENANCE)
        node.attrs["json"] = json.dumps(provenance, ensure_ascii=False)
        for number, source in enumerate(provenance["sources"], 1):
            flat = {k: v for k, v in source.items() if isinstance(v, str | int | float)}
            _collection(self._file, f"{metadata.PROVENANCE}/source_{number}").attrs.update(flat)
        _collection(self._file, metadata.NOTES)
        known = metadata.description_text(origin, conditions, provenance, self._groups.values())
        _write_texts(self._file, metadata.DESCRIPTION, [known])
        texts = [json.dumps(finding.as_dict(), ensure_ascii=False) for finding in findings]
        _write_texts(self._file, metadata.FINDINGS, texts)
        _write_texts(self._file, metadata.RIG, [] if rig is None else [rig])

    def seal(self) -> None:
        """Close the file, wait until it is on the disk, and take its digest: all that takes long before the end."""
        if self._file is None:
            return
        assert self._journal is not None
        with self._writing():
            self._close()
            with ThreadPoolExecutor(1) as pool:
                synced = pool.submit(sync, self._part)  # the disk writes while the digest is computed
                found = atomic_files.sha256_alone(self._part)
                synced.result()
            self._line = atomic_files.line_for(self.target.name, found)
            self._journal.seal(found)

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._out is not None:
            self._out.close()
            self._out.check()

    def commit(self) -> Path:
        """Move the run to its place, its digest first; never over another one. Returns its path."""
        self.seal()
        with self._writing():
            place_with_digest(self._part, self.target, self._line)
        return self.target

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError, RuntimeError, StoreError):
            self._close()
        with contextlib.suppress(OSError):  # a folder that is a file
            self._part.unlink(missing_ok=True)
        if self._journal is not None:
            self._journal.remove()
        if self._made_folder:
            with contextlib.suppress(OSError):  # the run is in it
                self.target.parent.rmdir()


def _journal_of(part: Path) -> Path:
    return part.with_name(part.name.removesuffix(PART) + JOURNAL)


def _reason(error: OSError | RuntimeError) -> str:
    """What the system says, out of what HDF5 makes of it."""
    known = [code for code in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS) if os.strerror(code) in str(error)]
    number = known[0] if known else getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)


def _write_conditions(file: "h5py.File", conditions: Conditions) -> None:
    node = _collection(file, metadata.CONDITIONS)
    node.attrs.update({key: value for key, value in conditions.items() if key != "counter_masses"})
    if "counter_masses" in conditions:
        _collection(file, metadata.COUNTER_MASSES).attrs.update(conditions["counter_masses"])


def _collection(file: "h5py.File", path: str) -> "h5py.Group":
    node = file.require_group(path)
    node.attrs["NX_class"] = "NXcollection"
    return node


def _write_texts(file: "h5py.File", path: str, texts: list[str]) -> None:
    """Texts as one dataset with a checksum; it is its own dimension, so that netCDF readers open it too."""
    import h5py

    if not texts:
        return
    encoded = [text.encode("utf-8") for text in texts]
    kind = h5py.string_dtype("utf-8", max(1, *map(len, encoded)))
    node = file.create_dataset(path, data=encoded, dtype=kind, chunks=(len(texts),), fletcher32=True)
    node.make_scale(path.rpartition("/")[2])
