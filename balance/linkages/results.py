"""Results of linkages: equations in symbols, what a source publishes, findings, all as plain values for JSON.

Equations are as the source writes them. What it publishes is compared with what its published inputs give; differences
have a reason.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from operator import attrgetter
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np

from ..errors import DataError
from ..results import Key, given
from .equivalence_method import Built, LinkageBalance, balance_linkage, rounding_intervals
from .expressions import Expression, Symbol, symbol
from .force_balance import EquivalentLoad, ForceBalance
from .linkage import GROUND, Contradiction, Disc
from .moment_balance import BodyMoment, GearResult
from .verification import COLUMNS, SimulatedLinkage, Verification, counter_gears_without_mass

HEAVY = 100.0
"""Times what it balances from which a counter-mass is a finding."""


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
    gears = {gear.gear.body: gear for gear in result.gears.values()}
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


@dataclass(frozen=True)
class PublishedRow:
    """One published number and ours."""

    name: Annotated[str, Key("symbol")]
    """Symbol, such as m2* or I_z1."""
    published: Annotated[Symbol, Key("printed_{0.unit}", to=attrgetter("value"))]
    computed: Annotated[float, Key("computed_{0.unit}")]
    """From the published inputs [kg, kg m2]."""
    interval: Annotated[tuple[float, float], Key("rounding_interval_{0.unit}")]
    """By the rounding of the published inputs [kg, kg m2]."""
    why: Annotated[str, Key(to=given)] = ""
    """Why it differs, where the source contradicts itself or its own equations."""
    explained: Annotated[float | None, Key("computed_as_the_source_did_{0.unit}")] = None
    """What the method gives without the terms that the source omits [kg, kg m2]."""
    explained_interval: tuple[float, float] | None = None
    """The same by the rounding of the published inputs [kg, kg m2]."""

    @property
    def agrees(self) -> bool:
        """Whether the published number, as rounded, is one that the published inputs, as rounded, can give."""
        return self._reached(self.interval, 1.0)

    @property
    def cut(self) -> bool:
        """Whether it agrees only as a number whose further digits were cut off, not rounded."""
        return not self.agrees and self._reached(self.interval, 2.0)

    @property
    def is_explained(self) -> bool:
        """Whether the omitted terms account for the published number."""
        return self.explained_interval is not None and self._reached(self.explained_interval, 1.0)

    @property
    def unit(self) -> str:
        """Of its values, as in keys."""
        return "kg" if self.name.startswith("m") else "kgm2"

    @property
    def verdict(self) -> Annotated[str, Key()]:
        """``agrees``, ``agrees, cut off`` or ``differs``."""
        return "agrees" if self.agrees else "agrees, cut off" if self.cut else "differs"

    def _reached(self, interval: tuple[float, float], halves: float) -> bool:
        slack = halves * self.published.half_unit * (1 + 1e-9)
        return interval[0] - slack <= self.published.value <= interval[1] + slack


@dataclass(frozen=True)
class Comparison:
    """All that a source publishes for a linkage, compared."""

    rows: Annotated[tuple[PublishedRow, ...], Key("values")]
    rms: Annotated[Mapping[str, Mapping[str, float]], Key()]
    """Published RMS values by stage and column, [N, N m]."""
    restored: Annotated[Mapping[str, str], Key()]
    """What had to be restored in the published copy."""
    contradictions: Annotated[tuple[Contradiction, ...], Key(to=lambda one: one.model_dump(include={"about", "why"}))]


def compare_published(result: LinkageBalance) -> Comparison | None:
    """Compare a balance with what its linkage's source publishes; None where there is nothing published."""
    published = result.linkage.published
    if published is None:
        return None
    bounds, ours = rounding_intervals(result), result.results()
    reasons = {entry.about: entry for entry in published.contradiction}
    rows = []
    for name, text in published.values.items():
        if name not in ours:
            raise DataError(f"printed.values: {name!r} is not a result: there are {', '.join(ours)}")
        number, reason = symbol(text, "mass" if name.startswith("m") else "inertia"), reasons.get(name)
        row = PublishedRow(name, number, ours[name], bounds[name], reason.why if reason else "")
        if reason and reason.omit:
            omit = _omitted(result, reason)
            other = balance_linkage(result.linkage, result.values, omit=omit, tree=result.tree)
            left = rounding_intervals(other, omit)[name]
            row = replace(row, explained=other.results()[name], explained_interval=left)
        rows.append(row)
    rms = {str(stage): dict(zip(COLUMNS, values, strict=True)) for stage, values in published.rms.items()}
    return Comparison(tuple(rows), rms, published.restored, published.contradiction)


def _omitted(result: LinkageBalance, reason: Contradiction) -> dict[str, Sequence[str]]:
    """Omitted terms by body. Raises DataError for a term that is not in its sum."""
    omitted: dict[str, Sequence[str]] = {}
    assert result.moment is not None
    for link, terms in reason.omit.items():
        body = result.linkage.body(link).name
        known = [term.text for term in result.moment.bodies[body].terms]
        for term in terms:
            if term not in known:
                raise DataError(
                    f"contradiction {reason.about}: {term!r} is no term of {body}: there are {', '.join(known)}"
                )
        omitted[body] = terms
    return omitted


