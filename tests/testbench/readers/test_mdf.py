"""ASAM MDF 3 and 4, written by asammdf and block by block; by column (4.2) only so, as no library at hand writes it."""

import struct
import zlib
from functools import partial

import numpy as np
import pytest
from asammdf import MDF, Signal
from asammdf.blocks import conversion_utils, v4_blocks

from testbench.readers.mdf import conversions
from testbench.readers.mdf.records import Member
from testbench.recording import refusing_findings

from . import reading

RANDOM = np.random.default_rng(4)
TIME = np.arange(400) / 128
VERSIONS = ["3.00", "3.30", "4.00", "4.10"]


def save(tmp_path, version, *groups, **options):
    """A file by asammdf; each group is a list of signals."""
    with MDF(version=version) as mdf:
        mdf.configure(write_fragment_size=1024)
        for signals in groups:
            mdf.append(signals, common_timebase=True)
        return mdf.save(tmp_path / f"run.{'mf4' if version >= '4' else 'mdf'}", overwrite=True, **options)


def signal(name, values, time=TIME, **details):
    """A channel of forces."""
    return Signal(values, time, name=name, **{"unit": "N"} | details)


@pytest.mark.parametrize(("version", "compression"), [*((v, 0) for v in VERSIONS), ("4.10", 1), ("4.10", 2)])
def test_groups_keep_their_own_time(tmp_path, version, compression):
    """A slow and a fast group, neither resampled; plain, deflated, and deflated after turning rows to columns."""
    slow, fast = np.arange(10) / 2, RANDOM.normal(size=400)
    groups = [signal("Force X", fast), signal("b", fast[::-1].copy())], [signal("c", np.cos(slow), slow)]
    found = reading.read(save(tmp_path, version, *groups, **({"compression": compression} if compression else {})))
    for group, time in zip(found.groups, (TIME, slow), strict=True):
        np.testing.assert_array_equal(found.time(group), time)
    for channel, values in (("Force X", fast), ("b", fast[::-1]), ("c", np.cos(slow))):
        np.testing.assert_array_equal(found.column(channel), values)
    assert found.unit("Force X") == "N"


def test_a_clock_that_counts_records(tmp_path):
    """A virtual master has no bytes in the records: its time is their number, as asammdf has it."""
    path = save(tmp_path, "4.10", [signal("a", RANDOM.normal(size=400))])
    with MDF(path) as mdf:
        clock = mdf.groups[0].channels[0]
    raw, kind = bytearray(path.read_bytes()), clock.address + 24 + 8 * clock.links_nr
    assert raw[kind] == 2
    raw[kind] = 3
    path.write_bytes(raw)
    with MDF(path) as mdf:
        expected = mdf.get("a").timestamps
    found = reading.read(path)
    np.testing.assert_array_equal(found.time(next(iter(found.groups))), expected)
    np.testing.assert_array_equal(expected, np.arange(400.0))


@pytest.mark.parametrize("version", ["3.30", "4.10"])
@pytest.mark.parametrize(
    "conversion",
    [
        {"a": 0.25, "b": -3.0},
        {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0},
        {f"raw_{i}": 10.0 * i for i in range(12)} | {f"phys_{i}": 1.5 * i**2 for i in range(12)},
        {"formula": "X * 2 + sin(X) ^ 2"},
    ],
    ids=["linear", "rational", "table", "formula"],
)
def test_laws_give_what_asammdf_gives(tmp_path, version, conversion):
    """Physical values by each law, to the last digits; of formulas asammdf alone would give the raw number instead."""
    law, raw = conversion_utils.from_dict(dict(conversion)), RANDOM.integers(0, 100, 400).astype("u1")
    law = conversion_utils.conversion_transfer(law, version=3) if version < "4" else law
    path = save(tmp_path, version, [signal("a", raw, conversion=law)])
    with MDF(path) as mdf:
        expected = raw * 2.0 + np.sin(raw * 1.0) ** 2 if "formula" in conversion else mdf.get("a").samples
    found = reading.read(path)
    np.testing.assert_allclose(found.column("a"), expected, rtol=1e-14)
    assert "calibration_applied" in found.codes


