"""NI TDMS, written by npTDMS and byte by byte; properties that change in the midst of the samples."""

import struct

import nptdms
import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

from testbench.errors import RecordingError
from testbench.recording import TimeColumn, UniformClock

from . import examples, reading

RANDOM = np.random.default_rng(9)
METADATA, NEW_LIST, RAW, INTERLEAVED, BIG_ENDIAN, DAQMX = (1 << i for i in (1, 2, 3, 5, 6, 7))


def _write(tmp_path, *segments):
    path = tmp_path / "run.tdms"
    with TdmsWriter(path) as writer:
        for objects in segments:
            writer.write_segment(objects)
    return path


def _channel(name, data, group="DAQ", **properties):
    return ChannelObject(group, name, data, properties)


def _segment(flags, objects, raw, order="<", size=None):
    """A segment of objects (path, index bytes, properties bytes)."""
    metadata = struct.pack(f"{order}I", len(objects))
    for path, index, properties in objects:
        metadata += struct.pack(f"{order}I", len(path)) + path.encode() + index + properties
    total = len(metadata) + len(raw) if size is None else size
    return struct.pack("<4sI", b"TDSm", flags) + struct.pack(f"{order}I2Q", 4713, total, len(metadata)) + metadata + raw


def _index(kind, count, order="<"):
    return struct.pack(f"{order}IIIQ", 20, kind, 1, count)


NONE = struct.pack("<I", 0)


def test_units_clock_and_properties_are_as_written(tmp_path):
    """unit_string and wf_increment; the rest is metadata by path."""
    wave = {"wf_increment": 1 / 5120, "wf_start_offset": 0.5, "wf_start_time": np.datetime64("2026-11-21", "us")}
    path = _write(tmp_path, [
        RootObject({"operator": "JS"}), GroupObject("DAQ", {"rig": "arm"}),
        _channel("Load.Cell 'A'/1", np.arange(20.0), unit_string="N", **wave),
    ])  # fmt: skip
    found = reading.read(path)
    assert found.unit("Load.Cell 'A'/1") == "N"
    assert found.group().clock == UniformClock(5120.0, 0.5)
    assert found.recording.metadata["operator"] == "JS"
    assert found.recording.metadata["DAQ: rig"] == "arm"


def test_a_clock_of_a_5120th_of_a_second_does_not_drift():
    """After ten hours, sample 184320000 is at 36000 s to the last digit."""
    clock = UniformClock(1.0 / (1 / 5120), 0.0)
    assert clock.start_s + 5120 * 36000 / clock.rate_hz == 36000.0


def test_lengths_and_steps_are_groups_of_their_own(tmp_path):
    """A slow and a fast channel of one TDMS group are two groups."""
    path = _write(tmp_path, [
        _channel("fast", np.arange(100.0), wf_increment=0.001), _channel("slow", np.arange(10.0), wf_increment=0.01),
        _channel("other", np.arange(10.0), group="Second"),
    ])  # fmt: skip
    found = reading.read(path)
    assert {n: g.clock and g.clock.rate_hz for n, g in found.groups.items()} == {
        "DAQ fast": 1000.0,
        "DAQ slow": 100.0,
        "Second": None,
    }


