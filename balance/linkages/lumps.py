"""What every body is made of in a stage of balancing, as point masses with inertia, and their sum."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from .loads import CounterMass, pin
from .method import Balance


@dataclass(frozen=True)
class Lump:
    """A rigid piece in the plane."""

    mass: float
    """[kg]."""
    inertia: float
    """About its own centre of mass [kg m2]."""
    at: Floats
    """Its centre of mass in the body's frame, (2,) [m]."""


def lumps(result: Balance, stage: str) -> dict[str, list[Lump]]:
    """Pieces of every body in the stage ``before``, ``force`` (counter-masses) or ``complete`` (and gears)."""
    linkage, values = result.linkage, result.values
    reshaped = result.moment.reshaped if result.moment and stage != "before" else {}
    found = {
        body.name: [
            Lump(values[p.mass], reshaped.get(p.link, values.get(p.inertia, 0.0)), p.centre.at(values))
            for p in body.parts
        ]
        for body in linkage.bodies.values()
    }
    if stage != "before":
        for body, counter in result.counters(stage):
            found[body].append(_counter(result, body, counter))
    if stage == "complete" and result.moment:
        for gear in result.moment.gears.values():
            if gear.wheel_mass:
                at = pin(linkage, gear.joint, gear.gear.body).at(values)
                found[gear.gear.body].append(Lump(gear.wheel_mass, gear.wheel_inertia, at))
    return found


def merged(pieces: Sequence[Lump]) -> Lump:
    """One rigid body: I = sum(I_cg + m r^2) about the common centre of mass."""
    mass = sum(p.mass for p in pieces)
    centre = sum((p.mass * p.at for p in pieces), np.zeros(2)) / mass
    inertia = sum(p.inertia + p.mass * float((p.at - centre) @ (p.at - centre)) for p in pieces)
    return Lump(mass, inertia, centre)


def _counter(result: Balance, body: str, counter: CounterMass) -> Lump:
    origin = pin(result.linkage, result.tree[body], body).at(result.values)
    return Lump(counter.mass, counter.inertia, origin + counter.position)
