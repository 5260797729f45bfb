"""Loggers: their own clock and what it loses, noise, range, steps, analogue filters."""

import numpy as np
import pytest

from testbench.rig import Column
from testbench.rig.bench import Logger
from testbench.simulator.loggers import (
    digitized,
    draw_samples,
    high_pass,
    low_pass,
    record_log,
    sample_instants,
    start_logger,
)

TIME = np.arange(20_001) / 10_000.0


def logger(**settings) -> Logger:
    """A logger of 1 kHz that starts 0.1 s before the motion."""
    return Logger.model_validate({"rate": "1 kHz", "start": "-0.1 s", **settings})


def rng(seed: int = 1):
    """A stream."""
    return np.random.default_rng(seed)


def column(**settings) -> Column:
    """A channel in g."""
    return Column("A", "acc", "x", "daq", "g", ("acceleration",), **settings)


def test_drift():
    """A clock that is 1000 ppm fast has taken 1000 samples a second of its own in 1/1.001 s."""
    own, true = sample_instants(logger(drift_ppm=1000.0), 2.0)
    assert own[1000] == pytest.approx(1.0)
    assert true[1000] == pytest.approx(-0.1 + 1.0 / 1.001)
    assert true[0] == -0.1
    assert 2.0 - 1e-3 < true[-1] <= 2.0


def test_rest_before_and_after():
    """Before the motion and after it a logger records the state of rest."""
    log = record_log(logger(), [column()], TIME, {"A": 9.81 * np.minimum(TIME, 1.0)}, (0, 0))
    assert not np.any(log.columns["A"][log.time < 0.1])
    assert log.columns["A"][-1] == pytest.approx(1.0)


def test_unit():
    """Values are written in the unit of the log."""
    assert digitized(column(), np.full(3, 19.62), rng(7)) == pytest.approx([2.0] * 3)


def test_clipping():
    """Nothing goes beyond the range of the sensor."""
    values = digitized(column(range=98.1, noise=50.0), 200.0 * np.sin(TIME), rng(7))
    assert np.abs(values).max() == pytest.approx(10.0)


def test_resolution():
    """Values lie on the steps of the converter, at most half a step off."""
    signal = np.sin(9 * TIME)
    values = digitized(column(resolution=0.0981), signal, rng(7))
    assert values / 0.01 == pytest.approx(np.round(values / 0.01), abs=1e-9)
    assert np.abs(values * 9.81 - signal).max() <= 0.0981 / 2 + 1e-12


def test_noise():
    """Noise has the stated standard deviation, no mean, and no memory."""
    values = 9.81 * digitized(column(noise=0.3), np.zeros(20_000), rng(7))
    assert values.std() == pytest.approx(0.3, rel=0.02)
    assert abs(values.mean()) < 4 * 0.3 / np.sqrt(20_000)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 4 / np.sqrt(20_000)


def test_noise_of_its_own():
    """The noise of a channel does not depend on which other channels there are."""
    other = Column("B", "acc", "y", "daq", "g", ("acceleration",), noise=0.3)
    signals = {"A": np.zeros_like(TIME), "B": np.zeros_like(TIME)}
    alone = record_log(logger(), [column(noise=0.3)], TIME, signals, (1, 2))
    both = record_log(logger(), [column(noise=0.3), other], TIME, signals, (1, 2))
    assert np.array_equal(alone.columns["A"], both.columns["A"])
    assert not np.array_equal(both.columns["A"], both.columns["B"])


def test_zero_in_zero_out():
    """Without noise a signal of zero is written as zero, without a sign."""
    values = digitized(column(resolution=0.1, range=10.0), np.array([0.0, -0.0, -0.01]), rng(7))
    assert not np.signbit(values).any()
    assert not values.any()


STEP = 1e-4
LONG = np.arange(60_000) * STEP


