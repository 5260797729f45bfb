"""A machine of one degree of freedom reduced to its crank: kinetic and potential energy as functions of one angle.

With the joint rates q' = g(phi) phi' that the loops allow, kinetic energy is I(phi) phi'^2 / 2, and the equation of
motion is I phi'' + I' phi'^2 / 2 + V' = Q. All of it is computed from the mechanism's file, as Fourier series over one
turn: of smooth functions these are exact to rounding error.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from ..arrays import Complexes, Floats, frozen
from ..closure import Closure
from ..dynamics.inverse_dynamics import simulate
from ..dynamics.regressor import potential
from ..errors import ModelError
from ..mechanism.mechanism import Mechanism
from ..motion import Samples
from ..results import Key
from . import DriveError

TAIL = 1e-12
"""Size of the highest harmonics, relative to the largest, at which a table counts as resolved."""
_FIRST, _LAST = 64, 8192
"""Positions of a turn that are tried, doubled each time."""
_SAME_ANGLE = 1e-9
"""Below a whole turn an angle this near is 0 [rad]."""
_GRID = 2881
"""Angles of a turn at which the slope's sign is looked at."""


@dataclass(frozen=True)
class Periodic:
    """Several functions f(phi) = Re sum_k c_k exp(i k phi) that share their harmonics."""

    coefficients: Complexes
    """c_k of each function, k = 0, 1, ..., (functions, harmonics + 1)."""

    @classmethod
    def through(cls, samples: Floats) -> "Periodic":
        """Through equidistant samples of one turn, its end excluded, (functions, n) [unit of each function]."""
        count = samples.shape[1]
        coefficients = np.fft.rfft(samples, axis=1)[:, : (count + 1) // 2] * (2.0 / count)
        coefficients[:, 0] /= 2.0
        return cls(coefficients)

    @property
    def harmonics(self) -> int:
        """Highest harmonic kept."""
        return self.coefficients.shape[1] - 1

    @cached_property
    def _orders(self) -> Complexes:
        return 1j * np.arange(self.harmonics + 1)

    def __call__(self, phi: Floats | float) -> Floats:
        """Values at angles phi of any shape [rad], (functions, *shape of phi) [unit of each function]."""
        waves = np.exp(np.multiply.outer(self._orders, phi)).reshape(self.harmonics + 1, -1)
        return np.real(self.coefficients @ waves).reshape(-1, *np.shape(phi))

    def slope(self) -> "Periodic":
        """Derivatives by phi."""
        return Periodic(self.coefficients * self._orders)

    def tail(self) -> float:
        """Largest coefficient in the last eighth of the harmonics, of each function relative to its largest."""
        last = self.coefficients[:, -max(2, self.harmonics // 8) :]
        size = np.abs(self.coefficients).max(axis=1)
        return float((np.abs(last).max(axis=1) / np.where(size > 0.0, size, 1.0)).max())

    def trimmed(self, tol: float = 1e-17) -> "Periodic":
        """Without the highest harmonics whose coefficients are all below ``tol`` of the largest of their function."""
        size = np.abs(self.coefficients)
        relative = (size / np.maximum(size.max(axis=1, keepdims=True), 1e-300)).max(axis=0)
        last = int(np.flatnonzero(relative > tol).max(initial=0))
        return Periodic(self.coefficients[:, : last + 1])


def odd_grid(harmonics: int) -> Floats:
    """Equidistant angles of one turn for so many harmonics, (2 harmonics + 1,) [rad]."""
    return 2.0 * np.pi * np.arange(2 * harmonics + 1) / (2 * harmonics + 1)


@lru_cache(maxsize=8)
def differentiation(harmonics: int) -> Floats:
    """Matrix from samples on ``odd_grid`` to samples of the derivative of their series, (n, n) [1/rad].

    D_jk = (-1)^(j-k) / (2 sin((phi_j - phi_k) / 2)) off the diagonal.
    """
    count = 2 * harmonics + 1
    steps = np.arange(1, count)
    first = np.r_[0.0, 0.5 * (-1.0) ** steps / np.sin(-np.pi * steps / count)]
    rows, columns = np.ogrid[:count, :count]
    return frozen(first[(columns - rows) % count])


@dataclass(frozen=True)
class EquivalentInertia:
    """Reduced inertia, potential and gains over the travel of the crank.

    The travel u is the crank's angle in the direction of turning: phi = direction u.
    """

    mechanism: Mechanism
    crank: Annotated[str, Key()]
    direction: Annotated[int, Key()]
    """1, or -1 where the crank turns clockwise (about minus its axis)."""
    functions: Periodic
    """I(u) [kg m2], V(u) [J], then the gains dq_j/du of all coordinates [-, m]."""
    samples: Annotated[int, Key("closed_positions")]
    """Closed configurations of a turn behind the series."""
    tail: Annotated[float, Key("highest_harmonics")]
    """Size of the highest harmonics of the series, relative to the largest."""
    closure_residual: Annotated[float, Key("closure_residual_m")]
    """Largest loop residual over the turn [m, rad]."""

    @cached_property
    def slopes(self) -> Periodic:
        """The derivatives of the functions by u."""
        return self.functions.slope()

    @cached_property
    def motion(self) -> Periodic:
        """What the equation of motion asks for at once: I, V, the gains, dI/du and dV/du."""
        return Periodic(np.vstack([self.functions.coefficients, self.slopes.coefficients[:2]]))

    def inertia(self, u: Floats | float) -> Floats:
        """Reduced inertia at travel u, scalar or (n,) [rad], drive inertias of the joints included, [kg m2]."""
        return self.functions(u)[0]

    def inertia_slope(self, u: Floats | float) -> Floats:
        """dI/du at travel u, scalar or (n,) [rad], [kg m2/rad]."""
        return self.slopes(u)[0]

    def potential(self, u: Floats | float) -> Floats:
        """Potential energy of weight at travel u, scalar or (n,) [rad] [J], zero with all masses at height zero."""
        return self.functions(u)[1]

    def potential_slope(self, u: Floats | float) -> Floats:
        """dV/du at travel u, scalar or (n,) [rad], [N m]."""
        return self.slopes(u)[1]

    def gains(self, u: Floats | float) -> Floats:
        """Rates of all coordinates per rate of the crank's travel, (nv, *shape of u) [-, m]."""
        return self.functions(u)[2:]


def reduced_to_crank(mechanism: Mechanism, crank: str | None = None, direction: int = 1) -> EquivalentInertia:
    """Reduce a mechanism to its crank, a joint that makes full turns; by default the one that the file's motor drives.

    Raises ModelError for a machine of other than one degree of freedom, DriveError where the crank cannot turn.
    """
    if not crank and len(mechanism.driven) != 1:
        drives = ", ".join(mechanism.driven) or "none"
        raise ModelError(f"{mechanism.name} has the motors {drives}: name the one crank joint that is driven")
    name = crank or mechanism.driven[0]
    model = replace(mechanism, driven=(name,), viscous=0.0 * mechanism.viscous, coulomb=0.0 * mechanism.coulomb)
    if not model.tree.joints[model.coordinate_index(name)].revolute:
        raise ModelError(f"{model.name}: joint {name!r} slides: a drive needs a crank that turns")
    closure = Closure(model).without_idle()
    if closure.dof != 1:
        raise ModelError(f"{model.name} has {closure.dof} degrees of freedom: a drive is reduced to one crank")
    count = _FIRST
    while True:
        samples, residual = _turn(closure, name, direction, count)
        series = Periodic.through(samples)
        if series.tail() < TAIL or count >= _LAST:
            break
        count *= 2
    if series.tail() > 1e-6:
        raise DriveError(
            f"{model.name}: its reduced inertia is not resolved by {count} positions a turn (highest harmonics "
            f"{series.tail():.1e}): a position is nearly singular; change the lengths, or another crank"
        )
    return EquivalentInertia(mechanism, name, direction, series.trimmed(), count, series.tail(), residual)


def _turn(closure: Closure, crank: str, direction: int, count: int) -> tuple[Floats, float]:
    """I, V and gains at equidistant positions of one turn, (2 + nv, count), and the loop residual.

    Raises DriveError for a joint that is not back after the turn, a hinge up to whole turns.
    """
    u = 2.0 * np.pi * np.arange(count + 1) / count
    rate = np.full((count + 1, 1), float(direction))
    at = Samples(u, direction * u[:, None], rate, np.zeros_like(rate), joints=(crank,))
    trajectory, mechanism = closure.follow(at), closure.mechanism
    change = trajectory.q[-1] - trajectory.q[0]
    hinge = np.array([joint.revolute for joint in mechanism.tree.joints])
    gap = np.abs(np.where(hinge, change - 2.0 * np.pi * np.rint(change / (2.0 * np.pi)), change))
    if gap.max() > 1e-8:
        joint = mechanism.coordinates[int(gap.argmax())]
        raise DriveError(
            f"{mechanism.name}: joint {joint!r} is not back after a turn of the crank (off {gap.max():.3g}): the drive "
            "needs a mechanism that repeats with its crank"
        )
    at_rest = replace(trajectory, v=np.zeros_like(trajectory.v), a=np.zeros_like(trajectory.v))
    weight = simulate(mechanism, at_rest).torque[crank]
    accelerated = simulate(mechanism, replace(at_rest, a=direction * trajectory.v)).torque[crank]
    energy = potential(mechanism, trajectory.q)
    return np.vstack([accelerated - weight, energy, trajectory.v.T])[:, :-1], trajectory.residual


def stationary_points(slope: Callable[[Floats], Floats]) -> list[float]:
    """Angles from 0 to 2 pi where a slope of period 2 pi changes its sign, increasing, (k,) [rad]."""
    u = (np.arange(_GRID + 1) - 0.5) * 2.0 * np.pi / _GRID
    values = slope(u)
    angles = []
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
        root = brentq(lambda x: float(slope(np.array([x]))[0]), u[k], u[k + 1], xtol=1e-13)
        angle = float(np.mod(root, 2.0 * np.pi))
        angles.append(0.0 if 2.0 * np.pi - angle < _SAME_ANGLE else angle)
    return sorted(angles)


def inertia_extremes(reduced: EquivalentInertia) -> list[tuple[float, float, str]]:
    """Travel [rad], reduced inertia [kg m2] and ``maximum`` or ``minimum``, for each extreme of I(u)."""
    bend = reduced.slopes.slope()
    return [
        (u, float(reduced.inertia(u)), "maximum" if bend(u)[0] < 0.0 else "minimum")
        for u in stationary_points(reduced.inertia_slope)
    ]
