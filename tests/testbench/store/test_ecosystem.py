"""A run in other people's tools: names, units, time and a plot; only what is asked for is read."""

import subprocess
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import testbench
from balance.errors import CounterpoiseError
from testbench.errors import StoreError
from testbench.recording import Channel, Group, TimeColumn, UniformClock
from testbench.store.archive import archive
from testbench.store.writer import CHUNK, RunWriter
from testbench.synchronization.clock_map import ClockMap
from testbench.synchronization.offset_and_drift import AlignedClock
from testbench.synchronization.run_alignment import RunClocks, write_alignments

from .stored import store, store_groups

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


def test_the_time_may_be_asked_for(run):
    """In xarray it is the axis, in seconds, and no error beside it; where there is none it is a channel like others."""
    pytest.importorskip("xarray")
    found = run.to_xarray(channels=["Time (ms)", "AccX"])
    if isinstance(run.group().clock, TimeColumn):
        assert list(found.data_vars) == ["AccX"]
        assert found["time"].to_numpy().tobytes() == run.time().tobytes()
    else:
        assert list(found.data_vars) == ["Time", "AccX"]


def test_a_run_prints_as_a_table_and_without_xarray_says_what_to_install(run, monkeypatch):
    """A line a group of at most 80 characters, never the texts of rig and logs; a dataset names its extra."""
    assert len(repr(run).splitlines()) == 2 + len(run.groups)
    assert max(map(len, repr(run).splitlines())) <= 80
    assert run.groups[0].channels[0].name in repr(run)
    assert "{" not in repr(run)
    assert repr(run).startswith("Run\n")
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(StoreError, match=r"counterpoise\[xarray\]"):
        run.to_xarray()


def test_two_loggers_in_pandas(tmp_path):
    """One table below the other, each value with its logger, channel and time; clashing names are refused."""
    daq = Group("daq", (Channel("AccX (g)", "g"), Channel("T (K)", "K")), UniformClock(1000.0))
    plc = Group("plc", (Channel("q (rad)", "rad"), Channel("T (K)", "K")), UniformClock(100.0))
    run = store_groups(tmp_path, {daq: COLUMNS[:2], plc: [column[:50] for column in COLUMNS[:2]]}, "two")
    table = run.to_pandas()
    assert table.attrs["units"] == {"AccX (g)": "g", "T (K)": "K", "q (rad)": "rad"}
    for name in ("daq", "plc"):
        own = run.to_pandas(name)
        assert table.loc[name][list(own.columns)].equals(own.rename_axis(table.loc[name].index.name))
    assert table.loc["plc"]["AccX (g)"].isna().all()
    for table_of in (run.to_pandas, run.to_xarray):
        with pytest.warns(UserWarning, match=r"clocks of daq, plc are as recorded, not aligned: .*testbench align"):
            table_of(resample="50 Hz")
    late = AlignedClock(ClockMap(0.0, 0.1, 0.0, np.zeros((2, 2)), 9, (0.0, 0.5)), "trigger", "by hand", None)
    write_alignments(tmp_path, [(run.path, RunClocks("two", "simulated", "daq", {"plc": late}, {}))])
    joined, data = run.to_pandas(resample="50 Hz"), run.to_xarray(resample="50 Hz")
    assert joined.attrs["clocks"] == "recorded alignments"
    assert joined.index[0] == 0.1, "where the later of the two begins, on the clock of the reference"
    same = run.to_pandas(resample="99.999 Hz")["q (rad)"]  # the plc's own rate, but for a drift: not low-passed
    np.testing.assert_allclose(same.iloc[2], COLUMNS[0][2], rtol=1e-4)
    assert joined.attrs["resampled_to_hz"] == 50.0
    for name, values in zip(joined.columns, data.data_vars.values(), strict=True):
        assert (values.attrs["long_name"], values.attrs["units"]) == (name, joined.attrs["units"][name])
        assert values.to_numpy().tobytes() == joined[name].to_numpy().tobytes()
    for asked, message in (
        ({"group": "daq"}, "resample joins all groups"),
        ({"channels": ["AccX"]}, "no channel 'AccX'"),
    ):
        with pytest.raises(CounterpoiseError, match=message):
            run.to_xarray(resample="50 Hz", **asked)
    twice = Group("daq", (Channel("Fz", "N"), Channel("Fz", "N")), UniformClock(10.0))
    run = store_groups(tmp_path, {twice: COLUMNS[:2], plc: COLUMNS[:2]}, "clash")
    with pytest.raises(StoreError, match="several channels or units: name a group, there are 'daq', 'plc'"):
        run.to_pandas()


