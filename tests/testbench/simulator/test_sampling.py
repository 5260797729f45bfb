"""Clocks that scatter, samples and blocks that are lost; a recorded clock shows it, a uniform one does not."""

import numpy as np
import pytest

from testbench.rig import Column
from testbench.rig.bench import Logger
from testbench.simulator.loggers import draw_samples, record_log, start_logger

TIME = np.arange(100_001) / 10_000.0


def logger(**settings) -> Logger:
    """A logger of 1 kHz that starts with the motion."""
    return Logger.model_validate({"rate": "1 kHz", "start": "0 s", **settings})


def rng(seed: int = 1):
    """A stream."""
    return np.random.default_rng(seed)


def ramp(**settings):
    """What a logger makes of a ramp of 1 g a second: the value tells the true instant."""
    column = Column("A", "acc", "x", "daq", "g", ("acceleration",))
    return record_log(logger(**settings), [column], TIME, {"A": 9.81 * TIME}, (1, 2))


def test_regular():
    """Without scatter and losses every instant is on the grid."""
    found = draw_samples(logger(), 2.0, rng())
    assert found.logged == pytest.approx(np.arange(2001) / 1000.0)
    assert np.array_equal(found.true_time, found.logged)
    assert found.lost == 0


def test_jitter():
    """Instants scatter by what is stated about the grid; a recorded clock shows them, a uniform one the grid."""
    for clock in ("recorded", "uniform"):
        found = draw_samples(logger(jitter="50 us", clock=clock, drift_ppm=100.0), 10.0, rng())
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
        found = draw_samples(logger(dropouts_per_minute=60.0, dropout="25 ms"), 10.0, rng(seed))
        gaps = np.diff(found.true_time)
        assert gaps[gaps > 2e-3].min(initial=np.inf) >= 0.0259
        counts.append((gaps > 2e-3).sum())
    assert np.mean(counts) == pytest.approx(10.0, abs=2.5)


def test_values_are_those_of_the_true_instants():
    """Whatever the clock does, a sample is the signal at the instant that the truth gives it."""
    log = ramp(jitter="100 us", lost=0.05, dropouts_per_minute=30.0, clock="uniform", drift_ppm=500.0)
    assert log.columns["A"] == pytest.approx(log.true_time, abs=1e-9)


def test_started():
    """Start and drift scatter from run to run about what the rig states; without scatter they are what it states."""
    stated = logger(start="-0.2 s", start_scatter="20 ms", drift_ppm=10.0, drift_scatter_ppm=4.0)
    drawn = [start_logger(stated, rng(seed)) for seed in range(400)]
    assert np.mean([d.start for d in drawn]) == pytest.approx(-0.2, abs=4e-3)
    assert np.std([d.start for d in drawn]) == pytest.approx(0.02, rel=0.12)
    assert np.std([d.drift_ppm for d in drawn]) == pytest.approx(4.0, rel=0.12)
    assert start_logger(logger(), rng()) == logger()


def test_noise_is_that_of_the_channel():
    """Scatter of the clock draws from a stream of its own: with an unmoving signal the noise stays the same."""
    column = Column("A", "acc", "x", "daq", "g", ("acceleration",), noise=0.3)
    still = {"A": np.zeros_like(TIME)}
    one, other = (record_log(logger(jitter=j), [column], TIME, still, (3, 4)) for j in ("0 s", "10 us"))
    assert np.array_equal(one.columns["A"], other.columns["A"])
