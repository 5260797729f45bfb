"""Steady rotation by harmonic balance: the periodic solution itself, without integrating start-up.

Over the crank's travel u the kinetic energy T = I u'^2 / 2 obeys dT/du = Q(u, sqrt(2 T / I)) - V'(u). A truncated
Fourier series of T that satisfies this at as many angles as it has coefficients is found by Newton's method.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Complexes, Floats
from . import DriveError
from .fourier_series import Periodic, differentiation, odd_grid
from .machine import Machine

TAIL = 1e-12
"""Size of the highest harmonics of T, relative to the largest, at which the series counts as converged."""
HARMONICS = (16, 32, 64, 128, 256, 512)
"""Harmonics tried in turn."""
_ITERATIONS = 50

DEFINITIONS = {
    "nominal": "(n_max - n_min) / n_nominal",
    "time_mean": "(n_max - n_min) / mean speed over time",
    "midrange": "2 (n_max - n_min) / (n_max + n_min)",
}
"""Definitions of the coefficient of speed fluctuation; the source's is ``nominal``."""


@dataclass(frozen=True)
class SteadyRotation:
    """A periodic rotation of a machine."""

    machine: Machine
    energy: Periodic
    """Kinetic energy over the travel [J]."""
    tail: float
    """Size of the highest harmonics of the energy, relative to the largest."""
    iterations: int
    """Newton steps taken with the last number of harmonics."""

    @property
    def harmonics(self) -> int:
        """Harmonics of the solution."""
        return self.energy.harmonics

    def is_converged(self, tol: float = 1e-9) -> bool:
        """Whether the highest harmonics are below ``tol`` of the largest."""
        return self.tail < tol

    def rate(self, u: Floats | float) -> Floats:
        """Speed of the crank at travel u, scalar or (n,) [rad], [rad/s]."""
        speed: Floats = np.sqrt(2.0 * self.energy(u)[0] / self.machine.inertia(u))
        return speed

    @cached_property
    def fastest(self) -> tuple[float, float]:
        """Travel [rad] and speed [rad/s] where the crank is fastest."""
        return self._extreme(1.0)

    @cached_property
    def slowest(self) -> tuple[float, float]:
        """Travel [rad] and speed [rad/s] where the crank is slowest."""
        return self._extreme(-1.0)

    @cached_property
    def period(self) -> float:
        """Time of a turn [s]: the integral of du / u'."""
        return float(2.0 * np.pi * np.mean(1.0 / self._course[1]))

    @property
    def mean_speed(self) -> float:
        """Mean over time [rad/s]."""
        return 2.0 * np.pi / self.period

    @cached_property
    def floquet(self) -> float:
        """Factor by which a small disturbance of the energy shrinks in a turn: exp of the integral of dQ/dT over u."""
        u, rate = self._course
        per_energy = self.machine.torque_slope(u, rate) / (self.machine.inertia(u) * rate)
        return float(np.exp(2.0 * np.pi * np.mean(per_energy)))

    @property
    def is_stable(self) -> bool:
        """Whether disturbances shrink."""
        return self.floquet < 1.0

    def turns_to(self, share: float) -> float:
        """Turns after which a small disturbance has shrunk to ``share``; infinite where it grows."""
        return float(np.log(share) / np.log(self.floquet)) if 0.0 < self.floquet < 1.0 else np.inf

    def fluctuation(self, definition: str = "nominal") -> float:
        """Coefficient of speed fluctuation, one of DEFINITIONS."""
        fast, slow = self.fastest[1], self.slowest[1]
        nominal = self.machine.nominal_crank
        mean = {"nominal": nominal, "time_mean": self.mean_speed, "midrange": 0.5 * (fast + slow)}
        return (fast - slow) / mean[definition]

    def residual(self) -> float:
        """Largest error of dT/du = Q - V' midway between the angles where it is satisfied, relative to T's mean [-]."""
        u = odd_grid(self.harmonics) + np.pi / (2 * self.harmonics + 1)
        rate = self.rate(u)
        error = self.energy.slope()(u)[0] - (self.machine.torque(u, rate) - self.machine.reduced.potential_slope(u))
        return float(np.abs(error).max() / np.real(self.energy.coefficients[0, 0]))

    def angle(self, u: float) -> float:
        """Crank angle of a travel, from 0 to 2 pi [rad]."""
        return float(np.mod(self.machine.reduced.direction * u, 2.0 * np.pi))

    @cached_property
    def _course(self) -> tuple[Floats, Floats]:
        """Travel and speed on a grid twice as fine as the solution's."""
        u = odd_grid(2 * self.harmonics)
        return u, self.rate(u)

    @cached_property
    def _stack(self) -> Periodic:
        """T and I with their first two derivatives."""
        inertia = Periodic(self.machine.reduced.functions.coefficients[:1])
        parts = [s.coefficients for f in (self.energy, inertia) for s in (f, f.slope(), f.slope().slope())]
        width = max(part.shape[1] for part in parts)
        return Periodic(np.vstack([np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in parts]))

    def _extreme(self, sign: float) -> tuple[float, float]:
        """The extreme on a grid, polished by Newton's method: u'^2 = 2 T / I is extreme where T' I = T I'."""
        u, rate = self._course
        first = best = float(u[int(np.argmax(sign * rate))])
        for _ in range(12):
            t, t1, t2, i, i1, i2 = self._stack(best)
            i += self.machine.constant_inertia
            bend = t2 * i - t * i2
            step = float((t1 * i - t * i1) / bend) if bend else 0.0
            best -= step
            if abs(step) < 1e-12:
                break
        if abs(best - first) > u[1]:
            best = first
        return best, float(self.rate(best))


