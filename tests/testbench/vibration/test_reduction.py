"""Reductions: closed forms, intervals that hold what they promise, and the known truth of a simulated campaign."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import polars
import pytest

from balance.results import document
from testbench.errors import AnalysisError
from testbench.signal.filters import Band
from testbench.store import open_campaign
from testbench.vibration.metrics import Measure
from testbench.vibration.motion_timing import MotionTiming
from testbench.vibration.reduction import analyze, reduction_findings, reduction_percent, verdict


def test_percent():
    """From 4 to 1 is a reduction of 75 %, from 1 to 1 none, from 1 to 2 an increase; of nothing there is none."""
    assert reduction_percent([1.0], [4.0]) == pytest.approx(75.0)
    assert reduction_percent([1.0], [1.0]) == pytest.approx(0.0)
    assert reduction_percent([2.0], [1.0]) == pytest.approx(-100.0)
    assert reduction_percent([0.0], [1.0]) == 100.0
    assert reduction_percent([0.0], [0.0]) is None


def test_percent_of_repeats():
    """Of the means of repeats, as where noise is known."""
    assert reduction_percent([1.0, 3.0], [8.0, 8.0]) == pytest.approx(75.0)


@pytest.mark.parametrize("metric", ["peak", "peak_to_peak", "rms"])
def test_known_truth(brief, brief_analysis, metric):
    """Through the files, too, the intervals hold the truth: 12 of 95 % miss it more than 3 times once in 450.

    And no value is further off than noise of some standard deviations on both amplitudes makes it.
    """
    noise = {"peak": 5.0, "peak_to_peak": 10.0, "rms": 1.2}[metric] * 0.002 * 9.81 * np.sqrt(200.0 / 2500.0)
    measure = Measure(metric, Band(0.0, 200.0))
    analysis = brief_analysis(metric)
    assert len(analysis.reductions) == 12
    held = 0
    for reduction in analysis.reductions:
        balanced, unbalanced = (_true_amplitude(brief.logs, run, reduction.axis, measure) for run in reduction.runs)
        low, high = reduction.interval
        true = 100.0 * (1.0 - balanced / unbalanced)
        held += low <= true <= high
        assert abs(reduction.percent - true) < 100.0 * 1.1 * noise / unbalanced * (1.0 + balanced / unbalanced)
        assert reduction.method == "propagation"
        assert reduction.n == (1, 1)
        assert reduction.resolution == pytest.approx(0.0005 * 9.81)
    assert held >= 9


def test_noise_floor(brief_analysis):
    """At rest the sensor's noise in the band is known: 0.002 g white over 2500 Hz, of which 200 Hz count."""
    expected = 0.002 * 9.81 * np.sqrt(200.0 / 2500.0)
    for reduction in brief_analysis("rms").reductions:
        assert reduction.noise_floor == pytest.approx((expected, expected), rel=0.35)


def test_below_noise(brief_analysis):
    """What sinks into the noise is a lower bound that says so: along y force alone acts, and nearly none is left.

    What is left is less than twice what noise alone reads.
    """
    analysis = brief_analysis("peak_to_peak")
    sunk = [r for r in analysis.reductions if r.below_noise]
    assert {(r.key.motion, r.axis) for r in sunk} >= {("y", "x"), ("y", "z")}
    for r in sunk:
        assert r.limit == "at_least"
        assert r.interval[1] == 100.0
        assert document(r)["at_least_percent"] == r.interval[0]
        assert r.interval[0] > 100.0 * (1.0 - 2.0 * r.noise_floor[0] / r.amplitudes[1])
    assert {f.code for f in analysis.findings} == {"below_noise"}
    assert not [r for r in analysis.reductions if r.key.motion == "x" and r.limit]


def test_the_verdict_counts_what_is_no_number(brief_analysis):
    """A bound with its reason, what is withheld with its code, what has no interval: each reduction counts once."""
    reductions = brief_analysis("peak_to_peak").reductions
    sound = next(r for r in reductions if r.limit is None)
    bound = next(r for r in reductions if r.below_noise)
    withheld = replace(bound, interval=None, doubts=("counter_mass_contradiction", "gain"))
    high = replace(sound, limit="at_most", interval=None)
    each = [sound, bound, high, withheld, replace(sound, interval=None), replace(withheld, limit="at_most")]
    condition = SimpleNamespace(places=(), pair=brief_analysis("peak_to_peak").pairs[0])
    for one, codes in ((bound, ["below_noise"]), (replace(bound, interval=None, doubts=("gain_contradiction",)), [])):
        assert [f.code for f in reduction_findings(condition, [one])] == codes, "no bound of what is withheld"
    kinds = ["number", "at_least", "at_most", "withheld", "no_interval", "withheld"]
    assert [document(one)["kind"] for one in each] == kinds
    assert verdict([withheld]) == ("1 of 1 reductions are withheld for counter_mass_contradiction: see the findings.")
    low, high = sound.interval
    assert verdict([sound, bound, withheld, replace(sound, interval=None)]) == (
        f"{sound.axis}: reduced by {sound.percent:.1f} % [{low:.1f}, {high:.1f}], at least "
        f"{bound.at_least:.1f} % (residual below noise); 1 of 4 reductions are withheld for "
        "counter_mass_contradiction: see the findings; 1 of 4 reductions have no interval."
    )
    less = replace(bound, interval=(bound.at_least - 5.0, 100.0))
    assert verdict([bound, less]) == (
        f"{bound.axis}: reduced by at least {less.at_least:.1f} to {bound.at_least:.1f} % in 2 conditions; 2 of 2 "
        "reductions are lower bounds, below noise or clipped."
    )
    some = [replace(bound, interval=(low, 100.0)) for low in (-77.1, 79.4, 65.3)]
    assert verdict(some).startswith(
        f"{bound.axis}: reduced by at least 65.3 to 79.4 % in 2 conditions, the noise hides whether it fell or rose in "
        "1 condition; 3 of 3"
    )
    assert "not raised by more than 77.1 % in 2 conditions;" in verdict(
        [replace(bound, interval=(-12.0, 100.0)), some[0]]
    )


