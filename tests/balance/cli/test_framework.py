"""Both commands at the face: exit codes, one message each, no traceback ever, quick help."""

import io
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from balance.cli.printing import FirstLine, emit_parts, words

from .. import models

OPEN_RING = models.load("four-bar").text.replace('site name="B_B0B" pos="0.2 0 0"', 'site name="B_B0B" pos="9 0 0"')
FILES = {
    "open.xml": OPEN_RING,
    "flat.xml": models.four_bar(0.3, 0.2, 0.3, 0.2, 1.0).split("<keyframe>")[0] + "</mujoco>",
    "afloat.xml": models.mjcf(models.link("", "a") + models.link("", "b", "<freejoint/>")),
    "broken.xml": "<mujoco><worldbody>",
    "arm.urdf": "<robot/>",
    "motion.toml": 'start = ["0 m", "9 m"]\npeak_acceleration = "1 g0"\nmoves = [ { axis = "x", to = ["1 mm"] } ]\n',
    "samples.toml": 'samples = "."\n',
    "sampled.toml": 'samples = "path.csv"\n',
    "path.csv": "time (s),x (m),y (m)\n" + "".join(f"{i},0,0\n" for i in range(6)),
    "typo.toml": 'drven = "platform"\n',
    "plates.csv": "name,mass,quantity\nM1,5,2\n",
    "joints.toml": 'driven = "joints"\njoints = ["A9"]\nstart = ["1 rad"]\npeak_acceleration = "1 rad/s^2"\n'
                   'moves = [ { joint = "A9", to = ["1 rad"] } ]\n',
}  # fmt: skip
MECH, X = "parallelogram-6bar", ("--motion", "x")

REFUSED = {
    "a folder for a mechanism": (("conditions", "."), "is a folder; expected a file"),
    "a folder for samples": (("simulate", MECH, "--motion", "samples.toml"), "is a folder; expected a file"),
    "a speed beyond all numbers": (
        ("rotor", "correct", "three-masses", "--bearing=-100mm", "--bearing=900mm", "--speed", "1e200rpm", "--json"),
        "a result is no finite number",
    ),
    "unknown mechanism": (("conditions", "six-bar"), "six-bar: no such file"),
    "unknown body": (("size", MECH, "-p", "crate=1kg"), "no body or site 'crate'"),
    "payload of an unknown mechanism": (("size", "six-bar", "-p", "2kg"), "six-bar: no such file"),
    "unknown site": (("check", MECH, "-c", "nowhere=1kg"), "no site 'nowhere'"),
    "unknown site to size": (("size", MECH, "--site", "nowhere"), "no site 'nowhere'"),
    "site that is limited in vain": (("size", MECH, "--limit", "C_AC=1kg"), "C_AC"),
    "impossible payload": (("conditions", MECH, "-p", "platform=-5kg"), "expected a positive mass"),
    "no payload": (("conditions", MECH, "-p", "platform=0kg"), "expected a positive mass"),
    "negative counter-mass": (("check", MECH, "-c", "counter_A0A=-1kg"), "expected zero or a positive mass"),
    "does not close": (("conditions", "open.xml"), "cannot be closed from 'home': the loops (B)"),
    "singular start": (("conditions", "flat.xml"), "singular at 'zero configuration'"),
    "a body afloat": (("conditions", "afloat.xml"), "body 'b' floats"),
    "broken file": (("size", "broken.xml"), "XML parse error"),
    "broken urdf": (("size", "arm.urdf"), "arm.urdf"),
    "out of reach": (("simulate", MECH, "--motion", "motion.toml"), "cannot be closed at platform.x = 0"),
    "typo in a motion": (("simulate", MECH, "--motion", "typo.toml"), "typo.toml: drven: unknown key; did you mean"),
    "joint of a motion": (("simulate", MECH, "--motion", "joints.toml"), "no joint 'A9'"),
    "unknown motion": (("simulate", MECH, "--motion", "spiral"), "spiral: no such file"),
    "motion without its ending": (("simulate", MECH, "--motion", "typo"), "did you mean 'typo.toml'?"),
    "motion of a chain": (("simulate", "serial-3r", *X), "serial-3r"),
    "too fast": (("simulate", MECH, *X, "--rate", "1e15 Hz"), "expected fewer than"),
    "rate of samples": (("simulate", MECH, "--motion", "sampled.toml", "--rate", "1 kHz"), "1000 Hz is not that of"),
    "rate of samples in a sweep": (
        ("sweep", MECH, "--vary", "counter_A0A.mass=1kg", "--motion", "sampled.toml", "--rate", "1kHz"),
        "sampled.toml: a rate of 1000 Hz is not that of its",
    ),
    "no stock": (("size", MECH, "--stock", "shelf"), "shelf: no such file"),
    "body for a site": (("size", MECH, "--site", "A0A"), "D_platform; that body has counter_A0A"),
    "wrong stock": (("size", MECH, "--stock", "plates.csv"), "column 'mass': is not expected; did you mean 'mass_kg'"),
    "no sites": (("size", "serial-1r", "--site", "tip", "--limit", "nowhere=1kg"), "nowhere"),
    "folder that is not there": (("simulate", MECH, *X, "--rate", "500 Hz", "--csv", "no/such/run.csv"), "run.csv"),
    "parquet into nowhere": (("simulate", MECH, *X, "--rate", "500 Hz", "--parquet", "no/such/run.pq"), "run.pq"),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with files that cannot be used."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", REFUSED)
