"""MATLAB files of version 4 and 5, as scipy writes them, and byte by byte."""

import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from testbench.errors import RecordingError
from testbench.recording import Refusal, TimeColumn, UniformClock

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

RANDOM = np.random.default_rng(5)
TIME = np.arange(50) / 128
TIME_4 = np.arange(100) / 50


def _save(tmp_path, compress=False, **variables):
    path = tmp_path / "test.mat"
    savemat(path, variables, do_compression=compress)
    return path


def test_bytes_of_the_other_order_are_read(tmp_path):
    """A big-endian file, by hand."""
    name, data = b"acc", np.arange(5.0)
    body = struct.pack(">IIBBBBI", 6, 8, 0, 0, 0, 6, 0) + struct.pack(">IIii", 5, 8, 5, 1)
    body += struct.pack(">HH4s", len(name), 1, name) + struct.pack(">II", 9, 40) + data.astype(">f8").tobytes()
    path = tmp_path / "big.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI" + struct.pack(">II", 14, len(body)) + body)
    assert reading.read(path).column("acc").tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("compress", [False, True])
def test_matrices_are_a_channel_for_each_of_their_short_side(tmp_path, compress):
    """Columns of a tall matrix and rows of a wide one."""
    matrix = RANDOM.normal(size=(50, 3))
    found = reading.read(_save(tmp_path, compress, tall=matrix, wide=matrix.T.copy()))
    for i in range(3):
        np.testing.assert_array_equal(found.column(f"tall(:,{i + 1})"), matrix[:, i])
        np.testing.assert_array_equal(found.column(f"wide({i + 1},:)"), matrix[:, i])


def test_complex_numbers_are_two_channels(tmp_path):
    """Real and imaginary part."""
    values = RANDOM.normal(size=50) + 1j * RANDOM.normal(size=50)
    found = reading.read(_save(tmp_path, frf=values))
    np.testing.assert_array_equal(found.column("frf (real)"), values.real)
    np.testing.assert_array_equal(found.column("frf (imag)"), values.imag)


def test_lengths_are_groups_and_a_growing_time_is_the_clock(tmp_path):
    """What is named time and grows is the clock of the arrays of its length; others have none."""
    found = reading.read(_save(tmp_path, Time_domain=TIME, Time_chan=np.cos(TIME), spectrum=np.ones(20)))
    assert found.groups["test 50"].clock == TimeColumn(0, 1.0, assumed=True)
    assert found.groups["test 20"].clock is None
    assert {"time_unit_assumed", "no_clock"} <= found.codes


def test_fields_and_cells_are_named_by_their_path(tmp_path):
    """Structures are groups of their own, with their own time."""
    fast, slow = {"t_ms": TIME * 1000, "acc": np.sin(TIME)}, {"t": TIME[:9], "force": np.cos(TIME[:9])}
    found = reading.read(_save(tmp_path, fast=fast, slow=slow, note="hello", mass=2.5))
    assert found.groups["test fast"].clock == TimeColumn(0, 1e-3)
    np.testing.assert_array_equal(found.column("slow.force"), np.cos(TIME[:9]))
    assert (found.recording.metadata["note"], found.recording.metadata["mass"]) == ("hello", "2.5")
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = np.ones(4), np.zeros(4)
    assert reading.read(_save(tmp_path, c=cells)).column("c{2}").tolist() == [0] * 4


@pytest.mark.parametrize(("name", "value"), [("fs", 128.0), ("Sample_Rate", 128.0), ("dt", 1 / 128)])
def test_a_single_number_may_state_the_rate(tmp_path, name, value):
    """fs and dt are the clock of arrays without a time column."""
    assert reading.read(_save(tmp_path, x=TIME**2, **{name: value})).group().clock == UniformClock(128.0)


def test_a_rate_that_is_a_little_off_is_said(tmp_path):
    """1280 Hz stated, 1279.9 Hz in the time column."""
    found = reading.read(_save(tmp_path, t=TIME * 128 / 1279.9, x=TIME, fs=1280.0))
    assert "states 1280 Hz, the times give 1279.9 Hz" in found.message("rate_rounded")


def test_what_is_no_series_is_left_out_by_name(tmp_path):
    """Three dimensions, sparse matrices."""
    from scipy.sparse import eye

    found = reading.read(_save(tmp_path, x=TIME, cube=np.ones((3, 3, 3)), sparse=eye(3).tocsc()))
    assert "cube (an array of 3 x 3 x 3), sparse (a sparse matrix)" in found.message("left_out")


def test_a_cut_file_names_the_last_whole_variable(tmp_path):
    """Both variables are named: the cut one and the last whole one."""
    path = _save(tmp_path, first=TIME, second=TIME)
    path.write_bytes(path.read_bytes()[:-30])
    found = reading.read(path)
    assert "inside variable 'second'" in found.message("cut_file")
    assert "the last whole variable is 'first'" in found.message("cut_file")
    assert len(found.group().channels) == 1