def test_what_is_above_the_new_rate_is_gone_and_gaps_stay_gaps(tmp_path):
    """Of a logger of equal steps, of one without a rate, and on both sides of a gap with a few samples in it."""
    even = np.arange(4000) / 1000.0
    loggers = {
        "even": even,
        "uneven": even + np.random.default_rng(1).uniform(-2e-4, 2e-4, len(even)),
        "gap": even[(even < 1.0) | (even > 1.5) | (abs(even - 1.25) < 6e-3)],
    }
    with RunWriter(tmp_path, "run") as writer:
        for name, time in loggers.items():
            group = Group(
                name, (Channel("t", "s"), Channel(f"{name} y", "g"), Channel(f"{name} on", "")), TimeColumn(0, 1.0)
            )
            slow, fast = np.sin(2 * np.pi * 3.0 * time), np.sin(2 * np.pi * 190.0 * time)
            line = np.where(np.arange(len(time)) == 700, np.nan, slow > 0.3)  # one sample is missing
            writer.group(group).append([time, slow + fast, line])
            rate = (None, None) if name == "uneven" else (1000.0, "median_step")
            writer.group(group).finish(*rate)
        writer.describe("simulated", {}, [], {"sources": []}, None)
        run = testbench.open_run(writer.commit())
    with pytest.warns(UserWarning, match="not aligned"):
        table = run.to_pandas(resample="100 Hz")
    grid = table.index.to_numpy()
    for name, most in (("even", 0.01), ("uneven", 0.05), ("gap", 0.015)):
        apart = (table[f"{name} y"] - np.sin(2 * np.pi * 3.0 * grid))[abs(grid - 1.25) > 0.01]
        assert np.sqrt(np.nanmean(apart**2)) < most, name
        line, clear = table[f"{name} on"], abs(np.sin(2 * np.pi * 3.0 * grid) - 0.3) > 0.05
        assert set(line.dropna()) == {0.0, 1.0}, "a digital line has no values between"
        known = clear & line.notna().to_numpy()
        np.testing.assert_array_equal(line[known], np.sin(2 * np.pi * 3.0 * grid[known]) > 0.3)
    assert "the last sample of digital lines: even on, uneven on, gap on" in table.attrs["interpolation"]
    hidden = (grid > 0.999) & (grid < 1.501) & (abs(grid - 1.25) > 5e-3)
    np.testing.assert_array_equal(table["gap y"].isna(), hidden)
    for rate, message in (("1e15 Hz", "are more than .* rows"), ("0 Hz", "expected a positive rate")):
        with pytest.raises(CounterpoiseError, match=message):
            run.to_pandas(resample=rate)


