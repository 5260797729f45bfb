import zipfile
from pathlib import Path

import openpyxl
import pytest

from testbench.errors import RigError
from testbench.ingestion.planned_runs import plan_runs
from testbench.ingestion.run_table import read_run_table, write_run_table

HEAD = "file,origin,payload_kg,counter_masses,motion,peak_acceleration_g,repeat\n"


@pytest.fixture
def run_table(tmp_path):
    """Write a run table and log files beside it."""

    def write(rows, *logs, head=HEAD):
        for name in logs:
            (tmp_path / name).write_text("t,a\n")
        path = tmp_path / "runs.csv"
        path.write_text(head + rows, encoding="utf-8-sig")
        return path, [tmp_path / name for name in logs]

    return write


def test_conditions_are_read_as_written(run_table):
    """Payload, masses by site, motion, acceleration and repeat; what is empty is absent, no masses are none."""
    path, _ = run_table("a.csv,simulated,5,counter_A0A=24.2626;counter_B0B=1,x,3,1\nb.csv,,,,y,,\n")
    first, second = read_run_table(path)
    assert first.conditions == {
        "payload_kg": 5.0, "counter_masses": {"counter_A0A": 24.2626, "counter_B0B": 1.0}, "motion": "x",
        "peak_acceleration_g": 3.0, "repeat": 1,
    }  # fmt: skip
    assert (first.origin, second.origin) == ("simulated", "unstated")
    assert second.conditions == {"counter_masses": {}, "motion": "y"}


def test_one_file_is_one_run_unless_the_sheet_says_otherwise(run_table):
    """Files of one `run` are together; without that column each is its own."""
    path, logs = run_table("a.csv,r1\nb.csv,r1\nc.csv,\n", "a.csv", "b.csv", "c.csv", head="file,run\n")
    assert [(r.name, [p.name for p in r.files]) for r in plan_runs(logs, path)] == [
        ("r1", ["a.csv", "b.csv"]),
        ("c", ["c.csv"]),
    ]
    assert [r.name for r in plan_runs(logs, None)] == ["a", "b", "c"]


def test_the_sheet_among_the_logs_is_not_a_log(run_table):
    """`ingest folder/*.csv --runs folder/runs.csv` does not ingest the run table."""
    path, logs = run_table("a.csv,,,,,,\n", "a.csv")
    assert [r.name for r in plan_runs([*logs, path], path)] == ["a"]


def test_files_of_one_name_are_told_apart_by_their_folder(tmp_path):
    """A row means the file at its place beside the run table."""
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "log.csv").write_text("t,a\n")
    path = tmp_path / "runs.csv"
    path.write_text("file,run,motion\nx/log.csv,rx,x\ny/log.csv,ry,y\n")
    runs = plan_runs([tmp_path / "y" / "log.csv", tmp_path / "x" / "log.csv"], path)
    assert [(r.name, r.files[0].parent.name, r.conditions) for r in runs] == [
        ("rx", "x", {"motion": "x"}), ("ry", "y", {"motion": "y"}),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("", r"names no file"),
        ("a.csv,,,,,,\na.csv,,,,,,\n", r"names a.csv a second time"),
        ("a.csv,guessed,,,,,\n", r"line 2: origin: 'guessed': expected 'measured', 'simulated' or 'unstated'"),
        ("a.csv,,five,,,,\n", r"line 2: payload_kg: 'five': expected a number"),
        ("a.csv,,-1,,,,\n", r"payload_kg: '-1': expected zero or more"),
        ('a.csv,,"1,5",,,,\n', r"payload_kg: '1,5': expected a number"),
        ("a.csv,,1_4,,,,\n", r"payload_kg: '1_4': expected a number"),
        ("a.csv,,,,,,1_4\n", r"repeat: '1_4': expected a number"),
        ("a.csv,,nan,,,,\n", r"payload_kg: 'nan': expected a number"),
        ("a.csv,,,A0A:24,,,\n", r"counter_masses: 'A0A:24': expected SITE=KG;SITE=KG"),
        ("a.csv,,,A=2 B=0.5,,,\n", r"counter_masses: 'A=2 B=0.5': expected SITE=KG;SITE=KG"),
        ("a.csv,,,A=1;A=2,,,\n", r"name the site 'A' twice"),
        ("a.csv,,,A=1 m,,,\nb.csv,,x,,,,\n", r"line 2: counter_masses: 'A=1 m'.* a number in kg\n.*line 3: payload_kg"),
        ("a.csv,,,,,,1.5\n", r"repeat: '1.5': expected a whole number"),
        ("a.csv,,,\n", r"line 2: 4 cells: expected 7, one for each column"),
        ("a\0.csv,,,,,,\n", r"line 2: holds a NUL character"),
        (",,,,,,1\n", r"line 2: file: missing: expected name of the log file, or columns file_NAME"),
    ],
)
def test_a_wrong_sheet_is_refused_by_line_and_column(run_table, rows, message):
    """One message that says where, what was found and what was expected."""
    path, logs = run_table(rows, "a.csv")
    with pytest.raises(RigError, match=message):
        plan_runs(logs, path)


