"""HDF5 of other people: plain, netCDF 4, NeXus, MATLAB 7.3; packed numbers; and files that would lead elsewhere."""

import time
from collections import Counter

import h5netcdf
import h5py
import numpy as np
import pytest

from testbench.errors import RecordingError
from testbench.readers.array_grouping import Series, group_series
from testbench.readers.hdf5 import datasets
from testbench.readers.hdf5.safe_walk import Walk
from testbench.recording import Channel, TimeColumn, UniformClock

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

RANDOM = np.random.default_rng(7)
TIME = np.arange(300) / 64


@pytest.fixture
def made(tmp_path):
    """A new file, and how to read it."""

    def make(write, name="run.h5", **options):
        path = tmp_path / name
        with h5py.File(path, "w", **options) as file:
            write(file)
        return reading.read(path)

    return make


def test_groups_lengths_and_times_are_kept_apart(made):
    """Datasets of one group and length belong together; time is what is named so and grows."""

    def write(file):
        fast, slow = file.create_group("daq/fast"), file.create_group("daq/slow")
        fast["time"], fast["acc"] = TIME, np.cos(TIME)
        fast["acc"].attrs["unit"], fast["time"].attrs["units"] = "m/s^2", "s"
        slow["t"], slow["force"] = TIME[:20], np.cos(TIME[:20])
        fast["spectrum"] = np.ones(33)

    found = made(write)
    assert sorted(found.groups) == ["run daq/fast 300", "run daq/fast 33", "run daq/slow"]
    np.testing.assert_array_equal(found.time("run daq/fast 300"), TIME)
    assert found.groups["run daq/slow"].clock == TimeColumn(1, 1.0, assumed=True)
    assert found.unit("acc") == "m/s^2"


@pytest.mark.parametrize("options", [{}, {"chunks": (64, 3)}, {"compression": "gzip", "shuffle": True}])
def test_tables_are_channels_of_their_short_side(made, options, monkeypatch):
    """Tall and wide tables, in chunks and packed, and of compound and complex numbers."""
    table = RANDOM.normal(size=(300, 3))
    rows = np.zeros(300, dtype=[("t", "f8"), ("a", "i4")])
    rows["t"], rows["a"] = TIME, np.arange(300)

    def write(file):
        file.create_dataset("tall", data=table, **options)
        file["wide"], file["rows"], file["frf"] = table.T, rows, table[:, 0] + 1j * table[:, 1]

    found = made(write)
    for i in range(3):
        np.testing.assert_array_equal(found.column(f"tall[:,{i}]"), table[:, i])
        np.testing.assert_array_equal(found.column(f"wide[{i},:]"), table[:, i])
    np.testing.assert_array_equal(found.column("rows.a"), np.arange(300))
    np.testing.assert_array_equal(found.column("frf (imag)"), table[:, 1])


def test_a_stated_rate_is_the_clock(made):
    """An attribute fs or a number beside the data."""

    def attribute(file):
        file["acc"] = TIME**2
        file["acc"].attrs["fs"] = 64.0

    def number(file):
        file["acc"], file["dt"] = TIME**2, 1 / 64

    assert made(attribute).group().clock == UniformClock(64.0)
    assert made(number).group().clock == UniformClock(64.0)


def test_netcdf_dimensions_are_the_axes(tmp_path):
    """Coordinates of the dimension, packed numbers, and a dimension without values."""
    path = tmp_path / "run.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"when": 300, "f": 300, "none": 4}
        file.create_variable("when", ("when",), data=TIME).attrs["units"] = "seconds since 2026-11-21 00:00:00"
        file.create_variable("f", ("f",), data=np.arange(300.0)).attrs["units"] = "Hz"
        packed = file.create_variable("acc", ("when",), data=np.arange(300, dtype="i2"), fillvalue=np.int16(7))
        packed.attrs["scale_factor"], packed.attrs["add_offset"], packed.attrs["units"] = 0.5, 10.0, "m s-2"
        file.create_variable("psd", ("f",), data=np.ones(300))
        file.create_variable("three", ("when", "none"), data=np.ones((300, 4)))
    found = reading.read(path)
    assert not [f for f in found.findings if f.severity == 2], "a length without values is no cut"
    acc = next(g for g in found.groups.values() if "acc" in [c.name for c in g.channels])
    assert isinstance(acc.clock, TimeColumn)
    assert acc.channels[acc.clock.index].name == "when"
    assert acc.clock.seconds_per_unit == 1.0
    expected = np.arange(300) * 0.5 + 10
    expected[7] = np.nan
    np.testing.assert_array_equal(found.column("acc"), expected)
    psd = next(g for g in found.groups.values() if "psd" in [c.name for c in g.channels])
    assert psd.name != acc.name
    assert psd.clock is None
    assert {"calibration_applied", "invalid_samples"} <= found.codes


