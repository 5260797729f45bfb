"""Power spectral density of a long channel: blocks of segments against ``scipy.signal.welch``, in turn in one run.

    python -m benchmarks.spectra [--samples 20000000] [--segment 4096] [--rounds 5]

The spectra are compared first, at every frequency; they must agree to 1e-12 of the value.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

AIM = 4.0
"""Times as fast as scipy."""
AGREEMENT = 1e-12
RATE_HZ = 10_000.0


def main() -> int:
    """Print the medians and their ratio; 1 if the aim is missed."""
    from scipy import signal

    from testbench.signal.welch import welch

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=20_000_000)
    parser.add_argument("--segment", type=int, default=4096)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    values = np.random.default_rng(20191120).normal(0.3, 1.0, given.samples)
    sides: dict[str, Callable[[], np.ndarray]] = {
        "scipy.signal.welch": lambda: signal.welch(values, RATE_HZ, nperseg=given.segment)[1],
        "testbench.signal.welch": lambda: welch([values], RATE_HZ, given.segment).power(),
    }
    peer, ours = (side() for side in sides.values())
    apart = float(np.abs(ours / peer - 1.0).max())
    if not apart <= AGREEMENT:
        raise SystemExit(f"the spectra differ by {apart:.1e} of the value")
    taken: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(given.rounds):
        for name, side in sides.items():
            begin = time.perf_counter()
            side()
            taken[name].append(time.perf_counter() - begin)
    medians = [statistics.median(times) for times in taken.values()]
    print(f"{given.samples} samples in segments of {given.segment}, medians of {given.rounds} interleaved rounds; "
          f"largest difference {apart:.1e} of the value")  # fmt: skip
    for name, median in zip(sides, medians, strict=True):
        print(f"  {name:24} {median:7.3f} s")
    print(f"  {medians[0] / medians[1]:.2f} times as fast; aim: {AIM:g}")
    return int(medians[0] < AIM * medians[1])


if __name__ == "__main__":
    raise SystemExit(main())
