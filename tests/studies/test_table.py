"""The table of the studies' figures."""

import json
from pathlib import Path

import pytest

from studies.__main__ import STUDIES, main
from studies.table import Origin, Row, acceptance, all_of, covered, write_table


def origin(study, commit="abc"):
    """Of a full run."""
    return Origin(study, f"python -m studies --only {study}", commit, "2026-01-01", False)


def test_counts_that_a_binomial_test_accepts():
    """The tails of B(200, 0.95): P(<= 178) = 0.05 %, P(<= 179) = 0.12 %, P(>= 199) = 0.04 %; a bound may be wide."""
    assert acceptance(200) == (179, 198)
    assert acceptance(200, conservative=True)[1] == 200
    assert covered("", 178, 200).verdict == covered("", 199, 200).verdict == "fails"
    assert covered("", 0, 0).verdict == "shown"


def test_verdicts():
    """Both ends of the required range are accepted; nothing required, nothing judged; of trials all must pass."""
    assert [Row("", value, low=1.0, high=2.0).verdict for value in (0.9, 1.0, 2.0, 2.1)] == [
        "fails", "holds", "holds", "fails",
    ]  # fmt: skip
    assert Row("", 3.0).verdict == "shown"
    assert [all_of("", passed, 3).passed for passed in (2, 3)] == [False, True]


def test_a_run_replaces_its_study_alone(tmp_path):
    """New figures take the place of the same study's; those of others stay, each with its commit and command."""
    write_table(tmp_path, origin("trim"), [Row("old", 1.0), Row("older", 2.0)])
    write_table(tmp_path, origin("clocks"), [covered("logger", 5, 6)])
    write_table(tmp_path, origin("trim", "def"), [Row("new", 3.5, "%", low=3.0)])
    figures = json.loads((tmp_path / "results.json").read_text())["figures"]
    assert [(f["study"], f["quantity"], f["commit"]) for f in figures] == [
        ("clocks", "logger", "abc"), ("trim", "new", "def"),
    ]  # fmt: skip
    page = (tmp_path / "results.md").read_text()
    assert "| new | 3.5 % | at least 3 | holds |  |" in page
    assert "`python -m studies --only trim` at def, 2026-01-01" in page


def test_every_study_is_a_module():
    """A name of the list is a module with its function."""
    folder = Path(main.__code__.co_filename).parent
    for name in STUDIES:
        path = folder / f"{name}.py" if (folder / f"{name}.py").exists() else folder / name / "__init__.py"
        assert "\ndef study(count: int, brief: bool) -> Iterator[Row]:" in path.read_text(encoding="utf-8")


def test_brief_figures_are_not_committed(capsys):
    """The table in docs is of full runs."""
    with pytest.raises(SystemExit, match="2"):
        main(["--brief", "--commit-table"])
    assert "leave out --brief" in capsys.readouterr().err
