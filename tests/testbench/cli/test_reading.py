"""Findings as people read them."""

from testbench.cli.options import SHOWN_PER_CODE, print_reading_findings
from testbench.recording import Finding


def test_of_many_findings_alike_the_first_are_shown_and_the_others_counted(capsys):
    """A log with 200 dead channels does not bury what else there is."""
    dead = [Finding("constant_channel", f"ch{i}", None, "dead") for i in range(200)]
    print_reading_findings("log.c3d", [*dead, Finding("time_gap", "time", None, "torn")])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 1 + SHOWN_PER_CODE + 1
    assert "time_gap" in "".join(lines[1:])
    assert f"  warning constant_channel: and {200 - SHOWN_PER_CODE} more like these; --json lists all" in lines


def test_one_more_than_are_shown_is_shown(capsys):
    """A line that says one more would be as long as the one."""
    print_reading_findings("log", [Finding("clipping", f"ch{i}", None, "flat") for i in range(SHOWN_PER_CODE + 1)])
    assert "more like these" not in capsys.readouterr().out
