"""ASAM MDF 3 and 4, written by asammdf and block by block; by column (4.2) only so, as no library at hand writes it."""

import struct
import zlib

import numpy as np
import pytest
from asammdf import MDF, Signal

from testbench.errors import RecordingError
from testbench.readers.mdf import conversions, records
from testbench.readers.mdf.records import Member

from . import reading

RANDOM = np.random.default_rng(4)
TIME = np.arange(400) / 128
VERSIONS = ["3.00", "3.30", "4.00", "4.10"]


def _save(tmp_path, version, *groups, **options):
    """A file by asammdf; each group is a list of signals."""
    with MDF(version=version) as mdf:
        for signals in groups:
            mdf.append(signals, common_timebase=True)
        return mdf.save(tmp_path / f"run.{'mf4' if version >= '4' else 'mdf'}", overwrite=True, **options)


def _signal(name, values, time=TIME, **details):
    return Signal(values, time, name=name, **{"unit": "N"} | details)


@pytest.mark.parametrize("version", VERSIONS)
def test_groups_keep_their_own_time(tmp_path, version):
    """A slow and a fast group, neither resampled."""
    slow = np.arange(10) / 2
    path = _save(tmp_path, version, [_signal("a", np.sin(TIME))], [_signal("b", np.cos(slow), slow)])
    found = reading.read(path)
    times = [found.time(name) for name in found.groups]
    np.testing.assert_array_equal(times[0], TIME)
    np.testing.assert_array_equal(times[1], slow)
    np.testing.assert_array_equal(found.column("b"), np.cos(slow))


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_compressed_samples_are_unpacked(tmp_path, compression):
    """Deflated, and deflated after turning rows to columns; several blocks of samples."""
    values = RANDOM.normal(size=400)
    with MDF(version="4.10") as mdf:
        mdf.configure(write_fragment_size=1024)
        mdf.append([_signal("a", values), _signal("b", values[::-1].copy())], common_timebase=True)
        path = mdf.save(tmp_path / "run.mf4", compression=compression, overwrite=True)
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("a"), values)
    np.testing.assert_array_equal(found.column("b"), values[::-1])


@pytest.mark.parametrize("version", ["3.30", "4.10"])
@pytest.mark.parametrize(
    "conversion",
    [
        {"a": 0.25, "b": -3.0},
        {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0},
        {f"raw_{i}": 10.0 * i for i in range(12)} | {f"phys_{i}": 1.5 * i**2 for i in range(12)},
    ],
    ids=["linear", "rational", "table"],
)
def test_laws_give_what_asammdf_gives(tmp_path, version, conversion):
    """Physical values by each law, to the last digits."""
    from asammdf.blocks import conversion_utils

    law = conversion_utils.from_dict(dict(conversion))
    if version < "4":
        law = conversion_utils.conversion_transfer(law, version=3)
    path = _save(tmp_path, version, [_signal("a", RANDOM.integers(0, 100, 400).astype("u1"), conversion=law)])
    with MDF(path) as mdf:
        expected = mdf.get("a").samples
    found = reading.read(path)
    np.testing.assert_allclose(found.column("a"), expected, rtol=1e-14)
    assert "calibration_applied" in found.codes


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_formulas_are_computed(tmp_path, version):
    """Arithmetic of the raw number; asammdf alone would give the raw number instead."""
    from asammdf.blocks import conversion_utils

    law = conversion_utils.from_dict({"formula": "X * 2 + sin(X) ^ 2"})
    if version < "4":
        law = conversion_utils.conversion_transfer(law, version=3)
    raw = np.arange(400) % 100
    found = reading.read(_save(tmp_path, version, [_signal("a", raw.astype("u1"), conversion=law)]))
    np.testing.assert_allclose(found.column("a"), raw * 2 + np.sin(raw) ** 2, rtol=1e-14)


