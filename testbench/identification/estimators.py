"""How far a mechanism with given parameters would depart from its recorded motion, were it driven by the torques.

The recorded motion q_m is simulated anew: M(q) q'' + h(q, q') = tau, with a weak pull back to it of natural frequency
w and damping z, M (w^2 (q_m - q) + 2 z w (q_m' - q')). To first order in the deviation e = q - q_m that is a linear
equation with time-varying coefficients,

    M e'' + (C + 2 z w M) e' + (K + w^2 M) e = tau - W pi,    C = d(W pi)/dv, K = d(W pi)/dq,

linear in pi as well. Above w the recorded accelerations drop out: e'' takes back what noise they carry. So q_m + e is a
motion that torque and model make, fit for instruments, and e is the output error (compare Gautier, Janot, Vandanjon,
IEEE Trans. Control Syst. Technol. 21, 2013, whose pull is the machine's own controller).

Three ways from the equations of records to base parameters, at one cut-off and delay.

``ls``: least squares, both sides low-passed alike. ``iv``: the same with instruments, the columns of W along the motion
that torque and model make instead of the recorded one, so that noise of the motion does not pull towards zero. ``oe``:
least squares of the deviation of that simulated motion from the recorded one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from balance.arrays import Floats, Indices
from balance.estimation.base_parameters import BaseParameters, base_parameters
from balance.estimation.identifiability import Identifiability
from balance.estimation.regression import RegressionRecord, least_squares
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics.smoothing_and_derivatives import Rates
from .regression_equations import RecordEquations, RegressionEquations, model_torque, path_of, regressor

DAMPING = 0.7
"""Of the pull."""
_STEP = 1e-5
"""Of differences [rad, m, and their rates]."""


@dataclass(frozen=True)
class Deviation:
    """The linear equation of one record's deviation, about its motion and some parameters."""

    inertia: Floats
    """M, (samples, joints, joints)."""
    damping: Floats
    """C, alike."""
    stiffness: Floats
    """K, alike."""
    step: float
    """Between samples [s]."""

    @classmethod
    def of(cls, part: RecordEquations, mechanism: Mechanism, parameters: Floats) -> "Deviation":
        """About the motion of a record; ``parameters`` over all of them, (p,).

        Dry friction is taken as a function of the recorded speed: its jump has no slope.
        """
        smooth = np.where([name.startswith("coulomb[") for name in part.names], 0.0, parameters)
        inertia, damping, stiffness = (_slope(part, mechanism, smooth, k) for k in (2, 1, 0))
        return cls(inertia, damping, stiffness, part.record.grid.step)

    @property
    def least_pull_hz(self) -> float:
        """Frequency of the pull that holds the mechanism nine tenths of the time, where its weight would topple it."""
        lowest = np.linalg.eigvals(np.linalg.solve(self.inertia, self.stiffness)).real.min(axis=1)
        return float(np.sqrt(max(-np.percentile(lowest, 10.0), 0.0)) / (2.0 * np.pi))

    def simulate(self, load: Floats, pull_hz: float) -> Rates:
        """Deviations (samples, joints, k) and their rates for the right-hand sides ``load`` (samples, joints, k).

        From rest, by the trapezoidal rule. ``pull_hz`` is the frequency of the pull [Hz].
        """
        w = 2.0 * np.pi * pull_hz
        joints, count = load.shape[1], load.shape[2]
        inverse = np.linalg.inv(self.inertia)
        system = np.zeros((len(load), 2 * joints, 2 * joints))
        system[:, :joints, joints:] = np.eye(joints)
        system[:, joints:, :joints] = -inverse @ self.stiffness - w * w * np.eye(joints)
        system[:, joints:, joints:] = -inverse @ self.damping - 2.0 * DAMPING * w * np.eye(joints)
        pushed = np.zeros((len(load), 2 * joints, count))
        pushed[:, joints:] = inverse @ load
        state = _integrated(system, pushed, self.step)
        rates = system @ state + pushed
        return Rates(state[:, :joints], state[:, joints:], rates[:, joints:])


