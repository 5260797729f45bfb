"""Splitting a correction over holes: of any weight, or from stock weights to a proven optimum.

Of stock weights the set with the least residual is taken, and of such sets the lightest: a mixed-integer programme in
the number of each weight in each hole. The residual's modulus is bounded from below by its components in some
directions; the direction of each residual found is added until the bound meets it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from ..arrays import Complexes, Floats, stdout_discarded
from ..balancing.stock_plates import Plate
from ..errors import SizingError

_SCALE = 1e3
"""Correction to which the programme is scaled, so that the solver's 1e-6 is 1e-9 of it."""
_GAP = 1e-8
"""Distance of residual and bound, relative to the correction, at which the optimum counts as proven."""
RESOLUTION = 1e-6
"""Share of the correction below which a residual counts as zero by default."""
_ROUNDS = 60
TIME_LIMIT_S = 20.0
"""Time for one programme; after it nothing is proven and the split is refused [s]."""


@dataclass(frozen=True)
class Hole:
    """A place of a correction plane where weights may be mounted."""

    name: str
    angle: float
    """From the rotor's mark [rad]."""


@dataclass(frozen=True)
class Split:
    """Weights in holes, and the residual correction."""

    target: complex
    """Correction to make, mass times radius or mass alone [kg m or kg]."""
    holes: tuple[Hole, ...]
    weights: tuple[float, ...]
    """Weight in each hole, in the unit of the target."""
    pieces: tuple[tuple[str, ...], ...]
    """Names of the stock weights in each hole; empty where weights are of any size."""
    bound: float
    """Proven lower bound of the residual, or the residual that counts as zero, in the unit of the target."""

    @property
    def made(self) -> complex:
        """The correction that the weights make."""
        return complex(np.array(self.weights) @ hole_directions(self.holes))

    def residual(self) -> float:
        """Modulus of the target minus the made correction, in the unit of the target."""
        return abs(self.target - self.made)

    def residual_percent(self) -> float | None:
        """Residual in per cent of the target; None where that is zero."""
        return 100.0 * self.residual() / abs(self.target) if self.target else None

    def is_optimal(self, tol: float) -> bool:
        """Whether the residual is within ``tol`` of its bound, relative to the correction."""
        return self.residual() - self.bound <= tol * abs(self.target)


def evenly_spaced(count: int, first: float) -> tuple[Hole, ...]:
    """``count`` holes at equal distance, numbered from 1, hole 1 at ``first`` [rad]."""
    if count < 1:
        raise SizingError(f"holes: {count}: expected at least 1")
    return tuple(Hole(str(i + 1), first + 2 * np.pi * i / count) for i in range(count))


def hole_directions(holes: Sequence[Hole]) -> Complexes:
    """Unit vectors to the holes, (holes,) [-]."""
    return np.exp(1j * np.array([hole.angle for hole in holes]))


def split_freely(target: complex, holes: Sequence[Hole], limit: float = np.inf) -> Split:
    """Weights of any size up to ``limit`` a hole that make the correction with the least total.

    Without a limit these are the two holes next to the correction: w_1 = U sin(b - t) / sin(b - a) at a, w_2 =
    U sin(t - a) / sin(b - a) at b. Raises SizingError where the holes cannot make it.
    """
    size = abs(target)
    if size == 0.0:
        return Split(target, tuple(holes), (0.0,) * len(holes), ((),) * len(holes), 0.0)
    unit = hole_directions(holes)
    sums = np.array([unit.real, unit.imag])
    required = np.array([target.real, target.imag]) / size
    upper = None if np.isinf(limit) else limit / size
    solution = linprog(
        np.ones(len(holes)), A_eq=sums, b_eq=required, bounds=[(0.0, upper)] * len(holes), method="highs"
    )
    if not solution.success:
        what = "" if upper is None else f" of at most {1e3 * limit:g} g each"
        raise SizingError(
            f"weights{what} in these holes cannot make this correction: give more holes, or a larger limit"
        )
    weights = np.asarray(solution.x)
    # to rounding error: the weights between their bounds are solved anew
    free = (weights > 1e-9) & (weights < (np.inf if upper is None else upper - 1e-9))
    exact = np.where(free | (weights <= 1e-9), 0.0, upper or 0.0)
    exact[free] = np.linalg.lstsq(sums[:, free], required - sums @ exact, rcond=None)[0]
    weights = size * (exact if (exact >= 0.0).all() else weights)
    return Split(target, tuple(holes), tuple(float(w) for w in weights), ((),) * len(holes), 0.0)


class NotProvenError(SizingError):
    """A split whose optimum could not be proven in the time allowed."""


