"""Writing a run: under a hidden name, then flushed, synced, digested and moved there whole.

A group is a dataset a channel, in whole chunks, with its checksum, unit, written name and clock. Where the chunks lie
is noted in a journal meanwhile, so that they survive the death of the process.
"""

import contextlib
import errno
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from ..errors import StoreError
from ..recording import (
    Channel,
    Conditions,
    Finding,
    Group,
    Origin,
    Samples,
    StartTime,
    TimeColumn,
    UniformClock,
    earliest,
)
from . import atomic_files, chunk_io, layout
from .atomic_files import JOURNAL, PART, JournalWriter, Piece, one_at_a_time, place_with_digest, sync
from .chunk_io import OutFile, digest, digest_of_texts
from .encodings import COMPRESSED, PLAIN, Decimals, Form, minus_bits
from .ledger import enter_run, read_ledger

if TYPE_CHECKING:
    import h5py

CHUNK = 1 << 16
"""Samples a chunk."""
GATHERED = 2 * CHUNK
"""Samples that are gathered before whole chunks are written."""
ENTERED = ("accepted_findings", "acceptance", "continues")
"""What the ledger says of a run, out of its provenance."""
SYNCED_EVERY_S = 0.5
"""How long chunks that are acknowledged wait until they begin to be synced with the journal [s].

A loss of power costs twice this, or what was acknowledged in twice the time that the disk takes for it.
"""
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable. %10d"
_SLOTS = 7
"""Places in HDF5's cache of chunks: chunks come one after the other; HDF5's own 8191 take 64 KB a channel."""


