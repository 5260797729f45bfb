"""The method's equations in symbols, as the source writes them: counter-masses, inertias, gears, two-point masses."""

from dataclasses import dataclass
from typing import Annotated

from ..results import Key
from .equivalence_method import LinkageBalance
from .expressions import Expression
from .force_balance import EquivalentLoad, ForceBalance
from .linkage import Disc
from .moment_balance import BodyMoment, GearResult


@dataclass(frozen=True)
class Equation:
    """One equation of a body."""

    body: Annotated[str, Key()]
    text: Annotated[str, Key("equation")]
    value: Annotated[float | None, Key("value_{0.unit}", optional=True)] = None
    """Of its left-hand side, in SI; None where it is a condition."""

    @property
    def unit(self) -> str:
        """Of its value, as in keys: masses in kg, inertias in kg m2."""
        return "kg" if self.text.startswith("m") else "kgm2"


def linkage_equations(result: LinkageBalance) -> list[Equation]:
    """All equations, in the order in which they are solved."""
    found: list[Equation] = []
    for balance in result.force.values():
        found += _force(result, balance)
    if result.moment is None:
        return found
    gears = {gear.gear.body: gear for gear in result.moment.gears.values()}
    for name, body in result.moment.bodies.items():
        found += _force(result, body.extra)
        if name in result.linkage.two_point:
            found += _two_point(result, body)
        elif body.terms:
            total = " + ".join(term.text for term in body.terms)
            found.append(Equation(name, f"I[{name}] = {total}", body.inertia))
        if name in gears:
            found += _gear(gears[name])
    return found


def _force(result: LinkageBalance, balance: ForceBalance) -> list[Equation]:
    """sum(m r) + sum(m* p) = 0 about the reduction joint, an axis a line; solved where one counter-mass is in it."""
    if not balance.counters:
        return []
    place, body = balance.counters[0].place, balance.body
    off_origin = [load for load in balance.loads if not load.at.is_zero]
    if place.radius is not None:
        loads = " + ".join(f"{load.text} r[{load.source}]" for load in off_origin)
        text = f"|{loads}| / {place.radius.factor_text()}, on the other side"
    elif shaped := result.linkage.two_point.get(body):  # its centre of mass comes onto the line of its joints
        loads, line = " + ".join(f"{load.text} n[{load.source}]" for load in off_origin), " ".join(shaped.joints)
        text = f"({loads}) / -n[{balance.counters[0].symbol}], n across the line {line}"
    else:
        text = ""
    (first, *_) = balance.counters
    lines = [Equation(body, f"{first.symbol} = {text}", first.mass)] if text else _axes(result, balance)
    rules = [(counter.place.inertia_text(), counter.inertia) for counter in balance.counters]
    return [*lines, *(Equation(body, rule, inertia) for rule, inertia in rules if rule)]


def _axes(result: LinkageBalance, balance: ForceBalance) -> list[Equation]:
    found = []
    places = [(c, c.place.point) for c in balance.counters if c.place.point is not None]
    for axis in "xy":
        at: list[tuple[EquivalentLoad, Expression]] = [(load, getattr(load.at, axis)) for load in balance.loads]
        loads = [f"{load.text} {arm.factor_text()}" for load, arm in at if not arm.is_zero]
        arms = [(counter, getattr(result.arm(place, balance.body), axis)) for counter, place in places]
        arms = [(counter, arm) for counter, arm in arms if not arm.is_zero]
        if len(arms) == 1:
            ((counter, arm),) = arms
            total = " + ".join(loads) if len(loads) == 1 else f"({' + '.join(loads)})"
            divisor = arm.times(-1.0).factor_text()
            found.append(Equation(balance.body, f"{counter.symbol} = {total or '0'} / {divisor}", counter.mass))
        elif terms := [*loads, *(f"{counter.symbol} {arm.factor_text()}" for counter, arm in arms)]:
            found.append(Equation(balance.body, f"{axis}: {' + '.join(terms)} = 0"))
    return found


def _gear(gear: GearResult) -> list[Equation]:
    """I_z = (Z*/Z) I; a real gear's disc goes with the square of its pitch diameter d."""
    z, z_star = gear.gear.teeth
    name, body = gear.gear.name, gear.gear.body
    found = [Equation(body, f"I_{name} = (Z*/Z) I[{body}], Z = {z}, Z* = {z_star}", gear.inertia)]
    wheel = gear.gear.wheel
    if isinstance(wheel, Disc):
        disc = f"m_{name} = {wheel.mass:g} kg (d / {wheel.diameter:g} m)^2, d = 2 a Z / (Z + Z*)"
        found.append(Equation(body, disc, gear.wheel_mass))
        found.append(Equation(body, f"I_m_{name} = m_{name} d^2 / 8", gear.wheel_inertia))
    if gear.gear.counter_gyration is not None:
        found.append(Equation(body, f"m_{name}* = I_{name} / ({gear.gear.counter_gyration:g} m)^2", gear.counter_mass))
    return found


def _two_point(result: LinkageBalance, body: BodyMoment) -> list[Equation]:
    """m_B = S / L, m_A = m - m_B, and the inertia that the reshaped link must have."""
    assert result.moment is not None
    shaped = result.linkage.two_point[body.body]
    found, second = _shares(result.force[body.body], "m", shaped.joints), [f"m[{body.body} at {shaped.joints[1]}]"]
    if body.extra.mass:
        found += _shares(body.extra, "m_z", shaped.joints)
        second.append(f"m_z[{body.body} at {shaped.joints[1]}]")
    link = f"I{shaped.reshaped}"
    others = " - ".join(term.text for term in body.terms if term.text != link)
    whole = second[0] if len(second) == 1 else f"({' + '.join(second)})"
    return [*found, Equation(body.body, f"{link} = {whole} L^2 - {others}", result.moment.reshaped[shaped.reshaped])]


def _shares(balance: ForceBalance, mass: str, joints: tuple[str, str]) -> list[Equation]:
    """Two point masses of a body, from its links (m) or from gears (m_z)."""
    first, second = (f"{mass}[{balance.body} at {joint}]" for joint in joints)
    total = " + ".join(balance.symbols)
    return [
        Equation(
            balance.body,
            f"{second} = |sum({mass} r)| / L, L from {joints[0]} to {joints[1]}",
            balance.shares[joints[1]],
        ),
        Equation(balance.body, f"{first} = {total} - {second}", balance.shares[joints[0]]),
    ]
