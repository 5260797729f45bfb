"""``testbench speed``."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from testbench.cli.speed import speed
from testbench.rotating import LostEdges

from ..rotating import discs


def written(path, time):
    """A log of edges in microseconds."""
    path.write_text("t_us\n" + "\n".join(str(round(t * 1e6)) for t in time) + "\n", encoding="utf-8")
    return str(path)


def run(*arguments):
    """Exit code and output of the command."""
    result = CliRunner().invoke(speed, arguments, standalone_mode=False, catch_exceptions=False)
    return result.return_value, result.output


@pytest.fixture
def log(tmp_path):
    """Eight steady turns, 100 pulses a turn."""
    return written(tmp_path / "edges.csv", discs.turning())


MODEL = ("--pulses", "100", "--drive", "inverted-slider-crank", "--reading", "ungeared")


def test_table_beside_the_model(log, tmp_path):
    """From edges, the interval, and computed; exit code 0; a figure and the course."""
    figure, table = tmp_path / "speed.svg", tmp_path / "speed.csv"
    code, output = run(log, *MODEL, "--figure", str(figure), "--csv", str(table))
    assert code == 0
    assert "0.22321" in output
    assert "found by aligning the curves" in output
    assert figure.read_text(encoding="utf-8").startswith("<?xml")
    assert table.read_text(encoding="utf-8").splitlines()[0].startswith("time_s,angle_deg_from_first_edge,speed_rpm")


def test_json_has_units_in_its_keys(log):
    """Every number: intervals, jitter, clock, harmonics, model."""
    code, output = run(log, *MODEL, "--first-edge-at", "0deg", "--json")
    document = json.loads(output)
    assert code == 0
    assert document["clock_step_us"] == pytest.approx(4.0)
    steady = document["steady"]
    assert steady["fluctuation"]["low"] < 0.22321449 < steady["fluctuation"]["high"]
    assert steady["nominal_rpm"] == pytest.approx(276 / 3.61)
    model = discs.truth()
    for key, true in (("mean", model.mean_speed), ("fastest", model.fastest[1]), ("slowest", model.slowest[1])):
        interval, rpm = steady[f"{key}_rpm"], true * 30.0 / np.pi
        assert 0.999 * rpm < interval["low"] < interval["value"] < interval["high"] < 1.001 * rpm
    assert document["model"]["fluctuation_in_interval"]
    assert not document["model"]["first_edge_found_by_alignment"]
    assert document["model"]["rms_difference_rpm"] < 0.01
    assert document["origin"] == "unstated"
    assert document["findings"] == []


def test_lost_edges_are_named_not_computed_through(tmp_path):
    """Refused with the place; with --bridge done, the place among the findings, exit code 3."""
    log = written(tmp_path / "lost.csv", np.delete(discs.turning(), [120, 121]))
    with pytest.raises(LostEdges, match=r"lost\.csv: 2 edges lost: 2 after edge 119"):
        run(log, "--pulses", "100")
    code, output = run(log, "--pulses", "100", "--bridge")
    assert code == 3
    assert "2 after edge 119" in output


def test_errors_of_the_disc_are_named(tmp_path):
    """2 % of pitch on the crank's shaft is a finding; a calibration takes it away."""
    ahead = discs.errors(100, 0.02, 4)
    log = written(tmp_path / "edges.csv", discs.turning(ahead=ahead))
    code, output = run(log, "--pulses", "100")
    assert code == 3
    assert "out of place" in output
    k = np.arange(3001)
    free = written(tmp_path / "free.csv", 20.0 * (k + ahead[k % 100] * 100 / 2 / np.pi) / 1000)
    pitch = str(tmp_path / "pitch.csv")
    assert run(free, "--pulses", "100", "--calibrate", pitch)[0] == 0
    later = written(tmp_path / "later.csv", discs.turning(ahead=np.roll(ahead, -37)))
    for path, line in ((log, 0), (later, 37)):
        code, output = run(path, "--pulses", "100", "--pitch", pitch, "--json")
        assert json.loads(output)["steady"]["fluctuation"]["value"] == pytest.approx(0.22175, abs=2e-4)
        assert json.loads(output)["calibration"]["first_edge_is_line"] == line
    assert "if the disc is concentric" not in run(log, "--pulses", "100", "--pitch", pitch)[1]


def test_what_an_eccentric_disc_would_add_is_said(log, tmp_path):
    """A disc on the crank, not calibrated: 0.1 deg once a turn adds up to 2 x 0.1 deg; of one on the motor nothing."""
    assert "over a turn, if the disc is concentric (0.1 deg: 0.0035 more or less)." in " ".join(
        run(log, "--pulses", "100", "--nominal", "76.454rpm")[1].split()
    )
    geared = written(tmp_path / "motor.csv", discs.turning(ratio=3.61))
    assert "concentric" not in run(geared, "--pulses", "100", "--ratio", "3.61")[1]


def test_start_up_beside_the_computed_one(tmp_path):
    """A log from standstill: turn by turn, measured and computed, to 0.3 rpm."""
    log = written(tmp_path / "start.csv", discs.starting(turns=3))
    code, output = run(log, *MODEL, "--start-up", "2", "--json")
    document = json.loads(output)
    assert code == 0
    speeds = np.array(document["course"]["speed_rpm"])
    assert speeds.max() == pytest.approx(document["start_up"]["turns"][1]["fastest_rpm"], abs=0.3)
    code, output = run(log, *MODEL, "--start-up", "2")
    assert "Start-up" in output


def test_what_proves_the_edges_a_turn(log, tmp_path):
    """The log of a crank that fluctuates shows them; at constant speed it is said that nothing does."""
    assert "The motion repeats every 100 edges." in run(log, "--pulses", "100")[1]
    code, output = run(log, "--pulses", "200")
    assert code == 3
    assert "has 100 edges a turn, not 200, all speeds are 2 times as high" in " ".join(output.split())
    even = written(tmp_path / "even.csv", np.arange(801) * 8e-3)
    assert "Nothing in the log proves 200 edges a turn" in run(even, "--pulses", "200")[1]
    assert json.loads(run(even, "--pulses", "200", "--json")[1])["motion_repeats_every_edges"] is None


@pytest.mark.parametrize(
    "options",
    [
        ("--ratio", "inf"),
        ("--ratio", "nan"),
        ("--nominal", "0rpm"),
        ("--nominal", "5 Hz"),
        ("--steady-within", "nan"),
        ("--steady-within", "0"),
        ("--reading", "geared"),
        ("--motor-speed", "276rpm"),
        ("--first-edge-at", "3deg"),
        ("--index", "index.csv"),
    ],
)
def test_options_that_cannot_be_meant(log, options):
    """Nonsense, and what changes nothing without a drive, is a wrong command line."""
    result = CliRunner().invoke(speed, [log, "--pulses", "100", *options])
    assert result.exit_code == 2
    assert options[0] in result.output


def test_a_nominal_speed_far_from_the_mean_is_a_finding(log):
    """The motor's 276 rpm are not the crank's 76.45 rpm; what slip and load do to a motor is no finding."""
    code, output = run(log, "--pulses", "100", "--nominal", "276rpm")
    assert code == 3
    assert "times the nominal 276 rpm: the fluctuation is divided by the nominal speed" in " ".join(output.split())
    assert run(log, "--pulses", "100", "--nominal", "90rpm")[0] == 0
