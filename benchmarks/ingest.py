"""CSV into HDF5: ``testbench ingest`` against naive ``pandas.read_csv`` and h5py, in turn, each in its own process.

    python -m benchmarks.ingest [--mb 300] [--rounds 3]

Ours also detects the dialect, checks every channel and the clock, keeps a checksum of each chunk and a digest of the
file, and waits for the disk; the peer does none of it. What both stored is compared first.
"""

import argparse
import hashlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

CHANNELS = 5
RATE_HZ = 5000.0
MEMORY_MB = 300.0
"""Peak memory that ingest keeps within, however long the log [MB]."""
LONG_MB = 200.0
"""Size from which start-up no longer decides [1e6 bytes]."""
_ROWS_WRITTEN = 100_000


def generate(path: Path, megabytes: float) -> None:
    """Write a log of time and five channels with six decimals, of about this size [1e6 bytes]."""
    import polars

    random = np.random.default_rng(20191120)
    row = 0
    with path.open("wb") as stream:
        stream.write(("Time (s)," + ",".join(f"Acc {i} (m/s^2)" for i in range(CHANNELS)) + "\n").encode())
        while stream.tell() < megabytes * 1e6:
            columns = {f"{i}": random.normal(0.0, 3.0, _ROWS_WRITTEN) for i in range(CHANNELS)}
            table = polars.DataFrame({"t": (row + np.arange(_ROWS_WRITTEN)) / RATE_HZ, **columns})
            table.write_csv(stream, include_header=False, float_precision=6)
            row += _ROWS_WRITTEN


def ours(log: Path, folder: Path) -> None:
    """Ingest as the command does."""
    from testbench.ingest import Ingest
    from testbench.runsheet import plan

    folder.mkdir()
    (outcome,) = Ingest(folder).run(plan([log], None)[0])
    if outcome.status != "stored":
        raise SystemExit(outcome.message)


def naive(log: Path, folder: Path) -> None:
    """What one writes first: the whole table into memory, then each column into a file."""
    import h5py
    import pandas as pd

    folder.mkdir()
    table = pd.read_csv(log)
    with h5py.File(folder / "log.h5", "w") as file:
        for number, name in enumerate(table.columns):
            file.create_dataset(f"column {number}", data=table[name].to_numpy())


SIDES = {"ours": ours, "naive": naive}


def measure(side: str, log: Path, folder: Path) -> tuple[float, float]:
    """Wall time [s] and peak memory [MB] of one side in a process of its own."""
    code = f"import sys; from benchmarks.ingest import child; child({side!r}, sys.argv[1], sys.argv[2])"
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, str(log), str(folder)], capture_output=True, text=True)
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise SystemExit(f"{side}: {done.stderr}")
    return seconds, float(done.stdout)


def child(side: str, log: str, folder: str) -> None:
    """Run one side and print its peak memory [MB]."""
    SIDES[side](Path(log), Path(folder))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def same(ours_folder: Path, naive_folder: Path) -> bool:
    """Whether both stored the same bits."""
    import h5py

    from testbench.store import open_run

    run = open_run(next(ours_folder.glob("*.h5")))
    with h5py.File(naive_folder / "log.h5") as file:
        return all(
            hashlib.sha256(run.channel(channel.name).tobytes()).digest()
            == hashlib.sha256(file[f"column {number}"][()].tobytes()).digest()
            for number, channel in enumerate(run.groups[0].channels)
        )


def compare(megabytes: float, rounds: int) -> dict[str, float]:
    """Medians of interleaved rounds: the ratio naive / ours of the times, and both peaks of memory [MB]."""
    results: dict[str, list[tuple[float, float]]] = {side: [] for side in SIDES}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        generate(folder / "log.csv", megabytes)
        for number in range(rounds):
            for side in SIDES:
                results[side].append(measure(side, folder / "log.csv", folder / f"{side}{number}"))
            if number == 0 and not same(folder / "ours0", folder / "naive0"):
                raise SystemExit("the two sides did not store the same numbers")
    seconds = {side: statistics.median(s for s, _ in rows) for side, rows in results.items()}
    memory = {side: max(m for _, m in rows) for side, rows in results.items()}
    return {
        "ratio": seconds["naive"] / seconds["ours"],
        "ours_s": seconds["ours"],
        "naive_s": seconds["naive"],
        "ours_peak_MB": memory["ours"],
        "naive_peak_MB": memory["naive"],
    }


def main() -> int:
    """Print the comparison; 1 if ours needs too much memory or, on a long log, is the slower one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mb", type=float, default=300.0, help="size of the log [1e6 bytes]")
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    found = compare(given.mb, given.rounds)
    print(f"{given.mb:g} MB of CSV into HDF5, medians of {given.rounds} interleaved rounds, same bits stored")
    print(f"  pandas.read_csv + h5py   {found['naive_s']:6.2f} s   peak {found['naive_peak_MB']:6.0f} MB")
    print(f"  testbench ingest         {found['ours_s']:6.2f} s   peak {found['ours_peak_MB']:6.0f} MB")
    print(f"  {found['ratio']:.2f} times as fast")
    slower = given.mb >= LONG_MB and found["ratio"] < 1.0
    return int(slower or found["ours_peak_MB"] > MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
