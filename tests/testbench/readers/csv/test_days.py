"""Times without a unit that are days of a calendar, as spreadsheets and MATLAB count them."""

import pytest
from scipy import io

from .. import reading

DAY_S = 86_400


@pytest.fixture
def log(tmp_path):
    """Write 300 times, from a first one at a step, as a text and read it."""

    def write_and_read(first, step, name="Time"):
        rows = "".join(f"{first + i * step:.12f},{i % 7}.5\n" for i in range(300))
        (tmp_path / "log.csv").write_text(f"{name},F (N)\n{rows}")
        return reading.read(tmp_path / "log.csv")

    return write_and_read


@pytest.mark.parametrize("first", [45352.4166, 739312.4166])
@pytest.mark.parametrize("rate_hz", [1000, 100, 1])
def test_days_are_not_taken_for_seconds(log, first, rate_hz):
    """A log of 1 kHz whose times are days would be one of 86 MHz: no rate is given, and why is said."""
    found = log(first, 1 / rate_hz / DAY_S)
    assert found.checks["log"].rate_hz is None
    assert "time_unit_unknown" in found.codes
    assert "time_unit_assumed" not in found.codes


@pytest.mark.parametrize(("first", "step"), [(45352.4166, 0.001), (0.0, 1e-5), (45352.0, 1.0), (1.0e5, 1e-5)])
def test_seconds_stay_seconds(log, first, step):
    """Seconds of the day at 1 kHz, a log of 100 kHz from zero, and one of 1 Hz are seconds as before."""
    found = log(first, step)
    assert found.checks["log"].rate_hz == pytest.approx(1 / step, rel=1e-3)
    assert "time_unit_assumed" in found.codes


def test_a_unit_leaves_no_doubt(log):
    """Whatever the numbers, seconds that are written are seconds."""
    assert "time_unit_unknown" not in log(45352.4166, 1e-5, "Time (s)").codes


def test_days_of_matlab(tmp_path):
    """``datenum`` counts days from the year 0."""
    times = [739312.4 + i / 100 / DAY_S for i in range(100)]
    io.savemat(tmp_path / "run.mat", {"t": times, "F": range(100)})
    found = reading.read(tmp_path / "run.mat")
    assert found.checks["run"].rate_hz is None
    assert "time_unit_unknown" in found.codes
