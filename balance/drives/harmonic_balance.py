"""Steady rotation by harmonic balance, the periodic solution itself; the flywheel that a wanted fluctuation asks for.

Over the crank's travel u the kinetic energy T = I u'^2 / 2 obeys dT/du = Q(u, sqrt(2 T / I)) - V'(u). A truncated
Fourier series of T that satisfies this at as many angles as it has coefficients is found by Newton's method.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Annotated

import numpy as np
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import brentq

from ..arrays import Floats
from ..results import Brief, Key, rpm
from . import DriveError
from .equivalent_inertia import Periodic, differentiation, odd_grid
from .machine import Machine

TAIL = 1e-12
"""Size of the highest harmonics of T, relative to the largest, at which the series counts as converged."""
HARMONICS = (16, 32, 64, 128, 256, 512)
"""Harmonics tried in turn."""
_ITERATIONS = 50
_STOPPED = 1e-2
"""Share of the nominal speed below which a crank that slows down stands, or creeps round as if it did."""
_TURNS = 50
"""Within which a machine that has no steady rotation is expected to stall."""
_HALVINGS = 12
"""Of a Newton step that does not shrink the error; near the solution rounding hides what is gained."""
_LARGEST_EXPONENT = 700.0
"""Above it a growth has no number; it is shown as exp of this."""
SAME = 1e-6
"""Relative difference of mean speeds below which two solutions are one."""

DEFINITIONS = {
    "nominal": "(n_max - n_min) / n_nominal",
    "time_mean": "(n_max - n_min) / mean speed over time",
    "midrange": "2 (n_max - n_min) / (n_max + n_min)",
}
"""Definitions of the coefficient of speed fluctuation; the source's is ``nominal``."""


@dataclass(frozen=True)
class SteadyRotation(Brief):
    """A periodic rotation of a machine.

    >>> import balance
    >>> rotation = balance.drive("four-bar-dc")[0]
    >>> rotation.is_converged()
    True
    """

    machine: Machine
    energy: Periodic
    """Kinetic energy over the travel [J]."""
    tail: Annotated[float, Key("highest_harmonics")]
    """Size of the highest harmonics of the energy, relative to the largest."""
    iterations: int
    """Newton steps taken with the last number of harmonics."""

    @property
    def harmonics(self) -> Annotated[int, Key()]:
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
    def period(self) -> Annotated[float, Key("period_s")]:
        """Time of a turn [s]: the integral of du / u'."""
        return float(2.0 * np.pi * np.mean(1.0 / self._course[1]))

    @property
    def mean_speed(self) -> Annotated[float, Key("mean_rpm", to=rpm)]:
        """Mean over time [rad/s]."""
        return 2.0 * np.pi / self.period

    @cached_property
    def floquet(self) -> Annotated[float, Key("floquet_factor")]:
        """Factor by which a small disturbance of the energy shrinks in a turn: exp of the integral of dQ/dT over u."""
        u, rate = self._course
        per_energy = self.machine.torque_slope(u, rate) / (self.machine.inertia(u) * rate)
        return float(np.exp(min(2.0 * np.pi * float(np.mean(per_energy)), _LARGEST_EXPONENT)))

    @property
    def is_stable(self) -> Annotated[bool, Key("stable")]:
        """Whether disturbances shrink."""
        return self.floquet < 1.0

    def turns_to(self, share: float) -> float:
        """Turns after which a small disturbance has shrunk to ``share``; infinite where it grows."""
        shrinks = max(self.floquet, float(np.finfo(float).tiny))  # what shrinks to nothing in a turn underflows
        return float(np.log(share) / np.log(shrinks)) if shrinks < 1.0 else np.inf

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


def steady_rotations(machine: Machine) -> list[SteadyRotation]:
    """Every periodic rotation next to a speed at which the mean torque vanishes, the fastest first.

    Between two stable ones lies an unstable one. Raises DriveError where there is none: no such speed, or the crank
    would have to stop on the way round.
    """
    found: list[SteadyRotation] = []
    refusal: DriveError | None = None
    for speed in _balanced_speeds(machine):
        for power in (0.0, 1.0):
            try:
                solution = _solved(machine, speed, HARMONICS, power)
            except DriveError as error:
                refusal = refusal or error
                continue
            known = (abs(solution.mean_speed / other.mean_speed - 1.0) < SAME for other in found)
            if not any(known) and (solution.is_converged() or not found):
                found.append(solution)
    if refusal and not found:
        raise _stalled(machine) or refusal
    return sorted(found, key=lambda solution: -solution.mean_speed)


