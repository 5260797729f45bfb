"""MATLAB files of version 4 and 5, as scipy writes them, and byte by byte."""

import re
import struct
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import eye

from testbench.recording import TimeColumn, UniformClock

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

RANDOM = np.random.default_rng(5)
TIME = np.arange(50) / 128
COLUMN = TIME[:, None]
HEAD = b"MATLAB 5.0 MAT-file".ljust(124)


@pytest.fixture
def saved(tmp_path):
    """A file of these variables by scipy, or of these bytes."""

    def save(content=b"", *, packed=False, version="5", **variables):
        path = tmp_path / "test.mat"
        if variables:
            savemat(path, variables, do_compression=packed, format=version)
        else:
            path.write_bytes(content)
        return path

    return save


def matrix(name, values, kind=0, order="<", text=0):
    """A matrix of version 4 of ``values`` (rows, columns): type MOPT, sides, real, name, numbers by column."""
    form = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}[kind]
    values = np.atleast_2d(values)
    head = struct.pack(f"{order}5i", 1000 * (order == ">") + 10 * kind + text, *values.shape, 0, len(name) + 1)
    return head + name.encode() + b"\0" + values.T.astype(order + form).tobytes()


def test_bytes_of_the_other_order_are_read(saved):
    """A big-endian file, by hand."""
    name, data = b"acc", np.arange(5.0)
    body = struct.pack(">IIBBBBI", 6, 8, 0, 0, 0, 6, 0) + struct.pack(">IIii", 5, 8, 5, 1)
    body += struct.pack(">HH4s", len(name), 1, name) + struct.pack(">II", 9, 40) + data.astype(">f8").tobytes()
    path = saved(HEAD + b"\x01\x00MI" + struct.pack(">II", 14, len(body)) + body)
    assert reading.read(path).column("acc").tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("packed", [False, True])
def test_matrices_are_a_channel_for_each_of_their_short_side(saved, packed):
    """Columns of a tall matrix and rows of a wide one; real and imaginary part of complex numbers."""
    table, frf = RANDOM.normal(size=(50, 3)), RANDOM.normal(size=50) + 1j * TIME
    found = reading.read(saved(packed=packed, tall=table, wide=table.T.copy(), frf=frf))
    for i in range(3):
        np.testing.assert_array_equal(found.column(f"tall(:,{i + 1})"), table[:, i])
        np.testing.assert_array_equal(found.column(f"wide({i + 1},:)"), table[:, i])
    np.testing.assert_array_equal(found.column("frf (real)"), frf.real)
    np.testing.assert_array_equal(found.column("frf (imag)"), frf.imag)


def test_lengths_are_groups_and_a_growing_time_is_the_clock(saved):
    """What is named time and grows is the clock of the arrays of its length; others have none."""
    found = reading.read(saved(Time_domain=TIME, Time_chan=np.cos(TIME), spectrum=np.ones(20)))
    assert found.groups["test 50"].clock == TimeColumn(0, 1.0, assumed=True)
    assert found.groups["test 20"].clock is None
    assert {"time_unit_assumed", "no_clock"} <= found.codes


def test_fields_and_cells_are_named_by_their_path(saved):
    """Structures are groups of their own, with their own time."""
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = np.ones(4), np.zeros(4)
    fast, slow = {"t_ms": TIME * 1000, "acc": np.sin(TIME)}, {"t": TIME[:9], "force": np.cos(TIME[:9])}
    found = reading.read(saved(fast=fast, slow=slow, note="hello", mass=2.5, c=cells))
    assert found.groups["test fast"].clock == TimeColumn(0, 1e-3)
    np.testing.assert_array_equal(found.column("slow.force"), np.cos(TIME[:9]))
    assert (found.recording.metadata["note"], found.recording.metadata["mass"]) == ("hello", "2.5")
    assert found.column("c{2}").tolist() == [0] * 4


def test_objects_without_dimensions_are_left_out(saved):
    """What MATLAB calls opaque has a name and no sides; the variables beside it are read."""
    path, name = saved(x=TIME), struct.pack("<HH4s", 1, 3, b"obj")
    body = struct.pack("<IIII", 6, 8, 17, 0) + name
    path.write_bytes(path.read_bytes() + struct.pack("<II", 14, len(body)) + body)
    found = reading.read(path)
    np.testing.assert_array_equal(found.column("x"), TIME)
    assert "obj (an opaque object)" in found.message("left_out")


