"""The printed numbers with what the mechanism's model says of their conditions: nothing of it is typed in."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats
from balance.closure import Closure
from balance.dynamics.inverse_dynamics import Response, simulate
from balance.loading.loading import load_mechanism
from balance.mechanism import Mechanism
from balance.motion import DEFAULT_RATE_HZ
from balance.motion.motion_files import load_motion
from balance.quantities import G0

from ..bench.run import payload_body
from ..errors import AnalysisError
from ..plan import Plan, PlannedRun
from ..published import Published

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
    rows = []
    for run in plan.runs():
        if not run.counter_masses or run.repeat > 1:
            continue
        acceleration_g = run.peak_acceleration / G0
        values = {axis: published.reduction(run.payload, run.motion, acceleration_g, axis) for axis in AXES}
        if None not in values.values():
            loads = _mechanics(mechanism, run)
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


def _mechanics(mechanism: Mechanism, run: PlannedRun) -> Mechanics:
    loaded = mechanism.with_payload({payload_body(mechanism): run.payload})
    samples = load_motion(run.motion).with_peak_acceleration(run.peak_acceleration).sample(DEFAULT_RATE_HZ)
    trajectory = Closure(loaded).follow(samples)
    bare, balanced = (simulate(m, trajectory) for m in (loaded, loaded.with_counter_mass(run.counter_masses)))
    return _by_acceleration(bare, balanced, run.peak_acceleration)


def _by_acceleration(bare: Response, balanced: Response, peak: float) -> Mechanics:
    loads = (bare.force, balanced.force, balanced.force - bare.force, bare.moment, balanced.moment)
    return Mechanics(*(float(np.linalg.norm(load, axis=1).max()) / peak for load in loads))
