"""``testbench info``, ``formats``, ``ingest``, ``list`` and ``verify`` as a person and a program call them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from balance.cli.printing import SHOWN_PER_KIND
from testbench.cli.options import print_reading_findings
from testbench.recording import Finding
from testbench.store import open_run

from ..readers import reading
from ..store.stored import names_in

HEADER = "Time (s),AccX (g)\n"
ROWS = "".join(f"{i / 1000:.4f},{0.5 * (i % 7) - 3:.4f}\n" for i in range(200))


@pytest.fixture
def log(tmp_path):
    """A log that is in order."""
    path = tmp_path / "r001.csv"
    path.write_text(HEADER + ROWS)
    return path


def test_info_as_json(command, log):
    """One document with exactly the documented keys; numbers only with --stats."""
    code, out, err = command("info", log, "--stats", "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert list(document) == ["schema_version", "format", "groups", "findings"]
    (group,) = document["groups"]
    assert list(group) == ["name", "samples", "rate_hz", "rate_source", "start_time", "clock", "channels"]
    assert list(group["clock"]) == ["t_first_s", "t_last_s", "dt_min_s", "dt_median_s", "dt_max_s", "non_increasing"]
    assert set(group["channels"][1]) == {"name", "unit", "n", "nan", "min", "max", "mean", "first", "last"}
    assert list(document["findings"][0]) == ["code", "channel", "where", "message"]
    assert (group["samples"], group["rate_source"]) == (200, "median_step")
    code, out, _ = command("info", log, "--json")
    assert list(json.loads(out)["groups"][0]["channels"][1]) == ["name", "unit"]


def test_info_for_people(command, log):
    """Channels with units, and the findings, on stdout."""
    code, out, err = command("info", log, "--stats")
    assert (code, err) == (0, "")
    assert "AccX (g)" in out
    assert "200 samples, 1000 Hz" in out


def test_info_of_very_many_channels_says_how_many_more(command, log):
    """People see five hundred channels of a group, and the number of the others; the JSON has all."""
    log.write_text("Time (s)," + ",".join(f"c{i:03d} (g)" for i in range(600)) + "\n" + ("0" + ",1" * 600 + "\n") * 2)
    _, out, _ = command("info", log)
    assert "c498 (g)" in out
    assert "c499 (g)" not in out.split("Findings")[0]
    assert "and 101 more channels; --json lists all" in out
    assert len(json.loads(command("info", log, "--json")[1])["groups"][0]["channels"]) == 601


@pytest.mark.parametrize(
    ("content", "code"),
    [(HEADER + ROWS, 0), (HEADER + ROWS + "0.2", 3), (HEADER + ROWS + "1,2,3\n", 1), ("", 1), (HEADER, 1)],
    ids=["in order", "last row cut", "ragged", "empty", "header only"],
)
def test_exit_codes_of_info(command, log, content, code):
    """0 in order, 3 with findings, 1 what would be refused or cannot be read; JSON in every case, no traceback."""
    log.write_text(content)
    found, out, err = command("info", log, "--json")
    assert (found, "Traceback" in err) == (code, False)
    assert bool(json.loads(out)["groups"]) is (len(content) > len(HEADER))


def test_simulated_logs_are_marked(command, log):
    """A person sees at once that a log is simulated."""
    log.write_text("# origin: simulated\n" + HEADER + ROWS)
    assert "SIMULATED" in command("info", log)[1]
    assert "simulated" in {f["code"] for f in json.loads(command("info", log, "--json")[1])["findings"]}


def test_names_cannot_steer_the_terminal(command, log):
    """Escape sequences in names and cells are shown, not obeyed."""
    log.write_text("Time (s),\x1b[2JAcc (g)\n" + ROWS + "9,\x1b]0;x\x07\n")
    _, out, _ = command("info", log)
    assert "\x1b" not in out
    assert "\\x1b[2JAcc" in out


def test_from_logs_to_a_campaign(command, log, tmp_path):
    """ingest, list, verify: stored once, listed with conditions, intact."""
    sheet = tmp_path / "runs.csv"
    sheet.write_text("file,origin,payload_kg,counter_masses,motion\nr001.csv,measured,5,counter_A0A=24.2626,x\n")
    campaign = tmp_path / "campaign"
    code, out, err = command("ingest", log, sheet, "--runs", sheet, "-o", campaign, "--json")
    assert (code, err) == (0, "")
    (run,) = json.loads(out)["runs"]
    assert list(run) == ["file", "source", "sha256", "origin", "status", "findings"]
    assert (run["file"], run["source"], run["origin"], run["status"]) == ("r001.h5", "r001.csv", "measured", "stored")
    code, out, _ = command("ingest", log, "--runs", sheet, "-o", campaign, "--json")
    assert (code, json.loads(out)["runs"][0]["status"]) == (3, "already_stored")
    (listed,) = json.loads(command("list", campaign, "--json")[1])["runs"]
    assert listed["conditions"] == {"payload_kg": 5.0, "counter_masses": {"counter_A0A": 24.2626}, "motion": "x"}
    assert "counter_A0A 24.2626" in command("list", campaign)[1]
    assert command("verify", campaign)[0] == 0
    run_file = campaign / "r001.h5"
    run_file.write_bytes(run_file.read_bytes()[:-1] + b"x")
    code, out, _ = command("verify", campaign, "--json")
    assert (code, json.loads(out)["files"][0]["status"]) == (1, "damaged")


def test_a_refused_log_does_not_keep_the_others_out(command, log, tmp_path):
    """The good ones are stored, the bad one named on stderr, exit 1; nothing is left of it."""
    bad = tmp_path / "bad.csv"
    bad.write_text(HEADER + ROWS + "1,2,3\n" + ROWS[:7])
    code, out, err = command("ingest", bad, log, "-o", tmp_path / "campaign", "--json")
    assert [run["status"] for run in json.loads(out)["runs"]] == ["refused", "stored"]
    assert code == 1
    assert "bad: refused for ragged_row" in err
    assert names_in(tmp_path / "campaign") == ["r001.h5", "r001.h5.sha256"]
    sheet = tmp_path / "runs.csv"
    sheet.write_text("file,run\nbad.csv,a\nr001.csv,a\n")
    _, out, err = command("ingest", bad, log, "--runs", sheet, "-o", tmp_path / "c")
    assert "refused for" not in out  # of the other log of the run: said once
    assert err.count("a: refused for ragged_row") == 1


def test_accepting_a_finding(command, log, tmp_path):
    """--accept stores what was refused, exit 3."""
    log.write_text(HEADER + ROWS + "1,2,3\n")
    assert command("ingest", log, "-o", tmp_path / "c")[0] == 1
    assert command("ingest", log, "-o", tmp_path / "c", "--accept", "ragged_row")[0] == 3


def test_formats_are_listed(command):
    """Every reader with its extensions."""
    code, out, _ = command("formats", "--json")
    assert code == 0
    assert {"CSV", "Cortex forces"} <= {f["name"] for f in json.loads(out)["formats"]}


@pytest.mark.parametrize("name", ["info", "formats", "ingest", "list", "verify"])
def test_help_carries_examples(command, name):
    """Each command's help shows how it is called."""
    code, out, _ = command(name, "--help")
    assert (code, f"testbench {name}" in out) == (0, True)


