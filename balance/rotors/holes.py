"""Splitting a correction over holes: of any weight between them, or stock weights to a proven optimum."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from ..arrays import Complexes, Floats
from ..errors import SizingError


@dataclass(frozen=True)
class Hole:
    """A place of a correction plane where weights may be mounted."""

    name: str
    angle: float
    """From the rotor's mark [rad]."""


@dataclass(frozen=True)
class Split:
    """Weights in holes, and what they leave of the correction."""

    target: complex
    """Correction that was asked for, mass times radius or mass alone [kg m or kg]."""
    holes: tuple[Hole, ...]
    weights: tuple[float, ...]
    """Weight in each hole, in the unit of the target."""
    pieces: tuple[tuple[str, ...], ...]
    """Names of the stock weights in each hole; empty where weights are of any size."""
    bound: float
    """No set leaves less than this, or it is the residual that counts as none, in the unit of the target."""

    @property
    def made(self) -> complex:
        """The correction that the weights make."""
        return complex(np.array(self.weights) @ directions(self.holes))

    def residual(self) -> float:
        """Modulus of the asked minus the made correction."""
        return abs(self.target - self.made)

    def residual_percent(self) -> float | None:
        """Residual in per cent of the correction; None where none was asked for."""
        return 100.0 * self.residual() / abs(self.target) if self.target else None

    def is_optimal(self, tol: float) -> bool:
        """Whether the residual is within ``tol`` of its bound, relative to the correction."""
        return self.residual() - self.bound <= tol * abs(self.target)


def evenly(count: int, first: float) -> tuple[Hole, ...]:
    """``count`` holes at equal distance, numbered from 1, hole 1 at ``first`` [rad]."""
    if count < 1:
        raise SizingError(f"holes: {count}: expected at least 1")
    return tuple(Hole(str(i + 1), first + 2 * np.pi * i / count) for i in range(count))


def directions(holes: Sequence[Hole]) -> Complexes:
    """Unit vectors to the holes, (holes,)."""
    return np.exp(1j * np.array([hole.angle for hole in holes]))


def continuous(target: complex, holes: Sequence[Hole], limit: float = np.inf) -> Split:
    """Weights of any size up to ``limit`` a hole that make the correction with the least total.

    Without a limit these are the two holes beside the correction: w_1 = U sin(b - t) / sin(b - a) at a, w_2 =
    U sin(t - a) / sin(b - a) at b. Raises SizingError where the holes cannot make it.
    """
    size = abs(target)
    if size == 0.0:
        return Split(target, tuple(holes), (0.0,) * len(holes), ((),) * len(holes), 0.0)
    unit = directions(holes)
    sums = np.array([unit.real, unit.imag])
    wanted = np.array([target.real, target.imag]) / size
    upper = None if np.isinf(limit) else limit / size
    solution = linprog(np.ones(len(holes)), A_eq=sums, b_eq=wanted, bounds=[(0.0, upper)] * len(holes), method="highs")
    if not solution.success:
        what = "" if upper is None else f" of at most {1e3 * limit:g} g each"
        raise SizingError(
            f"weights{what} in these holes cannot make this correction: give more holes, or a larger limit"
        )
    weights = _polished(sums, wanted, np.asarray(solution.x), upper) * size
    return Split(target, tuple(holes), tuple(float(w) for w in weights), ((),) * len(holes), 0.0)


def _polished(sums: Floats, wanted: Floats, weights: Floats, upper: float | None) -> Floats:
    """The same weights to rounding error: those between the bounds solved anew."""
    free = (weights > 1e-9) & (weights < (np.inf if upper is None else upper - 1e-9))
    exact = np.where(free, 0.0, np.where(weights <= 1e-9, 0.0, upper or 0.0))
    exact[free] = np.linalg.lstsq(sums[:, free], wanted - sums @ exact, rcond=None)[0]
    return exact if (exact >= 0.0).all() else weights
