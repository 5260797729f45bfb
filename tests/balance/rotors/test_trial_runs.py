"""Trial runs: published cases, phase conventions, and what is refused by name."""

import numpy as np
import pytest

from balance.errors import DataError
from balance.rotors.results import predicted_residual
from balance.rotors.rotor import angle_deg
from balance.rotors.trial_runs import load_trial_runs

RUNS = """
phase = "{phase}"
angles = "{angles}"
[[planes]]
name = "fan"
[[runs]]
name = "as found"
readings."3000 rpm" = {{ A = "10 um @ {a} deg", B = "4 um @ {b} deg" }}
[[runs]]
name = "trial"
weights = {{ fan = "5 g @ {w} deg" }}
{stayed}
readings."3000 rpm" = {{ A = "{size} um @ {c} deg", B = "4 um @ {b} deg" }}
"""
GIVEN = {"phase": "lead", "angles": "with rotation", "stayed": "stayed_on = false", "size": 7, "a": 30, "b": 100,
         "c": 75, "w": 20}  # fmt: skip


def _load(tmp_path, **changes):
    path = tmp_path / "runs.toml"
    path.write_text(RUNS.format(**(GIVEN | changes)), encoding="utf-8")
    return load_trial_runs(path)


@pytest.mark.parametrize(
    ("name", "unit", "expected", "rms_after"),
    [
        ("one-plane-maker", 1e-3, [(81.373347, 324.46232)], 0.0),
        ("two-plane-maker", 1e-3, [(1.9558238, 237.43828), (1.0734362, 121.09039)], 0.0),
        ("two-plane-maker-186", 1e-3, [(1.9733722, 236.48213), (1.0712569, 121.65591)], 0.0),
        ("goodman-1964", 1e-3, [(0.80952381, 0.0), (1.4761905, 0.0)], 0.35634832),
        ("pavelek-2016", 1e-3, [(18.003083, 229.4907), (30.594948, 351.45048)], 0.37568178),
        ("darlow-1982", 1e-3, [(1.3745258, 356.49913), (1.2266781, 215.87656), (0.97726671, 167.72445)], 1.4232857),
        ("feese-2004", 28.349523125e-3, [(15.329798, 2.90037), (6.6168947, 112.87436)], 0.069870226),
        ("feese-2004-trial-off", 28.349523125e-3, [(5.4439614, 222.06531), (6.6168947, 112.87436)], 0.069870226),
    ],
)
def test_published_cases(name, unit, expected, rms_after):
    """Correction weights of published cases, and the residual readings."""
    solution = load_trial_runs(name).solve("least-squares")
    for weight, (size, angle) in zip(solution.weights, expected, strict=True):
        assert abs(weight) / unit == pytest.approx(size, rel=1e-6)
        assert (angle_deg(complex(weight)) - angle + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-5)
    assert np.sqrt(np.mean(np.abs(solution.residual) ** 2)) * 1e6 == pytest.approx(rms_after, rel=1e-6, abs=1e-9)


def test_rounding_is_no_residual():
    """As many planes as readings: what remains is exactly zero."""
    assert not predicted_residual(load_trial_runs("two-plane-maker").solve("least-squares")).any()


def test_weight_that_is_still_on_is_taken_into_account(tmp_path):
    """The maker's note with its trial left on: 58.12 g at 234.46 deg is to be added, 81.37 g in all."""
    changes = {"size": 5, "a": 160, "c": 70, "w": 0}
    off, on = (_load(tmp_path, stayed=f"stayed_on = {s}", **changes) for s in ("false", "true"))
    np.testing.assert_allclose(off.solve("least-squares").weights, on.solve("least-squares").weights, rtol=1e-12)
    assert off.mounted == pytest.approx([0.0])
    assert on.mounted == pytest.approx([5e-3])


def test_phase_and_angle_senses(tmp_path):
    """Lag and lead of the same vibration, weights counted with and against rotation: one physical answer."""
    turned = {key: -GIVEN[key] for key in "abc"}
    lead = _load(tmp_path).solve("least-squares").weights
    lag = _load(tmp_path, phase="lag", **turned).solve("least-squares").weights
    against = _load(tmp_path, angles="against rotation", w=-20)
    np.testing.assert_allclose(lag, lead, rtol=1e-12)
    np.testing.assert_allclose(against.solve("least-squares").weights, lead, rtol=1e-12)
    np.testing.assert_allclose(against.in_file_sense(lead), lead.conj())
    wrong = _load(tmp_path, phase="lag").solve("least-squares").weights
    assert not np.allclose(wrong, lead)


