"""What a page keeps of a time series: every peak, every gap, and no more bytes than there is room for."""

import base64

import numpy as np
import pytest

from balance.report.plotted import BYTES_PER_VALUE, STEPS, plotted, spans_for, spectrum


def shown(one):
    """Time and values as the page's script makes them, NaN where there is nothing."""
    raw = np.frombuffer(base64.b64decode(one.as_dict()["values"]), "<i2").astype(float)
    raw[raw == -32768] = np.nan
    low, high = one.limits
    time = one.start + (np.arange(len(raw)) + (0.0 if one.whole else 0.5)) * one.step
    return time, low + (raw + STEPS // 2) * (high - low) / STEPS


@pytest.mark.parametrize("count", [3, 1000, 50_001])
def test_every_peak_is_kept(count):
    """Least and largest of every span are those of its samples, to the rounding that is stated, in their order."""
    rng = np.random.default_rng(count)
    time, values = 0.7 + np.arange(count) / 1e4, rng.standard_normal(count)
    values[count // 3] = 40.0  # one sample
    one = plotted("kind", "name", "m", time, values, 200)
    at, found = shown(one)
    rounding = 0.5 * np.ptp(values) / STEPS * (1.0 + 1e-9)
    assert np.nanmax(found) == pytest.approx(40.0, abs=rounding)
    assert np.nanmin(found) == pytest.approx(values.min(), abs=rounding)
    assert one.whole == (count <= 400)
    spans = len(found) // 2
    for k in range(0, spans, 17) if not one.whole else ():
        inside = values[np.minimum(((time - time[0]) / (2 * one.step)).astype(int), spans - 1) == k]
        assert sorted(found[2 * k : 2 * k + 2]) == pytest.approx([inside.min(), inside.max()], abs=rounding)
        assert (found[2 * k] < found[2 * k + 1]) == (inside.argmin() < inside.argmax())
    assert at[-1] <= time[-1] + 1e-9
    assert abs(at[int(np.nanargmax(found))] - time[count // 3]) <= 2.0 * one.step


def test_a_sample_without_an_instant_is_not_drawn():
    """The others stand where they stood."""
    time, values = np.arange(5000) / 1e3, np.sin(np.arange(5000) / 300.0)
    torn = np.where(np.isin(np.arange(5000), (1, 2499, 4998)), np.nan, time)
    at, found = shown(plotted("kind", "name", "m", torn, values, 300))
    np.testing.assert_allclose(found, np.interp(at, time, values), atol=0.04)


def test_gaps_stay_gaps():
    """Where the log has no sample for longer than a span, and where its values are NaN, nothing is drawn."""
    time = np.r_[np.arange(5000), np.arange(7000, 12000)] / 1e3
    values = np.sin(time)
    values[:1000] = np.nan
    at, found = shown(plotted("kind", "name", "m", time, values, 300))
    assert np.isnan(found[(at > 5.1) & (at < 6.9)]).all()
    assert np.isnan(found[at < 0.9]).all()
    assert np.isfinite(found[(at > 1.1) & (at < 4.9)]).all()


@pytest.mark.parametrize("samples", [[100_000] * 1872, [100_000] * 3 + [1000] * 2000, [500, 700]])
def test_all_series_fit_the_budget(samples):
    """156 runs of 10 s, 12 channels, 10 kHz: below 12 MB as base64; short series stay whole, few are not cut at all."""
    spans = spans_for(samples)
    assert sum(min(count, 2 * spans) for count in samples) * BYTES_PER_VALUE < 12e6
    assert spans >= 500
    if sum(samples) < 1e6:
        assert 2 * spans >= max(samples)


def test_a_spectrum_keeps_its_peaks():
    """The largest line of each cell, at its own frequency."""
    frequency = np.linspace(0.0, 500.0, 20_001)
    density = np.full(20_001, 1e-6)
    density[3333] = 2.0
    one = spectrum("kind", "name", "m", frequency, density)
    top = int(np.argmax(one["density"]))
    assert one["density"][top] == 2.0
    assert one["frequency_hz"][top] == pytest.approx(frequency[3333], rel=1e-4)
    assert len(one["density"]) <= 400