def _stamps(tmp_path, fractions):
    """A file of timestamps at 2026-11-21 plus fractions of 2**-64 s, and a channel beside them."""
    raw = b"".join(struct.pack("<Qq", f % 2**64, 2082844800 + 1795248000 + f // 2**64) for f in fractions)
    raw += np.arange(float(len(fractions))).tobytes()
    objects = [("/'g'/'Time'", _index(0x44, len(fractions)), NONE), ("/'g'/'a'", _index(10, len(fractions)), NONE)]
    path = tmp_path / "run.tdms"
    path.write_bytes(_segment(METADATA | NEW_LIST | RAW, objects, raw))
    return reading.read(path)


def test_timestamps_are_the_clock(tmp_path):
    """A channel of timestamps is time since 1970; to the microsecond as it was written, nothing is left over."""
    stamps = np.datetime64("2026-11-21T08:00:00", "us") + np.arange(50) * np.timedelta64(1 << 17, "us")
    found = reading.read(_write(tmp_path, [_channel("Time", stamps), _channel("a", np.arange(50.0))]))
    assert found.group().clock == TimeColumn(0, 1.0)
    assert found.time()[0] == 1795248000


@pytest.mark.parametrize("step", [1 / 51200, 0.01, 0.9999999999])
def test_timestamps_are_kept_to_their_last_bit(tmp_path, step):
    """Seconds and their remainder give the integers of the file back, however close the stamps are."""
    fractions = [int(i * step * 2**64) + 12345 for i in range(200)]
    found = _stamps(tmp_path, fractions)
    seconds, rest = found.column("Time"), found.column("Time remainder")
    back = [int(float(s) - 1795248000) * 2**64 + int((float(s) % 1) * 2**64) for s in seconds]
    assert [b + int(float(r) * 2**64) for b, r in zip(back, rest, strict=True)] == fractions
    assert np.abs(rest).max() < (1e-6 if step > 1e-4 else 2.4e-7)
    assert "'Time remainder'" in found.message("time_resolution")


def test_scales_make_physical_values(tmp_path):
    """Linear and polynomial scales in a chain, as npTDMS computes them."""
    scales = {
        "NI_Number_Of_Scales": 2, "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": "Polynomial", "NI_Scale[0]_Polynomial_Coefficients_Size": 3,
        "NI_Scale[0]_Polynomial_Coefficients[0]": 0.5, "NI_Scale[0]_Polynomial_Coefficients[1]": 0.01,
        "NI_Scale[0]_Polynomial_Coefficients[2]": 1e-4, "NI_Scale[0]_Polynomial_Input_Source": 0xFFFFFFFF,
        "NI_Scale[1]_Scale_Type": "Linear", "NI_Scale[1]_Linear_Slope": 2.0, "NI_Scale[1]_Linear_Y_Intercept": 1.0,
        "NI_Scale[1]_Linear_Input_Source": 0,
    }  # fmt: skip
    path = _write(tmp_path, [_channel("a", np.arange(10, dtype="i2"), **scales)])
    found = reading.read(path)
    np.testing.assert_allclose(found.column("a"), TdmsFile.read(path)["DAQ"]["a"][:], rtol=1e-15)
    assert found.column("a")[2] == pytest.approx(2 * (0.5 + 0.02 + 4e-4) + 1)
    assert "calibration_applied" in found.codes


def test_a_table_scale_is_left_to_the_library(tmp_path):
    """Laws that are not ours are npTDMS's; one that is not known is refused."""
    scales = {
        "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Table", "NI_Scale[0]_Table_Input_Source": 0xFFFFFFFF,
        "NI_Scale[0]_Table_Scaled_Values_Size": 2, "NI_Scale[0]_Table_Scaled_Values[0]": 0.0,
        "NI_Scale[0]_Table_Scaled_Values[1]": 10.0, "NI_Scale[0]_Table_Pre_Scaled_Values_Size": 2,
        "NI_Scale[0]_Table_Pre_Scaled_Values[0]": 0.0, "NI_Scale[0]_Table_Pre_Scaled_Values[1]": 5.0,
    }  # fmt: skip
    path = _write(tmp_path, [_channel("a", np.arange(5.0), **scales)])
    np.testing.assert_array_equal(reading.read(path).column("a"), TdmsFile.read(path)["DAQ"]["a"][:])
    path = _write(tmp_path, [_channel("a", np.arange(5.0), **scales | {"NI_Scale[0]_Scale_Type": "Magic"})])
    with pytest.raises(RecordingError, match="Magic"):
        reading.read(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_interleaved_data_of_either_byte_order(tmp_path, order):
    """Rows of a double and an integer, many segments without metadata of their own."""
    flags = METADATA | NEW_LIST | RAW | INTERLEAVED | (BIG_ENDIAN if order == ">" else 0)
    rows = np.zeros(6, dtype=[("a", f"{order}f8"), ("b", f"{order}i2")])
    rows["a"], rows["b"] = np.arange(6) / 4, np.arange(6) * 3
    objects = [("/'g'/'a'", _index(10, 6, order), NONE), ("/'g'/'b'", _index(2, 6, order), NONE)]
    first = _segment(flags, objects, rows.tobytes(), order)
    more = struct.pack("<4sI", b"TDSm", flags & ~(METADATA | NEW_LIST))
    more += struct.pack(f"{order}I2Q", 4713, 60, 0) + rows.tobytes()
    path = tmp_path / "run.tdms"
    path.write_bytes(first + more * 3)
    found = reading.read(path)
    assert found.column("a").tolist() == [i / 4 for i in range(6)] * 4
    assert found.column("b").tolist() == [3 * i for i in range(6)] * 4
    np.testing.assert_array_equal(found.column("b"), nptdms.TdmsFile.read(path)["g"]["b"][:])


def test_chunks_repeat_within_a_segment(tmp_path):
    """Raw data of several times the declared size are several chunks."""
    raw = b"".join(np.array([i, i + 0.5, -i], dtype="<f8").tobytes() for i in range(5))
    objects = [("/'g'/'a'", _index(10, 2), NONE), ("/'g'/'b'", _index(10, 1), NONE)]
    path = tmp_path / "run.tdms"
    path.write_bytes(_segment(METADATA | NEW_LIST | RAW, objects, raw))
    found = reading.read(path)
    assert found.column("a").tolist() == [x for i in range(5) for x in (i, i + 0.5)]
    assert found.column("b").tolist() == [-i for i in range(5)]


def test_daqmx_rows_are_scaled(tmp_path):
    """Two channels in one buffer of 16-bit numbers, each with a linear scale of its own."""

    def index(offset):
        scaler = struct.pack("<5I", 3, 0, offset, 0, 0)
        return struct.pack("<IIIQI", 0x1269, 0xFFFFFFFF, 1, 4, 1) + scaler + struct.pack("<II", 1, 4)

    def properties(slope):
        said = {"NI_Number_Of_Scales": 2, "NI_Scale[1]_Linear_Input_Source": 0}
        texts = {"NI_Scale[1]_Scale_Type": "Linear", "NI_Scaling_Status": "unscaled"}
        numbers = {"NI_Scale[1]_Linear_Slope": slope, "NI_Scale[1]_Linear_Y_Intercept": 10.0}
        raw = struct.pack("<I", len(said) + len(texts) + len(numbers))
        for name, value in (said | texts | numbers).items():
            raw += struct.pack("<I", len(name)) + name.encode()
            if isinstance(value, str):
                raw += struct.pack("<II", 0x20, len(value)) + value.encode()
            else:
                raw += struct.pack("<II", 7, value) if isinstance(value, int) else struct.pack("<Id", 10, value)
        return raw

    rows = np.array([[1, -1], [2, -2], [3, -3], [4, -4]], dtype="<i2")
    objects = [("/'g'/'a'", index(0), properties(0.5)), ("/'g'/'b'", index(2), properties(2.0))]
    path = tmp_path / "run.tdms"
    path.write_bytes(_segment(METADATA | NEW_LIST | RAW | INTERLEAVED | DAQMX, objects, rows.tobytes() * 2))
    found = reading.read(path)
    assert found.column("a").tolist() == [10.5, 11.0, 11.5, 12.0] * 2
    assert found.column("b").tolist() == [8.0, 6.0, 4.0, 2.0] * 2
    np.testing.assert_array_equal(found.column("b"), nptdms.TdmsFile.read(path)["g"]["b"][:])


def test_texts_and_empty_channels_are_said(tmp_path):
    """Text is not kept as data; a channel without samples is no group."""
    path = _write(
        tmp_path, [_channel("note", ["one", "two"]), _channel("a", np.arange(3.0)), _channel("none", np.empty(0))]
    )
    found = reading.read(path)
    assert list(found.groups) == ["DAQ"]
    assert {"text_channel", "empty_group"} <= found.codes


@pytest.mark.parametrize("cut", [3, 30, 60, 200])
def test_a_cut_file_says_where_and_how_many(tmp_path, cut):
    """The segment, the channels and their samples; those of whole segments can be had by one who accepts it."""
    path = _write(tmp_path, *([_channel("a", np.arange(10.0) + i), _channel("b", np.arange(10.0))] for i in range(5)))
    path.write_bytes(path.read_bytes()[:-cut])
    found = reading.read(path)
    message = found.message("cut_file")
    assert "inside segment 5" in message
    assert "a 40" in message
    assert len(found.column("a")) == len(found.column("b")) == 40


def test_a_file_that_was_never_finished_is_said(tmp_path):
    """A writer that crashed leaves its last segment without a length."""
    path = _write(tmp_path, [_channel("a", np.arange(10.0))])
    raw = bytearray(path.read_bytes())
    raw[12:20] = b"\xff" * 8
    path.write_bytes(raw)
    found = reading.read(path)
    assert "never finished" in found.message("cut_file")
    assert len(found.column("a")) == 10


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (_segment(METADATA | NEW_LIST | RAW, [("/'g'/'a'", struct.pack("<I", 0), NONE)], b""), "nothing before"),
        (_segment(METADATA | NEW_LIST | RAW, [("/'g'/'a'", _index(77, 1), NONE)], bytes(8)), "type 0x4d"),
        (_segment(METADATA, [("/'g'/'a'", _index(10, 1), struct.pack("<I", 1 << 31))], b""), "end inside"),
        (_segment(METADATA, [], b"") + b"TDSx" + bytes(24), "expected the next segment"),
        (b"TDSh" + bytes(24), "give the .tdms file"),
    ],
)
def test_what_contradicts_itself_is_refused(tmp_path, raw, said):
    """The refusal says what is wrong."""
    path = tmp_path / "run.tdms"
    path.write_bytes(raw)
    with pytest.raises(RecordingError, match=said):
        reading.read(path)


def test_declared_petabytes_are_not_believed(tmp_path):
    """A segment that declares more values than a file can hold is cut, and nothing is allocated for it."""
    objects = [("/'g'/'a'", _index(10, 1 << 50), NONE)]
    path = tmp_path / "run.tdms"
    path.write_bytes(_segment(METADATA | NEW_LIST | RAW, objects, bytes(80), size=1 << 53))
    with pytest.raises(RecordingError, match="a 0 of 1125899906842624 declared"):
        reading.read(path)


def test_metadata_repeated_and_changed_and_repeated(tmp_path):
    """Segments that say the same again add samples; a change between them counts from where it stands."""
    parts = [("a", 3, "V"), ("a", 3, "V"), ("a", 5, "V"), ("a", 5, "V"), ("b", 4, "A"), ("a", 5, "mV"), ("a", 5, "mV")]
    segments = [[_channel(name, RANDOM.normal(size=count), unit_string=unit)] for name, count, unit in parts]
    found = reading.read(_write(tmp_path, *segments))
    for name in "ab":
        written = np.concatenate([s[0].data for s, part in zip(segments, parts, strict=True) if part[0] == name])
        assert found.column(name).tobytes() == written.tobytes()
    units = {channel.name: channel.unit for group in found.recording.groups for channel in group.channels}
    assert units == {"a": "mV", "b": "A"}


@pytest.mark.parametrize("name", ["run.tdms", pytest.param("01_loadcell_wagon55.tdms", marks=pytest.mark.recordings)])
def test_nptdms_gives_the_same_numbers(tmp_path, name):
    """The public recording and one of several kinds: each sample of each channel of numbers, bit for bit."""
    path = examples.make(tmp_path, name) if name in examples.ALL else reading.real(name)
    found = reading.read(path)
    channels = {channel.name: channel[:] for group in TdmsFile.read(path).groups() for channel in group.channels()}
    of_numbers = {channel: values for channel, values in channels.items() if values.dtype.kind == "f"}
    for channel, values in of_numbers.items():
        np.testing.assert_array_equal(found.column(channel), values)
    assert len(of_numbers) >= 2


EIGHTHS = np.arange(50) / 8


def changed(tmp_path, *segments):
    """A file of one channel, a pair of samples and properties for each segment."""
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        for values, properties in segments:
            writer.write_segment([ChannelObject("DAQ", "x", values, properties)])
    return reading.read(tmp_path / "run.tdms")


def test_another_step_in_the_midst_of_samples_leaves_no_rate(tmp_path):
    """Half the samples at 1 kHz and half at 500 Hz have no one rate: said with both and where, and none is taken."""
    found = changed(tmp_path, (EIGHTHS, {"wf_increment": 0.001}), (EIGHTHS, {"wf_increment": 0.002}))
    assert found.group().clock is None
    assert "0.001 up to sample 50 and 0.002" in found.message("header_contradiction")
    assert found.column("x").tolist() == [*EIGHTHS, *EIGHTHS]


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("unit_string", "N", "kN"),
        ("wf_start_time", np.datetime64("2024-01-01T00:00:00"), np.datetime64("2024-01-01T00:01:00")),
    ],
)
def test_another_unit_or_start_is_said(tmp_path, name, before, after):
    """By the format the last one holds for all samples; that another one stood before is a warning."""
    rate = {"wf_increment": 0.001}
    found = changed(tmp_path, (EIGHTHS, {name: before, **rate}), (EIGHTHS, {name: after, **rate}))
    (finding,) = [f for f in found.findings if f.code == "header_contradiction"]
    assert (finding.channel, finding.where) == ("x", "sample 50")
    assert str(finding.message).startswith(f"{name} is ")
    assert found.group().clock.rate_hz == 1000.0


