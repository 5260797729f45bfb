"""Run every step, each in a process of its own; pictures and data go to ``demo-output``."""

import shutil
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

STEPS = ("counter_masses", "campaign", "arm")
"""They need nothing of each other; what they print follows in this order."""


def main() -> None:
    """Run the demonstration in a fresh output folder."""
    out = Path("demo-output")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    started = time.perf_counter()
    with ExitStack() as running:
        steps = [running.enter_context(step(name, out)) for name in STEPS]
        for one in steps:
            assert one.stdout is not None
            for line in one.stdout:
                print(line, end="", flush=True)
            if one.wait():
                sys.exit(one.returncode)
    print(f"\nDone in {time.perf_counter() - started:.0f} s.")


def step(name: str, out: Path) -> "subprocess.Popen[str]":
    """A step that has been started, what it prints in a pipe."""
    return subprocess.Popen([sys.executable, "-m", f"demo.{name}", out], stdout=subprocess.PIPE, encoding="utf-8")


if __name__ == "__main__":
    main()