def test_reading_needs_no_mechanics():
    """Where Pinocchio cannot be installed, logs are still read, stored, listed and verified."""
    modules = ["ingestion", "quality.log_description", "store", "cli.ingest", "cli.logs", "cli.campaign", "rig"]
    code = "import sys; sys.modules['pinocchio'] = None; import " + ", ".join(f"testbench.{one}" for one in modules)
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["08_phyphox_linear_acc.csv", "10_double_pendulum_C1_154548.csv"])
def test_public_recordings_from_hdf5(command, tmp_path, name):
    """Their known values, after ingest."""
    assert command("ingest", reading.real(name), "-o", tmp_path / "c")[0] in (0, 3)
    run = open_run(tmp_path / "c" / f"{Path(name).stem}.h5")
    for channel, expected in reading.known(name).items():
        if "t_first" in expected:
            reading.assert_clock(run.channel(channel), expected)
        else:
            reading.assert_values(run.channel(channel), expected)


def test_of_many_findings_alike_the_first_are_shown_and_the_others_counted(capsys):
    """A log with 200 dead channels does not bury what else there is."""
    dead = [Finding("constant_channel", f"ch{i}", None, "dead") for i in range(200)]
    print_reading_findings("log.c3d", [("", one) for one in (*dead, Finding("time_gap", "time", None, "torn"))])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 1 + SHOWN_PER_KIND + 1
    assert "time_gap" in "".join(lines[1:])
    assert f"    and {200 - SHOWN_PER_KIND} more like these: --all lists them" in lines


def test_one_more_than_are_shown_is_shown(capsys):
    """A line that says one more would be as long as the one."""
    flat = [("", Finding("clipping", f"ch{i}", None, "flat")) for i in range(SHOWN_PER_KIND + 1)]
    print_reading_findings("log", flat)
    assert "more like these" not in capsys.readouterr().out


def test_what_several_logs_share_is_said_once(capsys):
    """Twelve logs of one logger have one dead channel, and one of them a gap besides."""
    logs = [f"run{i}.csv" for i in range(12)]
    shared = [(log, Finding("constant_channel", "b", None, "dead")) for log in logs]
    print_reading_findings("Findings", [*shared, (logs[5], Finding("time_gap", "t", "line 9", "torn"))])
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("constant_channel") == 1
    assert "run0.csv, run1.csv, run2.csv and 9 more: b: dead" in said
    assert "run5.csv: t, line 9: torn" in said


def test_a_log_is_named_once(capsys):
    """A finding that names its own log is printed with that name once."""
    said = {"runs.csv": "runs.csv: names no file", "a.csv": "a.csv, line 3: 8 cells", "b.csv": "in b.csv: torn"}
    print_reading_findings("Findings", [(log, Finding("not_stored", None, None, text)) for log, text in said.items()])
    out = capsys.readouterr().out
    for text in ("not_stored: runs.csv: names no file", "not_stored: a.csv: line 3: 8 cells", "b.csv: in b.csv: torn"):
        assert text in out
