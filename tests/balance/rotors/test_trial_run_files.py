"""Intervals in a file of trial runs: how they are stated, what is refused, what the command shows."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

import balance
from balance.errors import DataError, UnitError
from balance.rotors.trial_runs import load_trial_runs, trial_runs_from_table
from balance.units import parse_uncertain

from ..cli.conftest import call, json_of

RUNS = """
phase = "{phase}"
angles = "with rotation"
[[planes]]
name = "fan"
[[runs]]
name = "as found"
readings.unstated = {{ A = "10 um{a} @ 30 deg{b}" }}
[[runs]]
name = "trial"
weights = {{ fan = "5 g @ 20 deg" }}
stayed_on = {stayed}
readings.unstated = {{ A = "7 um{c} @ 75 deg" }}
{more}
"""
AGAIN = """
[[runs]]
name = "again"
readings.unstated = { A = "10.4 um @ 31 deg" }
"""
GIVEN = {"phase": "lead", "a": "", "b": "", "c": "", "stayed": "false", "more": ""}


@pytest.fixture
def file(tmp_path):
    """Writes the file with changes and returns its path."""

    def write(**changes):
        path = tmp_path / "runs.toml"
        path.write_text(RUNS.format(**(GIVEN | changes)), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("mark", ["±", "+-", "+/-"])
def test_a_reading_with_its_intervals(mark):
    """Magnitude and angle; per cent; one interval for every direction."""
    value, half = parse_uncertain(f"170 um {mark} 2 um @ 90 deg {mark} 1 deg", "length")
    assert value == pytest.approx(170e-6j)
    assert half == pytest.approx((2e-6, 170e-6 * np.pi / 180))
    assert parse_uncertain(f"170um{mark}2% @ 90deg", "length")[1] == pytest.approx((3.4e-6, 3.4e-6))
    assert parse_uncertain("170 um @ 90 deg", "length")[1] is None


@pytest.mark.parametrize(
    "text", ["1 um ± 0 um @ 3 deg", "1 um ± 1 @ 3 deg", "1 um @ 3 deg ± 1 deg", "1 um ± 1 g @ 3 deg",
             "1 um ± 1 um ± 1 um @ 1 deg", "1 um ± 1 um", "1 um ± -1 um @ 2 deg", "0 um ± 1 % @ 2 deg"]
)  # fmt: skip
def test_intervals_that_mean_nothing_are_refused(text):
    """None at all, without a unit, of the angle alone, of another quantity, twice, without an angle, negative."""
    with pytest.raises(UnitError):
        parse_uncertain(text, "length")


def test_sensors_state_intervals_for_readings_that_have_none(file):
    """A sensor's own goes to every reading without one; the weight's interval follows from both."""
    more = '[[sensors]]\nname = "A"\nwithin = "0.2 um"'
    runs = load_trial_runs(file(a=" ± 0.5 um", more=more))
    sigma = np.array([0.5e-6, 0.2e-6]) / 1.959964
    found = np.sqrt([np.linalg.eigvalsh(run.errors[0])[-1] for run in runs.runs])
    np.testing.assert_allclose(found, sigma, rtol=1e-6)


def test_intervals_of_some_readings_only_are_refused(file):
    """By name: a reading without an interval would count as exact."""
    with pytest.raises(DataError, match="run 'trial' and of run 'as found' do not both have intervals"):
        load_trial_runs(file(a=" ± 0.5 um"))


def test_one_plane_against_the_closed_form(file):
    """w = -v0 / alpha, alpha = (v1 - v0) / w_t: dw = w (dv0 / v0 - (dv1 - dv0) / (v1 - v0)), to first order."""
    runs = load_trial_runs(file(a=" ± 0.2 um", c=" ± 0.2 um"))
    solution = runs.solve("least-squares")
    v0, v1 = (run.readings[0] for run in runs.runs)
    w, change = solution.weights[0], v1 - v0
    relative = np.hypot(abs(1 / v0 + 1 / change), abs(1 / change)) * 0.2e-6
    (found,) = runs.uncertainty(solution).weights
    assert found.magnitude == pytest.approx(abs(w) * relative, rel=1e-6)
    assert np.sin(found.angle) == pytest.approx(relative, rel=1e-6)


def test_lag_and_lead_have_the_same_intervals(file):
    """Counting phases and angles the other way mirrors errors too."""
    text = {"a": " ± 0.1 um", "b": " ± 5 deg", "c": " ± 0.3 um"}
    lead, lag = (load_trial_runs(file(phase=phase, **text)) for phase in ("lead", "lag"))
    assert lag.runs[0].errors[0, 0, 1] == pytest.approx(-lead.runs[0].errors[0, 0, 1])
    for one, other in zip(lead.runs, lag.runs, strict=True):
        np.testing.assert_allclose(np.diagonal(one.errors[0]), np.diagonal(other.errors[0]))


def test_the_command_shows_intervals_and_where_they_come_from(file):
    """Stated, from repeats, or none and what to do; JSON with units in the keys; a doubtful weight is a finding."""
    stated = call("rotor", "influence", file(a=" ± 0.2 um", c=" ± 0.2 um"))
    assert stated.code == 0
    assert "from the stated intervals of readings" in stated.out
    within = json_of("rotor", "influence", file(a=" ± 0.2 um", c=" ± 0.2 um"))["readings"][0]["after_within_um"]
    assert f"RMS 10 -> 0 um is predicted, each reading within {within:.3g} um of its own; " in stated.out
    found = json_of("rotor", "influence", file(more=AGAIN))
    assert found["intervals"]["from"] == "repeats"
    assert found["planes"][0]["total"]["magnitude_g_within"] > 0.0
    assert found["readings"][0]["after_within_um"] > 0.0
    unsure = call("rotor", "influence", file()).out
    assert "No intervals: state those" in unsure
    assert "um is predicted; " in unsure
    doubtful = call("rotor", "influence", file(a=" ± 20 um", c=" ± 20 um"))
    assert doubtful.code == 3
    assert "is not distinguished from zero" in doubtful.out


def test_trial_weights_that_cancel_what_stayed_on(tmp_path):
    """Taken off by an opposite weight, up to rounding: the next trial is compared with the right run."""
    more = """[[runs]]
