"""What errors of masses and places cost: the shaking force that a mechanism made within its tolerances keeps.

Each quantity is drawn from a rectangular distribution over its tolerance (JCGM 101, 6.4.2). The force along the motion
is linear in small errors: one mechanism at either end of each tolerance gives the slope, and how far from linear it is.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..closure import Closure
from ..dynamics.inverse_dynamics import simulate
from ..errors import ClosureError, ModelError
from ..results import Key, Shown, per_cent
from ..task_pool import HERE, TaskPool
from ..units import si
from .sweep import Problem, Variable

PERCENTILES = (50.0, 90.0, 95.0, 99.0)
NOT_LINEAR = 0.05
"""Curvature relative to slope over half a tolerance, above which the answer is doubtful."""
_ROUNDING = 1e-12
"""Part of the force that counts as rounding."""
_COUNTS, _CHANGES = 1e-3, 1e-6
"""Share of what all errors add, and change of the RMS force by one alone, from which its effect counts."""


@dataclass(frozen=True)
class Tolerance:
    """A quantity of the drawing, and its largest error."""

    name: Annotated[str, Key()]
    """A site or a body."""
    part: Annotated[str, Key()]
    """``mass`` of a counter-mass or body [kg]; ``x``, ``y``, ``z`` of the place of a site or body [m]."""
    half_width: Annotated[float, Key()]
    """[``unit``], or a part of the quantity's nominal value [-]."""
    relative: Annotated[bool, Key()] = False
    """Whether it is such a part: of a counter-mass, the mass of a body, or a coordinate."""

    @classmethod
    def of(cls, name: str, part: str, error: float | str) -> "Tolerance":
        """Of an ``error`` in SI, as a text with its unit, or in per cent of the nominal value, such as ``2 %``.

        Raises UnitError for another text.
        """
        if isinstance(error, str) and (match := re.fullmatch(r"\s*\+?([0-9]+\.?[0-9]*|\.[0-9]+)\s*%\s*", error)):
            return cls(name, part, float(match[1]) / 100.0, True)
        return cls(name, part, si(error, "mass" if part == "mass" else "length"))

    def sized(self, problem: Problem) -> "Tolerance":
        """In kg or m. Raises ModelError for a part of zero."""
        if not self.relative:
            return self
        if self.part != "mass":
            nominal = problem.place(self.name, self.part)
        elif self.name in problem.mechanism.sites:
            nominal = problem.counter_masses.get(self.name, 0.0)
        else:
            nominal = problem.mechanism.mass(self.name)
        if nominal == 0.0:
            of_site = self.part == "mass" and self.name in problem.mechanism.sites
            raise ModelError(
                f"{self.name}.{self.part} is zero, of which {100.0 * self.half_width:g} % are nothing: give "
                f"{'a counter-mass with --counter, or ' if of_site else ''}its tolerance in "
                f"{'g' if self.part == 'mass' else 'mm'}"
            )
        return Tolerance(self.name, self.part, self.half_width * abs(nominal))

    @property
    def unit(self) -> Annotated[str, Key()]:
        """Of ``half_width``: kg of a mass, m of a place, 1 of a part of the nominal value."""
        return "1" if self.relative else "kg" if self.part == "mass" else "m"

    @property
    def text(self) -> str:
        """The quantity with its tolerance, as on a drawing."""
        size = f"{1e3 * self.half_width:.4g} " + ("g" if self.part == "mass" else "mm")
        return f"{self.name}.{self.part} ± {size}"


@dataclass(frozen=True)
class ToleranceEffect:
    """What one tolerance does alone."""

    tolerance: Annotated[Tolerance, Key(label="tolerance", form=lambda t: t.text)]
    rms_95: Annotated[float, Key("rms_95_N", "95 % keep at most, RMS [N]", ".4g")]
    """RMS force that 95 % of the mechanisms with this error alone do not exceed [N]."""
    variance_share: Annotated[float, Key("variance_share_percent", "share [%]", ".1f", to=per_cent)]
    """Of the mean square force that all errors together add to the nominal one, 0 to 1."""
    curvature: Annotated[float, Key("curvature", "curvature", ".2g")]
    """Departure from a straight line within the tolerance, relative to the slope [-]."""