def test_a_cut_compressed_variable_is_said(tmp_path):
    """A tag that is cut, and a stream that ends too early within its bounds."""
    path = _save(tmp_path, True, first=TIME, second=RANDOM.normal(size=500))
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    assert "last whole variable is 'first'" in reading.read(path).message("cut_file")
    packed = zlib.compress(bytes(4000))[:-6]
    path.write_bytes(whole + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(RecordingError, match="ends too early"):
        reading.read(path)


def test_a_compression_bomb_is_refused(tmp_path):
    """A hundred thousand times as many bytes as are there."""
    bomb = zlib.compress(struct.pack("<II", 14, 1 << 28) + bytes(1 << 28), 9)
    path = tmp_path / "bomb.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(bomb)) + bomb)
    with pytest.raises(RecordingError, match="unpack to more than"):
        reading.read(path)


def test_declared_sizes_that_are_not_there_are_refused(tmp_path):
    """Dimensions of gigabytes over fifty numbers."""
    path = _save(tmp_path, x=TIME)
    path.write_bytes(path.read_bytes().replace(struct.pack("<ii", 1, 50), struct.pack("<ii", 1, 1 << 30)))
    with pytest.raises(RecordingError, match=r"variable 'x' cannot be read.*reshape"):
        reading.read(path)


def matrix(name, values, kind=0, order="<", text=0):
    """A matrix of ``values`` (rows, columns): type MOPT, sides, real, name, numbers by column."""
    form = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}[kind]
    values = np.atleast_2d(values)
    head = struct.pack(f"{order}5i", 1000 * (order == ">") + 10 * kind + text, *values.shape, 0, len(name) + 1)
    return head + name.encode() + b"\0" + values.T.astype(order + form).tobytes()


def test_version_4_as_scipy_writes_it(tmp_path):
    """Arrays of one length are a group with its time; a number states the rate; texts are metadata; complex numbers."""
    path = tmp_path / "run.mat"
    savemat(
        path, {"t": TIME_4, "a": np.c_[TIME_4, -TIME_4], "fs": 50.0, "who": "me", "z": np.arange(9) * 1j}, format="4"
    )
    found = reading.read(path)
    assert found.recording.format == "MATLAB v4"
    assert found.column("a(:,2)").tolist() == (-TIME_4).tolist()
    assert found.column("z (imag)").tolist() == list(range(9))
    assert isinstance(found.groups["run 100"].clock, TimeColumn)
    assert (found.recording.metadata["who"], found.recording.stated_rate_hz) == ("me", 50.0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", range(6))
def test_numbers_and_byte_orders_of_version_4(tmp_path, kind, order):
    """Doubles, singles, integers of three widths, of both byte orders."""
    path = tmp_path / "run.mat"
    path.write_bytes(matrix("t", TIME_4[:, None], order=order) + matrix("n", np.arange(100)[:, None], kind, order))
    found = reading.read(path)
    assert found.column("n").tolist() == list(range(100))
    assert found.time().tolist() == TIME_4.tolist()


def test_texts_and_sparse_matrices_of_version_4(tmp_path):
    """Letters are numbers by column; a sparse matrix is left out by name."""
    letters = np.array([[ord(c) for c in row] for row in ("ab", "cd")])
    path = tmp_path / "run.mat"
    path.write_bytes(
        matrix("t", TIME_4[:, None]) + matrix("note", letters, text=1) + matrix("s", np.ones((4, 3)), text=2)
    )
    found = reading.read(path)
    assert found.recording.metadata["note"] == "ab\ncd"
    assert "s (a sparse matrix)" in found.message("left_out")


def test_a_cut_in_version_4_names_the_matrix(tmp_path):
    """The matrices before it can be had by one who accepts the cut."""
    path = tmp_path / "run.mat"
    path.write_bytes((matrix("t", TIME_4[:, None]) + matrix("a", TIME_4[:, None]))[:-1])
    found = reading.read(path)
    assert "inside matrix 'a'" in found.message("cut_file")
    assert [c.name for c in found.group().channels] == ["t"]


def test_a_header_of_version_4_that_cannot_be_is_refused(tmp_path):
    """A second header of another type, sides below zero."""
    path = tmp_path / "run.mat"
    for odd in (struct.pack("<5i", 7777, 1, 1, 0, 2), struct.pack("<5i", 0, -1, 1, 0, 2)):
        path.write_bytes(matrix("t", TIME_4[:, None]) + odd + b"x\0" + bytes(8))
        with pytest.raises(Refusal, match="a matrix of type"):
            reading.read(path)