def test_refused_is_one_message_and_exit_1(balance, folder, case):
    """Something read cannot be used: one line on stderr that names it, the same in JSON if asked, nothing written."""
    arguments, message = REFUSED[case]
    before = sorted(folder.rglob("*"))
    for extra in ((), ("--json",)):
        code, out, err = balance(*arguments, *extra)
        assert code == 1
        assert message in err
        assert (
            (json.loads(out)["error"]["message"] in err.removeprefix("balance: "))
            if "--json" in (*arguments, *extra)
            else out == ""
        )
        assert len(err.splitlines()) == 1
        assert "Traceback" not in err
    assert sorted(folder.rglob("*")) == before


WRONG = {
    "size parallelogram-6bar -p platform": "expected BODY=5kg",
    "size parallelogram-6bar -p 2kg": "'2kg': expected BODY=5kg; did you mean platform=2kg?",
    "size -p 2kg four-bar": "'2kg': expected BODY=5kg; bodies are A0A, AB, B0B",
    "size four-bar --limit 2kg": "'2kg': expected SITE=5kg; sites are counter_A0A, counter_B0B",
    "size parallelogram-6bar -p platform=5": "platform: '5' has no unit",
    "size parallelogram-6bar -p 'platform=5 m'": "platform: 'm' is not a unit of mass",
    "check parallelogram-6bar -c 'counter_A0A=5 stones9'": "not a known unit",
    "check parallelogram-6bar -c 'counter_A0A=1 kg^9^9^9^9'": "not a known unit",
    "check parallelogram-6bar -c tip=5kg -p platform=5kg -p platform=6kg": "'platform' twice",
    "conditions": "Missing argument",
    "conditions parallelogram-6bar --colour red": "No such option",
    "balence": "No such command 'balence'",
    "sise": "did you mean 'size'",
    "conditions parallelogram-6bar --momentum spin": "spin",
    "sweep four-bar --quantity forse": "'forse': expected force, moment, torque; did you mean 'force'?",
    "simulate parallelogram-6bar": "--motion",
    "methods serial-1r --stroke 5": "'5' has no unit",
    "methods serial-1r --stroke -1mm": "--stroke",
    "methods serial-1r --turn 5mm": "--turn",
    "methods serial-1r --wheel-ratio nan": "--wheel-ratio: expected a number",
    "methods parallelogram-6bar": "no shipped motion has the name of parallelogram-6bar: give one with --motion",
    "static four-bar --reach 0mm": "--reach",
    "static four-bar --height -3mm": "--height",
    "static parallelogram-6bar --springs parallelogram-6bar --reach 1mm": "--reach",
    "drive inverted-slider-crank --flywheel-for none": "expected a share above zero",
    "drive inverted-slider-crank --start-up 0": "--start-up",
    "drive inverted-slider-crank --speed 0rpm": "more than zero",
    "drive inverted-slider-crank --speed 828": "'828' has no unit",
    "engine single in-line-4 --speed 100rpm": "in-line 4 is a layout without sizes",
    "engine single single --radius 1m --mass 1kg": "either --radius or --mass",
    "engine single single --fraction nan": "--fraction",
    "engine free in-line-4 --speed 100rpm": "--speed: in-line 4 has no sizes",
    "engine free v4-72-offset --ratio 0.3": "has sizes, r / l = ",
    "linkage two-levels --speed 0rpm": "--speed: expected a number other than zero",
    "linkage two-levels --speed 50": "'50' has no unit",
    "linkage two-levels --variation nan": "--variation",
    "linkage two-levels --variation 0": "--variation",
    "linkage two-levels --built m4*": "expected SYMBOL=VALUE",
    "linkage two-levels --built z3=40:0": "expected teeth as two whole numbers",
    "rotor tolerance --grade fine --mass 1kg --speed 3000rpm": "expected a grade such as G6.3",
    "rotor tolerance --grade G1 --mass 1kg --speed 50Hz": "may count turns or radians",
    "rotor tolerance --grade G1 --mass 1kg": "needs --mass and --speed",
    "rotor tolerance --grade G6.3 --mass 40kg --speed 3000rpm --residual -5gmm": "--residual: expected zero or more",
    "rotor split '30 g' --holes 4": "has no angle",
    "rotor split '30 g mm @ 0 deg' --holes 4": "give the radius of the holes",
    "rotor split '30 g @ 0 deg'": "where are the holes?",
    "rotor split '30 g @ 0 deg' --holes 4 --taken 5": "there are holes 1 to 4",
    "rotor split '30 g @ 0 deg' --holes 0": "--holes",
    "rotor split '30 g @ 0 deg' --holes 4 --weight 5g --within -3": "--within",
    "rotor split '30 g @ 0 deg' --holes 4 --within 2%": "--within is for stock weights",
    "rotor split '30 g @ 0 deg' --holes 4 --in-hole 2": "--in-hole is for stock weights",
    "rotor split '30 g @ 0 deg' --angle 0deg --angle 360deg --angle 90deg": "give each angle once",
    "rotor trial --mass 1kg --radius 10mm": "needs --speed",
    "rotor correct three-masses --plane left": "expected NAME=0mm",
    "rotor correct three-masses --bearing 0mm": "give two, in two places",
    "rotor correct three-masses --bearing 0mm --bearing '0 m'": "give two, in two places",
}