@dataclass(frozen=True)
class ToleranceAnalysis(Shown, rows="effects", figure="balance.figures.balancing:draw_tolerances"):
    """RMS shaking force of mechanisms made within tolerances."""

    nominal: Annotated[float, Key("nominal_rms_N")]
    """Without errors [N]."""
    percentiles: Annotated[dict[str, float], Key("rms_percentiles_N")]
    """RMS force that so many per cent of the mechanisms do not exceed [N]."""
    effects: Annotated[tuple[ToleranceEffect, ...], Key("tolerances")]
    """Effects of the errors one by one, the one that alone leaves the largest force first."""

    @property
    def doubtful(self) -> tuple[ToleranceEffect, ...]:
        """Tolerances so wide that a straight line does not describe their effect, of those whose effect counts."""
        bent = (effect for effect in self.effects if effect.curvature > NOT_LINEAR)
        least = (1.0 + _CHANGES) * self.nominal
        return tuple(effect for effect in bent if effect.variance_share >= _COUNTS and effect.rms_95 > least)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is said of those."""
        advice = "narrow the tolerance, or vary it with balance sweep"
        return tuple(
            f"{one.tolerance.text}: its effect is not linear (curvature {one.curvature:.2g}): {advice}"
            for one in self.doubtful
        )


def analyze_tolerances(
    problem: Problem, tolerances: Sequence[Tolerance], draws: int, seed: int, pool: TaskPool = HERE
) -> ToleranceAnalysis:
    """Draw ``draws`` mechanisms within the tolerances; the same ``seed`` gives the same draws. An end is a task.

    Raises ModelError for what the mechanism does not have, ClosureError where it cannot move at an end of a tolerance.
    """
    problem.check([Variable(t.name, t.part, np.zeros(1)) for t in tolerances])
    if draws < 1 or not all(0.0 < one.half_width < np.inf for one in tolerances):
        raise ModelError("expected one draw at least, and tolerances of more than zero")
    tolerances = [one.sized(problem) for one in tolerances]
    nominal = _force(problem)
    slopes, curvatures = [], []
    ends = [(tolerance, sign * tolerance.half_width) for tolerance in tolerances for sign in (1.0, -1.0)]
    forces = dict(pool.results(partial(_force, problem), ends))
    for k in range(len(tolerances)):
        upper, lower = forces[2 * k], forces[2 * k + 1]
        slopes.append((upper - lower) / 2.0)
        size = float(np.linalg.norm(slopes[-1]))
        bend = float(np.linalg.norm(upper + lower - 2.0 * nominal)) / 2.0
        curvatures.append(bend / size if bend > _ROUNDING * np.linalg.norm(nominal) else 0.0)
    factor: Floats = np.linalg.qr(np.stack([nominal, *slopes], axis=1)).R / np.sqrt(nominal.size / 3)
    errors = np.random.default_rng(seed).uniform(-1.0, 1.0, (draws, len(tolerances)))
    whole = _rms(factor, errors)
    added = np.sum(factor[:, 1:] ** 2, axis=0)
    shares = (added / max(added.sum(), 1e-300)).tolist()
    effects = []
    for alone, one, share, bend in zip(np.eye(len(tolerances)), tolerances, shares, curvatures, strict=True):
        effects.append(ToleranceEffect(one, float(np.percentile(_rms(factor, errors * alone), 95.0)), share, bend))
    levels = [f"{level:g}" for level in PERCENTILES]
    percentiles = dict(zip(levels, np.percentile(whole, PERCENTILES).tolist(), strict=True))
    costliest = sorted(effects, key=lambda effect: (-effect.rms_95, -effect.variance_share))
    return ToleranceAnalysis(float(np.linalg.norm(factor[:, 0])), percentiles, tuple(costliest))


def _rms(factor: Floats, errors: Floats) -> Floats:
    """RMS force of errors (n, k), each relative to its half width, (n,) [N]."""
    return np.linalg.norm(np.column_stack([np.ones(len(errors)), errors]) @ factor.T, axis=1)


def _with_error(problem: Problem, tolerance: Tolerance, error: float) -> Problem:
    """The mechanism with one quantity ``error`` [kg or m] above its nominal value."""
    name, mechanism, counters = tolerance.name, problem.mechanism, problem.counter_masses
    if tolerance.part != "mass":
        return problem.with_points({(name, tolerance.part): problem.place(name, tolerance.part) + error})
    if name not in mechanism.sites:
        if not mechanism.mass(name) + error > 0.0:
            raise ModelError(
                f"the mass of {name!r} is {mechanism.mass(name):g} kg with a tolerance of {abs(error):g} kg: expected "
                "more than its tolerance"
            )
        return replace(problem, mechanism=mechanism.with_payload({name: mechanism.mass(name) + error}))
    if counters.get(name, 0.0) + error < 0.0:
        raise ModelError(
            f"the counter-mass at {name!r} is {counters.get(name, 0.0):g} kg with a tolerance of {abs(error):g} kg: "
            "expected at least its tolerance; give it with --counter"
        )
    return replace(problem, counter_masses={**counters, name: counters.get(name, 0.0) + error})


def _force(problem: Problem, end: tuple[Tolerance, float] | None = None) -> Floats:
    """Shaking force along the motion, (3 n,) [N]; at an ``end`` of a tolerance, with its error."""
    made = problem if end is None else _with_error(problem, *end)
    try:
        mounted = made.mechanism.with_counter_mass(made.counter_masses)
        return simulate(mounted, Closure(mounted).follow(made.samples)).force.ravel()
    except ClosureError as error:
        if end is None:
            raise
        raise ClosureError(
            f"the tolerance {end[0].text}: with it the mechanism does not close; leave out what is out of a planar "
            f"mechanism's plane, or take less: {error}"
        ) from error
