"""Counter-masses of least vibration of the base on the mounts of a rig, as its accelerometers show it.

A mass adds to the wrench on the base and to the inertia that the base carries, the mechanism locked as the motion
starts. Near given masses the base's acceleration x'' is linear in them: a kilogram at a site, which adds dw to the
wrench and dM to the inertia, changes x'' by the base's response to dw - dM x''. Least squares of that, repeated around
what they give, are the method of Gauss and Newton; they start from no masses and from those of least force.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from .. import datasets
from ..arrays import Floats
from ..closure import Trajectory
from ..dynamics.inverse_dynamics import simulate
from ..dynamics.moving_base import MountedBase, Point, displacement_at, locked_inertia, times
from ..errors import DataError, SizingError
from ..input_files import Table, model_from_table, read_toml
from ..mechanism.mechanism import Mechanism
from .conditions import Conditions
from .objective import Objective, motion_objective, scaled
from .sizing import Sizing, sizing_of_given

UNIT = "m_per_s2"
_ROUNDS = 50
_SAME = 1e-9
"""Change of the masses, relative to the largest, at which they are found."""
_HALVINGS = 30
_EVEN = 1e-6
"""Difference between steps of time, relative to one, that is rounding."""


@dataclass(frozen=True)
class MeasuredBase:
    """The base of a rig, and what its accelerometers measure of it."""

    base: MountedBase
    directions: Floats
    """A (k, 6) [-, m] with A x'' the accelerations that are measured, a row a channel."""
    left_out: tuple[str, ...]
    """Keys of the rig's ``[bench]`` that count for its vibration and are not known here, such as ``modes``."""
    mechanism: str = ""
    """Name or file of the mechanism on it, as the rig states it; empty where it states none."""


class _Accelerometer(Table):
    """What of an accelerometer counts here."""

    channels: dict[Literal["x", "y", "z"], str] = Field(min_length=1)
    position: Point


def load_measured_base(rig: str | Path) -> MeasuredBase:
    """The base of a rig, by a shipped one's name or its file.

    Raises DataError without a stated base, or an accelerometer on it.
    """
    path = datasets.find_dataset(rig, "rigs", ".toml")
    tables = read_toml(path)
    if not tables.get("bench"):
        raise DataError(
            f"{path.name}: no [bench]: expected the base whose vibration is made small; add its mass, centre, inertia "
            "and [[bench.mounts]] (`testbench schema rig`)"
        )
    bench, sensors = (_table(tables.get(key, {}), path.name, key) for key in ("bench", "sensors"))
    own = {key: value for key, value in bench.items() if key in MountedBase.model_fields}
    rows = []
    for name in sensors:
        stated = _table(sensors[name], path.name, f"sensors.{name}")
        if stated.get("kind") == "accelerometer" and stated.get("attached_to", "base") == "base":
            known = {key: stated[key] for key in _Accelerometer.model_fields if key in stated}
            found = model_from_table(_Accelerometer, known, f"{path.name}: sensors.{name}")
            rows += [displacement_at(np.array(found.position))["xyz".index(axis)] for axis in found.channels]
    if not rows:
        raise DataError(f"{path.name}: no accelerometer is attached to the base: there is no vibration to make small")
    unlike = {"settling", *own}
    left_out = tuple(key for key, value in bench.items() if key not in unlike and value and value != "locked")
    named = str(tables.get("mechanism", ""))
    return MeasuredBase(model_from_table(MountedBase, own, f"{path.name}: bench"), np.array(rows), left_out, named)


def _table(value: Any, file: str, key: str) -> Mapping[str, Any]:  # noqa: ANN401
    if not isinstance(value, dict):
        raise DataError(f"{file}: {key}: expected a table")
    return value


@dataclass(frozen=True)
class VibrationObjective(Objective):
    """Mean over a motion of the sum of squares of the measured accelerations; ``factor`` holds near some masses."""

    measured: MeasuredBase
    trajectory: Trajectory
    scale: float
    """1, or in a weighted objective the weight of the vibration by its mean square without counter-masses [s4/m2]."""
    others: Objective | None
    """Of a weighted objective: force, moment and torque."""

    def value(self, mechanism: Mechanism) -> float:
        """J of a mechanism of the same kind with other masses, exactly [m2/s4, or 1 with others]."""
        squares = np.sum((self._base_acceleration(mechanism) @ self.measured.directions.T) ** 2, axis=1)
        return self.scale * float(np.mean(squares)) + (self.others.value(mechanism) if self.others else 0.0)

    def around(self, mechanism: Mechanism, sites: Sequence[str]) -> "VibrationObjective":
        """With the factor near the masses that ``mechanism`` has, for those at ``sites``."""
        added = np.array([mechanism.with_counter_mass({name: 1.0}).pi - mechanism.pi for name in sites])
        moved, carried = self._base_acceleration(mechanism), self._carried(mechanism)
        wrench, columns = self._wrench(mechanism), []
        for name in sites:
            heavier = mechanism.with_counter_mass({name: 1.0})
            inertia = self._carried(heavier) - carried
            pushed = self._wrench(heavier) - wrench - times(inertia, moved)
            columns.append(self._respond(carried, pushed) @ self.measured.directions.T)
        rows = np.array([one.ravel() for one in [*columns, moved @ self.measured.directions.T]]).T
        triangle = np.asarray(np.linalg.qr(rows, mode="r")) * np.sqrt(self.scale / len(moved))
        per_parameter = triangle[:, :-1] @ np.linalg.pinv(added.T)
        factor = np.column_stack([per_parameter, triangle[:, -1] - per_parameter @ mechanism.pi])
        return replace(self, factor=np.vstack([factor, self.others.factor]) if self.others else factor)

    def _base_acceleration(self, mechanism: Mechanism) -> Floats:
        return self._respond(self._carried(mechanism), self._wrench(mechanism))

    def _carried(self, mechanism: Mechanism) -> Floats:
        return locked_inertia(mechanism, self.trajectory.q[0])

    def _wrench(self, mechanism: Mechanism) -> Floats:
        response = simulate(mechanism, self.trajectory)
        return np.hstack([response.force, response.moment])

    def _respond(self, carried: Floats, wrench: Floats) -> Floats:
        """Acceleration of the base (n, 6) [m/s2, rad/s2] that carries an inertia (6, 6), under a wrench (n, 6)."""
        step = float(self.trajectory.time[1] - self.trajectory.time[0])
        return self.measured.base.elastic(carried).respond(wrench, step).acceleration


