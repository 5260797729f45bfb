"""How the demonstration speaks."""

import contextlib
import importlib
import io
import sys
from collections.abc import Sequence
from pathlib import Path


def heading(text: str) -> None:
    """Announce a step."""
    print(f"\n{text}")


def saved(path: Path, what: str) -> None:
    """Say where a picture or file went."""
    print(f"   {what}: {path.parent.name}/{path.name}")


def command(words: Sequence[str | Path], folder: Path, *, shown: str = "") -> str:
    """Run a command as a user would type it in ``folder``; ``shown`` is what is printed of it, and its output kept.

    In this process, which has the libraries imported already.
    """
    print(f"$ {shown or ' '.join(map(str, words))}", flush=True)
    main = importlib.import_module(f"{words[0]}.cli").main
    before, sys.argv, kept = sys.argv, [*map(str, words)], io.StringIO()
    try:
        with contextlib.chdir(folder), contextlib.redirect_stdout(kept if shown else sys.stdout):
            main()
    except SystemExit as end:
        if end.code not in {0, 3}:
            sys.exit(f"{words[0]} {words[1]} failed with exit code {end.code}")
    finally:
        sys.argv = before
    return kept.getvalue()
