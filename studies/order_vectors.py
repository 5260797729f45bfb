"""Coverage of the intervals of ``testbench vectors``: simulated rotors whose truth is known.

Accelerations of one sensor with orders 1 to 3, noise, and a tone that does not turn with the rotor, timed by a sine or
by short pulses; and a bench of two modes whose speed changes. Where the sampling is synchronous with the speed, or the
record does not tell the vector at the speed that is asked (findings say so), the interval is a bound.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from testbench.rotating.order_tracking import OrderVector, mains_near, order_vector
from testbench.rotating.tachometer import steady_turns

from .laboratories import FAMILIES
from .table import Row, covered

SPEED, TRUTH = 50.0, 4.0 * np.exp(0.7j)
"""Turns a second; vector of the first order [m/s2]."""
NOISES = ("floor", "hum", "drift", "in motion only", "step without dither", "all mixed")
"""Families of noise, as in laboratories; their size is a residual's in them [m/s2]."""
CASES: dict[str, dict[str, Any]] = {
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
    "speed wanders": {"waves": {0.13: 0.02, 0.31: 0.012}},
    "speed wanders, marks at 10 kHz": {"waves": {0.13: 0.02, 0.31: 0.012}, "rate": 10_000.0},
    "speed hunts over 30 turns": {"waves": {1.5: 0.02}},
    "speed hunts over 11 turns, off the mean": {"waves": {4.0: 0.02}, "off": 0.0025},
    "steady, off the speed": {"waves": {0.0: 0.0}, "off": 0.0025},
    **{f"{size:g} of {name}": {"family": name, "size": size, "speed": 47.3} for name in NOISES for size in (0.2, 2.0)},
}


def run(
    seed: int, turns: int = 60, noise: float = 0.4, tone: float = 0.0, beside: float = 13.4, pulses: bool = False,
    speed: float = SPEED, jitter: float = 0.0, family: str = "", size: float = 0.0,
) -> OrderVector | None:  # fmt: skip
    """One record; None where its order lies on the mains, as a finding says.

    ``beside`` is the tone's distance from the order in periods a record, ``jitter`` in samples.
    """
    rng, rate = np.random.default_rng(seed), 2500.0
    time = np.arange(int((turns + 1.2) / speed * rate)) / rate
    turned = rng.uniform() + speed * time
    late = rng.normal(0.0, jitter * speed / rate, int(turned[-1]) + 2)[np.floor(turned).astype(int)] if jitter else 0.0
    tacho = np.where((turned - late) % 1.0 < 0.06, 5.0, 0.0) if pulses else np.sin(2 * np.pi * turned)
    tacho = tacho + rng.normal(0.0, 1e-3, len(time))
    theta = 2.0 * np.pi * turned
    signal = np.real(TRUTH * np.exp(1j * theta)) + 0.8 * np.cos(2 * theta + 0.3) + 0.4 * np.cos(3 * theta - 1.0)
    signal += tone * np.cos(2 * np.pi * speed * (1 + beside / turns) * time + rng.uniform(0, 2 * np.pi))
    signal += rng.normal(0.0, 0.02 * size if family else noise, len(time))
    if family:
        signal += FAMILIES[family].law(rng, size)(rng, time, np.ones(len(time)))
        step = size * rng.uniform(*FAMILIES[family].steps)
        signal = np.round(signal / step + rng.uniform()) * step if step else signal
    found = steady_turns("record", time, tacho, None, False, 0.02)
    if family and mains_near(found, 1):
        return None
    return order_vector("A", "acceleration", signal, found, time, 1, 8)


MODES = ((41.0, 0.03, 1.0), (63.0, 0.025, -0.6))
"""Natural frequency [Hz], damping ratio and share of each mode of the bench whose speed changes."""


def response(frequency: np.ndarray | float) -> np.ndarray:
    """Acceleration of the bench by unbalance at a speed [turns/s], unscaled."""
    modes = (
        share * (frequency / f) ** 4 / (1 - (frequency / f) ** 2 + 2j * z * frequency / f) for f, z, share in MODES
    )
    return np.asarray(sum(modes))


def changing(seed: int, waves: dict[float, float], off: float = 0.0, rate: float = 2500.0) -> OrderVector:
    """A record of 5 s at about 45 turns/s, in which the speed goes by ``waves`` (size by frequency [Hz]).

    It is scaled to TRUTH at the speed that is asked, ``off`` 45 by that share; the response is by convolution.
    """
    rng, time = np.random.default_rng(seed), np.arange(int(7.0 * rate)) / rate
    change = sum(size * np.sin(2 * np.pi * f * time + rng.uniform(0, 2 * np.pi)) for f, size in waves.items())
    theta = rng.uniform(0, 2 * np.pi) + 2 * np.pi * 45.0 * np.cumsum(1.0 + change) / rate
    at = 45.0 * (1.0 + rng.choice([-1.0, 1.0]) * off)
    spectrum = np.fft.fft(np.exp(1j * theta)) * response(np.fft.fftfreq(len(time), 1.0 / rate))
    phasor = np.fft.ifft(spectrum) / complex(response(at)) * TRUTH
    signal = phasor.real + 0.01 * np.cos(2 * theta + 0.3) + rng.normal(0.0, 0.007, len(time))
    signal += 0.004 * np.cos(2 * np.pi * 50.0 * time)
    kept = time >= 2.0
    tacho = np.where(theta[kept] % (2 * np.pi) < 0.35, 5.0, 0.0)
    found = steady_turns("record", time[kept], tacho, None, False, 0.08)
    return order_vector("A", "acceleration", signal[kept], found, time[kept], 1, 8, at)


def study(count: int, brief: bool) -> Iterator[Row]:
    """Coverage of amplitude and phase in each case; half widths over the least that noise alone allows."""
    for name, given in CASES.items():
        found = [vector for seed in range(count) if (vector := (changing if "waves" in given else run)(seed, **given))]
        samples = given.get("turns", 60) / given.get("speed", SPEED) * 2500.0
        least = 1.96 * given.get("noise", 0.4) * (2.0 / samples) ** 0.5
        width = np.median([v.amplitude_within for v in found]) / (least if "waves" not in given else 0.01 * abs(TRUTH))
        hits = {
            "amplitude": sum(abs(abs(v.value) - abs(TRUTH)) < v.amplitude_within for v in found),
            "phase": sum(bool(abs(np.angle(v.value / TRUTH)) < v.phase_within) for v in found),
        }
        for quantity, number in hits.items():
            of = "half width [%]" if "waves" in given else "half width over the least"
            note = f"{of} {width:.2f}" if quantity == "amplitude" and "family" not in given else ""
            bound = "in step" in name or "off" in given
            yield covered(f"{name}, {quantity}", number, len(found), note, conservative=bound)
