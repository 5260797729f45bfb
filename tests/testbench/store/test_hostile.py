"""Files that were made to deceive: nothing of another file is ever read, nothing endless is walked."""

import random

import h5py
import numpy as np
import pytest

from studies.store_faults import misread
from testbench.errors import StoreError
from testbench.recording import Channel, Finding, Group, TimeColumn
from testbench.store import layout, open_run
from testbench.store.archive import archive
from testbench.store.safe_hdf5 import open_for_reading

from .stored import ACC, store, store_groups

SECRET = 424242.0


@pytest.fixture
def run(tmp_path):
    """A stored run, beside it files with numbers that must not be read."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.full(4, SECRET)
    (tmp_path / "secret.bin").write_bytes(np.full(4, SECRET).tobytes())
    group = Group("log", (Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")), TimeColumn(0))
    return store(tmp_path, group, [np.arange(4.0), np.ones(4)]).path


def replaced(path, make):
    """Replace the channel of a run by something else."""
    with h5py.File(path, "r+") as file:
        node = file["entry/log"]
        attrs = dict(node["AccX"].attrs)
        del node["AccX"]
        make(node, path.parent)
        link = node.get("AccX", getlink=True)
        if isinstance(link, h5py.HardLink) and isinstance(node["AccX"], h5py.Dataset):
            node["AccX"].attrs.update({k: v for k, v in attrs.items() if k in ("long_name", "label", "units")})
    return path


def external_link(node, folder):
    """A link to a dataset in another file."""
    node["AccX"] = h5py.ExternalLink(str(folder / "secret.h5"), "/x")


def soft_link(node, folder):
    """A link to another name in this file."""
    node["AccX"] = h5py.SoftLink("/entry/log/time")


def dangling_link(node, folder):
    """A link to nothing."""
    node["AccX"] = h5py.SoftLink("/nothing")


def external_storage(node, folder):
    """A dataset whose bytes lie in another file."""
    node.create_dataset("AccX", (4,), "f8", external=[(str(folder / "secret.bin"), 0, 32)])


def virtual(node, folder):
    """A dataset made of another file's."""
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "secret.h5"), "x", shape=(4,))
    node.create_virtual_dataset("AccX", layout)


def never_written(node, folder):
    """A dataset of petabytes that was never written: it would read as zeros."""
    node.create_dataset("AccX", (10**14,), "f8", chunks=(1 << 20,))


def cycle(node, folder):
    """A group that holds itself in place of a channel."""
    node["AccX"] = node


def objects(node, folder):
    """Text in place of numbers."""
    node.create_dataset("AccX", data=np.array(["a", "b"], dtype=object), dtype=h5py.string_dtype())


@pytest.mark.parametrize("content", [b"", b"no HDF5 at all", b"\x89HDF\r\n\x1a\n" + b"\0" * 500])
def test_other_files_are_no_runs(tmp_path, content):
    """Anything that is no stored run is refused as such."""
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(StoreError, match="not a stored run, or damaged"):
        open_run(path)


def test_other_hdf5_is_no_run(tmp_path):
    """HDF5 of other people, a missing file and a folder: clear messages."""
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["a"] = 1.0
    with pytest.raises(StoreError, match="not a run stored by this version"):
        open_run(tmp_path / "x.h5")
    with pytest.raises(StoreError, match="no such file"):
        open_run(tmp_path / "y.h5")


def deflated_hole(node, folder):
    """A compressed dataset of which no chunk was written: it would read as zeros."""
    node.create_dataset("AccX", (4,), "f8", chunks=(2,), compression="gzip")


def half_a_hole(node, folder):
    """A compressed dataset of which one chunk was written."""
    node.create_dataset("AccX", (4,), "f8", chunks=(2,), compression="gzip")[:2] = 1.0


def foreign_filter(node, folder):
    """A filter that only some libraries have."""
    node.create_dataset("AccX", data=np.ones(4), chunks=(4,), compression="lzf")


def last_chunk_missing(node, folder):
    """One chunk of four was not written; with their checksums the others take more room than all the values."""
    node.create_dataset("AccX", (4,), "f8", chunks=(1,), fletcher32=True)[:3] = 1.0


