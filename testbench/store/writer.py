"""Writing a run: beside its place under a hidden name, then flushed, synced, digested and moved there whole."""

import contextlib
import json
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from ..errors import StoreError
from ..findings import Finding
from ..recording import Conditions, Group, Origin
from . import digest, layout
from .groups import GroupWriter

if TYPE_CHECKING:
    import h5py

PART = ".part"
"""Ending of a run that is being written."""


class RunWriter:
    """A run while it is written. Leaving the ``with`` block without :meth:`commit` leaves nothing behind."""

    def __init__(self, campaign: Path, name: str) -> None:
        self.target = campaign / f"{name}.h5"
        self._tag = f"{uuid4().hex[:12]}{PART}"
        self._part = campaign / f".{name}.{self._tag}"
        self._groups: dict[str, GroupWriter] = {}
        self._taken: set[str] = {"conditions", "provenance", "notes"}
        self._file: h5py.File | None = None
        self._made_folder = False
        if self.target.exists():
            raise StoreError(f"{self.target}: there is a run of this name already; stored runs never change")

    def __enter__(self) -> "RunWriter":
        import h5py

        self._made_folder = not self.target.parent.exists()
        self.target.parent.mkdir(parents=True, exist_ok=True)
        self._file = h5py.File(self._part, "w-", libver=("v108", "v110"))
        self._file.attrs.update({"NX_class": "NXroot", "default": layout.ENTRY, "creator": "counterpoise"})
        self._file.attrs["counterpoise_layout"] = layout.LAYOUT
        self._file.create_group(layout.ENTRY).attrs["NX_class"] = "NXentry"
        return self

    def group(self, group: Group) -> GroupWriter:
        """The writer of this group's samples; a new one if there is none of its name."""
        assert self._file is not None
        if group.name not in self._groups:
            key = layout.safe_name(group.name, self._taken)
            node = self._file[layout.ENTRY].create_group(key)
            self._groups[group.name] = GroupWriter(node, group)
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
        assert self._file is not None
        keys = [writer.key for writer in self._groups.values()]
        self._file[layout.ENTRY].attrs.update({"origin": origin, "groups": keys, "default": keys[0]})
        _write_conditions(self._file, conditions)
        node = _collection(self._file, layout.PROVENANCE)
        node.attrs["json"] = json.dumps(provenance, ensure_ascii=False)
        for number, source in enumerate(provenance["sources"], 1):
            flat = {k: v for k, v in source.items() if isinstance(v, str | int | float)}
            _collection(self._file, f"{layout.PROVENANCE}/source_{number}").attrs.update(flat)
        _collection(self._file, layout.NOTES)
        texts = [json.dumps(finding.as_dict(), ensure_ascii=False) for finding in findings]
        _write_texts(self._file, layout.FINDINGS, texts)
        _write_texts(self._file, layout.RIG, [] if rig is None else [rig])

    def commit(self) -> Path:
        """Move the run to its place, its digest first; never over another one. Returns its path."""
        assert self._file is not None
        self._file.close()
        self._file = None
        with ThreadPoolExecutor(1) as pool:
            synced = pool.submit(_sync, self._part)  # the disk writes while the digest is computed
            line = digest.line_for(self.target.name, digest.sha256_of(self._part))
            synced.result()
        beside = digest.beside(self.target)
        part = beside.with_name(f".{beside.name}.{self._tag}")
        part.write_text(line, encoding="utf-8")
        _sync(part)
        try:
            _place(part, beside)
            self._place_run(beside)
        finally:
            part.unlink(missing_ok=True)
        _sync(self.target.parent)
        return self.target

    def _place_run(self, beside: Path) -> None:
        """The run at its place; if that fails, its digest leaves again."""
        try:
            _place(self._part, self.target)
        except (StoreError, OSError):
            beside.unlink()
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            with contextlib.suppress(OSError, RuntimeError):  # a full disk shows again at closing
                self._file.close()
        self._part.unlink(missing_ok=True)
        if self._made_folder:
            with contextlib.suppress(OSError):  # the run is in it
                self.target.parent.rmdir()


def _write_conditions(file: "h5py.File", conditions: Conditions) -> None:
    node = _collection(file, layout.CONDITIONS)
    node.attrs.update({key: value for key, value in conditions.items() if key != "counter_masses"})
    if "counter_masses" in conditions:
        _collection(file, layout.COUNTER_MASSES).attrs.update(conditions["counter_masses"])


def _collection(file: "h5py.File", path: str) -> "h5py.Group":
    node = file.create_group(path)
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


def _place(part: Path, target: Path) -> None:
    """Give a synced file its name; what has that name already stays, whoever was quicker."""
    try:
        os.link(part, target)
    except FileExistsError as error:
        raise StoreError(
            f"{target}: is there already, from another ingest at this moment or one that was stopped; "
            "`testbench verify` tells which"
        ) from error
    except OSError as error:  # a file system without hard links
        if target.exists():
            raise StoreError(f"{target}: is there already; nothing was replaced") from error
        os.rename(part, target)
    part.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    """Wait until the file or folder is on the disk."""
    if path.is_dir() and os.name == "nt":
        return  # Windows cannot open a folder to sync it
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