def test_tables_of_steps_and_ranges():
    """The nearest value, the lower one half-way; ranges whose upper ends belong to integers only."""
    x = np.array([0.0, 5.0, 5.1, 10.0, 99.0])
    steps = conversions.table([0, 10], [1, 2], interpolate=False)
    assert steps(x).tolist() == [1, 1, 2, 2, 2]
    for belong, expected in ((True, [7, 7, -1, 8, -1]), (False, [7, -1, -1, 8, -1])):
        assert conversions.ranges([0, 10], [5, 11], [7, 8], -1.0, belong)(x).tolist() == expected


@pytest.mark.parametrize("text", ["__import__('os')", "X.real", "X if X else 0", "[X]", "X +", "open(X)", "X" * 2000])
def test_formulas_are_never_code(text):
    """Anything but arithmetic is refused."""
    with pytest.raises(ValueError, match=r".+"):
        conversions.formula(text)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("bit", "bits"), [(0, 12), (3, 5), (5, 7), (4, 28), (1, 63), (0, 64), (7, 64), (3, 1)])
def test_bits_are_cut_out_of_bytes(order, bit, bits):
    """Unsigned and signed numbers of any count of bits, in either byte order, against Python's integers."""
    count = -(-(bit + bits) // 8)
    rows = RANDOM.integers(0, 256, (50, count + 3)).astype(np.uint8)
    for kind in "ui":
        member = Member("a", None, kind, order, 2, bit, bits)
        assert records.fits(member, count + 3)
        for row, value in zip(rows, records.raw_values(member, rows, 0), strict=True):
            number = int.from_bytes(row[2 : 2 + count].tobytes(), "little" if order == "<" else "big") >> bit
            number &= (1 << bits) - 1
            if kind == "i" and number >> (bits - 1):
                number -= 1 << bits
            assert value == float(number)


def test_invalid_samples_are_nan(tmp_path):
    """What the invalidation bits mark is NaN, and counted."""
    bad = np.zeros(400, dtype=bool)
    bad[[3, 7]] = True
    with MDF(version="4.10") as mdf:
        mdf.append([_signal("a", np.arange(400.0), invalidation_bits=bad)], common_timebase=True)
        path = mdf.save(tmp_path / "run.mf4", overwrite=True)
    found = reading.read(path)
    assert np.flatnonzero(np.isnan(found.column("a"))).tolist() == [3, 7]
    assert found.message("invalid_samples").startswith("2 samples")


def test_texts_are_said_and_meanings_kept(tmp_path):
    """A channel of text is left out by name; a status keeps its number, and its words beside."""
    from asammdf.blocks import conversion_utils

    words = conversion_utils.from_dict({"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"})
    path = _save(tmp_path, "4.10", [
        _signal("note", np.array([b"abc"] * 400), encoding="latin-1"),
        _signal("state", (np.arange(400) % 2).astype("u1"), conversion=words),
    ])  # fmt: skip
    found = reading.read(path)
    assert "text_channel" in found.codes
    assert found.column("state").tolist() == [0, 1] * 200
    assert "1 = on" in found.recording.metadata["state: meaning"]


def _block(kind, links, data):
    length = 24 + 8 * len(links) + len(data)
    return struct.pack("<4s4xQQ", b"##" + kind, length, len(links)) + struct.pack(f"<{len(links)}Q", *links) + data


class _Written:
    """A file of version 4 that grows block by block; links are known when a block is written."""

    def __init__(self, mark=b"MDF     "):
        self.raw = bytearray(mark + b"4.10    " + b"test    " + bytes(4) + struct.pack("<H", 410)).ljust(64, b"\0")
        self.raw += bytes(_HEADER)

    def add(self, kind, links, data):
        self.raw += bytes(-len(self.raw) % 8)
        address = len(self.raw)
        self.raw += _block(kind, links, data)
        return address

    def channel(self, name, following, byte, form=4, bits=64, kind=0, sync=0):
        title = self.add(b"TX", [], name.encode() + b"\0")
        data = struct.pack("<BBBBIIII", kind, sync, form, 0, byte, bits, 0, 0).ljust(72, b"\0")
        return self.add(b"CN", [following, 0, title, 0, 0, 0, 0, 0], data)

    def records(self, following, channel, identifier, count, size, flags=0):
        data = struct.pack("<QQHH4xII", identifier, count, flags, 0, size, 0)
        return self.add(b"CG", [following, channel, 0, 0, 0, 0], data)

    def finish(self, tmp_path, records, samples, identifier_size=0):
        group = self.add(b"DG", [0, records, samples, 0], bytes([identifier_size]) + bytes(7))
        self.raw[64 : 64 + _HEADER] = _block(b"HD", [group, 0, 0, 0, 0, 0], bytes(32))
        path = tmp_path / "made.mf4"
        path.write_bytes(self.raw)
        return path


_HEADER = 24 + 48 + 32
ROWS = np.array([(i / 4, i * 2.0) for i in range(8)])


def _made(tmp_path, samples=None, count=8, mark=b"MDF     "):
    """Eight records of time and one channel."""
    file = _Written(mark)
    channels = file.channel("t", file.channel("a", 0, 8), 0, kind=2, sync=1)
    at = samples(file) if samples else file.add(b"DT", [], ROWS.tobytes())
    return file.finish(tmp_path, file.records(0, channels, 0, count, 16), at)


def test_records_of_several_kinds_are_told_apart(tmp_path):
    """Records in the order of their coming, with identifiers; texts of varying length are passed over."""
    file = _Written()
    one = file.records(0, file.channel("t", file.channel("a", 0, 8), 0, kind=2, sync=1), 1, 8, 16)
    two = file.records(one, file.channel("u", file.channel("b", 0, 8, form=0, bits=16), 0, kind=2, sync=1), 2, 4, 10)
    three = file.records(two, 0, 3, 2, 0, flags=1)
    raw = b""
    for i, row in enumerate(ROWS):
        raw += b"\x01" + row.tobytes()
        raw += b"\x02" + struct.pack("<dH", row[0], 500 + i) if i % 2 == 0 else b""
        raw += b"\x03" + struct.pack("<I3s", 3, b"abc") if i > 5 else b""
    path = file.finish(tmp_path, three, file.add(b"DT", [], raw), 1)
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("a"), ROWS[:, 1])
    assert found.column("b").tolist() == [500, 502, 504, 506]
    path.write_bytes(path.read_bytes().replace(b"\x02" + struct.pack("<dH", 0.5, 502), b"\x09" + bytes(10)))
    with pytest.raises(RecordingError, match="identifier 9"):
        reading.read(path)