@pytest.mark.parametrize(("name", "value"), [("fs", 128.0), ("Sample_Rate", 128.0), ("dt", 1 / 128)])
def test_a_single_number_may_state_the_rate(saved, name, value):
    """fs and dt are the clock of arrays without a time column."""
    assert reading.read(saved(x=TIME**2, **{name: value})).group().clock == UniformClock(128.0)


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        (
            {"x": TIME, "cube": np.ones((3, 3, 3)), "sparse": eye(3).tocsc()},
            "no series of numbers: cube (an array of 3 x 3 x 3), sparse (a sparse matrix)",
        ),
        ({"t": TIME * 128 / 1279.9, "x": TIME, "fs": 1280.0}, "states 1280 Hz, the times give 1279.9 Hz"),
    ],
)
def test_what_is_said_of_variables(saved, variables, message):
    """Three dimensions and sparse matrices are left out by name; a rate that is a little off."""
    assert message in reading.said(saved(**variables))


@pytest.mark.parametrize("packed", [False, True])
def test_a_cut_file_names_the_last_whole_variable(saved, packed):
    """And the one that is cut, where its name is there."""
    path = saved(packed=packed, first=TIME, second=RANDOM.normal(size=500))
    path.write_bytes(path.read_bytes()[:-30])
    found = reading.read(path)
    assert packed or "inside variable 'second'" in found.message("cut_file")
    assert "the last whole variable is 'first'" in found.message("cut_file")
    assert len(found.group().channels) == 1


EARLY = zlib.compress(bytes(4000))[:-6]
OLD = matrix("t", COLUMN)


def stream(packed):
    """A file of one compressed variable."""
    return HEAD + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda: stream(EARLY), "cut_file.*ends too early"),
        (lambda: stream(zlib.compress(bytes((64 << 20) + 1), 1)), "too_large.*unpack to more than"),
        (lambda: OLD + struct.pack("<5i", 7777, 1, 1, 0, 2) + b"x\0" + bytes(8), "damaged_file.*a matrix of type 7777"),
        (
            lambda: OLD + struct.pack("<5i", 0, -1, 1, 0, 2) + b"x\0" + bytes(8),
            "damaged_file.*a matrix of type 0, -1 x 1",
        ),
        (lambda: HEAD + b"\x00\x02IM" + stream(EARLY)[128:], "damaged_file.*version 2 at byte 124; expected 1"),
    ],
    ids=["a stream that ends early", "a bomb", "no type of version 4", "sides below zero", "of version 7.3"],
)
def test_hostile_variables_are_refused(saved, content, message):
    """By what is wrong, before anything is allocated for them."""
    assert re.match(message, reading.said(saved(content())))


def test_declared_sizes_that_are_not_there_are_refused(saved):
    """Dimensions of gigabytes over fifty numbers."""
    path = saved(x=TIME)
    path.write_bytes(path.read_bytes().replace(struct.pack("<ii", 1, 50), struct.pack("<ii", 1, 1 << 30)))
    assert "variable 'x' cannot be read" in (text := reading.said(path))
    assert "reshape" in text


def test_version_4_as_scipy_writes_it(saved):
    """Arrays of one length are a group with its time; a number states the rate; texts are metadata; complex numbers."""
    path = saved(version="4", t=TIME, a=np.c_[TIME, -TIME], fs=128.0, who="me", z=np.arange(9) * 1j)
    found = reading.read(path)
    assert found.recording.format == "MATLAB v4"
    assert found.column("a(:,2)").tolist() == (-TIME).tolist()
    assert found.column("z (imag)").tolist() == list(range(9))
    assert isinstance(found.groups["test 50"].clock, TimeColumn)
    assert (found.recording.metadata["who"], found.recording.stated_rate_hz) == ("me", 128.0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", range(6))
def test_numbers_and_byte_orders_of_version_4(saved, kind, order):
    """Doubles, singles, integers of three widths, of both byte orders."""
    found = reading.read(saved(matrix("t", COLUMN, 0, order) + matrix("n", np.arange(50)[:, None], kind, order)))
    assert found.column("n").tolist() == list(range(50))
    assert found.time().tolist() == TIME.tolist()


def test_texts_sparse_matrices_and_a_cut_of_version_4(saved):
    """Letters are numbers by column; a sparse matrix is left out by name; the matrices before a cut can be had."""
    letters = np.array([[ord(c) for c in row] for row in ("ab", "cd")])
    content = OLD + matrix("note", letters, text=1) + matrix("s", np.ones((4, 3)), text=2) + matrix("a", COLUMN)
    found = reading.read(saved(content[:-1]))
    assert found.recording.metadata["note"] == "ab\ncd"
    assert "s (a sparse matrix)" in found.message("left_out")
    assert "inside matrix 'a'" in found.message("cut_file")
    assert [c.name for c in found.group().channels] == ["t"]
