"""CSV into HDF5: ``testbench ingest`` against naive ``pandas.read_csv`` and h5py, in turn, each in its own process.

    python -m benchmarks.ingest [--mb 300] [--rounds 3]

Ours also detects the dialect, checks every channel and the clock, keeps a checksum of each chunk and digests of both
files, and waits for the disk; the peer does none of it. What all stored is compared first. pandas 3.1 parses in several
threads by default, and in one with ``low_memory=False``; both are measured, and the quicker one counts.
"""

import argparse
import hashlib
import tempfile
from pathlib import Path

import numpy as np

from . import apart

CHANNELS = 5
RATE_HZ = 5000.0
LONG_MB = 200.0
"""Size from which start-up no longer decides [1e6 bytes]."""
AIM = 1.5
"""Times as fast as the peer, on two cores that do nothing else."""
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


def naive(log: Path, folder: Path, **options: bool) -> None:
    """What one writes first: the whole table into memory, then each column into a file."""
    import h5py
    import pandas as pd

    folder.mkdir()
    table = pd.read_csv(log, **options)
    with h5py.File(folder / "log.h5", "w") as file:
        for number, name in enumerate(table.columns):
            file.create_dataset(f"column {number}", data=table[name].to_numpy())


def whole(log: Path, folder: Path) -> None:
    """The same, by the other way in which pandas reads."""
    naive(log, folder, low_memory=False)


SIDES = {"ours": apart.ingest, "naive": naive, "whole": whole}


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


def main() -> int:
    """Print the comparison; 1 if ours needs too much memory or, on a long log, is the slower one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mb", type=float, default=300.0, help="size of the log [1e6 bytes]")
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        log = Path(temporary) / "log.csv"
        generate(log, given.mb)
        found = apart.compare("benchmarks.ingest", log, given.rounds, same)
    ours, peer = found["ours"], min(found["naive"], found["whole"], key=lambda side: side.seconds)
    print(f"{given.mb:g} MB of CSV into HDF5, medians of {given.rounds} interleaved rounds, same bits stored")
    print(found["naive"].line("pandas.read_csv + h5py"))
    print(found["whole"].line("pandas.read_csv, low_memory=False + h5py"))
    print(ours.line("testbench ingest"))
    used = peer.processor_s / ours.processor_s
    print(f"  {peer.seconds / ours.seconds:.2f} times as fast, {used:.2f} by processor time; aim: {AIM:g}")
    slower = given.mb >= LONG_MB and peer.seconds < ours.seconds
    return int(slower or ours.peak_mb > apart.MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
