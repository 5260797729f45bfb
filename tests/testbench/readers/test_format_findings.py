"""What all binary formats report in the same words."""

import h5py
import numpy as np
import polars
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from . import reading
from .reading import in_process  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_process")

WIDE = np.array([1, 2**53 + 1])


def _hdf5(path):
    with h5py.File(path, "w") as file:
        file["a"] = WIDE


def _tdms(path):
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("DAQ", "a", WIDE)])


WRITERS = {
    "h5": _hdf5,
    "mat": lambda path: savemat(path, {"a": WIDE}),
    "parquet": lambda path: polars.DataFrame({"a": WIDE}).write_parquet(path),
    "tdms": _tdms,
}


@pytest.mark.parametrize("kind", WRITERS)
def test_integers_that_float64_rounds_are_a_finding(tmp_path, kind):
    """2**53 + 1 has no float64: the channel is named."""
    path = tmp_path / f"run.{kind}"
    WRITERS[kind](path)
    (finding,) = [finding for finding in reading.read(path).findings if finding.code == "not_exact"]
    assert finding.channel == "a"