def test_rows_without_logs_and_logs_without_rows(run_table):
    """In the middle of a campaign the complete runs are stored; every other log is named, and what it needs."""
    rows = "a.csv,r1,,,,,\nb.csv,r2,,,,,\nc.csv,r2,,,,,\nd.csv,r3,,,,,\n"
    path, logs = run_table(
        rows, "a.csv", "b.csv", "e.csv", head="file,run,origin,payload_kg,counter_masses,motion,repeat\n"
    )
    planned = {run.name: run for run in plan_runs(logs, path)}
    assert [name for name, run in planned.items() if not run.problem] == ["r1"]
    assert planned["r2"].problem == "waits for c.csv, of the same run 'r2'"
    assert (planned["r3"].files, planned["r3"].missing) == ((), ("d.csv",))
    assert "runs.csv does not name it: add a row" in planned["e"].problem
    for head in ("run,file,motion\n", '"run";"file_daq";"motion"\n', "\ufeffrun,origin,file_a,file_b\n"):
        logs[0].with_name("copy.csv").write_text(head, encoding="utf-8")
        (copy,) = (run for run in plan_runs([*logs, logs[0].with_name("copy.csv")], path) if run.name == "copy")
        assert copy.problem == "copy.csv: it is a run table, not a log, and is left alone"


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("name,origin\n", "no column 'file'"),
        ("file,paylod\n", "unknown column 'paylod'.* mean 'payload_kg'"),
        ("", "no column 'file'"),
        ("file,motion,motion\n", "column 'motion' is there twice"),
        ("file_daq,motion\n", "line 2: run: missing: expected a name"),
        ("payload_tool arm_kg,file\n", "line 2: payload_tool arm_kg: 'a.csv': expected a number"),
    ],
)
def test_wrong_columns(run_table, head, message):
    """A column that is missing or unknown is named."""
    path, logs = run_table("a.csv,1\n" if head else "", "a.csv", head=head)
    with pytest.raises(RigError, match=message):
        plan_runs(logs, path)


def test_runs_that_would_have_one_name(tmp_path):
    """Two files of one name without a run table, and conditions that differ within a run, are refused."""
    logs = [tmp_path / "x" / "log.csv", tmp_path / "y" / "log.csv"]
    assert all("would all be stored as run 'log'" in run.problem for run in plan_runs(logs, None))
    path = tmp_path / "runs.csv"
    path.write_text("file,run,motion\nx/log.csv,r,x\ny/log.csv,r,y\n")
    with pytest.raises(RigError, match="line 3: run 'r' has other conditions in line 2"):
        plan_runs(logs, path)


def test_names_of_runs_stay_in_the_campaign(run_table):
    """A run's name is no way out of the folder."""
    path, logs = run_table("a.csv,../../etc/x\n", "a.csv", head="file,run\n")
    with pytest.raises(RigError, match="is no name for a stored run"):
        plan_runs(logs, path)
    assert Path(path).is_file()


SEMICOLONS = "file;payload_kg;counter_masses;peak_acceleration_g\n"


@pytest.mark.parametrize(
    "row",
    [
        'a.csv;1,451;"A=24,26;B=1";3\n',
        'a.csv;1.451;"A=24.26;B=1";3\n',
        "a.csv;1,451;A=24,26 kg;3\n",
        "a.csv;1,451;A=24,26 kg, B=1;3\n",
    ],
)
def test_a_sheet_with_semicolons(run_table, row):
    """As spreadsheets of half of Europe write it: decimal commas, or points, and sites within quotes."""
    path, _ = run_table(row, head=SEMICOLONS)
    (found,) = read_run_table(path)
    assert found.conditions["payload_kg"] == 1.451
    assert found.conditions["counter_masses"]["A"] == 24.26
    assert found.conditions["peak_acceleration_g"] == 3.0


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("a.csv;1,451;;3\nb.csv;1.451;;3\n", r"decimal commas \(line 2\) and decimal points \(line 3\)"),
        ("a.csv;1,451;A=24,26;B=1;3\n", "need quotes in a run table with semicolons"),
        ("a.csv;1.451,5;;3\n", "line 2: expected decimal commas or decimal points throughout"),
        ("a.csv;1;A=x;3\nb.csv;1;;3\n./b.csv;2;;3\n", r"line 2: counter_masses: (.|\n)*line 4: names ./b.csv a second"),
        ("a.csv;1;;3\n./a.csv;2;;3\n", "line 3: names ./a.csv a second time, after line 2"),
    ],
)
def test_what_semicolons_leave_unclear(run_table, rows, message):
    """Two decimal marks, a set of sites that falls apart, two lines for one file: refused, and nothing guessed."""
    path, _ = run_table(rows, head=SEMICOLONS)
    with pytest.raises(RigError, match=message):
        read_run_table(path)


