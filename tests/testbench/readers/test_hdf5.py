"""HDF5 of other people: plain, netCDF 4, NeXus, MATLAB 7.3; packed numbers; and files that would lead elsewhere."""

import time
from collections import Counter

import h5netcdf
import h5py
import numpy as np
import pytest

from testbench.readers import hdf5_worker as worker
from testbench.readers.array_grouping import Series, group_series
from testbench.readers.hdf5_worker import Walk
from testbench.recording import Channel, TimeColumn, UniformClock

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

RANDOM = np.random.default_rng(7)
TIME = np.arange(300) / 64
SOFT = h5py.SoftLink


@pytest.fixture
def written(tmp_path):
    """A new file of objects by path: data, links, or data with attributes (a group's alone, its path ending in /)."""

    def write(objects, name="run.h5", **options):
        path = tmp_path / name
        with h5py.File(path, "w", **options) as file:
            for where, content in objects.items():
                data, attributes = content if isinstance(content, tuple) else (content, {})
                if callable(data):
                    data(file, where)
                elif where.endswith("/"):
                    file.create_group(where)
                else:
                    file[where] = data
                for key, value in attributes.items():
                    file[where].attrs[key] = value
        return path

    return write


@pytest.fixture
def made(written):
    """The same, read."""
    return lambda objects, **options: reading.read(written(objects, **options))


def created(**options):
    """A dataset made with options of HDF5."""
    return lambda file, where: file.create_dataset(where, **options)


def test_an_attribute_without_a_value_is_none(made):
    """HDF5 fails to say how large it is; the numbers beside it are read."""
    found = made({"acc": (TIME, {"none": np.empty(0), "units": "m/s2"})})
    assert found.unit("acc") == "m/s2"


def test_content_of_others_may_stand_before(written):
    """The mark of HDF5 may come behind 512 bytes times a power of two, where the file is called so."""
    path = written({"acc": TIME}, userblock_size=32768)
    with path.open("r+b") as file:
        file.write(b"<?xpacket begin='' ?>".ljust(32768))
    np.testing.assert_array_equal(reading.read(path).column("acc"), TIME)


def by_channel(found, code):
    """The messages of the findings of a code by their channel."""
    return {f.channel: f.message for f in found.findings if f.code == code}


def test_groups_lengths_and_times_are_kept_apart(made):
    """Datasets of one group and length belong together; time is what is named so and grows."""
    found = made({
        "daq/fast/time": (TIME, {"units": "s"}), "daq/fast/acc": (np.cos(TIME), {"unit": "m/s^2"}),
        "daq/slow/t": TIME[:20], "daq/slow/force": np.cos(TIME[:20]), "daq/fast/spectrum": np.ones(33),
    })  # fmt: skip
    assert sorted(found.groups) == ["run daq/fast 300", "run daq/fast 33", "run daq/slow"]
    np.testing.assert_array_equal(found.time("run daq/fast 300"), TIME)
    assert found.groups["run daq/slow"].clock == TimeColumn(1, 1.0, assumed=True)
    assert found.unit("acc") == "m/s^2"


@pytest.mark.parametrize("options", [{}, {"chunks": (64, 3)}, {"compression": "gzip", "shuffle": True}])
def test_tables_are_channels_of_their_short_side(made, options):
    """Tall and wide tables, in chunks and packed, and of compound and complex numbers."""
    table = RANDOM.normal(size=(300, 3))
    rows = np.zeros(300, dtype=[("t", "f8"), ("a", "i4"), ("state", "S4")])
    rows["t"], rows["a"] = TIME, np.arange(300)
    found = made(
        {"tall": created(data=table, **options), "wide": table.T, "rows": rows, "frf": table[:, 0] + 1j * TIME}
    )
    for i in range(3):
        np.testing.assert_array_equal(found.column(f"tall[:,{i}]"), table[:, i])
        np.testing.assert_array_equal(found.column(f"wide[{i},:]"), table[:, i])
    np.testing.assert_array_equal(found.column("rows.a"), np.arange(300))
    np.testing.assert_array_equal(found.column("frf (imag)"), TIME)
    assert "/rows.state" in found.message("left_out")


