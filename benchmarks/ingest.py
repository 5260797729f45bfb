"""CSV into HDF5: ``testbench ingest`` against naive ``pandas.read_csv`` and h5py, in turn, each in its own process.

    python -m benchmarks.ingest [--mb 300] [--rounds 3]

Ours also detects the dialect, checks every channel and the clock, keeps a checksum of each chunk and digests of both
files, and waits for the disk; the peer does none of it. What all stored is compared first. pandas parses in several
threads from 3.1 on, and in one before; both are measured. On a long log ours must be quicker than either, and ``AIM``
times as quick as the one thread.
"""

import argparse
import hashlib
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import apart

CHANNELS = 5
RATE_HZ = 5000.0
LONG_MB = 200.0
"""Size from which start-up no longer decides [1e6 bytes]."""
AIM = 2.0
"""Times as fast as pandas in one thread, on two cores that do nothing else."""
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


def naive(log: Path, folder: Path) -> None:
    """What one writes first: the whole table into memory, then each column into a file."""
    import h5py
    import pandas as pd

    folder.mkdir()
    table = pd.read_csv(log)
    with h5py.File(folder / "log.h5", "w") as file:
        for number, name in enumerate(table.columns):
            file.create_dataset(f"column {number}", data=table[name].to_numpy())


def single(log: Path, folder: Path) -> None:
    """The same in one thread, as pandas reads before 3.1."""
    import pandas as pd

    with pd.option_context("mode.max_threads", 1):
        naive(log, folder)


SIDES = {"ours": apart.ingest, "naive": naive, "single": single}


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
    ours, peers = found["ours"], (found["naive"], found["single"])
    print(f"{given.mb:g} MB of CSV into HDF5, medians of {given.rounds} interleaved rounds, same bits stored")
    print(peers[0].line("pandas.read_csv + h5py"))
    print(peers[1].line("the same in one thread, as before 3.1"))
    print(ours.line("testbench ingest"))
    threads, one = (f"{peer.seconds / ours.seconds:.2f} ({peer.processor_s / ours.processor_s:.2f})" for peer in peers)
    print(f"  {threads} times as fast (by processor time); aim: 1; than in one thread {one}; aim: {AIM:g}")
    slower = ours.seconds > min(peers[0].seconds, peers[1].seconds / AIM)
    return int((given.mb >= LONG_MB and slower) or ours.peak_mb > apart.MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
