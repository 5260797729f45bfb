"""The steady turn behind a log of edges, against a motion that is known."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from testbench.errors import AnalysisError
from testbench.public_recordings import FOLDER_VARIABLE
from testbench.rotating import Disc, number_edges, periodic_turn, read_edge_times

from ..coverage import assert_holds
from . import discs

NOMINAL = 276 * discs.RPM / 3.61


def found(time, disc=None, **options):
    """The turn of a log."""
    return periodic_turn(number_edges("log", time, disc or Disc(100)), **options)


def test_a_fine_clock_gives_the_motion_itself():
    """No jitter, no clock step: fluctuation to 1e-7, speeds to 1e-5 rpm, mean to 1e-9."""
    turn, truth = found(discs.turning(clock=0.0)), discs.truth()
    assert turn.fluctuation(NOMINAL).value == pytest.approx(truth.fluctuation(), abs=1e-7)
    assert turn.fastest.value == pytest.approx(truth.fastest[1], abs=2e-6)
    assert turn.mean.value == pytest.approx(truth.mean_speed, rel=1e-9)
    assert np.degrees(turn.fastest_at) == pytest.approx(np.degrees(truth.fastest[0]), abs=0.26)
    phi = np.linspace(0, 2 * np.pi, 50)
    np.testing.assert_allclose(turn.speed(phi), truth.rate(phi), rtol=1e-6)


CASES = {
    "4 us clock": {},
    "4 us clock, 10 us jitter": {"jitter": 1e-5},
    "10 us jitter, 3 turns": {"jitter": 1e-5, "turns": 3, "clock": 0.0},
    "361 pulses, 10 us jitter": {"pulses": 361, "jitter": 1e-5},
    "2 % pitch": {"pitch": 0.02},
    "10 % pitch, 10 us jitter": {"pitch": 0.1, "jitter": 1e-5},
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_intervals_hold_the_truth(case):
    """7 logs, other noise, disc and start each: 95 % of intervals hold the truth, binomial at 0.1 %."""
    options, tries = dict(case), 7
    pitch, pulses, truth = options.pop("pitch", 0.0), options.get("pulses", 100), discs.truth()
    hits = np.zeros(3, dtype=int)
    for seed in range(tries):
        ahead = discs.errors(pulses, pitch, seed) if pitch else None
        turn = found(discs.turning(**options, ahead=ahead, start=0.25 * seed, seed=seed), Disc(pulses))
        hits[0] += turn.fluctuation(NOMINAL).contains(truth.fluctuation())
        hits[1] += turn.fastest.contains(truth.fastest[1])
        hits[2] += turn.mean.contains(truth.mean_speed)
    assert all(binomtest(int(hit), tries, 0.95).pvalue > 1e-3 for hit in hits), hits


def test_intervals_are_no_wider_than_their_errors_ask_for():
    """10 us of jitter: half widths between 1.5 and 3 standard deviations of what 20 logs scatter about the truth."""
    turns = [found(discs.turning(jitter=1e-5, clock=0.0, seed=seed)) for seed in range(20)]
    for of in (lambda turn: turn.fluctuation(NOMINAL), lambda turn: turn.mean):
        estimates = [of(turn) for turn in turns]
        half = np.median([(e.high - e.low) / 2 for e in estimates])
        assert 1.5 < half / np.std([e.value for e in estimates]) < 3.0


def test_loads_that_change_from_turn_to_turn_widen_the_interval():
    """Turns whose fluctuation differs by a tenth, and turns whose duration does: told, and in the intervals."""
    rng, even = np.random.default_rng(0), discs.turning(clock=0.0, turns=12)
    phi = 2 * np.pi * np.arange(len(even)) / 100
    waves = rng.normal(size=13)[(np.arange(len(even)) // 100)]
    swinging = found(even + 1e-4 * waves * np.sin(phi) + 1e-6 * rng.normal(size=len(even)))
    still = found(even + 1e-6 * rng.normal(size=len(even)))
    widths = [turn.fluctuation(NOMINAL).high - turn.fluctuation(NOMINAL).low for turn in (swinging, still)]
    assert widths[0] > 20 * widths[1]
    longer = np.cumsum(np.r_[0.0, 1e-4 * rng.normal(size=12)])
    wandering = found(even + np.interp(phi / (2 * np.pi), np.arange(13), longer), steady_within=0.01)
    assert wandering.mean.high - wandering.mean.low > 20 * (still.mean.high - still.mean.low)


def test_the_mean_holds_where_instants_walk_at_random():
    """A sensor that wanders by 5 us a root second, beside jitter and hum that average out within a turn."""
    within = 0
    for seed in range(20):
        rng, time = np.random.default_rng(seed), discs.turning(jitter=1e-5, clock=0.0, seed=seed)
        steps = rng.standard_normal(len(time)) * np.sqrt(np.gradient(time))
        turn = found(time + 5e-6 * np.cumsum(steps) + 5e-5 * np.sin(2 * np.pi * 50.0 * time + seed))
        within += turn.mean.contains(discs.truth().mean_speed)
    assert_holds(within, 20)


def test_jitter_does_not_push_the_extremes_apart():
    """20 us of jitter: differences of single edges say 0.236 and more, the fit is unbiased to 0.001."""
    values, naive = [], []
    for seed in range(10):
        time = discs.turning(jitter=2e-5, seed=seed)
        values.append(found(time).fluctuation(NOMINAL).value)
        speed = 2 * np.pi / 100 / np.diff(time)
        naive.append(np.ptp(speed) / NOMINAL)
    truth = discs.truth().fluctuation()
    assert abs(np.mean(values) - truth) < 1e-3
    assert np.mean(naive) - truth > 0.01


def test_a_disc_out_of_pitch_is_held_down_and_named():
    """2 % of pitch makes single edges say 0.32; the fit stays within 0.01 and says how much is out of place."""
    time = discs.turning(ahead=discs.errors(100, 0.02, 3))
    turn = found(time)
    assert np.ptp(2 * np.pi / 100 / np.diff(time)) / NOMINAL > 0.28
    assert turn.fluctuation(NOMINAL).value == pytest.approx(discs.truth().fluctuation(), abs=0.01)
    assert turn.repeated == pytest.approx(0.02, rel=0.3)
    assert found(discs.turning()).repeated == 0.0


def test_jitter_is_measured():
    """The standard deviation of an instant, clock step included."""
    assert found(discs.turning(jitter=1e-5)).jitter == pytest.approx(np.hypot(1e-5, 4e-6 / np.sqrt(12)), rel=0.06)


def test_turns_that_are_not_steady_are_left_out():
    """From standstill the first turns are left out; where none are steady the log is refused."""
    turn = found(discs.starting(turns=7))
    assert turn.turns == 5
    assert turn.unsteady_turns == 1
    with pytest.raises(AnalysisError, match="no two turns in a row are steady"):
        found(np.cumsum(1e-3 * 0.999 ** np.arange(500)))
    with pytest.raises(AnalysisError, match="two or more"):
        found(discs.turning(turns=1.5))


def test_a_single_shaft_at_constant_speed_does_not_fluctuate():
    """Even edges: the interval of the fluctuation holds zero to the clock's step."""
    turn = found(np.round(np.arange(801) * 7.7731e-3 / 4e-6) * 4e-6)
    assert turn.fluctuation().value < 1e-5
    assert turn.mean.value == pytest.approx(2 * np.pi / 0.77731, rel=1e-6)


def test_fewer_edges_than_harmonics_are_refused():
    """A disc of 20 pulses does not carry 12 harmonics."""
    with pytest.raises(AnalysisError, match="too many"):
        found(discs.turning(pulses=20), Disc(20), harmonics=12)


@pytest.mark.recordings("malformed")
@pytest.mark.parametrize(("name", "ratio"), [("open_encoder_crank100_276", 1.0), ("open_encoder_motor361_276", 3.61)])
def test_edges_made_elsewhere_from_a_known_motion(name, ratio):
    """True fluctuation 0.223214, largest and smallest speed 84.71183 and 67.64612 rpm: within the intervals."""
    path = Path(os.environ[FOLDER_VARIABLE]).parent / f"{name}.csv"
    turn = found(read_edge_times(path), Disc(100, ratio))
    assert turn.fluctuation(NOMINAL).value == pytest.approx(0.223214, abs=2e-5)
    assert turn.fluctuation(NOMINAL).contains(0.223214)
    assert turn.fastest.contains(84.71183 * discs.RPM)
    assert turn.slowest.contains(67.64612 * discs.RPM)