def test_a_stated_rate_is_the_clock(made):
    """An attribute fs or a number beside the data."""
    assert made({"acc": (TIME**2, {"fs": 64.0})}).group().clock == UniformClock(64.0)
    assert made({"acc": TIME**2, "dt": 1 / 64}).group().clock == UniformClock(64.0)


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
    of = {
        name: next(g for g in found.groups.values() if name in [c.name for c in g.channels]) for name in ("acc", "psd")
    }
    assert of["acc"].channels[of["acc"].clock.index].name == "when"
    assert of["acc"].clock.seconds_per_unit == 1.0
    expected = np.where(np.arange(300) == 7, np.nan, np.arange(300) * 0.5 + 10)
    np.testing.assert_array_equal(found.column("acc"), expected)
    assert of["psd"].name != of["acc"].name
    assert of["psd"].clock is None
    assert {"calibration_applied", "invalid_samples"} <= found.codes


def test_nexus_axes_are_the_axes(made):
    """NXdata names its axis, NXlog has time."""
    found = made({
        "entry/data/": (None, {"NX_class": "NXdata", "signal": "force", "axes": ["clock"]}),
        "entry/data/force": np.cos(TIME), "entry/data/clock": (TIME, {"units": "s"}),
        "entry/log/": (None, {"NX_class": "NXlog"}),
        "entry/log/time": (TIME[:9] * 1000, {"units": "ms"}), "entry/log/value": (np.ones(9), {"units": "°C"}),
    })  # fmt: skip
    np.testing.assert_array_equal(found.time("run entry/data"), TIME)
    assert found.groups["run entry/log"].clock == TimeColumn(0, 1e-3)


def test_matlab_variables_are_named_as_in_matlab(written):
    """Structures, texts, cells, empty arrays and turned tables of a file of MATLAB 7.3."""
    table = RANDOM.normal(size=(3, 300))

    def cell(file, where):
        file.create_dataset(where, data=np.array([[file["#refs#/a"].ref]], dtype=h5py.ref_dtype))

    def of(data, kind="double", **more):
        return data, {"MATLAB_class": np.bytes_(kind), **more}

    path = written({
        "x": of(table), "run/t": of(TIME[None, :]), "run/acc": of(np.cos(TIME)[None, :]),
        "note": of(np.array([[ord(c)] for c in "hello"], dtype="u2"), "char"),
        "none": of(np.zeros(2, dtype="u8"), MATLAB_empty=np.uint8(1)),
        "#refs#/a": np.arange(4.0)[None, :], "c": of(cell, "cell"),
    }, "run.mat", userblock_size=512)  # fmt: skip
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + path.read_bytes()[128:])
    found = reading.read(path)
    assert found.recording.format == "MATLAB v7.3"
    np.testing.assert_array_equal(found.column("x(:,2)"), table[1])
    np.testing.assert_array_equal(found.column("run.acc"), np.cos(TIME))
    assert found.column("c{1}").tolist() == [0, 1, 2, 3]
    assert found.recording.metadata["note"] == "hello"
    assert isinstance(found.groups["run run"].clock, TimeColumn)


def test_links_within_the_file_are_met_once(made):
    """A second name of a dataset is no second channel; circles of groups are left out and said."""

    def again(to):
        return lambda file, where: file.__setitem__(where, file[to])

    found = made({
        "a/acc": TIME, "again": again("a/acc"), "a/round": again("a"), "a/soft": SOFT("/a/acc"),
        "a/circle": SOFT("/a"), "a/one": SOFT("/a/two"), "a/two": SOFT("/a/one"), "a/nowhere": SOFT("/b/acc"),
    })  # fmt: skip
    assert [len(columns) for columns in found.data.values()] == [1]
    assert by_channel(found, "cyclic_link").keys() == {"/a/round", "/a/circle", "/a/one", "/a/two"}
    assert by_channel(found, "broken_link").keys() == {"/a/nowhere"}