def test_nexus_axes_are_the_axes(made):
    """NXdata names its axis, NXlog has time."""

    def write(file):
        data = file.create_group("entry/data")
        data.attrs.update({"NX_class": "NXdata", "signal": "force", "axes": ["clock"]})
        data["force"], data["clock"] = np.cos(TIME), TIME
        data["clock"].attrs["units"] = "s"
        log = file.create_group("entry/log")
        log.attrs["NX_class"] = "NXlog"
        log["time"], log["value"] = TIME[:9] * 1000, np.ones(9)
        log["time"].attrs["units"], log["value"].attrs["units"] = "ms", "°C"

    found = made(write)
    np.testing.assert_array_equal(found.time("run entry/data"), TIME)
    assert found.groups["run entry/log"].clock == TimeColumn(0, 1e-3)


def test_matlab_variables_are_named_as_in_matlab(tmp_path):
    """Structures, texts, cells, empty arrays and turned tables of a file of MATLAB 7.3."""
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = RANDOM.normal(size=(3, 300))
        file["run/t"], file["run/acc"] = TIME[None, :], np.cos(TIME)[None, :]
        file["note"] = np.array([[ord(c)] for c in "hello"], dtype="u2")
        file["none"] = np.zeros(2, dtype="u8")
        refs = file.create_group("#refs#")
        refs["a"] = np.arange(4.0)[None, :]
        file.create_dataset("c", data=np.array([[refs["a"].ref]], dtype=h5py.ref_dtype))
        kinds = {"x": "double", "run/t": "double", "run/acc": "double", "note": "char", "none": "double", "c": "cell"}
        for name, kind in kinds.items():
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
        file["none"].attrs["MATLAB_empty"] = np.uint8(1)
        rows = file["x"][()]
    raw = bytearray(path.read_bytes())
    raw[:128] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    path.write_bytes(raw)
    found = reading.read(path)
    assert found.recording.format == "MATLAB v7.3"
    np.testing.assert_array_equal(found.column("x(:,2)"), rows[1])
    np.testing.assert_array_equal(found.column("run.acc"), np.cos(TIME))
    assert found.column("c{1}").tolist() == [0, 1, 2, 3]
    assert found.recording.metadata["note"] == "hello"
    assert isinstance(found.groups["run run"].clock, TimeColumn)


def test_links_within_the_file_are_met_once(made):
    """A second name of a dataset is no second channel; circles of groups are left out and said."""

    def write(file):
        group = file.create_group("a")
        group["acc"] = TIME
        file["again"] = group["acc"]
        group["round"] = group
        group["soft"] = h5py.SoftLink("/a/acc")
        group["circle"] = h5py.SoftLink("/a")
        group["one"], group["two"] = h5py.SoftLink("/a/two"), h5py.SoftLink("/a/one")
        group["nowhere"] = h5py.SoftLink("/b/acc")

    found = made(write)
    assert [len(columns) for columns in found.data.values()] == [1]
    assert {f.channel for f in found.findings if f.code == "cyclic_link"} == {
        "/a/round",
        "/a/circle",
        "/a/one",
        "/a/two",
    }
    assert {f.channel for f in found.findings if f.code == "broken_link"} == {"/a/nowhere"}