@pytest.mark.parametrize("size", [1, 7, 40])
def test_pieces_that_part_a_record_are_joined(tmp_path, monkeypatch, size):
    """However the bytes are cut into blocks, records are whole."""

    def listed(file):
        raw = ROWS.tobytes()
        links = [file.add(b"DT", [], raw[i : i + size]) for i in range(0, len(raw), size)]
        return file.add(b"DL", [0, *links], bytes(8))

    found = reading.read(_made(tmp_path, listed))
    np.testing.assert_array_equal(found.column("a"), ROWS[:, 1])
    monkeypatch.setattr("testbench.readers.mdf.reader.block_samples", lambda channels: 3)
    np.testing.assert_array_equal(reading.read(_made(tmp_path, listed)).column("a"), ROWS[:, 1])


def test_an_unfinished_file_is_said(tmp_path):
    """A logger that lost power leaves counts at zero and samples to the end of the file."""
    file = _Written(b"UnFinMF ")
    channels = file.channel("t", file.channel("a", 0, 8), 0, kind=2, sync=1)
    records = file.records(0, channels, 0, 0, 16)
    at = len(file.raw) + 24 + 32 + 8 + (-len(file.raw) % 8)
    path = file.finish(tmp_path, records, at)
    path.write_bytes(path.read_bytes() + struct.pack("<4s4xQQ", b"##DT", 24, 0) + ROWS.tobytes()[:-5])
    found = reading.read(path)
    assert "cut_file" in found.codes
    np.testing.assert_array_equal(found.column("a"), ROWS[:7, 1])


