"""Free forces and moments of an engine by orders, as vectors that turn with and against the crankshaft.

The force of order k along a cylinder at beta is the real part of a turning vector; it is half of it turning forward
and half backward. Per omega^2, with a = m r c_k (see ``slider_crank``):
forward P_k = 1/2 sum a e^(i (k phi - (k - 1) beta)), backward N_k = 1/2 sum conj(a) e^(-i (k phi - (k + 1) beta)),
F_k = omega^2 (P_k e^(i k theta) + N_k e^(-i k theta)): an ellipse of half-axes |P| + |N| and ||P| - |N||. What turns
with the crankshaft (rotating masses, counterweights) is in P_1. Moments are the same sums times z.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..arrays import Complexes, Floats
from ..errors import DataError
from . import slider_crank
from .engine import Engine

Series = Literal["second-order", "exact"]


@dataclass(frozen=True)
class RotatingVector:
    """One order of a force [kg m] or of a moment [kg m2], per omega^2."""

    order: int
    forward: complex
    """Turns at order times the crankshaft's speed, with it."""
    backward: complex
    """Turns as fast against it."""

    @property
    def largest(self) -> float:
        """Long half-axis of the ellipse."""
        return abs(self.forward) + abs(self.backward)

    @property
    def least(self) -> float:
        """Short half-axis; zero where the force swings in one plane."""
        return abs(abs(self.forward) - abs(self.backward))

    @property
    def direction(self) -> float:
        """Angle of the long half-axis from x [rad]."""
        return float(np.angle(self.forward) + np.angle(self.backward)) / 2.0

    def at(self, theta: Floats) -> Complexes:
        """Value at crank angles (n,) [rad], per omega^2, (n,) [kg m] or [kg m2]."""
        return self.forward * np.exp(1j * self.order * theta) + self.backward * np.exp(-1j * self.order * theta)


@dataclass(frozen=True)
class FreeForces:
    """Free force and moment of one order."""

    force: RotatingVector
    moment: RotatingVector
    """About ``about``, in the direction of the forces: see Engine.tilting."""
    about: float
    """[m]"""

    @property
    def place(self) -> float | None:
        """Where the resultant acts along the crankshaft, z = M / F [m]; None for a couple, or where it moves.

        The place is fixed where forward and backward part act at one z.
        """
        pairs = [(self.force.forward, self.moment.forward), (self.force.backward, self.moment.backward)]
        size, largest = self.force.largest, self.moment.largest
        if size <= 0.0:
            return None
        acting = [(f, m) for f, m in pairs if abs(f) > 1e-9 * size]
        silent = [m for f, m in pairs if abs(f) <= 1e-9 * size]
        places = [m / f for f, m in acting]
        scale = max(largest / size, 1e-12)
        if any(abs(z - places[0]) > 1e-9 * scale or abs(z.imag) > 1e-9 * scale for z in places):
            return None
        if any(abs(m) > 1e-9 * largest for m in silent):
            return None
        return self.about + places[0].real


def free_forces(
    engine: Engine, orders: int = 8, kind: Series = "exact", about: float | None = None
) -> list[FreeForces]:
    """Free forces and moments of orders 1 to ``orders`` about a place [m], by default the middle.

    ``kind``: the exact motion, or its usual approximation by first and second order.
    """
    if orders < 1:
        raise DataError(f"orders 1 to {orders}: expected one order at least")
    point = engine.middle if about is None else about
    size, length = force_scale(engine, point)
    free = []
    for k in range(1, (2 if kind == "second-order" else orders) + 1):
        force, moment = _sums(engine, k, kind, point)
        free.append(FreeForces(_clean(k, force, size), _clean(k, moment, size * length), point))
    return free


def force_scale(engine: Engine, about: float) -> tuple[float, float]:
    """Unbalance of all cylinders if they acted in phase [kg m], and the longest arm about a place [m]."""
    size = sum(c.crank.reciprocating_mass * c.crank.radius + abs(c.crank.rotating_unbalance) for c in engine.cylinders)
    return size, max((abs(c.at - about) for c in engine.cylinders), default=0.0)


def _sums(engine: Engine, k: int, kind: Series, about: float) -> tuple[list[complex], list[complex]]:
    """Forward and backward part of the force, and of the moment."""
    force, moment = np.zeros(2, dtype=complex), np.zeros(2, dtype=complex)
    for cylinder in engine.cylinders:
        crank, phi, beta = cylinder.crank, cylinder.throw, cylinder.bank
        coefficients = slider_crank.exact_series(crank, k) if kind == "exact" else slider_crank.second_order(crank)
        a = crank.reciprocating_mass * crank.radius * coefficients[k]
        forward = 0.5 * a * np.exp(1j * (k * phi - (k - 1) * beta))
        if k == 1:
            forward = forward + crank.rotating_unbalance * np.exp(1j * phi)
        parts = np.array([forward, 0.5 * a.conjugate() * np.exp(-1j * (k * phi - (k + 1) * beta))])
        force, moment = force + parts, moment + (cylinder.at - about) * parts
    for weight in engine.counterweights if k == 1 else ():
        force[0] += weight.vector
        moment[0] += (weight.at - about) * weight.vector
    return [complex(x) for x in force], [complex(x) for x in moment]


def _clean(order: int, parts: list[complex], size: float) -> RotatingVector:
    """Sums that are rounding error of their terms are zero."""
    forward, backward = (0j if abs(part) <= 1e-13 * size else part for part in parts)
    return RotatingVector(order, forward, backward)


def cylinder_sums(engine: Engine, order: int) -> dict[str, tuple[float, float]]:
    """The textbook's sums of an in-line engine: (sum cos k phi, sum sin k phi), and those weighted by z [m].

    F_k = m r omega^2 c_k (S_c cos k theta - S_s sin k theta); z counts from the first cylinder.
    """
    phi = np.array([c.throw - c.bank for c in engine.cylinders])
    z = np.array([c.at - engine.cylinders[0].at for c in engine.cylinders])
    cosine, sine = np.cos(order * phi), np.sin(order * phi)
    rounding = 1e-12 * len(phi) * max(1.0, float(np.abs(z).max()))

    def clean(value: float) -> float:
        return value if abs(value) > rounding else 0.0

    return {
        "force": (clean(float(cosine.sum())), clean(float(sine.sum()))),
        "moment": (clean(float(z @ cosine)), clean(float(z @ sine))),
    }