def test_a_web_of_links_is_one_finding(made):
    """Each of forty groups holds each other and itself: one finding with their number; so are links to nowhere."""

    def write(file):
        groups = [file.create_group(f"g{i:02d}") for i in range(40)]
        groups[0]["acc"] = TIME
        for group in groups:
            for i, other in enumerate(groups):
                group[f"to{i:02d}"] = other
            group["nowhere"] = h5py.SoftLink("/b/acc")

    found = made(write)
    assert [len(columns) for columns in found.data.values()] == [1]
    counts = Counter(f.code for f in found.findings)
    assert counts["cyclic_link"] == counts["broken_link"] == 1
    assert "and 39 more links like it, such as /g00/to01/" in found.message("broken_link")
    # the groups lie one in the other, g00 outermost: the one at depth i leads back to itself and the i above it
    assert f"and {40 * 41 // 2 - 1} more links" in found.message("cyclic_link")


def test_the_objects_are_gone_through_once(made, monkeypatch):
    """Opening and reading of thousands of datasets: one walk, attributes asked once each, and values to the bit."""
    walks, asked = [], Counter()
    walk, ask = Walk.datasets, datasets.attributes
    monkeypatch.setattr(Walk, "datasets", lambda self: walks.append(self) or walk(self))
    monkeypatch.setattr(datasets, "attributes", lambda node: asked.update([node.name]) or ask(node))
    values = RANDOM.normal(size=(600, 5))

    def write(file):
        for i, row in enumerate(values):
            file[f"g{i % 300}/c{i}"] = row

    found = made(write)
    assert len(walks) == 1
    assert set(asked.values()) == {1}
    assert len(found.groups) == 300
    for i, row in enumerate(values):
        np.testing.assert_array_equal(found.column(f"c{i}", f"run g{i % 300}"), row)


def test_twenty_thousand_places_are_gathered_in_one_go():
    """Names of groups do not compare each place with each other: seconds, where it took minutes."""
    series = [Series(f"g{i}", (Channel("x"),), 2 + i % 7, lambda a, b: [np.zeros(b - a)]) for i in range(20_000)]
    began = time.process_time()
    found = group_series("run", series)
    assert time.process_time() - began < 5
    assert len({gathered.group.name for gathered in found}) == 20_000


def test_nothing_outside_is_ever_opened(made, tmp_path):
    """External links, external storage and virtual datasets are left out by name; the secret is in none of them."""
    (tmp_path / "secret.bin").write_bytes(np.full(300, 31337.0).tobytes())
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["secret"] = np.full(300, 424242.0)

    def write(file):
        file["acc"] = TIME
        file["link"] = h5py.ExternalLink("secret.h5", "/secret")
        file["by_soft"] = h5py.SoftLink("/link")
        file.create_dataset("raw", shape=(300,), dtype="f8", external=[("secret.bin", 0, 2400)])
        layout = h5py.VirtualLayout(shape=(300,), dtype="f8")
        layout[:] = h5py.VirtualSource("secret.h5", "secret", shape=(300,))
        file.create_virtual_dataset("virtual", layout)

    found = made(write)
    outside = {f.channel: f.message for f in found.findings if f.code == "outside_reference"}
    assert set(outside) == {"/link", "/by_soft", "/raw", "/virtual"}
    assert "secret.h5:/secret" in outside["/link"]
    assert "secret.bin" in outside["/raw"]
    assert "secret.h5" in outside["/virtual"]
    assert [c.name for c in found.group().channels] == ["acc"]


def test_sizes_that_are_not_there_are_refused(made):
    """A petabyte that was never written, a gigabyte of zeros in a kilobyte, a chunk of gigabytes."""

    def write(file):
        file["acc"] = TIME
        file.create_dataset("petabyte", shape=(1 << 47,), dtype="f8", chunks=(1 << 16,))
        bomb = file.create_dataset("bomb", shape=(1 << 25,), dtype="f8", chunks=(1 << 20,), compression="gzip")
        bomb[:] = 0.0
        file.create_dataset("chunk", shape=(1 << 31,), dtype="u1", chunks=(1 << 31,))
        early = file.create_dataset("late", shape=(1000,), dtype="f8")
        del early

    found = made(write)
    refused = {f.channel: f.code for f in found.findings if f.code in ("too_large", "cut_file")}
    assert refused == {"/petabyte": "too_large", "/bomb": "too_large", "/chunk": "too_large", "/late": "cut_file"}
    assert [c.name for c in found.group().channels] == ["acc"]


