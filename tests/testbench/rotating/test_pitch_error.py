"""Errors of the disc: from a free run, and from a record where they repeat with another period."""

import numpy as np
import pytest

from balance.errors import DataError
from testbench.errors import AnalysisError
from testbench.rotating import Disc, number_edges, periodic_turn, speed_results

from . import discs

NOMINAL = 276 * discs.RPM / 3.61


@pytest.mark.parametrize("pulses", [100, 101])
def test_a_free_run_gives_the_errors(pulses):
    """A shaft slowing down freely, 1 us jitter: every slot to 0.2 % of the pitch."""
    ahead = discs.errors(pulses, 0.03, 1)
    k = np.arange(12 * pulses)
    angle = 2 * np.pi * k / pulses + ahead[k % pulses]
    time = (8.0 - np.sqrt(64.0 - 0.1 * angle)) / 0.05 + 1e-6 * np.random.default_rng(2).normal(size=len(k))
    found = speed_results.pitch_from_free_run(number_edges("free", time, Disc(pulses)))
    assert np.abs(found.ahead - ahead).max() < 0.002 * 2 * np.pi / pulses
    assert found.rms == pytest.approx(np.std(ahead) * pulses / (2 * np.pi), rel=0.02)


def test_a_calibrated_disc_gives_the_motion(tmp_path):
    """2 % of pitch on the crank's shaft, put right: fluctuation to 5e-5 instead of to 5e-3; through a file."""
    ahead = discs.errors(100, 0.02, 5)
    path = tmp_path / "pitch.csv"
    speed_results.write_pitch_errors(speed_results.PitchErrors(ahead, 0.0 * ahead), path)
    offset = speed_results.read_pitch_errors(path, 100)
    np.testing.assert_allclose(offset, ahead, atol=1e-9)
    turn = periodic_turn(number_edges("log", discs.turning(ahead=ahead), Disc(100), False, offset))
    assert turn.fluctuation(NOMINAL).value == pytest.approx(discs.truth().fluctuation(), abs=5e-5)
    assert turn.repeated == 0.0


def test_on_the_motor_s_shaft_they_are_told_apart():
    """Geared 3.61, errors of the disc and fluctuation have other periods: both are found from one record."""
    ahead = discs.errors(100, 0.02, 7)
    log = number_edges("log", discs.turning(ratio=3.61, turns=12, ahead=ahead, jitter=2e-6), Disc(100, 3.61))
    found, turn = speed_results.pitch_from_record(log)
    assert np.mean(np.abs(found.ahead - ahead) < found.error) > 0.85
    assert found.rms == pytest.approx(0.02, rel=0.2)
    assert turn.fluctuation(NOMINAL).contains(discs.truth().fluctuation())
    assert turn.jitter < 5e-6 < periodic_turn(log).jitter


def test_what_cannot_be_told_apart_is_refused():
    """A disc on the crank's own shaft; a log with lost edges; a log too short; a table of another disc."""
    log = number_edges("log", discs.turning(), Disc(100))
    with pytest.raises(AnalysisError, match="cannot be separated"):
        speed_results.pitch_from_record(log)
    bridged = number_edges("log", np.delete(discs.turning(), 50), Disc(100), bridge=True)
    with pytest.raises(AnalysisError, match="lost"):
        speed_results.pitch_from_free_run(bridged)
    with pytest.raises(AnalysisError, match="3 or more"):
        speed_results.pitch_from_free_run(number_edges("log", discs.turning(turns=2), Disc(100)))


@pytest.mark.parametrize(
    "text", ["slot,ahead_deg\n0,0.1\n", "slot,angle\n0,0.1\n", "slot,ahead_deg\n0,nan\n1,0\n", "\0"]
)
def test_other_tables_are_refused(tmp_path, text):
    """Too few slots, other columns, no number, no text."""
    path = tmp_path / "pitch.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"pitch\.csv"):
        speed_results.read_pitch_errors(path, 2)
