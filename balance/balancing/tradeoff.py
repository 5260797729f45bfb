"""The front of shaking force, shaking moment, drive torque and added mass: what each costs in the others.

Mean squares of force, moment and torque over a motion, and the added mass, are convex in the counter-masses: every
point of the front is the least of a weighted sum. Even weights would crowd its points where it bends (Das, Dennis,
SIAM J. Optim. 8, 1998): the two neighbours that are furthest apart get a point between them, until there are enough.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import combinations
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..errors import SizingError
from ..mechanism.mechanism import Mechanism
from ..results import Key, Shown
from .least_masses import distribute_masses
from .objective import QUANTITIES, motion_objective, turning_drives
from .sizing import chosen_sites, total_limit, upper_limits

_SAME = 1e-9
"""Difference of a quantity, relative to its largest on the front, that is rounding."""
_FAINT = 1e-6
"""Weight of what has none, so that of equals the better is taken."""
_HALVINGS = 30
"""Of the weights between two neighbours, after which nothing lies between them: the front has a gap there."""
_FINER = 5.0
"""How much closer points lie along the curve of force against added mass, which is asked for most, than elsewhere."""


@dataclass(frozen=True)
class FrontPoint:
    """Counter-masses that nothing betters in all quantities."""

    force: Annotated[float, Key("rms_force_N", "force RMS [N]", ".4g")]
    moment: Annotated[float, Key("rms_moment_Nm", "moment RMS [N m]", ".4g")]
    torque: Annotated[float | None, Key("rms_torque_Nm", "torque RMS [N m]", ".4g")]
    """Of all motors that turn; None where the file names none."""
    added_mass: Annotated[float, Key("added_mass_kg", "added [kg]", ".4f")]
    masses: Annotated[Mapping[str, float], Key("counter_masses_kg", "masses [kg]", lambda m: _listed(m))]
    """By site [kg]."""
    on_curve: Annotated[bool, Key("least_force_for_mass")]
    """Whether no other masses of the same sum leave less force."""


def _listed(masses: Mapping[str, float]) -> str:
    return " / ".join(f"{mass:.4f}" for mass in masses.values())


@dataclass(frozen=True)
class Front(Shown, rows="points", figure="balance.figures.balancing:draw_front"):
    """The best compromises: each a set of counter-masses that nothing betters in all quantities.

    >>> import balance
    >>> balance.tradeoff("four-bar", "four-bar", points=10).table().columns[0]
    'rms_force_N'
    """

    mechanism: Annotated[str, Key()]
    motion: Annotated[str, Key()]
    points: Annotated[tuple[FrontPoint, ...], Key()]
    """Least force first."""


def tradeoff_front(
    mechanism: Mechanism,
    trajectory: Trajectory,
    sites: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
    points: int = 300,
    added: float | None = None,
) -> tuple[FrontPoint, ...]:
    """At most about ``points`` points of the front of a motion, the least force first; limits [kg] by site.

    With ``added`` [kg] no point adds more, and that of the least force with so much is the first. Moment is about the
    base frame's origin. Points that no other betters in one quantity without a loss in another.
    """
    if not isinstance(points, int | np.integer) or points < 4:
        raise SizingError(f"{points} points: expected a whole number, 4 at least: one for the end of each quantity")
    total_limit(added)
    names = chosen_sites(mechanism, sites)
    upper = upper_limits(names, limits)
    quantities = [name for name in QUANTITIES if name != "torque" or turning_drives(mechanism)]
    systems = [
        _reduced(*motion_objective(mechanism, trajectory, {name: 1.0}).system(mechanism, names)) for name in quantities
    ]
    scales = [float(np.linalg.norm(target)) or 1.0 for _, target in systems]
    ends = [*(distribute_masses(*system, upper).masses for system in systems), np.zeros(len(names))]
    systems.append((np.ones((1, len(names))), np.zeros(1)))
    scales.append(float(ends[0].sum()) or 1.0)

    def least(weights: Floats) -> Floats:
        parts = [
            (np.sqrt(max(weight, _FAINT)) / scale * columns, np.sqrt(max(weight, _FAINT)) / scale * target)
            for weight, scale, (columns, target) in zip(weights, scales, systems, strict=True)
        ]
        columns, target = (np.concatenate(blocks) for blocks in zip(*parts, strict=True))
        return distribute_masses(columns, target, upper).masses

    def quantities_of(masses: Floats) -> Floats:
        return np.array([np.linalg.norm(c @ masses - t) for c, t in systems])

    weights = np.eye(len(ends))
    if added is not None:
        for k, end in enumerate(ends):
            if end.sum() > added:
                weights[k] = _lighter(weights[k], lambda weights: float(least(weights).sum()), added)
                ends[k] = least(weights[k])
    spread = _spread(ends, weights, least, quantities_of, points)
    spread = [(masses, on_curve) for masses, on_curve in spread if added is None or masses.sum() <= added]
    values = np.array([quantities_of(masses) for masses, _ in spread])
    found = []
    for row, masses, on_curve in _unbettered(values, spread):
        force, moment, torque = float(row[0]), float(row[1]), float(row[2]) if len(row) == 4 else None
        by_site = dict(zip(names, masses.tolist(), strict=True))
        found.append(FrontPoint(force, moment, torque, float(masses.sum()), by_site, on_curve))
    return tuple(found)


def _reduced(columns: Floats, target: Floats) -> tuple[Floats, Floats]:
    """A system with the same square error for all masses, of as many rows as there are sites, and one."""
    triangle = np.asarray(np.linalg.qr(np.column_stack([columns, target]), mode="r"))
    return triangle[:, :-1], triangle[:, -1]


def _lighter(weights: Floats, mass: Callable[[Floats], float], most: float) -> Floats:
    """Weights moved to the last, of the added mass, until the ``mass`` [kg] of weights is ``most`` or just below."""
    light, heavy, last = 40.0, -40.0, np.eye(len(weights))[-1]
    for _ in range(60):
        middle = 0.5 * (light + heavy)
        share = 1.0 / (1.0 + np.exp(-middle))
        light, heavy = (light, middle) if mass((1.0 - share) * weights + share * last) > most else (middle, heavy)
    share = 1.0 / (1.0 + np.exp(-light))
    return (1.0 - share) * weights + share * last


def _spread(
    ends: Sequence[Floats],
    corners: Floats,
    least: Callable[[Floats], Floats],
    quantities_of: Callable[[Floats], Floats],
    points: int,
) -> list[tuple[Floats, bool]]:
    """Masses of so many points of a front, spread evenly over it, and whether by weights of force and added mass alone.

    The ``ends`` are first: those of the least of each quantity, the force the first and the added mass the last.

    ``least`` gives the masses of weights. The weights fill a simplex between ``corners``, those of the ends; it is cut
    where neighbours are furthest apart in their quantities, each over its range, at weights between theirs that give a
    point about as far from the one as from the other.
    """
    found, weights = list(ends), list(corners)
    values = [quantities_of(masses) for masses in found]
    ranges = np.ptp(values, axis=0)
    ranges[ranges <= _SAME * np.max(values, axis=0)] = np.inf
    simplices = {frozenset(range(len(ends)))}
    apart: list[tuple[float, int, int]] = []

    def distance(one: int, values_there: Floats) -> float:
        return float(np.linalg.norm((values[one] - values_there) / ranges))

    def on_curve(*ks: int) -> bool:
        return not any(weights[k][1:-1].any() for k in ks)

    def neighbours(pairs: Iterable[tuple[int, int]]) -> None:
        for one, other in pairs:
            heappush(apart, (-distance(one, values[other]) * (_FINER if on_curve(one, other) else 1.0), one, other))

    neighbours(combinations(range(len(ends)), 2))
    while len(found) < points and apart:
        length, one, other = heappop(apart)
        if -length <= _SAME:
            break
        near, far = 0.0, 1.0
        for _ in range(_HALVINGS):
            share = 0.5 * (near + far)
            middle = (1.0 - share) * weights[one] + share * weights[other]
            there = quantities_of(masses := least(middle))
            behind, ahead = distance(one, there), distance(other, there)
            if max(behind, ahead) <= 2.0 * min(behind, ahead):
                break
            near, far = (share, far) if behind < ahead else (near, share)
        else:
            continue
        new, cut = len(found), [simplex for simplex in simplices if {one, other} <= simplex]
        weights.append(middle)
        found.append(masses)
        values.append(there)
        simplices.difference_update(cut)
        simplices.update(simplex - {old} | {new} for simplex in cut for old in (one, other))
        neighbours([(corner, new) for corner in sorted(frozenset().union(*cut))])
    return [(masses, on_curve(k)) for k, masses in enumerate(found)]


def _unbettered(values: Floats, spread: Sequence[tuple[Floats, bool]]) -> list[tuple[Floats, Floats, bool]]:
    """Rows (n, quantities) that no other is as good as in all quantities, each once, the least force first.

    A row is on the curve where one of those that are the same is.
    """
    edge = _SAME * values.max(axis=0)
    kept: list[int] = []
    for k in np.lexsort(values.T[::-1]):
        others = np.delete(values, k, axis=0)
        better = (others <= values[k] + edge).all(axis=1) & (others < values[k] - edge).any(axis=1)
        same = any((np.abs(values[j] - values[k]) <= edge).all() for j in kept)
        if not better.any() and not same:
            kept.append(int(k))
    alike = [np.flatnonzero((np.abs(values - values[k]) <= edge).all(axis=1)).tolist() for k in kept]
    return [(values[k], spread[k][0], any(spread[j][1] for j in same)) for k, same in zip(kept, alike, strict=True)]
