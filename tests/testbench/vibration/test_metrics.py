"""Amplitudes name their metric, and are those of closed forms; channels come in SI or not at all."""

from pathlib import Path

import numpy as np
import pytest

from balance.results import document
from testbench import rig as rigs
from testbench.errors import AnalysisError
from testbench.recording import Channel, UniformClock
from testbench.rig import Column
from testbench.runs.si_run import SIRun
from testbench.signal.filters import Band
from testbench.store import Run, StoredGroup, open_run
from testbench.store.writer import RunWriter
from testbench.vibration.metrics import Measure

RATE = 1000.0
TIME = np.arange(4000) / RATE


@pytest.mark.parametrize(("metric", "amplitude"), [("peak", 3.0), ("peak_to_peak", 6.0), ("rms", 3.0 / np.sqrt(2.0))])
def test_metrics_of_a_sine(metric, amplitude):
    """A sine of amplitude 3 on an offset has peak 3, peak-to-peak 6, RMS 3 / sqrt 2."""
    sine = 3.0 * np.sin(2 * np.pi * 5 * TIME) + 7.0
    assert Measure(metric, None).amplitude(sine, RATE) == pytest.approx(amplitude, rel=1e-6)
    assert Measure(metric, Band(0.0, 200.0)).amplitude(sine, RATE) == pytest.approx(amplitude, rel=2e-2)


def test_a_measure_says_what_it_is():
    """Metric, offset and band stand in its text."""
    assert str(Measure("rms", None)) == "rms (root mean square over the whole record), mean removed, band not limited"
    assert str(Measure("peak")).endswith("offset and ramp removed, band 1..200 Hz")
    assert document(Measure("peak", Band(1.0, 50.0))) == {"metric": "peak", "band_hz": [1.0, 50.0]}


def test_a_metric_that_is_none_is_refused():
    """With what is expected, and what may have been meant."""
    with pytest.raises(AnalysisError, match="metric: 'RMS': expected peak, peak_to_peak, rms; did you mean 'rms'"):
        Measure("RMS")


@pytest.mark.parametrize("ramp", [0.0, 9.81, -40.0])
def test_a_ramp_is_no_vibration(ramp):
    """An offset and a ramp many times the vibration do not show above a lower end of zero; a base that rests before and
    after its motion has nothing there, so that the amplitude is that of the whole.
    """
    swing = np.gradient(np.gradient(np.exp(-(((TIME - 2.0) / 0.05) ** 2)), TIME), TIME)
    drifted = swing + 3.0 + ramp * TIME / TIME[-1]
    assert Measure().amplitude(drifted, RATE) == pytest.approx(Measure(band=None).amplitude(swing, RATE), rel=2e-3)
    assert Measure().amplitude(drifted, RATE) == pytest.approx(Measure().amplitude(swing, RATE), rel=1e-9)


def stored(folder: Path, unit: str | None, values: np.ndarray, rate: float | None = RATE) -> Run:
    """A run of one channel."""
    label = "AccX" if unit is None else f"AccX ({unit})"
    clock = UniformClock(RATE) if rate else None
    group_of = StoredGroup("daq", (Channel(label, unit, "AccX"),), clock)
    with RunWriter(folder, "r") as writer:
        group = writer.group(group_of)
        group.append((values,))
        group.finish(rate, "declared" if rate else None)
        writer.describe("simulated", {}, [], {"sources": []}, None)
        writer.commit()
    return open_run(folder / "r.h5")


def column(unit: str) -> Column:
    """The channel as a rig describes it."""
    return Column("AccX", "acc", "x", "daq", unit, ("acceleration",))


def signal(run: Run, column: Column) -> tuple[np.ndarray, float]:
    """The channel in SI, of a rig that knows no other."""
    rig = rigs.rig_from_text('mechanism = "none"\n[loggers.daq]\n[sensors.acc]\nkind = "accelerometer"\n'
                             'logger = "daq"\nchannels = { x = "AccX" }\n'
                             'position = ["0 m", "0 m", "0 m"]\n')  # fmt: skip
    return SIRun.of(run, rig).signal(column)


@pytest.mark.parametrize(("unit", "factor"), [("g", 9.81), ("m/s^2", 1.0), ("mm/s2", 1e-3)])
def test_units_of_the_log(tmp_path, unit, factor):
    """The unit of the log decides; g is g0 = 9.81 m/s2."""
    run = stored(tmp_path, unit, TIME)
    assert signal(run, column(unit))[0] == pytest.approx(factor * TIME)
    assert signal(run, column(""))[0] == pytest.approx(factor * TIME)


def test_unit_of_the_rig(tmp_path):
    """Where the log has no unit, or one that nobody knows, that of the rig counts."""
    assert signal(stored(tmp_path, None, TIME), column("g"))[0] == pytest.approx(9.81 * TIME)
    assert signal(stored(tmp_path / "odd", "Ausschlag", TIME), column("g"))[0] == pytest.approx(9.81 * TIME)


@pytest.mark.parametrize(
    ("logged", "rigged", "said"),
    [
        (None, "", "no unit"),
        ("g", "m/s^2", "'g' by its log and in 'm/s\\^2' by the rig"),
        ("V", "", "'V'"),
        ("Gal", "g", "correct one"),
        ("Ausschlag", "", "'Ausschlag' is not a known unit"),
    ],
)
def test_doubtful_units(tmp_path, logged, rigged, said):
    """No unit, two units, or one of something else: refused with run and channel."""
    with pytest.raises(AnalysisError, match=f"r: channel 'AccX'.*{said}"):
        signal(stored(tmp_path, logged, TIME), column(rigged))


def test_no_number(tmp_path):
    """A sample that is no number is named, not skipped."""
    values = TIME.copy()
    values[17] = np.nan
    with pytest.raises(AnalysisError, match="sample 17"):
        signal(stored(tmp_path, "g", values), column("g"))


def test_no_clock(tmp_path):
    """A channel without a rate is refused."""
    with pytest.raises(AnalysisError, match="no sampling rate"):
        signal(stored(tmp_path, "g", TIME, None), column("g"))
