"""What the base still feels once the force is balanced: six parameters with a physical meaning each.

Amplitudes are those of the base acceleration along an axis k, as the mass [kg] whose shaking force at the same peak
acceleration a would cause them: the base's own gain cancels. They differ in phase and frequency: squares add.

    without^2 = F^2 + R^2 + G^2 + L^2          F: shaking force without counter-masses
    with^2    = D^2 + R^2 + G^2 + L'^2 + C^2   D: shaking force that the built set leaves
    R  = m_res                       what no counter-mass removes, whatever the payload: drives, play, structure
    G  = f a F                       compliance: links and frame yield in proportion to the load and the acceleration
    C  = e_k T                       couples of the counter-masses, T their own force, planes beside the arms
    L  = l M across the motion, else 0   the shaking moment M turns the base; L' with the counter-masses' inertia
    reduction = 100 (1 - with / without)

F, D, T, M are computed from the mechanism, nothing of them is typed in; m_res, f, l, e_x, e_y, e_z are calibrated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.closure import Closure, Trajectory
from balance.dynamics.inverse_dynamics import Response, simulate
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion import DEFAULT_RATE_HZ
from balance.motion.motion_files import load_motion
from balance.units import G0
from testbench.campaign_plan import Plan, PlannedRun
from testbench.errors import AnalysisError
from testbench.published_tables import Published
from testbench.simulator.run import payload_body

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Mechanics:
    """Loads of the moving mechanism on its base in one condition, by its peak acceleration: kg and kg m.

    A force of a x 1 kg has the amplitude 1 kg here; amplitudes are largest magnitudes over the motion.
    """

    force_without: float
    """Shaking force without counter-masses [kg]."""
    force_left: float
    """Shaking force that the built counter-masses leave [kg]."""
    force_taken: float
    """Force of the counter-masses themselves, with - without [kg]."""
    moment_without: float
    """Shaking moment about the base frame's origin without counter-masses [kg m]."""
    moment_with: float
    """The same with counter-masses, their own inertia included [kg m]."""


@dataclass(frozen=True)
class Cases:
    """Printed numbers, one an entry, with their conditions and mechanics; all arrays (n,)."""

    payload_kg: Floats
    """As built; the label of the table is this, rounded to two decimals."""
    motion: NDArray[np.str_]
    peak_acceleration: Floats
    """[m/s2]"""
    axis: NDArray[np.str_]
    printed: Floats
    """Reduction of the base acceleration's amplitude, as printed [%]."""
    mechanics: Floats
    """The five values of Mechanics, in its order, (n, 5) [kg, kg m]."""

    def where(self, chosen: NDArray[np.bool_]) -> "Cases":
        """The entries that are chosen, (n,)."""
        return Cases(
            self.payload_kg[chosen],
            self.motion[chosen],
            self.peak_acceleration[chosen],
            self.axis[chosen],
            self.printed[chosen],
            self.mechanics[chosen],
        )

    @property
    def payloads(self) -> list[float]:
        """Distinct payloads, the lightest first [kg]."""
        return sorted(set(self.payload_kg.tolist()))

    @property
    def across(self) -> NDArray[np.bool_]:
        """Whether the axis is not the one that the platform moves along."""
        return self.axis != self.motion

    @property
    def groups(self) -> Floats:
        """1 where a number belongs to a group of one payload, motion and axis, else 0, (n, groups)."""
        of = list(zip(self.payload_kg, self.motion, self.axis, strict=True))
        return np.array([[float(each == group) for group in dict.fromkeys(of)] for each in of])

    def of_payload(self, payload_kg: float) -> "Cases":
        """The entries of one payload."""
        return self.where(self.payload_kg == payload_kg)

    def without_payload(self, payload_kg: float) -> "Cases":
        """The entries of all other payloads."""
        return self.where(self.payload_kg != payload_kg)


def cases(published: Published, plan: Plan) -> Cases:
    """Every printed number that the plan has the condition of, with counter-masses as built.

    Raises AnalysisError where a printed condition is not in the plan, or one payload alone is.
    """
    mechanism = load_mechanism(plan.mechanism)
    closure = Closure(mechanism)

    @cache
    def followed(motion: str, peak: float) -> Trajectory:  # of any payload
        return closure.follow(load_motion(motion).with_peak_acceleration(peak).sample(DEFAULT_RATE_HZ))

    rows = []
    for run in plan.runs():
        payload, peak = run.payload, run.peak_acceleration
        if not run.counter_masses or run.repeat > 1 or payload is None or peak is None:
            continue
        values = {axis: published.reduction(payload, run.motion, peak / G0, axis) for axis in AXES}
        if None not in values.values():
            loaded = mechanism.with_payload({payload_body(mechanism): payload})
            loads = _mechanics(loaded, run.counter_masses, followed(run.motion, peak), peak)
            rows += [(run, axis, value, loads) for axis, value in values.items()]
    if len(rows) != sum(map(len, published.rows.values())):
        raise AnalysisError(
            f"{published.name}: {sum(map(len, published.rows.values()))} printed numbers, of which the plan has the "
            f"conditions of {len(rows)}: expected all; give the plan of these tests, --plan FILE"
        )
    found = _stacked(rows)
    if len(found.payloads) < 2:
        raise AnalysisError(f"{published.name}: one payload alone: expected one to calibrate on and others to predict")
    return found


def _stacked(rows: list[tuple[PlannedRun, str, float | None, Mechanics]]) -> Cases:
    return Cases(
        np.array([run.payload for run, *_ in rows]),
        np.array([run.motion for run, *_ in rows]),
        np.array([run.peak_acceleration for run, *_ in rows]),
        np.array([axis for _, axis, *_ in rows]),
        np.array([value for *_, value, _ in rows], dtype=float),
        np.array([list(vars(loads).values()) for *_, loads in rows]),
    )


def _mechanics(loaded: Mechanism, counter_masses: dict[str, float], trajectory: Trajectory, peak: float) -> Mechanics:
    bare, balanced = (simulate(m, trajectory) for m in (loaded, loaded.with_counter_mass(counter_masses)))
    return _by_acceleration(bare, balanced, peak)


def _by_acceleration(bare: Response, balanced: Response, peak: float) -> Mechanics:
    loads = (bare.force, balanced.force, balanced.force - bare.force, bare.moment, balanced.moment)
    return Mechanics(*(float(np.linalg.norm(load, axis=1).max()) / peak for load in loads))


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
DISCREPANCY = Parameter(
    "discrepancy",
    "points",
    0.0,
    20.0,
    "the model's own error: standard deviation of what the numbers of one payload, motion and axis are off in common",
)
"""Calibrated too; every value counts as equally likely, for with few groups a logarithm would favour none at all
(Gelman 2006, Prior distributions for variance parameters in hierarchical models, Bayesian Analysis 1).
"""


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
