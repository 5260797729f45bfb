"""The command as a person calls it, in this process: exit code, standard output, standard error."""

import sys
from collections.abc import Callable
from typing import NamedTuple

import pytest

from balance.cli import main


class Outcome(NamedTuple):
    """What a call of the command left."""

    code: int
    out: str
    err: str


@pytest.fixture
def balance(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Call ``balance`` with arguments."""

    def call(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["balance", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        shown = capsys.readouterr()
        return Outcome(int(caught.value.code or 0), shown.out, shown.err)

    return call