def gain(filtered, frequency: float) -> complex:
    """Of the settled answer to a cosine."""
    signal = filtered(np.cos(2 * np.pi * frequency * LONG))
    late = LONG >= 3.0
    return 2.0 * np.mean(signal[late] * np.exp(-2j * np.pi * frequency * LONG[late]))


@pytest.mark.parametrize("frequency", [10.0, 100.0, 200.0, 400.0])
def test_butterworth(frequency):
    """Of fourth order: 1 / sqrt(1 + (f / f0)^8), and its poles' phase."""
    found = gain(lambda s: low_pass(s, 200.0, STEP), frequency)
    x = 1j * frequency / 200.0
    expected = np.prod([1.0 / (x**2 + 2.0 * np.cos(a) * x + 1.0) for a in (np.pi / 8, 3 * np.pi / 8)])
    assert abs(expected) == pytest.approx(1.0 / np.sqrt(1.0 + (frequency / 200.0) ** 8))
    lines_between_samples = np.sinc(frequency * STEP) ** 4  # two sections, each from a signal of straight lines
    assert found == pytest.approx(expected * lines_between_samples, abs=2e-3 * abs(expected))


def test_delay_of_the_low_pass():
    """What is slow beside the corner comes later by the stated delay, and not smaller."""
    logger = Logger.model_validate({"low_pass": "200 Hz"})
    found = gain(lambda s: low_pass(s, 200.0, STEP), 5.0)
    assert -np.angle(found) / (2 * np.pi * 5.0) == pytest.approx(logger.delay, rel=1e-3)
    assert abs(found) == pytest.approx(1.0, abs=1e-4)
    assert Logger().delay == 0.0


@pytest.mark.parametrize("frequency", [0.5, 1.0, 20.0])
def test_high_pass(frequency):
    """First order: i f / (f0 + i f)."""
    found = gain(lambda s: high_pass(s, 1.0, STEP), frequency)
    assert found == pytest.approx(1j * frequency / (1.0 + 1j * frequency), abs=5e-3)


def test_filters_at_rest():
    """What stands still passes the low pass as it is, and a high pass not at all."""
    assert low_pass(np.full(500, 3.0), 200.0, STEP) == pytest.approx(np.full(500, 3.0))
    assert not np.any(high_pass(np.full(500, 3.0), 1.0, STEP))


def test_step_decays():
    """A charge amplifier forgets a constant load with its time constant."""
    load = np.where(LONG > 0.0, 5.0, 0.0)
    assert high_pass(load, 0.5, STEP)[20_000] == pytest.approx(5.0 * np.exp(-2 * np.pi * 0.5 * 2.0), rel=1e-3)


def test_filter_in_a_logger():
    """A logger's anti-alias filter takes out what would fold; what a controller computed it leaves alone."""
    fast, shared = np.sin(2 * np.pi * 900.0 * LONG), ("acc", "x", "daq", "m/s^2", ("acceleration",))
    columns = [Column("A", *shared), Column("T", *shared, commanded=True)]
    logger = Logger.model_validate({"rate": "1 kHz", "start": "0 s", "low_pass": "250 Hz"})
    log = record_log(logger, columns, LONG, {"A": fast, "T": fast}, (1, 1))
    assert np.abs(log.columns["A"][500:]).max() < 0.01
    assert np.abs(log.columns["T"][500:]).max() > 0.9


TEN_SECONDS = np.arange(100_001) / 10_000.0


def prompt(**settings) -> Logger:
    """A logger of 1 kHz that starts with the motion."""
    return logger(**{"start": "0 s", **settings})


def ramp(**settings):
    """What a logger makes of a ramp of 1 g a second: the value tells the true instant."""
    column = Column("A", "acc", "x", "daq", "g", ("acceleration",))
    return record_log(prompt(**settings), [column], TEN_SECONDS, {"A": 9.81 * TEN_SECONDS}, (1, 2))


def test_regular_clock():
    """Without scatter and losses every instant is on the grid."""
    found = draw_samples(prompt(), 2.0, rng())
    assert found.logged == pytest.approx(np.arange(2001) / 1000.0)
    assert np.array_equal(found.true_time, found.logged)
    assert found.lost == 0


