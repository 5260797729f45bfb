"""Reductions: closed forms, intervals that hold what they promise, and the known truth of a simulated campaign."""

import shutil

import numpy as np
import polars
import pytest

from testbench.errors import AnalysisError
from testbench.reductions import analyze, interval, percent
from testbench.signals import Band
from testbench.store import open_campaign
from testbench.vibration import Measure


def test_percent():
    """From 4 to 1 is a reduction of 75 %, from 1 to 1 none, from 1 to 2 an increase; of nothing there is none."""
    assert percent([1.0], [4.0]) == pytest.approx(75.0)
    assert percent([1.0], [1.0]) == pytest.approx(0.0)
    assert percent([2.0], [1.0]) == pytest.approx(-100.0)
    assert percent([0.0], [1.0]) == 100.0
    assert percent([0.0], [0.0]) is None


def test_percent_of_repeats():
    """Repeats are averaged by their logarithms: the order of averaging and dividing does not matter."""
    assert percent([1.0, 4.0], [8.0, 8.0]) == pytest.approx(75.0)


def test_no_interval_without_repeats():
    """One run on either side gives no interval."""
    assert interval([1.0], [2.0, 2.1]) is None
    assert interval([1.0, 1.1], [2.0]) is None


def test_interval_without_scatter():
    """Repeats that agree give an interval of no width."""
    assert interval([1.0, 1.0], [2.0, 2.0]) == pytest.approx((50.0, 50.0))


def test_interval_against_scipy():
    """It is the interval of Welch's t test on the logarithms."""
    from scipy.stats import ttest_ind

    balanced, unbalanced = [1.0, 1.2, 0.9], [3.0, 3.3, 3.1, 2.8]
    between = ttest_ind(np.log(balanced), np.log(unbalanced), equal_var=False).confidence_interval(0.95)
    found = interval(balanced, unbalanced)
    assert found == pytest.approx((100 * (1 - np.exp(between.high)), 100 * (1 - np.exp(between.low))))


def test_coverage_of_the_interval():
    """Of 2000 intervals from three repeats, 95 % hold the truth (not rejected by a binomial test at 0.1 %)."""
    from scipy.stats import binomtest

    rng, held = np.random.default_rng(11), 0
    for _ in range(2000):
        low, high = interval(np.exp(rng.normal(0.0, 0.05, 3)), 4.0 * np.exp(rng.normal(0.0, 0.02, 3)))
        held += low <= 75.0 <= high
    assert binomtest(held, 2000, 0.95).pvalue > 1e-3


@pytest.mark.parametrize("metric", ["peak", "peak_to_peak", "rms"])
def test_known_truth(brief, metric):
    """The logs give the reductions of the truth, as near as the noise of the accelerometer allows."""
    measure = Measure(metric, Band(0.0, 200.0))
    sigma = 0.002 * 9.81 * np.sqrt(200.0 / 2500.0)
    noise = {"peak": 5.0, "peak_to_peak": 10.0, "rms": 1.2}[metric] * sigma
    analysis = analyze(open_campaign(brief.campaign).runs, measure)
    assert len(analysis.reductions) == 12
    for reduction in analysis.reductions:
        balanced, unbalanced = (_true_amplitude(brief.logs, run, reduction.axis, measure) for run in reduction.runs)
        error = reduction.percent - 100.0 * (1.0 - balanced / unbalanced)
        assert abs(error) < 100.0 * 1.1 * noise / unbalanced * (1.0 + balanced / unbalanced)


def _true_amplitude(logs, run: str, axis: str, measure: Measure) -> float:
    """Amplitude of the base without noise, over the span that the logger recorded [m/s2]."""
    table = polars.read_parquet(logs / "truth" / f"{run}.parquet")
    resting = np.zeros(2370)
    signal = np.concatenate([resting, table[f"Acc{axis.upper()}_m_s2"].to_numpy()])
    return measure.of(signal, 10_000.0)


def test_truth_is_not_read(brief, tmp_path):
    """Analysis needs neither the logs nor the truth: only the stored runs."""
    shutil.copytree(brief.campaign, tmp_path / "alone")
    alone = analyze(open_campaign(tmp_path / "alone").runs, Measure())
    assert alone.reductions == analyze(open_campaign(brief.campaign).runs, Measure()).reductions


def test_nothing_of_the_analysis_imports_the_truth():
    """No module but those that make a campaign knows of the truth."""
    from pathlib import Path

    import testbench

    root = Path(testbench.__file__).parent
    knowing = {p.relative_to(root).as_posix() for p in root.rglob("*.py") if "truth" in _imports(p)}
    assert knowing == {"bench/campaign.py"}


def _imports(path) -> set[str]:
    """Last parts of everything that a module imports."""
    import ast

    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            module = getattr(node, "module", None) or ""
            names |= {part for alias in node.names for part in f"{module}.{alias.name}".split(".")}
    return names


def test_no_two_runs(brief):
    """A campaign without a pair is refused, and each run is named with what it lacks."""
    runs = [run for run in open_campaign(brief.campaign).runs if run.conditions["counter_masses"]]
    with pytest.raises(AnalysisError, match=r"(?s)no two runs.*r001: no simulated run without.*r007"):
        analyze(runs, Measure())


def test_repeats_give_intervals(tmp_path):
    """With two repeats on both sides every reduction has an interval, and it holds the reduction."""
    from .conftest import simulated

    plan = """
mechanism = "parallelogram-6bar"
repeats = 2
[[conditions]]
payload = "5 kg"
counter_masses = { counter_A0A = "24.2626 kg", counter_B0B = "24.2626 kg" }
motion = "x"
peak_acceleration = "4 g0"
"""
    made = simulated(tmp_path, plan)
    reductions = analyze(open_campaign(made.campaign).runs, Measure()).reductions
    assert [reduction.axis for reduction in reductions] == ["x", "y", "z"]
    for reduction in reductions:
        low, high = reduction.interval
        assert low < reduction.percent < high
        assert len(reduction.runs) == 4
