"""A run in other people's tools: names, units, time and a plot; only what is asked for is read."""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import testbench
from testbench.recording import Channel, Group, TimeColumn, UniformClock

from .test_writer import store

GROUP = Group("daq", (Channel("Time (ms)", "ms", "Time"), Channel("AccX (g)", "g", "AccX"), Channel("İvme", None)))
N = 500
COLUMNS = [np.arange(float(N)), np.sin(np.arange(N)), np.cos(np.arange(N))]
CLOCKS = {"recorded": TimeColumn(0, 1e-3), "uniform": UniformClock(1000.0), "none": None}


@pytest.fixture(params=CLOCKS)
def run(request, tmp_path):
    """A stored run by its path alone, with each kind of clock."""
    group = Group(GROUP.name, GROUP.channels, CLOCKS[request.param])
    return testbench.open_run(store(tmp_path, group, COLUMNS, rig="a = 1\n").path)


def test_pandas(run):
    """Columns by their written names against time in seconds; units beside."""
    frame = run.to_pandas("daq")
    assert frame["AccX (g)"].to_numpy().tobytes() == COLUMNS[1].tobytes()
    assert frame.attrs["units"]["AccX (g)"] == "g"
    assert frame.attrs["origin"] == "simulated"
    if run.group().clock is None:
        assert (frame.index.name, frame.index[-1]) == ("sample", N - 1)
    else:
        assert (frame.index.name, frame.index[-1]) == ("time (s)", pytest.approx((N - 1) / 1000))
    assert list(run.to_pandas(channels=["AccX"]).columns) == ["AccX (g)"]


def test_two_channels_of_one_name_stay_two(tmp_path):
    """Neither is lost in pandas, nor in xarray."""
    twice = Group("daq", (Channel("Fz (N)", "N"), Channel("Fz (N)", "N")), UniformClock(10.0))
    run = store(tmp_path, twice, COLUMNS[:2])
    frame = run.to_pandas()
    assert [frame.iloc[:, i].to_numpy().tobytes() for i in range(2)] == [c.tobytes() for c in COLUMNS[:2]]
    assert len(run.to_xarray().data_vars) == 2


def test_our_xarray_is_that_of_open_dataset(run):
    """The same names, values and units as xarray reads from the file; and the whole tree opens."""
    xarray = pytest.importorskip("xarray")
    ours = run.to_xarray()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_dataset(run.path, engine="h5netcdf", group="entry/daq") as theirs:
            for key in ("AccX", "Ivme"):
                assert theirs[key].to_numpy().tobytes() == ours[key].to_numpy().tobytes()
                assert theirs[key].attrs["long_name"] == ours[key].attrs["long_name"]
                assert theirs[key].dims == ours[key].dims
            assert theirs["AccX"].attrs["units"] == ours["AccX"].attrs["units"] == "g"
        with xarray.open_datatree(run.path, engine="h5netcdf") as tree:
            assert tree["entry/daq/AccX"].shape == (N,)


def test_a_nexus_library_finds_the_default_plot(run):
    """nexusformat opens the run and goes from the root to signal and axis, as h5web does."""
    nexusformat = pytest.importorskip("nexusformat.nexus")
    root = nexusformat.nxload(run.path)
    plot = root.get_default()
    assert plot.nxclass == "NXdata"
    signal = {"recorded": "AccX", "uniform": "Time", "none": "Time"}
    kind = {TimeColumn: "recorded", UniformClock: "uniform"}.get(type(run.group().clock), "none")
    assert plot.nxsignal.nxname == signal[kind]
    assert plot.nxsignal.shape == (N,)
    assert plot["AccX"].attrs["units"] == "g"
    if kind != "none":
        assert [axis.nxname for axis in plot.nxaxes] == ["time"]
        assert plot.nxaxes[0].shape == (N,)


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="the system does not count what a process reads")
def test_only_what_is_asked_for_is_read(tmp_path):
    """Of six channels of 3.2 MB one is read; opening the run reads none."""
    samples = 400_000
    wide = Group("daq", tuple(Channel(f"c{i} (V)", "V", f"c{i}") for i in range(6)), UniformClock(1000.0))
    path = store(tmp_path, wide, [np.full(samples, float(i)) for i in range(6)], block=samples).path
    before = bytes_read()
    run = testbench.open_run(path)
    opened = bytes_read() - before
    assert run.channel("c3")[-1] == 3.0
    assert opened < 200_000
    assert 8 * samples <= bytes_read() - before < 1.15 * 8 * samples


def bytes_read():
    """Bytes that this process has read from files so far."""
    return int(Path("/proc/self/io").read_text().split()[1])


def test_the_package_imports_nothing_until_it_is_asked():
    """`import testbench` costs nothing; a name that is not there is an AttributeError."""
    code = "import sys, testbench; assert 'h5py' not in sys.modules; testbench.open_run; "
    code += "assert 'pandas' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    with pytest.raises(AttributeError, match="no attribute"):
        testbench.nothing  # noqa: B018
