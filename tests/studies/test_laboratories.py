"""Laboratories drawn at random: their motion, their noise, and the truth that the study counts by."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from studies.laboratories import FAMILIES, HOME, Course, _moved, analyzed, drawn, floor, hum, oracle, write_campaign
from testbench.vibration.metrics import Measure


@pytest.mark.parametrize("seed", range(4))
def test_the_motion_is_one(seed: int) -> None:
    """Place is the second integral of the acceleration, ends where it began, and has the peak that the table says."""
    course = Course.drawn(np.random.default_rng(seed))
    time = np.linspace(-0.1, course.end + 0.1, 40_001)
    acceleration, speed, place = course.at(time)
    assert np.abs(acceleration).max() == pytest.approx(course.peak, rel=1e-3)  # a leg is a table of 2000 steps
    for rate, whole in ((speed, place), (acceleration, speed)):
        found = cumulative_trapezoid(rate, time, initial=0.0)
        np.testing.assert_allclose(found, whole, atol=1e-3 * np.abs(whole).max())
    assert abs(place[-1]) < 1e-12


def test_encoders_are_those_of_the_arms() -> None:
    """Both links of each arm are 0.15 m long wherever the platform is, to the encoder's step and noise."""
    laboratory = next(one for seed in range(9) if (one := drawn(FAMILIES["white"], seed)).controller.encoders)
    time = np.linspace(0.0, laboratory.course.end, 500)
    moved, place = _moved(laboratory, time), laboratory.course.at(time)[2]
    at = np.array(
        [HOME[0] + place * (laboratory.course.axis == "x"), HOME[1] + place * (laboratory.course.axis == "y")]
    )
    for joint in ("A0", "B0"):
        elbow = 0.15 * np.array([np.cos(moved[f"theta_{joint} (rad)"]), np.sin(moved[f"theta_{joint} (rad)"])])
        np.testing.assert_allclose(np.hypot(*(at - elbow)), 0.15, atol=0.15 * 4 * 4.8e-5)


def test_noise_has_the_size_of_its_law() -> None:
    """A floor is stationary: as large at the start of a record as later; the phase of hum is another in each run."""
    rng, time = np.random.default_rng(1), np.arange(0.0, 1.0, 1e-3)
    law = floor(rng, 1.0)
    paths = np.array([law(rng, time, time) for _ in range(200)])
    assert 0.1 < paths.std() < 1.0
    assert paths[:, :200].std() == pytest.approx(paths[:, -200:].std(), rel=0.2)  # 200 runs of a narrow mode: 5 %
    law = hum(rng, 1.0)
    assert abs(np.mean([law(rng, time, time) for _ in range(200)], axis=0)).max() < 0.6  # 2.7 / sqrt(200), 3 times


def test_the_truth_is_what_analysis_finds_without_noise(tmp_path: Path) -> None:
    """Ingested and analysed, next to no noise: the reduction of the signals themselves."""
    laboratory = replace(drawn(FAMILIES["white"], 3), white=1e-9, step=1e-6)
    write_campaign(laboratory, tmp_path)
    measure = Measure(laboratory.metric)
    for one in analyzed(tmp_path, measure).reductions:
        balanced, bare = laboratory.truth(laboratory.axes.index(one.axis), measure)
        assert one.percent == pytest.approx(100.0 * (1.0 - balanced / bare), abs=0.05)


def test_the_oracle_knows_the_noise_alone(tmp_path: Path) -> None:
    """In white noise it knows little more than the rests show; who knows the signal too is never less sure."""
    laboratory = drawn(FAMILIES["white"], 4)
    write_campaign(laboratory, tmp_path)
    analysis = analyzed(tmp_path, Measure(laboratory.metric))
    known = oracle(laboratory, analysis.pairs[0], analysis.measure)
    for one in analysis.reductions:
        assert one.interval is not None
        half = 0.5 * (one.interval[1] - one.interval[0])
        assert 0.6 < half / known[one.axis][0] < 1.6
        assert known[one.axis][1] < 1.25 * known[one.axis][0]  # 60 draws: to a tenth
