"""The compiled checksum: that of HDF5, only where much is written, and never waited for."""

import threading

import h5py
import numpy as np
import pytest

from testbench.recording import Channel, Group
from testbench.store import chunk_io, fletcher32, journal, open_run
from testbench.store.writer import RunWriter


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """The loop, compiled into a folder of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        found = fletcher32.CHECKSUM.loop()
        assert found is not None
        yield found


@pytest.mark.parametrize("samples", [1, 63, 64, 65, 1024, 1 << 15, 100_001])
@pytest.mark.parametrize("kind", ["random", "zeros", "ones", "last bit"])
def test_it_is_the_checksum(loop, samples, kind):
    """Of random bits, of nothing, of the largest words, of a single bit: as computed the other way."""
    content = {
        "random": np.random.default_rng(samples).integers(0, 1 << 63, samples, dtype=np.uint64),
        "zeros": np.zeros(samples, np.uint64),
        "ones": np.full(samples, 2**64 - 1, np.uint64),
        "last bit": np.append(np.zeros(samples - 1, np.uint64), np.uint64(1)),
    }[kind]
    assert loop(content.ctypes.data, 4 * samples) == fletcher32.checksum(content.view(np.uint8))


def test_runs_are_the_same_with_it_and_hdf5_checks_them(loop, tmp_path, monkeypatch):
    """A run whose checksums are compiled from its second block on: the same chunks, which HDF5 takes as whole."""
    values = np.random.default_rng(3).normal(size=5 * (1 << 17) + 77)
    group = Group("log", (Channel("a", "V"), Channel("b", "V")))
    provenance = {"sources": [{"name": "log.csv", "sha256": "0" * 64, "size_bytes": 1}]}
    used = []
    for name, ready in (("without", None), ("with", lambda *given: used.append(given) or loop(*given))):
        monkeypatch.setattr(chunk_io, "SWIFT", fletcher32.CompiledChecksum())
        with RunWriter(tmp_path, name) as writer:
            for part in np.array_split(values, 5):
                writer.group(group).append([part, -part])
                chunk_io.SWIFT._loop = ready
            writer.group(group).finish(None, None)
            writer.describe("simulated", {}, [], provenance, None)
            run = open_run(writer.commit())
        assert run.channel("a").tobytes() == values.tobytes()
        with h5py.File(run.path) as file:  # HDF5 checks each chunk
            assert file["entry/log/b"][()].tobytes() == (-values).tobytes()
    assert len(used) > 10


def test_the_journal_says_where_chunks_lie(tmp_path):
    """Places seen below HDF5 are those that HDF5 knows."""
    group = Group("log", (Channel("a"), Channel("b")))
    with RunWriter(tmp_path, "r") as writer:
        writer.group(group).append([np.arange(300_000.0), np.ones(300_000)])
        noted = journal.read_journal(next(journal.journals_in(tmp_path))).groups[0].pieces
        for dataset, pieces in zip(writer.group(group)._datasets, noted, strict=True):
            known = [dataset.id.get_chunk_info(i) for i in range(len(pieces))]
            assert [(p.at, p.size) for p in pieces] == [(k.byte_offset, k.size) for k in known]
            assert len(pieces) == 300_000 // 32768


def test_long_channels_are_read_with_it(loop, tmp_path, monkeypatch):
    """The same bits as were written, each chunk checked by it; a flipped bit is found."""
    values, used = np.random.default_rng(4).normal(size=5 * (1 << 15) + 9), []
    ready = fletcher32.CompiledChecksum()
    ready._loop = lambda *given: used.append(given[1]) or loop(*given)
    monkeypatch.setattr(chunk_io, "SWIFT", ready)
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=values, chunks=(1 << 15,), fletcher32=True)
    with h5py.File(path) as file:
        assert chunk_io.is_possible(file["x"])
        assert chunk_io.read_chunks(file["x"]).tobytes() == values.tobytes()
        at = file["x"].id.get_chunk_info(3).byte_offset
    assert used == 6 * [4 << 15]
    with path.open("r+b") as stream:
        stream.seek(at + 1234)
        byte = stream.read(1)[0]
        stream.seek(at + 1234)
        stream.write(bytes([byte ^ 16]))
    with h5py.File(path) as file, pytest.raises(OSError, match="from 98304 on does not match"):
        chunk_io.read_chunks(file["x"])


def test_it_is_asked_for_only_where_much_is_done(monkeypatch):
    """A short run starts no compiler."""
    asked = []
    monkeypatch.setattr(fletcher32.Kernel, "loop", lambda self: asked.append(self) or (lambda *given: 7))
    ready, quadruples = fletcher32.CompiledChecksum(), fletcher32.MUCH_BYTES // 8
    assert isinstance(ready.sums(1, quadruples), fletcher32.Sums)
    assert not asked
    ready.sums(1, 1)
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and thread.daemon:
            thread.join(10)
    sums = ready.sums(2, 1)
    for row in range(2):
        sums.add(row, np.zeros(1, np.uint64))
    assert sums.checksums().tolist() == [7, 7]
    assert asked == [fletcher32.CHECKSUM]
