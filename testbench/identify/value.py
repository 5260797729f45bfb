"""Combinations of parameters as identified, and what their units are."""

from collections.abc import Mapping
from dataclasses import dataclass

from balance.arrays import Floats
from balance.dynamics.joint_friction import TERMS
from balance.estimation.estimate import Estimate
from balance.mechanism import Mechanism

from ..wrench import COMPONENTS

_TERM_UNITS = {
    "coulomb": ("N", "N m"), "viscous": ("N s/m", "N m s"), "offset": ("N", "N m"), "armature": ("kg", "kg m^2"),
}  # fmt: skip
"""Of the terms of a joint that slides, and of one that turns."""


@dataclass(frozen=True)
class Value:
    """A combination of parameters with an interval that contains what other choices of method would have given."""

    name: str
    unit: str
    estimate: Estimate
    """At the chosen cut-off and delay; its interval is statistical alone."""
    variants: Mapping[str, float]
    """The same by other choices: half and double the cut-off, no delay, the other methods."""
    in_file: float
    """What the mechanism's file says."""
    one_sided: Mapping[str, float]
    """With torque and rates smoothed but positions as recorded: often done, biased, for comparison only."""

    @property
    def value(self) -> float:
        """At the chosen cut-off and delay [SI]."""
        return self.estimate.value

    @property
    def interval(self) -> tuple[float, float]:
        """The range of all variants, widened on both sides by half of the statistical 95 % interval."""
        return self.estimate.containing([*self.variants.values()]).interval()


@dataclass(frozen=True)
class CounterMassValue:
    """A counter-mass that would balance the mechanism as identified."""

    site: str
    position: Floats
    """Of the site in its body's frame, (3,) [m]."""
    mass: Value
    first_moment: Value
    """Mass times the distance of the site from the joint [kg m]."""


def unit_of(mechanism: Mechanism, parameter: str) -> str:
    """Unit of a parameter by name."""
    kind, _, of = parameter.rstrip("]").partition("[")
    if kind in TERMS and of in COMPONENTS:
        return "N" if of.startswith("F") else "N m"
    if kind in TERMS:
        place = mechanism.coordinate_index(of)
        return _TERM_UNITS[kind][mechanism.tree.joints[place].revolute]
    return "kg" if kind == "m" else "kg m" if kind.startswith("mc") else "kg m^2"
