"""Levels of a run's channels: all metrics and the spectrum, the same alone and in company."""

import numpy as np
import pytest
from scipy.signal import welch as scipy_welch

from balance.results import plain
from studies import simulated_runs as memory
from testbench.errors import AnalysisError
from testbench.rig import rig_from_text
from testbench.runs.si_run import SIRun, physical
from testbench.store import open_campaign
from testbench.vibration.channel_levels import channel_levels, level_definitions, levels_of_runs
from testbench.vibration.metrics import DEFAULT_BAND, METRICS, Measure


@pytest.fixture(scope="module")
def runs(brief):
    """Two stored runs."""
    return open_campaign(brief.campaign).runs[:2]


def test_metrics_are_those_of_the_reductions(runs):
    """Peak, peak to peak and RMS of the base are what a reduction takes of it in one band, to rounding."""
    run = SIRun.of(runs[0])
    for level in channel_levels(run, run.rig.sensors["base_acc"].columns("base_acc")):
        for metric in METRICS:
            amplitude = Measure(metric, DEFAULT_BAND).amplitude(*run.signal(level.column))
            assert level.metrics[metric] == pytest.approx(amplitude, rel=1e-12)
        assert level.metrics.keys() <= level_definitions(level.band).keys()


def test_many_runs_are_each_as_alone(runs):
    """Side by side, in the order of the runs, with the same numbers to the bit."""
    found = list(levels_of_runs(runs))
    assert [run.name for run, _ in found] == [run.name for run in runs]
    for run, some in found:
        alone = channel_levels(SIRun.of(run), SIRun.of(run).rig.columns())
        assert plain(some) == plain(alone)


def test_a_line_in_the_noise_is_found():
    """A 63 Hz line of 0.1 m/s2 that is put into the base's record stands first among the peaks, others are not seen."""
    run = memory.scene("x", payload=5.0, masses={}).run(0)
    column = SIRun.of(run).rig.sensors["base_acc"].columns("base_acc")[0]
    time = np.arange(60_000) / 5000.0
    quiet = np.random.default_rng(2).normal(0.0, 0.001, len(time))
    line = memory.with_values(run, "AccX", quiet + np.sin(2 * np.pi * 63.0 * time) / 98.1)
    stated = "[sensors.base_acc.calibration.uncertainty]\nexpanded = '1 %'\ncoverage_factor = 2\n"
    certified = rig_from_text(SIRun.of(line).rig.text + stated)
    level, *_ = channel_levels(SIRun(line, certified), certified.sensors["base_acc"].columns("base_acc"))
    assert plain(level)["calibration_percent"] == pytest.approx(0.5 * 1.959964)
    assert [peak["frequency_hz"] for peak in level.peaks] == [pytest.approx(63.0, abs=5000.0 / 4096.0)]
    (nothing,) = channel_levels(SIRun.of(memory.with_values(run, "AccX", quiet)), [column])
    assert (nothing.peaks, nothing.calibration) == ([], None)


def test_a_table_of_spectra_is_that_of_scipy(runs):
    """In SI, of loggers of two rates: each channel at its own lines alone; also by the name that the log has."""
    run = runs[0]
    found = run.spectra(["base_acc x", "Fz1", "tau1"], 256)
    assert found.attrs["units"] == {"base_acc x": "(m/s^2)^2/Hz", "k6d40 Fz": "(N)^2/Hz", "motor_A0 A0": "(N m)^2/Hz"}
    tables = [physical(run).to_pandas(group.name) for group in run.groups]
    for name, label in zip(found, ("AccX", "Fz1", "tau1"), strict=True):
        (table,) = [table for table in tables if any(column.startswith(f"{label} (") for column in table)]
        values = next(table[column].to_numpy() for column in table if column.startswith(f"{label} ("))
        frequency, density = scipy_welch(values, 1.0 / np.diff(table.index).mean(), nperseg=256)
        shown = found[name].dropna()
        np.testing.assert_allclose(shown.index, frequency, rtol=1e-6)
        np.testing.assert_allclose(shown, density, rtol=1e-5, atol=1e-9 * density.max())
        assert found.attrs["resolution_hz"][name] == pytest.approx(frequency[1], rel=1e-6)
    with pytest.raises(AnalysisError, match="'AccW' is no channel of its rig: there are base_acc x, base_acc y"):
        run.spectra(["AccW"])
