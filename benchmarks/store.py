"""One channel of a stored run read back, against ``np.copy`` of it and against plain h5py, in turn in one run; and the
size of archives of noise of fixed decimals.

    python -m benchmarks.store [--samples 20000000] [--channels 4] [--rounds 7]

Reading compares every chunk with its digest, which copying does not. The values are compared first. Two threads read
and check.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

AIM = 2.5
"""Times that reading may take as long as copying."""
ARCHIVE_AIM = 0.30
"""Size of an archive over that of its values as float64."""
NOISES = {4: 1.0, 6: 0.05}
"""Standard deviation of the noise that is archived, by its decimals."""


def stored(folder: Path, samples: int, channels: int, decimals: int | None = None) -> Path:
    """A run of this many channels of noise, of full precision or fixed decimals."""
    from testbench.recording import Channel, Group, UniformClock
    from testbench.store.writer import RunWriter

    group = Group("daq", tuple(Channel(f"c{i} (V)", "V", f"c{i}") for i in range(channels)), UniformClock(5000.0))
    random = np.random.default_rng(7)
    with RunWriter(folder, "run") as writer:
        for begin in range(0, samples, 1 << 20):
            count = min(1 << 20, samples - begin)
            noise = random.normal(size=(channels, count))
            writer.group(group).append(noise if decimals is None else np.round(noise * NOISES[decimals], decimals))
        writer.group(group).finish(5000.0, "declared")
        writer.describe("simulated", {}, [], {"sources": []}, None)
        return writer.commit()


def seconds(work: Callable[[], object]) -> float:
    """Wall time of ``work`` [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def plain(path: Path) -> np.ndarray:
    """The channel by h5py alone."""
    import h5py

    with h5py.File(path) as file:
        return file["entry/daq/c1"][()]


def archived(folder: Path, samples: int, channels: int) -> bool:
    """Print how large archives are; whether all are as small as they should be."""
    import testbench
    from testbench.store.archive import archive

    print(f"archives of {channels} channels of noise of {samples} samples, of which every channel came back to the bit")
    small = True
    for decimals in NOISES:
        run = testbench.open_run(stored(folder / f"d{decimals}", samples, channels, decimals))
        found: list[Path] = []
        taken = seconds(
            lambda run=run, found=found: found.append(archive(run, folder / "archive" / run.path.parent.name).file)
        )
        ratio = found[0].stat().st_size / (8 * samples * channels)
        print(f"  {decimals} decimals {ratio:6.3f} of the float64 size, {8e-6 * samples * channels / taken:5.0f} MB/s")
        small &= ratio <= ARCHIVE_AIM
    print(f"  aim: {ARCHIVE_AIM:g}")
    return small


def main() -> int:
    """Print the medians and the ratio of medians, and the sizes; 1 if an aim is missed."""
    import testbench

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=20_000_000)
    parser.add_argument("--channels", type=int, default=4)
    parser.add_argument("--rounds", type=int, default=7)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        path = stored(Path(temporary), given.samples, max(2, given.channels))
        run = testbench.open_run(path)
        values = run.channel("c1")
        if values.tobytes() != plain(path).tobytes():
            raise SystemExit("the two ways did not read the same bits")
        sides: dict[str, Callable[[], object]] = {
            "np.copy": lambda: np.copy(values),
            "h5py": lambda: plain(path),
            "run.channel": lambda: run.channel("c1"),
        }
        rounds = [{name: seconds(work) for name, work in sides.items()} for _ in range(given.rounds)]
        small = archived(Path(temporary), min(given.samples, 1_000_000), max(2, given.channels))
    medians = {name: statistics.median(one[name] for one in rounds) for name in sides}
    print(f"{given.samples * 8 / 1e6:.0f} MB of one channel, medians of {given.rounds} interleaved rounds, same bits")
    for name, median in medians.items():
        print(f"  {name:12} {median * 1e3:8.1f} ms   {median / medians['np.copy']:5.2f} times np.copy")
    print(f"  aim: {AIM:g} times np.copy")
    return int(not small or medians["run.channel"] > AIM * medians["np.copy"])


if __name__ == "__main__":
    raise SystemExit(main())
