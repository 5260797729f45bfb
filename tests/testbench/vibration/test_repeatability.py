"""RepeatabilityByPlace of repeats: what it is made of, whether intervals from it hold, and what is not pooled."""

import numpy as np
import pytest
from scipy.stats import norm

from testbench.vibration import AmplitudeLikelihood, ConditionAmplitude, Group, Ratio, Repeatability
from testbench.vibration.amplitude import MetricStatistic

from ..coverage import assert_holds

AWAY = np.linspace(-5.0, 5.0, 16)


def run(amplitude: float, share: float, rng, noise: float = 1.0) -> AmplitudeLikelihood:
    """A run whose noise at rest has the standard deviation 1, in motion ``noise``; runs differ by ``share``."""
    read = amplitude * (1.0 + share * rng.normal()) + noise * rng.normal()
    tried = np.maximum(read + AWAY, 0.0) + 1e-9 * np.arange(16)
    reach = np.median(np.abs(rng.normal(size=200)))
    return AmplitudeLikelihood(MetricStatistic("peak"), read, reach, False, 0.0, tried, read - tried, tried - tried[0])


def group(amplitude: float, share: float, rng, repeats: int, noise: float = 1.0, name: str = "") -> Group:
    """Repeats."""
    return Group(tuple(run(amplitude, share, rng, noise) for _ in range(repeats)), (name,))


def test_components():
    """Of many groups both components are found: noise three times that at rest, and a share of 2 %."""
    rng = np.random.default_rng(1)
    found = Repeatability.of([group(a, 0.02, rng, 3, noise=3.0) for a in np.geomspace(10.0, 3000.0, 300)])
    assert found.noise == pytest.approx(9.0, rel=0.25)
    assert found.share == pytest.approx(0.02**2, rel=0.25)


def test_how_well_they_are_known():
    """The variance of many campaigns scatters as its degrees of freedom say; those of all groups where x is alike."""
    rng = np.random.default_rng(2)
    found = [Repeatability.of([group(100.0, 0.05, rng, 3, name=str(i)) for i in range(8)]) for _ in range(300)]
    variances = np.array([repeats.variance(100.0) for repeats in found])
    assert variances.mean() == pytest.approx(1.0 + 25.0, rel=0.1)
    freedom = np.median([repeats.degrees_of_freedom(100.0) for repeats in found])
    assert freedom == pytest.approx(16.0, rel=0.15)
    assert variances.std() / variances.mean() == pytest.approx(np.sqrt(2.0 / freedom), rel=0.2)


@pytest.mark.parametrize("repeats", [2, 3])
@pytest.mark.parametrize(
    ("conditions", "share", "noise"), [(1, 0.0, 1.0), (1, 0.1, 1.0), (4, 0.0, 2.0), (4, 0.03, 1.0)]
)
def test_coverage(conditions, share, noise, repeats):
    """Intervals hold whatever makes repeats differ: noise as at rest, noise in motion alone, or the runs themselves."""
    held = 0
    for seed in range(150):
        rng = np.random.default_rng([seed, conditions, repeats])
        campaign = [
            [group(a, share, rng, repeats, noise, f"{i}{a}") for a in (12.0 * scale, 90.0 * scale)]
            for i, scale in enumerate(np.geomspace(1.0, 3.0, conditions))
        ]
        scatter = Repeatability.of([group for pair in campaign for group in pair])
        held += Ratio(*(ConditionAmplitude(group, scatter, scatter.excludes(group)) for group in campaign[0])).accepts(
            12 / 90
        )
    assert_holds(held, 150)


def test_pooling_narrows():
    """Two repeats know more where other conditions have been repeated too."""
    width = {}
    for conditions in (1, 6):
        ends = []
        for seed in range(20):
            rng = np.random.default_rng(seed)
            groups = [group(a, 0.03, rng, 2) for _ in range(conditions) for a in (40.0, 400.0)]
            scatter = Repeatability.of(groups)
            low, high = Ratio(ConditionAmplitude(groups[0], scatter), ConditionAmplitude(groups[1], scatter)).interval
            ends.append(high - low)
        width[conditions] = np.median(ends)
    assert width[6] < 0.6 * width[1]


def test_unlike_the_others():
    """Repeats that differ ten times as much as all others are told apart, and their own scatter is taken."""
    rng, found = np.random.default_rng(3), 0
    for _ in range(20):
        groups = [group(300.0, 0.02, rng, 3, name=str(i)) for i in range(9)]
        odd = group(300.0, 0.4, rng, 3, name="odd")
        scatter = Repeatability.of([*groups, odd])
        found += scatter.excludes(odd)
        assert sum(map(scatter.excludes, groups)) == 0
    assert found >= 15


def test_alike():
    """Of campaigns of alike groups about one in a hundred has one that is told apart."""
    rng = np.random.default_rng(4)
    found = [Repeatability.of([group(300.0, 0.02, rng, 3, name=str(i)) for i in range(6)]) for _ in range(150)]
    assert sum(bool(repeats.outlying) for repeats in found) <= 6


def test_too_few():
    """A single group of repeats cannot say what is noise and what a share; neither can runs without repeats."""
    rng = np.random.default_rng(5)
    assert Repeatability.of([group(100.0, 0.0, rng, 3), group(10.0, 0.0, rng, 1)]) is None
    assert Repeatability.of([group(100.0, 0.0, rng, 1), group(10.0, 0.0, rng, 1)]) is None


def test_single_run_among_repeats():
    """A run that was not repeated is as sure as the repeats of other conditions let expect."""
    held, alone = 0, 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        others = [group(a, 0.05, rng, 3) for a in (40.0, 60.0, 300.0, 500.0)]
        pair = [group(50.0, 0.05, rng, 1), group(400.0, 0.05, rng, 1)]
        scatter = Repeatability.of([*others, *pair])
        held += Ratio(*(ConditionAmplitude(group, scatter) for group in pair)).accepts(50 / 400)
        alone += Ratio(*map(ConditionAmplitude, pair)).accepts(50 / 400)
    assert_holds(held, 30)
    assert alone < 23


def test_steps_that_repeat():
    """Readings that are alike since the noise is far below a step are no surer than the step."""
    tried = 7.0 + 0.1 * AWAY
    same = AmplitudeLikelihood(MetricStatistic("peak"), 7.0, 0.1, False, 1.0, tried, -AWAY, AWAY + 5.0)
    assert Group((same, same, same)).variance == 1.0


def test_clearness():
    """An amplitude of 100 standard deviations is as clear as that, and none that is not there."""
    found = run(100.0, 0.0, np.random.default_rng(6))
    assert found.signal_to_noise(100.0) == pytest.approx(100.0, rel=0.02)
    assert found.signal_to_noise(0.0) == 0.0
    assert found.deviation(np.array([found.reading]))[0] == pytest.approx(0.0, abs=1e-6)
    far = found.deviation(np.array([200.0]))[0]
    assert far == pytest.approx(100.0 * np.log(found.reading / 200.0), rel=0.1)


def test_normal_quantile():
    """One run alone is judged by its noise: its interval is that of a normal reading."""
    rng = np.random.default_rng(7)
    pair = [group(1000.0, 0.0, rng, 1), group(1e7, 0.0, rng, 1)]
    low, high = Ratio(*map(ConditionAmplitude, pair)).interval
    assert (high - low) * 1e7 == pytest.approx(2.0 * norm.ppf(0.975), rel=0.01)