def steady_rotation(
    machine: Machine, harmonics: tuple[int, ...] = HARMONICS, near: float | None = None
) -> SteadyRotation:
    """The fastest periodic rotation, or the one next to a speed of the crank ``near`` [rad/s].

    Raises DriveError where there is none.
    """
    speed = _balanced_speed(machine, near)
    try:
        return _solved_from_either(machine, speed, harmonics)
    except DriveError as refusal:
        raise _stalled(machine) or refusal from None


def _stalled(machine: Machine) -> DriveError | None:
    """Where it stalls, for a machine without a steady rotation; None where the energy does not tell."""
    if (angle := _stall(machine)) is None:
        return None
    return DriveError(
        f"{machine.reduced.mechanism.name}: at {rpm(machine.nominal):.6g} rpm it stalls or all but stands: the "
        f"load uses up what motor and stored energy give, at {np.degrees(angle):.0f} deg; a flywheel may carry it "
        "on (--flywheel-for, in Python flywheel_for)"
    )


def _solved_from_either(machine: Machine, speed: float, harmonics: tuple[int, ...] = HARMONICS) -> SteadyRotation:
    """From constant energy, else from constant speed. Raises DriveError where neither leads to a solution."""
    try:
        return _solved(machine, speed, harmonics, 0.0)
    except DriveError:
        return _solved(machine, speed, harmonics, 1.0)


def _solved(machine: Machine, speed: float, harmonics: tuple[int, ...], power: float) -> SteadyRotation:
    """With more and more harmonics, from kinetic energy in proportion to inertia to a ``power``.

    Constant energy (0) is near where the motor's speed yields to the torque, constant speed (1) where it hardly does.
    """
    inertia, mean = machine.inertia(odd_grid(harmonics[0])), float(machine.inertia(odd_grid(8)).mean())
    energy = Periodic.through(0.5 * speed**2 * mean * (inertia[None] / mean) ** power)
    tail, iterations = 1.0, 0
    for count in harmonics:
        energy, iterations = _balance(machine, energy, count)
        tail = energy.tail()
        if tail < TAIL:
            break
    return SteadyRotation(machine, energy, tail, iterations)


def _balance(machine: Machine, guess: Periodic, harmonics: int) -> tuple[Periodic, int]:
    """Newton's method on D T = Q - V'; its Jacobian is D - diag(dQ/du' / (I u')), as dT = I u' du'.

    A step is halved until the largest error shrinks, and never takes more than four fifths of the energy.
    """
    u = odd_grid(harmonics)
    matrix, inertia = differentiation(harmonics), machine.inertia(u)
    weight, energy = machine.reduced.potential_slope(u), guess(u)[0]

    def gap(energy: Floats) -> tuple[Floats, Floats]:
        rate = np.sqrt(2.0 * energy / inertia)
        return rate, matrix @ energy - (machine.torque(u, rate) - weight)

    energy = np.maximum(energy, 1e-6 * energy.max())
    rate, error = gap(energy)
    for iteration in range(1, _ITERATIONS + 1):
        per_energy = machine.torque_slope(u, rate) / (inertia * rate)
        step = np.linalg.solve(matrix - np.diag(per_energy), error)
        share = min(1.0, 0.8 / max(float((step / energy).max()), 1e-300))
        size, whole = float(np.linalg.norm(error)), share == 1.0
        for _ in range(_HALVINGS):
            rate, error = gap(energy - share * step)
            if float(np.linalg.norm(error)) < size:
                break
            share *= 0.5
        energy = energy - share * step
        small = np.abs(step).max() / energy.max()
        if whole and (small < 1e-13 or (iteration > 8 and small < 1e-10)):  # 1e-10 remains where the torque is steep
            return Periodic.through(energy[None]), iteration
    raise DriveError(f"{machine.reduced.mechanism.name}: no steady rotation was found with {harmonics} harmonics")


def _stall(machine: Machine) -> float | None:
    """Angle at which a crank of nominal speed at travel 0 comes to stand or creep [rad]; None where it goes on."""

    def slope(u: float, energy: Floats) -> Floats:
        rate = np.sqrt(2.0 * np.maximum(energy, 0.0) / machine.inertia(u))
        return np.array([float(machine.torque(u, float(rate[0])) - machine.reduced.potential_slope(u))])

    def used_up(_u: float, energy: Floats) -> float:
        return float(energy[0]) - _STOPPED**2 * start

    used_up.terminal = True  # type: ignore[attr-defined]
    start = 0.5 * float(machine.inertia(0.0)) * machine.nominal_crank**2
    course = solve_ivp(slope, (0.0, _TURNS * 2.0 * np.pi), [start], events=used_up, rtol=1e-6, atol=1e-9 * start)
    if course.status == 0:
        return None
    return float(np.mod(machine.reduced.direction * course.t[-1], 2.0 * np.pi))