@dataclass(frozen=True)
class SplitRules:
    """What may be mounted."""

    in_hole: int = 1
    """Largest number of weights in one hole."""
    used_holes: int | None = None
    """Largest number of holes used; None for all."""
    resolution: float = RESOLUTION
    """Share of the correction below which a residual counts as zero."""


def split_from_stock(
    target: complex, holes: Sequence[Hole], stock: Sequence[Plate], rules: SplitRules | None = None
) -> Split:
    """The stock weights that come nearest to a correction [kg].

    Raises NotProvenError where the optimum cannot be proven.
    """
    sizes = np.array([plate.mass for plate in stock])
    programme = _Programme(target, hole_directions(holes), sizes, stock, rules or SplitRules())
    least, bound = programme.solve(None)
    lightest, _ = programme.solve(max(programme.residual(least) * (1.0 + 1e-9), programme.finest) + 1e-6)
    scale = programme.scale
    names = tuple(tuple(p.name for p, n in zip(stock, row, strict=True) for _ in range(int(n))) for row in lightest)
    return Split(target, tuple(holes), tuple(float(w) for w in lightest @ sizes), names, bound / scale)


class _Programme:
    """Unknowns: number of each weight in each hole (holes, weights), a flag a hole, and the bound t on the residual."""

    def __init__(
        self, target: complex, unit: Complexes, sizes: Floats, stock: Sequence[Plate], rules: SplitRules
    ) -> None:
        self.scale = _SCALE / max(abs(target), float(sizes.min()), 1e-300)
        self.target, self.effect = self.scale * target, self.scale * np.outer(unit, sizes).ravel()
        holes, kinds = self.shape = len(unit), len(stock)
        self.mass = np.tile(sizes * self.scale, holes)
        self.finest = rules.resolution * abs(self.target)
        quantity = np.array([min(plate.quantity, rules.in_hole * holes) for plate in stock], dtype=float)
        lower = np.r_[np.zeros(holes * kinds + holes), self.finest]
        self.lower, self.upper = lower, np.r_[np.tile(quantity, holes), np.ones(holes), np.inf]
        # quantities in stock, weights in a hole only where its flag is set, and flags in all
        per_kind = np.hstack([np.tile(np.eye(kinds), holes), np.zeros((kinds, holes + 1))])
        in_hole = np.kron(np.eye(holes), np.ones((1, kinds)))
        per_hole = np.hstack([in_hole, -rules.in_hole * np.eye(holes), np.zeros((holes, 1))])
        flags = np.r_[np.zeros(holes * kinds), np.ones(holes), 0.0][None]
        self.rules = [
            LinearConstraint(per_kind, 0.0, quantity),
            LinearConstraint(per_hole, -np.inf, 0.0),
            LinearConstraint(flags, 0.0, holes if rules.used_holes is None else rules.used_holes),
        ]
        self.sides: list[Floats] = []
        self.limits: list[float] = []
        for angle in np.arange(16) * np.pi / 8:
            self._cut(float(angle))

    def residual(self, numbers: Floats) -> float:
        """Modulus of the residual of a set, scaled."""
        return float(abs(self.target - numbers.ravel() @ self.effect))

    def solve(self, within: float | None) -> tuple[Floats, float]:
        """Numbers (holes, weights) with the least residual, or the lightest with it ``within``, and the bound."""
        bound = 0.0
        best: Floats = np.zeros(self.shape)
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
        self.sides.append(np.r_[-(turned * self.effect).real, np.zeros(self.shape[0]), -1.0])
        self.limits.append(-float((turned * self.target).real))

    def _solved(self, within: float | None) -> tuple[Floats, float]:
        count, holes = len(self.effect), self.shape[0]
        cost = (
            np.r_[np.zeros(count), np.zeros(holes), 1.0] if within is None else np.r_[self.mass, np.zeros(holes), 0.0]
        )
        upper = np.r_[self.upper[:-1], within or np.inf]
        cuts = LinearConstraint(np.array(self.sides), -np.inf, np.array(self.limits))
        with stdout_discarded():
            solution = milp(
                cost,
                constraints=[cuts, *self.rules],
                integrality=np.r_[np.ones(count + holes), 0.0],
                bounds=Bounds(self.lower, upper),
                options={"mip_rel_gap": 0.0, "time_limit": TIME_LIMIT_S},
            )
        if not solution.success:
            raise NotProvenError(
                f"no proven best set of weights: {solution.message} Allow a residual (--within 1%), or give fewer "
                "holes or weights."
            )
        x = np.asarray(solution.x)
        return np.rint(x[:count]).reshape(self.shape), float(x[-1])