def test_tables_of_steps_and_ranges():
    """The nearest value, the lower one half-way; ranges whose upper ends belong to integers only."""
    x = np.array([0.0, 5.0, 5.1, 10.0, 99.0])
    assert conversions.table([0, 10], [1, 2], interpolate=False)(x).tolist() == [1, 1, 2, 2, 2]
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
        assert member.fits(count + 3)
        for row, value in zip(rows, member.raw_values(rows, 0), strict=True):
            number = int.from_bytes(row[2 : 2 + count].tobytes(), "little" if order == "<" else "big") >> bit
            number &= (1 << bits) - 1
            number -= (1 << bits) if kind == "i" and number >> (bits - 1) else 0
            assert value == float(number)


@pytest.mark.parametrize(
    ("version", "encoding", "compression"),
    [("3.30", "latin-1", 0), ("4.10", "latin-1", 0), ("4.10", "utf-8", 2), ("4.10", "utf-16-le", 1)],
)
def test_texts_by_their_own_library(tmp_path, version, encoding, compression):
    """As asammdf gives them, with the samples from which on they hold; in version 4 they lie in blocks of their own."""
    words = ["bereit", "läuft", "läuft", ""] * 100
    written = np.array([word.encode(encoding) for word in words])
    made = [signal("note", written, encoding=encoding), signal("a", np.arange(400.0))]
    path = save(tmp_path, version, made, compression=compression)
    found = reading.read(path)
    (kept,) = found.recording.texts.kept
    with MDF(path) as file:
        cells = file.get("note", raw=True).samples
        given = [(cell + b"\0" * (len(cell) % 2)).decode(encoding).strip("\0") for cell in cells]
    assert given == words
    assert (kept.channel, kept.group) == ("note", found.recording.groups[0].name)
    assert [words[i] for i in kept.samples] == kept.texts
    assert kept.samples == [i for i in range(400) if i == 0 or words[i] != words[i - 1]]
    assert "note" in {finding.channel for finding in found.findings if finding.code == "text_kept"}


def test_events(tmp_path):
    """What a person marked while it was recorded, and when, by the time that the file states for it."""
    with MDF(save(tmp_path, "4.10", [signal("a", np.arange(400.0))])) as file:
        event = v4_blocks.EventBlock(event_type=6, sync_type=1, sync_base=25, sync_factor=0.5)
        event.name, event.comment = "knock", "with the small hammer"
        file.events.append(event)
        file.save(tmp_path / "marked.mf4", overwrite=True)
    assert (
        reading.read(tmp_path / "marked.mf4").recording.metadata["event 1"] == "at 12.5 s: knock; with the small hammer"
    )


def test_invalid_samples_and_meanings(tmp_path):
    """What invalidation bits mark is NaN and counted; a status keeps number and words."""
    words = conversion_utils.from_dict({"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"})
    gears = {f"{key}_{i}": v for i in (0, 1) for key, v in (("lower", 2 * i), ("upper", 2 * i + 1), ("text", f"g{i}"))}
    ranges = conversion_utils.from_dict(gears)
    found = reading.read(save(tmp_path, "4.10", [
        signal("gear", (np.arange(400) % 4).astype("u1"), conversion=ranges),
        signal("a", np.arange(400.0), invalidation_bits=np.isin(np.arange(400), [3, 7])),
        signal("state", (np.arange(400) % 2).astype("u1"), conversion=words),
    ]))  # fmt: skip
    assert np.flatnonzero(np.isnan(found.column("a"))).tolist() == [3, 7]
    assert found.message("invalid_samples").startswith("2 samples")
    assert found.column("state").tolist() == [0, 1] * 200
    assert "1 = on" in found.recording.metadata["state: meaning"]
    assert "2 to 3 = g1" in found.recording.metadata["gear: meaning"]


HEADER = 24 + 48 + 32
ROWS = np.array([(i / 4, i * 2.0) for i in range(8)])


def block(kind, links, data):
    """A block of version 4."""
    length = 24 + 8 * len(links) + len(data)
    return struct.pack("<4s4xQQ", b"##" + kind, length, len(links)) + struct.pack(f"<{len(links)}Q", *links) + data


