"""What the shell completes."""

import pytest
from click.shell_completion import BashComplete

from balance.cli import COMMANDS as BALANCE
from balance.cli.framework import LazyGroup
from testbench.cli import COMMANDS as TESTBENCH

GROUPS = {
    "balance": LazyGroup("balance", package="balance.cli", lazy=BALANCE),
    "testbench": LazyGroup("testbench", package="testbench.cli", lazy=TESTBENCH),
}


def completed(line):
    """What completes the last word of a line, and whether the shell is asked for files."""
    name, *words = line.split(" ")
    shell = BashComplete(GROUPS[name], {}, name, f"_{name.upper()}_COMPLETE")
    found = shell.get_completions(words[:-1], words[-1])
    return [one.value for one in found if one.type == "plain"], any(one.type == "file" for one in found)


CASES = {
    "balance si": ["size", "simulate"],
    "balance size parallelogram-6bar-": ["parallelogram-6bar-full"],
    "balance size fo": ["forbal-2", "four-bar"],
    "balance size my-": ["my-machine.xml"],
    "balance size four-bar --motion tri": ["triangle"],
    "balance size four-bar --site counter_A": ["counter_A0A"],
    "balance check four-bar -c counter_B": ["counter_B0B="],
    "balance check four-bar -p ": ["A0A=", "AB=", "B0B="],
    "balance engine free in-line-5": ["in-line-5"],
    "balance drive four": ["four-bar-dc"],
    "testbench simulate --plan kiper2019-b": ["kiper2019-brief"],
    "testbench analyze --accept flat": ["flat_channel"],
    "testbench ingest --accept cut_last": ["cut_last_row"],
    "testbench identify two-joint-arm-a": ["two-joint-arm-a0"],
    "testbench compare --published ki": ["kiper2019"],
}


@pytest.mark.parametrize("line", CASES)
def test_names_are_completed(line, tmp_path, monkeypatch):
    """Commands, what is shipped, files of this folder, sites and bodies of the mechanism that is named, codes."""
    (tmp_path / "my-machine.xml").write_text("<mujoco/>", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert completed(line) == (CASES[line], False)


@pytest.mark.parametrize("line", ["balance size ./", "balance check six-bar -c co", "testbench analyze camp"])
def test_else_the_shell_completes_files(line):
    """Where no name begins so, also where the mechanism cannot be read."""
    assert completed(line) == ([], True)
