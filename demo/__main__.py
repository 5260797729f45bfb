"""Run every step, each in a process of its own; pictures and data go to ``demo-output``."""

import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def main() -> None:
    """Run the demonstration in a fresh output folder."""
    out = Path("demo-output")
    shutil.rmtree(out, ignore_errors=True)
    try:
        out.mkdir()
    except OSError as error:
        sys.exit(f"{out.absolute()}: {error.strerror}; the demonstration needs this folder for itself")
    started = time.perf_counter()
    with step("campaign", out) as bench:  # the longest; the others need nothing of it
        with step("counter_masses", out) as masses:
            show(masses)
        with step("arm", out) as arm:
            show(bench)
            show(arm)
    print(f"\nDone in {time.perf_counter() - started:.0f} s.")


@contextmanager
def step(name: str, out: Path) -> "Iterator[subprocess.Popen[str]]":
    """A step that has been started, what it prints in a pipe; it ends where the demonstration fails."""
    words = [sys.executable, "-m", f"demo.{name}", out]
    with subprocess.Popen(words, stdout=subprocess.PIPE, encoding="utf-8") as running:
        try:
            yield running
        except BaseException:
            running.terminate()
            raise


def show(running: "subprocess.Popen[str]") -> None:
    """Print what a step prints, to its end; where it fails the demonstration ends."""
    assert running.stdout is not None
    for line in running.stdout:
        print(line, end="", flush=True)
    if running.wait():
        sys.exit(f"python {' '.join(map(str, running.args[1:]))} failed with exit code {running.returncode}")


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("Interrupted: what is done so far is in demo-output.")