@pytest.mark.parametrize(
    ("axis", "rate_hz"),
    [
        ({}, 8.0), ({"wf_xname": "Time"}, 8.0), ({"wf_xname": "Zeit", "wf_xunit_string": "s"}, 8.0),
        ({"wf_xname": "Time", "wf_xunit_string": "ms"}, 8000.0), ({"wf_xname": "Frequency"}, None),
        ({"wf_xname": "Frequency", "wf_xunit_string": "Hz"}, None), ({"wf_xunit_string": "blorp"}, None),
    ],
)  # fmt: skip
def test_a_step_is_one_of_time_in_its_unit(tmp_path, axis, rate_hz):
    """1/8 of an abscissa is 8 Hz of seconds, 8 kHz of milliseconds, and no rate of anything else."""
    found = changed(tmp_path, (EIGHTHS, {"wf_increment": 0.125, **axis}))
    clock = found.group().clock
    assert (None if clock is None else clock.rate_hz) == rate_hz


def test_a_correction_behind_the_samples_is_no_contradiction(tmp_path):
    """A property that is written anew once all samples are there is that of all of them; so is one said twice alike."""
    first = {"unit_string": "N", "wf_increment": 0.001}
    found = changed(tmp_path, (EIGHTHS, first), (EIGHTHS, first), (EIGHTHS[:0], {"unit_string": "kN"}))
    assert found.unit("x") == "kN"
    assert "header_contradiction" not in found.codes


@pytest.mark.parametrize(("is_interleaved", "unit"), [(True, "rows of 12 bytes"), (False, "chunks of 60 bytes")])
def test_bytes_behind_whole_chunks_are_an_error(tmp_path, is_interleaved, unit):
    """Three bytes more than whole rows or chunks are a part of samples that is not read, and said to be."""
    metadata = struct.pack("<I", 2)
    for path, kind in (("/'g'/'a'", 3), ("/'g'/'b'", 10)):
        metadata += struct.pack("<I", len(path)) + path.encode() + struct.pack("<IIIQI", 20, kind, 1, 5, 0)
    flags, raw = 0b1110 | (is_interleaved << 5), bytes(60)
    for behind in (b"", b"abc"):
        sizes = struct.pack("<I2Q", 4713, len(metadata) + len(raw + behind), len(metadata))
        path = tmp_path / "run.tdms"
        path.write_bytes(b"TDSm" + struct.pack("<I", flags) + sizes + metadata + raw + behind)
        found = reading.read(path)
        assert len(found.column("a")) == len(found.column("b")) == 5
        assert ("count_contradiction" in found.codes) == bool(behind)
    assert f"3 bytes behind its whole {unit}" in found.message("count_contradiction")
