import ast
from pathlib import Path

import pytest

import testbench
from testbench.cli.options import print_reading_findings
from testbench.cross_examination.statement import ADVICE, WITHHOLDING
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.quality.log_description import describe_log
from testbench.recording import (
    MEANING,
    Channel,
    Finding,
    Group,
    Refusal,
    Severity,
    findings_by_group,
    refusing_findings,
    worst_severity,
)
from testbench.store import open_run

PAGE = Path(__file__).parents[2] / "docs" / "findings.md"


def test_every_code_is_documented_with_its_severity():
    """The page of findings has a line for each code, in the section of its severity, and no other codes."""
    sections = PAGE.read_text("utf-8").split("\n## ")
    for code, meaning in MEANING.items():
        title = Finding(code, None, None, "").severity.name.capitalize() + "s"
        (section,) = [text for text in sections if text.startswith(title)]
        assert f"| `{code}` | {meaning} |" in section
    assert sum(line.startswith("| `") for line in PAGE.read_text("utf-8").splitlines()) == len(MEANING)


def test_every_code_of_an_analysis_is_documented():
    """Each code that stands in the source, and in the table about reductions, has a line on the page."""
    package, codes = Path(testbench.__file__).parent, set(MEANING)
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                codes |= {one.value for one in node.args[:1] if isinstance(one, ast.Constant)}
            if isinstance(node, ast.Tuple) and path.name == "reduction.py" and len(node.elts) == 3:
                codes |= {one.value for one in node.elts[:1] if isinstance(one, ast.Constant)}
    lines = {line.partition(" | ")[0].strip("| `") for line in PAGE.read_text("utf-8").splitlines()}
    assert {"vibrates_more", "durations_differ"} <= codes <= lines


def test_contradictions_that_withhold_a_number_are_marked_so_on_the_page():
    """All contradictions are listed; a copied run has words of its own, for it counts once or not at all."""
    _, table = PAGE.read_text("utf-8").split("| contradiction | subject |")
    effects = {
        row[1].strip(): row[3].strip() for row in (line.split("|") for line in table.splitlines()) if len(row) > 4
    }
    assert set(ADVICE) <= set(effects)
    for code in set(ADVICE) - {"copied_run"}:
        assert effects[code] == ("withheld" if code in WITHHOLDING else "marked"), code


def test_only_accepted_errors_pass():
    """An error is refused unless its code is accepted; warnings never are."""
    found = [Finding(code, None, None, "") for code in ("dialect", "time_gap", "ragged_row", "nul_bytes")]
    assert worst_severity(found) is Severity.ERROR
    assert [f.code for f in refusing_findings(found, ["nul_bytes"])] == ["ragged_row"]
    assert worst_severity(found[:1]) is worst_severity([]) is Severity.NOTE


def test_the_group_is_named_where_the_channel_does_not_say_it():
    """Of two groups with a channel of one name each; not where there is one group, nor where a name is in both."""
    x, y, z = (Channel(name) for name in "xyz")
    groups = (Group("daq", (x, y)), Group("forces", (y, z)))
    found = [Finding("clipping", name, None, "") for name in ("x", "y", "z", None)]
    assert [f.group for f in findings_by_group(found, groups, True)] == ["daq", None, "forces", None]
    known = [Finding("clipping", "y", None, "", "forces")]
    assert findings_by_group(known, groups, True) == known
    assert findings_by_group(known, groups, False)[0].group is None


def test_two_logs_of_one_run_keep_their_findings_apart(tmp_path, capsys):
    """The same channel is dead in both logs: each finding names its group."""
    for period, name in ((7, "left"), (5, "right")):
        rows = [f"{i / 100},{i % period},5\n" for i in range(200)]
        (tmp_path / f"{name}.csv").write_text("Time (s),AccX (g),AccY (g)\n" + "".join(rows), encoding="utf-8")
    planned = PlannedRun("r1", (tmp_path / "left.csv", tmp_path / "right.csv"))
    outcomes = Ingest(tmp_path / "c").run(planned)
    assert {outcome.status for outcome in outcomes} == {"stored"}, outcomes[0].message
    run = open_run(tmp_path / "c" / "r1.h5")
    dead = [f for f in run.findings if f.code == "constant_channel"]
    assert [(f.channel, f.group) for f in dead] == [("AccY (g)", "left"), ("AccY (g)", "right")]
    print_reading_findings("r1", (("", one) for one in dead))
    assert "AccY (g), group left: all 200 samples are 5" in capsys.readouterr().out
    Ingest(tmp_path / "alone").run(PlannedRun("r1", (tmp_path / "left.csv",)))
    assert {f.group for f in open_run(tmp_path / "alone" / "r1.h5").findings} == {None}
    assert {f.group for f in describe_log(tmp_path / "left.csv").findings} == {None}


@pytest.mark.parametrize(
    ("code", "refused_for"), [("empty_group", "no_data"), ("left_out", "no_data"), ("cut_file", "cut_file")]
)
def test_a_refusal_is_an_error(code, refused_for):
    """A file of which everything is left out is refused for an error, and not for the note that says what was."""
    refusal = Refusal("log.mf4", Finding(code, None, None, "no sample in 1 groups: a"))
    assert (refusal.finding.code, refusal.finding.severity) == (refused_for, Severity.ERROR)
    assert str(refusal) == "log.mf4: no sample in 1 groups: a"
