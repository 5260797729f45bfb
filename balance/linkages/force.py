"""Force balance, leaves to root: every body becomes a point mass at its reduction joint.

With own parts and the point masses received from the bodies that it carries, S = sum(m r) about that joint; its
counter-masses satisfy sum(m* p) = -S, m* >= 0.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from ..arrays import Floats
from ..errors import SizingError
from .description import Body, Linkage, Place
from .expressions import Point
from .loads import ROUNDING, CounterMass, ForceBalance, Load, pin
from .turning import translating
from .twopoint import two_point_balanced
from .walk import leaves_first, parents


def force_balance(linkage: Linkage, tree: Mapping[str, str], values: Mapping[str, float]) -> dict[str, ForceBalance]:
    """Counter-masses of every body, leaves first. Raises SizingError, naming the body, where its places do not do."""
    done: dict[str, ForceBalance] = {}
    still = translating(linkage)
    for name in leaves_first(linkage, tree):
        body = linkage.bodies[name]
        origin = pin(linkage, tree[name], name)
        loads = [
            Load((part.mass,), values[part.mass], part.centre.plus(origin, -1.0), part.link) for part in body.parts
        ]
        loads += received(linkage, tree, done, name)
        done[name] = balanced(linkage, tree, values, body, loads, body.places, free=name in still and not body.places)
    return done


def received(
    linkage: Linkage, tree: Mapping[str, str], done: Mapping[str, ForceBalance], body: str, mass: str = "m"
) -> list[Load]:
    """Point masses that a body receives from those that it carries; ``mass`` begins the symbols of two-point ones."""
    origin = pin(linkage, tree[body], body)
    found = []
    for child, balance in done.items():
        for joint, parent in parents(linkage, tree, child):
            if parent == body and balance.shares[joint]:
                symbols = balance.symbols if len(balance.shares) == 1 else (f"{mass}[{child} at {joint}]",)
                at = pin(linkage, joint, body).plus(origin, -1.0)
                found.append(Load(symbols, balance.shares[joint], at, child))
    return found


def balanced(
    linkage: Linkage,
    tree: Mapping[str, str],
    values: Mapping[str, float],
    body: Body,
    loads: Sequence[Load],
    places: Sequence[Place],
    free: bool = False,
) -> ForceBalance:
    """Counter-masses against the loads of one body; ``free`` of a body that only translates and needs none."""
    at = np.array([load.at.at(values) for load in loads]).reshape(-1, 2)
    mass = np.array([load.mass for load in loads])
    first = mass @ at if len(loads) else np.zeros(2)
    first[np.abs(first) <= ROUNDING * (np.abs(mass) @ np.abs(at) if len(loads) else np.zeros(2))] = 0.0
    total = float(mass.sum())
    if body.name in linkage.two_point:
        return two_point_balanced(linkage, tree, values, body, tuple(loads), places, first, total)
    if free:
        return ForceBalance(body.name, tree[body.name], tuple(loads), (), {tree[body.name]: total}, first)
    origin = pin(linkage, tree[body.name], body.name)
    counters = solve(first, places, origin, values, body.name)
    total += sum(c.mass for c in counters)
    residual = first + sum((c.mass * c.position for c in counters), np.zeros(2))
    return ForceBalance(body.name, tree[body.name], tuple(loads), counters, {tree[body.name]: total}, residual)


def solve(
    first: Floats, places: Sequence[Place], origin: Point, values: Mapping[str, float], body: str
) -> tuple[CounterMass, ...]:
    """The lightest counter-masses with sum(m* p) = -first: at one place, or at two (no more are ever needed).

    Raises SizingError where no choice of places can do it.
    """
    if not first.any():
        return ()
    at = [_position(place, origin, first, values) for place in places]
    best: tuple[float, tuple[int, ...], Floats] | None = None
    for count in (1, 2):
        for chosen in combinations(range(len(places)), count):
            matrix = np.array([at[k] for k in chosen]).T
            mass = np.linalg.lstsq(matrix, -first, rcond=1e-12)[0]
            exact = np.abs(matrix @ mass + first).max() <= ROUNDING * 100 * np.abs(first).max()
            if exact and (mass >= 0).all() and (best is None or mass.sum() < best[0] * (1 - 1e-12)):
                best = float(mass.sum()), chosen, mass
    if best is None:
        raise SizingError(_impossible(first, at, body))
    return tuple(
        CounterMass(places[k], float(m), at[k], places[k].inertia(float(m), values))
        for k, m in zip(best[1], best[2], strict=True)
        if m > 0
    )


def _position(place: Place, origin: Point, first: Floats, values: Mapping[str, float]) -> Floats:
    if place.point is not None:
        return place.point.plus(origin, -1.0).at(values)
    assert place.radius is not None
    return -place.radius.at(values) * first / np.linalg.norm(first)


def _impossible(first: Floats, at: Sequence[Floats], body: str) -> str:
    side = np.degrees(np.arctan2(0.0 - first[1], 0.0 - first[0]))
    places = ", ".join(f"({x:.4g} m, {y:.4g} m)" for x, y in at) or "none"
    return (
        f"body {body} needs counter-masses of first moment {np.linalg.norm(first):.4g} kg m about its reduction joint, "
        f"on the side {side:.4g} deg of its frame; its places, from that joint, are {places}: give a place on that "
        "side, two places that enclose it, or counter_mass = { radius = '...' }"
    )
