"""TDMS of many short segments into HDF5: ``testbench ingest`` against npTDMS and h5py, segment by segment.

    python -m benchmarks.tdms [--segments 5000] [--rounds 3]

LabVIEW writes a segment each time its program writes, often a thousand samples. The peer appends each to its dataset,
as one does without gathering whole chunks. What both stored is compared first.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import apart

CHANNELS = 4
SAMPLES = 1000
"""Samples a channel in each segment."""
RATE_HZ = 5000.0
AIM = 4.0
"""Times as fast as the peer."""


def generate(path: Path, segments: int) -> None:
    """Write a log of float64 channels by npTDMS."""
    from nptdms import ChannelObject, TdmsWriter

    random = np.random.default_rng(20191120)
    said = {"wf_increment": 1 / RATE_HZ, "wf_start_offset": 0.0, "unit_string": "m/s^2"}
    with TdmsWriter(path) as writer:
        for _ in range(segments):
            data = random.normal(0.0, 3.0, (CHANNELS, SAMPLES))
            writer.write_segment([ChannelObject("daq", f"Acc {i}", column, said) for i, column in enumerate(data)])


def appended(log: Path, folder: Path) -> None:
    """Each segment as npTDMS gives it, appended to its dataset."""
    import h5py
    from nptdms import TdmsFile

    folder.mkdir()
    with TdmsFile.open(log) as tdms, h5py.File(folder / "log.h5", "w") as file:
        for name in (f"Acc {i}" for i in range(CHANNELS)):
            file.create_dataset(name, shape=(0,), maxshape=(None,), chunks=(1 << 15,), dtype="f8")
        for chunk in tdms.data_chunks():
            for channel in chunk["daq"].channels():
                dataset, data = file[channel.name], channel[:]
                dataset.resize(len(dataset) + len(data), axis=0)
                dataset[-len(data) :] = data


SIDES = {"ours": apart.ingest, "appended": appended}


def main() -> int:
    """Print the comparison; 1 if ours needs too much memory or is the slower one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--segments", type=int, default=5000)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        log = Path(temporary) / "log.tdms"
        generate(log, given.segments)
        size = log.stat().st_size / 1e6
        found = apart.compare("benchmarks.tdms", log, given.rounds, apart.same_channels)
    ours, peer = found["ours"], found["appended"]
    print(f"{size:.0f} MB of TDMS, {given.segments} segments of {SAMPLES} samples, into HDF5, same bits stored")
    print(peer.line("npTDMS, appended by h5py"))
    print(ours.line("testbench ingest"))
    print(f"  {peer.seconds / ours.seconds:.2f} times as fast; aim: {AIM:g}")
    return int(peer.seconds < ours.seconds or ours.peak_mb > apart.MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
