"""The force sensors' printed extremes beside the rigid mechanism: what can reconcile them with the acceleration."""

from dataclasses import dataclass

import numpy as np

from balance.units import G0
from testbench.published_tables import MOTION, PAYLOAD_KG, PEAK_G, ForceExtremes

from .model import Cases


def reading(extremes: ForceExtremes, cases: Cases) -> "Reading | None":
    """The extremes and the mechanics of its condition; None where the cases lack it."""
    same = np.isclose(cases.payload_kg, PAYLOAD_KG) & (cases.motion == MOTION)
    at = same & np.isclose(cases.peak_acceleration, PEAK_G * G0)
    return Reading(extremes, *map(float, cases.mechanics[at][0] * PEAK_G * G0)) if at.any() else None


@dataclass(frozen=True)
class Reading:
    """The extremes and the shaking force and moment of the rigid mechanism [N, N m]."""

    extremes: ForceExtremes
    force_without: float
    force_left: float
    force_taken: float
    moment_without: float
    moment_with: float

    @property
    def unbalanced_mass(self) -> float:
        """Mass at the platform that would cause the span that remains [kg]."""
        return self.extremes.spans[1] / 2.0 / (PEAK_G * G0)

    @property
    def would_remain(self) -> float:
        """Peak to peak that would remain if the force fell as the acceleration did [N]."""
        return self.extremes.spans[0] * (1.0 - self.extremes.acceleration_percent / 100.0)

    def cannot(self) -> tuple[str, ...]:
        """What does not reconcile the two."""
        falls, spans = self.extremes.reductions.values(), self.extremes.spans
        off = abs(2.0 * self.force_without / spans[0] - 1.0)
        return (
            "an offset of the sensors: it moves both peaks alike and leaves peak to peak as it is",
            f"another amplitude of the same force: those that extremes allow fall by at most {max(falls):.1f} %",
            f"sensors that read wrongly throughout: without counter-masses the rigid mechanism shakes with "
            f"{2 * self.force_without:.0f} N peak to peak, {spans[0]:.1f} N is printed, {off:.0%} apart",
            f"wrong counter-masses: the rigid mechanism keeps {2 * self.force_left:.1f} N peak to peak with them, and "
            f"{spans[1]:.0f} N would take {self.unbalanced_mass:.1f} kg unbalanced at the platform; had the force "
            f"fallen as the acceleration did, {self.would_remain:.0f} N would remain",
        )

    def can(self) -> tuple[str, ...]:
        """What could, none of it decidable from print."""
        rise = self.moment_with / self.moment_without - 1.0
        return (
            "a support that carries in one direction only, a preload that is lost, a stop that is hit: the motion is "
            "as fast forth as back, and a linear path would lower both peaks about alike",
            "one short peak: it sets an extreme, and hardly an RMS or a filtered amplitude; what the table's amplitude "
            "is, and in which band, is not printed",
            f"sensors of one support alone: they carry a part of the shaking moment, which rises by {rise:.0%} "
            f"({self.moment_without:.1f} to {self.moment_with:.1f} N m)",
            "what rides on the sensors: they read the shaking force less the mechanism's mass times the base's "
            "acceleration, and the counter-masses add to that mass",
        )
