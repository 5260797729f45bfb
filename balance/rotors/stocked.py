"""Stock weights in holes: the set with the least residual, and of such sets the lightest.

A mixed-integer programme in the number of each weight in each hole. The residual's modulus is bounded from below by
its components in some directions; the direction of each residual found is added until the bound meets what is reached.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from ..arrays import Floats
from ..errors import SizingError
from ..quiet import stdout_discarded
from ..stock import Plate
from .holes import Hole, Split, directions

_SCALE = 1e3
"""Correction to which the programme is scaled, so that the solver's 1e-6 is 1e-9 of it."""
_GAP = 1e-8
"""Distance of residual and bound, relative to the correction, at which the optimum counts as proven."""
RESOLUTION = 1e-6
"""Residual, of the correction, that counts as none where no other is asked for."""
_ROUNDS = 60
TIME_LIMIT_S = 20.0
"""Time for one programme; after it nothing is proven and the split is refused [s]."""


class NotProvenError(SizingError):
    """A split whose optimum could not be proven in the time allowed."""


@dataclass(frozen=True)
class Rules:
    """What may be mounted."""

    in_hole: int = 1
    """Largest number of weights in one hole."""
    used_holes: int | None = None
    """Largest number of holes used; None for all."""
    resolution: float = RESOLUTION
    """Residual, of the correction, below which none is told from none."""


def split(
    target: complex, holes: Sequence[Hole], stock: Sequence[Plate], radius: float | None, rules: Rules | None = None
) -> Split:
    """The stock weights that come nearest to a correction [kg m with ``radius`` in m, kg with None].

    Raises NotProvenError where the optimum cannot be proven.
    """
    sizes = np.array([plate.mass for plate in stock]) * (1.0 if radius is None else radius)
    programme = _Programme(target, directions(holes), sizes, stock, rules or Rules())
    least, bound = programme.solve(None)
    lightest, _ = programme.solve(max(programme.residual(least) * (1.0 + 1e-9), programme.finest) + 1e-6)
    scale = programme.scale
    names = tuple(tuple(p.name for p, n in zip(stock, row, strict=True) for _ in range(int(n))) for row in lightest)
    return Split(target, tuple(holes), tuple(float(w) for w in lightest @ sizes), names, bound / scale)


class _Programme:
    """Unknowns: number of each weight in each hole (holes, weights), a flag a hole, and the bound t on the residual."""

    def __init__(self, target: complex, unit: Any, sizes: Floats, stock: Sequence[Plate], rules: Rules) -> None:  # noqa: ANN401
        self.scale = _SCALE / max(abs(target), float(sizes.min()), 1e-300)
        self.target, self.effect = self.scale * target, self.scale * np.outer(unit, sizes).ravel()
        self.holes, self.kinds = len(unit), len(stock)
        self.mass = np.tile(sizes * self.scale, self.holes)
        self.quantity = np.array([min(plate.quantity, rules.in_hole * self.holes) for plate in stock], dtype=float)
        self.rules, self.finest = rules, rules.resolution * abs(self.target)
        self.sides: list[Floats] = []
        self.limits: list[float] = []
        for angle in np.arange(16) * np.pi / 8:
            self._cut(float(angle))

    def residual(self, numbers: Floats) -> float:
        """Modulus of what a set leaves, scaled."""
        return float(abs(self.target - numbers.ravel() @ self.effect))

    def solve(self, within: float | None) -> tuple[Floats, float]:
        """Numbers (holes, weights) with the least residual, or the lightest with it ``within``, and the bound."""
        bound = 0.0
        best: Floats = np.zeros((self.holes, self.kinds))
        reached = abs(self.target)
        for _ in range(_ROUNDS):
            numbers, t = self._solved(within)
            found = self.residual(numbers)
            bound = max(bound, t)
            if within is not None and found <= within + 1e-6:
                return numbers, bound
            if found < reached:
                best, reached = numbers, found
            if within is None and max(reached, self.finest) - bound <= _GAP * _SCALE + 1e-6:
                return best, bound
            self._cut(float(np.angle(self.target - numbers.ravel() @ self.effect)))
        raise NotProvenError(
            f"no proven best set of weights: residual {reached / self.scale:.6g} after {_ROUNDS} rounds"
        )

    def _cut(self, angle: float) -> None:
        """Re((target - effect n) exp(-i angle)) <= t."""
        turned = np.exp(-1j * angle)
        self.sides.append(np.concatenate([-(turned * self.effect).real, np.zeros(self.holes), [-1.0]]))
        self.limits.append(-float((turned * self.target).real))

    def _solved(self, within: float | None) -> tuple[Floats, float]:
        count, holes = self.holes * self.kinds, self.holes
        zeros = np.zeros(holes)
        cost = np.concatenate([np.zeros(count), zeros, [1.0]])
        if within is not None:
            cost = np.concatenate([self.mass, zeros, [0.0]])
        lower = np.concatenate([np.zeros(count), zeros, [self.finest]])
        upper = np.concatenate([np.tile(self.quantity, holes), np.ones(holes), [within or np.inf]])
        with stdout_discarded():
            solution = milp(
                cost,
                constraints=self._constraints(),
                integrality=np.concatenate([np.ones(count + holes), [0.0]]),
                bounds=Bounds(lower, upper),
                options={"mip_rel_gap": 0.0, "time_limit": TIME_LIMIT_S},
            )
        if not solution.success:
            raise NotProvenError(
                f"no proven best set of weights: {solution.message} Allow a residual (--within 1%), or fewer "
                "holes or weights."
            )
        x = np.asarray(solution.x)
        return np.rint(x[:count]).reshape(holes, self.kinds), float(x[-1])

    def _constraints(self) -> list[LinearConstraint]:
        """Cuts, stock quantities, weights a hole only where its flag is set, and flags in all."""
        holes, kinds = self.holes, self.kinds
        last = np.zeros((1, 1))
        per_kind = np.hstack([np.tile(np.eye(kinds), holes), np.zeros((kinds, holes + 1))])
        per_hole = np.hstack(
            [np.kron(np.eye(holes), np.ones((1, kinds))), -self.rules.in_hole * np.eye(holes), np.zeros((holes, 1))]
        )
        flags = np.hstack([np.zeros((1, holes * kinds)), np.ones((1, holes)), last])
        most = holes if self.rules.used_holes is None else self.rules.used_holes
        return [
            LinearConstraint(np.array(self.sides), -np.inf, np.array(self.limits)),
            LinearConstraint(per_kind, 0.0, self.quantity),
            LinearConstraint(per_hole, -np.inf, 0.0),
            LinearConstraint(flags, 0.0, most),
        ]
