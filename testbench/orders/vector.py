"""What order vectors of a run are: amplitude and phase of each sensor with their intervals, and what is odd."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .tacho import Turns

Metric = Literal["peak", "peak_to_peak", "rms"]
METRICS: dict[Metric, float] = {"peak": 1.0, "peak_to_peak": 2.0, "rms": 0.5**0.5}
"""Factor from the peak value of an order."""


@dataclass(frozen=True)
class OrderVector:
    """One sensor's vector; its intervals (95 %) are from the noise on lines beside the order."""

    sensor: str
    dimension: str
    value: complex
    """Peak amplitude and phase of lead [m, m/s or m/s2]."""
    amplitude_within: float
    """Half the interval of the amplitude [m, m/s or m/s2]."""
    phase_within: float
    """Half the interval of the phase, at most pi [rad]; it holds what the samples leave open of steep pulses."""
    phase_within_alone: float
    """The same without what the pulses' timing does to the phases of all sensors alike [rad]."""
    coherence: float
    """|sum of the parts' vectors|^2 over parts times the sum of their squares: 1 where all parts agree."""
    share: float
    """Power of the order over that of the whole signal, mean removed."""
    tones: tuple[float, ...] = ()
    """Frequencies of tones beside the order that do not turn with the rotor, fitted with it [Hz]."""

    @property
    def is_told(self) -> bool:
        """Whether amplitude is told from the scatter; else the phase means nothing."""
        return self.phase_within < np.pi / 2

    def findings(self, order: int) -> tuple[str, ...]:
        """What is odd about it."""
        if self.is_told:
            return ()
        return (f"order {order} is not told from the scatter; its phase means nothing",)


@dataclass(frozen=True)
class Vectors:
    """Order vectors of a run."""

    order: int
    turns: Turns
    vectors: tuple[OrderVector, ...]

    @property
    def phase_alike(self) -> float:
        """How far all phases may be off alike, by the timing of the pulses, half a 95 % interval [rad]."""
        return 2.0 * np.pi * self.order * self.turns.speed * self.turns.timing

    @property
    def phase_shared(self) -> float:
        """The same as half the interval of a normal error of its deviation, for sums with others [rad]."""
        return 2.0 * np.pi * self.order * self.turns.speed * self.turns.timing_within

    def findings(self) -> tuple[str, ...]:
        """What is odd; nothing where all is well."""
        return (*self._in_step(), *(f"{v.sensor}: {text}" for v in self.vectors for text in v.findings(self.order)))

    def _in_step(self) -> tuple[str, ...]:
        if not self.turns.keeps_step:
            return ()
        samples = 1.0 / (self.turns.resolution * self.turns.speed)
        return (
            f"the sampling keeps step with the speed ({samples:.6g} samples a turn): where the pulses lie within a "
            f"sample does not average out, all phases may be off by {np.degrees(self.phase_alike):.2g} deg alike; it "
            "is in their intervals; sample faster, or at a rate that is no multiple of the speed",
        )