class Written:
    """A file of version 4 that grows block by block; links are known when a block is written."""

    def __init__(self, mark=b"MDF     ", version=410):
        self.raw = bytearray(mark + b"%d.%02d    " % divmod(version, 100) + b"test    " + bytes(4))
        self.raw = (self.raw + struct.pack("<H", version)).ljust(64, b"\0") + bytes(HEADER)
        self.group = 0

    @property
    def end(self):
        """Where the next block will lie."""
        return len(self.raw) + (-len(self.raw) % 8)

    def add(self, kind, links, data):
        """A block, and its address."""
        address = self.end
        self.raw = self.raw.ljust(address, b"\0") + block(kind, links, data)
        return address

    def channel(self, name, following, byte, form=4, bits=64, kind=0, sync=0, flags=0, signal=0):
        """A channel before another one; ``signal`` is where what varies in length lies."""
        title = self.add(b"TX", [], name.encode() + b"\0")
        data = struct.pack("<BBBBIIII", kind, sync, form, 0, byte, bits, flags, 0).ljust(72, b"\0")
        return self.add(b"CN", [following, 0, title, 0, 0, signal, 0, 0], data)

    def pair(self, **second):
        """Time, and a channel behind it."""
        return self.channel("t", self.channel(**{"name": "a", "following": 0, "byte": 8} | second), 0, kind=2, sync=1)

    def records(self, following, channel, identifier, count, size, flags=0, invalidation=0, master=()):
        """A channel group."""
        data = struct.pack("<QQHH4xII", identifier, count, flags, 0, size, invalidation)
        return self.add(b"CG", [following, channel, 0, 0, 0, 0, *master], data)

    def data_group(self, records, samples, identifier_size=0):
        """A data group before those that there are."""
        self.group = self.add(b"DG", [self.group, records, samples, 0], bytes([identifier_size]) + bytes(7))

    def write(self, path, behind=b""):
        """The file, its data groups from the last to the first."""
        self.raw[64 : 64 + HEADER] = block(b"HD", [self.group, 0, 0, 0, 0, 0], bytes(32))
        path.write_bytes(bytes(self.raw) + behind)
        return path

    def listed(self, *sections, bits=()):
        """A list LD of sections of data, and of their invalidation bytes."""
        data, apart = [self.add(*section) for section in sections], [self.add(*section) for section in bits]
        starts = np.cumsum([0, *(len(s[2]) for s in sections)])[:-1]
        head = struct.pack("<II", (1 << 31) if bits else 0, len(sections)) + starts.astype("<u8").tobytes()
        return self.add(b"LD", [0, *data, *apart], head)

    def column(self, name, samples, size, master=0, invalidation=0, count=1000, **details):
        """A data group of one channel; the address of its channel group."""
        channel = self.channel(name, 0, 0, bits=8 * size, flags=2 if invalidation else 0, **details)
        group = self.records(0, channel, 0, count, size, 8 if master else 0, invalidation, [master] if master else [])
        self.data_group(group, samples)
        return group


def made(path, samples, count=8, mark=b"MDF     ", behind=b""):
    """Declared records of time and one channel, whose samples are what ``samples`` adds, and bytes behind all."""
    file = Written(mark)
    records_at = file.records(0, file.pair(), 0, count, 16)
    file.data_group(records_at, samples(file))
    return file.write(path, behind)


def listed(file, size):
    """The rows in pieces."""
    raw = ROWS.tobytes()
    return file.add(b"DL", [0, *(file.add(b"DT", [], raw[i : i + size]) for i in range(0, len(raw), size))], bytes(8))


def packed(raw, unpacked=None):
    """A block DZ of these bytes."""
    data = zlib.compress(raw)
    return b"DZ", [], struct.pack("<2sBxIQQ", b"DT", 0, 0, unpacked or len(raw), len(data)) + data


def behind(file):
    """Where a block behind the data group will lie."""
    return file.end + 24 + 32 + 8


def repeated(file, section):
    """One block of samples, linked thousands of times."""
    return file.add(b"DL", [0] + [file.add(*section)] * 5000, bytes(8))


DATA = block(b"DT", [], ROWS.tobytes())
BOMB = packed(bytes(1 << 16), 1 << 28)
ODD = {
    "as declared": (lambda file: file.add(b"DT", [], ROWS.tobytes()), {}, 8, []),
    "one record less": (lambda file: file.add(b"DT", [], ROWS.tobytes()), {"count": 9}, 8, ["declares 9 samples"]),
    "cut": (behind, {"behind": DATA[:-20]}, 6, ["cut_file", "20 of 128 bytes", "6 of 8 samples"]),
    "never finished": (
        behind, {"mark": b"UnFinMF ", "count": 0, "behind": struct.pack("<4s4xQQ", b"##DT", 24, 0) + DATA[24:-5]},
        7, ["cut_file"],
    ),
    "a bomb": (partial(repeated, section=BOMB), {}, None, ["are declared in a file of"]),
    "one block again and again": (partial(repeated, section=(b"DT", [], ROWS.tobytes())), {}, None, ["are declared"]),
    "a circle": (lambda file: file.add(b"DL", [file.end, 0], bytes(8)), {}, None, ["comes back"]),
} | {f"in pieces of {n}": (partial(listed, size=n), {}, 8, []) for n in (1, 7, 40)}  # fmt: skip
"""Samples, what is odd round them, how many records are there (None: refused), and what is said."""


