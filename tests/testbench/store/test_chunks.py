"""Whole chunks written past HDF5's filter: what HDF5 would have written, to the byte."""

import h5py
import numpy as np
import pytest

from testbench.store import chunk_io


def dataset(file, length=1024, **options):
    """An empty channel."""
    options = {"dtype": "<f8", "fletcher32": True, **options}
    return file.create_dataset("x", shape=(0,), maxshape=(None,), chunks=(length,), **options)


@pytest.mark.parametrize("length", [256, 1024, 1 << 15])
@pytest.mark.parametrize("sizes", [[4096], [1, 4095], [1000] * 5, [5000, 3], [4096, 7, 7]])
def test_chunks_are_those_of_hdf5(tmp_path, length, sizes):
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


def test_a_flipped_bit_is_noticed(tmp_path):
    """The checksum is one that HDF5 checks."""
    with h5py.File(tmp_path / "x.h5", "w") as file:
        channel = dataset(file)
        channel.resize((1024,))
        chunk_io.Room(1024).write(channel, 0, [np.arange(1024.0)], 1024)
        place = channel.id.get_chunk_info(0).byte_offset
    content = bytearray((tmp_path / "x.h5").read_bytes())
    content[place + 100] ^= 1
    (tmp_path / "x.h5").write_bytes(content)
    with h5py.File(tmp_path / "x.h5") as file, pytest.raises(OSError, match=r"[Ff]ilter|checksum"):
        file["x"][()]


@pytest.mark.parametrize(
    "options", [{"dtype": "<f4"}, {"dtype": ">f8"}, {"fletcher32": False}, {"compression": "gzip"}, {"length": 1000}]
)
def test_anything_else_is_left_to_hdf5(tmp_path, options):
    """Other types, other filters, chunks of other lengths."""
    with h5py.File(tmp_path / "x.h5", "w") as file:
        assert not chunk_io.are_possible(dataset(file, **options))