def steady_rotation(machine: Machine, harmonics: tuple[int, ...] = HARMONICS) -> SteadyRotation:
    """The periodic rotation next to the speed at which the mean torque vanishes.

    Raises DriveError where there is none: no such speed, or the crank would have to stop on the way round.
    """
    energy, tail, iterations = Periodic(_first_guess(machine)), 1.0, 0
    for count in harmonics:
        energy, iterations = _balance(machine, energy, count)
        tail = energy.tail()
        if tail < TAIL:
            break
    return SteadyRotation(machine, energy, tail, iterations)


def _balance(machine: Machine, guess: Periodic, harmonics: int) -> tuple[Periodic, int]:
    """Newton's method on D T = Q - V'; its Jacobian is D - diag(dQ/du' / (I u')), as dT = I u' du'."""
    u = odd_grid(harmonics)
    matrix, inertia = differentiation(harmonics), machine.inertia(u)
    weight, energy = machine.reduced.potential_slope(u), guess(u)[0]
    for iteration in range(1, _ITERATIONS + 1):
        rate = np.sqrt(2.0 * energy / inertia)
        error = matrix @ energy - (machine.torque(u, rate) - weight)
        per_energy = machine.torque_slope(u, rate) / (inertia * rate)
        step = np.linalg.solve(matrix - np.diag(per_energy), error)
        share = min(1.0, 0.8 / max(float((step / energy).max()), 1e-300))
        energy = energy - share * step
        if share == 1.0 and np.abs(step).max() < 1e-13 * energy.max():
            return Periodic.through(energy[None]), iteration
        if share == 1.0 and iteration > 8 and np.abs(step).max() < 1e-10 * energy.max():
            return Periodic.through(energy[None]), iteration  # what rounding leaves where the torque is steep
    raise DriveError(
        f"{machine.reduced.mechanism.name}: no steady rotation with {harmonics} harmonics at nominal "
        f"{machine.nominal:.6g} rad/s of the motor: the kinetic energy falls to {energy.min():.3g} J on the way round"
    )


def _first_guess(machine: Machine) -> Complexes:
    """Constant kinetic energy at the highest speed where the torque, averaged over a turn, falls through zero."""
    u = odd_grid(8)
    speeds = machine.nominal_crank * np.linspace(3.0, 0.01, 120)
    mean = np.mean(machine.torque(u[:, None], speeds + 0.0 * u[:, None]), axis=0)
    rising = np.flatnonzero((mean[:-1] < 0.0) & (mean[1:] >= 0.0))
    if not len(rising):
        what = "drives faster and faster" if mean[0] > 0.0 else "never drives its loads"
        raise DriveError(
            f"{machine.reduced.mechanism.name}: no steady rotation: up to 3 times the nominal speed the motor {what}"
        )
    k = int(rising[0])
    speed = speeds[k] + (speeds[k + 1] - speeds[k]) * mean[k] / (mean[k] - mean[k + 1])
    return np.array([[0.5 * float(machine.inertia(u).mean()) * speed**2 + 0j]])
