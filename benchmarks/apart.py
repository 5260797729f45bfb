"""Sides of a comparison in turn, each in a process of its own: wall time and peak memory."""

import importlib
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

MEMORY_MB = 300.0
"""Peak memory that ingest keeps within, however long the log [MB]."""

FAILED = 2
"""Exit code of a benchmark that could not compare; 1 is that of one that falls short."""


@dataclass(frozen=True)
class Taken:
    """What one side took: median wall time [s] and largest peak of memory [MB] of its rounds."""

    seconds: float
    peak_mb: float

    def line(self, name: str) -> str:
        """The numbers as they are printed."""
        return f"  {name:34} {self.seconds:7.2f} s   peak {self.peak_mb:6.0f} MB"


def compare(module: str, log: Path, rounds: int, same: Callable[[Path, Path], bool]) -> dict[str, Taken]:
    """The ``SIDES`` of ``module``, ours and a peer, in turn; what both stored in the first round must be the same."""
    sides = list(importlib.import_module(module).SIDES)
    results: dict[str, list[tuple[float, float]]] = {side: [] for side in sides}
    for number in range(rounds):
        folders = [log.with_name(f"{side}{number}") for side in sides]
        for side, folder in zip(sides, folders, strict=True):
            results[side].append(_measured(module, side, log, folder))
        if number == 0 and not same(*folders):
            _fail("the two sides did not store the same numbers")
        for file in (file for folder in folders for file in folder.iterdir()):
            file.unlink()
    return {side: Taken(statistics.median(s for s, _ in r), max(m for _, m in r)) for side, r in results.items()}


def ingest(log: Path, folder: Path) -> None:
    """Our side: as the command does."""
    from testbench.ingest import Ingest
    from testbench.runsheet import plan

    folder.mkdir()
    (outcome,) = Ingest(folder).run(plan([log], None)[0])
    if outcome.status != "stored":
        raise SystemExit(outcome.message)


def _measured(module: str, side: str, log: Path, folder: Path) -> tuple[float, float]:
    """Wall time [s], start included, and peak memory [MB] of one side."""
    code = f"import sys; from benchmarks.apart import child; child({module!r}, {side!r}, sys.argv[1], sys.argv[2])"
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, str(log), str(folder)], capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    if done.returncode:
        _fail(f"{side}: {done.stderr}")
    return seconds, float(done.stdout.splitlines()[-1])


def _fail(message: str) -> None:
    """End with another code than what is merely slow."""
    print(message, file=sys.stderr)
    raise SystemExit(FAILED)


def child(module: str, side: str, log: str, folder: str) -> None:
    """Run one side and print its peak memory [MB]."""
    importlib.import_module(module).SIDES[side](Path(log), Path(folder))
    print(peak_mb())


def peak_mb() -> float:
    """Peak memory of this process [MB]; Linux's rusage would count that of the process that started it, too."""
    status = Path("/proc/self/status")
    if status.exists():
        return next(int(line.split()[1]) for line in status.read_text().splitlines() if line[:6] == "VmHWM:") / 1024
    scale = 1 << 20 if sys.platform == "darwin" else 1 << 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale
