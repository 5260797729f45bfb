from pathlib import Path

from testbench.findings import MEANING, Finding, Severity, refused, worst

PAGE = Path(__file__).parents[2] / "docs" / "findings.md"


def test_every_code_is_documented_with_its_severity():
    """The page of findings has a line for each code, in the section of its severity, and no other codes."""
    sections = PAGE.read_text("utf-8").split("\n## ")
    for code, meaning in MEANING.items():
        title = Finding(code, None, None, "").severity.name.capitalize() + "s"
        (section,) = [text for text in sections if text.startswith(title)]
        assert f"| `{code}` | {meaning} |" in section
    assert sum(line.startswith("| `") for line in PAGE.read_text("utf-8").splitlines()) == len(MEANING)


def test_only_accepted_errors_pass():
    """An error is refused unless its code is accepted; warnings never are."""
    found = [Finding(code, None, None, "") for code in ("dialect", "time_gap", "ragged_row", "nul_bytes")]
    assert worst(found) is Severity.ERROR
    assert [f.code for f in refused(found, ["nul_bytes"])] == ["ragged_row"]
    assert worst(found[:1]) is worst([]) is Severity.NOTE