class GroupWriter:
    """The samples of one group of a run, gathered to whole chunks and written; chunks that lie there are acknowledged.

    ``forms`` says how the samples of each channel are stored; without it as they are.
    """

    def __init__(
        self, run: "RunWriter", number: int, node: "h5py.Group", group: Group, forms: Sequence[Form] | None = None
    ) -> None:
        self.node, self.group, self.samples = node, group, 0
        self.forms = [PLAIN] * len(group.channels) if forms is None else list(forms)
        self._form_of_time = PLAIN if forms is None else COMPRESSED
        self._minus: list[list[NDArray[np.uint8]]] = [[] for _ in group.channels]
        self._run, self._number = run, number
        self.rate_hz: float | None = None
        self.rate_source: str | None = None
        self.start_time: StartTime | None = None
        self.has_plot = False
        self.key = node.name.rpartition("/")[2]
        taken = {layout.TIME, layout.SAMPLE}
        self.keys = [
            layout.TIME
            if isinstance(group.clock, TimeColumn) and group.clock.index == i
            else layout.safe_name(channel.label, taken)
            for i, channel in enumerate(group.channels)
        ]
        self._waiting: list[list[Samples]] = [[] for _ in group.channels]
        self._datasets: list[h5py.Dataset] = []
        self._written = 0
        self._chunk = chunk_io.Chunk(0)
        self.digests = [bytearray() for _ in group.channels]

    def append(self, columns: Sequence[Samples]) -> None:
        """Take in the next samples, one column a channel."""
        for waiting, column in zip(self._waiting, columns, strict=True):
            waiting.append(column)
        self.samples += len(columns[0])
        if self.samples - self._written >= GATHERED:
            with self._run.writing():
                self._write((self.samples - self._written) // CHUNK * CHUNK)

    def _write(self, count: int) -> None:
        """Write ``count`` of the waiting samples of each channel."""
        if not self._datasets:
            self._chunk = chunk_io.Chunk(min(CHUNK, max(1, count)))
            self._datasets = [
                _dataset(self.node, k, self._chunk.length, f) for k, f in zip(self.keys, self.forms, strict=True)
            ]
        pieces: list[Sequence[Piece]] = []
        for i, (dataset, form) in enumerate(zip(self._datasets, self.forms, strict=True)):
            dataset.resize((self._written + count,))
            if form is PLAIN:
                pieces.append(self._write_chunks(i, count))
                continue
            samples = np.concatenate([np.empty(0), *self._taken(i, count)])
            dataset[self._written : self._written + count] = form.stored(samples)
            if isinstance(form, Decimals) and form.negative_zeros:
                self._minus[i].append(minus_bits(samples))
            for begin in range(0, count, CHUNK):
                self._note_digest(i, self._written + begin, samples[begin : begin + CHUNK])
        self._run.out.check()
        if pieces:
            self._run.acknowledge(self._number, pieces)
        self._written += count

    def _taken(self, index: int, count: int) -> list[Samples]:
        """The first ``count`` of the waiting samples of a channel, in parts, which wait no longer."""
        waiting, parts = self._waiting[index], list[Samples]()
        while count:
            parts.append(waiting[0][:count])
            count -= len(parts[-1])
            waiting[:1] = [waiting[0][len(parts[-1]) :]] if len(parts[-1]) < len(waiting[0]) else []
        return parts

    def _write_chunks(self, index: int, count: int) -> list[Piece]:
        """Write chunks past HDF5's filter; where they went is seen below HDF5, which would look through all."""
        dataset, chunk, pieces = self._datasets[index], self._chunk, []
        for first in range(self._written, self._written + count, chunk.length):
            block = chunk.fill(self._taken(index, min(chunk.length, self._written + count - first)))
            size = chunk.write(dataset, first)
            at, seen = self._run.out.last
            if seen != size:
                at = dataset.id.get_chunk_info_by_coord((first,)).byte_offset
            pieces.append(Piece(at, size, len(block), self._note_digest(index, first, block).hex()))
        return pieces

    def _note_digest(self, index: int, first: int, block: Samples) -> bytes:
        found = digest(np.ascontiguousarray(block, "<f8"), self._run.salt, self._number, index, first)
        self.digests[index] += found
        return found

    def finish(self, rate_hz: float | None, rate_source: str | None, start_time: StartTime | None = None) -> None:
        """Write what waits, then names, units and clock."""
        self.rate_hz, self.rate_source, self.start_time = rate_hz, rate_source, start_time
        with self._run.writing():
            self._write(self.samples - self._written)
            clock = self.group.clock
            self.node.attrs.update({"NX_class": "NXdata", "name": self.group.name, "samples": self.samples})
            self.node.attrs["channels"] = self.keys
            if rate_hz is not None:
                self.node.attrs.update({"rate_hz": rate_hz, "rate_source": rate_source})
            if start_time is not None:
                self.node.attrs["start_time"] = start_time.time
            if isinstance(clock, UniformClock):
                self.node.attrs.update({"clock": "uniform", "rate_hz": clock.rate_hz, "start_s": clock.start_s})
            elif clock is not None:
                self.node.attrs.update({"clock": "recorded", "unit_assumed": clock.assumed})
                if clock.seconds_per_unit is not None:
                    self.node.attrs["seconds_per_unit"] = clock.seconds_per_unit
            else:
                self.node.attrs["clock"] = "none"
            for dataset, channel, form in zip(self._datasets, self.group.channels, self.forms, strict=True):
                _name(dataset, channel)
                dataset.attrs.update(form.attributes)
            # Write what whole numbers do not hold; each dataset is its own dimension, for netCDF readers.
            for key, bits in zip(self.keys, self._minus, strict=True):
                if bits:
                    node = self.node.file
                    for name in (*layout.MINUS.split("/"), self.key):
                        node = node.require_group(name)
                        node.attrs.setdefault("NX_class", "NXcollection")
                    content = np.concatenate(bits)
                    node.create_dataset(key, data=content, fletcher32=True, **COMPRESSED.options).make_scale(key)
            self._attach(self._dimension(clock))

    def _dimension(self, clock: UniformClock | TimeColumn | None) -> "h5py.Dataset":
        """The scale of the samples: recorded time, time by index and rate, or a length without values."""
        if isinstance(clock, TimeColumn):
            return self._datasets[clock.index]
        if isinstance(clock, UniformClock):
            chunk = CHUNK if self.samples >= CHUNK else max(1, self.samples)
            time = _dataset(self.node, layout.TIME, chunk, self._form_of_time)
            time.resize((self.samples,))
            for begin in range(0, self.samples, GATHERED):
                end = min(begin + GATHERED, self.samples)
                time[begin:end] = clock.times(begin, end)
            _name(time, Channel(f"{layout.TIME} (s)", "s", layout.TIME))
            return time
        scale = self.node.create_dataset(layout.SAMPLE, shape=(self.samples,), dtype=">f4")
        scale.make_scale(_NO_VARIABLE % self.samples)
        return scale

    def _attach(self, scale: "h5py.Dataset") -> None:
        """Make ``scale`` the dimension of all channels, and say to NeXus what to plot."""
        if scale.name.endswith(layout.TIME):
            scale.make_scale(layout.TIME)
        others = [(key, d) for key, d in zip(self.keys, self._datasets, strict=True) if d.name != scale.name]
        attach_dimensions([dataset for _, dataset in others], scale)
        shown = [key for key, form in zip(self.keys, self.forms, strict=True) if not isinstance(form, Decimals)]
        signals = [key for key, _ in others if key in shown]
        self.has_plot = bool(signals)
        if signals or not others:  # NeXus viewers apply no scale: of whole numbers they would plot other values
            self.node.attrs["signal"] = signals[0] if signals else layout.TIME
            self.node.attrs["axes"] = [layout.TIME if scale.name.endswith(layout.TIME) and others else "."]

    def description(self) -> dict[str, Any]:
        """Its part of the description of the run."""
        return {
            "key": self.key,
            "name": self.group.name,
            "samples": self.samples,
            "rate_hz": self.rate_hz,
            "rate_source": self.rate_source,
            "clock": self.group.clock and asdict(self.group.clock),
            "zero": self.group.zero and asdict(self.group.zero),
            "start_time": self.start_time and asdict(self.start_time),
            "channels": [
                {"key": key, "name": channel.name, "label": channel.label, "unit": channel.unit, "digests": found.hex()}
                | ({"whole": asdict(form)} if isinstance(form, Decimals) else {})
                for key, channel, form, found in zip(
                    self.keys, self.group.channels, self.forms, self.digests, strict=True
                )
            ],
        }


def _dataset(node: "h5py.Group", key: str, chunk: int, form: Form) -> "h5py.Dataset":
    return node.create_dataset(
        key,
        shape=(0,),
        maxshape=(None,),
        dtype=form.kind,
        chunks=(chunk,),
        fletcher32=True,
        rdcc_nslots=_SLOTS,
        **form.options,
    )


def _name(dataset: "h5py.Dataset", channel: Channel) -> None:
    dataset.attrs.update({"long_name": channel.name, "label": channel.label})
    if channel.unit is not None:
        dataset.attrs["units"] = channel.unit


def attach_dimensions(datasets: "Sequence[h5py.Dataset]", scale: "h5py.Dataset") -> None:
    """Make ``scale``, which is one already, the first dimension of one-dimensional ``datasets``.

    The two attributes of HDF5's dimension scales, each written once: HDF5's own call writes the scale's list anew for
    every dataset, gigabytes for some ten thousand of them.
    https://docs.hdfgroup.org/hdf5/v1_14/group___h5_d_s.html
    """
    import h5py

    if not datasets:
        return
    axis = np.empty(1, dtype=object)
    axis[0] = np.array([scale.ref], dtype=h5py.ref_dtype)
    for dataset in datasets:
        dataset.attrs.create("DIMENSION_LIST", axis, dtype=h5py.vlen_dtype(h5py.ref_dtype))
    member = np.dtype([("dataset", h5py.ref_dtype), ("dimension", np.uint32)], align=True)
    users = np.array([(dataset.ref, 0) for dataset in datasets], dtype=member)
    scale.attrs.create("REFERENCE_LIST", users, dtype=member)


class RunWriter:
    """A run while it is written. Leaving the ``with`` block without :meth:`commit` leaves nothing behind.

    ``intent`` is what a person would want to know of the run if this process were killed.
    """

    def __init__(self, campaign: Path, name: str, intent: Mapping[str, Any] | None = None) -> None:
        self.target = campaign / f"{name}.h5"
        self.salt = uuid4().hex[:12]
        """Of its digests, and in the names of its unfinished files."""
        self.part = campaign / f".{name}.{self.salt}{PART}"
        """The file while it is written."""
        self._intent = {"run": name, **(intent or {})}
        self._journal: JournalWriter | None = None
        self._out: OutFile | None = None
        self._sha256 = ""
        self._groups: dict[str, GroupWriter] = {}
        self._taken: set[str] = {"conditions", "provenance", "notes", "start_time"}
        self._file: h5py.File | None = None
        self._made_folder = self._is_placed = False
        self._details: dict[str, Any] = {}
        self._pool = ThreadPoolExecutor(1)  # syncs while the next chunks are written
        self._syncing: Future[None] | None = None
        self._sync_begun = time.monotonic()
        if self.target.exists():
            raise StoreError(f"{self.target}: there is a run of this name already; stored runs never change")

    def __enter__(self) -> "RunWriter":
        self._made_folder = not self.target.parent.exists()
        try:
            with self.writing():
                self._begin()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    @property
    def out(self) -> OutFile:
        """The file below HDF5."""
        assert self._out is not None
        return self._out

    def _begin(self) -> None:
        import h5py

        self.target.parent.mkdir(parents=True, exist_ok=True)
        read_ledger(self.target.parent)  # one that is damaged takes no entry: better known before the log is read
        self._journal = JournalWriter(self.part.with_suffix(JOURNAL), self._intent)
        self._out = OutFile(self.part)
        self._file = h5py.File(self._out, "w", libver=("v108", "v110"))
        self._file.attrs.update({"NX_class": "NXroot", "default": layout.ENTRY, "creator": "counterpoise"})
        self._file.attrs[layout.MARK] = layout.LAYOUT
        self._file.create_group(layout.ENTRY).attrs["NX_class"] = "NXentry"

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
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
        if group.name not in self._groups:
            key, number = layout.safe_name(group.name, self._taken), len(self._groups)
            with self.writing():
                node = self._file[layout.ENTRY].create_group(key)
                self._journal.group(number, group)
            self._groups[group.name] = GroupWriter(self, number, node, group, forms)
        return self._groups[group.name]

    def acknowledge(self, number: int, pieces: Sequence[Sequence[Piece]]) -> None:
        """Note chunks in the journal; from time to time begin to sync all that are in it."""
        assert self._journal is not None
        self._journal.acknowledge(number, pieces)
        if time.monotonic() - self._sync_begun >= SYNCED_EVERY_S:
            self.wait_until_synced()
            self._sync_begun = time.monotonic()
            self._syncing = self._pool.submit(self._sync, dict(self._journal.acknowledged))

    def _sync(self, acknowledged: Mapping[int, int]) -> None:
        """Wait until so many chunks of each group are on the disk, and the journal that says so."""
        assert self._journal is not None
        self.out.sync()
        self._journal.sync(acknowledged)
        sync(self.target.parent)

    def wait_until_synced(self) -> None:
        """Wait for the sync that has begun, if one has. Raises OSError if it failed."""
        syncing, self._syncing = self._syncing, None
        if syncing is not None:
            syncing.result()

    def describe(
        self,
        origin: Origin,
        conditions: Conditions,
        findings: Iterable[Finding],
        provenance: Mapping[str, Any],
        rig: str | None,
        inputs: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        """Write what is known of the run: where it is from, conditions, findings, rig, ``Run.inputs``."""
        assert self._file is not None
        keys = [writer.key for writer in self._groups.values()]
        default = next((writer.key for writer in self._groups.values() if writer.has_plot), keys[0])
        self._details = {key: found for key in ENTERED if (found := provenance.get(key))}
        texts = {place: list(inputs.get(place.rpartition("/")[2], ())) for place in layout.TEXTS}
        texts[layout.FINDINGS] = [json.dumps(finding.as_dict(), ensure_ascii=False) for finding in findings]
        texts[layout.RIG] = [] if rig is None else [rig]
        digests = {place: digest_of_texts(found, self.salt, place) for place, found in texts.items() if found}
        known = {"layout": layout.LAYOUT, "origin": origin, "conditions": conditions, "provenance": provenance,
                 "digests": {"kind": "XXH3", "salt": self.salt, "samples": CHUNK, "texts": digests},
                 "groups": [writer.description() for writer in self._groups.values()]}  # fmt: skip
        with self.writing():
            self._file[layout.ENTRY].attrs.update({"origin": origin, "groups": keys, "default": default})
            node = _collection(self._file, layout.CONDITIONS)
            for key, value in conditions.items():
                if isinstance(value, dict):
                    _collection(self._file, f"{layout.CONDITIONS}/{key}").attrs.update(value)
                else:
                    node.attrs[key] = value
            _collection(self._file, layout.PROVENANCE).attrs["json"] = json.dumps(provenance, ensure_ascii=False)
            for number, source in enumerate(provenance["sources"], 1):
                flat = {k: v for k, v in source.items() if isinstance(v, str | int | float)}
                _collection(self._file, f"{layout.PROVENANCE}/source_{number}").attrs.update(flat)
            _collection(self._file, layout.NOTES)
            if (start := earliest(writer.start_time for writer in self._groups.values())) is not None:
                node = self._file.create_dataset(layout.START_TIME, data=start.time)
                known_of_it = {"source": start.source, "uncertainty_s": start.uncertainty_s}
                node.attrs.update({key: value for key, value in known_of_it.items() if value is not None})
            _write_texts(self._file, layout.DESCRIPTION, [json.dumps(known, ensure_ascii=False)])
            for place, found in texts.items():
                _write_texts(self._file, place, found)

    def seal(self) -> None:
        """Close the file, wait until it is on the disk, and take its digest: all that takes long before the end."""
        if self._file is None:
            return
        assert self._journal is not None
        with self.writing():
            self._close()
            synced = self._pool.submit(sync, self.part)  # the disk writes while the digest is computed
            found = atomic_files.sha256_alone(self.part)
            synced.result()
            self._sha256 = found
            self._journal.seal(found)

    def _close(self) -> None:
        try:
            self.wait_until_synced()
        finally:
            if self._file is not None:
                self._file.close()
                self._file = None
            if self._out is not None:
                self._out.close()
        if self._out is not None:
            self._out.check()

    def commit(self) -> Path:
        """Move the run to its place, its digest first, never over another one; enter it into the ledger. Its path.

        Raises NotConfirmedError where it has its name, but disk or ledger fail: its journal stays for `recover`.
        """
        self.seal()
        with one_at_a_time(self.target.parent):
            with self.writing():
                place_with_digest(self.part, self.target, self._sha256)
            self._is_placed = True
            enter_run(self.target, self._sha256, self._details)
        self._is_placed = False
        return self.target

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError, RuntimeError, StoreError):
            self._close()
        self._pool.shutdown()
        try:
            self.part.unlink(missing_ok=True)
        except OSError:  # a folder that is a file; else the journal stays too, so that `recover` takes both away
            self._is_placed = self.part.exists()
        if self._journal is not None:
            self._journal.close()
            if not self._is_placed:
                with contextlib.suppress(OSError):  # it stays: `verify` names it, `recover` takes it away
                    self._journal.remove()
        if self._made_folder:
            with contextlib.suppress(OSError):  # the run is in it
                self.target.parent.rmdir()


def _reason(error: OSError | RuntimeError) -> str:
    """What the system says, out of what HDF5 makes of it."""
    known = [code for code in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS) if os.strerror(code) in str(error)]
    number = known[0] if known else getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)


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
