"""MATLAB files of version 4, as scipy writes them, and byte by byte."""

import struct

import numpy as np
import pytest
from scipy.io import savemat

from testbench.recording import Refusal, TimeColumn

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

TIME = np.arange(100) / 50


def matrix(name, values, kind=0, order="<", text=0):
    """A matrix of ``values`` (rows, columns): type MOPT, sides, real, name, numbers by column."""
    form = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}[kind]
    values = np.atleast_2d(values)
    head = struct.pack(f"{order}5i", 1000 * (order == ">") + 10 * kind + text, *values.shape, 0, len(name) + 1)
    return head + name.encode() + b"\0" + values.T.astype(order + form).tobytes()


def test_what_scipy_writes(tmp_path):
    """Arrays of one length are a group with its time; a number states the rate; texts are beside; complex numbers."""
    path = tmp_path / "run.mat"
    savemat(path, {"t": TIME, "a": np.c_[TIME, -TIME], "fs": 50.0, "who": "me", "z": np.arange(9) * 1j}, format="4")
    found = reading.read(path)
    assert found.recording.format == "MATLAB v4"
    assert found.column("a(:,2)").tolist() == (-TIME).tolist()
    assert found.column("z (imag)").tolist() == list(range(9))
    assert isinstance(found.groups["run 100"].clock, TimeColumn)
    assert (found.recording.metadata["who"], found.recording.stated_rate_hz) == ("me", 50.0)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", range(6))
def test_all_numbers_and_byte_orders(tmp_path, kind, order):
    """Doubles, singles, integers of three widths, of both byte orders."""
    path = tmp_path / "run.mat"
    path.write_bytes(matrix("t", TIME[:, None], order=order) + matrix("n", np.arange(100)[:, None], kind, order))
    found = reading.read(path)
    assert found.column("n").tolist() == list(range(100))
    assert found.time().tolist() == TIME.tolist()


def test_texts_and_sparse_matrices_are_beside(tmp_path):
    """Letters are numbers by column; a sparse matrix is left out by name."""
    letters = np.array([[ord(c) for c in row] for row in ("ab", "cd")])
    path = tmp_path / "run.mat"
    path.write_bytes(
        matrix("t", TIME[:, None]) + matrix("note", letters, text=1) + matrix("s", np.ones((4, 3)), text=2)
    )
    found = reading.read(path)
    assert found.recording.metadata["note"] == "ab\ncd"
    assert "s (a sparse matrix)" in found.message("left_out")


def test_a_cut_names_the_matrix(tmp_path):
    """The matrices before it can be had by one who accepts the cut."""
    path = tmp_path / "run.mat"
    path.write_bytes((matrix("t", TIME[:, None]) + matrix("a", TIME[:, None]))[:-1])
    found = reading.read(path)
    assert "inside matrix 'a'" in found.message("cut_file")
    assert [c.name for c in found.group().channels] == ["t"]


def test_a_header_that_cannot_be_is_refused(tmp_path):
    """A second header of another type, sides below zero."""
    path = tmp_path / "run.mat"
    for odd in (struct.pack("<5i", 7777, 1, 1, 0, 2), struct.pack("<5i", 0, -1, 1, 0, 2)):
        path.write_bytes(matrix("t", TIME[:, None]) + odd + b"x\0" + bytes(8))
        with pytest.raises(Refusal, match="a matrix of type"):
            reading.read(path)