def incompressible_but_the_last(node, folder):
    """The same where what was written does not get smaller."""
    dataset = node.create_dataset("AccX", (4,), "f8", chunks=(1,), compression="gzip", fletcher32=True)
    dataset[:3] = np.random.default_rng(1).normal(size=3)
    assert dataset.id.get_storage_size() > dataset.nbytes


ELSEWHERE = "is a link to elsewhere|lies in another file|does not hold one number a sample|not a stored run|expected 4"
NOT_THERE = "declares more values than the file holds|filter that is not a standard one"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        *(
            (make, ELSEWHERE)
            for make in (external_link, soft_link, dangling_link, external_storage, virtual, cycle, objects)
        ),
        *((make, NOT_THERE) for make in (never_written, deflated_hole, half_a_hole, last_chunk_missing)),
        *((make, NOT_THERE) for make in (incompressible_but_the_last, foreign_filter)),
    ],
)
def test_what_leads_elsewhere_or_is_not_there_is_refused(run, make, said):
    """One clear error, and no number of another file, whichever way it is asked for; an archive is no way round."""
    with pytest.raises(StoreError, match=said):
        open_run(replaced(run, make)).channel("AccX")


def test_long_texts_open_and_deflated_ones_do_not(tmp_path, monkeypatch):
    """Findings and descriptions of any length are read back; texts a thousand times as long as their file are not."""
    monkeypatch.setattr(layout, "LARGEST", 1000)
    findings = [Finding("clipping", f"channel {i}" * (1 + i % 9), None, "cut") for i in range(100)]
    provenance = {"sources": [], "comments": ["long " * 400]}
    run = store_groups(tmp_path, {ACC: [np.ones(4)]}, findings=findings, provenance=provenance)
    assert list(run.findings) == findings
    with h5py.File(run.path, "r+") as file:
        content = file[layout.FINDINGS][()]
        del file[layout.FINDINGS]
        file.create_dataset(layout.FINDINGS, data=content, compression="gzip")
    with pytest.raises(StoreError, match="does not hold texts as we store them"):
        open_run(run.path)


def test_more_than_the_memory_holds(run):
    """Deflated values may be a thousand times their file: one clear error."""
    with pytest.raises(StoreError, match=r"r001\.h5: does not fit into this machine's memory"), open_for_reading(run):
        raise MemoryError


@pytest.fixture
def archived(tmp_path):
    """An archive with a missing value and a zero with a minus sign."""
    group = Group("log", (Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")), TimeColumn(0))
    values = np.array([0.25, -0.0, np.nan, 1.5])
    return archive(store(tmp_path, group, [np.arange(4.0), values]), tmp_path / "a").file


OTHERS = {
    "another type": ("entry/log/AccX", np.zeros(4, "<f8")),
    "a smaller type": ("entry/log/AccX", np.zeros(4, "u1")),
    "another length": ("entry/log/AccX", np.zeros(3, "<u4")),
    "no signs": ("entry/notes/negative_zeros/log/AccX", None),
    "signs of another type": ("entry/notes/negative_zeros/log/AccX", np.zeros(1, "<u4")),
    "too few signs": ("entry/notes/negative_zeros/log/AccX", np.zeros(0, "u1")),
}


@pytest.mark.parametrize("other", OTHERS)
def test_an_archive_must_hold_what_its_description_declares(archived, other):
    """Numbers and signs of zeros: whatever else lies in their place is refused, no number is made up."""
    path, content = OTHERS[other]
    with h5py.File(archived, "r+") as file:
        del file[path]
        if content is not None:
            file[path] = content
    with pytest.raises(StoreError):
        open_run(archived).channel("AccX")


@pytest.mark.parametrize("stored", ["run", "archived"])
def test_flipped_bits_never_change_a_number(request, stored):
    """Any bits flipped, metadata included: an error, or the numbers as stored; never another number, never a hang."""
    path, chance = request.getfixturevalue(stored), random.Random(29)
    assert not any(misread(path, chance) for _ in range(30))


def test_a_run_that_lost_its_first_bytes(run):
    """Its digest tells that it was one: what to do is to verify, and not to ingest it."""
    run.write_bytes(b"x" + run.read_bytes()[1:])
    with pytest.raises(StoreError, match="damaged: no HDF5 file, but it has a digest file: testbench verify"):
        open_run(run)
