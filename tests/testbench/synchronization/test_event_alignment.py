"""Alignment by trigger edges and by taps."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.errors import AnalysisError
from testbench.synchronization.event_alignment import by_taps, by_trigger, trigger_edges
from testbench.synchronization.signal_preparation import SharedSignals

from ..coverage import assert_holds

OFFSET, DRIFT = -0.37, -45e-6


def pulses(instants, seed=0, column_rates=(1000.0, 2000.0), seconds=12.0):
    """A trigger high for 20 ms from each instant [s] of the reference's time, on two loggers."""
    phase = np.random.default_rng(seed).random(2)
    there, here = (np.arange(int(seconds * r)) / r + p / r for r, p in zip(column_rates, phase, strict=True))
    level = lambda t: 5.0 * np.any((t[:, None] >= instants) & (t[:, None] < instants + 0.02), axis=1)  # noqa: E731
    own_signals = level(OFFSET + (1 + DRIFT) * here)
    return SharedSignals("sync", there, (level(there)[:, None],), here, own_signals[:, None])


@pytest.mark.parametrize("drift", [True, False])
@pytest.mark.parametrize("steps", [None, 1e-3], ids=["any phase", "phases kept"])
def test_edges(steps, drift):
    """Edges at uneven intervals give offset and drift within the sampling; intervals hold over seeds, also where all
    edges are at one phase of the reference's samples: what the sampling leaves open is then common to them.
    """
    hits = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 5])
        instants = np.sort(rng.uniform(0.5, 11.0, 6))
        instants = np.round(instants / steps) * steps + rng.random() * steps if steps else instants
        clock = by_trigger(pulses(instants, seed), drift).clock
        (low, high), (least, most) = clock.offset_interval, clock.drift_interval
        truth = OFFSET + (1 + DRIFT) * clock.at_own
        middle = abs(clock.at_reference - truth) <= clock.half_width(clock.at_own) < 1e-3
        hits.append([low <= OFFSET <= high, least <= DRIFT <= most, middle])
        assert clock.offset == pytest.approx(OFFSET, abs=1.5e-3)
        assert drift or (1e6 * least, 1e6 * most) == pytest.approx((-100.0, 100.0))
    assert (np.mean(hits, axis=0) >= 0.95).all()


def test_one_edge():
    """A single edge tells no drift, which is said, asked for or not; the offset alone is known to about a sample."""
    one = pulses(np.array([4.0]))
    found = by_trigger(one)
    assert str(found) == str(by_trigger(one, drift=False))
    assert "1 edge, sync; drift unknown, within 100 ppm: 0.1 ms a second from it" in found.content
    clock = found.clock
    assert found.findings == ()
    assert abs(float(clock.to_reference(np.array([4.37]))[0]) - (OFFSET + (1 + DRIFT) * 4.37)) < clock.half_width(4.37)
    stop = pulses(np.array([11.0]))
    other = replace(one, own_time=stop.own_time, own_signals=stop.own_signals)
    (said,) = by_trigger(other, drift=False).findings
    assert "both recorded 4.63 s of the shorter record's 12 s: the edges may be of two events" in said


EVEN = np.arange(2.0, 8.1, 0.5)
UNEVEN = np.array([1.3, 2.1, 4.0, 7.2, 9.7])


@pytest.mark.parametrize(
    ("there", "here", "says"),
    [
        (np.arange(-1.5, 14.0), np.arange(-1.5, 14.0), "ambiguous.* fit at offsets of .*uneven intervals"),
        (EVEN[1:], EVEN[:-1], r"ambiguous: 12 edges .* 0\.13\d* s, -0\.3[67]\d* s"),
        (EVEN, EVEN, r"ambiguous.* -0\.3[67]"),
        (EVEN[:2], EVEN[:2], r"ambiguous: 2 edges .* -0\.3[67]"),
        (UNEVEN[:1], UNEVEN[:2], r"ambiguous: 1 edges"),
        (np.delete(UNEVEN, 2), UNEVEN, r"4 of 4 and 5 edges match at -0\.3[67]\d* s, but one at 4\.?\d* s .* missed"),
        (UNEVEN, UNEVEN + [0, 0.004, 0, -0.004, 0], r"3 of 5 and 5 edges match .* up to 4\.?\d* ms apart.*jitter"),
        (UNEVEN, UNEVEN + [0, 0.02, 0.05, -0.03, 0.11], r"no interval between edges"),
    ],
    ids=["throughout", "first and last missed", "a burst", "two", "one of two", "one missed", "jitter", "much jitter"],
)  # fmt: skip
def test_what_several_clocks_or_none_explain_is_refused(there, here, says):
    """Even intervals fit one interval off wherever a logger may have missed an edge; else the message has the cause."""
    one, other = pulses(there), pulses(here)
    with pytest.raises(AnalysisError, match=says):
        by_trigger(replace(one, own_time=other.own_time, own_signals=other.own_signals))


def test_two_edges_of_which_another_match_would_leave_little_in_common():
    """A pulse at the beginning and one at the end of the records: a shift by the time between is not of one run."""
    clock = by_trigger(pulses(np.array([1.5, 10.5]))).clock
    assert clock.offset == pytest.approx(OFFSET, abs=1.5e-3)


def test_a_quiet_line_holds_no_trigger():
    """A line that never changes is refused."""
    with pytest.raises(AnalysisError, match=r"never changes|rising edges"):
        by_trigger(pulses(np.array([])))


def test_noise_of_a_dead_line_holds_no_trigger():
    """Its largest and smallest values are no levels: refused, however few edges they make."""
    time = np.arange(0.0, 12.0, 1e-3)
    for seed in range(20):
        with pytest.raises(AnalysisError, match="no two levels"):
            trigger_edges("sync", time, np.random.default_rng(seed).normal(0.0, 0.01, len(time)))


def taps(seed, instants, noise=0.02):
    """Ringing shocks at the instants [s] of the reference's time, and motions of each side's own between them."""
    rng = np.random.default_rng(seed)
    there, here = np.arange(0.0, 12.0, 1 / 2000.0), np.arange(0.0, 12.0, 1 / 1600.0)

    def ring(t):
        since = t[:, None] - instants
        return np.sum(np.where(since > 0, np.exp(-since.clip(0) / 0.01) * np.sin(2 * np.pi * 90 * since), 0.0), axis=1)

    one = ring(there) + 0.01 * np.sin(2 * np.pi * 1.7 * there) + noise * rng.normal(size=len(there))
    other = (
        ring(OFFSET + (1 + DRIFT) * here) + 0.01 * np.sin(2 * np.pi * 2.3 * here) + noise * rng.normal(size=len(here))
    )
    return SharedSignals("taps", there, (one[:, None],), here, other[:, None])


def test_taps():
    """Three taps align two loggers far better than a sample, whatever else moved; intervals hold over seeds."""
    clocks = [by_taps(taps(seed, np.array([1.3, 4.0, 9.7]))).clock for seed in range(6)]
    assert max(abs(c.offset - OFFSET) for c in clocks) < 1e-4
    assert_holds(sum(c.offset_interval[0] <= OFFSET <= c.offset_interval[1] for c in clocks), len(clocks))


def test_no_tap():
    """Noise without a shock is refused."""
    with pytest.raises(AnalysisError, match="no tap found"):
        by_taps(taps(0, np.array([]), 1.0))
