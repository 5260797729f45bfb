"""Three methods from the equations of records to base parameters, at one cut-off and delay.

``ls``: least squares, both sides low-passed. ``iv``: the same with instruments, the columns of W along the motion that
torque and model make instead of the recorded one, so that noise of the motion does not pull towards zero. ``oe``: least
squares of the deviation of that simulated motion from the recorded one.

The recorded motion q_m is simulated anew: M(q) q'' + h(q, q') = tau, with a weak pull back to it of natural frequency
w and damping z, M (w^2 (q_m - q) + 2 z w (q_m' - q')). To first order in the deviation e = q - q_m that is a linear
equation with time-varying coefficients,

    M e'' + (C + 2 z w M) e' + (K + w^2 M) e = tau - W pi,    C = d(W pi)/dv, K = d(W pi)/dq,

linear in pi as well. Above w the recorded accelerations drop out: e'' takes back what noise they carry. So q_m + e is a
motion that torque and model make, fit for instruments, and e is the output error (compare Gautier, Janot, Vandanjon,
IEEE Trans. Control Syst. Technol. 21, 2013, whose pull is the machine's own controller).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from balance.arrays import Floats
from balance.closure import Trajectory
from balance.dynamics.regressor import driven_torque_regressor, joint_friction_regressor
from balance.estimation.base_parameters import BaseParameters, base_parameters
from balance.estimation.identifiability import Identifiability
from balance.estimation.regression import RegressionRecord, least_squares
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics.smoothing_and_derivatives import Rates
from .regression_equations import NEARBY, RecordEquations, RegressionEquations, path_of

Method = Literal["ls", "iv", "oe"]
METHODS: tuple[Method, ...] = ("ls", "iv", "oe")
NAMES = {"ls": "least squares", "iv": "instrumental variables", "oe": "output error"}
BLOCK_PERIODS = {"ls": 1.0, "iv": 1.0, "oe": 1.5}
"""Length of the blocks that are left out in turn for an interval, in periods of the cut-off: beyond half a period
what a low-pass leaves of white noise is no longer correlated; deviations remember longer."""
PULL = 0.25
"""Frequency of the pull back to the recorded motion, in cut-offs: well below what the comparison looks at."""
ROUNDS = 2
"""Of parameters -> coefficients of the deviation -> parameters, for the output error."""
DAMPING = 0.7
"""Of the pull."""
_BOUND = 1e12
"""Of deviations and their rates [SI], beyond which nothing is simulated."""


class NotSimulated(AnalysisError):
    """Parameters with which no motion can be simulated: an inertia that is not positive, a deviation without bounds."""


@dataclass(frozen=True)
class Deviation:
    """The linear equation of one record's deviation, about its motion and some parameters."""

    inertia: Floats
    """M, (samples, joints, joints)."""
    damping: Floats
    """C, (samples, joints, joints)."""
    stiffness: Floats
    """K, (samples, joints, joints)."""
    step: float
    """Between samples [s]."""

    @classmethod
    def of(cls, part: RecordEquations, mechanism: Mechanism, parameters: Floats) -> "Deviation":
        """About the motion of a record; ``parameters`` over all of them, (p,) [SI].

        Slopes of W pi by central differences. Dry friction is taken as a function of the recorded speed: its jump has
        no slope.
        """
        smooth = np.where([name.startswith("coulomb[") for name in part.names], 0.0, parameters)
        smooth[: len(part.record.mounted)] += part.record.mounted
        count = len(mechanism.pi)

        def torque(motion: Rates, path: Trajectory) -> Floats:
            bodies = driven_torque_regressor(mechanism, path.q, path.v, path.a, path.per_drive) @ smooth[:count]
            terms = joint_friction_regressor(mechanism.driven, motion.v, motion.a)[0]
            return np.asarray(bodies + terms @ smooth[count : count + terms.shape[2]])

        inertia, damping, stiffness = (
            np.stack([(torque(*more) - torque(*less)) / (2.0 * NEARBY) for more, less in part.nearby[of]], axis=2)
            for of in "avq"
        )
        return cls(inertia, damping, stiffness, part.record.grid.step)

    def refuse_negative_inertia(self) -> None:
        """Raise NotSimulated where the inertia is not positive definite."""
        if not np.linalg.eigvalsh(self.inertia + self.inertia.transpose(0, 2, 1)).min() > 0.0:
            raise NotSimulated("the inertia that the torques show is not positive: no motion can be simulated with it")

    def segment(self, samples: slice) -> "Deviation":
        """Of some of the samples."""
        return Deviation(self.inertia[samples], self.damping[samples], self.stiffness[samples], self.step)

    @property
    def least_pull_hz(self) -> float:
        """Frequency of the pull that is stiff enough nine tenths of the time, where the weight would topple it."""
        lowest = np.linalg.eigvals(np.linalg.solve(self.inertia, self.stiffness)).real.min(axis=1)
        return float(np.sqrt(max(-np.percentile(lowest, 10.0), 0.0)) / (2.0 * np.pi))

    def simulate(self, load: Floats, pull_hz: float) -> Rates:
        """Deviations (samples, joints, k) and their rates for the right-hand sides ``load`` (samples, joints, k).

        From rest, by the trapezoidal rule. ``pull_hz`` is the frequency of the pull [Hz]. Raises NotSimulated.
        """
        joints, count = load.shape[1:]
        system, pushed = self._system(load, pull_hz)
        with np.errstate(over="ignore", invalid="ignore"):
            state = _integrated(system, pushed, self.step, np.zeros((2 * joints, count)))
            rates = _bounded(system @ state + pushed)
        return Rates(state[:, :joints], state[:, joints:], rates[:, joints:])

    def from_any_state(self, load: Floats) -> tuple[Floats, Floats]:
        """Deviations without a pull, from rest for ``load`` (samples, joints, k), and free ones from unit states.

        (samples, joints, k) and (samples, joints, 2 joints). Raises NotSimulated.
        """
        joints, count = load.shape[1:]
        system, pushed = self._system(np.pad(load, ((0, 0), (0, 0), (0, 2 * joints))), 0.0)
        start = np.hstack([np.zeros((2 * joints, count)), np.eye(2 * joints)])
        with np.errstate(over="ignore", invalid="ignore"):
            state = _bounded(_integrated(system, pushed, self.step, start))
        return state[:, :joints, :count], state[:, :joints, count:]

    def _system(self, load: Floats, pull_hz: float) -> tuple[Floats, Floats]:
        """A and b of x' = A x + b, x the deviations and their rates."""
        w = 2.0 * np.pi * pull_hz
        joints = load.shape[1]
        inverse = np.linalg.inv(self.inertia)
        system = np.zeros((len(load), 2 * joints, 2 * joints))
        system[:, :joints, joints:] = np.eye(joints)
        system[:, joints:, :joints] = -inverse @ self.stiffness - w * w * np.eye(joints)
        system[:, joints:, joints:] = -inverse @ self.damping - 2.0 * DAMPING * w * np.eye(joints)
        return system, np.concatenate([np.zeros_like(load), inverse @ load], axis=1)


