"""A balanced linkage with the masses, inertias and gears that were built, which are never quite those computed."""

from collections.abc import Mapping
from dataclasses import replace

from ..errors import DataError
from ..units import parse
from .equivalence_method import LinkageBalance
from .force_balance import CounterMass, ForceBalance
from .moment_balance import GearResult

Built = str | tuple[int, int]
"""A mass or inertia with its unit, or the teeth of a gear pair, [Z, Z*]."""


def as_built(result: LinkageBalance, built: Mapping[str, Built]) -> LinkageBalance:
    """The linkage with what is stated under its symbol in place of what was computed; nothing else is sized anew.

    Symbols are those of the results and of the file: m3* and I3* of a counter-mass, I_z1 and m_z1* of a counter-gear,
    m_z1 and I_m_z1 of the gear on the body, m3 and I3 of a link; a gear's name for its teeth. A counter-mass whose
    inertia is not stated has that of its shape. Raises DataError for another name, or a value that no body has.
    """
    teeth = {name: pair for name, pair in built.items() if not isinstance(pair, str)}
    gears = dict(result.moment.gears) if result.moment else {}
    parts = [part for body in result.linkage.bodies.values() for part in body.parts]
    known = {*gears, *(part.mass for part in parts), *(part.inertia for part in parts if part.turns)}
    for _, counter in result.counters():
        known |= {counter.symbol, f"I{counter.place.name}*"}
    for name in gears:
        known |= {f"I_{name}", f"m_{name}*", f"m_{name}", f"I_m_{name}"}
    for name, value in built.items():
        if name not in known:
            raise DataError(f"built: {name!r} is none of this linkage: there are {', '.join(sorted(known))}")
        if (name in gears) is isinstance(value, str):
            raise DataError(
                f"built.{name}: expected {'teeth, [Z, Z*]' if name in gears else 'a quantity with its unit'}"
            )
    values = {name: _number(name, text) for name, text in built.items() if isinstance(text, str)}

    def body(balance: ForceBalance) -> ForceBalance:
        return replace(balance, counters=tuple(_counter(c, values, result.values) for c in balance.counters))

    force = {name: body(balance) for name, balance in result.force.items()}
    if result.moment is None:
        return replace(result, values={**result.values, **values}, force=force)
    moment = replace(
        result.moment,
        bodies={name: replace(one, extra=body(one.extra)) for name, one in result.moment.bodies.items()},
        gears={name: _gear(gear, values, teeth) for name, gear in gears.items()},
        reshaped={link: values.get(f"I{link}", inertia) for link, inertia in result.moment.reshaped.items()},
    )
    return replace(result, values={**result.values, **values}, force=force, moment=moment)


def _number(name: str, text: str) -> float:
    value = parse(text, "inertia" if name.startswith("I") else "mass")
    if value < 0.0 or (value == 0.0 and not name.startswith("I")):
        raise DataError(
            f"built.{name}: {text!r}: expected {'zero or more' if name.startswith('I') else 'more than zero'}"
        )
    return value


def _counter(counter: CounterMass, built: Mapping[str, float], values: Mapping[str, float]) -> CounterMass:
    mass, stated = built.get(counter.symbol, counter.mass), built.get(f"I{counter.place.name}*")
    own = counter.inertia if mass == counter.mass else counter.place.inertia(mass, values)
    return replace(counter, mass=mass, inertia=own if stated is None else stated)


def _gear(gear: GearResult, built: Mapping[str, float], teeth: Mapping[str, tuple[int, int]]) -> GearResult:
    name = gear.gear.name
    return replace(
        gear,
        gear=replace(gear.gear, teeth=teeth.get(name, gear.gear.teeth)),
        inertia=built.get(f"I_{name}", gear.inertia),
        counter_mass=built.get(f"m_{name}*", gear.counter_mass),
        wheel_mass=built.get(f"m_{name}", gear.wheel_mass),
        wheel_inertia=built.get(f"I_m_{name}", gear.wheel_inertia),
    )