def linkage_document(
    result: LinkageBalance,
    check: Verification | None,
    comparison: Comparison | None,
    built: Mapping[str, Built] = MappingProxyType({}),
    findings: Sequence[str] = (),
    made: LinkageBalance | None = None,
) -> dict[str, Any]:
    """The whole balance: tree, counter-masses, gears, equations, dynamics, as built, and what the source publishes.

    ``made`` is the linkage with what is ``built``.
    """
    return {
        "linkage": result.linkage.name,
        "title": result.linkage.title,
        "reduction": [
            {"body": name, "joint": result.tree[name], "mass_kg": balance.mass, "point_masses_kg": dict(balance.shares)}
            for name, balance in result.force.items()
        ],
        "residual_first_moment_kgm": result.residual(),
        "counter_masses": _counter_masses(result),
        "gears": list(result.gears.values()),
        "inertias": [
            {"body": name, "inertia_about_joint_kgm2": body.inertia, "terms": body.terms}
            for name, body in (result.moment.bodies.items() if result.moment else ())
            if body.terms
        ],
        "reshaped_inertia_kgm2": dict(result.moment.reshaped) if result.moment else {},
        "built": {name: text if isinstance(text, str) else list(text) for name, text in built.items()},
        "as_built": made and {"counter_masses": _counter_masses(made), "gears": list(made.gears.values())},
        "findings": [*findings],
        "equations": linkage_equations(result),
        "simulated": None
        if check is None
        else {
            "origin": "simulated",
            "speed_rad_per_s": check.speed,
            "variation_share_of_speed": check.variation,
            "swings": check.swings,
            "constant_speed": _run(check.constant),
            "varying_speed": _run(check.varying),
            "moving_mass_kg": dict(check.mass),
            "counter_gears_without_mass": counter_gears_without_mass(made or result),
            "multiple_of_before": {stage: check.penalty(stage) for stage in check.constant.responses},
        },
        "printed": comparison,
    }


def linkage_findings(result: LinkageBalance) -> list[str]:
    """Numbers that the equations allow and no workshop makes, or no body has; empty where there are none."""
    linkage, values, found = result.linkage, result.values, []
    for name, counter in result.counters():
        balance = result.force[name]
        loads = [*balance.loads, *(result.moment.bodies[name].extra.loads if result.moment else ())]
        carried = sum(load.mass for load in loads)
        if counter.mass > HEAVY * carried:
            far = 1e3 * float(np.linalg.norm(counter.position))
            found.append(
                f"counter-mass {counter.symbol} is {counter.mass / carried:.4g} times what it balances, "
                f"{carried:.4g} kg: its place is {far:.4g} mm from joint {balance.joint}; give one further out"
            )
    for body in linkage.bodies.values():
        joints = [j for j in linkage.joints.values() if j.joins(body.name)]
        points = [p.at(values) for j in joints if (p := j.end(body.name).point) is not None]
        if len(points) < 2 or not all(joint.revolute and not joint.joins(GROUND) for joint in joints):
            continue  # a crank or rocker may carry a flywheel
        length = max(float(np.linalg.norm(p - q)) for p in points for q in points)
        for part in body.parts:
            gyration = float(np.sqrt(values.get(part.inertia, 0.0) / values[part.mass]))
            if gyration > length:
                found.append(
                    f"link {part.link}: inertia {values[part.inertia]:.4g} kg m2 means a radius of gyration of "
                    f"{1e3 * gyration:.4g} mm, and its joints are {1e3 * length:.4g} mm apart: no rod has that; check "
                    "the inertia, about the link's own centre of mass, and its unit"
                )
    return found


def _counter_masses(result: LinkageBalance) -> list[dict[str, Any]]:
    count = len(result.counters("force"))
    return [
        {
            "symbol": counter.symbol,
            "body": body,
            "against": "gears" if k >= count else "links",
            "mass_kg": counter.mass,
            "position_from_reduction_joint_m": counter.position.tolist(),
            "inertia_kgm2": counter.inertia,
        }
        for k, (body, counter) in enumerate(result.counters())
    ]


def _run(run: SimulatedLinkage) -> dict[str, Any]:
    return {
        "bearing_forces": {  # None where it is statically indeterminate
            stage: None
            if forces is None
            else {f"largest_{name}_N": peaks for name, peaks in forces.peaks().items()}
            | {"undetermined_gears": list(forces.undetermined)}
            for stage, forces in run.bearings.items()
        },
        "rms": {stage: run.rms(stage) for stage in run.responses},
        "share_of_before": {  # None where it was zero before and is not now
            stage: {name: share if isfinite(share) else None for name, share in run.residual(stage).items()}
            for stage in run.responses
        },
        "time_s": run.trajectory.time.tolist(),
        "series": {stage: {k: v.tolist() for k, v in run.series(stage).items()} for stage in run.responses},
    }