def vibration_objective(
    mechanism: Mechanism, trajectory: Trajectory, measured: MeasuredBase, weights: Mapping[str, float] | None = None
) -> VibrationObjective:
    """The vibration of a rig's base in a motion of ``mechanism``; weighed, as ``combined`` does, against QUANTITIES.

    ``weights`` are of the vibration and the others by name. Raises SizingError for samples of uneven steps.
    """
    steps = np.diff(trajectory.time)
    if len(steps) < 2 or np.ptp(steps) > _EVEN * steps[0]:
        raise SizingError("vibration needs samples at equal steps of time: resample the motion")
    nothing = np.zeros((1, mechanism.pi.size + 1))
    alone = VibrationObjective(nothing, UNIT, measured, trajectory, 1.0, None)
    shares = {name: weight for name, weight in (weights or {}).items() if name != "vibration"}
    if not shares:
        return alone
    parts = [motion_objective(mechanism, trajectory, {name: 1.0}) for name in shares]
    whole = alone.value(mechanism)
    if not whole > 0.0:
        raise SizingError(f"{mechanism.name} does not shake the base in this motion: there is nothing to weigh against")
    others = Objective(scaled(mechanism, parts, list(shares.values()), list(shares)), "1")
    return replace(alone, unit="1", scale=(weights or {})["vibration"] / whole, others=others)


def least_vibration(
    conditions: Conditions,
    mechanism: Mechanism,
    sites: Sequence[str],
    objective: VibrationObjective,
    size: Callable[[Objective], Sizing],
) -> Sizing:
    """Masses at ``sites`` of least vibration nearby; ``size`` gives those of least value of an objective it is given.

    Its objective is the one around them, and it has no bound: the inertia that the base carries changes with the
    masses, so that far from these others might leave less. Raises SizingError where it does not converge.
    """
    least_force = size(motion_objective(mechanism, objective.trajectory))
    starts = [np.zeros(len(sites)), np.array([c.mass for c in least_force.counter_masses])]
    found = [_descended(mechanism, sites, objective, size, start) for start in starts]
    masses, near, _ = min(found, key=lambda one: one[2])
    return sizing_of_given(conditions, mechanism, dict(zip(sites, masses.tolist(), strict=True)), None, near)


def least_vibration_from_stock(
    sites: Sequence[str], objective: VibrationObjective, search: Callable[[Objective], Sequence[Sizing]]
) -> list[Sizing]:
    """Sets of plates, best first: those of ``search`` with the objective around the best that it gave before.

    Which is best is proven only where the vibration is taken as linear near it: they have no bound.
    """
    seen: list[list[float]] = []
    while True:
        sets = sorted(search(objective), key=lambda one: one.root_mean_squares()[1])
        masses = [c.mass for c in sets[0].counter_masses]
        if masses in seen:
            return [replace(one, bound=None) for one in sets]
        seen.append(masses)
        objective = objective.around(sets[0].after, sites)


def _descended(
    mechanism: Mechanism,
    sites: Sequence[str],
    objective: VibrationObjective,
    size: Callable[[Objective], Sizing],
    masses: Floats,
) -> tuple[Floats, VibrationObjective, float]:
    """Masses (sites,) [kg], the objective around them, and its value, by steps that are halved until it falls."""

    def mounted(masses: Floats) -> Mechanism:
        return mechanism.with_counter_mass(dict(zip(sites, masses.tolist(), strict=True)))

    value = objective.value(mounted(masses))
    for _ in range(_ROUNDS):
        objective = objective.around(mounted(masses), sites)
        step = np.array([c.mass for c in size(objective).counter_masses]) - masses
        for _ in range(_HALVINGS):
            trial = objective.value(mounted(masses + step))
            if trial <= value or np.abs(step).max() <= _SAME * np.abs(masses).max():
                break
            step = 0.5 * step
        if trial > value or np.abs(step).max() <= _SAME * np.abs(masses).max():
            return masses, objective, value
        masses, value = masses + step, trial
    raise SizingError(f"counter-masses of least vibration did not converge in {_ROUNDS} rounds")