def test_a_web_of_links_is_one_finding(made):
    """Each of forty groups holds each other and itself: one finding with their number; so are links to nowhere."""

    def web(file, _):
        groups = [file.create_group(f"g{i:02d}") for i in range(40)]
        groups[0]["acc"] = TIME
        for group in groups:
            for i, other in enumerate(groups):
                group[f"to{i:02d}"] = other
            group["nowhere"] = SOFT("/b/acc")

    found = made({"web": web})
    assert [len(columns) for columns in found.data.values()] == [1]
    counts = Counter(f.code for f in found.findings)
    assert counts["cyclic_link"] == counts["broken_link"] == 1
    assert "and 39 more links like it, such as /g00/to01/" in found.message("broken_link")
    # the groups lie one in the other, g00 outermost: the one at depth i leads back to itself and the i above it
    assert f"and {40 * 41 // 2 - 1} more links" in found.message("cyclic_link")


def test_the_objects_are_gone_through_once(made, monkeypatch):
    """Opening and reading of hundreds of datasets: one walk, attributes asked once each, and values to the bit."""
    walks, asked = [], Counter()
    walk, ask = Walk.datasets, worker.attributes
    monkeypatch.setattr(Walk, "datasets", lambda self: walks.append(self) or walk(self))
    monkeypatch.setattr(worker, "attributes", lambda node: asked.update([node.name]) or ask(node))
    values = RANDOM.normal(size=(300, 5))  # more than are kept open at once
    found = made({f"g{i % 150}/c{i}": row for i, row in enumerate(values)})
    assert len(walks) == 1
    assert set(asked.values()) == {1}
    assert len(found.groups) == 150
    for i, row in enumerate(values):
        np.testing.assert_array_equal(found.column(f"c{i}", f"run g{i % 150}"), row)


def test_twenty_thousand_places_are_gathered_in_one_go():
    """Names of groups do not compare each place with each other: seconds, where it took minutes."""
    series = [Series(f"g{i}", (Channel("x"),), 2 + i % 7, lambda a, b: [np.zeros(b - a)]) for i in range(20_000)]
    began = time.process_time()
    found = [group for group, _ in group_series("run", series)]
    assert time.process_time() - began < 5
    assert len({group.name for group in found}) == 20_000


def test_nothing_outside_is_ever_opened(made, tmp_path):
    """External links, external storage and virtual datasets are left out by name; the secret is in none of them."""
    (tmp_path / "secret.bin").write_bytes(np.full(300, 31337.0).tobytes())
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["secret"] = np.full(300, 424242.0)
    layout = h5py.VirtualLayout(shape=(300,), dtype="f8")
    layout[:] = h5py.VirtualSource("secret.h5", "secret", shape=(300,))
    found = made({
        "acc": TIME, "link": h5py.ExternalLink("secret.h5", "/secret"), "by_soft": SOFT("/link"),
        "raw": created(shape=(300,), dtype="f8", external=[("secret.bin", 0, 2400)]),
        "virtual": lambda file, where: file.create_virtual_dataset(where, layout),
    })  # fmt: skip
    outside = by_channel(found, "outside_reference")
    assert set(outside) == {"/link", "/by_soft", "/raw", "/virtual"}
    for where, name in (("/link", "secret.h5:/secret"), ("/raw", "secret.bin"), ("/virtual", "secret.h5")):
        assert name in outside[where]
    assert [c.name for c in found.group().channels] == ["acc"]