def _slope(part: RecordEquations, mechanism: Mechanism, parameters: Floats, of: int) -> Floats:
    """d(W pi)/d(q, v or a) by central differences, (samples, joints, joints)."""
    joints = part.record.torque.shape[1]
    known = np.zeros_like(parameters)
    known[: len(part.record.mounted)] = part.record.mounted
    columns = []
    for unit in np.eye(joints):
        ends = [_moved(part.motion, of, sign * _STEP * unit) for sign in (1.0, -1.0)]
        high, low = (
            model_torque(mechanism, end, path_of(part.record, mechanism, end, part.path), parameters + known)
            for end in ends
        )
        columns.append((high - low) / (2.0 * _STEP))
    return np.stack(columns, axis=2)


def _moved(motion: Rates, of: int, change: Floats) -> Rates:
    values = [motion.q, motion.v, motion.a]
    values[of] = values[of] + change
    return Rates(*values)


def _integrated(system: Floats, pushed: Floats, step: float) -> Floats:
    """x' = A x + b from x = 0: (1 - h A1 / 2) x1 = (1 + h A0 / 2) x0 + h (b0 + b1) / 2."""
    unit = np.eye(system.shape[1])
    inverse = np.linalg.inv(unit - 0.5 * step * system[1:])
    carried = inverse @ (unit + 0.5 * step * system[:-1])
    added = 0.5 * step * inverse @ (pushed[1:] + pushed[:-1])
    state = np.zeros_like(pushed)
    for i in range(len(carried)):
        state[i + 1] = carried[i] @ state[i] + added[i]
    return state


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


def allowed(evidence: RegressionEquations) -> tuple[Method, ...]:
    """Methods for these rows: least squares alone for forces alone, no output error where forces count too."""
    record = evidence.parts[0].record
    if not record.torque.shape[1]:
        return ("ls",)
    return METHODS if record.loads is None else ("ls", "iv")


@dataclass(frozen=True)
class Equations:
    """What one method solves: rows = columns @ base, over all records without their ends."""

    columns: Floats
    """(n, rows, r)"""
    rows: Floats
    """(n, rows)"""
    used: Floats
    """(n, rows), zero or one."""
    instruments: Floats | None = None

    def solve(self, identifiable: Identifiability, blocks: Indices) -> BaseParameters:
        """With intervals from leaving out ``blocks``."""
        return base_parameters(self._record(blocks), identifiable)

    def values(self, training: Floats) -> Floats:
        """Base parameters from the part of the equations that ``training`` (n, 1) leaves, (r,)."""
        record = self._record(np.zeros(len(self.rows), dtype=np.intp))
        return least_squares(replace(record, used=self.used * training))

    def _record(self, blocks: Indices) -> RegressionRecord:
        return RegressionRecord.of(self.columns, self.rows, blocks, used=self.used, instruments=self.instruments)