def test_lines_of_several_values_are_held_and_what_is_measured_is_not(tmp_path):
    """Counters and states have no values between; a sine of 12 bits has. What may be either is named."""
    time = np.arange(4000) / 1000.0
    sine = np.sin(2 * np.pi * 3.0 * time)
    lines = {
        "count": np.cumsum(np.arange(4000) % 7 == 0).astype(float),
        "ticks": np.arange(4000.0),
        "byte": np.arange(4000.0) % 256,
        "lost": (np.arange(4000.0) + 3.0 * (np.arange(4000) > 2000)) % 1000,
        "down": 4000.0 - np.arange(4000) // 7,
        "state": np.array([0.0, 3.0, 1.0, 7.0])[(time // 0.03).astype(int) % 4],
        "trigger": 2.5 * (sine > 0.3) + 0.001 * np.arange(4000) % 0.01,
    }
    measured = {"adc": np.rint(2047 * sine), "small": np.rint(4 * np.sin(2 * np.pi * 30.0 * time))}
    measured["hops"] = np.array([0.0, 3.0, 1.0, 7.0])[(time // 0.004).astype(int) % 4]
    measured["spiky"] = np.cumsum(np.arange(4000) % 9 < 4) + 40.0 * (np.arange(4000) % 500 == 250)
    measured["mask"] = np.repeat(np.random.default_rng(1).permutation(1000), 4).astype(float)
    sensor = '[sensors.sync]\nkind = "trigger"\nlogger = "daq"\nchannel = "Sync"\n'
    rig = f'mechanism = "none"\n[loggers.daq]\n{sensor}'
    channels = tuple(Channel(name, label="Sync" if name == "trigger" else "") for name in lines | measured)
    group = Group("daq", channels, UniformClock(1000.0))
    run = store_groups(tmp_path, {group: [*lines.values(), *measured.values()]}, rig=rig)
    with pytest.warns(UserWarning, match="small, hops, mask: whole numbers, few or each for some samples") as said:
        table = run.to_pandas(resample="100 Hz")
    assert len(said) == 1
    for name, values in lines.items():
        np.testing.assert_array_equal(table[name], values[::10], err_msg=name)
    for name, values in measured.items():
        assert (table[name] != values[::10]).mean() > 0.5, name
    assert table.attrs["interpolation"].endswith(f"digital lines: {', '.join(lines)}")
    own = run.to_pandas(resample="1 kHz")  # at the logger's own rate no values are between: nothing is said
    np.testing.assert_array_equal(own[[*measured]], np.column_stack([*measured.values()]))


def test_channels_of_one_name_stay_as_many(tmp_path):
    """None is lost in pandas, nor in xarray, nor on one clock."""
    three = COLUMNS[:3]
    run = store(tmp_path, Group("daq", (Channel("Fz (N)", "N"),) * 3, UniformClock(10.0)), three)
    for frame in (run.to_pandas(), run.to_pandas(resample="10 Hz")):
        assert [frame.iloc[:, i].to_numpy().tobytes() for i in range(3)] == [c.tobytes() for c in three]
    assert len(run.to_xarray().data_vars) == len(run.to_xarray(resample="10 Hz").data_vars) == 3


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


SEVERAL = {
    Group("edges", (Channel("t", "s"),), TimeColumn(0)): None,
    Group(
        "DAQ 1 / left",
        (Channel("Time (ms)", "ms", "Time"), Channel("Acc X [m/s²]", "m/s²", "Acc X")),
        CLOCKS["recorded"],
    ): "ms",
    Group("force plate", (Channel("F z (N)", "N", "F z"), Channel("sample", None)), UniformClock(2000.0, 0.5)): "s",
    Group("loose numbers", (Channel("a b"), Channel("T", "degC")), None): None,
    Group("ticks", (Channel("tick", "ticks"), Channel("U", "V")), TimeColumn(0, None)): "ticks",
}
"""Groups of one run, and the unit of the axis against which each is plotted."""


@pytest.fixture
def several(tmp_path):
    """A run of groups of every clock, of different lengths, with names of several words; its archive."""
    groups = {group: [np.sqrt(np.arange(N + i)) for _ in group.channels] for i, group in enumerate(SEVERAL)}
    known = {"provenance": {"sources": [{"name": "a b.csv", "sha256": "0" * 64, "size_bytes": 1}]}, "rig": "a = 1\n"}
    run = store_groups(tmp_path, groups, "run 1", conditions={"counter_masses": {"counter A": 1.0}}, **known)
    return run, testbench.open_run(archive(run, tmp_path / "archive").file)


def test_several_groups_of_different_clocks_open_in_xarray(several):
    """Each with its own time, names and units, as one tree and one by one, without a warning."""
    xarray = pytest.importorskip("xarray")
    for run in several:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with xarray.open_datatree(run.path, engine="h5netcdf") as tree:
                for number, (group, unit) in enumerate(SEVERAL.items()):
                    key = run.group(group.name).path
                    found = tree[key]
                    assert set(found.sizes.values()) == {N + number}
                    for name, channel in zip(run.group(group.name).keys, group.channels, strict=True):
                        assert found[name].attrs["long_name"] == channel.name
                        assert found[name].attrs.get("units") == channel.unit
                    if unit is not None:
                        assert found["time"].attrs["units"] == unit
                    with xarray.open_dataset(run.path, engine="h5netcdf", group=key) as alone:
                        assert alone.sizes == found.sizes


def test_the_default_plot_of_several_groups(several):
    """Every group has a class; the default is no list of edges; each group plots against its own axis."""
    nexusformat = pytest.importorskip("nexusformat.nexus")
    run, _ = several
    root = nexusformat.nxload(str(run.path))
    assert root.get_default().nxpath == "/entry/DAQ_1_left"
    for group, unit in SEVERAL.items():
        data = root[run.group(group.name).path]
        assert data.nxclass == "NXdata"
        channel = group.channels[0 if unit is None or len(group.channels) == 1 or unit == "s" else 1]
        assert data.nxsignal.attrs["long_name"] == channel.name
        assert data.nxsignal.attrs.get("units") == channel.unit
        if unit is not None:
            (axis,) = data.nxaxes
            assert (axis.nxname, axis.attrs["units"], axis.shape) == ("time", unit, data.nxsignal.shape)
    with h5py.File(run.path) as file:
        found = []
        file.visititems(
            lambda name, node: found.append("NX_class" in node.attrs) if isinstance(node, h5py.Group) else None
        )
        assert all(found)


def test_what_h5web_asks_of_a_default_plot(several):
    """Its rules for NXdata: each group's signal and axes are names of its own one-dimensional plain numbers.

    A `title` would have to be one text, `errors` and SIGNAL_errors are drawn as such; a label is `long_name` alone, so
    that the time of a uniform clock has its unit there.
    """
    for run in several:
        with h5py.File(run.path) as file:
            node = file
            while "default" in node.attrs:
                name = node.attrs["default"]
                assert isinstance(name, str)
                assert isinstance(node.get(name, getlink=True), h5py.HardLink)
                node = node[name]
            assert node.attrs["NX_class"] == "NXdata"
            plotted = [g for g in file["entry"].values() if g.attrs["NX_class"] == "NXdata" and "signal" in g.attrs]
            assert node in plotted
            for group in plotted:
                (axis,), signal = group.attrs["axes"], group.attrs["signal"]
                for name in (signal, *([] if axis == "." else [axis])):
                    assert isinstance(name, str)
                    dataset = group[name]
                    assert isinstance(group.get(name, getlink=True), h5py.HardLink)
                    assert (dataset.ndim, dataset.dtype.names) == (1, None)
                    assert dataset.dtype.kind in "iuf"
                    assert dataset.shape == group[signal].shape
                    assert isinstance(dataset.attrs["long_name"], str)
                    if name == "time" and group.attrs["clock"] == "uniform":
                        assert dataset.attrs["long_name"] == "time (s)"
                assert not {"title", "errors", f"{signal}_errors"} & set(group)


def test_channels_whose_names_mean_something_to_viewers(tmp_path):
    """`title`, `errors` and `a_errors` are channels like any other: no heading and no bars round the values of `a`."""
    names = ("a", "title", "errors", "a errors", "terrors")
    group = Group("daq", tuple(Channel(name, "V") for name in names), UniformClock(10.0))
    run = store(tmp_path, group, [np.arange(5.0) + i for i in range(5)])
    assert run.group().keys == ("a", "title_channel", "errors_channel", "a_errors_channel", "terrors")
    for i, name in enumerate(names):
        assert run.channel(name)[0] == i


def test_no_viewer_plots_whole_numbers_for_values(tmp_path):
    """An archive's channel of decimals is no signal; one of full precision is."""
    full = np.sqrt(np.arange(N))
    run = store(tmp_path, GROUP, [COLUMNS[0], np.round(full, 3), full])
    with h5py.File(run.path) as plain, h5py.File(archive(run, tmp_path / "a").file) as small:
        assert (plain["entry/daq"].attrs["signal"], small["entry/daq"].attrs["signal"]) == ("Time", "Ivme")
    alone = store(tmp_path, Group("daq", GROUP.channels[:2]), [COLUMNS[0], np.round(full, 3)], name="r002")
    with h5py.File(archive(alone, tmp_path / "a").file) as small:
        assert "signal" not in small["entry/daq"].attrs


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="the system does not count what a process reads")
def test_only_what_is_asked_for_is_read(tmp_path):
    """Of six channels of 3.1 MB one is read; opening the run reads none."""
    samples = 6 * CHUNK
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
