"""Simulated rotors of known truth: two planes, two sensors, a tachometer, and what disturbs them."""

from dataclasses import dataclass, field

import numpy as np

INFLUENCE = np.array([[3.0 * np.exp(0.4j), 1.1 * np.exp(-1.2j)], [0.8 * np.exp(2.0j), 2.4 * np.exp(-2.8j)]])
"""Acceleration of each sensor for unbalance in each plane, phase of lead, (sensors, planes) [m/s2 / g]."""
UNBALANCE = np.array([1.5 * np.exp(1.0j), 0.9 * np.exp(-2.2j)])
"""Unbalance of each plane, angles with the rotation from the mark, (planes,) [g]."""


@dataclass
class Rotor:
    """One run."""

    weights: complex | np.ndarray = 0.0
    """Weights that are on, (planes,) [g]."""
    seed: int = 0
    speed: float = 50.0
    """[turns/s]"""
    seconds: float = 3.0
    rate: float = 10_000.0
    noise: float = 0.3
    tone: float = 0.3
    """Amplitude of a vibration that does not turn with the rotor [m/s2]."""
    drift: float = 0.0
    """Change of speed over the record, of its mean."""
    smooth: bool = False
    """Whether the tachometer gives a sine rather than short pulses."""
    drop: list[int] = field(default_factory=list)
    """Turns whose pulses the tachometer misses."""
    marks: tuple[float, ...] = (0.0,)
    """Where the marks are [turns]."""

    def record(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Time (n,) [s], tachometer (n,) [V], accelerations (sensors, n) [m/s2]."""
        rng = np.random.default_rng(self.seed)
        time = np.arange(int(self.seconds * self.rate)) / self.rate
        start = rng.uniform()
        turned = start + self.speed * (time + self.drift * (time**2 / (2 * self.seconds) - time / 2))
        tacho = np.where(np.any([(turned - mark) % 1.0 < 0.06 for mark in self.marks], axis=0), 5.0, 0.0)
        tacho[np.isin(np.floor(turned).astype(int), self.drop)] = 0.0
        if self.smooth:
            tacho = 2.5 * np.sin(2.0 * np.pi * turned)
        tacho = tacho + rng.normal(0.0, 0.002 if self.smooth else 0.05, len(time))
        theta = 2.0 * np.pi * turned
        signals = [
            2.7 + np.real(value * np.exp(1j * theta)) + self._disturbance(rng, theta, time) for value in self.truth()
        ]
        return time, tacho, np.array(signals)

    def truth(self) -> np.ndarray:
        """Vector of each sensor, (sensors,) [m/s2]."""
        return INFLUENCE @ (UNBALANCE + self.weights)

    def _disturbance(self, rng: np.random.Generator, theta: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Order 2 and 3 at fixed phase, a tone that does not turn with the rotor, noise."""
        orders = 0.8 * np.cos(2 * theta + 0.3) + 0.4 * np.cos(3 * theta - 1.0)
        tone = self.tone * np.cos(2 * np.pi * 61.3 * time + rng.uniform(0, 2 * np.pi))
        return orders + tone + rng.normal(0.0, self.noise, len(time))

    def csv(self) -> str:
        """The record as a logger writes it."""
        time, tacho, (a, b) = self.record()
        rows = "\n".join(f"{t:.4f},{p:.4f},{x:.6f},{y:.6f}" for t, p, x, y in zip(time, tacho, a, b, strict=True))
        return f"t (s),tacho (V),A (m/s^2),B (m/s^2)\n{rows}\n"