name = "opposite"
weights = { fan = "5 g @ 200 deg" }
stayed_on = true
readings.unstated = { A = "10 um @ 30 deg" }
[[runs]]
name = "other"
weights = { fan = "5 g @ 77 deg" }
stayed_on = false
readings.unstated = { A = "13 um @ 30 deg" }"""
    path = tmp_path / "runs.toml"
    path.write_text(RUNS.format(**(GIVEN | {"more": more, "stayed": "true"})), encoding="utf-8")
    assert load_trial_runs(path).effects()["other"] == pytest.approx(0.3)


def test_regions_hold_the_true_weight(file):
    """Of 400 draws of the readings with their stated errors 95 % of the ellipses hold the truth (binomial, 0.1 %)."""
    rng = np.random.default_rng(3)
    runs = load_trial_runs(file(a=" ± 1 um", b=" ± 3 deg", c=" ± 0.5 um"))
    truth, inside = runs.solve("least-squares").weights[0], 0
    for _ in range(400):
        drawn = [
            replace(run, readings=run.readings + (np.linalg.cholesky(run.errors[0]) @ rng.normal(size=2)) @ [1, 1j])
            for run in runs.runs
        ]
        again = replace(runs, runs=tuple(drawn))
        solution = again.solve("least-squares")
        (region,) = again.uncertainty(solution).regions
        off = (truth - solution.weights[0]) * np.exp(-1j * region.angle)
        inside += (off.real / region.half_axes[0]) ** 2 + (off.imag / region.half_axes[1]) ** 2 < 1.0
    assert binomtest(inside, 400, 0.95).pvalue > 1e-3


def test_the_figure_and_the_document_have_the_regions(file, tmp_path):
    """A shaded ellipse about the weight with the half axes of the document; none without intervals."""
    path = file(a=" ± 1 um", b=" ± 3 deg", c=" ± 0.5 um")
    found = json_of("rotor", "influence", path)
    (plane,) = found["planes"]
    long, short = plane["region"]["half_axes_g"]
    figure = balance.influence(path).plot()
    (patch,) = figure.axes[1].patches
    angle, length = patch.get_xy().T
    off = np.abs(length * np.exp(1j * angle) - complex(plane["total"]["x_g"], plane["total"]["y_g"]))
    assert off.max() == pytest.approx(long, rel=1e-3)
    assert off.min() == pytest.approx(short, rel=1e-3)
    assert not balance.influence("two-plane-maker").plot().axes[1].patches


def test_common_mode_error_of_phases(file):
    """Stated of a run: one plane, one sensor, where it widens the angle as the reading's own error would; refusals."""
    alone = {"a": " ± 0.001 um", "b": " ± 2 deg", "c": " ± 0.001 um"}
    text = file(**alone).read_text(encoding="utf-8")
    shared = text.replace(" ± 2 deg", " ± 0.001 deg").replace(
        'name = "as found"', 'name = "as found"\nphases_alike.unstated = "2 deg"'
    )
    found = []
    for written in (text, shared):
        runs = trial_runs_from_table(tomllib.loads(written), "runs.toml")
        found.append(runs.uncertainty(runs.solve("least-squares")).weights[0])
    assert found[1].angle == pytest.approx(found[0].angle, rel=1e-3)
    assert found[1].magnitude == pytest.approx(found[0].magnitude, rel=1e-3)
    for change, message in {'"2 deg"': "phases_alike", "unstated": "is no speed of this run's readings"}.items():
        wrong = (
            shared.replace("alike.unstated", "alike.'7 rpm'") if change == "unstated" else shared.replace(change, '"2"')
        )
        with pytest.raises(DataError, match=message):
            trial_runs_from_table(tomllib.loads(wrong), "runs.toml")
    bare = (
        file().read_text(encoding="utf-8").replace('name = "trial"', 'name = "trial"\nphases_alike.unstated = "2 deg"')
    )
    with pytest.raises(DataError, match="needs intervals of the readings"):
        trial_runs_from_table(tomllib.loads(bare), "runs.toml")