def test_a_cut_file_says_what_is_missing(tmp_path):
    """Samples that are cut are counted; a block that is missing altogether is refused."""
    path = _save(tmp_path, "4.10", [_signal("a", np.sin(TIME))])
    file = _Written()
    channels = file.channel("t", file.channel("a", 0, 8), 0, kind=2, sync=1)
    records = file.records(0, channels, 0, 8, 16)
    at = len(file.raw) + 24 + 32 + 8 + (-len(file.raw) % 8)
    made = file.finish(tmp_path, records, at)
    made.write_bytes(made.read_bytes() + _block(b"DT", [], ROWS.tobytes())[:-20])
    found = reading.read(made)
    assert "20 of 128 bytes" in found.message("cut_file")
    assert "6 of 8 samples" in found.message("cut_file")
    np.testing.assert_array_equal(found.column("a"), ROWS[:6, 1])
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        try:
            assert "cut_file" in reading.read(path).codes
        except RecordingError as error:
            assert "beyond the end" in str(error) or "cut" in str(error)  # noqa: PT017


def test_counts_that_contradict_the_bytes_are_said(tmp_path):
    """Nine records declared, bytes for eight."""
    assert "declares 9 samples" in reading.read(_made(tmp_path, count=9)).message("count_contradiction")


def test_bombs_and_circles_are_refused(tmp_path):
    """Samples that unpack to terabytes, one block linked a million times, lists that come back to themselves."""

    def bomb(file):
        packed = zlib.compress(bytes(1 << 16))
        one = file.add(b"DZ", [], struct.pack("<2sBxIQQ", b"DT", 0, 0, 1 << 28, len(packed)) + packed)
        return file.add(b"DL", [0] + [one] * 5000, bytes(8))

    def repeated(file):
        one = file.add(b"DT", [], ROWS.tobytes())
        return file.add(b"DL", [0] + [one] * 5000, bytes(8))

    def circle(file):
        return file.add(b"DL", [len(file.raw) + (-len(file.raw) % 8), 0], bytes(8))

    for samples, said in ((bomb, "are declared in a file of"), (repeated, "are declared in"), (circle, "comes back")):
        with pytest.raises(RecordingError, match=said):
            reading.read(_made(tmp_path, samples))


COUNT = 1000
COLUMN_TIME = np.arange(COUNT) / 100
FORCE = np.sin(COLUMN_TIME)
STEPS = (np.arange(COUNT) * 7 % 5000).astype("<u2")
BAD = np.arange(COUNT) % 9 == 4
_REMOTE_MASTER, _PER_BIT, _APART = 8, 2, 1 << 31


class _ByColumn(_Written):
    """A file whose channels lie in data groups of their own."""

    def __init__(self):
        super().__init__()
        self.raw[8:16], self.raw[28:30] = b"4.20    ", struct.pack("<H", 420)
        self.groups = 0

    def listed(self, *sections, bits=()):
        """A list LD of sections of data, and of their invalidation bytes."""
        data = [self.add(*section) for section in sections]
        apart = [self.add(*section) for section in bits]
        starts = np.cumsum([0, *(len(s[2]) for s in sections)])[:-1]
        flags = _APART if bits else 0
        said = struct.pack("<II", flags, len(sections)) + starts.astype("<u8").tobytes()
        return self.add(b"LD", [0, *data, *apart], said)

    def column(self, name, samples, size, master=0, invalidation=0, count=COUNT, **details):
        """A data group of one channel; the address of its channel group."""
        title = self.add(b"TX", [], name.encode() + b"\0")
        flags = _PER_BIT if invalidation else 0
        form = {"form": 4, "kind": 0, "sync": 0} | details
        data = struct.pack("<BBBBIIII", form["kind"], form["sync"], form["form"], 0, 0, 8 * size, flags, 0)
        channel = self.add(b"CN", [0, 0, title, 0, 0, 0, 0, 0], data.ljust(72, b"\0"))
        links = [0, channel, 0, 0, 0, 0, *([master] if master else [])]
        data = struct.pack("<QQHH4xII", 0, count, _REMOTE_MASTER if master else 0, 0, size, invalidation)
        group = self.add(b"CG", links, data)
        self.groups = self.add(b"DG", [self.groups, group, samples, 0], bytes(8))
        return group

    def write(self, path):
        """The file, its data groups from the last to the first."""
        self.raw[64 : 64 + _HEADER] = _block(b"HD", [self.groups, 0, 0, 0, 0, 0], bytes(32))
        path.write_bytes(self.raw)
        return path


