"""One slider-crank, exactly: what it exerts on its base at any speed and acceleration of its crank.

Plane of the cylinder: x along the cylinder's axis away from the crank, y a quarter turn on in the sense of rotation;
vectors are complex numbers x + iy. theta = 0 is the crank along x, the top dead centre of a cylinder without offset.
Pin B = r e^(i theta), piston C = s + i e with s = r cos theta + sqrt(l^2 - w^2), w = r sin theta - e; the rod leans by
chi = -asin(w / l). Shaking force F = -sum m d2p/dt2, moment M = -dL/dt about the crank's axis, weight excluded. The
reciprocating force by orders is -s'' / r = Re sum_k c_k e^(i k theta).

Point masses replace the rod exactly if they have its mass, its centre of mass and (third condition) its inertia. Two
masses at the pins keep the first two: the shaking force is true, the moment is off by the couple -dI chi''.

Partial balance: a counterweight m_b r_b opposite the pin balances the rotating unbalance and a fraction c of the
reciprocating one: m_b r_b = (rotating) + c m r. The residual force is m r omega^2 (f(theta) - c e^(i theta)), f the
reciprocating force.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from ..arrays import Complexes, Floats, root_mean_square
from ..errors import DataError
from ..results import Key, milli

_SAMPLES = 8192
"""Of a turn, for the discrete Fourier transform."""
_GRID = 3600
"""Crank angles at which an extreme is first looked for."""
_MEAN = 7200
"""Crank angles of a mean square."""
Model = Literal["order1", "order2", "exact"]
MODELS: tuple[Model, ...] = ("order1", "order2", "exact")
"""First order alone; first and second; the exact motion."""
_ANGLE_DECIMALS = 5
"""Of the angle of a largest value [deg]: about a largest value, rounding of the value hides changes of the angle."""


@dataclass(frozen=True)
class SliderCrank:
    """Crank, connecting rod and piston."""

    radius: float
    """Crank radius r [m]."""
    rod_length: float
    """Connecting rod l, pin to pin [m]."""
    crank_mass: float = 0.0
    """[kg]"""
    crank_centre: float = 0.0
    """Centre of mass of the crank along its throw; negative is opposite the pin [m]."""
    crank_inertia: float = 0.0
    """Of the crank about its own centre of mass [kg m2]."""
    rod_mass: float = 0.0
    """[kg]"""
    rod_centre: float = 0.0
    """Centre of mass of the rod from the crank pin l_B [m]."""
    rod_inertia: float = 0.0
    """Of the rod about its own centre of mass [kg m2]."""
    piston_mass: float = 0.0
    """Piston, pin and all that only slides [kg]."""
    offset: float = 0.0
    """Distance e of the cylinder's axis from the crank's, towards y: where the pin goes from top dead centre [m]."""

    def __post_init__(self) -> None:
        """Refuse a crank that cannot make a full turn."""
        if not self.radius > 0.0 or not self.rod_length > self.radius + abs(self.offset):
            raise DataError(
                f"crank {self.radius:g} m, rod {self.rod_length:g} m, offset {self.offset:g} m: expected a rod longer "
                "than crank and offset together, or the crank cannot make a full turn"
            )

    @property
    def ratio(self) -> float:
        """Lambda = r / l."""
        return self.radius / self.rod_length

    @property
    def dead_centre(self) -> float:
        """Its top dead centre: crank and rod in one line, asin(e / (r + l)) [rad]."""
        return float(np.arcsin(self.offset / (self.radius + self.rod_length)))

    @property
    def rotating_unbalance(self) -> float:
        """Crank, and the rod's mass at the pin m l_C / l, times their radii [kg m]."""
        at_pin = self.rod_mass * (self.rod_length - self.rod_centre) / self.rod_length
        return self.crank_mass * self.crank_centre + at_pin * self.radius

    @property
    def reciprocating_mass(self) -> float:
        """Piston, and the rod's mass at the piston m l_B / l [kg]."""
        return self.piston_mass + self.rod_mass * self.rod_centre / self.rod_length

    def force(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Complexes:
        """Shaking force at crank angles (n,) [rad], speed [rad/s] and acceleration [rad/s2], (n,) [N]."""
        force: Complexes = np.zeros(np.shape(theta), dtype=complex)
        for mass, _, first, second in self._points(theta):
            force = force - mass * (first * alpha + second * omega**2)
        return force

    def moment(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Shaking moment about the crank's axis, in the sense of rotation, (n,) [N m].

        M = -sum m Im(conj(p) d2p/dt2) - I chi'' of the rod - I alpha of the crank; the rod's true inertia is in it.
        """
        lean, lean_rate = self._lean(theta)
        moment = -self.crank_inertia * np.asarray(alpha) - self.rod_inertia * (lean * alpha + lean_rate * omega**2)
        for mass, place, first, second in self._points(theta):
            moment = moment - mass * (place.conj() * (first * alpha + second * omega**2)).imag
        return np.asarray(moment)

    def torque(self, theta: Floats, omega: float | Floats, alpha: float | Floats = 0.0) -> Floats:
        """Torque on the crank that this motion needs, without weight and gas, (n,) [N m].

        Q = J alpha + 1/2 dJ/dtheta omega^2 with J = sum m |dp/dtheta|^2 + I (dchi/dtheta)^2.
        """
        lean, lean_rate = self._lean(theta)
        torque = self.crank_inertia * np.asarray(alpha) + self.rod_inertia * lean * (
            lean * alpha + lean_rate * omega**2
        )
        for mass, _, first, second in self._points(theta):
            torque = torque + mass * (first.conj() * (first * alpha + second * omega**2)).real
        return np.asarray(torque)

    def reciprocation(self, theta: Floats) -> Floats:
        """Exact -s'' / r at crank angles (n,) [rad]: reciprocating force by m r omega^2 at constant speed, (n,) [-]."""
        return -self._slide(theta)[2] / self.radius

    def _rod(self, theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """r sin theta and r cos theta; the rod across the axis, w, and along it, (n,) [m]."""
        sine, cosine = self.radius * np.sin(theta), self.radius * np.cos(theta)
        w = sine - self.offset
        return sine, cosine, w, np.sqrt(self.rod_length**2 - w**2)

    def _slide(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """Piston's place along the axis and its derivatives by theta, (n,) [m]."""
        sine, cosine, w, q = self._rod(theta)
        return cosine + q, -sine - w * cosine / q, -cosine - (cosine**2 - w * sine) / q - (w * cosine) ** 2 / q**3

    def _lean(self, theta: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of the rod's angle chi = -asin(w / l) by theta, (n,)."""
        sine, cosine, w, q = self._rod(theta)
        return -cosine / q, sine / q - w * cosine**2 / q**3

    def _points(self, theta: Floats) -> list[tuple[float, Complexes, Complexes, Complexes]]:
        """Mass, place and its derivatives by theta of the three centres of mass: crank, rod, piston."""
        turned = np.exp(1j * np.asarray(theta))
        pin = self.radius * turned, 1j * self.radius * turned, -self.radius * turned
        place, first, second = self._slide(theta)
        piston = place + 1j * self.offset, first + 0j, second + 0j
        share = self.rod_centre / self.rod_length
        rod = [(1.0 - share) * b + share * c for b, c in zip(pin, piston, strict=True)]
        crank = [self.crank_centre / self.radius * b for b in pin]
        return [
            (self.crank_mass, crank[0], crank[1], crank[2]),
            (self.rod_mass, rod[0], rod[1], rod[2]),
            (self.piston_mass, *piston),
        ]


@dataclass(frozen=True)
class PointMass:
    """A mass on the rod's line."""

    place: Annotated[str, Key()]
    mass: Annotated[float, Key("mass_kg")]
    """[kg]"""
    at: Annotated[float, Key("at_mm", to=milli)]
    """Distance from the crank pin, towards the piston pin [m]."""


@dataclass(frozen=True)
class Replacement:
    """Point masses in the rod's place."""

    name: Annotated[str, Key("replacement")]
    masses: Annotated[tuple[PointMass, ...], Key()]
    missing_inertia: Annotated[float, Key("missing_inertia_kgm2")]
    """Inertia of the rod minus that of the masses, about the rod's centre of mass [kg m2]; zero keeps the third
    condition."""


def replacements(crank: SliderCrank) -> list[Replacement]:
    """Two masses at the pins; two masses of which one at the crank pin, exact; three masses, exact.

    None of a rod without mass, or whose centre is not between its pins.
    The two at the pins: m_B = m l_C / l, m_C = m l_B / l. Exact with one at the pin: the other at the centre of
    percussion, I / (m l_B) beyond the centre. Three: m_B = I / (l_B l), m_C = I / (l_C l), the rest at the centre.
    """
    if not (crank.rod_mass and 0.0 < crank.rod_centre < crank.rod_length):
        return []
    mass, inertia, length = crank.rod_mass, crank.rod_inertia, crank.rod_length
    l_b, l_c = crank.rod_centre, crank.rod_length - crank.rod_centre
    beyond = inertia / (mass * l_b)
    first, last = inertia / (l_b * length), inertia / (l_c * length)
    at_pins = [("crank pin", mass * l_c / length, 0.0), ("piston pin", mass * l_b / length, length)]
    percussion = [
        ("crank pin", mass * beyond / (l_b + beyond), 0.0),
        ("centre of percussion", mass * l_b / (l_b + beyond), l_b + beyond),
    ]
    three = [("crank pin", first, 0.0), ("centre of mass", mass - first - last, l_b), ("piston pin", last, length)]
    named = {
        "two masses at the pins": at_pins,
        "two masses, one at the centre of percussion": percussion,
        "three masses": three,
    }
    replaced = []
    for name, masses in named.items():
        missing = inertia - sum(m * (at - l_b) ** 2 for _, m, at in masses)
        missing = missing if abs(missing) > 1e-12 * inertia else 0.0
        replaced.append(Replacement(name, tuple(PointMass(*each) for each in masses), missing))
    return replaced


def rod_findings(crank: SliderCrank) -> list[str]:
    """A rod whose radius of gyration reaches beyond both its pins, as no connecting rod's does; empty otherwise."""
    if not 0.0 < crank.rod_centre < crank.rod_length or crank.rod_mass == 0.0:
        return []
    gyration, far = float(np.sqrt(crank.rod_inertia / crank.rod_mass)), crank.rod_length - crank.rod_centre
    if gyration <= max(crank.rod_centre, far):
        return []
    return [
        f"rod: inertia {crank.rod_inertia:.4g} kg m2 means a radius of gyration of {1e3 * gyration:.4g} mm, and its "
        f"pins are {1e3 * crank.rod_centre:.4g} and {1e3 * far:.4g} mm from its centre of mass: no rod has that; check "
        "rod_inertia, about the centre of mass, and its unit"
    ]


def exact_series(crank: SliderCrank, orders: int = 8) -> dict[int, complex]:
    """Coefficients c_k of the exact motion by order k = 1, 2, ... [-]."""
    theta = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    spectrum = np.fft.rfft(crank.reciprocation(theta)) * 2.0 / _SAMPLES
    return {k: complex(spectrum[k]) for k in range(1, orders + 1)}


def second_order(crank: SliderCrank) -> dict[int, complex]:
    """The usual approximation, c_1 = 1 - i e / l and c_2 = r / l [-], from s = r cos theta + l - w^2 / (2 l)."""
    return {1: 1.0 - 1j * crank.offset / crank.rod_length, 2: complex(crank.ratio)}


def largest_over_turn(function: Callable[[Floats], Floats]) -> tuple[float, float]:
    """Largest value over a turn of a ``function`` of crank angles (n,) [rad], in its unit, and its angle [rad].

    Searched on ever finer grids.
    """
    theta, step = crank_angles(_GRID), 2 * np.pi / _GRID
    best = float(theta[int(np.argmax(function(theta)))])
    for _ in range(9):
        theta = best + step * np.linspace(-1.0, 1.0, 21)
        best = float(theta[int(np.argmax(function(theta)))])
        step /= 10.0
    return float(function(np.array([best]))[0]), best


def crank_angles(count: int) -> Floats:
    """So many crank angles over one turn, its end excluded, (count,) [rad]."""
    return 2 * np.pi * np.arange(count) / count


def reciprocating_force(crank: SliderCrank, theta: Floats, model: Model) -> Floats:
    """Reciprocating force by m r omega^2 at crank angles (n,) [rad], (n,) [-]."""
    if model == "exact":
        return crank.reciprocation(theta)
    orders = {k: c for k, c in second_order(crank).items() if model == "order2" or k == 1}
    return np.asarray(sum((c * np.exp(1j * k * np.asarray(theta))).real for k, c in orders.items()))


def residual_force(
    crank: SliderCrank, counterweight: float, theta: Floats, omega: float, model: Model = "exact"
) -> Complexes:
    """Shaking force at crank angles (n,) [rad] and constant speed [rad/s], (n,) [N].

    The ``counterweight`` m_b r_b [kg m] is opposite the pin.
    """
    inline = crank.reciprocating_mass * crank.radius * reciprocating_force(crank, theta, model)
    return omega**2 * (inline + (crank.rotating_unbalance - counterweight) * np.exp(1j * np.asarray(theta)))


def counterweight(crank: SliderCrank, fraction: float) -> float:
    """m_b r_b for the rotating unbalance and a fraction of the reciprocating one [kg m]."""
    return crank.rotating_unbalance + fraction * crank.reciprocating_mass * crank.radius


class BestCounterweight(NamedTuple):
    """The fraction whose largest shaking force is least."""

    fraction: float
    largest: float
    """Largest |F| / (m r omega^2)."""


def best_fraction(crank: SliderCrank, model: Model = "exact") -> BestCounterweight:
    """Minimise over c the largest over theta of |f - c e^(i theta)|^2 = f^2 - 2 c f cos theta + c^2, convex in c.

    Bisection on the sign of its slope, -2 f cos theta + 2 c at the theta of the largest force.
    """

    def largest(fraction: float) -> tuple[float, float]:
        def square(theta: Floats) -> Floats:
            f = reciprocating_force(crank, theta, model)
            return np.asarray(f**2 - 2.0 * fraction * f * np.cos(theta) + fraction**2)

        return largest_over_turn(square)

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        theta = np.array([largest(middle)[1]])
        if (middle - reciprocating_force(crank, theta, model) * np.cos(theta))[0] > 0.0:
            high = middle
        else:
            low = middle
    fraction = 0.5 * (low + high)
    return BestCounterweight(fraction, float(np.sqrt(largest(fraction)[0])))


LEAST_RMS_FRACTION = 0.5
"""The fraction of least mean square, Re c_1 / 2: beside r cos theta, s depends on sin theta alone, so Re c_1 = 1."""


@dataclass(frozen=True)
class Extremes:
    """Of a shaking force over one turn [N]."""

    largest: Annotated[float, Key("F_max_N")]
    at_deg: Annotated[float, Key("F_max_at_deg")]
    """Crank angle of the largest [deg]."""
    least: Annotated[float, Key("F_min_N")]
    rms: Annotated[float, Key("F_rms_N")]
    x: Annotated[tuple[float, float], Key("Fx_N")]
    """Least and largest component along the cylinder's axis."""
    y: Annotated[tuple[float, float], Key("Fy_N")]
    """Least and largest component across."""


def residual_extremes(crank: SliderCrank, counterweight: float, omega: float, model: Model) -> Extremes:
    """Extremes of the residual force with a counterweight m_b r_b [kg m] at constant speed [rad/s]."""

    def force(theta: Floats) -> Complexes:
        return residual_force(crank, counterweight, theta, omega, model)

    values = force(crank_angles(_MEAN))
    top, at = largest_over_turn(lambda theta: np.abs(force(theta)))
    low, _ = largest_over_turn(lambda theta: -np.abs(force(theta)))
    x, y = ((float(part.min()), float(part.max())) for part in (values.real, values.imag))
    angle = round(float(np.degrees(at)), _ANGLE_DECIMALS) % 360.0
    return Extremes(top, angle, -low, root_mean_square(values), x, y)
