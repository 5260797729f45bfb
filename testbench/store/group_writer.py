"""Writing one group: a dataset a channel, in whole chunks, with its checksum, unit, written name and clock.

Dimension scales: which dataset is the axis of which others, as HDF5 and netCDF tools look it up.

The file below HDF5 while a run is written.

HDF5 crashes the process when it cannot write out what it holds, as on a full disk. Here a write that fails is kept as
``error`` and those after it are dropped, so that HDF5 closes in good order and the caller raises.
"""

import io
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..recording import Channel, Group, Samples, TimeColumn, UniformClock
from . import chunk_io, metadata
from .encodings import COMPRESSED, PLAIN, Decimals, Form, minus_bits
from .journal import Piece

if TYPE_CHECKING:
    import h5py


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


class OutFile(io.RawIOBase):
    """A new file that HDF5 writes through, whose first error is kept."""

    def __init__(self, path: Path) -> None:
        self._stream = path.open("x+b", buffering=0)
        self._at = 0
        self.error: OSError | None = None
        self.last = (0, 0)
        """Place and size of what was written last [bytes]."""

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.error is not None:
            raise self.error

    def write(self, content: Any) -> int:  # noqa: ANN401
        """Write all of ``content``, or keep the reason why not."""
        view = memoryview(content).cast("B")
        done = 0
        try:
            while self.error is None and done < len(view):
                done += self._stream.write(view[done:])
        except OSError as error:
            self.error = error
        self.last = (self._at, len(view))
        self._at += len(view)
        return len(view)

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401
        """Read into ``buffer``; zeros where a write was dropped."""
        view = memoryview(buffer).cast("B")
        done = 0
        while done < len(view) and (count := self._stream.readinto(view[done:])):
            done += count
        view[done:] = bytes(len(view) - done)
        self._at = self._stream.tell()
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a place in the file."""
        self._at = self._stream.seek(offset, whence)
        return self._at

    def tell(self) -> int:
        """The place in the file."""
        return self._stream.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the file's size, or keep the reason why not."""
        try:
            return self._stream.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._stream.close()
        super().close()


CHUNK = 1 << 15
"""Samples a chunk."""
GATHERED = 4 * CHUNK
"""Samples that are gathered before whole chunks are written."""
Acknowledge = Callable[[Sequence[Sequence[Piece]]], None]
Writing = AbstractContextManager[None]
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable. %10d"
_SLOTS = 7
"""Places in HDF5's cache of chunks: chunks come one after the other; HDF5's own 8191 take 64 KB a channel."""