@pytest.mark.parametrize("name", ODD)
def test_odd_samples(tmp_path, name):
    """Whole records are read however the bytes are parted; what is missing or cannot be is said, or refused."""
    samples, details, count, parts = ODD[name]
    path = made(tmp_path / "made.mf4", samples, **details)
    text = reading.said(path)
    assert [part for part in parts if part not in text] == []
    if count is not None:
        np.testing.assert_array_equal(reading.read(path).column("a"), ROWS[:count, 1])
        assert ("cut_file" in text or "count_contradiction" in text) == bool(parts)


def test_records_of_several_kinds_are_distinguished(tmp_path):
    """Records in the order of their coming, with identifiers; texts of varying length are passed over."""
    file = Written()
    one = file.records(0, file.pair(), 1, 8, 16)
    two = file.records(one, file.pair(name="b", form=0, bits=16), 2, 4, 10)
    three = file.records(two, 0, 3, 2, 0, flags=1)
    raw = b""
    for i, row in enumerate(ROWS):
        raw += b"\x01" + row.tobytes()
        raw += b"\x02" + struct.pack("<dH", row[0], 500 + i) if i % 2 == 0 else b""
        raw += b"\x03" + struct.pack("<I3s", 3, b"abc") if i > 5 else b""
    file.data_group(three, file.add(b"DT", [], raw), 1)
    found = reading.read(path := file.write(tmp_path / "made.mf4"))
    np.testing.assert_array_equal(found.column("a"), ROWS[:, 1])
    assert found.column("b").tolist() == [500, 502, 504, 506]
    path.write_bytes(path.read_bytes().replace(b"\x02" + struct.pack("<dH", 0.5, 502), b"\x09" + bytes(10)))
    assert "identifier 9" in reading.said(path)


FRAMES = [bytes(range(1, 2 + i % 5)) for i in range(8)]


@pytest.mark.parametrize("piece", [8 << 20, 23])
@pytest.mark.parametrize("is_finished", [True, False])
def test_frames_of_a_bus_keep_their_bytes(tmp_path, monkeypatch, piece, is_finished):
    """A channel for each byte, of a fixed array, and of records of varying length that come before or behind theirs.

    A logger that leaves counts unwritten, and says so by its flags, leaves nothing to accept.
    """
    monkeypatch.setattr("testbench.readers.mdf.version4.BLOCK_BYTES", piece)
    file = Written(b"MDF     " if is_finished else b"UnFinMF ")
    file.raw[60:62] = b"\0\0" if is_finished else b"\x25\0"
    frames = file.records(0, 0, 2, 8 * is_finished, 0, flags=1)
    payload = file.channel("payload", 0, 10, form=10, kind=1, signal=frames)
    fixed = file.channel("id", payload, 8, form=10, bits=16)
    one = file.records(frames, file.channel("t", fixed, 0, kind=2, sync=1), 1, 8 * is_finished, 18)
    empty = file.records(one, file.pair(), 3, 0, 16)
    raw = b""
    for i, (row, frame) in enumerate(zip(ROWS, FRAMES, strict=True)):
        pair = [b"\x01" + struct.pack("<d2BQ", row[0], i, 7, 99), b"\x02" + struct.pack("<I", len(frame)) + frame]
        raw += b"".join(pair if i % 3 else pair[::-1])
    file.data_group(empty, file.add(b"DT", [], raw), 1)
    found = reading.read(file.write(tmp_path / "made.mf4"))
    columns = np.array([found.column(f"payload[{k}]") for k in range(5)])
    np.testing.assert_array_equal(columns, [[f[k] if k < len(f) else np.nan for f in FRAMES] for k in range(5)])
    assert (found.column("id[0]").tolist(), set(found.column("id[1]"))) == (list(range(8)), {7.0})
    assert ("not_finalized" in found.codes) != is_finished
    assert not refusing_findings(found.findings)


