"""MDF 4.2 with samples stored by column, made byte by byte: the libraries at hand neither write nor read them."""

import struct
import zlib

import numpy as np
import pytest

from testbench.errors import RecordingError

from . import reading
from .test_mdf import _HEADER, _block, _Written

COUNT = 1000
TIME = np.arange(COUNT) / 100
FORCE = np.sin(TIME)
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


def _made(path, count=COUNT):
    file = _ByColumn()
    plain, force, steps = TIME.tobytes(), FORCE.tobytes(), STEPS.tobytes()
    master = file.column("t", file.listed((b"DV", [], plain)), 8, kind=2, sync=1)
    file.column("force", file.listed((b"DV", [], force[:800]), _packed(force[800:])), 8, master, count=count)
    bits = [(b"DI", [], BAD[:300].tobytes()), (b"DI", [], BAD[300:].tobytes())]
    sections = [(b"DV", [], steps[:600]), (b"DV", [], steps[600:])]
    file.column("steps", file.listed(*sections, bits=bits), 2, master, invalidation=1, form=0)
    return file.write(path)


def test_columns_of_one_time_are_one_group(tmp_path):
    """Time and channels from their own streams, plain and compressed, with invalidation bits apart: NaN and counted."""
    found = reading.read(_made(tmp_path / "made.mf4"))
    (group,) = found.groups.values()
    assert {c.name for c in group.channels} == {"t", "force", "steps"}
    assert np.array_equal(found.time(), TIME)
    assert np.array_equal(found.column("force"), FORCE)
    assert np.array_equal(found.column("steps"), np.where(BAD, np.nan, STEPS), equal_nan=True)
    assert found.message("invalid_samples").startswith(f"{BAD.sum()} samples")


def test_blocks_of_any_size_give_the_same(tmp_path, monkeypatch):
    """However the streams are cut into pieces, their rows stay side by side."""
    monkeypatch.setattr("testbench.readers.mdf.version4_blocks.BLOCK_BYTES", 56)
    monkeypatch.setattr("testbench.readers.mdf.reader.block_samples", lambda channels: 7)
    found = reading.read(_made(tmp_path / "made.mf4"))
    assert np.array_equal(found.time(), TIME)
    assert np.array_equal(found.column("force"), FORCE)
    assert int(np.isnan(found.column("steps")).sum()) == BAD.sum()


def test_columns_that_disagree_are_said(tmp_path):
    """A declared count that is not there; a time that is no channel group; a cut."""
    path = tmp_path / "made.mf4"
    assert "declare" in reading.read(_made(path, count=COUNT + 3)).message("count_contradiction")
    file = _ByColumn()
    file.column("force", file.listed((b"DV", [], FORCE.tobytes())), 8, master=64)
    with pytest.raises(RecordingError, match="its time lies in another group"):
        reading.read(file.write(path))


def test_a_cut_among_the_columns_is_said(tmp_path):
    """Where the bytes of a column end too early, the file is refused or found cut."""
    path = tmp_path / "made.mf4"
    whole = _made(path).read_bytes()
    for end in range(len(whole) // 2, len(whole), 211):
        path.write_bytes(whole[:end])
        try:
            codes = reading.read(path).codes
        except RecordingError:
            continue
        assert "cut_file" in codes
