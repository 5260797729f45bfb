"""Numbers that HDF5 holds in another form: unsigned in signed types, words for no value, records with texts."""

import h5py
import numpy as np
import pytest

from testbench.errors import RecordingError

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")


@pytest.fixture
def made(tmp_path):
    """A new file, and how to read it."""

    def make(write):
        with h5py.File(tmp_path / "run.h5", "w") as file:
            write(file)
        return reading.read(tmp_path / "run.h5")

    return make


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
