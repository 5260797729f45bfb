"""Chunks below HDF5: the bits and checksums that HDF5 would write, and the same refusal of what is not as written."""

import threading

import h5py
import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.recording import Channel, Group, UniformClock
from testbench.store import atomic_files, chunk_io, open_run, writer
from testbench.store.writer import RunWriter

from .test_writer import store

LENGTHS = [chunk_io.WORTH // 8, writer.GATHERED + 1, 3 * writer.GATHERED, 5 * writer.GATHERED - 7]
GROUP = Group("log", (Channel("AccX (g)", "g", "AccX"), Channel("AccY (g)", "g", "AccY")), UniformClock(5000.0))


@pytest.fixture(scope="module")
def loop():
    """The compiled checksum, kept for the next run of the tests."""
    found = chunk_io.KERNEL.loop()
    assert found is not None
    return found


@pytest.fixture
def ready(loop, monkeypatch):
    """The checksum of this process, its loop there from the beginning; gives the calls of it."""
    used = []
    monkeypatch.setattr(chunk_io, "CHECKSUM", chunk_io.CompiledChecksum())
    chunk_io.CHECKSUM._loop = lambda place, words: used.append(words) or loop(place, words)
    return used


@pytest.fixture
def run(tmp_path):
    """The path of a run that is long enough."""
    return store(tmp_path, GROUP, np.random.default_rng(4).normal(size=(2, LENGTHS[1])), block=50_000).path


def chunk_of(path, number):
    """Where a chunk of AccY lies in the file, and its size [bytes]."""
    with h5py.File(path) as file:
        info = file["entry/log/AccY"].id.get_chunk_info(number)
    return info.byte_offset, info.size


@pytest.mark.parametrize("samples", LENGTHS)
def test_the_same_bits_as_hdf5_reads(tmp_path, ready, samples):
    """Whole and begun chunks; the array is one's own, to write to."""
    columns = np.random.default_rng(samples).normal(size=(2, samples))
    columns[0][:3] = -0.0, np.nan, np.inf
    run = store(tmp_path, GROUP, columns, block=77_777)
    with h5py.File(run.path) as file:
        assert chunk_io.is_possible(file["entry/log/AccX"])
        assert chunk_io.read_chunks(file["entry/log/AccX"]).tobytes() == file["entry/log/AccX"][()].tobytes()
    values = run.channel("AccY")
    assert values.tobytes() == columns[1].tobytes()
    assert values.flags.writeable


@pytest.mark.parametrize("samples", [1, 63, 64, 65, 1024, 1 << 15, 100_001, chunk_io.LONGEST])
def test_the_checksum_is_that_of_hdf5(loop, samples):
    """Of random bits, of nothing, of the largest words, of a single bit: four bytes behind a chunk that HDF5 wrote."""
    for content in (
        np.random.default_rng(samples).integers(0, 1 << 63, samples, dtype=np.uint64),
        np.zeros(samples, np.uint64),
        np.full(samples, 2**64 - 1, np.uint64),
        np.append(np.zeros(samples - 1, np.uint64), np.uint64(1)),
    ):
        with h5py.File("x", "w", driver="core", backing_store=False) as file:
            dataset = file.create_dataset("x", data=content, chunks=(samples,), fletcher32=True)
            chunk = dataset.id.read_direct_chunk((0,))[1]
        assert loop(content.ctypes.data, 4 * samples) == int.from_bytes(chunk[-4:], "little")
        assert chunk_io.checked_samples(chunk).tobytes() == content.tobytes()
        with pytest.raises(OSError, match=r"[Ff]ilter"):
            chunk_io.checked_samples(bytes([chunk[0] ^ 1]) + chunk[1:])


@pytest.mark.parametrize("compiled", [True, False])
def test_a_flipped_bit_is_found(run, ready, monkeypatch, compiled):
    """In the samples, behind the last of them and in the checksum, with and without the loop: one clear error."""
    if not compiled:
        monkeypatch.setattr(chunk_io.CHECKSUM, "_loop", None)
    content = bytearray(run.read_bytes())
    for number in (0, 3, 4):
        at, size = chunk_of(run, number)
        for place in (0, 12_345, -5, -4, -1):
            content[at + place % size] ^= 16
            run.write_bytes(content)
            with pytest.raises(StoreError, match="not a stored run, or damaged"):
                open_run(run).channel("AccY")
            content[at + place % size] ^= 16
    assert len(open_run(run).channel("AccX")) == LENGTHS[1]


def rewritten(run, make):
    """Give AccY other chunks, as a hostile writer would."""
    with h5py.File(run, "r+") as file:
        node, scale = file["entry/log"], file["entry/log/time"]
        values = node["AccY"][()]
        del node["AccY"]
        dataset = node.create_dataset("AccY", values.shape, "f8", chunks=(writer.CHUNK,), fletcher32=True)
        make(dataset, values)
        dataset.dims[0].attach_scale(scale)
    return run


def without_checksum(dataset, values):
    """Chunks that say of themselves that the filter was left out: HDF5 would read them unchecked."""
    for begin in range(0, len(values), writer.CHUNK):
        chunk = np.resize(values[begin : begin + writer.CHUNK], writer.CHUNK)
        dataset.id.write_direct_chunk((begin,), chunk.tobytes(), filter_mask=1)


def with_a_hole(dataset, values):
    """One chunk was never written: HDF5 would read zeros."""
    dataset[: writer.CHUNK] = values[: writer.CHUNK]
    dataset[2 * writer.CHUNK :] = values[2 * writer.CHUNK :]


def of_another_size(dataset, values):
    """A chunk that is shorter than it declares."""
    dataset[...] = values
    dataset.id.write_direct_chunk((0,), values[:100].tobytes())


@pytest.mark.parametrize("make", [without_checksum, with_a_hole, of_another_size])
def test_other_chunks_are_refused(run, ready, make):
    """What is not checked, not there or not whole gives an error and no number."""
    with pytest.raises(StoreError):
        open_run(rewritten(run, make)).channel("AccY")


def test_places_outside_the_file_are_refused(run, ready, monkeypatch):
    """A chunk that an index puts behind the end of the file, or a file that is cut while it is read."""
    with h5py.File(run) as file:
        size = run.stat().st_size
        with pytest.raises(OSError, match="outside the file"):
            chunk_io._places(file["entry/log/AccY"], size // 4)
        monkeypatch.setattr(chunk_io, "_places", lambda dataset, _: [size - 100] * -(-len(dataset) // writer.CHUNK))
        with pytest.raises(OSError, match="ends inside a chunk"):
            chunk_io.read_chunks(file["entry/log/AccY"])


def test_what_cannot_be_read_so_is_left_to_hdf5(tmp_path, ready):
    """Short channels, other filters, other types."""
    kinds = {"short": {"fletcher32": True}, "plain": {}, "gzip": {"compression": "gzip"}}
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for name, options in kinds.items():
            data = np.zeros(10 if name == "short" else LENGTHS[1])
            assert not chunk_io.is_possible(file.create_dataset(name, data=data, **options))
        assert not chunk_io.is_possible(file.create_dataset("f4", data=data.astype("f4"), fletcher32=True))


def dataset(file, length=1024, **options):
    """An empty channel."""
    options = {"dtype": "<f8", "fletcher32": True, **options}
    return file.create_dataset("x", shape=(0,), maxshape=(None,), chunks=(length,), **options)


@pytest.mark.parametrize("length", [256, 1024, 1 << 15])
@pytest.mark.parametrize("sizes", [[4096], [1, 4095], [1000] * 5, [4096, 7, 7]])
def test_chunks_are_those_of_hdf5(tmp_path, ready, length, sizes):
    """The bits of every chunk and its checksum as the library writes them; the rest is given back."""
    rng = np.random.default_rng(len(sizes) + length)
    times = max(1, length // 4096)
    waiting = [rng.normal(size=n * times) for n in sizes]
    values, count = np.concatenate(waiting), 4096 * times
    with h5py.File(tmp_path / "ours.h5", "w") as ours, h5py.File(tmp_path / "theirs.h5", "w") as theirs:
        mine, other = dataset(ours, length), dataset(theirs, length)
        assert chunk_io.are_possible(mine)
        for d in (mine, other):
            d.resize((count,))
        rest = chunk_io.Room(length).write(mine, 0, waiting, count)
        other[:] = values[:count]
        theirs.flush()
        assert np.concatenate([np.empty(0), *rest]).tobytes() == values[count:].tobytes()
        for begin in range(0, count, length):
            assert mine.id.read_direct_chunk((begin,)) == other.id.read_direct_chunk((begin,))
    with h5py.File(tmp_path / "ours.h5") as file:
        assert file["x"][()].tobytes() == values[:count].tobytes()


@pytest.mark.parametrize(
    "options",
    [
        {"length": chunk_io.LONGEST + 1},
        {"dtype": "<f4"},
        {"dtype": ">f8"},
        {"fletcher32": False},
        {"compression": "gzip"},
    ],
)
def test_anything_else_is_left_to_hdf5(tmp_path, options):
    """Other types, other filters."""
    with h5py.File(tmp_path / "x.h5", "w") as file:
        assert not chunk_io.are_possible(dataset(file, **options))


def test_runs_are_the_same_with_it_and_hdf5_checks_them(loop, tmp_path, monkeypatch):
    """A run whose checksums are compiled from its second block on: the same chunks, which HDF5 takes as whole."""
    values = np.random.default_rng(3).normal(size=5 * (1 << 17) + 77)
    group = Group("log", (Channel("a", "V"), Channel("b", "V")))
    provenance = {"sources": [{"name": "log.csv", "sha256": "0" * 64, "size_bytes": 1}]}
    used = []
    for name, ready in (("without", None), ("with", lambda *given: used.append(given) or loop(*given))):
        monkeypatch.setattr(chunk_io, "CHECKSUM", chunk_io.CompiledChecksum())
        with RunWriter(tmp_path, name) as storing:
            for part in np.array_split(values, 5):
                storing.group(group).append([part, -part])
                chunk_io.CHECKSUM._loop = ready
            storing.group(group).finish(None, None)
            storing.describe("simulated", {}, [], provenance, None)
            run = open_run(storing.commit())
        assert run.channel("a").tobytes() == values.tobytes()
        with h5py.File(run.path) as file:  # HDF5 checks each chunk
            assert file["entry/log/b"][()].tobytes() == (-values).tobytes()
    assert len(used) > 10


def test_the_journal_says_where_chunks_lie(tmp_path):
    """Places seen below HDF5 are those that HDF5 knows."""
    group = Group("log", (Channel("a"), Channel("b")))
    with RunWriter(tmp_path, "r") as storing:
        storing.group(group).append([np.arange(300_000.0), np.ones(300_000)])
        noted = atomic_files.read_journal(next(atomic_files.journals_in(tmp_path))).groups[0].pieces
        for dataset, pieces in zip(storing.group(group)._datasets, noted, strict=True):
            known = [dataset.id.get_chunk_info(i) for i in range(len(pieces))]
            assert [(p.at, p.size) for p in pieces] == [(k.byte_offset, k.size) for k in known]
            assert len(pieces) == 300_000 // 32768


def test_it_is_asked_for_only_where_much_is_done(monkeypatch):
    """A short run starts no compiler, and nobody waits for it."""
    asked = []
    monkeypatch.setattr(chunk_io.Kernel, "loop", lambda self: asked.append(self) or (lambda *given: 7))
    checksum = chunk_io.CompiledChecksum()
    assert not checksum.is_ready(chunk_io.MUCH_BYTES)
    assert not asked
    checksum.is_ready(8)
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and thread.daemon:
            thread.join(10)
    assert checksum.is_ready(8)
    assert checksum.of_samples(np.zeros(1)) == 7
    assert asked == [chunk_io.KERNEL]
