"""Time by index and rate: after ten hours as exact as in the first second, in every form."""

from fractions import Fraction

import h5py
import numpy as np
import polars
import pytest

from testbench.export import export, sep005
from testbench.recording import Channel, Group, UniformClock
from testbench.store import writer
from testbench.store.run import open_run
from testbench.store.writer import RunWriter

RATES = {"1/5120 s": 5120.0, "1/3 kHz": 1000 / 3, "3 kHz": 3000.0, "48/7 kHz": 48000 / 7}
TEN_HOURS_S = 36_000
SAMPLES = writer.GATHERED + 3


@pytest.fixture(scope="module", params=RATES)
def run(request, tmp_path_factory):
    """A run of one channel at a rate."""
    group = Group("daq", (Channel("AccX (g)", "g", "AccX"),), UniformClock(RATES[request.param]))
    with RunWriter(tmp_path_factory.mktemp("c"), "r001") as writer:
        writer.group(group).append([np.arange(float(SAMPLES))])
        writer.group(group).finish(RATES[request.param], "declared")
        writer.describe("simulated", {}, [], {"sources": []}, None)
        return open_run(writer.commit())


def exact(rate_hz, begin, end):
    """The float64 next to index / rate, by whole numbers alone."""
    return np.array([float(Fraction(i) / Fraction(rate_hz)) for i in range(begin, end)])


@pytest.mark.parametrize("rate_hz", RATES.values(), ids=RATES)
def test_the_last_samples_of_ten_hours(rate_hz):
    """Each is index / rate, rounded once: 184,320,000 steps of 1/5120 s end at ten hours, to the bit."""
    count = round(TEN_HOURS_S * rate_hz)
    times = UniformClock(rate_hz).times(count - 1000, count + 1)
    assert times.tobytes() == exact(rate_hz, count - 1000, count + 1).tobytes()
    assert np.ptp(np.diff(times)) <= 2 * np.spacing(float(TEN_HOURS_S))
    late = UniformClock(rate_hz, 0.25).times(count - 1000, count)
    np.testing.assert_array_max_ulp(late, times[:-1] + 0.25, 1)
    if rate_hz == 5120.0:
        assert count == 184_320_000
        assert times[-1] == TEN_HOURS_S


def test_in_memory_and_in_the_file(run):
    """time(), pandas, xarray, the dataset that others read, and the archive's."""
    expected = exact(run.rate_hz, SAMPLES - 500, SAMPLES).tobytes()
    assert run.time()[-500:].tobytes() == expected
    assert run.to_pandas().index.to_numpy()[-500:].tobytes() == expected
    assert run.to_xarray()["time"].to_numpy()[-500:].tobytes() == expected
    with h5py.File(run.path) as file:
        assert file["entry/daq/time"][-500:].tobytes() == expected
    assert [series["fs"] for series in sep005(run)] == [run.rate_hz]


def test_in_every_export(run, tmp_path):
    """CSV, Parquet, MAT, UFF: the last samples to the bit."""
    from scipy.io import loadmat

    expected = exact(run.rate_hz, SAMPLES - 500, SAMPLES)
    files = {to: export(run, to, tmp_path / to)[0].file for to in ("csv", "parquet", "mat", "uff")}
    lines = files["csv"].read_text("utf-8").splitlines()[-500:]
    assert [float(line.partition(",")[0]) for line in lines] == expected.tolist()
    assert polars.read_parquet(files["parquet"])["time (s)"].to_numpy()[-500:].tobytes() == expected.tobytes()
    content = loadmat(files["mat"], simplify_cells=True)
    assert content["group_daq"]["channel_time_s"]["data"][-500:].tobytes() == expected.tobytes()
    pyuff = pytest.importorskip("pyuff")
    assert pyuff.UFF(str(files["uff"])).read_sets()["x"][-500:].tobytes() == expected.tobytes()