def _balanced_speeds(machine: Machine) -> list[float]:
    """Speeds of the crank at which the torque, averaged over a turn, vanishes, the fastest first [rad/s].

    Raises DriveError where there is none that the motor keeps, up to three times the nominal speed.
    """
    u = odd_grid(8)
    speeds = machine.nominal_crank * np.linspace(3.0, 0.01, 300)
    torque = machine.torque(u[:, None], speeds + 0.0 * u[:, None], machine.reduced.gains(u)[:, :, None])
    mean = np.mean(torque, axis=0)
    size = np.abs(np.pad(mean, 1, mode="edge"))
    pole = size[1:-2] + size[2:-1] > size[:-3] + size[3:]  # of a curve beyond its range: no speed of no torque
    changes = np.flatnonzero(((mean[:-1] < 0.0) != (mean[1:] < 0.0)) & ~pole)
    if not (mean[changes] < 0.0).any():
        what = "drives faster and faster" if mean[0] > 0.0 else "never drives its loads"
        raise DriveError(
            f"{machine.reduced.mechanism.name}: no steady rotation: up to 3 times the nominal speed the motor {what}"
        )
    steps = np.diff(speeds)[changes] * mean[changes] / (mean[changes] - mean[changes + 1])
    return [float(speed) for speed in speeds[changes] + steps]


def _balanced_speed(machine: Machine, near: float | None) -> float:
    """The fastest of them, or that next to a speed of the crank ``near`` [rad/s]."""
    speeds = _balanced_speeds(machine)
    return speeds[0] if near is None else min(speeds, key=lambda n: abs(n - near))


@dataclass(frozen=True)
class Flywheel:
    """A flywheel on the crank's or the motor's shaft."""

    inertia: Annotated[float, Key("inertia_kgm2")]
    """About its own shaft; zero where none is needed [kg m2]."""
    side: Annotated[str, Key()]
    """``crank`` or ``motor``."""
    fluctuation: Annotated[float, Key()]
    """Coefficient of speed fluctuation with it."""
    wanted: Annotated[float, Key("wanted_fluctuation")]
    """What was asked for at most; more than ``fluctuation`` where a smaller one leaves no steady rotation."""
    mean_speed: Annotated[float, Key("mean_rpm", to=rpm)]
    """Of the crank with it, over time [rad/s]."""


def flywheel_for(
    machine: Machine, wanted: float, definition: str = "nominal", side: str = "crank", near: float | None = None
) -> Flywheel:
    """The smallest flywheel with which the fluctuation is at most ``wanted``, the motor's own answer included.

    Of the fastest steady rotation, or of that next to a speed of the crank ``near`` [rad/s]; the machine may stall
    without a flywheel. Raises DriveError where even 1e6 times the machine's own inertia does not.
    """
    if not 0.0 < wanted < 2.0:
        raise DriveError(f"wanted coefficient of fluctuation is {wanted:g}: expected a number between 0 and 2")
    enough: dict[float, Flywheel] = {}
    speed = _balanced_speed(machine, near)  # which inertia does not change: where there is none, no flywheel helps

    @cache
    def excess(inertia: float) -> float:
        try:
            rotation = _solved_from_either(machine.with_flywheel(inertia, side), speed)
        except DriveError:
            return 2.0  # as where it stalls
        found = rotation.fluctuation(definition)
        if found <= wanted:
            enough[inertia] = Flywheel(inertia, side, found, wanted, rotation.mean_speed)
        return found - wanted

    if excess(0.0) <= 0.0:
        return enough[0.0]
    own = float(np.mean(machine.inertia(np.linspace(0.0, 2.0 * np.pi, 64)))) / (
        machine.ratio**2 if side == "motor" else 1
    )
    low, high = 0.0, own
    while excess(high) > 0.0:
        low, high = high, 4.0 * high
        if high > 1e6 * own:
            raise DriveError(f"no flywheel up to {high:.3g} kg m2 brings the fluctuation down to {wanted:g}")
    brentq(excess, low, high, xtol=1e-12 * own, rtol=1e-12)
    return enough[min(enough)]


def flywheel_estimate(machine: Machine, wanted: float) -> float:
    """The textbook's whole inertia dE / (omega^2 delta) [kg m2], dE the swing of energy that loads and weight make.

    At nominal speed, under the constant torque that keeps it up. The motor's answer and what the inertia's variation
    makes are left out: an estimate to compare the solution with.
    """
    u = np.linspace(0.0, 2.0 * np.pi, 20_001)
    rate = np.full(len(u), machine.nominal_crank)
    loads: Floats = np.asarray(machine.torque(u, rate) - machine.motor_torque(rate))
    work = cumulative_trapezoid(loads, u, initial=0)
    energy = work - work[-1] * u / u[-1] - machine.reduced.potential(u)
    return float(np.ptp(energy)) / (machine.nominal_crank**2 * wanted)
