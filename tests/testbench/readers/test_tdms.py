"""NI TDMS, written by npTDMS and byte by byte; properties that change in the midst of the samples."""

import struct
from itertools import repeat

import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

from testbench.recording import TimeColumn, UniformClock

from . import examples, reading

RANDOM = np.random.default_rng(9)
METADATA, NEW_LIST, RAW, INTERLEAVED, BIG_ENDIAN, DAQMX = (1 << i for i in (1, 2, 3, 5, 6, 7))
NEW = METADATA | NEW_LIST | RAW
NONE = struct.pack("<I", 0)


def write(tmp_path, *segments):
    """A file by npTDMS."""
    path = tmp_path / "run.tdms"
    with TdmsWriter(path) as writer:
        for objects in segments:
            writer.write_segment(objects)
    return path


def channel(name, data, group="DAQ", **properties):
    """A channel with properties."""
    return ChannelObject(group, name, data, properties)


def segment(flags, objects, raw, order="<", size=None):
    """A segment of objects (path, index bytes, properties bytes), byte by byte."""
    metadata = struct.pack(f"{order}I", len(objects)) if flags & METADATA else b""
    for path, index, properties in objects:
        metadata += struct.pack(f"{order}I", len(path)) + path.encode() + index + properties
    total = len(metadata) + len(raw) if size is None else size
    return struct.pack("<4sI", b"TDSm", flags) + struct.pack(f"{order}I2Q", 4713, total, len(metadata)) + metadata + raw


def numbers(*kinds, count, order="<"):
    """Objects a, b, ... of so many numbers of these types."""
    index = (struct.pack(f"{order}IIIQ", 20, kind, 1, count) for kind in kinds)
    return list(zip((f"/'g'/'{letter}'" for letter in "abc"), index, repeat(NONE)))


@pytest.fixture
def of_bytes(tmp_path):
    """A file of these bytes."""

    def write_bytes(raw):
        (tmp_path / "run.tdms").write_bytes(raw)
        return tmp_path / "run.tdms"

    return write_bytes


def test_units_clock_and_properties_are_as_written(tmp_path):
    """unit_string and wf_increment; the rest is metadata by path."""
    wave = {"wf_increment": 1 / 5120, "wf_start_offset": 0.5, "wf_start_time": np.datetime64("2026-11-21", "us")}
    found = reading.read(write(tmp_path, [
        RootObject({"operator": "JS"}), GroupObject("DAQ", {"rig": "arm"}),
        channel("Load.Cell 'A'/1", np.arange(20.0), unit_string="N", **wave),
    ]))  # fmt: skip
    assert found.unit("Load.Cell 'A'/1") == "N"
    assert found.group().clock == UniformClock(5120.0, 0.5)
    assert (found.recording.metadata["operator"], found.recording.metadata["DAQ: rig"]) == ("JS", "arm")


def test_lengths_and_steps_are_groups_of_their_own(tmp_path):
    """A slow and a fast channel of one TDMS group are two groups; texts and channels without samples are none."""
    found = reading.read(write(tmp_path, [
        channel("fast", np.arange(100.0), wf_increment=0.001), channel("slow", np.arange(10.0), wf_increment=0.01),
        channel("other", np.arange(10.0), "Second"), channel("note", ["one", "two"]), channel("none", np.empty(0)),
    ]))  # fmt: skip
    rates = {n: g.clock and g.clock.rate_hz for n, g in found.groups.items()}
    assert rates == {"DAQ fast": 1000.0, "DAQ slow": 100.0, "Second": None}
    assert {"text_kept", "empty_group"} <= found.codes


