"""Commands as a person calls them, in this process: exit code, standard output, standard error."""

import contextlib
import io
import json
import sys
from collections.abc import Callable
from typing import Any, NamedTuple


class Outcome(NamedTuple):
    """What a call of a command left."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The document on standard output."""
        return json.loads(self.out)


def call(main: Callable[[], None], name: str, *words: object) -> Outcome:
    """Call the main function of a command with words."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv, code = [name, *map(str, words)], 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    finally:
        sys.argv = before
    return Outcome(code, out.getvalue(), err.getvalue())