def _packed(raw):
    """A block DZ of these bytes."""
    packed = zlib.compress(raw)
    return b"DZ", [], struct.pack("<2sBxIQQ", b"DV", 0, 0, len(raw), len(packed)) + packed


def _made_by_column(path, count=COUNT):
    file = _ByColumn()
    plain, force, steps = COLUMN_TIME.tobytes(), FORCE.tobytes(), STEPS.tobytes()
    master = file.column("t", file.listed((b"DV", [], plain)), 8, kind=2, sync=1)
    file.column("force", file.listed((b"DV", [], force[:800]), _packed(force[800:])), 8, master, count=count)
    bits = [(b"DI", [], BAD[:300].tobytes()), (b"DI", [], BAD[300:].tobytes())]
    sections = [(b"DV", [], steps[:600]), (b"DV", [], steps[600:])]
    file.column("steps", file.listed(*sections, bits=bits), 2, master, invalidation=1, form=0)
    return file.write(path)


def test_columns_of_one_time_are_one_group(tmp_path):
    """Time and channels from their own streams, plain and compressed, with invalidation bits apart: NaN and counted."""
    found = reading.read(_made_by_column(tmp_path / "made.mf4"))
    (group,) = found.groups.values()
    assert {c.name for c in group.channels} == {"t", "force", "steps"}
    assert np.array_equal(found.time(), COLUMN_TIME)
    assert np.array_equal(found.column("force"), FORCE)
    assert np.array_equal(found.column("steps"), np.where(BAD, np.nan, STEPS), equal_nan=True)
    assert found.message("invalid_samples").startswith(f"{BAD.sum()} samples")


def test_blocks_of_any_size_give_the_same(tmp_path, monkeypatch):
    """However the streams are cut into pieces, their rows stay side by side."""
    monkeypatch.setattr("testbench.readers.mdf.version4_blocks.BLOCK_BYTES", 56)
    monkeypatch.setattr("testbench.readers.mdf.reader.block_samples", lambda channels: 7)
    found = reading.read(_made_by_column(tmp_path / "made.mf4"))
    assert np.array_equal(found.time(), COLUMN_TIME)
    assert np.array_equal(found.column("force"), FORCE)
    assert int(np.isnan(found.column("steps")).sum()) == BAD.sum()


def test_columns_that_disagree_are_said(tmp_path):
    """A declared count that is not there; a time that is no channel group; a cut."""
    path = tmp_path / "made.mf4"
    assert "declare" in reading.read(_made_by_column(path, count=COUNT + 3)).message("count_contradiction")
    file = _ByColumn()
    file.column("force", file.listed((b"DV", [], FORCE.tobytes())), 8, master=64)
    with pytest.raises(RecordingError, match="its time lies in another group"):
        reading.read(file.write(path))


def test_a_cut_among_the_columns_is_said(tmp_path):
    """Where the bytes of a column end too early, the file is refused or found cut."""
    path = tmp_path / "made.mf4"
    whole = _made_by_column(path).read_bytes()
    for end in range(len(whole) // 2, len(whole), 211):
        path.write_bytes(whole[:end])
        try:
            codes = reading.read(path).codes
        except RecordingError:
            continue
        assert "cut_file" in codes