WIDE = """run,file_daq,file_plc,payload_platform_kg,payload_tip_kg,counter_masses,repeat
r1,a.csv,b.csv,1.451,,C=24.2626;D=1,1
r2,c.csv,,2,0.1,,2
"""
LONG = """run,file,payload_platform_kg,payload_tip_kg,counter_masses,repeat
r1,a.csv,1.451,,C=24.2626;D=1,1
r1,b.csv,1.451,,C=24.2626;D=1,1
r2,c.csv,2,0.1,,2
"""


def workbook(path, text, sheet="Sheet"):
    """A CSV as a spreadsheet, numbers as numbers."""
    book = openpyxl.Workbook()
    page = book.active
    page.title = sheet
    for row in text.splitlines():
        page.append([float(c) if c.replace(".", "").isdigit() else c or None for c in row.split(",")])
    book.save(path)
    return path


def test_wide_and_long_tables_and_spreadsheets_say_the_same(tmp_path):
    """A row a run or a row a log, as CSV or as a spreadsheet: the same files, runs and conditions."""
    said = []
    for name, text in (("wide", WIDE), ("long", LONG)):
        (tmp_path / f"{name}.csv").write_text(text)
        for path in (tmp_path / f"{name}.csv", workbook(tmp_path / f"{name}.xlsx", text)):
            said.append([(row.file, row.run, row.conditions) for row in read_run_table(path)])
    assert said[0] == said[1] == said[2] == said[3]
    file, run, conditions = said[0][1]
    assert (file, run) == ("b.csv", "r1")
    assert conditions == {
        "payloads": {"platform": 1.451}, "counter_masses": {"C": 24.2626, "D": 1.0}, "repeat": 1,
    }  # fmt: skip


def test_a_run_table_is_written_as_it_is_read(tmp_path):
    """What the simulation writes is what ingest takes."""
    rows = [("a.csv", "r1", "simulated", {"payloads": {"tip": 0.1}, "counter_masses": {"C": 1 / 3}, "motion": "x"})]
    write_run_table(tmp_path / "runs.csv", rows)
    (row,) = read_run_table(tmp_path / "runs.csv")
    assert row.conditions == rows[0][3] | {"counter_masses": {"C": pytest.approx(1 / 3, rel=1e-11)}}


def broken(path, how):
    """A spreadsheet that cannot be taken as it is."""
    if how == "two sheets":
        book = openpyxl.load_workbook(workbook(path, WIDE))
        book.create_sheet("other")
        book.save(path)
    elif how == "bomb":
        workbook(path, WIDE)
        with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("xl/media/a.bin", bytes(101_000_000))
    elif how == "entities":
        workbook(path, WIDE)
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("xl/more.xml", "<!DOCTYPE x [<!ENTITY a 'aaaa'>]><x>&a;</x>")
    elif how == "damaged":
        content = bytearray(workbook(path, WIDE).read_bytes())
        with zipfile.ZipFile(path) as archive:
            first = archive.infolist()[0]
        content[first.header_offset + 30 + len(first.filename)] = 255  # no kind of block that deflate has
        path.write_bytes(content)
    elif how == "text":
        path.write_text(WIDE)
    else:
        workbook(path, f"file,repeat\na.csv,{how}\n")
    return path


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("two sheets", "has the worksheets Sheet, other: name that of the run table 'runs'"),
        ("bomb", "unpacks to more than 100 MB"),
        ("entities", "xl/more.xml has a document type"),
        ("text", r"not a spreadsheet \(.xlsx\)"),
        ("damaged", r"not a spreadsheet \(.xlsx\): Error -3"),
        ("=1+1", "line 2: cell B2 is a formula without a stored value"),
        ("1.5", "line 2: repeat: '1.5': expected a whole number"),
        ("#REF!", "line 2: cell B2 shows #REF!"),
    ],
)
def test_spreadsheets_that_are_refused(tmp_path, how, message):
    """Bounded, nothing computed, and every refusal says where."""
    with pytest.raises(RigError, match=message):
        read_run_table(broken(tmp_path / "runs.xlsx", how))