@pytest.mark.parametrize("behind", [0, 5])
def test_texts_are_as_nptdms_has_them(tmp_path, behind):
    """Of several segments and chunks, beside numbers, each with the sample from which on it stands; cut in the last."""
    words = [["on", "on", "LOST µ"], ["", "off", "off"], ["off", "x", "x"]]
    path = write(tmp_path, *([channel("a", np.arange(3.0)), channel("state", each)] for each in words))
    expected = [str(text) for text in TdmsFile.read(path)["DAQ"]["state"][:]]
    path.write_bytes(path.read_bytes()[: -behind or None])
    (series,) = reading.read(path).recording.texts.kept
    assert (series.group, series.channel) == ("DAQ", "state")
    kept = dict(zip(series.samples, series.texts, strict=True))
    whole = expected[: 6 if behind else 9]
    changes = {i: text for i, text in enumerate(whole) if not i or text != whole[i - 1]}
    assert kept == changes


def test_timestamps_are_the_clock(tmp_path):
    """A channel of timestamps is time since 1970; to the microsecond as it was written, nothing is left over."""
    stamps = np.datetime64("2026-11-21T08:00:00", "us") + np.arange(50) * np.timedelta64(1 << 17, "us")
    found = reading.read(write(tmp_path, [channel("Time", stamps), channel("a", np.arange(50.0))]))
    assert found.group().clock == TimeColumn(0, 1.0)
    assert found.time()[0] == 1795248000


