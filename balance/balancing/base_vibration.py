"""Counter-masses of least vibration of the base on the mounts of a rig, as its accelerometers show it.

A mass adds to the wrench on the base and to the inertia that the base carries, the mechanism locked as the motion
starts, both linear in the masses, the base's acceleration therefore not. Masses of any size are descended to from none
and from those of least force; plates are chosen by what is linear near given masses.
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
from ..dynamics.moving_base import MountedBase, Point, displacement_at, locked_inertia
from ..errors import DataError, SizingError
from ..input_files import Table, model_from_table, read_toml
from ..mechanism.mechanism import Mechanism
from .conditions import Conditions
from .objective import Exact, Objective, discs, motion_objective, scaled, unit_masses
from .sizing import Sizing, exact_sizing, site_groups, sizing_of_given, total_limit, upper_limits

UNIT = "m_per_s2"
_STEP = 1e-5
"""Mass that is added and taken off for slopes, of the base's own."""
_MOST = 5_000
"""Evaluations until masses are given up."""
_MOST_SAMPLES = 12_000_000
"""Samples of a motion, times the ways to share plates, of which all are looked at."""
_TOO_MANY, _TOO_MANY_WITHIN = 1, 9
"""What scipy answers then."""
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
        measured = self._respond(self._carried(mechanism), self._wrench(mechanism)) @ self.measured.directions.T
        return self.mean_square(measured) + (self.others.value(mechanism) if self.others else 0.0)

    def mean_square(self, measured: Floats) -> float:
        """Of measured accelerations (n, k) [m/s2]: their share of J."""
        return self.scale * float(np.mean(np.sum(measured**2, axis=1)))

    def measured_with(self, mechanism: Mechanism, changes: Floats) -> Callable[[Floats], Floats]:
        """The measured accelerations (n, k) [m/s2] after so much (c,) [kg] of ``changes`` (c, 10 nb) of a mechanism."""
        wrench, carried = self._wrench(mechanism), self._carried(mechanism)
        others = [replace(mechanism, parameters=mechanism.parameters + one.reshape(-1, 10)) for one in changes]
        pushes = np.array([self._wrench(one) - wrench for one in others])
        inertias = np.array([self._carried(one) - carried for one in others])

        def measured(amounts: Floats) -> Floats:
            pushed = wrench + np.tensordot(amounts, pushes, 1)
            return self._respond(carried + np.tensordot(amounts, inertias, 1), pushed) @ self.measured.directions.T

        return measured

    def around(self, mechanism: Mechanism, sites: Sequence[str]) -> "VibrationObjective":
        """With the factor near the masses that ``mechanism`` has, for those at ``sites``, and their own inertia."""
        changes = np.vstack([unit_masses(mechanism, sites), discs(mechanism, sites)])
        measured, step = self.measured_with(mechanism, changes), _STEP * self.measured.base.mass
        sides = step * np.eye(len(changes))
        rows = np.array([*((measured(one) - measured(-one)) / (2.0 * step) for one in sides), measured(0.0 * sides[0])])
        triangle = np.linalg.qr(rows.reshape(len(rows), -1).T, mode="r") * np.sqrt(self.scale / rows.shape[1])
        per_parameter = triangle[:, :-1] @ np.linalg.pinv(changes.T)
        factor = np.column_stack([per_parameter, triangle[:, -1] - per_parameter @ mechanism.pi])
        return replace(self, factor=np.vstack([factor, self.others.factor]) if self.others else factor)

    def exactly(self, mechanism: Mechanism, sites: Sequence[str]) -> Exact:
        """J of rows of masses, and of inertia, at sites of a mechanism."""
        measured = self.measured_with(mechanism, np.vstack([unit_masses(mechanism, sites), discs(mechanism, sites)]))
        columns: Floats = np.zeros((1, 2 * len(sites)))
        target: Floats = np.zeros(1)
        if self.others:
            columns, target = self.others.system(mechanism, sites)
            columns = np.hstack([columns, self.others.turning(mechanism, sites)])

        def values(masses: Floats, inertias: Floats) -> Floats:
            rows = np.hstack([masses, inertias])
            return np.array([self.mean_square(measured(row)) + np.sum((columns @ row - target) ** 2) for row in rows])

        return values

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
    """The vibration of a rig's base in a motion of ``mechanism``; with ``weights`` of other QUANTITIES, a sum of parts.

    As in ``motion_objective``. Raises SizingError for samples of uneven steps.
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
    others = Objective(scaled(mechanism, parts, shares), "1")
    return replace(alone, unit="1", scale=(weights or {})["vibration"] / whole, others=others)


def least_vibration(
    conditions: Conditions,
    mechanism: Mechanism,
    sites: Sequence[str],
    objective: VibrationObjective,
    limits: Mapping[str, float] | None = None,
    equal: Sequence[Sequence[str]] = (),
    added: float | None = None,
) -> Sizing:
    """Masses at ``sites`` of least vibration nearby, with ``limits``, ``added`` [kg], ``equal`` as in ``exact_sizing``.

    Its objective is the one around them, and it has no bound: the inertia that the base carries changes with the
    masses, so that far from these others might leave less. Raises SizingError where it does not converge.
    """
    from scipy import optimize  # late: plates are looked through without it

    least_force = exact_sizing(
        conditions, mechanism, sites, limits, motion_objective(mechanism, objective.trajectory), equal, added
    )
    groups, upper = site_groups(sites, equal), upper_limits(sites, limits)
    share = np.array([[float(i in group) for group in groups] for i in range(len(sites))])
    exact, still = objective.exactly(mechanism, sites), np.zeros((1, len(sites)))
    unit, whole = objective.measured.base.mass, objective.value(mechanism)

    def value(parts: Floats) -> float:
        return float(exact(unit * (share @ parts)[None], still)[0]) / whole

    starts = [np.zeros(len(groups)), np.array([least_force.counter_masses[group[0]].mass for group in groups]) / unit]
    bounds = [(0.0, float(upper[group].min()) / unit) for group in groups]
    found = [
        optimize.minimize(
            value, at, jac="3-point", method="L-BFGS-B", bounds=bounds,
            options={"ftol": 1e-14, "gtol": 1e-9, "maxfun": _MOST},
        )
        for at in starts
    ]  # fmt: skip
    best, size, total = min(found, key=lambda one: float(one.fun)), share.sum(axis=0), total_limit(added) / unit
    if size @ best.x > total:
        within = optimize.LinearConstraint(size, -np.inf, total)
        found = [
            optimize.minimize(
                value,
                at * min(1.0, total / max(float(size @ at), 1e-300)),
                jac="3-point",
                method="SLSQP",
                bounds=bounds,
                constraints=within,
                options={"ftol": 1e-14, "maxiter": _MOST},
            )
            for at in (*starts, best.x)
        ]
        best = min(found, key=lambda one: float(one.fun))
    if best.status in {_TOO_MANY, _TOO_MANY_WITHIN}:
        raise SizingError(f"counter-masses of least vibration did not converge in {_MOST} evaluations: limit them")
    masses = dict(zip(sites, (unit * (share @ best.x)).tolist(), strict=True))
    return sizing_of_given(
        conditions, mechanism, masses, None, objective.around(mechanism.with_counter_mass(masses), sites)
    )


def least_vibration_from_stock(
    mechanism: Mechanism,
    sites: Sequence[str],
    objective: VibrationObjective,
    ways: int,
    search: Callable[[Objective, Exact | None], Sequence[Sizing]],
) -> list[Sizing]:
    """Sets of plates, best first, of so many ``ways`` to share them; all are looked at where these are few.

    Else those of ``search`` with the objective around the best that it gave before: which is best is proven only where
    the vibration is taken as linear near it, and they have no bound.
    """
    if ways * len(objective.trajectory.time) <= _MOST_SAMPLES:
        sets = search(objective, objective.exactly(mechanism, sites))
        return [replace(one, objective=objective.around(one.after, sites)) for one in sets]
    seen: list[list[float]] = []
    while True:
        sets = sorted(search(objective, None), key=lambda one: one.root_mean_squares()[1])
        masses = [c.mass for c in sets[0].counter_masses]
        if masses in seen:
            return [replace(one, bound=None) for one in sets]
        seen.append(masses)
        objective = objective.around(sets[0].after, sites)