def test_sizes_that_are_not_there_are_refused(made):
    """A petabyte that was never written, a gigabyte of zeros in a kilobyte, a chunk of gigabytes."""
    found = made({
        "acc": TIME, "petabyte": created(shape=(1 << 47,), dtype="f8", chunks=(1 << 16,)),
        "bomb": created(data=np.zeros(9 << 20), chunks=(1 << 20,), compression="gzip"),
        "chunk": created(shape=(1 << 31,), dtype="u1", chunks=(1 << 31,)), "late": created(shape=(1000,), dtype="f8"),
        "missing": created(shape=(1000,), dtype="f8", fillvalue=9.96921e36),
    })  # fmt: skip
    assert by_channel(found, "too_large").keys() == {"/petabyte", "/bomb", "/chunk"}
    assert by_channel(found, "cut_file").keys() == {"/late"}
    assert "all are its fill value" in by_channel(found, "left_out")["/missing"]
    assert [c.name for c in found.group().channels] == ["acc"]


def test_arrays_of_texts_are_kept(made):
    """Of fixed and of varying length, beside the numbers of their place and length, else for themselves."""
    words = ["wait", "läuft", "läuft", "off"]
    found = made({
        "daq/a": np.arange(4.0), "daq/state": words, "log": ["began", "ended"],
        "daq/code": np.array([word.encode() for word in words]),
    })  # fmt: skip
    kept = {text.channel: text for text in found.recording.texts.kept}
    for name in ("state", "code"):
        assert kept[name].group == found.recording.groups[0].name
        assert (kept[name].samples, kept[name].texts) == ([0, 1, 3], ["wait", "läuft", "off"])
    assert kept["log"].texts == ["began", "ended"]
    assert {finding.channel for finding in found.findings if finding.code == "text_kept"} == {"state", "code", "log"}


def test_objects_are_left_out_by_name(made):
    """References, arrays of varying length, pictures: nothing of it is unpickled or followed; Empty is whole."""

    def references(file, where):
        file.create_dataset(where, data=np.array([file["acc"].ref] * 3, dtype=h5py.ref_dtype))

    found = made({
        "acc": TIME, "texts": [["a", "b"]] * 2, "title": "a text", "picture": np.zeros((4, 5, 6)), "refs": references,
        "vlen": lambda file, where: file.create_dataset(where, (3,), h5py.vlen_dtype("f8")).__setitem__(0, [1.0, 2.0]),
        "nothing": h5py.Empty("f8"),
    })  # fmt: skip
    for name in ("/texts", "/vlen", "/refs", "/picture"):
        assert name in found.message("left_out")
    assert found.recording.metadata["title"] == "a text"
    assert not [f for f in found.findings if f.severity == 2]


@pytest.mark.parametrize(
    ("objects", "message"),
    [
        ({"a/": None}, "no array of numbers"),
        ({"x": h5py.ExternalLink("y.h5", "/z")}, "another file"),
        ({"/".join("a" * 200): TIME}, "deep"),
        ({"table": np.array([(b"ok",)] * 20, dtype=[("state", "S4")])}, "it holds /table "),
    ],
)
def test_a_file_without_numbers_is_refused(written, objects, message):
    """With the reason: nothing in it, data elsewhere, groups without end, texts alone."""
    assert message in reading.said(written(objects))


@pytest.mark.parametrize("kind", ["f8", "f4", "i2"])
def test_a_missing_value_is_no_number(made, kind):
    """-999 (and -999.9 as float32 has it) that ``missing_value`` names is NaN, and said; all others stay."""
    word = -999 if kind == "i2" else -999.9
    found = made({"force": (np.array([1, 2, word, 4] * 5, dtype=kind), {"missing_value": word})})
    np.testing.assert_array_equal(found.column("force"), [1, 2, np.nan, 4] * 5)
    assert "missing_value" in found.message("invalid_samples")


def test_unsigned_numbers_in_a_signed_type(made):
    """By ``_Unsigned`` the bytes -1 and -128 are 255 and 128; the scale is of the unsigned number, the fill is raw."""
    packing = {"_Unsigned": "true", "scale_factor": 0.5, "_FillValue": np.int8(-2)}
    found = made({"raw": (np.array([0, 127, -128, -1, -2] * 4, dtype="i1"), packing)})
    np.testing.assert_array_equal(found.column("raw"), [0, 63.5, 64, 127.5, np.nan] * 4)
    assert "calibration_applied" in found.codes
