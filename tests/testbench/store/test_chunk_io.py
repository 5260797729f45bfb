"""Long channels are read past HDF5: the same bits, and the same refusal of whatever is not as it was written."""

import h5py
import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.recording import Channel, Group, UniformClock
from testbench.store import chunk_io, fletcher32, group_writer, open_run

from .test_writer import store

LENGTHS = [chunk_io.WORTH // 8, group_writer.GATHERED + 1, 3 * group_writer.GATHERED, 5 * group_writer.GATHERED - 7]
GROUP = Group("log", (Channel("AccX (g)", "g", "AccX"), Channel("AccY (g)", "g", "AccY")), UniformClock(5000.0))


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
def test_the_same_bits_as_hdf5_reads(tmp_path, samples):
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


@pytest.mark.parametrize("size", [4, 12, 4096, 8 * fletcher32.ROW, 8 * fletcher32.ROW + 4, 24 * fletcher32.ROW])
@pytest.mark.parametrize("fill", [None, 0, 255])
def test_the_checksum_is_that_of_hdf5(tmp_path, size, fill):
    """HDF5's own checksum of a chunk, four bytes behind it, of noise, nothing and everything."""
    content = (
        np.random.default_rng(size).integers(0, 256, size, np.uint8) if fill is None else np.full(size, fill, "u1")
    )
    with h5py.File(tmp_path / "x.h5", "w") as file:
        dataset = file.create_dataset("x", data=content, chunks=(size,), fletcher32=True)
        stored = np.frombuffer(dataset.id.read_direct_chunk((0,))[1], np.uint8)
    assert fletcher32.checksum(content) == int(stored[-4:].view("<u4")[0])
    assert fletcher32.is_intact(stored)


@pytest.mark.parametrize("place", [0, 12_345, -5, -4, -1])
@pytest.mark.parametrize("number", [0, 3, 4])
def test_a_flipped_bit_is_found(run, place, number):
    """In the samples, behind the last of them and in the checksum, as HDF5 finds it: one clear error."""
    at, size = chunk_of(run, number)
    content = bytearray(run.read_bytes())
    content[at + place % size] ^= 16
    run.write_bytes(content)
    with pytest.raises(StoreError, match="not a stored run, or damaged"):
        open_run(run).channel("AccY")
    assert len(open_run(run).channel("AccX")) == LENGTHS[1]


def test_content_of_another_chunk_is_found(run):
    """Halves of two chunks exchanged: every word is there, in the wrong place."""
    (first, size), (second, _) = chunk_of(run, 0), chunk_of(run, 1)
    content = bytearray(run.read_bytes())
    half = size // 2
    content[first : first + half], content[second : second + half] = (
        content[second : second + half],
        content[first : first + half],
    )
    run.write_bytes(content)
    with pytest.raises(StoreError, match="checksum of the samples from 0 on"):
        open_run(run).channel("AccY")


def rewritten(run, make):
    """Give AccY other chunks, as a hostile writer would."""
    with h5py.File(run, "r+") as file:
        node, scale = file["entry/log"], file["entry/log/time"]
        values = node["AccY"][()]
        del node["AccY"]
        dataset = node.create_dataset("AccY", values.shape, "f8", chunks=(group_writer.CHUNK,), fletcher32=True)
        make(dataset, values)
        dataset.dims[0].attach_scale(scale)
    return run


def without_checksum(dataset, values):
    """Chunks that say of themselves that the filter was left out: HDF5 would read them unchecked."""
    for begin in range(0, len(values), group_writer.CHUNK):
        chunk = np.resize(values[begin : begin + group_writer.CHUNK], group_writer.CHUNK)
        dataset.id.write_direct_chunk((begin,), chunk.tobytes(), filter_mask=1)


def with_a_hole(dataset, values):
    """One chunk was never written: HDF5 would read zeros."""
    dataset[: group_writer.CHUNK] = values[: group_writer.CHUNK]
    dataset[2 * group_writer.CHUNK :] = values[2 * group_writer.CHUNK :]


def of_another_size(dataset, values):
    """A chunk that is shorter than it declares."""
    dataset[...] = values
    dataset.id.write_direct_chunk((0,), values[:100].tobytes())


@pytest.mark.parametrize("make", [without_checksum, with_a_hole, of_another_size])
def test_other_chunks_are_refused(run, make):
    """What is not checked, not there or not whole gives an error and no number."""
    with pytest.raises(StoreError):
        open_run(rewritten(run, make)).channel("AccY")


def test_places_outside_the_file_are_refused(run, monkeypatch):
    """A chunk that an index puts behind the end of the file, or a file that is cut while it is read."""
    with h5py.File(run) as file:
        size = run.stat().st_size
        with pytest.raises(OSError, match="outside the file"):
            chunk_io._places(file["entry/log/AccY"], size // 4)
        monkeypatch.setattr(
            chunk_io, "_places", lambda dataset, _: [size - 100] * -(-len(dataset) // group_writer.CHUNK)
        )
        with pytest.raises(OSError, match="ends inside a chunk"):
            chunk_io.read_chunks(file["entry/log/AccY"])


def test_what_cannot_be_read_so_is_left_to_hdf5(tmp_path):
    """Short channels, other filters, other types."""
    kinds = {"short": {"fletcher32": True}, "plain": {}, "gzip": {"compression": "gzip"}}
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for name, options in kinds.items():
            data = np.zeros(10 if name == "short" else LENGTHS[1])
            assert not chunk_io.is_possible(file.create_dataset(name, data=data, **options))
        assert not chunk_io.is_possible(file.create_dataset("f4", data=data.astype("f4"), fletcher32=True))
