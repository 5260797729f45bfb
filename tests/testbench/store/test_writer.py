"""Runs in HDF5: the same bits back, for us and for others; whole or not at all."""

import json

import h5py
import numpy as np
import pytest

from testbench.errors import StoreError
from testbench.recording import Channel, Group, TimeColumn
from testbench.store import atomic_files, open_campaign, writer
from testbench.store.writer import RunWriter

from .stored import ACC, fill, names_in, store

RANDOM = np.random.default_rng(11)
NAMES = ["Time (s)", "AccX (g)", "Acc/../../X", "İvme µ (m/s²)", "Şaft", "AccX (g)", "time", "\x1b[31m", "a" * 300]


@pytest.mark.parametrize("samples", [1, 622, writer.CHUNK, writer.GATHERED + 12_345, 3 * writer.GATHERED])
def test_the_same_bits_come_back(tmp_path, samples):
    """Whatever the length and the blocks, each channel has the bits that went in; -0.0, NaN and inf as well."""
    columns = [np.arange(samples) / 5000.0, RANDOM.normal(size=samples)]
    columns[1][:3] = [-0.0, np.nan, np.inf][:samples]
    group = Group("log", (Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")), TimeColumn(0))
    run = store(tmp_path, group, columns, block=77_777, rate=(5000.0, "median_step"))
    assert run.channel("AccX").tobytes() == columns[1].tobytes()
    assert run.time().tobytes() == columns[0].tobytes()
    assert (run.group().samples, run.rate_hz, run.group().rate_source) == (samples, 5000.0, "median_step")


def test_names_are_kept_whatever_they_hold(tmp_path):
    """Slashes, accents, escapes, duplicates: safe HDF5 names, and the written ones beside."""
    group = Group("../log", tuple(Channel(name) for name in NAMES), TimeColumn(0, 1.0, assumed=True))
    columns = [np.full(5, float(i)) for i in range(len(NAMES))]
    run = store(tmp_path, group, columns)
    stored = run.group()
    assert (stored.name, [c.name for c in stored.channels]) == ("../log", NAMES)
    assert len(set(stored.keys)) == len(NAMES)
    assert all(key.isascii() and "/" not in key and key.isprintable() for key in stored.keys)
    assert [run.channel(key)[0] for key in stored.keys if key not in NAMES] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert run.channel("time")[0] == 6  # the one so written, not the HDF5 name of 'Time (s)'
    with pytest.raises(StoreError, match=r"'AccX \(g\)' is not one in group .*channel 2 .*channel 6 "):
        run.channel("AccX (g)")


def test_a_channel_is_found_with_and_without_its_unit(tmp_path):
    """The rig names AccX; the log writes AccX (g)."""
    group = Group("log", (Channel("AccX (g)", "g", "AccX"), Channel("AccY (g)", "g", "AccY")))
    run = store(tmp_path, group, [np.ones(3), np.zeros(3)])
    assert run.channel("AccX").tolist() == run.channel("AccX (g)").tolist() == [1, 1, 1]
    with pytest.raises(StoreError, match=r"no channel 'AccZ'.*'AccX \(g\)', 'AccY \(g\)'"):
        run.channel("AccZ")
    with pytest.raises(StoreError, match="no time column"):
        run.time()


def test_conditions_rig_and_findings_come_back(tmp_path):
    """What is known of the run is in the run; the rig's text to the byte."""
    rig = 'name = "Prüfstand"\r\n# ölçüm\n[loggers.daq]\n'
    conditions = {"payload_kg": 5.0, "counter_masses": {"counter_A0A": 24.2626}, "motion": "x", "repeat": 2}
    run = store(tmp_path, ACC, [np.ones(3)], rig=rig, **conditions)
    assert (run.origin, run.conditions, run.rig) == ("simulated", conditions, rig)
    assert run.provenance["sources"][0]["name"] == "log.csv"
    without = store(tmp_path, ACC, [np.ones(3)], name="r002", counter_masses={})
    assert without.conditions == {"counter_masses": {}}
    assert without.rig is None


def test_h5py_and_nexus_find_their_way(tmp_path):
    """NX_class and default lead from the root to the plot; every dataset of values has a checksum."""
    group = Group("daq", (Channel("Time (s)", "s", "Time"), Channel("AccX (g)", "g", "AccX")), TimeColumn(0))
    run = store(tmp_path, group, [np.arange(10) / 100, np.arange(10.0)], rig="a = 1\n")
    with h5py.File(run.path) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        assert (entry.attrs["NX_class"], data.attrs["NX_class"]) == ("NXentry", "NXdata")
        assert data[data.attrs["signal"]][3] == 3.0
        assert data[data.attrs["axes"][0]].attrs["long_name"] == "Time (s)"
        assert data["AccX"].dims[0][0] == data["time"]
        unchecked = []
        file.visititems(
            lambda name, node: unchecked.append(name) if getattr(node, "fletcher32", True) is False else None
        )
        assert unchecked == []


def test_nothing_is_left_of_a_run_that_is_not_committed(tmp_path, monkeypatch):
    """Neither the run nor a part of it, nor a folder that was not there; interrupted before its name, no digest."""
    with RunWriter(tmp_path / "new", "r") as writer:
        writer.group(ACC).append([np.ones(200_000)])
    assert list(tmp_path.iterdir()) == []

    def sync(_):
        if (tmp_path / "r001.h5.sha256").exists():
            raise KeyboardInterrupt

    monkeypatch.setattr(atomic_files, "sync", sync)
    with pytest.raises(KeyboardInterrupt):
        store(tmp_path, ACC, [np.ones(3)])
    assert names_in(tmp_path) == []


def test_a_stored_run_is_never_replaced(tmp_path):
    """A second run of the name is refused before anything is read; one that comes meanwhile is not overwritten."""
    with RunWriter(tmp_path, "r001") as late:
        fill(late, {ACC: [np.zeros(3)]})
        first = store(tmp_path, ACC, [np.ones(3)])
        with pytest.raises(StoreError, match="is there already"):
            late.commit()
    with pytest.raises(StoreError, match="stored runs never change"):
        RunWriter(tmp_path, "r001")
    assert first.channel("AccX (g)").tolist() == [1, 1, 1]
    assert [state.status for state in open_campaign(tmp_path).verify()] == ["intact"]
    assert names_in(tmp_path) == ["r001.h5", "r001.h5.sha256"]


def test_layout_is_documented_in_the_file(tmp_path):
    """Provenance is JSON that anyone can read."""
    run = store(tmp_path, ACC, [np.ones(3)])
    with h5py.File(run.path) as file:
        assert json.loads(file["entry/provenance"].attrs["json"])["sources"][0]["size_bytes"] == 1
        assert file["entry/provenance/source_1"].attrs["name"] == "log.csv"
