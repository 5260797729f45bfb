"""A project of one's own machine: valid as written, and everything wrong in it said at once."""

import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

import balance.cli
import testbench.cli
from balance import datasets
from balance.mechanism.mjcf_parser import load_mechanism
from testbench.campaign_plan import load_plan
from testbench.errors import RigError
from testbench.ingestion.run_table import read_run_table
from testbench.project import new_project, project_problems
from testbench.rig import load_rig
from testbench.rig.sensors import Encoder

from ..commands import call


@pytest.mark.parametrize(("mechanism", "loggers"), [("five-bar", 2), ("scara-quill", 1), ("bennett", 2)])
def test_what_is_written_is_valid(tmp_path, mechanism, loggers):
    """Whatever the mechanism's joints: files that load, a motion that it can follow, a table of the planned runs."""
    folder = tmp_path / "test"
    files = new_project(folder, mechanism, loggers)
    assert sorted(path.name for path in folder.iterdir()) == sorted(files)
    assert [p for p in project_problems(folder) if "nothing can be compared" not in p.message] == []
    plan, rig = load_plan(folder / "plan.toml"), load_rig(folder / "rig.toml")
    assert {row.run for row in read_run_table(folder / "runs.csv")} == {run.name for run in plan.runs()}
    assert len(rig.loggers) == loggers
    down = load_mechanism(mechanism).gravity
    assert all(np.dot(place, down) > 0.0 for place in (rig.bench.centre, *(m.position for m in rig.bench.mounts)))
    assert {sensor.joint for sensor in rig.of_kind(Encoder).values()}