def test_objects_are_left_out_by_name(made):
    """Texts, references, arrays of varying length, pictures: nothing of it is unpickled or followed."""

    def write(file):
        file["acc"] = TIME
        file["texts"] = ["a", "b", "c"]
        file.create_dataset("vlen", shape=(3,), dtype=h5py.vlen_dtype("f8"))[0] = [1.0, 2.0]
        file.create_dataset("refs", data=np.array([file["acc"].ref] * 3, dtype=h5py.ref_dtype))
        file["picture"] = np.zeros((4, 5, 6))
        file["title"] = "a text"

    found = made(write)
    for name in ("/texts", "/vlen", "/refs", "/picture"):
        assert name in found.message("left_out")
    assert found.recording.metadata["title"] == "a text"


def test_a_file_without_numbers_is_refused(made):
    """And one whose only datasets lie elsewhere, with the reason."""
    with pytest.raises(RecordingError, match="no array of numbers"):
        made(lambda f: f.create_group("a"))
    with pytest.raises(RecordingError, match="another file"):
        made(lambda f: f.__setitem__("x", h5py.ExternalLink("y.h5", "/z")))


def test_groups_without_end_are_refused(made):
    """A thousand groups, one in the other."""
    with pytest.raises(RecordingError, match="deep"):
        made(lambda f: f.create_dataset("/".join("a" * 200), data=TIME))


@pytest.mark.parametrize("kind", ["f8", "f4", "i2"])
def test_a_missing_value_is_no_number(made, kind):
    """-999 (and -999.9 as float32 has it) that ``missing_value`` names is NaN, and said; all others stay."""
    word = -999 if kind == "i2" else -999.9

    def write(file):
        file["force"] = np.array([1, 2, word, 4] * 5, dtype=kind)
        file["force"].attrs["missing_value"] = word

    found = made(write)
    np.testing.assert_array_equal(found.column("force"), [1, 2, np.nan, 4] * 5)
    assert "missing_value" in found.message("invalid_samples")


def test_unsigned_numbers_in_a_signed_type(made):
    """By ``_Unsigned`` the bytes -1 and -128 are 255 and 128; the scale is of the unsigned number, the fill is raw."""

    def write(file):
        file["raw"] = np.array([0, 127, -128, -1, -2] * 4, dtype="i1")
        file["raw"].attrs.update({"_Unsigned": "true", "scale_factor": 0.5, "_FillValue": np.int8(-2)})

    found = made(write)
    np.testing.assert_array_equal(found.column("raw"), [0, 63.5, 64, 127.5, np.nan] * 4)
    assert "calibration_applied" in found.codes


RECORDS = np.array([(i / 8, i, b"ok") for i in range(20)], dtype=[("F", "f8"), ("n", "i2"), ("state", "S4")])


def test_records_with_texts_keep_their_numbers(made):
    """The fields of numbers are channels; that of texts is left out by name."""
    found = made(lambda file: file.create_dataset("table", data=RECORDS))
    assert found.column("table.F").tolist() == RECORDS["F"].tolist()
    assert found.column("table.n").tolist() == RECORDS["n"].tolist()
    assert "/table.state" in found.message("left_out")


def test_a_refusal_names_what_is_there(made):
    """Records of texts alone are no numbers; the refusal says what the file holds."""
    with pytest.raises(RecordingError, match="it holds /table "):
        made(lambda file: file.create_dataset("table", data=RECORDS[["state"]]))


def test_a_dataset_without_a_value_is_whole(made):
    """HDF5's empty dataset has no samples that could be missing."""

    def write(file):
        file["acc"] = np.arange(20.0)
        file["nothing"] = h5py.Empty("f8")

    assert not [f for f in made(write).findings if f.severity == 2]