def test_the_verdict_says_what_is_raised(brief_analysis):
    """No reduction by less than nothing: raised, or between raised and reduced."""
    sound = next(r for r in brief_analysis("peak_to_peak").reductions if r.limit is None)
    more, most, less = (replace(sound, percent=p, interval=(p - 2.0, p + 3.0)) for p in (-1.5, -13.25, 4.0))
    assert verdict([more]) == f"{sound.axis}: raised by 1.5 % [-1.5, 3.5]."
    assert verdict([more, most]) == f"{sound.axis}: raised by 1.5 to 13.2 % [-1.5, 15.2] in 2 conditions."
    mixed = f"{sound.axis}: between raised by 13.2 % and reduced by 4.0 % [-15.2, 7.0] in 2 conditions"
    assert verdict([most, less]) == f"{mixed}."
    wide = replace(less, interval=(-11.7, 49.7), doubts=("repeats_differ",))
    assert verdict([less, wide]) == (
        f"{sound.axis}: reduced by 4.0 to 4.0 % [-11.7, 49.7] in 2 conditions; 1 of 2 reductions are doubtful for "
        "repeats_differ: see the findings."
    )
    bound = next(r for r in brief_analysis("peak_to_peak").reductions if r.below_noise)
    assert "not raised by more than 12.0 % (" in verdict([replace(bound, interval=(-12.0, 100.0))])
    assert "the noise hides whether it fell or rose in 1 condition." in verdict(
        [replace(bound, interval=(-1600.0, 100.0))]
    )
    lost, clipped = replace(bound, interval=(-1600.0, 100.0)), replace(bound, below_noise=False)
    assert verdict([lost, bound]).startswith(
        f"{bound.axis}: reduced by at least {bound.at_least:.1f} % (residual below noise), the noise hides whether "
        "it fell or rose in 1 condition;"
    )
    assert (lost.text, document(lost)["at_least_percent"]) == ("noise hides it", -1600.0)
    assert bound.text == f">= {bound.at_least:.1f} < noise"
    assert "not raised by more than 150.0 % (clipped" in verdict([replace(clipped, interval=(-150.0, 100.0))])


@pytest.mark.parametrize(
    ("doubts", "timed", "advice"),
    [
        ((), True, "repeat the runs, or name a --band without the noise"),
        ((), False, "record a trigger on both loggers, or see testbench align"),
        (("repeats_differ",), False, None),
    ],
)
def test_why_repeats_tell_no_reduction(brief_analysis, doubts, timed, advice):
    """Where nothing aligned them, that is the reason; where they differ, the finding that names the odd one is."""
    analysis = brief_analysis("peak_to_peak")
    sound = next(r for r in analysis.reductions if r.limit is None)
    lost = replace(sound, percent=None, interval=None, n=(3, 3), doubts=doubts)
    condition = SimpleNamespace(places=(), pair=analysis.pairs[0], timed=timed)
    found = [(one.code, advice in one.message) for one in reduction_findings(condition, [lost])]
    assert found == ([("no_reduction", True)] if advice else [])


@pytest.mark.parametrize("timed", [True, False])
def test_what_relates_clocks_is_said_once(timed, brief, monkeypatch):
    """A note by what, or a finding why not, of all runs of which it is the same but for numbers."""
    of = MotionTiming.of
    monkeypatch.setattr(
        MotionTiming, "of", lambda run, at: replace(of(run, at), timed=timed, clocks=f"edge at {run.name[1:]}.5 s")
    )
    found = analyze(open_campaign(brief.campaign).runs[:4], Measure())
    said = [one.message for one in found.findings if one.code == "clocks_not_related"]
    (text,) = found.clocks if timed else said
    assert text.startswith("Clocks of r001, r002, r003, r004 are " if timed else "r001, r002, r003, r004: ")
    assert "edge at 001.5 s" in text
    assert (len(said), text in found.notes) == (not timed, timed)


def _true_amplitude(logs, run: str, axis: str, measure: Measure) -> float:
    """Amplitude of the base without noise, over the span that the logger recorded [m/s2]."""
    table = polars.read_parquet(logs / "truth" / f"{run}.parquet")
    resting = np.zeros(2370)
    signal = np.concatenate([resting, table[f"Acc{axis.upper()}_m_s2"].to_numpy()])
    return measure.amplitude(signal, 10_000.0)


def test_no_two_runs(brief):
    """A campaign without a pair is refused, and each run is named with what it lacks."""
    runs = [run for run in open_campaign(brief.campaign).runs if run.conditions["counter_masses"]]
    with pytest.raises(AnalysisError, match=r"(?s)no two runs.*r001: no simulated run without.*r007"):
        analyze(runs, Measure())


def test_originals_are_not_available(brief_analysis):
    """Wherever simulated runs of the manipulator are reduced it is said that its own logs are not at hand."""
    assert any("original logs" in note and "not available" in note for note in brief_analysis("rms").notes)
