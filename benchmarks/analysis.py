"""A campaign analysed: 26 conditions with and without counter-masses, three repeats, 12 channels at 10 kHz.

    python -m benchmarks.analysis [--runs 156] [--seconds 10] [--rounds 3]

The runs are written by the store from made-up signals; they are simulated and say so. Of every channel: SI, mean
removed, 0..200 Hz without phase, peak, peak to peak, root mean square, power spectral density; of every condition the
reduction of the base's acceleration. Ours against the same steps by scipy on whole arrays, channel by channel, read by
h5py; both from the same files. First each in a process of its own, for its memory, and what both found is compared;
then in turn in one process, libraries imported, for the time. Reductions with their intervals, which scipy has not, are
timed beside them: what `testbench analyze` takes. Both run with one thread of linear algebra, as that command does.
"""

import argparse
import os
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported, as the commands do

import numpy as np

from benchmarks import apart

AIM = 2.0
"""Times as fast as the peer."""
MEMORY_MB = 500.0
"""Within which ours stays, however many runs there are [MB]."""
AGREEMENT = 1e-9
"""Of each number, relative to its channel's largest: filters run in another order round differently."""
RATE_HZ = 10_000.0
SEGMENT = 4096
PADDING = round(4.0 * RATE_HZ / 200.0)
"""Samples of mirrored record at the ends, four periods of the band's edge."""
UNITS = {"AccX": "g", "AccY": "g", "AccZ": "g", "PlatX": "g", "PlatY": "g", "tau1": "N m"}
FORCES = ("Fx1", "Fy1", "Fz1", "Mx1", "My1", "Mz1")
RIG = """mechanism = "none"
[loggers.daq]
clock = "uniform"
rate = "10 kHz"
[sensors.base_acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "AccX", y = "AccY", z = "AccZ" }
unit = "g"
position = ["0 m", "0 m", "0 m"]
[sensors.arm_acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "PlatX", y = "PlatY" }
unit = "g"
position = ["0 m", "0 m", "0 m"]
attached_to = "arm"
[sensors.support]
kind = "wrench"
logger = "daq"
channels = { Fx = "Fx1", Fy = "Fy1", Fz = "Fz1", Mx = "Mx1", My = "My1", Mz = "Mz1" }
position = ["0 m", "0 m", "0 m"]
[sensors.motor]
kind = "torque"
logger = "daq"
channel = "tau1"
joint = "A0"
unit = "N m"
"""


def generate(folder: Path, count: int, seconds: float) -> None:
    """Write runs of a plan: pulses of the motion, a decaying mode, noise; weaker with counter-masses."""
    from testbench import campaign_plan
    from testbench.recording import Channel, Group, UniformClock
    from testbench.store.writer import RunWriter

    channels = tuple(Channel(name, unit) for name, unit in {**UNITS, **_force_units()}.items())
    group = Group("daq", channels, UniformClock(RATE_HZ))
    samples = round(seconds * RATE_HZ)
    instants = np.arange(samples) / RATE_HZ
    random = np.random.default_rng(20191120)
    shape = np.exp(-(((instants - seconds / 2) / (seconds / 20)) ** 2)) * np.sin(2 * np.pi * 11.0 * instants)
    for planned in campaign_plan.load_plan("kiper2019-deep").runs()[:count]:
        size = planned.peak_acceleration / 10.0 * (0.2 if planned.counter_masses else 1.0)
        values = [np.round((i + 1) * size * shape + 0.02 * random.standard_normal(samples) + 0.1 * i, 5)
                  for i in range(len(channels))]  # fmt: skip
        with RunWriter(folder, planned.name) as writer:
            writer.group(group).append(values)
            writer.group(group).finish(RATE_HZ, "declared")
            writer.describe("simulated", planned.conditions, [], {"sources": []}, RIG)
            writer.commit()


def _force_units() -> dict[str, str]:
    return {name: "N" if name[0] == "F" else "N m" for name in FORCES}


def ours(folder: Path, out: Path) -> None:
    """As the product does."""
    from testbench.store import open_campaign
    from testbench.vibration.channel_levels import levels_of_runs
    from testbench.vibration.run_pairs import ConditionKey

    found, keys = {}, {}
    for run, some in levels_of_runs(open_campaign(folder).runs, segment=SEGMENT):
        found[run.name] = {one.column.channel: [*one.metrics.values(), one.spectrum.power()] for one in some}
        keys[run.name] = str(ConditionKey.of(run)), bool(run.conditions.get("counter_masses"))
    _write(out, found, keys)