@dataclass(frozen=True)
class Methods:
    """The equations of each method from what records show at one cut-off and delay."""

    evidence: RegressionEquations
    mechanism: Mechanism
    identifiable: Identifiability
    delay: float
    smooth: Floats | None = None
    """Low-passed base columns where they are at hand, (n, rows, r)."""

    def identified(self, method: Method) -> BaseParameters:
        """Base parameters with intervals. Raises AnalysisError for a method that needs torques where there are none."""
        self._refuse(method)
        blocks = self.evidence.blocks(BLOCK_PERIODS[method] / self.evidence.cutoff)
        return self._equations(method, None).solve(self.identifiable, blocks)

    def held_out(self, method: Method, training: Sequence[Floats]) -> Floats:
        """Base parameters from each choice of samples that is marked with one, (n, 1) each, (choices, r)."""
        self._refuse(method)
        return np.array([self._equations(method, marked).values(marked) for marked in training])

    def _refuse(self, method: Method) -> None:
        if method not in allowed(self.evidence):
            raise AnalysisError(
                f"method {method!r} is not for these rows: oe takes torques alone, iv torques among others; expected "
                f"{' or '.join(allowed(self.evidence))}"
            )

    def _equations(self, method: Method, training: Floats | None) -> Equations:
        marked = np.ones((len(self.plain.rows), 1)) if training is None else training
        if method == "ls":
            return self.plain
        if method == "iv":
            return self._instrumented(self.plain.values(marked))
        return self._output_error

    @cached_property
    def plain(self) -> Equations:
        """Of least squares."""
        evidence = self.evidence
        columns = evidence.low_passed_columns(self.identifiable.pivots) if self.smooth is None else self.smooth
        return Equations(columns, evidence.low_passed_torque(self.delay), evidence.moving)

    def _instrumented(self, base: Floats) -> Equations:
        """With the columns of the motion that ``base`` (r,) and the torques make as instruments."""
        parts = [self._made(*pair, base) for pair in zip(self.evidence.parts, self._models, strict=True)]
        plain = self.plain
        return Equations(plain.columns, plain.rows, plain.used, np.concatenate(parts))

    @cached_property
    def _models(self) -> list[Deviation]:
        """Of each record, about the parameters of least squares."""
        return self._about(self.plain.values(np.ones((len(self.plain.rows), 1))))

    def _about(self, base: Floats) -> list[Deviation]:
        return [Deviation.of(part, self.mechanism, self._full(base)) for part in self.evidence.parts]

    @cached_property
    def _output_error(self) -> Equations:
        """About parameters of the output error itself, found by repetition from those of least squares."""
        equations = self._deviations(self._models)
        everything = np.ones((len(self.plain.rows), 1))
        for _ in range(ROUNDS):
            equations = self._deviations(self._about(equations.values(everything)))
        return equations

    def _deviations(self, models: Sequence[Deviation]) -> Equations:
        """Deviations that single parameters make, and that the torques make, beside each other."""
        r = self.identifiable.rank
        parts = []
        for part, model in zip(self.evidence.parts, models, strict=True):
            joints = part.record.torque.shape[1]
            columns = part.whole[:, :joints, list(self.identifiable.pivots)]
            right = (
                np.concatenate([columns, part.measured(self.delay)[:, :joints, None]], axis=2) * part.sound[:, :, None]
            )
            parts.append(part.inside(model.simulate(right, max(PULL * part.cutoff, model.least_pull_hz)).q))
        made = np.concatenate(parts)
        return Equations(made[:, :, :r], made[:, :, r], self.evidence.moving[:, : made.shape[1]])

    def _made(self, part: RecordEquations, model: Deviation, base: Floats) -> Floats:
        """Low-passed base columns along the simulated motion, without the record's ends."""
        joints = part.record.torque.shape[1]
        pivots = list(self.identifiable.pivots)
        left = (part.measured(self.delay)[:, :joints] - part.whole[:, :joints, pivots] @ base) * part.sound
        away = model.simulate(left[:, :, None], max(PULL * part.cutoff, model.least_pull_hz))
        motion = Rates(*(m + e[:, :, 0] for m, e in zip(_arrays(part.motion), _arrays(away), strict=True)))
        path = path_of(part.record, self.mechanism, motion, part.path)
        columns = regressor(part.record, self.mechanism, motion, path)[:, :, pivots]
        return part.inside(part.low_passed(columns))

    def _full(self, base: Floats) -> Floats:
        """Parameters over all (p,) that make the same rows as the base parameters."""
        full = np.zeros(len(self.identifiable.names))
        full[list(self.identifiable.pivots)] = base
        return full


def _arrays(rates: Rates) -> Sequence[Floats]:
    return rates.q, rates.v, rates.a
