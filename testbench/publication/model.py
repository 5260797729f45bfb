"""What the base still feels once the force is balanced: six parameters with a physical meaning each.

Amplitudes are those of the base acceleration along an axis k, told as the mass [kg] whose shaking force at the same
peak acceleration a would cause them: the base's own gain cancels. They differ in phase and frequency: squares add.

    without^2 = F^2 + R^2 + G^2 + L^2          F: shaking force without counter-masses
    with^2    = D^2 + R^2 + G^2 + L'^2 + C^2   D: shaking force that the built set leaves
    R  = m_res                       what no counter-mass removes, whatever the payload: drives, play, structure
    G  = f a F                       links and frame give way in proportion to the load and the acceleration
    C  = e_k T                       couples of the counter-masses, T their own force, planes beside the arms
    L  = l M across the motion, else 0   the shaking moment M turns the base; L' with the counter-masses' inertia
    reduction = 100 (1 - with / without)

F, D, T, M are computed from the mechanism (``cases``); m_res, f, l, e_x, e_y, e_z are calibrated.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .cases import AXES, Cases


@dataclass(frozen=True)
class Parameter:
    """A calibrated quantity and the bounds between which every value counts as equally likely beforehand."""

    name: str
    unit: str
    """As a suffix of a key; empty for a pure number."""
    low: float
    high: float
    meaning: str

    @property
    def key(self) -> str:
        """Name and unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name


def _couple(axis: str) -> Parameter:
    meaning = (
        f"couples of the counter-masses felt along {axis}, as a share of what their own force would cause: the "
        "distance of their plane from the arms' by that of the arms' plane from the base's centre"
    )
    return Parameter(f"couple_share_{axis}", "", 0.0, 1.0, meaning)


PARAMETERS = (
    Parameter(
        "residual_mass",
        "kg",
        0.0,
        4.0,
        "unbalanced mass that no counter-mass removes, whatever the payload: drives, play",
    ),
    Parameter(
        "flexing",
        "s2_per_m",
        0.0,
        0.05,
        "links and frame give way: share of the load by which, by the peak acceleration",
    ),
    Parameter(
        "moment_weight", "per_m", 0.0, 4.0, "force that is felt across the motion like a shaking moment of 1 N m"
    ),
    *map(_couple, AXES),
)
"""What is common to all axes first, then the couples axis by axis."""
NAMES = tuple(p.name for p in PARAMETERS)
COMMON = tuple(p for p in PARAMETERS if not p.name.startswith("couple_share"))
SCATTER = Parameter("scatter", "points", 1.0, 20.0, "standard deviation of a printed number about the model")
"""Calibrated too, but no mechanics; its logarithm counts as equally likely."""


def reductions(values: Mapping[str, Floats | float], cases: Cases) -> Floats:
    """Reductions [%] by the law above, (..., n); each parameter (...) by its name, those left out being zero."""

    def of(name: str) -> Floats:
        return np.asarray(values.get(name, 0.0))[..., None]

    without, balanced = felt(of("residual_mass"), of("flexing"), of("moment_weight"), cases)
    shares = sum(of(f"couple_share_{axis}") * (cases.axis == axis) for axis in AXES)
    return percent(without, balanced + (shares * cases.mechanics[:, 2]) ** 2)


def felt(residual: Floats, flexing: Floats, moment_weight: Floats, cases: Cases) -> tuple[Floats, Floats]:
    """Squares of what is felt without counter-masses, and with them but for their couples, (..., n) [kg2].

    For m_res [kg], f [s2/m] and l [1/m] that broadcast to (..., n).
    """
    force, left, _, moment, moment_with = cases.mechanics.T
    stays = residual**2 + (flexing * cases.peak_acceleration * force) ** 2
    turning = (moment_weight * cases.across) ** 2
    return force**2 + stays + turning * moment**2, left**2 + stays + turning * moment_with**2


def percent(without: Floats, balanced: Floats) -> Floats:
    """Reduction [%] of the square roots."""
    return 100.0 * (1.0 - np.sqrt(balanced / without))
