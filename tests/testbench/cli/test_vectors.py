"""``testbench vectors``, and from logs to correction weights."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import balance
from balance.cli.rotor import influence
from testbench.cli.ingest import ingest
from testbench.cli.vectors import vectors
from testbench.errors import AnalysisError, StoreError
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.rotating import order_tracking

from ...commands import assert_fits, held_to_widths
from ..rotating.machine import UNBALANCE, Rotor

OWN = 46.137
"""Turns a second of which no samples keep step."""


def stored(folder: Path, name: str, rotor: Rotor) -> str:
    """The rotor's log as a stored run."""
    log, campaign = folder / f"{name}.csv", folder / "campaign"
    log.write_text(rotor.csv(), encoding="utf-8")
    campaign.mkdir(exist_ok=True)
    (outcome,) = Ingest(campaign).run(PlannedRun(name, (log,)))
    assert outcome.status == "stored", outcome.message
    return str(campaign / str(outcome.file))


def run(*arguments: str) -> tuple[int, str]:
    """Exit code and output of the command."""
    result = CliRunner().invoke(vectors, arguments, standalone_mode=False, catch_exceptions=False)
    return result.return_value, result.output


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A stored run as found."""
    return stored(tmp_path_factory.mktemp("rotor"), "found", Rotor(seconds=2.0, speed=OWN))


@pytest.fixture(scope="module")
def in_step(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A stored run that was sampled in step with its speed."""
    return stored(tmp_path_factory.mktemp("rotor"), "in-step", Rotor(seconds=1.0))


def test_json_holds_the_truth_with_intervals(found: str) -> None:
    """Both sensors, amplitude in SI, lead and lag opposite, peak to peak twice the peak."""
    code, output = run(found, "--json")
    lead = json.loads(output)
    assert code == 0
    assert lead["speed_rpm"] == pytest.approx(60 * OWN, rel=1e-4)
    for row, truth in zip(lead["vectors"], Rotor().truth(), strict=True):
        assert abs(row["amplitude_m_s2"] - abs(truth)) < 2 * row["amplitude_m_s2_within"]
        assert row["phase_deg"] == pytest.approx(np.degrees(np.angle(truth)), abs=2 * row["phase_deg_within"] + 0.5)
    lag = json.loads(run(found, "--json", "--phase", "lag", "--amplitude", "peak_to_peak")[1])
    for one, other in zip(lead["vectors"], lag["vectors"], strict=True):
        assert other["phase_deg"] == pytest.approx(-one["phase_deg"])
        assert other["amplitude_m_s2"] == pytest.approx(2 * one["amplitude_m_s2"])


@pytest.mark.parametrize(
    ("within", "answer"),
    [
        (0.05, "not at 3000rpm within 5 %"), ("5 %", "not at 3000rpm within 5 %"), ("0.05", "within 5 %"),
        (5, "steady_within: 5: expected a share"), ("60%", "or '5 %'"), (0, "or '5 %'"), ("much", "or '5 %'"),
        (np.nan, "or '5 %'"),
    ],
)  # fmt: skip
def test_a_share_is_no_per_cent(found: str, within: float | str, answer: str) -> None:
    """In Python a number is a share, and per cent have their sign; the command's are per cent."""
    with pytest.raises(AnalysisError, match=answer):
        order_tracking.vectors(found, speed="3000rpm", steady_within=within)