def by_scipy(folder: Path, out: Path) -> None:
    """The same steps, each a call of scipy or numpy on a whole channel."""
    import h5py
    from scipy.signal import butter, sosfiltfilt, welch

    found, keys = {}, {}
    sections = butter(4, 200.0, fs=RATE_HZ, output="sos")
    for path in sorted(folder.glob("*.h5")):
        found[path.stem] = {}
        with h5py.File(path) as file:
            for name in (*UNITS, *FORCES):
                values = file[f"entry/daq/{name}"][()] * (9.81 if UNITS.get(name) == "g" else 1.0)
                passed = sosfiltfilt(sections, values - values.mean(), padtype="even", padlen=PADDING)
                metrics = np.abs(passed).max(), np.ptp(passed), np.sqrt(np.mean(passed**2))
                found[path.stem][name] = [*map(float, metrics), welch(values, RATE_HZ, nperseg=SEGMENT)[1]]
            said, mounted = (
                dict(file["entry/conditions"].attrs),
                "counter_A0A" in file["entry/conditions/counter_masses"].attrs,
            )
        key = f"{said['payload_kg']:g} kg, motion {said['motion']}, {said['peak_acceleration_g']:g} g0"
        keys[path.stem] = key, mounted
    _write(out, found, keys)


def _write(out: Path, found: dict, keys: dict) -> None:
    """Metrics and mean spectra of all channels, and the reductions of the conditions; last the reductions."""
    out.mkdir()
    names = [*UNITS, *FORCES]
    rows = np.array([[channels[n][:3] for n in names] for channels in found.values()])
    spectra = np.array([[channels[n][3] for n in names] for channels in found.values()])
    falls = []
    for key in sorted({key for key, _ in keys.values()}):
        sides = [[found[r][c][1] for r, k in keys.items() if k == (key, masses) for c in ("AccX", "AccY", "AccZ")]
                 for masses in (True, False)]  # fmt: skip
        falls.append([100.0 * (1.0 - np.exp(np.mean(np.log(sides[0])) - np.mean(np.log(sides[1]))))])
    np.savez(out / "found.npz", metrics=rows, spectra=spectra, falls=falls)


def intervals(folder: Path, out: Path) -> None:
    """Reductions with noise, intervals and findings, as `testbench analyze` gives them."""
    import testbench

    out.mkdir()
    testbench.analyze(folder)


SIDES = {"ours": ours, "scipy": by_scipy}
TIMED = SIDES | {"intervals": intervals}


def same(one: Path, other: Path) -> bool:
    """Whether all numbers of both are the same, to rounding."""
    with np.load(one / "found.npz") as a, np.load(other / "found.npz") as b:
        apart = [float(np.abs(a[n] - b[n]).max() / np.abs(b[n]).max()) for n in ("metrics", "falls")]
        apart.append(float(np.abs(a["spectra"] / b["spectra"] - 1.0).max()))
    print(f"largest differences: metrics {apart[0]:.1e}, reductions {apart[1]:.1e}, spectra {apart[2]:.1e}")
    return max(apart) <= AGREEMENT


def in_turn(folder: Path, rounds: int) -> dict[str, tuple[float, float]]:
    """Medians of wall time and processor time of each side [s], after one round that is not counted."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in TIMED}
    for number in range(rounds + 1):
        for name, side in TIMED.items():
            begin, busy = time.perf_counter(), sum(os.times()[:4])  # copies of this process included
            side(folder, folder.with_name(f"turn{number}{name}"))
            taken[name].append((time.perf_counter() - begin, sum(os.times()[:4]) - busy))
    return {
        name: (statistics.median(s for s, _ in times[1:]), statistics.median(p for _, p in times[1:]))
        for name, times in taken.items()
    }


def main() -> int:
    """Print the comparison; 1 if the aim is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=156)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "campaign"
        generate(folder, given.runs, given.seconds)
        alone = apart.compare("benchmarks.analysis", folder, 1, same)
        turns = in_turn(folder, given.rounds)
        took, busy = turns.pop("intervals")
        found = {name: replace(alone[name], seconds=s, processor_s=p) for name, (s, p) in turns.items()}
    mine, peer = found["ours"], found["scipy"]
    print(f"{given.runs} runs of {given.seconds:g} s, 12 channels at 10 kHz, medians of {given.rounds} rounds in turn")
    print(peer.line("scipy on whole channels"))
    print(mine.line("testbench"))
    share = peer.processor_s / mine.processor_s
    print(
        f"reductions with intervals: {took:.2f} s, {busy:.2f} s of processor time, {took / peer.seconds:.2f} of scipy's"
    )
    print(f"  {peer.seconds / mine.seconds:.2f} times as fast, {share:.2f} times less processor time; aim: {AIM:g}")
    return int(peer.seconds < AIM * mine.seconds or mine.peak_mb > MEMORY_MB)


if __name__ == "__main__":
    raise SystemExit(main())
