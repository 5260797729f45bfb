"""Chunks below HDF5: the bits and checksums that HDF5 would write, and the same refusal of what is not as written."""

import json

import h5py
import numpy as np
import pytest

from balance.compiled_kernels import can_compile
from testbench.errors import StoreError
from testbench.recording import Channel, Finding, Group, UniformClock
from testbench.store import atomic_files, chunk_io, layout, open_campaign, open_run, writer
from testbench.store.archive import archive
from testbench.store.writer import RunWriter

from .stored import store, store_groups

LENGTHS = [chunk_io.WORTH // 8, writer.GATHERED + 1, 3 * writer.GATHERED, 5 * writer.GATHERED - 7]
GROUP = Group("log", (Channel("AccX (g)", "g", "AccX"), Channel("AccY (g)", "g", "AccY")), UniformClock(5000.0))


@pytest.fixture
def run(tmp_path):
    """The path of a run that is long enough."""
    return store(tmp_path, GROUP, np.random.default_rng(4).normal(size=(2, LENGTHS[1])), block=50_000).path


def chunk_of(path, number, channel="AccY"):
    """Where a chunk of a channel lies in the file, and its size [bytes]."""
    with h5py.File(path) as file:
        info = file[f"entry/log/{channel}"].id.get_chunk_info(number)
    return info.byte_offset, info.size


@pytest.mark.parametrize("samples", LENGTHS)
def test_the_same_bits_as_hdf5_reads(tmp_path, samples):
    """Whole and begun chunks; the array is one's own, to write to; of a part, no more than is asked for."""
    columns = np.random.default_rng(samples).normal(size=(2, samples))
    columns[0][:3] = -0.0, np.nan, np.inf
    run = store(tmp_path, GROUP, columns, block=77_777)
    with h5py.File(run.path) as file:
        assert chunk_io.is_possible(file["entry/log/AccX"].id, writer.CHUNK)
        read = chunk_io.read_chunks(file["entry/log/AccX"].id, writer.CHUNK, lambda first, values: None)
        assert read.tobytes() == file["entry/log/AccX"][()].tobytes()
        part = run.group().samples_of(file, 1, 33_000, 70_000)
        assert part.tobytes() == columns[1][33_000:70_000].tobytes()
    values = run.channel("AccY")
    assert values.tobytes() == columns[1].tobytes()
    assert values.flags.writeable


@pytest.mark.parametrize("samples", [1, 63, 64, 65, 1024, 1 << 15, 1 << 16, 100_001])
def test_the_checksum_is_that_of_hdf5(samples):
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
        chunk_io.compiled_sums().thread.join()
        assert can_compile() == (chunk_io.compiled_sums().loop is not None)
        for loop in (None, chunk_io.compiled_sums().loop):
            assert chunk_io.fletcher32(content.view("<f8"), loop) == int.from_bytes(chunk[-4:], "little")
        assert chunk_io.checked_samples(chunk).tobytes() == content.tobytes()
        with pytest.raises(ValueError, match="checksum"):
            chunk_io.checked_samples(bytes([chunk[0] ^ 1]) + chunk[1:])


def test_a_flipped_bit_is_found(run):
    """In the samples, read past HDF5: one clear error that says which."""
    content = bytearray(run.read_bytes())
    for number in (0, 1):
        at, _ = chunk_of(run, number)
        for place in (0, 12_345, 8 * writer.CHUNK - 1):
            content[at + place] ^= 16
            run.write_bytes(content)
            first = number * writer.CHUNK
            with pytest.raises(StoreError, match=rf"'AccY \(g\)', samples {first} to .* not those that were written"):
                open_run(run).channel("AccY")
            content[at + place] ^= 16
    assert len(open_run(run).channel("AccX")) == LENGTHS[1]


def hole(content, path):
    """Zeros, the checksum included, which of zeros is zero."""
    at, size = chunk_of(path, 1)
    content[at : at + size] = bytes(size)


def repeated(content, path):
    """The chunk before once more, with its checksum."""
    (source, size), (at, _) = chunk_of(path, 0), chunk_of(path, 1)
    content[at : at + size] = content[source : source + size]


def of_another_channel(content, path):
    """The chunk of the same samples of the other channel."""
    (source, size), (at, _) = chunk_of(path, 1, "AccX"), chunk_of(path, 1)
    content[at : at + size] = content[source : source + size]


def of_another_run(content, path):
    """The chunk at the same place of a run of the same channels."""
    other = store(path.parent / "other", GROUP, np.random.default_rng(5).normal(size=(2, LENGTHS[1]))).path
    (source, size), (at, _) = chunk_of(other, 1), chunk_of(path, 1)
    content[at : at + size] = other.read_bytes()[source : source + size]


@pytest.mark.parametrize(
    ("put", "named"),
    [
        (hole, "a hole, read as zeros"),
        (repeated, "swapped or repeated: there lie those of this channel from sample 0 on"),
        (
            of_another_channel,
            f"swapped or repeated: there lie those of channel 1 of the group from sample {writer.CHUNK} ",
        ),
        (of_another_run, "not those that were written"),
    ],
)
def test_a_whole_chunk_in_the_place_of_another_is_found(run, put, named):
    """Chunks whose checksum is right, h5py reads them: refused by name on reading, and named by verify."""
    content = bytearray(run.read_bytes())
    put(content, run)
    run.write_bytes(content)
    with h5py.File(run) as file:
        assert len(file["entry/log/AccY"][()]) == LENGTHS[1]  # HDF5 sees nothing
    with pytest.raises(StoreError, match=named):
        open_run(run).channel("AccY")
    state = open_campaign(run.parent).verify()[0]
    assert state.status == "damaged"
    assert named in state.message


@pytest.mark.parametrize("path", [layout.RIG, layout.FINDINGS, layout.DESCRIPTION])
def test_a_hole_in_the_texts_is_found(tmp_path, path):
    """An empty rig would be one that states nothing."""
    findings = [Finding("clipping", "AccX", None, "x")]
    stored = store_groups(tmp_path, {GROUP: [np.ones(3), np.ones(3)]}, findings=findings, rig="a = 1\n").path
    with h5py.File(stored) as file:
        info = file[path].id.get_chunk_info(0)
    content = bytearray(stored.read_bytes())
    content[info.byte_offset : info.byte_offset + info.size] = bytes(info.size)
    stored.write_bytes(content)
    with pytest.raises(StoreError):
        open_run(stored)


def test_a_hole_in_an_archive_is_found(run, tmp_path):
    """Chunks of an archive are digested as the values that they give."""
    stored = archive(open_run(run), tmp_path / "a").file
    assert open_run(stored).channel("AccY").tobytes() == open_run(run).channel("AccY").tobytes()
    with h5py.File(stored, "r+") as file:
        chunk = file["entry/log/AccY"].id.read_direct_chunk((0,))
        file["entry/log/AccY"].id.write_direct_chunk((writer.CHUNK,), chunk[1], chunk[0])
    with pytest.raises(StoreError, match="swapped or repeated"):
        open_run(stored).channel("AccY")


def test_a_run_without_digests_is_read_and_says_so(run):
    """Stored before there were any: the same values, by HDF5's own checks; verify says what is not proven."""
    expected = open_run(run).channel("AccY")
    with h5py.File(run, "r+") as file:
        known = json.loads(file[layout.DESCRIPTION][0])
        del known["digests"], file[layout.DESCRIPTION]
        writer._write_texts(file, layout.DESCRIPTION, [json.dumps(known)])
    digest = atomic_files.sha256_of(run)
    atomic_files.digest_file(run).write_text(atomic_files.line_for(run.name, digest))
    assert open_run(run).channel("AccY").tobytes() == expected.tobytes()
    (run.parent / "ledger.jsonl").unlink()
    state, ledger = open_campaign(run.parent).verify()
    assert (state.status, ledger.status) == ("intact", "absent")
    assert "stored before samples had digests" in state.message


def test_a_disk_that_fails_is_no_damage(run, monkeypatch):
    """The system's own words; and verify calls the run neither old nor damaged."""

    def failing(*_):
        raise KeyError("file read failed: errno = 5, error message = 'Input/output error', buf = 0x5")

    with monkeypatch.context() as patch:
        patch.setattr(h5py, "File", failing)
        with pytest.raises(StoreError, match=r"^\S+\.h5: cannot be read \(Input/output error\)$"):
            open_run(run)
        state = open_campaign(run.parent).verify()[0]
    assert state.status == "intact"
    assert state.message.endswith("it cannot be opened: " + f"{run.name}: cannot be read (Input/output error)")


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
def test_other_chunks_are_refused(run, make):
    """What is not checked, not there or not whole gives an error and no number."""
    with pytest.raises(StoreError):
        open_run(rewritten(run, make)).channel("AccY")


def test_places_outside_the_file_are_refused(run, monkeypatch):
    """A chunk that an index puts behind the end of the file, or a file that is cut while it is read."""
    with h5py.File(run) as file:
        size = run.stat().st_size
        with pytest.raises(OSError, match="outside the file"):
            chunk_io._places(file["entry/log/AccY"].id, writer.CHUNK, size // 4)
        monkeypatch.setattr(
            chunk_io, "_places", lambda dataset, length, _: [size - 100] * -(-dataset.shape[0] // length)
        )
        with pytest.raises(OSError, match="ends inside a chunk"):
            chunk_io.read_chunks(file["entry/log/AccY"].id, writer.CHUNK, lambda first, values: None)


def test_what_cannot_be_read_so_is_left_to_hdf5(tmp_path):
    """Short channels, other filters, other types."""
    kinds = {"short": {"fletcher32": True}, "plain": {}, "gzip": {"compression": "gzip"}}
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for name, options in kinds.items():
            options |= {"chunks": (1000,)} if name != "short" else {}
            data = np.zeros(10 if name == "short" else LENGTHS[1])
            assert not chunk_io.is_possible(file.create_dataset(name, data=data, **options).id, 1000)
        f4 = file.create_dataset("f4", data=data.astype("f4"), fletcher32=True, chunks=(1000,))
        assert not chunk_io.is_possible(f4.id, 1000)
        other = file.create_dataset("other", data=data, fletcher32=True, chunks=(999,))
        assert not chunk_io.is_possible(other.id, 1000)


@pytest.mark.parametrize("length", [256, 1024, 1 << 15])
def test_chunks_are_those_of_hdf5(tmp_path, length):
    """The bits of every chunk and its checksum as the library writes them, the last one filled up with zeros."""
    values = np.random.default_rng(length).normal(size=3 * length + 7)
    with h5py.File(tmp_path / "ours.h5", "w") as ours, h5py.File(tmp_path / "theirs.h5", "w") as theirs:
        mine, other = (
            file.create_dataset("x", values.shape, "<f8", chunks=(length,), fletcher32=True) for file in (ours, theirs)
        )
        chunk = chunk_io.Chunk(length)
        for begin in range(0, len(values), length):
            block = values[begin : begin + length]
            assert chunk.fill([block[:100], block[100:]]).tobytes() == block.tobytes()
            assert chunk.write(mine, begin) == 8 * length + 4
        other[:] = values
        theirs.flush()
        for begin in range(0, len(values), length):
            assert mine.id.read_direct_chunk((begin,)) == other.id.read_direct_chunk((begin,))
    with h5py.File(tmp_path / "ours.h5") as file:
        assert file["x"][()].tobytes() == values.tobytes()


def test_the_journal_says_where_chunks_lie(tmp_path):
    """Places seen below HDF5 are those that HDF5 knows."""
    group = Group("log", (Channel("a"), Channel("b")))
    with RunWriter(tmp_path, "r") as storing:
        storing.group(group).append([np.arange(300_000.0), np.ones(300_000)])
        noted = atomic_files.read_journal(atomic_files.leftovers(tmp_path)[0].journal).groups[0].pieces
        for dataset, pieces in zip(storing.group(group)._datasets, noted, strict=True):
            known = [dataset.id.get_chunk_info(i) for i in range(len(pieces))]
            assert [(p.at, p.size) for p in pieces] == [(k.byte_offset, k.size) for k in known]
            assert len(pieces) == 300_000 // writer.CHUNK