def test_table(found: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sensor, amplitude with interval, phase and its sense, speed."""
    titles = held_to_widths(monkeypatch)
    code, output = run(found, "--sensor", "B")
    assert code == 0
    assert_fits(output)
    assert titles
    assert "lead of the pulse" in output
    assert "91 turns, 1 mark each, at 2768" in " ".join(output.split())


def test_a_sensor_in_millivolts_is_read_by_its_calibration(tmp_path: Path) -> None:
    """The same vectors as of the log in m/s2; a channel of another kind is named, and its unit."""
    rotor = Rotor(seconds=2.0, speed=OWN)
    _, *rows = rotor.csv().splitlines()
    cells = [row.split(",") for row in rows]
    lines = [f"{t},{p},{a},{float(b) * 10.2:.9g},{20 + i % 3}" for i, (t, p, a, b) in enumerate(cells)]
    (tmp_path / "log.csv").write_text("\n".join(["t (s),tacho (V),A (m/s^2),B (mV),T (degC)", *lines, ""]), "utf-8")
    sensors = "".join(
        f'[sensors.{name}]\nkind = "accelerometer"\nlogger = "daq"\nchannels = {{ x = "{name}" }}\nposition = ["0 m", '
        '"0 m", "0 m"]\n'
        for name in "AB"
    )
    calibration = '[sensors.B.calibration]\nsensitivity = "10.2 mV/(m/s^2)"\n'
    rig, campaign = tmp_path / "rig.toml", tmp_path / "campaign"
    rig.write_text(f'mechanism = "none"\n[loggers.daq]\n{sensors}{calibration}', "utf-8")
    arguments = [str(tmp_path / "log.csv"), "--rig", str(rig), "-o", str(campaign)]
    assert CliRunner().invoke(ingest, arguments, standalone_mode=False, catch_exceptions=False).return_value == 0
    _, plain = run(stored(tmp_path, "plain", rotor), "--json")
    code, out = run(str(campaign / "log.h5"), "--json")
    assert code == 0
    document = json.loads(out)
    assert document["left_out"] == ["T (degC)"]
    for one, other in zip(document["vectors"], json.loads(plain)["vectors"], strict=True):
        assert one["sensor"] == other["sensor"]
        assert one["amplitude_m_s2"] == pytest.approx(other["amplitude_m_s2"], rel=1e-7)
        assert one["phase_deg"] == pytest.approx(other["phase_deg"], abs=1e-5)
    _, out = run(str(campaign / "log.h5"))
    assert "Left out: T (degC)" in out
    assert "Calibrated B: 10.2 mV/(m/s^2)" in out
    assert "# left out: T (degC)" in run(str(campaign / "log.h5"), "--speed", f"{60 * OWN}rpm", "--toml", "x")[1]


def test_sampling_in_step_is_a_finding_and_in_every_interval(in_step: str) -> None:
    """Half of one of 200 samples a turn, 0.9 deg, in text, document and file of trial runs, whose interval it is."""
    code, output = run(in_step)
    assert code == 3
    assert "Finding: the sampling is synchronous with the speed (200 samples a turn)" in " ".join(output.split())
    document = json.loads(run(in_step, "--json")[1])
    assert document["phases_off_alike_deg_within"] == pytest.approx(0.9, abs=0.06)
    assert all(row["phase_deg_within"] > 0.8 for row in document["vectors"])
    text = run(in_step, "--speed", "3000rpm", "--toml", "found")[1]
    (written,) = tomllib.loads(text)["runs"]
    shared, own = float(written["phases_alike"]["3000rpm"].removesuffix("deg")), written["readings"]["3000rpm"]
    assert shared == pytest.approx(1.96 * 1.8 / np.sqrt(12.0), rel=0.08)
    for row, reading in zip(document["vectors"], own.values(), strict=True):
        alone = float(reading.split("±")[-1].removesuffix("deg"))
        assert np.hypot(alone, document["phases_off_alike_deg_within"]) == pytest.approx(
            row["phase_deg_within"], rel=0.01
        )
    assert "# finding: the sampling is synchronous" in text


def test_several_marks_a_turn(tmp_path: Path) -> None:
    """Two marks taken for one: the finding asks, a speed that is asked too; with --pulses the truth, and of even marks
    no phase for trial runs. A part of the record has fewer turns.
    """
    file = stored(tmp_path, "two", Rotor(seconds=2.0, speed=OWN, marks=(0.0, 0.5)))
    code, output = run(file)
    assert code == 3
    assert "2 marks a turn? pulses=2 (--pulses 2), then this is order 2 of 2768" in " ".join(output.split())
    assert run(file, "--pulses", "1")[0] == 0
    with pytest.raises(AnalysisError, match=r"turns at 5536.* rpm by 1 pulse a turn, not at 2768rpm .*--pulses 2"):
        run(file, "--speed", "2768rpm")
    code, output = run(file, "--pulses", "2", "--from", "0.5s", "--to", "1500 ms", "--json")
    document = json.loads(output)
    assert (code, document["pulses_per_turn"], document["turns"]) == (3, 2, 45)
    for row, truth in zip(document["vectors"], Rotor().truth(), strict=True):
        assert abs(row["amplitude_m_s2"] - abs(truth)) < 2 * row["amplitude_m_s2_within"]
    assert any("look alike" in text and "multiples of 180 deg" in text for text in document["findings"])
    with pytest.raises(AnalysisError, match="2 marks that look alike"):
        run(file, "--pulses", "2", "--speed", "2768rpm", "--toml", "x")
    with pytest.raises(AnalysisError, match="no samples from 3 s on: it has 0 to 1"):
        order_tracking.vectors(file, begin=3.0)


def test_a_time_without_a_unit_is_a_finding_of_what_it_times(tmp_path: Path) -> None:
    """Seconds were assumed at ingest: the speed that follows says so again."""
    time = np.arange(0.0, 2.0, 2e-4)
    pulse, shake = (np.mod(24.3 * time, 1.0) < 0.1) * 5.0, np.sin(2.0 * np.pi * 24.3 * time)
    rows = "\n".join(f"{t:.4f},{p:g},{x:.6f}" for t, p, x in zip(time, pulse, shake, strict=True))
    (tmp_path / "log.csv").write_text(f"time,tacho (V),A (m/s^2)\n{rows}\n")
    CliRunner().invoke(ingest, [str(tmp_path / "log.csv"), "-o", str(tmp_path / "c")])
    stored = order_tracking.vectors(tmp_path / "c" / "log.h5")
    assert any("carries no unit: seconds are assumed" in text for text in stored.findings())


def test_figure(found: str, tmp_path: Path) -> None:
    """A vector for each sensor, its tip at amplitude and phase of the document, its field as wide as the intervals."""
    code, _ = run(found, "--figure", str(tmp_path / "vectors.svg"))
    assert code == 0
    assert "origin unstated" in (tmp_path / "vectors.svg").read_text(encoding="utf-8")
    document = json.loads(run(found, "--json")[1])
    vectors = order_tracking.vectors(found)
    (axes,) = vectors.plot().axes
    for row, line, field in zip(document["vectors"], axes.lines, axes.patches, strict=True):
        assert line.get_xdata()[1] == pytest.approx(np.radians(row["phase_deg"]))
        assert line.get_ydata()[1] == pytest.approx(row["amplitude_m_s2"])
        assert field.get_height() == pytest.approx(2 * row["amplitude_m_s2_within"])
        assert field.get_width() == pytest.approx(2 * np.radians(row["phase_deg_within"]))
    scattered = replace(vectors.vectors[0], phase_within=np.pi)
    (axes,) = replace(vectors, vectors=(scattered, *vectors.vectors[1:])).plot().axes
    assert axes.patches[0].get_y() == 0.0
    assert axes.patches[0].get_width() == pytest.approx(2 * np.pi)


def test_refusals(found: str) -> None:
    """No tachometer, another speed, an order beyond the samples, a sensor that is none."""
    with pytest.raises(StoreError, match=r"no channel 'keyphasor'.*'tacho"):
        run(found, "--tacho", "keyphasor")
    with pytest.raises(AnalysisError, match="not at 3600rpm within 1 %"):
        run(found, "--speed", "3600rpm")
    with pytest.raises(AnalysisError, match="do not resolve order 90"):
        run(found, "--order", "90")
    with pytest.raises(AnalysisError, match=r"'tacho.* is in V: expected one of length"):
        run(found, "--sensor", "tacho")


def test_a_sensor_that_does_not_move_is_named(tmp_path: Path) -> None:
    """Rounding errors of a constant are no vibration: refused with the channel and its value; the others are given."""
    log, campaign = tmp_path / "dead.csv", tmp_path / "campaign"
    head, *rows = Rotor(seconds=1.0, speed=OWN).csv().splitlines()
    text = [f"{row.rpartition(',')[0]},2.5" for row in rows]  # B is the last column
    log.write_text("\n".join([head, *text]) + "\n", encoding="utf-8")
    campaign.mkdir()
    (outcome,) = Ingest(campaign).run(PlannedRun("dead", (log,)))
    stored_run = str(campaign / str(outcome.file))
    with pytest.raises(AnalysisError, match=r"channel 'B.* is 2.5 m/s\^2 throughout: dead"):
        run(stored_run)
    assert run(stored_run, "--sensor", "A")[0] == 0


@pytest.mark.parametrize(
    "options",
    [
        ("--toml", "x"),
        ("--toml", "x", "--speed", "3000rpm", "--json"),
        ("--weight", "a=1 g @ 0 deg", "--came-off"),
        ("--toml", "x", "--speed", "3000rpm", "--weight", "a=1 g @ 0 deg"),
        ("--toml", "x", "--speed", "3000rpm", "--stayed-on"),
        ("--toml", "x", "--speed", "3000rpm", "--weight", "a=1 g", "--came-off"),
        ("--toml", "x", "--speed", "3000rpm", "--order", "2"),
        ("--sensor", "B", "--sensor", "B"),
        ("--level", "nan"),
    ],
)
def test_options_that_do_not_go_together(found: str, options: tuple[str, ...]) -> None:
    """A wrong command line, exit 2."""
    result = CliRunner().invoke(vectors, [found, *options])
    assert result.exit_code == 2
    assert "--" in result.output


TRIALS = {"as found": (None, 0j), "trial 1": ("1", 1.2 * np.exp(0.5j)), "trial 2": ("2", 1.0 * np.exp(2.0j))}
"""Plane and trial weight of each run [g]."""


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The runs of TRIALS, stored."""
    folder, files = tmp_path_factory.mktemp("trials"), []
    for seed, (plane, weight) in enumerate(TRIALS.values()):
        on = np.array([weight if plane == p else 0.0 for p in ("1", "2")])
        files.append(stored(folder, f"run-{seed}", Rotor(weights=on, seed=seed, seconds=2.0)))
    return files


@pytest.mark.parametrize(("phase", "angles"), [("lead", "with rotation"), ("lag", "against rotation")])
def test_from_logs_to_correction_weights(trials: list[str], tmp_path: Path, phase: str, angles: str) -> None:
    """As found and two trial runs, logged, stored, reduced; the weights of the file leave 2 % of the vibration."""
    sense = 1.0 if phase == "lead" else -1.0
    lines = [f'phase = "{phase}"', f'angles = "{angles}"', 'amplitude = "peak"']
    lines += ["", "[[planes]]", 'name = "1"', "", "[[planes]]", 'name = "2"', ""]
    for file, (name, (plane, weight)) in zip(trials, TRIALS.items(), strict=True):
        on: dict[str, str] = {}
        arguments = [file, "--speed", "3000 rpm", "--phase", phase, "--toml", name]
        if plane:
            angle = sense * np.degrees(np.angle(weight))
            on = {plane: f"{abs(weight):.6f} g @ {angle:.4f} deg"}
            arguments += ["--weight", f"{plane}={on[plane]}", "--came-off"]
        lines.append(run(*arguments)[1])
        assert lines[-1] == order_tracking.vectors(file, speed="3000 rpm", phase=phase).to_toml(name, on) + "\n"
    (tmp_path / "runs.toml").write_text("\n".join(lines), encoding="utf-8")
    correction = _weights(tmp_path / "runs.toml", sense)
    found = balance.influence(tomllib.loads("\n".join(lines)))
    np.testing.assert_allclose(found.table()["total.magnitude_g"], np.abs(correction))
    np.testing.assert_allclose(correction, -UNBALANCE, atol=0.03)
    left = np.abs(Rotor(weights=correction).truth()) / np.abs(Rotor().truth())
    assert left.max() < 0.03


def _weights(runs: Path, sense: float) -> np.ndarray:
    """Correction weights of ``balance rotor influence``, with the rotation whatever the file counts [g]."""
    shown = CliRunner().invoke(influence, [str(runs), "--json"], standalone_mode=False, catch_exceptions=False)
    assert shown.return_value in (0, None), shown.output
    found = json.loads(shown.stdout)
    assert found["intervals"]["from"] == "stated"
    totals = [plane["total"] for plane in found["planes"]]
    assert all(
        abs(t["magnitude_g"] - abs(u)) < 2 * t["magnitude_g_within"] for t, u in zip(totals, UNBALANCE, strict=True)
    )
    assert all(0.002 < t["magnitude_g_within"] < 0.1 for t in totals)
    return np.array([complex(total["x_g"], sense * total["y_g"]) for total in totals])
