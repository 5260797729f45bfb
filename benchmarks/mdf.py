"""ASAM MDF 4 into HDF5 in bounded memory: ``testbench ingest`` against asammdf and h5py.

    python -m benchmarks.mdf [--mb 240] [--rounds 3] [--compressed]

The log is written by asammdf. The peer takes each channel from asammdf and writes it, which holds the data in memory.
What both stored is compared first.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import apart

CHANNELS = 5
RATE_HZ = 5000.0


def generate(path: Path, megabytes: float, compressed: bool) -> None:
    """Write a log of time and five channels of float64, of about this size before compression [1e6 bytes]."""
    from asammdf import MDF, Signal

    samples = int(megabytes * 1e6 / 8 / (CHANNELS + 1))
    time = np.arange(samples) / RATE_HZ
    random = np.random.default_rng(20191120)
    signals = [
        Signal(np.round(random.normal(0.0, 3.0, samples), 6), time, unit="m/s^2", name=f"Acc {i}")
        for i in range(CHANNELS)
    ]
    with MDF(version="4.10") as file:
        file.append(signals, comment="daq", common_timebase=True)
        file.save(path, compression=2 if compressed else 0)


def by_asammdf(log: Path, folder: Path) -> None:
    """Each channel as asammdf gives it, written whole."""
    import h5py
    from asammdf import MDF

    folder.mkdir()
    with MDF(log) as mdf, h5py.File(folder / "log.h5", "w") as file:
        for i in range(CHANNELS):
            signal = mdf.get(f"Acc {i}")
            file.create_dataset(f"Acc {i}", data=signal.samples)
        file.create_dataset("time", data=signal.timestamps)


SIDES = {"ours": apart.ingest, "asammdf": by_asammdf}


def main() -> int:
    """Print the comparison; 1 if ours needs too much memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mb", type=float, default=240.0, help="size of the samples [1e6 bytes]")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--compressed", action="store_true", help="transposed and deflated blocks")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        log = Path(temporary) / "log.mf4"
        generate(log, given.mb, given.compressed)
        found = apart.compare("benchmarks.mdf", log, given.rounds, apart.same_channels)
    ours, peer = found["ours"], found["asammdf"]
    print(f"{given.mb:g} MB of MDF 4 into HDF5, medians of {given.rounds} interleaved rounds, same bits stored")
    print(peer.line("asammdf + h5py"))
    print(ours.line("testbench ingest"))
    print(f"  {peer.peak_mb / ours.peak_mb:.2f} times less memory, {peer.seconds / ours.seconds:.2f} times as fast")
    return int(ours.peak_mb > apart.MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