@pytest.mark.parametrize(("line", "message"), WRONG.items(), ids=WRONG)
def test_a_wrong_command_line_is_exit_2(balance, line, message):
    """The command line itself is wrong: usage and the reason, nothing on stdout; nothing that was typed is ignored."""
    code, out, err = balance(*shlex.split(line))
    assert code == 2
    assert json.loads(out)["error"]["exit_code"] == 2 if "--json" in line else out == ""
    assert message in " ".join(err.split())
    assert "Traceback" not in err


@pytest.mark.parametrize("command", ["conditions", "size", "check", "simulate"])
def test_help_has_examples(balance, command):
    """Help of each command shows how it is called."""
    code, out, _ = balance(command, "--help")
    assert code == 0
    assert f"balance {command} " in out.split("Examples:")[1]


def test_a_closed_pipe_is_no_error():
    """``balance conditions ... | head -1`` ends quietly."""
    command = f"{sys.executable} -c 'from balance.cli import main; main()' conditions parallelogram-6bar-full --json"
    shown = subprocess.run(f"{command} | head -1", shell=True, capture_output=True, text=True, check=False)
    assert shown.stdout.strip() == "{"
    assert shown.stderr == ""


def test_linear_algebra_keeps_to_one_thread(balance, monkeypatch):
    """Unless the environment asks for more."""
    for given, expected in (({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")):
        monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
        for name, value in given.items():
            monkeypatch.setenv(name, value)
        balance("--version")
        assert os.environ["OPENBLAS_NUM_THREADS"] == expected


def test_modules_import_without_pinocchio():
    """Only reading a mechanism needs Pinocchio."""
    modules = "balance.balancing.closed_forms, balance.cli, balance.units, balance.balancing.conditions"
    code = f"import sys; sys.modules['pinocchio'] = None; import {modules}"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_numbers_of_the_json_are_finite(balance):
    """One document that any JSON reader takes: no NaN, no Infinity."""
    out = balance("size", "serial-3r", "--json").out
    json.loads(out, parse_constant=lambda text: pytest.fail(f"{text} in the JSON"))


VERDICTS = (
    "conditions parallelogram-6bar -p platform=5kg",
    "check four-bar -c counter_A0A=1kg",
    "assemble five-bar",
    "size four-bar --stock kiper2019",
    "simulate four-bar --motion four-bar --rate 1kHz",
)


@pytest.mark.parametrize("line", VERDICTS)
def test_the_answer_comes_first(balance, line):
    """-q prints one sentence with a number."""
    (answer,) = balance(*line.split(), "-q").out.splitlines()
    assert re.search(r"\d.*\.$", answer)


def test_an_empty_line_is_no_answer():
    """-q passes on the first line that says something, in whatever pieces it is written."""
    said = io.StringIO()
    first = FirstLine(said)
    for text in ("\n", "", "\nLogs: 2", " stored\nr001\n", "r002\n"):
        first.write(text)
    assert said.getvalue() == "Logs: 2 stored\n"


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self):
        """It is."""
        return True


@pytest.mark.parametrize("value", ["", "1"])
def test_no_color(balance, monkeypatch, value):
    """On a terminal titles are bold, and plain where NO_COLOR has a value (no-color.org)."""
    monkeypatch.setattr("io.StringIO", Terminal)
    monkeypatch.setenv("NO_COLOR", value)
    assert ("\x1b[" in balance("check", "four-bar", "-c", "counter_A0A=1kg").out) is (value == "")


def test_all_prints_parts_of_the_document(capsys):
    """Under their keys: results in rows, or in columns where they have more values; texts below, long lists not."""
    document = {
        "mass_kg": 2.0,
        "of": None,
        "long": "word " * 20,
        "runs": [{"F_N": 1.0}, {"F_N": 2.5, "at": [1, 2], "trials": [{"n": 3}]}],
        "stages": {"time_s": [0.0] * 99, "a": {"M_Nm": {"x": 1.0}, "series": [0.0] * 99}},
        "none": [],
    }
    emit_parts(document, ("", "runs", "runs.trials", "stages", "none", "nowhere"))
    lines = [line.split() for line in click.unstyle(capsys.readouterr().out).splitlines() if "─" not in line]
    assert lines[:5] == [[], ["Further"], ["value"], ["mass", "[kg]", "2"], ["of", "-"]]
    assert lines[5][:2] == ["long:", "word"]
    assert lines[6:9] == [[], ["Runs"], ["1", "2"]]
    assert lines[9:12] == [["F", "[N]", "1", "2.5"], ["at", "-", "1,", "2"], ["trial", "1", "n", "-", "3"]]
    assert lines[12:16] == [[], ["Runs,", "trials"], ["n"], ["1", "3"]]
    assert lines[16:] == [[], ["Stages"], ["M", "[N", "m]", "x"], ["a", "1"]]


@pytest.mark.parametrize(
    ("key", "heading"),
    [
        ("is_crankshaft", "crankshaft"), ("rms_before_N", "RMS before [N]"), ("at_a", "at [a]"),
        ("dof", "degrees of freedom"),
        ("largest_moment_mrw2a", "largest moment [m r omega^2 a]"), ("mcx[rod_1a]", "mcx[rod_1a]"),
    ],
)  # fmt: skip
def test_headings_are_words(key, heading):
    """Of keys; names in brackets stay."""
    assert words(key) == heading


def test_all_shows_rounding_as_zero_and_names_as_they_are(capsys):
    """Beside others of its unit, anywhere in the document; names of joints and planes keep what is in them."""
    document = {
        "before": {"F_N": 100.0, "share": 1e-13, "condition": 1e9},
        "found": {"start_s": 1773479520.1, "age_s": 2.0},
        "after": {"rms": {"torque_Nm": {"arm_left": 2e-30}, "F_N": -9e-11, "share": 1e-11}},
        "planes": [{"weights": {"left_end": {"x_m": 1.0, "far": True}, "right_end": {"x_m": 2.0, "far": False}}}],
    }
    emit_parts(document, ("before", "found", "after.rms", "planes"))
    rows = [line.rsplit(maxsplit=1) for line in click.unstyle(capsys.readouterr().out).splitlines()]
    shown = {name.strip(): value for name, value in filter(lambda row: len(row) == 2, rows)}
    expected = {"F [N]": "0", "torque [N m] arm_left": "2e-30", "share": "1e-11"}
    expected |= {"start [s]": "1773479520.100", "age [s]": "2"}
    expected |= {"weights left_end x [m]": "1", "weights left_end far": "yes", "weights right_end far": "no"}
    assert shown.items() >= expected.items()


def test_what_is_no_number_hides_no_other(capsys):
    """Infinite and undefined values are shown as such, and set no scale for others."""
    emit_parts({"a": {"F_N": float("inf"), "G_N": 2.0, "H_N": float("nan"), "I_N": 1e-13, "k": float("nan")}}, ("a",))
    rows = [line.split() for line in click.unstyle(capsys.readouterr().out).splitlines()]
    assert [row[-1] for row in rows if row and row[0] in "FGHIk"] == ["inf", "2", "nan", "0", "nan"]
