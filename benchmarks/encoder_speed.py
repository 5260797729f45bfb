"""Coverage of the intervals of ``testbench speed``: how often 95 % intervals hold the truth of simulated encoder logs.

    python -m benchmarks.encoder_speed [--seeds 200]

Edges of a disc on the crank of the shipped inverted slider-crank, steady at 276 rev/min of the motor: clock steps,
jitter, errors of the disc, few and many turns. A count that is too small for 95 % by a one-sided binomial test at 0.1 %
is marked. Beside it the half width of the fluctuation's interval over the rms of its error: 1.96 at best.
"""

import argparse

import numpy as np
from scipy.stats import binomtest

from balance.drives.drive_files import load_drive
from balance.drives.steady import Steady, steady
from testbench.encoder import Disc, Turn, edges_of, periodic_turn

CASES = {
    "clock of 4 us": {"clock": 4e-6},
    "clock of 4 us, jitter 10 us": {"clock": 4e-6, "jitter": 1e-5},
    "jitter 10 us, 3 turns": {"jitter": 1e-5, "turns": 3},
    "jitter 50 us": {"jitter": 5e-5},
    "jitter 200 us, 30 turns": {"jitter": 2e-4, "turns": 30},
    "60 pulses, jitter 20 us": {"pulses": 60, "jitter": 2e-5},
    "361 pulses, jitter 10 us": {"pulses": 361, "jitter": 1e-5},
    "2 % of pitch": {"pitch": 0.02},
    "5 % of pitch, jitter 10 us": {"pitch": 0.05, "jitter": 1e-5},
}


def truth() -> Steady:
    """The steady rotation that the logs are made of."""
    drive = load_drive("inverted-slider-crank")
    return steady(drive.machines(drive.load_mechanism())[1])


def log(
    motion: Steady, seed: int, pulses: int = 100, turns: int = 8, clock: float = 0.0, jitter: float = 0.0,
    pitch: float = 0.0,
) -> Turn:  # fmt: skip
    """The turn found from one log."""
    rng = np.random.default_rng(seed)
    waves = np.fft.rfft(1.0 / motion.rate(np.arange(4096) * 2 * np.pi / 4096))[1:60] / 2048
    off = rng.normal(0.0, pitch * 2 * np.pi / pulses, pulses)
    edge = np.arange(pulses * turns + 1)
    phi = 0.25 * seed + 2 * np.pi * edge / pulses + off[edge % pulses] - off[0]
    k = np.arange(1, 60)
    time = motion.period * phi / (2 * np.pi) + np.real(np.exp(1j * np.outer(phi, k)) @ (waves / (1j * k)))
    time = time + rng.normal(0.0, jitter, len(edge))
    return periodic_turn(edges_of("log", np.round(time / clock) * clock if clock else time, Disc(pulses)))


def main(arguments: list[str] | None = None) -> int:
    """Print counts; 1 where one is too small."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.encoder_speed")
    parser.add_argument("--seeds", type=int, default=200)
    seeds, motion, failed = parser.parse_args(arguments).seeds, truth(), False
    nominal = motion.machine.nominal_crank
    print(f"{'':28s} fluctuation  fastest   mean    of   half width over error")
    for name, given in CASES.items():
        turns = [log(motion, seed, **given) for seed in range(seeds)]
        found = [turn.fluctuation(nominal) for turn in turns]
        hits = [
            sum(estimate.holds(motion.fluctuation()) for estimate in found),
            sum(turn.fastest.holds(motion.fastest[1]) for turn in turns),
            sum(turn.mean.holds(motion.mean_speed) for turn in turns),
        ]
        short = min(binomtest(hit, seeds, 0.95, "less").pvalue for hit in hits) < 1e-3
        failed |= short
        off = np.sqrt(np.mean([(estimate.value - motion.fluctuation()) ** 2 for estimate in found]))
        wide = np.median([0.5 * (estimate.high - estimate.low) for estimate in found]) / off
        print(
            f"{name:28s} {hits[0]:11d} {hits[1]:8d} {hits[2]:6d} {seeds:5d}   {wide:.2f}{'   short' if short else ''}"
        )
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