@pytest.mark.parametrize("step", [1 / 51200, 0.01, 0.9999999999])
def test_timestamps_are_kept_to_their_last_bit(of_bytes, step):
    """Seconds and their remainder give the integers of the file back, however close the stamps are."""
    fractions = [int(i * step * 2**64) + 12345 for i in range(200)]
    raw = b"".join(struct.pack("<Qq", f % 2**64, 2082844800 + 1795248000 + f // 2**64) for f in fractions)
    objects = [(path.replace("a", "Time"), *rest) for path, *rest in numbers(0x44, count=200)]
    found = reading.read(of_bytes(segment(NEW, objects, raw)))
    seconds, rest = found.column("Time"), found.column("Time remainder")
    back = [int(float(s) - 1795248000) * 2**64 + int((float(s) % 1) * 2**64) for s in seconds]
    assert [b + int(float(r) * 2**64) for b, r in zip(back, rest, strict=True)] == fractions
    assert np.abs(rest).max() < (1e-6 if step > 1e-4 else 2.4e-7)
    assert "'Time remainder'" in found.message("time_resolution")


CHAIN = {
    "NI_Number_Of_Scales": 2, "NI_Scaling_Status": "unscaled",
    "NI_Scale[0]_Scale_Type": "Polynomial", "NI_Scale[0]_Polynomial_Coefficients_Size": 3,
    "NI_Scale[0]_Polynomial_Coefficients[0]": 0.5, "NI_Scale[0]_Polynomial_Coefficients[1]": 0.01,
    "NI_Scale[0]_Polynomial_Coefficients[2]": 1e-4, "NI_Scale[0]_Polynomial_Input_Source": 0xFFFFFFFF,
    "NI_Scale[1]_Scale_Type": "Linear", "NI_Scale[1]_Linear_Slope": 2.0, "NI_Scale[1]_Linear_Y_Intercept": 1.0,
    "NI_Scale[1]_Linear_Input_Source": 0,
}  # fmt: skip
TABLE = {
    "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Table", "NI_Scale[0]_Table_Input_Source": 0xFFFFFFFF,
    "NI_Scale[0]_Table_Scaled_Values_Size": 2, "NI_Scale[0]_Table_Scaled_Values[0]": 0.0,
    "NI_Scale[0]_Table_Scaled_Values[1]": 10.0, "NI_Scale[0]_Table_Pre_Scaled_Values_Size": 2,
    "NI_Scale[0]_Table_Pre_Scaled_Values[0]": 0.0, "NI_Scale[0]_Table_Pre_Scaled_Values[1]": 5.0,
}  # fmt: skip


def test_scales_make_physical_values(tmp_path):
    """Linear and polynomial scales in a chain, and a table by npTDMS; a law that nobody knows is refused."""
    for scales, third in ((CHAIN, 2 * (0.5 + 0.02 + 4e-4) + 1), (TABLE, 4.0)):
        path = write(tmp_path, [channel("a", np.arange(5, dtype="i2"), **scales)])
        found = reading.read(path)
        np.testing.assert_allclose(found.column("a"), TdmsFile.read(path)["DAQ"]["a"][:], rtol=1e-15)
        assert found.column("a")[2] == pytest.approx(third)
        assert "calibration_applied" in found.codes
    unknown = TABLE | {"NI_Scale[0]_Scale_Type": "Magic"}
    assert "Magic" in reading.said(write(tmp_path, [channel("a", np.arange(5.0), **unknown)]))


@pytest.mark.parametrize("order", ["<", ">"])
def test_interleaved_data_of_either_byte_order(of_bytes, order):
    """Rows of a double and an integer, many segments without metadata of their own."""
    flags = NEW | INTERLEAVED | (BIG_ENDIAN if order == ">" else 0)
    rows = np.zeros(6, dtype=[("a", f"{order}f8"), ("b", f"{order}i2")])
    rows["a"], rows["b"] = np.arange(6) / 4, np.arange(6) * 3
    first = segment(flags, numbers(10, 2, count=6, order=order), rows.tobytes(), order)
    path = of_bytes(first + segment(flags & ~(METADATA | NEW_LIST), [], rows.tobytes(), order) * 3)
    found = reading.read(path)
    assert found.column("a").tolist() == [i / 4 for i in range(6)] * 4
    np.testing.assert_array_equal(found.column("b"), TdmsFile.read(path)["g"]["b"][:])


def test_chunks_repeat_within_a_segment(of_bytes):
    """Raw data of several times the declared size are several chunks."""
    raw = b"".join(np.array([i, i + 0.5, -i], dtype="<f8").tobytes() for i in range(5))
    found = reading.read(of_bytes(segment(NEW, [numbers(10, count=2)[0], numbers(10, 10, count=1)[1]], raw)))
    assert found.column("a").tolist() == [x for i in range(5) for x in (i, i + 0.5)]
    assert found.column("b").tolist() == [-i for i in range(5)]


def test_daqmx_rows_are_scaled(of_bytes):
    """Two channels in one buffer of 16-bit numbers, each with a linear scale of its own."""

    def index(offset):
        scaler = struct.pack("<5I", 3, 0, offset, 0, 0)
        return struct.pack("<IIIQI", 0x1269, 0xFFFFFFFF, 1, 4, 1) + scaler + struct.pack("<II", 1, 4)

    def properties(slope):
        stated = {
            "NI_Number_Of_Scales": 2, "NI_Scale[1]_Linear_Input_Source": 0, "NI_Scale[1]_Scale_Type": "Linear",
            "NI_Scaling_Status": "unscaled", "NI_Scale[1]_Linear_Slope": slope, "NI_Scale[1]_Linear_Y_Intercept": 10.0,
        }  # fmt: skip
        raw = struct.pack("<I", len(stated))
        for name, value in stated.items():
            raw += struct.pack("<I", len(name)) + name.encode()
            if isinstance(value, str):
                raw += struct.pack("<II", 0x20, len(value)) + value.encode()
            else:
                raw += struct.pack("<II", 7, value) if isinstance(value, int) else struct.pack("<Id", 10, value)
        return raw

    rows = np.array([[1, -1], [2, -2], [3, -3], [4, -4]], dtype="<i2")
    objects = [("/'g'/'a'", index(0), properties(0.5)), ("/'g'/'b'", index(2), properties(2.0))]
    path = of_bytes(segment(NEW | INTERLEAVED | DAQMX, objects, rows.tobytes() * 2))
    found = reading.read(path)
    assert found.column("a").tolist() == [10.5, 11.0, 11.5, 12.0] * 2
    np.testing.assert_array_equal(found.column("b"), TdmsFile.read(path)["g"]["b"][:])


@pytest.mark.parametrize("cut", [3, 30, 60, 100, 155])
def test_a_cut_file_says_where_and_how_many(tmp_path, cut):
    """The segment, the channels and their samples; all that npTDMS finds too can be had by one who accepts it."""
    path = write(tmp_path, *([channel("a", np.arange(10.0) + i), channel("b", np.arange(10.0))] for i in range(5)))
    path.write_bytes(path.read_bytes()[:-cut])
    found = reading.read(path)
    assert "inside segment 5" in found.message("cut_file")
    library = TdmsFile.read(path)["DAQ"]
    lengths = [len(library[name][:]) for name in "ab"]
    assert f"a {lengths[0]} of 50 declared" in found.message("cut_file")
    for name, length in zip("ab", lengths, strict=True):
        assert found.column(name)[:length].tolist() == library[name][:].tolist()
        assert np.isnan(found.column(name)[length:]).all()
        assert len(found.column(name)) == max(lengths)


def test_a_file_cut_in_its_only_chunk_keeps_what_is_there(tmp_path):
    """1,883 of 2,000 numbers; of a second channel behind it nothing is there."""
    path = write(tmp_path, [channel("a", np.arange(2000.0)), channel("b", np.arange(2000.0))])
    path.write_bytes(path.read_bytes()[: -2000 * 8 - 117 * 8 + 3])
    found = reading.read(path)
    assert found.column("a").tolist() == list(range(1883))
    assert "no sample in b" in found.message("empty_group")


@pytest.mark.parametrize("beyond", [5, 1 << 62])
def test_raw_data_that_begin_beyond_the_end_of_a_cut_file(tmp_path, beyond):
    """The segment before is read, of the last nothing is there; no place before the data is taken for one of theirs."""
    whole = segment(METADATA | RAW, numbers(10, count=4), np.arange(4.0).tobytes())
    last = bytearray(segment(METADATA | RAW, numbers(10, count=4), b""))
    last[12:28] = struct.pack("<2Q", len(last) - 28 + beyond + 32, len(last) - 28 + beyond)
    (tmp_path / "run.tdms").write_bytes(whole + last)
    found = reading.read(tmp_path / "run.tdms")
    assert found.column("a").tolist() == [0.0, 1.0, 2.0, 3.0]
    assert "segment 2" in found.message("cut_file")


def test_a_file_that_was_never_finished_is_found(tmp_path):
    """A writer that crashed leaves its last segment without a length."""
    path = write(tmp_path, [channel("a", np.arange(10.0))])
    raw = path.read_bytes()
    path.write_bytes(raw[:12] + b"\xff" * 8 + raw[20:])
    found = reading.read(path)
    assert "never finished" in found.message("cut_file")
    assert len(found.column("a")) == 10


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (segment(NEW, [("/'g'/'a'", struct.pack("<I", 0), NONE)], b""), "nothing before"),
        (segment(NEW, numbers(77, count=1), bytes(8)), "type 0x4d"),
        (segment(METADATA, [(*numbers(10, count=1)[0][:2], struct.pack("<I", 1 << 31))], b""), "end inside"),
        (segment(METADATA, [], b"") + b"TDSx" + bytes(24), "expected the next segment"),
        (b"TDSh" + bytes(24), "give the .tdms file"),
        (segment(NEW, numbers(10, count=1 << 50), bytes(80), size=1 << 53), "a 10 of 1125899906842624 declared"),
    ],
)
def test_what_contradicts_itself_is_refused(of_bytes, raw, message):
    """The refusal says what is wrong; of petabytes that are declared nothing is allocated."""
    assert message in reading.said(of_bytes(raw))