def quicker(folder):
    """Edit a project: one run a side, one axis, slow loggers."""
    edits = {"plan.toml": [("repeats = 2", "repeats = 1")],
             "rig.toml": [("{ x = \"AccX\", y = \"AccY\", z = \"AccZ\" }", "{ y = \"AccY\" }"),
                          ("2 kHz", "500 Hz"), ("1 kHz", "500 Hz")]}  # fmt: skip
    for name, changes in edits.items():
        text = (folder / name).read_text("utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text, "utf-8")


PAGE = Path(__file__).parents[2] / "docs" / "own-machine.md"
PROGRAMS = {"balance": balance.cli.main, "testbench": testbench.cli.main}


def test_the_page_runs_and_the_campaign_stands_alone(tmp_path, monkeypatch):
    """Every command of the page, at most ten, from a URDF to a verdict; then the campaign elsewhere, its sources gone.

    Of the numbers only that simulation and analysis of the same bench agree, and that nothing depends on the sources.
    """
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    lines = block.splitlines()
    assert len(lines) <= 10
    for line in lines:
        program, *words = shlex.split(line)
        names = [sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in words]
        done = call(PROGRAMS[program], program, *(word for some in names for word in some))
        assert done.code in (0, 3), f"{line}: {done.err}"
        assert done.out
        if "new" in words:
            quicker(Path("my-test"))
    assert "reduced by" in done.out.splitlines()[0]
    assert "<html" in Path("my-test/report.html").read_text("utf-8")[:200]

    said = call(testbench.cli.main, "testbench", "compare", "my-test/campaign", "--json").out
    Path("my-test/campaign").rename(tmp_path / "campaign")
    shutil.rmtree("my-test")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert call(testbench.cli.main, "testbench", "compare", tmp_path / "campaign", "--json").out == said
    rows = json.loads(said)["rows"]
    assert [row["simulated_percent"] for row in rows] == pytest.approx(
        [row["analyzed_percent"] for row in rows], abs=3.0
    )
    assert [row["published_percent"] for row in rows] == [None] * len(rows)


def test_a_machine_of_several_files(tmp_path):
    """What is written is one file, whatever the mechanism was made of."""
    text = (datasets.ROOT / "mechanisms" / "serial-1r.xml").read_text()
    head, body = text.split("<worldbody>")
    inner, tail = body.split("</worldbody>")
    (tmp_path / "arm.xml").write_text(f'{head}<include file="bodies.xml"/>{tail}')
    (tmp_path / "bodies.xml").write_text(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
    new_project(tmp_path / "test", str(tmp_path / "arm.xml"))
    assert "<include" not in (tmp_path / "test" / "arm.xml").read_text()


@pytest.mark.parametrize(
    ("limits", "ends"),
    [("-0.15 0", ["-20 mm", "0 mm"]), ("-0.007 0.3", ["20 mm", "0 mm"]), ("-1 1", ["20 mm", "-20 mm", "0 mm"])],
)
def test_the_guessed_motion_stays_within_the_limits(tmp_path, limits, ends):
    """A slide that may go one way alone goes that way; a motion beyond the file's limits is a problem to `check`."""
    (tmp_path / "slide.xml").write_text(
        '<mujoco><worldbody><body name="base"><body name="carriage"><joint name="S" type="slide" axis="1 0 0" '
        f'limited="true" range="{limits}"/><inertial pos="0 0 0" mass="2" diaginertia="1e-3 1e-3 1e-3"/></body></body>'
        '</worldbody><actuator><motor joint="S"/></actuator></mujoco>'
    )
    folder = tmp_path / "test"
    new_project(folder, str(tmp_path / "slide.xml"))
    assert tomllib.loads((folder / "motion.toml").read_text())["moves"][0]["to"] == ends
    said = {problem.message for problem in project_problems(folder)}
    (folder / "motion.toml").write_text((folder / "motion.toml").read_text().replace("20 mm", "2000 mm"))
    more = {problem.message for problem in project_problems(folder)} - said
    assert more
    assert all("Joint S goes from" in message and "beyond the file's limits" in message for message in more)


BROKEN = {
    "rig.toml": ('joint = "A"', 'joint = "Q"', "has no joint 'Q'"),
    "plan.toml": ('motion = "motion"', 'motion = "moton"', "moton"),
    "runs.csv": ("counter_A0A", "counter_A0Z", "counter_A0Z"),
    "motion.toml": ("15 deg", "15 kg", "kg"),
    "four-bar.xml": ("</worldbody>", "", "four-bar.xml"),
}


def _log_of_rig(path, rig, replaced=("", "")):
    """A log of the logger that its file is named for, with some text of its header replaced, and values of its own."""
    own = crc32(path.stem.encode()) % 1000
    names = ["Time (s)", *(f"{c.channel} ({c.unit})" for c in rig.columns(path.stem.partition("_")[2]))]
    rows = [f"{i / 1000}," + ",".join(f"{i * i + own}" for _ in names[1:]) for i in range(4)]
    path.write_text("\n".join([",".join(names).replace(*replaced), *rows, ""]))


def test_names_of_an_import_description_against_the_headers_of_the_logs(tmp_path):
    """One that no log has is said of each; one that some lack is none of their faults."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    logs = [tmp_path / line.split(",")[1] for line in (folder / "runs.csv").read_text().splitlines()[1:]]
    for log in logs:
        _log_of_rig(log, load_rig(folder / "rig.toml"), ("AccX", "X") if log is logs[0] else ("", ""))
    text = (folder / "rig.toml").read_text()
    (folder / "rig.toml").write_text(text.replace("[loggers.daq]", '[loggers.daq]\nread_as = "daq.toml"'))
    for name, count in (("X (g)", 0), ("Z (g)", len(logs))):
        (folder / "daq.toml").write_text(f'[channels]\n"{name}" = "AccX (g)"\n')
        found = [p.file for p in project_problems(folder, logs) if "channels." in p.message]
        assert found == [log.name for log in logs if "daq" in log.name][:count]


@pytest.mark.parametrize(
    ("replaced", "said"),
    [
        (("AccX", "Acc_X"), ("rig.toml", r"r001, .*: AccX: the rig .*\(logger daq\); the log holds Time, Acc_X,"
                                r".*did you mean 'Acc_X'\?")),
        (("(g)", "(N)"), ("rig.toml", r"r001, .*: AccX \(N\): sensors\.base_acc: unit 'g' in the rig, 'N'")),
        (("Acc", "Beschl"), ("rig.toml", r"r001, .*: nothing is recorded of sensors base_acc \(logger daq\)")),
        (("Time (s)", "t0"), ("rig.toml", r"r001, .*: loggers\.daq: no column of t0, .* is known as time, .*read_as")),
        (("AccX (g)", "x,y,z"), ("r001_daq.csv", "line 1 has")),
        (("(g)", "[g]"), None),
    ],
)  # fmt: skip
def test_the_rigs_channels_against_the_headers_of_the_logs(tmp_path, replaced, said):
    """A channel that no log has is said once for all runs, and the rig may call channels with the unit or without."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    rig = load_rig(folder / "rig.toml")
    logs = [tmp_path / line.split(",")[1] for line in (folder / "runs.csv").read_text().splitlines()[1:]]
    for log in logs:
        _log_of_rig(log, rig, replaced)
    if said is None:
        (folder / "rig.toml").write_text((folder / "rig.toml").read_text().replace('"AccX"', '"AccX [g]"'))
    problems = [p for p in project_problems(folder, logs) if p not in project_problems(folder)]
    if said is None:
        assert problems == []
    else:
        found = [p for p in problems if p.file == said[0]]
        assert re.match(said[1], found[0].message), problems
        assert len(found) == 1 or replaced[1] in {"(N)", "t0"}


@pytest.mark.parametrize(
    ("second", "file", "said"),
    [
        (
            ("r002,measured", "r001,measured"),
            "runs.csv",
            "r001: r001_daq.csv and r002_daq.csv both hold AccX, .* of logger",
        ),
        (
            ("r002,measured,0", "r001,measured,1"),
            "runs.csv",
            "line 3: run 'r001' has other conditions in line 2: is the",
        ),
    ],
)
def test_a_name_used_twice_is_said_by_check_as_by_ingest(tmp_path, monkeypatch, second, file, said):
    """Two logs of one logger for one run; rows of one run with other conditions: refused in the same words."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar", loggers=1)
    monkeypatch.chdir(folder)
    logs = ["r001_daq.csv", "r002_daq.csv"]
    for log in logs:
        _log_of_rig(folder / log, load_rig(folder / "rig.toml"))
    rows = ["file,run,origin,repeat", "r001_daq.csv,r001,measured,0", "r002_daq.csv,r002,measured,0"]
    Path("runs.csv").write_text("\n".join(rows))
    assert [p for p in project_problems(Path()) if p.file == "runs.csv" and not p.is_note] == []
    Path("runs.csv").write_text("\n".join(rows).replace(*second))
    for given in ((), tuple(map(Path, logs))):
        assert any(p.file == file and re.match(said, p.message) for p in project_problems(Path(), given))
    done = call(
        testbench.cli.main, "testbench", "ingest", *logs, "--rig", "rig.toml", "--runs", "runs.csv", "-o", "campaign"
    )
    assert done.code == 1
    assert re.search(said.partition(": ")[2], " ".join((done.out + done.err).split()))


def test_logs_and_run_table_against_each_other(tmp_path):
    """A row that is not understood hides no other problem; names that differ by a letter are put together."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    lines = (folder / "runs.csv").read_text().splitlines()
    logs = [tmp_path / line.split(",")[1] for line in lines[1:]]
    for log in logs:
        _log_of_rig(log, load_rig(folder / "rig.toml"))
    assert project_problems(folder, logs) == project_problems(folder)
    (tmp_path / "r009_daq.csv").write_text(logs[0].read_text())
    extra = project_problems(folder, [*logs, tmp_path / "r009_daq.csv"])
    assert [one.message for one in extra if "r009" in one.message] == [
        "no line names r009_daq.csv: add one, or leave that log out"
    ]
    own = logs[2].read_bytes()
    logs[2].write_bytes(logs[0].read_bytes())
    assert [one.message for one in project_problems(folder, logs)] == [
        f"{logs[0].name} and {logs[2].name} are one recording (byte for byte): bring the missing log of one of them"
    ]
    assert not any("one recording" in one.message for one in project_problems(folder, [logs[0], logs[0]]))
    logs[2].write_bytes(own)
    lines[1] = lines[1].replace("r001_daq", "r001_dag")
    lines[2] = lines[2].replace("counter_A0A", "counter_A0Z")
    lines[3] = lines[3].replace("measured", "gemessen")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    said = " | ".join(problem.message for problem in project_problems(folder, logs))
    for expected in (
        "line 2: names r001_dag.csv, which is not among the logs; did you mean 'r001_daq.csv'?",
        "no site 'counter_A0Z'",
        "line 4: origin: 'gemessen'",
    ):
        assert expected in said
    (folder / "runs.csv").write_text("\n".join(lines).replace("origin", "orijin"))
    found = [problem.message for problem in project_problems(folder, logs) if not problem.is_note]
    assert found == ["unknown column 'orijin'; did you mean 'origin'?"]


def test_names_of_an_own_logger_are_said_before_the_run_table_is_whole(tmp_path):
    """Logs of a logger that the rig knows by none of its names, and that no row names: one round, three problems."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    lines = (folder / "runs.csv").read_text().splitlines()
    logs = [tmp_path / line.split(",")[1] for line in lines[1:]]
    for log in logs:
        _log_of_rig(log, load_rig(folder / "rig.toml"))
    for log in logs:
        if "controller" in log.name:
            log.write_text(log.read_text().replace("q_", "angle ").replace("tau_", "load "))
            log.rename(tmp_path / log.name.replace("controller", "plc"))
    logs = sorted(tmp_path.glob("r*.csv"))
    rows, unnamed, names = [problem for problem in project_problems(folder, logs) if not problem.is_note]
    assert re.match(r"line 3: names r001_controller.csv, .* \(as lines 5, 7, 9\)", rows.message)
    assert re.match(r"no line names r001_plc.csv, .*r004_plc.csv: add a line for each", unnamed.message)
    assert names.file == "rig.toml"
    for said in ("(logger controller)", "'q_A0', 'tau_A0'", "r001_plc.csv holds", "'angle A0'", "sensors.NAME.channel"):
        assert said in names.message


@pytest.mark.parametrize("file", BROKEN)
def test_what_is_wrong_is_said(tmp_path, file):
    """Each file by name, with what is wrong in it; nothing stops at the first."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    old, new, said = BROKEN[file]
    text = (folder / file).read_text()
    joint = load_rig(folder / "rig.toml").of_kind(Encoder).popitem()[1].joint
    old = old.replace('"A"', f'"{joint}"')
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    problems = project_problems(folder)
    assert any(said in problem.message for problem in problems), problems


REFUSED = {
    "a peak of another kind": ("plan.toml", 'motion = "motion"', 'motion = "motion"\npeak_acceleration = "3 g0"',
                               ("plan.toml", r"r001: motion 'motion': moves joints that turn: expected a peak")),
    "a peak that nothing states": ("motion.toml", "\npeak_acceleration", "\n# peak_acceleration",
                                   ("plan.toml", r"r001: motion 'motion': motion\.toml: peak_acceleration: missing: ")),
    "a mass that nothing has": ("runs.csv", ";counter_B0B", "e300;counter_B0B",
                                ("runs.csv", r"line 2: counter_masses: .*e\+300 kg: .* below 1e\+09 kg")),
    "a rate that nothing has": ("rig.toml", 'rate = "2 kHz"', 'rate = "1e12 Hz"',
                                ("plan.toml", r"r001: motion 'motion': 2e\+12 Hz .*: expected fewer than")),
    "a motion that is not there": ("runs.csv", ",motion,1", ",swing,1",
                                   ("swing.toml", "not there: its runs are analysed, and not .* write sw", "a note")),
    "a motion that plan.toml names": ("motion.toml", None, None, ("motion.toml", "not there: its runs", "a note")),
    "a peak in the run table": ("runs.csv", ",repeat", ",peak_acceleration_g",
                                ("runs.csv", "line 2: motion 'motion': moves joints that turn: expected", "a note")),
    "a joint with a motor": ("rig.toml", "[bench] ",
                             '[bench.joints.A0]\nstiffness = "1 MN/m"\ndamping = "0 N s/m"\n[bench] ',
                             ("rig.toml", r"bench\.joints: .* there are A, B0.*drives\.A0\.transmission")),
    "a pin too fast": ("rig.toml", "[bench] ",
                       '[bench.joints.A]\nstiffness = "9 GN/m"\ndamping = "0 N s/m"\nclearance = "1 um"\n[bench] ',
                       ("rig.toml", r"bench\.joints\.A: with clearance its pin bounces at \d+ Hz")),
    "no plan": ("plan.toml", None, None, ("plan.toml", "not there: `testbench new` writes one", "a note")),
    "two keys": ("rig.toml", 'kind = "encoder"', 'kind = "coder"',
                 ("rig.toml", r"sensors\.encoder_\w+\.kind: [^\n]*$")),
    "a cell": ("runs.csv", "measured", "gemessen", ("runs.csv", "line 2: origin: 'gemessen'")),
    "no run table": ("runs.csv", None, None, ("runs.csv", "not there: `testbench new` writes one")),
    "a folder for it": ("runs.csv", None, "", ("runs.csv", "is a folder: expected a file")),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_simulator_refuses_is_said(tmp_path, case):
    """Each row begins with what is wrong, its file beside it; a motion is named once."""
    file, old, new, (named, said, *note) = REFUSED[case]
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    if old is None:
        (folder / file).unlink()
        if new is not None:
            (folder / file).mkdir()
    else:
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new))
    problems = project_problems(folder)
    found = [problem for problem in problems if problem.file == named]
    assert found, problems
    assert re.match(said, found[0].message), problems
    assert found[0].is_note is bool(note)  # what logs are ingested without
    assert len({(p.file, p.message) for p in problems}) == len(problems)


def test_motions_that_are_not_there_are_said_once_each(tmp_path):
    """Each with a file of the folder whose name is near; the shipped ones are listed with the first alone."""
    folder = tmp_path / "test"
    new_project(folder, "four-bar")
    lines = (folder / "runs.csv").read_text().splitlines()
    kinds = [
        line.replace(",motion,", f",{name},") for line, name in zip(lines[1:], ("motoin", "swing") * 9, strict=False)
    ]
    (folder / "runs.csv").write_text("\n".join([lines[0], *kinds]) + "\n")
    said = {p.file: p.message for p in project_problems(folder) if "not there: its runs" in p.message}
    assert set(said) == {"motoin.toml", "swing.toml"}
    assert [p.message.count("triangle") for p in project_problems(folder)].count(1) == 1
    assert said["motoin.toml"].endswith("; did you mean 'motion'?")
    assert "did you mean" not in said["swing.toml"]


def test_quick_motions_are_followed_at_the_rate_of_the_simulator(tmp_path):
    """What ``simulate`` makes is no problem, though 1 kHz would be too slow for it."""
    new_project(tmp_path / "test", "four-bar")
    path = tmp_path / "test" / "motion.toml"
    path.write_text(path.read_text().replace("15 deg", "1 deg").replace("60 rad/s^2", "2000 rad/s^2"))
    assert project_problems(tmp_path / "test") == []


def test_a_peak_that_each_run_states(tmp_path):
    """The motion's file needs none then."""
    new_project(tmp_path / "test", "four-bar")
    for file, old, new in (
        ("motion.toml", "\npeak_acceleration", "\n# peak_acceleration"),
        ("plan.toml", 'motion = "motion"', 'motion = "motion"\npeak_acceleration = "60 rad/s^2"'),
        ("runs.csv", ",repeat", ",repeat,peak_acceleration_rad_s2"),
        ("runs.csv", "motion,1", "motion,1,60"),
        ("runs.csv", "motion,2", "motion,2,60"),
    ):
        path = tmp_path / "test" / file
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))
    assert project_problems(tmp_path / "test") == []


def test_a_folder_in_use(tmp_path):
    """Nothing is overwritten; and what is not there is said with what to do."""
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(RigError, match="not empty; name a new folder"):
        new_project(tmp_path, "four-bar")
    with pytest.raises(RigError, match="testbench new"):
        project_problems(tmp_path / "nowhere")