@pytest.mark.parametrize("longest", [128, 4])
def test_texts_whose_records_lie_among_others(tmp_path, monkeypatch, longest):
    """As asammdf gives them, whether they come before or behind their record; beyond the limit they are left out."""
    monkeypatch.setattr("testbench.readers.mdf.reader.LONGEST_TEXT", longest)
    words, file, raw, place = ["ready", "ready", "", "läuft", "läuft", "ready"], Written(), b"", 0
    letters = file.records(0, 0, 2, len(words), sum(4 + len(word.encode()) for word in words), flags=1)
    note = file.channel("note", 0, 8, form=7, kind=1, signal=letters)
    one = file.records(letters, file.channel("t", note, 0, kind=2, sync=1), 1, len(words), 16)
    for i, word in enumerate(word.encode() for word in words):
        pair = [b"\x01" + struct.pack("<dQ", i / 4, place), b"\x02" + struct.pack("<I", len(word)) + word]
        raw, place = raw + b"".join(pair if i % 3 else pair[::-1]), place + 4 + len(word)
    file.data_group(one, file.add(b"DT", [], raw), 1)
    found = reading.read(path := file.write(tmp_path / "made.mf4"))
    assert found.column("t").tolist() == [i / 4 for i in range(len(words))]
    if longest == 4:
        assert "note (text of records apart, up to 6)" in found.message("left_out")
        assert not found.recording.texts.kept
        return
    with MDF(path) as other:
        assert [cell.decode().strip("\0") for cell in other.get("note", raw=True).samples] == words
    (kept,) = found.recording.texts.kept
    assert (kept.samples, kept.texts) == ([0, 2, 3, 5], ["ready", "", "läuft", "ready"])
    assert found.message("text_kept").startswith("holds text ('ready', 'läuft'), not numbers")


COLUMN_TIME = np.arange(1000) / 100
FORCE = np.sin(COLUMN_TIME)
STEPS = (np.arange(1000) * 7 % 5000).astype("<u2")
BAD = np.arange(1000) % 9 == 4


def by_column(path, count=1000):
    """Time and two channels in data groups of their own: plain and deflated, and with invalidation bytes apart."""
    file, force, steps = Written(version=420), FORCE.tobytes(), STEPS.tobytes()
    master = file.column("t", file.listed((b"DV", [], COLUMN_TIME.tobytes())), 8, kind=2, sync=1)
    file.column("force", file.listed((b"DV", [], force[:800]), packed(force[800:])), 8, master, count=count)
    bits = [(b"DI", [], BAD[:300].tobytes()), (b"DI", [], BAD[300:].tobytes())]
    sections = [(b"DV", [], steps[:600]), (b"DV", [], steps[600:])]
    file.column("steps", file.listed(*sections, bits=bits), 2, master, invalidation=1, form=0)
    return file.write(path)


@pytest.mark.parametrize(("size", "rows"), [(8 << 20, 1 << 20), (56, 7)])
def test_columns_of_one_time_are_one_group(tmp_path, monkeypatch, size, rows):
    """Channels from their own streams, however those are cut into pieces; invalid samples NaN and counted."""
    monkeypatch.setattr("testbench.readers.mdf.version4.BLOCK_BYTES", size)
    monkeypatch.setattr("testbench.readers.byte_source.BLOCK_BYTES", 8 * rows)
    found = reading.read(by_column(tmp_path / "made.mf4"))
    assert {c.name for c in found.group().channels} == {"t", "force", "steps"}
    np.testing.assert_array_equal(found.time(), COLUMN_TIME)
    np.testing.assert_array_equal(found.column("force"), FORCE)
    np.testing.assert_array_equal(found.column("steps"), np.where(BAD, np.nan, STEPS))
    assert found.message("invalid_samples").startswith(f"{BAD.sum()} samples")


def test_columns_that_disagree_are_found(tmp_path):
    """A declared count that is not there; a time that is no channel group; a cut anywhere, refused or found."""
    path = tmp_path / "made.mf4"
    assert "columns declare" in reading.said(by_column(path, count=1003))
    file = Written(version=420)
    file.column("force", file.listed((b"DV", [], FORCE.tobytes())), 8, master=64)
    assert "its time lies in another group" in reading.said(file.write(path))
    whole = by_column(path).read_bytes()
    for end in range(len(whole) // 2, len(whole), 211):
        path.write_bytes(whole[:end])
        assert reading.said(path).startswith(("cut_file", "damaged_file")), end