def _integrated(system: Floats, pushed: Floats, step: float, start: Floats) -> Floats:
    """x' = A x + b from x = ``start``: (1 - h A1 / 2) x1 = (1 + h A0 / 2) x0 + h (b0 + b1) / 2."""
    unit = np.eye(system.shape[1])
    inverse = np.linalg.inv(unit - 0.5 * step * system[1:])
    carried = inverse @ (unit + 0.5 * step * system[:-1])
    added = 0.5 * step * inverse @ (pushed[1:] + pushed[:-1])
    state = np.zeros_like(pushed)
    state[0] = start
    for i in range(len(carried)):
        state[i + 1] = carried[i] @ state[i] + added[i]
    return state


def _bounded(values: Floats) -> Floats:
    if not np.abs(values).max() < _BOUND:
        raise NotSimulated("a simulation with the parameters that the torques show leaves every bound")
    return values


def allowed(equations: RegressionEquations) -> tuple[Method, ...]:
    """Methods for these rows: least squares alone for forces alone, no output error where forces count too."""
    record = equations.records[0]
    if not record.torque.shape[1]:
        return ("ls",)
    return METHODS if record.loads is None else ("ls", "iv")


@dataclass(frozen=True)
class Methods:
    """The least squares of each method from what records show at one cut-off and delay."""

    equations: RegressionEquations
    mechanism: Mechanism
    identifiable: Identifiability
    delay: float
    smooth: Floats | None = None
    """Low-passed base columns where they are at hand, (n, rows, r)."""

    def identified(self, method: Method) -> BaseParameters:
        """Base parameters with intervals.

        Raises AnalysisError for a method that needs torques where there are none, NotSimulated for one that simulates.
        """
        blocks = self.equations.blocks(BLOCK_PERIODS[method] / self.equations.cutoff)
        return base_parameters(replace(self._record(method), blocks=blocks), self.identifiable)

    def held_out(self, method: Method, training: Sequence[Floats]) -> Floats:
        """Base parameters from each choice of samples that is marked with one, (n, 1) each, (choices, r) [SI]."""
        return np.array([_values(self._record(method, marked), marked) for marked in training])

    @cached_property
    def plain(self) -> RegressionRecord:
        """Of least squares."""
        columns = self.equations.low_passed_columns(self._pivots) if self.smooth is None else self.smooth
        return self._of(columns, self.equations.low_passed_torque(self.delay))

    def _record(self, method: Method, training: Floats | float = 1.0) -> RegressionRecord:
        """What a method solves, instruments and models by the samples of ``training`` (n, 1)."""
        if method not in allowed(self.equations):
            raise AnalysisError(
                f"method {method!r} is not for these rows: oe takes torques alone, iv torques among others; expected "
                f"{' or '.join(allowed(self.equations))}"
            )
        if method == "ls":
            return self.plain
        if method == "oe":
            return self._output_error
        base = _values(self.plain, training)
        pairs = zip(self.equations.parts, self._models, strict=True)
        return replace(self.plain, instruments=np.concatenate([self._instruments(*pair, base) for pair in pairs]))

    @property
    def _pivots(self) -> list[int]:
        return list(self.identifiable.pivots)

    def _of(self, columns: Floats, readings: Floats) -> RegressionRecord:
        used = self.equations.moving[:, : readings.shape[1]]
        return RegressionRecord.of(columns, readings, np.zeros(len(readings), dtype=np.intp), used=used)

    @cached_property
    def _models(self) -> list[Deviation]:
        """Of each record, about the parameters of least squares."""
        return self._about(_values(self.plain))

    def _about(self, base: Floats) -> list[Deviation]:
        """About parameters (p,) that make the same rows as the base parameters (r,)."""
        return [Deviation.of(p, self.mechanism, self.identifiable.over_all(base)) for p in self.equations.parts]

    @cached_property
    def _output_error(self) -> RegressionRecord:
        """About parameters of the output error itself, found by repetition from those of least squares."""
        found = self._deviations(self._models)
        for _ in range(ROUNDS):
            found = self._deviations(self._about(_values(found)))
        return found

    def _deviations(self, models: Sequence[Deviation]) -> RegressionRecord:
        """Deviations that single parameters make explain the deviation that the torques make."""
        parts = []
        for part, model in zip(self.equations.parts, models, strict=True):
            columns, torque = self._torques(part)
            right = np.concatenate([columns, torque[:, :, None]], axis=2) * part.valid[:, :, None]
            parts.append(part.inside(_simulated(part, model, right).q))
        made = np.concatenate(parts)
        return self._of(made[:, :, :-1], made[:, :, -1])

    def _instruments(self, part: RecordEquations, model: Deviation, base: Floats) -> Floats:
        """Low-passed base columns along the motion that ``base`` (r,) and the torques make, without its ends."""
        columns, torque = self._torques(part)
        away = _simulated(part, model, ((torque - columns @ base) * part.valid)[:, :, None])
        motion = Rates(*(getattr(part.motion, x) + getattr(away, x)[:, :, 0] for x in "qva"))
        path = path_of(part.record, self.mechanism, motion, part.path)
        return part.inside(part.low_passed_columns(part.regressor(motion, path)[:, :, self._pivots]))

    def _torques(self, part: RecordEquations) -> tuple[Floats, Floats]:
        """Base columns and measured values of a record's torques, (samples, joints, r) and (samples, joints)."""
        joints = part.record.torque.shape[1]
        return part.whole[:, :joints, self._pivots], part.measured(self.delay)[:, :joints]


def _values(record: RegressionRecord, training: Floats | float = 1.0) -> Floats:
    """Base parameters (r,) from the samples that ``training`` (n, 1) marks."""
    return least_squares(replace(record, used=record.used * training))


def _simulated(part: RecordEquations, model: Deviation, load: Floats) -> Rates:
    model.refuse_negative_inertia()
    return model.simulate(load, max(PULL * part.cutoff, model.least_pull_hz))