def test_a_trial_weight_with_too_little_effect_is_named(tmp_path):
    """A trial that changes no reading by a quarter is refused by run; a file may state a smaller effect."""
    runs = _load(tmp_path, size=10.8, c=32)
    with pytest.raises(DataError, match="trial weight of run 'trial' changed no reading by more than 8"):
        runs.solve("least-squares")
    stated = _load(tmp_path, size=10.8, c=32, stayed="stayed_on = false", phase='lead"\nleast_effect = 0.05\n#"')
    assert stated.solve("least-squares").is_optimal(1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("stayed_on = false", "", r"runs\[1\] \(trial\): stayed_on is missing"),
        ('phase = "lead"', "", "phase: missing"),
        ('phase = "lead"', 'phase = "left"', "expected 'lead' or 'lag'"),
        ("fan =", "pump =", "pump is no plane"),
        ('"10 um @ 30 deg"', '"10 um"', "has no angle"),
        ('A = "7 um', 'C = "7 um', "is not read in every run"),
        ('A = "7 um', 'A = "7 mm/s', "velocity here and a length"),
        ('weights = { fan = "5 g @ 20 deg" }', 'weights = { fan = "0 g @ 20 deg" }', "trial weight above zero"),
        ('"3000 rpm" = { A = "10', '"fast" = { A = "10', "readings.fast: 'fast' is no angular velocity"),
        ('name = "trial"', 'name = "as found"', "runs: 'as found' is there twice"),
        ('phase = "lead"', 'phase = "lead"\namplitude = "mean"', "amplitude: 'mean': expected 'peak', 'peak_to_peak'"),
        ('phase = "lead"', 'phase = "lead"\nleast_effect = -1', "least_effect: -1: expected more than zero"),
    ],
)
def test_wrong_files_are_named(tmp_path, old, new, message):
    """What is missing, unknown or contradictory is refused where it stands."""
    text = RUNS.format(**GIVEN)
    assert old in text
    path = tmp_path / "runs.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(DataError, match=message):
        load_trial_runs(path)


def test_one_speed_written_in_two_ways_is_refused(tmp_path):
    """3000 rpm and 50 turns a second are one: two influences of one weight there contradict each other."""
    text = RUNS.format(**GIVEN)
    twice = "\n".join(
        f"{line}\n{line.replace('3000 rpm', '50 turn/s')}" if "readings" in line else line for line in text.splitlines()
    )
    path = tmp_path / "runs.toml"
    path.write_text(twice, encoding="utf-8")
    assert twice.count("50 turn/s") == text.count("3000 rpm") > 0
    with pytest.raises(DataError, match="50 turn/s is the same speed as 3000 rpm"):
        load_trial_runs(path)


def test_speeds_and_sensors_are_rows(tmp_path):
    """Two speeds and sensors of different quantities: four rows, weighed by scale and speed."""
    text = """
phase = "lag"
angles = "against rotation"
per = "g mm"
speed_weights = { "900 rpm" = 4.0 }
[[planes]]
name = "p"
limit = "20 g mm"
[[sensors]]
name = "A"
scale = "10 um"
[[sensors]]
name = "B"
scale = "2 mm/s"
[initial."600 rpm"]
A = "20 um @ 10 deg"
B = "3 mm/s @ 50 deg"
[initial."900 rpm"]
A = "30 um @ 20 deg"
B = "4 mm/s @ 60 deg"
[coefficients."600 rpm"]
A = ["1 um @ 0 deg"]
B = ["0.1 mm/s @ 0 deg"]
[coefficients."900 rpm"]
A = ["2 um @ 0 deg"]
B = ["0.2 mm/s @ 0 deg"]
"""
    path = tmp_path / "runs.toml"
    path.write_text(text, encoding="utf-8")
    runs = load_trial_runs(path)
    assert runs.rows == (("A", "600 rpm"), ("B", "600 rpm"), ("A", "900 rpm"), ("B", "900 rpm"))
    np.testing.assert_allclose(runs.factors, [1e5, 500, 2e5, 1000])
    limited = runs.solve("min-max")
    assert abs(limited.weights[0]) <= 20e-6 * (1 + 1e-9)
    path.write_text(text.replace('scale = "2 mm/s"', "weight = 2.0"), encoding="utf-8")
    with pytest.raises(DataError, match="give every sensor a scale"):
        load_trial_runs(path)