class GroupWriter:
    """The samples of one group, gathered to whole chunks and written.

    ``acknowledge`` is told where the chunks of each channel lie, once they do; ``writing`` puts failures in words;
    ``out`` is the file below HDF5. ``forms`` says how the samples of each channel are stored; without it as they are.
    """

    def __init__(
        self,
        node: "h5py.Group",
        group: Group,
        acknowledge: Acknowledge,
        writing: Callable[[], Writing],
        out: OutFile,
        forms: Sequence[Form] | None = None,
    ) -> None:
        self.node, self.group, self.samples = node, group, 0
        self.forms = [PLAIN] * len(group.channels) if forms is None else list(forms)
        self._form_of_time = PLAIN if forms is None else COMPRESSED
        self._minus: list[list[NDArray[np.uint8]]] = [[] for _ in group.channels]
        self._acknowledge, self._writing, self._out = acknowledge, writing, out
        self.rate_hz: float | None = None
        self.rate_source: str | None = None
        self.has_plot = False
        self.key = node.name.rpartition("/")[2]
        taken = {metadata.TIME, metadata.SAMPLE}
        self.keys = [
            metadata.TIME if _is_time(group, i) else metadata.safe_name(channel.label, taken)
            for i, channel in enumerate(group.channels)
        ]
        self._waiting: list[list[Samples]] = [[] for _ in group.channels]
        self._datasets: list[h5py.Dataset] = []
        self._written = 0
        self._chunk = CHUNK
        self._whole: list[bool] = []
        self._room = chunk_io.Room(CHUNK)

    def append(self, columns: Sequence[Samples]) -> None:
        """Take in the next samples, one column a channel."""
        for waiting, column in zip(self._waiting, columns, strict=True):
            waiting.append(column)
        self.samples += len(columns[0])
        if self.samples - self._written >= GATHERED:
            with self._writing():
                self._write((self.samples - self._written) // CHUNK * CHUNK)

    def _write(self, count: int) -> None:
        """Write ``count`` of the waiting samples of each channel."""
        if not self._datasets:
            self._chunk = CHUNK if count >= CHUNK else max(1, count)
            self._datasets = [
                _dataset(self.node, k, self._chunk, f) for k, f in zip(self.keys, self.forms, strict=True)
            ]
            self._whole = [chunk_io.are_possible(dataset) for dataset in self._datasets]
            self._room = chunk_io.Room(self._chunk)
        pieces: list[Sequence[Piece]] = []
        for i, (dataset, form, waiting) in enumerate(zip(self._datasets, self.forms, self._waiting, strict=True)):
            dataset.resize((self._written + count,))
            if self._whole[i] and count and count % self._chunk == 0:
                pieces.append(self._write_whole(dataset, waiting, count))
                continue
            samples = waiting[0] if len(waiting) == 1 else np.concatenate([np.empty(0), *waiting])
            dataset[self._written : self._written + count] = form.stored(samples[:count])
            if isinstance(form, Decimals) and form.negative_zeros:
                self._minus[i].append(minus_bits(samples[:count]))
            waiting[:] = [samples[count:]]
            dataset.flush()
            pieces.append(_pieces(dataset, self._written))
        self._out.check()
        self._acknowledge(pieces)
        self._written += count

    def _write_whole(self, dataset: "h5py.Dataset", waiting: list[Samples], count: int) -> Sequence[Piece]:
        """Write whole chunks past HDF5's filter; where they went is seen below HDF5, which would look through all."""
        places: list[tuple[int, int]] = []
        waiting[:] = self._room.write(dataset, self._written, waiting, count, lambda: places.append(self._out.last))
        if {size for _, size in places} != {self._room.size}:
            return _pieces(dataset, self._written)
        return [Piece(at, size, self._chunk) for at, size in places]

    def finish(self, rate_hz: float | None, rate_source: str | None) -> None:
        """Write what waits, then names, units and clock."""
        with self._writing():
            self._finish(rate_hz, rate_source)

    def _finish(self, rate_hz: float | None, rate_source: str | None) -> None:
        self._write(self.samples - self._written)
        self.rate_hz, self.rate_source = rate_hz, rate_source
        clock = self.group.clock
        self.node.attrs.update({"NX_class": "NXdata", "name": self.group.name, "samples": self.samples})
        self.node.attrs["channels"] = self.keys
        if rate_hz is not None:
            self.node.attrs.update({"rate_hz": rate_hz, "rate_source": rate_source})
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
        self._write_minus()
        self._attach(self._dimension(clock))

    def _write_minus(self) -> None:
        """Write what whole numbers do not hold; each dataset is its own dimension, for netCDF readers."""
        for key, bits in zip(self.keys, self._minus, strict=True):
            if bits:
                node = self.node.file
                for name in (*metadata.MINUS.split("/"), self.key):
                    node = node.require_group(name)
                    node.attrs.setdefault("NX_class", "NXcollection")
                content = np.concatenate(bits)
                node.create_dataset(key, data=content, fletcher32=True, **COMPRESSED.options).make_scale(key)

    def _dimension(self, clock: UniformClock | TimeColumn | None) -> "h5py.Dataset":
        """The scale of the samples: recorded time, time by index and rate, or a length without values."""
        if isinstance(clock, TimeColumn):
            return self._datasets[clock.index]
        if isinstance(clock, UniformClock):
            chunk = CHUNK if self.samples >= CHUNK else max(1, self.samples)
            time = _dataset(self.node, metadata.TIME, chunk, self._form_of_time)
            time.resize((self.samples,))
            for begin in range(0, self.samples, GATHERED):
                end = min(begin + GATHERED, self.samples)
                time[begin:end] = clock.times(begin, end)
            _name(time, Channel(f"{metadata.TIME} (s)", "s", metadata.TIME))
            return time
        scale = self.node.create_dataset(metadata.SAMPLE, shape=(self.samples,), dtype=">f4")
        scale.make_scale(_NO_VARIABLE % self.samples)
        return scale

    def _attach(self, scale: "h5py.Dataset") -> None:
        """Make ``scale`` the dimension of all channels, and say to NeXus what to plot."""
        if scale.name.endswith(metadata.TIME):
            scale.make_scale(metadata.TIME)
        others = [(key, d) for key, d in zip(self.keys, self._datasets, strict=True) if d.name != scale.name]
        attach_dimensions([dataset for _, dataset in others], scale)
        shown = [key for key, form in zip(self.keys, self.forms, strict=True) if not isinstance(form, Decimals)]
        signals = [key for key, _ in others if key in shown]
        self.has_plot = bool(signals)
        if signals or not others:  # NeXus viewers apply no scale: of whole numbers they would plot other values
            self.node.attrs["signal"] = signals[0] if signals else metadata.TIME
            self.node.attrs["axes"] = [metadata.TIME if scale.name.endswith(metadata.TIME) and others else "."]


def _is_time(group: Group, index: int) -> bool:
    return isinstance(group.clock, TimeColumn) and group.clock.index == index


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


def _pieces(dataset: "h5py.Dataset", start: int) -> list[Piece]:
    """The chunks from sample ``start`` to the end."""
    pieces = []
    total, length = len(dataset), dataset.chunks[0]
    for begin in range(start, total, length):
        info = dataset.id.get_chunk_info_by_coord((begin,))
        pieces.append(Piece(info.byte_offset, info.size, min(length, total - begin)))
    return pieces


def _name(dataset: "h5py.Dataset", channel: Channel) -> None:
    dataset.attrs.update({"long_name": channel.name, "label": channel.label})
    if channel.unit is not None:
        dataset.attrs["units"] = channel.unit