def test_jitter():
    """Instants scatter by what is stated about the grid; a recorded clock shows them, a uniform one the grid."""
    for clock in ("recorded", "uniform"):
        found = draw_samples(prompt(jitter="50 us", clock=clock, drift_ppm=100.0), 10.0, rng())
        off = found.true_time - np.arange(len(found.true_time)) / 1000.0 / (1 + 1e-4)
        assert off[1:].std() == pytest.approx(50e-6, rel=0.03)
        assert (np.diff(found.true_time) > 0.0).all()
        shown = found.logged - np.arange(len(found.logged)) / 1000.0
        assert shown == pytest.approx(off * (1 + 1e-4) * (clock == "recorded"), abs=1e-12)


def test_lost_samples():
    """A share of samples is missing: gaps of a recorded clock; on a uniform one all that follows moves up."""
    recorded, uniform = (ramp(lost=0.01, clock=clock) for clock in ("recorded", "uniform"))
    assert recorded.lost == uniform.lost == 10_001 - len(recorded.time)
    assert recorded.lost / 10_001 == pytest.approx(0.01, rel=0.3)
    assert recorded.columns["A"] == pytest.approx(recorded.time, abs=1e-9)
    gaps = np.diff(recorded.time) / 1e-3
    assert gaps == pytest.approx(np.round(gaps), abs=1e-6)
    assert round((gaps - 1.0).sum()) == recorded.lost - (10_000 - round(recorded.time[-1] / 1e-3))
    assert np.diff(uniform.time) == pytest.approx(np.full(len(uniform.time) - 1, 1e-3))
    assert uniform.columns["A"][-1] - uniform.time[-1] == pytest.approx(1e-3 * uniform.lost, abs=1.1e-3)


def test_dropouts():
    """Blocks of the stated length are lost as often as stated."""
    counts = []
    for seed in range(20):
        found = draw_samples(prompt(dropouts_per_minute=60.0, dropout="25 ms"), 10.0, rng(seed))
        gaps = np.diff(found.true_time)
        assert gaps[gaps > 2e-3].min(initial=np.inf) >= 0.0259
        counts.append((gaps > 2e-3).sum())
    assert np.mean(counts) == pytest.approx(10.0, abs=2.5)


def test_values_are_those_of_the_true_instants():
    """Whatever the clock does, a sample is the signal at the instant that the truth gives it."""
    log = ramp(jitter="100 us", lost=0.05, dropouts_per_minute=30.0, clock="uniform", drift_ppm=500.0)
    assert log.columns["A"] == pytest.approx(log.true_time, abs=1e-9)


def test_start_scatters():
    """Start and drift scatter from run to run about what the rig states; without scatter they are what it states."""
    stated = prompt(start="-0.2 s", start_scatter="20 ms", drift_ppm=10.0, drift_scatter_ppm=4.0)
    drawn = [start_logger(stated, rng(seed)) for seed in range(400)]
    assert np.mean([d.start for d in drawn]) == pytest.approx(-0.2, abs=4e-3)
    assert np.std([d.start for d in drawn]) == pytest.approx(0.02, rel=0.12)
    assert np.std([d.drift_ppm for d in drawn]) == pytest.approx(4.0, rel=0.12)
    assert start_logger(prompt(), rng()) == prompt()


def test_noise_is_that_of_the_channel():
    """Scatter of the clock draws from a stream of its own: with an unmoving signal the noise stays the same."""
    column = Column("A", "acc", "x", "daq", "g", ("acceleration",), noise=0.3)
    still = {"A": np.zeros_like(TEN_SECONDS)}
    one, other = (record_log(prompt(jitter=j), [column], TEN_SECONDS, still, (3, 4)) for j in ("0 s", "10 us"))
    assert np.array_equal(one.columns["A"], other.columns["A"])
