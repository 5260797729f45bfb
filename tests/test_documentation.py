"""The pages' commands are those of the program; docs/run_examples.py runs them all, which takes minutes."""

import re
import shlex
from pathlib import Path

import click
import pytest

from balance.cli import COMMANDS as BALANCE
from balance.cli.framework import LazyGroup
from testbench.cli import COMMANDS as TESTBENCH

DOCS = Path(__file__).parents[1] / "docs"
GROUPS = {
    "balance": LazyGroup("balance", package="balance.cli", lazy=BALANCE),
    "testbench": LazyGroup("testbench", package="testbench.cli", lazy=TESTBENCH),
}


def commands(page: Path) -> list[str]:
    """The lines of a page's shell blocks."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]


PAGES = [page for page in sorted(DOCS.rglob("*.md")) if "_build" not in page.parts and commands(page)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_is_there(page):
    """Each command and each of its options exists, and no argument is missing."""
    for line in commands(page):
        name, *words = shlex.split(line)
        found = GROUPS[name]
        while isinstance(found, click.Group):
            found, words = found.get_command(click.Context(found), words[0]), words[1:]
            assert found is not None, line
        _, rest, _ = found.make_parser(click.Context(found)).parse_args(list(words))
        assert not rest, line


def test_both_starts_are_one():
    """The Turkish start shows the commands of the English one."""
    assert commands(DOCS / "start.md") == commands(DOCS / "start-tr.md")


def test_every_command_is_shown():
    """Of the commands each has a task on a page of how-to, but for those that are told elsewhere."""
    text = "".join(page.read_text("utf-8") for page in DOCS.rglob("*.md") if "_build" not in page.parts)
    missing = [f"{name} {one}" for name, some in (("balance", BALANCE), ("testbench", TESTBENCH))
               for one in some if f"{name} {one}" not in text]  # fmt: skip
    assert missing == []
