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
    offset = speed_results.read_pitch_errors(path, 100).ahead
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
    """A disc on the crank's own shaft; a log too short."""
    log = number_edges("log", discs.turning(), Disc(100))
    with pytest.raises(AnalysisError, match="cannot be separated"):
        speed_results.pitch_from_record(log)
    with pytest.raises(AnalysisError, match="3 or more"):
        speed_results.pitch_from_free_run(number_edges("log", discs.turning(turns=2), Disc(100)))


WORN = np.array([17, 18, 41])
"""Lines without an edge."""


def calibrated(ahead, lacking=(), jitter=1e-5, index=None, lost=()):
    """Errors of a disc from 30 turns of its shaft at 8 rad/s, without some of its lines."""
    pulses = len(ahead)
    edge = np.arange(30 * pulses)
    time = (2 * np.pi * edge / pulses + ahead[edge % pulses]) / 8.0
    time += jitter * np.random.default_rng(1).normal(size=len(edge))
    have = ~np.isin(edge % pulses, lacking) & ~np.isin(edge, lost)
    log = number_edges("free", time[have], Disc(pulses), bridge=len(lacking) + len(lost) > 0)
    return speed_results.pitch_from_free_run(log, index)


def run(ahead, first, ratio=1.0, lacking=(), jitter=1e-5):
    """A log of a disc whose line ``first`` comes first."""
    pulses = len(ahead)
    time = discs.turning(pulses, 30, ratio, jitter, 0.0, np.roll(ahead, -first), start=0.3, seed=first)
    have = ~np.isin((np.arange(len(time)) + first) % pulses, lacking)
    return number_edges("log", time[have], Disc(pulses, ratio), bridge=len(lacking) > 0)


def eccentric(pulses=60, seed=0, single=0.002):
    """Errors of an eccentric disc whose single lines err, too: 0.005 rad, and ``single`` in shares of the pitch."""
    angle = 2 * np.pi * np.arange(pulses) / pulses
    return 0.005 * np.sin(angle + seed) - 0.005 * np.sin(seed) + discs.errors(pulses, single, seed)


@pytest.mark.parametrize(("ratio", "lacking"), [(1.0, ()), (2.0, ()), (3.61, ()), (1.0, WORN), (3.61, WORN)])
@pytest.mark.parametrize("first", [0, 8, 33])
def test_a_calibration_is_turned_to_where_it_fits(first, ratio, lacking):
    """A log begins at any line: found, and the fluctuation within its interval, which without it excludes it."""
    ahead = eccentric()
    log = run(ahead, first, ratio, lacking)
    turned, place = speed_results.place_pitch_errors(log, calibrated(ahead, lacking))
    assert place.line == first
    assert place.evidence == ("missing lines" if len(lacking) else "errors of single lines")
    turn = periodic_turn(turned)
    assert turn.fluctuation(NOMINAL).contains(discs.truth().fluctuation())
    assert turn.fluctuation(NOMINAL).high - turn.fluctuation(NOMINAL).low < 0.004
    if ratio == 1.0:
        assert not periodic_turn(log).fluctuation(NOMINAL).contains(discs.truth().fluctuation())


@pytest.mark.parametrize("seed", range(5))
def test_a_calibration_that_does_not_fit_gives_nothing(seed):
    """Of another disc; of the other direction of rotation; errors that jitter hides; lines that it lacks."""
    ahead = eccentric(seed=seed)
    log = run(ahead, 11 + seed)
    for other in (eccentric(seed=seed + 50), -np.roll(ahead[::-1], 1)):
        with pytest.raises(AnalysisError, match="does not fit"):
            speed_results.place_pitch_errors(log, calibrated(other))
    with pytest.raises(AnalysisError, match="does not fit: lines that it lacks have edges"):
        speed_results.place_pitch_errors(log, calibrated(ahead, WORN))
    smooth = eccentric(seed=seed, single=0.0)
    with pytest.raises(AnalysisError, match=r"does not fit.*--index"):
        speed_results.place_pitch_errors(run(smooth, 11), calibrated(smooth))


def test_an_index_pulse_places_what_single_lines_do_not(tmp_path):
    """A disc that is eccentric alone, with a pulse a turn between two lines; a pulse elsewhere is refused."""
    ahead, first, at = eccentric(single=0.0), 23, 40.4
    pulses = (2 * np.pi * (at + 60 * np.arange(25)) / 60 + ahead[40]) / 8.0
    path = tmp_path / "pitch.csv"
    speed_results.write_pitch_errors(calibrated(ahead, index=pulses), path)
    pitch = speed_results.read_pitch_errors(path, 60)
    assert pitch.index == pytest.approx(at, abs=0.1)
    log = run(ahead, first)

    def index(line):
        return np.interp(line - first + 60.0 * np.arange(1, 20), log.pulse, log.time)

    turned, place = speed_results.place_pitch_errors(log, pitch, index=index(at))
    assert (place.line, place.evidence) == (first, "index pulse")
    assert periodic_turn(turned).fluctuation(NOMINAL).contains(discs.truth().fluctuation())
    with pytest.raises(AnalysisError, match="elsewhere between lines"):
        speed_results.place_pitch_errors(log, pitch, index=index(at + 0.5))
    with pytest.raises(AnalysisError, match="lines_from_index"):
        speed_results.place_pitch_errors(log, calibrated(ahead), index=index(at))
    with pytest.raises(AnalysisError, match="index pulses come up to"):
        calibrated(ahead, index=np.sort(np.r_[pulses, pulses + 0.3]))
    rough = eccentric()
    with pytest.raises(
        AnalysisError, match="by index pulse its line 24 comes first, by the errors of single lines not"
    ):
        speed_results.place_pitch_errors(run(rough, first), calibrated(rough, index=pulses), index=index(at - 1))
    worn = run(rough, first, 1.0, WORN)
    with pytest.raises(AnalysisError, match="by the index pulse its line 24 comes first, and lines that it lacks have"):
        speed_results.place_pitch_errors(worn, calibrated(rough, WORN, index=pulses), index=index(at - 1))


def test_worn_lines_and_lost_edges_do_not_hinder_a_calibration(tmp_path):
    """The lines that there are, to 0.2 % of the pitch; the others are NaN, and an empty cell of the file."""
    ahead, path = eccentric(single=0.03), tmp_path / "pitch.csv"
    found = calibrated(ahead, WORN, jitter=1e-6, lost=[700, 1201])
    speed_results.write_pitch_errors(found, path)
    assert path.read_text(encoding="utf-8").splitlines()[18] == "17,,"
    have = ~np.isin(np.arange(60), WORN)
    for errors in (found, speed_results.read_pitch_errors(path, 60)):
        np.testing.assert_array_equal(np.isnan(errors.ahead), ~have)
        off = (errors.ahead - ahead)[have]
        assert np.abs(off - off.mean()).max() < 0.002 * 2 * np.pi / 60


@pytest.mark.parametrize(
    "text", ["slot,ahead_deg\n0,0.1\n", "slot,angle\n0,0.1\n", "slot,ahead_deg\n0,nan\n1,0\n", "\0"]
)
def test_other_tables_are_refused(tmp_path, text):
    """Too few slots, other columns, no number, no text."""
    path = tmp_path / "pitch.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"pitch\.csv"):
        speed_results.read_pitch_errors(path, 2)
