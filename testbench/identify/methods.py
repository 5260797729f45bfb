"""Three ways from the equations of records to base parameters, at one cut-off and delay.

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
from balance.mechanism import Mechanism

from ..errors import AnalysisError
from ..motion.derivatives import Rates
from .deviation import Deviation
from .equations import path_of, regressor
from .evidence import Evidence, Part

Method = Literal["ls", "iv", "oe"]
METHODS: tuple[Method, ...] = ("ls", "iv", "oe")
NAMES = {"ls": "least squares", "iv": "instrumental variables", "oe": "output error"}
STRETCH_PERIODS = {"ls": 1.0, "iv": 1.0, "oe": 1.5}
"""Length of the stretches that are left out in turn for an interval, in periods of the cut-off: beyond half a period
what a low-pass leaves of white noise is no longer correlated; deviations remember longer."""
PULL = 0.25
"""Frequency of the pull back to the recorded motion, in cut-offs: well below what the comparison looks at."""
ROUNDS = 2
"""Of parameters -> coefficients of the deviation -> parameters, for the output error."""


def allowed(evidence: Evidence) -> tuple[Method, ...]:
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

    evidence: Evidence
    mechanism: Mechanism
    identifiable: Identifiability
    delay: float
    smooth: Floats | None = None
    """Low-passed base columns where they are at hand, (n, rows, r)."""

    def identified(self, method: Method) -> BaseParameters:
        """Base parameters with intervals. Raises AnalysisError for a method that needs torques where there are none."""
        self._refuse(method)
        blocks = self.evidence.stretches(STRETCH_PERIODS[method] / self.evidence.cutoff)
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

    def _made(self, part: Part, model: Deviation, base: Floats) -> Floats:
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
