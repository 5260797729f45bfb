"""Runs of very many channels: their dimension scale, against HDF5's own, their size and memory."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from testbench.recording import Channel, Group
from testbench.store.writer import attach_dimensions

from .stored import store


def made(path, how):
    """Five datasets and their scale, attached in one of two ways; what HDF5 tells of them."""
    with h5py.File(path, "w", libver=("v108", "v110")) as file:
        scale = file.create_dataset("time", data=np.arange(4.0))
        scale.make_scale("time")
        datasets = [file.create_dataset(f"c{i}", data=np.arange(4.0)) for i in range(5)]
        how(datasets, scale)
    with h5py.File(path) as file:
        scale = file["time"]
        assert all(h5py.h5ds.is_attached(file[f"c{i}"].id, scale.id, 0) for i in range(5))
        listed = scale.attrs["REFERENCE_LIST"]
        return (
            [[(axis.name, key) for key, axis in file[f"c{i}"].dims[0].items()] for i in range(5)],
            [(file[ref].name, int(dimension)) for ref, dimension in listed],
            [file["c0"].attrs.get_id("DIMENSION_LIST").get_type(), scale.attrs.get_id("REFERENCE_LIST").get_type()],
        )


def test_it_is_what_hdf5_writes_itself(tmp_path):
    """The same axes, the same users of the scale, in the same types."""

    def by_hdf5(datasets, scale):
        for dataset in datasets:
            dataset.dims[0].attach_scale(scale)

    ours, theirs = made(tmp_path / "ours.h5", attach_dimensions), made(tmp_path / "theirs.h5", by_hdf5)
    assert ours[:2] == theirs[:2]
    assert ours[2] == theirs[2]


def test_a_wide_run_is_not_larger_than_its_values(tmp_path):
    """500 channels of 100 samples: by far less than the 2 MB that the scale's list took when it grew each time."""
    wide = Group("wide", tuple(Channel(f"c{i}", "V") for i in range(500)))
    run = store(tmp_path, wide, [np.arange(100.0) + i for i in range(500)])
    assert run.path.stat().st_size < 6 * 500 * 100 * 8
    assert run.channel("c499")[0] == 499


WIDE = """
import sys
from pathlib import Path
import numpy as np
from testbench.recording import Channel, Group
from testbench.store.writer import RunWriter
def held():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
group = Group("wide", tuple(Channel(f"c{i}", "V") for i in range(1000)))
with RunWriter(Path(sys.argv[1]), "r") as writer:
    writer.group(group).append([np.zeros(100)] * 1000)
    before = held()
    writer.group(group).finish(None, None)
    print(held() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not say what a process holds")
def test_a_wide_run_takes_little_memory(tmp_path):
    """Less than 60 kB a channel while it is written; HDF5's own cache of chunks would take as much again."""
    done = subprocess.run([sys.executable, "-c", WIDE, tmp_path], capture_output=True, text=True, check=True)
    assert 0 < int(done.stdout) < 1000 * 60_000
