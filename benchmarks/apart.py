"""Sides of a comparison in turn, each in a process of its own: wall time, processor time and peak memory."""

import importlib
import os
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
    """What one side took: medians of wall time [s] and processor time [s], and largest peak of memory [MB]."""

    seconds: float
    processor_s: float
    peak_mb: float

    def line(self, name: str) -> str:
        """The numbers as they are printed."""
        used = f"{self.processor_s:6.2f} s of processor"
        return f"  {name:40} {self.seconds:7.2f} s   {used}   peak {self.peak_mb:6.0f} MB"


def compare(module: str, log: Path, rounds: int, same: Callable[[Path, Path], bool]) -> dict[str, Taken]:
    """The ``SIDES`` of ``module``, ours and peers, in turn; what all stored in the first round must be the same."""
    sides = list(importlib.import_module(module).SIDES)
    results: dict[str, list[tuple[float, float, float]]] = {side: [] for side in sides}
    for number in range(rounds):
        folders = [log.with_name(f"{side}{number}") for side in sides]
        for side, folder in zip(sides, folders, strict=True):
            results[side].append(_measured(module, side, log, folder))
        if number == 0 and not all(same(folders[0], other) for other in folders[1:]):
            _fail("the sides did not store the same numbers")
        for file in (file for folder in folders for file in folder.iterdir()):
            file.unlink()
    taken = {side: tuple(zip(*rounds_of, strict=True)) for side, rounds_of in results.items()}
    median = statistics.median
    return {side: Taken(median(wall), median(used), max(peak)) for side, (wall, used, peak) in taken.items()}


def ingest(log: Path, folder: Path) -> None:
    """Our side: as the command does."""
    from testbench.ingestion import Ingest
    from testbench.ingestion.planned_runs import plan_runs

    folder.mkdir()
    (outcome,) = Ingest(folder).run(plan_runs([log], None)[0])
    if outcome.status != "stored":
        raise SystemExit(outcome.message)


def same_channels(ours: Path, other: Path) -> bool:
    """Whether our run in one folder and ``log.h5`` of a peer in the other hold the same bits in every channel."""
    import h5py

    from testbench.store import open_run

    run = open_run(next(ours.glob("*.h5")))
    with h5py.File(other / "log.h5") as file:
        return all(run.channel(name).tobytes() == file[name][()].tobytes() for name in file)


def _measured(module: str, side: str, log: Path, folder: Path) -> tuple[float, float, float]:
    """Wall time [s], start included, processor time [s] and peak memory [MB] of one side.

    Python may keep the bytecode of the checkout, as it has that of installed packages.
    """
    code = f"import sys; from benchmarks.apart import child; child({module!r}, {side!r}, sys.argv[1], sys.argv[2])"
    command = [sys.executable, "-c", code, str(log), str(folder)]
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    begin, used = time.perf_counter(), _used()
    done = subprocess.run(command, capture_output=True, text=True, env=kept)
    seconds, processor_s = time.perf_counter() - begin, _used() - used
    if done.returncode:
        _fail(f"{side}: {done.stderr}")
    return seconds, processor_s, float(done.stdout.splitlines()[-1])


def _used() -> float:
    """Processor time of the processes that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


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