@pytest.mark.parametrize(("is_interleaved", "unit"), [(True, "rows of 12 bytes"), (False, "chunks of 60 bytes")])
def test_bytes_behind_whole_chunks_are_an_error(of_bytes, is_interleaved, unit):
    """Three bytes more than whole rows or chunks are a part of samples that is not read, and said to be."""
    flags = NEW | (INTERLEAVED if is_interleaved else 0)
    for behind in (b"", b"abc"):
        found = reading.read(of_bytes(segment(flags, numbers(3, 10, count=5), bytes(60) + behind)))
        assert len(found.column("a")) == len(found.column("b")) == 5
        assert ("count_contradiction" in found.codes) == bool(behind)
    assert f"3 bytes behind its whole {unit}" in found.message("count_contradiction")


def test_metadata_repeated_and_changed_and_repeated(tmp_path):
    """Segments that say the same again add samples; a change between them counts from where it stands."""
    parts = [("a", 3, "V"), ("a", 3, "V"), ("a", 5, "V"), ("a", 5, "V"), ("b", 4, "A"), ("a", 5, "mV"), ("a", 5, "mV")]
    segments = [[channel(name, RANDOM.normal(size=count), unit_string=unit)] for name, count, unit in parts]
    found = reading.read(write(tmp_path, *segments))
    for name in "ab":
        written = np.concatenate([s[0].data for s, part in zip(segments, parts, strict=True) if part[0] == name])
        assert found.column(name).tobytes() == written.tobytes()
    assert {c.name: c.unit for group in found.recording.groups for c in group.channels} == {"a": "mV", "b": "A"}


@pytest.mark.parametrize("name", ["run.tdms", pytest.param("01_loadcell_wagon55.tdms", marks=pytest.mark.recordings)])
def test_nptdms_gives_the_same_numbers(tmp_path, name):
    """The public recording and one of several kinds: each sample of each channel of numbers, bit for bit."""
    path = examples.make(tmp_path, name) if name in examples.ALL else reading.real(name)
    found = reading.read(path) if name in examples.ALL else reading.read_real(name)
    channels = {channel.name: channel[:] for group in TdmsFile.read(path).groups() for channel in group.channels()}
    of_numbers = {channel: values for channel, values in channels.items() if values.dtype.kind == "f"}
    for title, values in of_numbers.items():
        np.testing.assert_array_equal(found.column(title), values)
    assert len(of_numbers) >= 2


EIGHTHS = np.arange(50) / 8
RATE = {"wf_increment": 0.001}
DATES = [np.datetime64(f"2024-01-01T00:0{i}:00") for i in range(2)]


@pytest.mark.parametrize(
    ("first", "then", "rate_hz", "message"),
    [
        ({}, {"wf_increment": 0.002}, None, "wf_increment is 0.001 up to sample 50 and 0.002"),
        ({"unit_string": "N"}, {"unit_string": "kN"}, 1000.0, "unit_string is "),
        ({"wf_start_time": DATES[0]}, {"wf_start_time": DATES[1]}, 1000.0, "wf_start_time is "),
    ],
)
def test_properties_that_change_in_the_midst(tmp_path, first, then, rate_hz, message):
    """Two steps leave no rate; of a unit or start the last one holds for all samples, by the format; both are said."""
    found = reading.read(write(tmp_path, *([channel("x", EIGHTHS, **RATE | each)] for each in (first, then))))
    (finding,) = [f for f in found.findings if f.code == "header_contradiction"]
    assert (finding.channel, finding.where) == ("x", "sample 50")
    assert finding.message.startswith(message)
    assert (found.group().clock and found.group().clock.rate_hz) == rate_hz
    assert found.column("x").tolist() == [*EIGHTHS, *EIGHTHS]


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
    clock = reading.read(write(tmp_path, [channel("x", EIGHTHS, wf_increment=0.125, **axis)])).group().clock
    assert (None if clock is None else clock.rate_hz) == rate_hz


def test_a_correction_behind_the_samples_is_no_contradiction(tmp_path):
    """A property that is written anew once all samples are there is that of all; so is one that is written twice."""
    first = [channel("x", EIGHTHS, unit_string="N", **RATE)]
    found = reading.read(write(tmp_path, first, first, [channel("x", EIGHTHS[:0], unit_string="kN")]))
    assert found.unit("x") == "kN"
    assert "header_contradiction" not in found.codes
