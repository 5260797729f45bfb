"""How the demonstration speaks."""

import subprocess
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
    """Run a command as a user would type it in ``folder``; ``shown`` is what is printed of it, and its output kept."""
    print(f"$ {shown or ' '.join(map(str, words))}", flush=True)
    program = Path(sys.executable).parent / str(words[0])
    done = subprocess.run(
        [program, *map(str, words[1:])], cwd=folder, check=False, stdout=subprocess.PIPE if shown else None, text=True
    )
    if done.returncode not in {0, 3}:
        sys.exit(f"{words[0]} {words[1]} failed with exit code {done.returncode}")
    return done.stdout or ""
