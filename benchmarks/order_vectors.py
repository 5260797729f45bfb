"""Coverage of the intervals of ``testbench vectors``: how often 95 % intervals hold the truth of simulated rotors.

    python -m benchmarks.order_vectors [--seeds 200]

Accelerations of one sensor with orders 1 to 3, noise, and a tone that does not turn with the rotor, timed by a sine or
by short pulses. A count that is not 95 % by a binomial test at 0.1 % is marked; where the sampling keeps step with the
speed only one that is below: the interval is a bound. Beside it the half width, of the least that noise alone would
allow over the whole record. A finding says that the sampling keeps step.
"""

import argparse

import numpy as np
from scipy.stats import binomtest

from testbench.orders.tacho import steady_turns
from testbench.orders.vectors import OrderVector, order_vector

SPEED, TRUTH = 50.0, 4.0 * np.exp(0.7j)
"""Turns a second; vector of the first order [m/s2]."""
CASES = {
    "noise alone": {},
    "tone of 2 noises": {"tone": 0.8},
    "tone of 10 noises": {"tone": 4.0},
    "tone, little noise": {"tone": 0.8, "noise": 0.005},
    "tone 2.2 lines beside": {"tone": 0.8, "beside": 2.2},
    "12 turns": {"turns": 12},
    "12 turns, tone": {"turns": 12, "tone": 2.0},
    "short pulses, own step": {"pulses": True, "speed": 49.37},
    "short pulses, in step": {"pulses": True},
    "in step, nearly": {"pulses": True, "speed": 50.003},
    "in step, pulses jitter": {"pulses": True, "jitter": 0.1},
}


def run(
    seed: int, turns: int = 60, noise: float = 0.4, tone: float = 0.0, beside: float = 13.4, pulses: bool = False,
    speed: float = SPEED, jitter: float = 0.0,
) -> OrderVector:  # fmt: skip
    """One record; ``beside`` is the tone's distance from the order in periods a record, ``jitter`` in samples."""
    rng, rate = np.random.default_rng(seed), 2500.0
    time = np.arange(int((turns + 1.2) / speed * rate)) / rate
    turned = rng.uniform() + speed * time
    late = rng.normal(0.0, jitter * speed / rate, int(turned[-1]) + 2)[np.floor(turned).astype(int)] if jitter else 0.0
    tacho = np.where((turned - late) % 1.0 < 0.06, 5.0, 0.0) if pulses else np.sin(2 * np.pi * turned)
    tacho = tacho + rng.normal(0.0, 1e-3, len(time))
    theta = 2.0 * np.pi * turned
    signal = np.real(TRUTH * np.exp(1j * theta)) + 0.8 * np.cos(2 * theta + 0.3) + 0.4 * np.cos(3 * theta - 1.0)
    signal += tone * np.cos(2 * np.pi * speed * (1 + beside / turns) * time + rng.uniform(0, 2 * np.pi))
    signal += rng.normal(0.0, noise, len(time))
    found = steady_turns("record", time, tacho, None, False, 0.02)
    return order_vector("A", "acceleration", signal, found, time, 1, 8)


def main(arguments: list[str] | None = None) -> int:
    """Print counts; 1 where one is not 95 %."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.order_vectors")
    parser.add_argument("--seeds", type=int, default=200)
    seeds, failed = parser.parse_args(arguments).seeds, False
    print(f"{'':24s} amplitude   phase   of   half width over the least")
    for name, given in CASES.items():
        found = [run(seed, **given) for seed in range(seeds)]
        hits = [
            sum(abs(abs(v.value) - abs(TRUTH)) < v.amplitude_within for v in found),
            sum(abs(np.angle(v.value / TRUTH)) < v.phase_within for v in found),
        ]
        side = "less" if "in step" in name else "two-sided"
        odd = min(binomtest(hit, seeds, 0.95, side).pvalue for hit in hits) < 1e-3
        failed |= odd
        samples = given.get("turns", 60) / given.get("speed", SPEED) * 2500.0
        least = 1.96 * given.get("noise", 0.4) * (2.0 / samples) ** 0.5
        width = np.median([v.amplitude_within for v in found]) / least
        print(f"{name:24s} {hits[0]:9d} {hits[1]:7d} {seeds:4d}   {width:.2f}{'   not 95 %' if odd else ''}")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
