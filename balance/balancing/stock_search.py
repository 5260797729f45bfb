"""Which whole plates at which sites: the least square error, proven by a search through all that plates can make.

J(m) = |columns m - target|^2 over masses m that plates make. With m* the best of any masses within the limits and
totals, that of the stock among them, g the gradient there and R' R = columns' columns (R triangular),

    J(m) >= J(m*) + g (m - m*) + |R (m - m*)|^2,   each g_i (m_i - m*_i) >= 0,

so that site after site, in the order of R's rows, only masses near the best for those chosen can do better than what
has been found (Schnorr and Euchner, Math. Programming 66, 1994). What J may be above the bound is raised from next to
nothing, so that good masses are found soon. A mass is looked at once, however plates make it: whether some make those
of all sites chosen so far together is sought along a list of all piles, or, where plates weigh multiples of a unit or
are of many kinds, along bits that tell which multiples the first kinds make (Bellman, Dynamic programming, 1957).
"""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Indices
from .least_masses import distribute_within
from .objective import Exact

TIME_LIMIT_S = 8.0
"""Longest search [s]; then the best that was found is given with its gap."""
_FIRST = 0.125
"""Of that time, what the search for the first plates may take; others are placed by a descent besides."""
_ROUNDING = 1e-9
"""Masses that differ by less, relative to all plates, are one."""
_MOST_PILES = 2_000_000
"""Piles of plates that are all looked at."""
_MOST_SELECTIONS = 1_000_000
"""Selections, times their sites, that are all looked at, instead of a search."""
_GOOD = 2e-7
"""Of the bound, by which J may exceed it where the search ends."""
_MOST_MASSES = 300_000
_STEP_KG, _STEP_ROUNDING = 1e-6, 1e-3
"""What masses of plates are multiples of [kg], and how far from that rounding may take them, in such steps."""
_MOST_BITS = 200_000_000
"""Largest mass of a site in units, times the kinds of plates, that is counted by."""
_ROUNDED_BITS = 30_000_000
"""As many where plates are rounded to such units."""
_STEPS = 5_000
"""Plates that are tried before it is left open whether some masses can be made together."""
_CANDIDATES = 20
"""Sets that are looked at more closely where plates differ in radius of gyration."""
_FIRST_CAP, _CAPS = 1e-9, 30.0
"""What J may first be above the bound, relative to J without counter-masses, and the factor by which that rises."""
_WORTHWHILE = 1e-3
"""Part of the root of J by which one more plate must lessen it to be worth naming."""
_TIE = 1e-12
"""Difference of J, relative to J without counter-masses, that is rounding: the lighter is better then."""


Sums = tuple[Floats, Floats]
"""Of the sites, in what is limited together, (sums, sites) [-], and what that may weigh, (sums,) [kg]."""


@dataclass(frozen=True)
class Selection:
    """Plates at sites."""

    counts: Indices
    """Of each kind at each site, (sites, kinds)."""
    masses: Floats
    """(sites,) [kg]"""
    value: float
    """J [square of the target's unit]."""


@dataclass(frozen=True)
class StockOptimum:
    """The best selections, best first, and a bound that no selection is below."""

    selections: tuple[Selection, ...]
    bound: float
    """J of no selection is less than this; that of the first where the search was complete."""

    @property
    def gap(self) -> float:
        """By how much the first may exceed the least of all."""
        return max(self.selections[0].value - self.bound, 0.0)


def selections(quantities: Indices, sites: int) -> int:
    """How many ways there are to share plates among sites."""
    return math.prod(math.comb(quantity + sites, sites) for quantity in quantities.tolist())


def best_plates(
    columns: Floats,
    target: Floats,
    masses: Floats,
    quantities: Indices,
    limits: Floats | None = None,
    equal: Sequence[Sequence[int]] = (),
    best: int = 1,
    turning: tuple[Floats, Floats] | None = None,
    exact: Exact | None = None,
    sums: Sums | None = None,
    time_limit: float | None = None,
) -> StockOptimum:
    """Plates at the sites of least |columns m - target|^2; of equals the lightest.

    ``columns`` (rows, sites), ``target`` (rows,); kinds of plates have ``masses`` (kinds,) [kg] and ``quantities``
    (kinds,), for all sites together; ``limits`` (sites,) [kg]; ``sums`` of masses are limited, too. Sites whose indices
    are in one group of ``equal`` carry equal masses. The ``best`` few sets of masses are given. ``turning``: columns
    (rows, sites) [unit / kg m2] of what plates have of inertia beyond their mass times that of the columns, (sites,
    kinds) [kg m2]; it is added. With ``exact`` all selections are looked at.
    A search ends after ``time_limit`` [s] (default TIME_LIMIT_S).
    """
    sites = columns.shape[1]
    if exact is None and turning is not None and not (np.abs(turning[0]) @ np.abs(turning[1] * quantities)).any():
        turning = None
    groups = _groups(sites, equal)
    most = np.full(sites, np.inf) if limits is None else limits
    used = quantities > 0
    parts, totals = sums or (np.zeros((0, sites)), np.zeros(0))
    sums = parts[np.isfinite(totals)], totals[np.isfinite(totals)]
    if exact is not None or selections(quantities, sites) * sites <= _MOST_SELECTIONS:
        return _best_of_all(columns, target, masses, quantities, most, groups, best, turning, exact, sums)
    if turning is not None:
        # The best of those that a search finds with one radius of gyration for all plates; the bound is of masses of
        # any size, each of any of the plates' radii of gyration.
        per_turning, inertia = turning
        squares = inertia[:, quantities > 0] / masses[quantities > 0]
        middle = columns + per_turning * (inertia @ quantities / (masses @ quantities))
        sought = best_plates(
            middle, target, masses, quantities, most, equal, best + _CANDIDATES, sums=sums, time_limit=time_limit
        )
        whole = []
        for one in sought.selections:
            made = columns @ one.masses + per_turning @ (inertia * one.counts).sum(axis=1)
            whole.append(replace(one, value=float(np.sum((made - target) ** 2))))
        ends = np.hstack([columns + per_turning * square for square in (squares.min(axis=1), squares.max(axis=1))])
        least, _, gap = distribute_within(ends, target, np.tile(most, 2), np.tile(sums[0], 2), sums[1])
        bound = float(np.sum((ends @ least - target) ** 2)) - gap
        return StockOptimum(tuple(sorted(whole, key=lambda one: one.value)[:best]), max(bound, 0.0))
    few, steps = np.prod(quantities + 1.0) <= _MOST_PILES, masses[used] / _STEP_KG
    counted = used.any() and np.abs(steps - np.round(steps)).max() <= _STEP_ROUNDING
    kind = _Search if few and not counted else _UnitSearch
    longest = TIME_LIMIT_S if time_limit is None else time_limit
    search = kind(columns, target, masses[used], quantities[used], most, groups, best, sums, longest)
    found = search.run()
    whole = [Selection(_padded(one.counts, used), one.masses, one.value) for one in found]
    bound = search.bound if search.bound < found[0].value - search.tie else found[0].value
    return StockOptimum(tuple(whole), max(bound, 0.0))


def with_more(
    columns: Floats,
    target: Floats,
    masses: Floats,
    quantities: Indices,
    counts: Indices,
    more: int = 1,
    limits: Floats | None = None,
    equal: Sequence[Sequence[int]] = (),
    turning: tuple[Floats, Floats] | None = None,
    sums: Sums | None = None,
) -> tuple[dict[int, StockOptimum], list[int]]:
    """The best plates with ``more`` of one kind, by kind, the best first, where they leave less than ``counts``.

    ``counts`` (sites, kinds) [-] are the best without them; the rest is as for ``best_plates``. The second list has
    kinds of which that is open, since in TIME_LIMIT_S, for all of them, nothing better was found and not all was seen.
    """
    made = columns @ (counts @ masses) - target
    if turning is not None:
        made = made + turning[0] @ (turning[1] * counts).sum(axis=1)
    worthwhile = (1.0 - _WORTHWHILE) ** 2 * float(made @ made) - _TIE * float(target @ target)
    kinds, deadline = np.flatnonzero(quantities > 0).tolist(), time.monotonic() + TIME_LIMIT_S
    if not worthwhile > 0.0:
        return {}, []
    found, unknown = dict[int, StockOptimum](), list[int]()
    for place, kind in enumerate(kinds):
        if (left := deadline - time.monotonic()) < 0.0:
            unknown += kinds[place:]
            break
        larger = quantities + more * (np.arange(len(quantities)) == kind)
        one = best_plates(
            columns, target, masses, larger, limits, equal, 1, turning, None, sums, left / (len(kinds) - place)
        )
        if one.selections[0].value < worthwhile:
            found[kind] = one
        elif one.bound < worthwhile:
            unknown.append(kind)
    return dict(sorted(found.items(), key=lambda item: item[1].selections[0].value)), unknown


def _groups(sites: int, equal: Sequence[Sequence[int]]) -> list[list[int]]:
    """Sites that carry equal masses, and each of the others alone."""
    return [[i] for i in range(sites) if not any(i in group for group in equal)] + [list(group) for group in equal]


def _best_of_all(
    columns: Floats,
    target: Floats,
    plates: Floats,
    quantities: Indices,
    limits: Floats,
    groups: Sequence[Sequence[int]],
    best: int,
    turning: tuple[Floats, Floats] | None,
    exact: Exact | None,
    sums: Sums,
) -> StockOptimum:
    """Of all ways to share the plates among the sites."""
    sites, edge = columns.shape[1], _ROUNDING * max(float(plates @ quantities), 1e-12)
    per_turning, inertia = turning or (np.zeros_like(columns), np.zeros((sites, len(plates))))
    shared = [np.array(list(_shares(quantity, sites)), dtype=np.intp) for quantity in quantities.tolist()]
    made = turned = np.zeros((1, sites))
    for counts, plate, own in zip(shared, plates, inertia.T, strict=True):
        made = (made[:, None] + plate * counts[None]).reshape(-1, sites)
        turned = (turned[:, None] + own * counts[None]).reshape(-1, sites)
    allowed = (made <= limits + edge).all(axis=1) & (made @ sums[0].T <= sums[1] + edge).all(axis=1)
    for group in groups:
        allowed &= np.ptp(made[:, list(group)], axis=1) <= edge
    ways = np.flatnonzero(allowed)
    square = np.asarray(np.linalg.qr(np.column_stack([columns, per_turning, target]), mode="r"))
    made, turned = made[ways], turned[ways]
    if exact is None:
        values = np.sum((np.hstack([made, turned]) @ square[:, :-1].T - square[:, -1]) ** 2, axis=1)
    else:
        values = exact(made, turned)
    tie, found = _TIE * (float(target @ target) or 1.0), list[Selection]()
    while len(ways) and len(found) < best:
        equals = np.flatnonzero(values <= values.min() + tie)
        chosen = equals[np.lexsort((values[equals], made[equals].sum(axis=1).round(9)))[0]]
        places = np.unravel_index(ways[chosen], [len(counts) for counts in shared])
        counts = np.zeros((sites, len(plates)), dtype=np.intp)
        counts.T[:] = [shares[place] for shares, place in zip(shared, places, strict=True)]
        found.append(Selection(counts, counts @ plates, float(values[chosen])))
        others = (np.abs(made - made[chosen]) > edge).any(axis=1)
        ways, made, values = ways[others], made[others], values[others]
    return StockOptimum(tuple(found), found[0].value)


def _shares(quantity: int, sites: int) -> Iterator[tuple[int, ...]]:
    """All ways to share at most ``quantity`` plates of a kind among ``sites``."""
    if not sites:
        yield ()
        return
    for count in range(quantity + 1):
        yield from ((count, *others) for others in _shares(quantity - count, sites - 1))


def _padded(counts: Indices, used: NDArray[np.bool_]) -> Indices:
    """Plates of all kinds (sites, kinds), from those of the kinds ``used``."""
    whole = np.zeros((len(counts), len(used)), dtype=np.intp)
    whole[:, used] = counts
    return whole


@dataclass
class _Search:
    """Selections of plates; sites that carry equal masses are one group, k below."""

    columns: Floats
    target: Floats
    plates: Floats
    quantities: Indices
    limits: Floats
    groups: Sequence[Sequence[int]]
    best: int
    sums: Sums
    """What plates may weigh together."""
    time_limit: float
    """Longest search [s]."""
    found: list[Selection] = field(default_factory=list)
    """The best, best first; of equals the lightest."""
    late: bool = False
    """Whether time was up before the search was complete."""
    first: bool = False
    """Whether this pass of the search only looks for some plates."""
    cap: float = np.inf
    """What J may be above the bound of any masses, in this pass."""
    rounded: bool = False
    """Whether the search knows masses of plates only about."""
    steps: int = 0
    """How many more plates or piles are tried before it is left open whether masses can be made together."""
    open_value: float = np.inf
    """Least J of masses of which it is not known whether plates make them."""

    def __post_init__(self) -> None:
        """Find the best of any masses, from which the search goes."""
        self.share = np.zeros((self.columns.shape[1], len(self.groups)))
        for k, group in enumerate(self.groups):
            self.share[group, k] = 1.0
        stock = float(self.plates @ self.quantities)
        self.edge = _ROUNDING * max(stock, 1e-12)
        self.parts, self.totals = self.sums[0] @ self.share, self.sums[1]
        """Of the groups, in what is limited together, (sums, groups) [-], and what that may weigh, (sums,) [kg]."""
        self.tie = _TIE * (float(np.sum(self.target**2)) or 1.0)
        columns, weight = self.columns @ self.share, self.share.sum(axis=0)
        every, self.within = np.vstack([self.parts, weight]), np.append(self.totals, stock)
        alone = np.divide(self.within[:, None], every, out=np.full(every.shape, np.inf), where=every > 0.0)
        most = np.minimum([self.limits[list(group)].min() for group in self.groups], alone.min(axis=0))
        upper = np.array([_largest_mass(self.plates, self.quantities, limit, self.edge) for limit in most])
        centre, self.prices, gap = distribute_within(columns, self.target, upper, every, self.within)
        self.relaxed = float(np.sum((columns @ centre - self.target) ** 2)) - gap
        gradient = 2.0 * columns.T @ (columns @ centre - self.target) + self.prices @ every
        pushed = np.where(centre <= 0.0, gradient.clip(min=0.0), np.where(centre >= upper, gradient.clip(max=0.0), 0.0))
        free, steep = np.flatnonzero(pushed == 0.0), np.flatnonzero(pushed)
        order = [*free[_search_order(columns[:, free])], *steep[np.argsort(np.abs(pushed[steep]))]]
        self.order, self.centre, self.gradient = order, centre[order], pushed[order]
        dependent = np.linalg.matrix_rank(columns) < len(weight)
        self.lightest = float(weight @ centre) if dependent else np.inf
        """What masses as good as the centre weigh at least [kg]; any, where there are no others."""
        padded = np.vstack([columns[:, order], np.zeros((len(order), len(order)))])
        self.triangle: Floats = np.asarray(np.linalg.qr(padded, mode="r"))
        self.weight, self.upper = weight[order], upper[order]
        self.parts, self.every = self.parts[:, order], every[:, order]

    def run(self) -> list[Selection]:
        """Search through all masses that piles of plates make."""
        self.pile_masses, self.piles = _piles(self.plates, self.quantities, self.edge)
        return self._search(self.pile_masses[np.concatenate([[True], np.diff(self.pile_masses) > self.edge])])

    def _search(self, distinct: Floats) -> list[Selection]:
        """Search through the ``distinct`` masses that plates make, rising [kg]; no plates are always a selection."""
        self.reachable = [distinct[distinct <= upper + self.edge] for upper in self.upper]
        self.deadline = time.monotonic() + _FIRST * self.time_limit
        self._offer(np.zeros((len(self.columns[0]), len(self.plates)), dtype=np.intp))
        most = max(self.found[0].value - self.relaxed, self.tie)
        cap = max(_FIRST_CAP * most, _GOOD * self.relaxed)
        self.first = True
        self._descend(len(self.order) - 1, np.zeros(len(self.order)), 0.0)
        self.first = self.late = False
        self._offer(self._placed())
        self.deadline = time.monotonic() + (1.0 - _FIRST) * self.time_limit
        while not self.late:
            self.cap = cap if cap < most else np.inf
            self._descend(len(self.order) - 1, np.zeros(len(self.order)), 0.0)
            if self._worst() - self.relaxed + self.tie <= self.cap or self._is_done():
                break
            cap *= _CAPS
        return self.found

    def _placed(self) -> Indices:
        """Plates (sites, kinds) that a descent finds: each moved, heavy ones first, as long as that lessens J."""
        size = np.array([0, *(len(group) for group in self.groups)])  # the stock, then the groups
        columns = np.column_stack([np.zeros(len(self.target)), self.columns @ self.share])
        parts = np.column_stack([np.zeros(len(self.totals)), self.sums[0] @ self.share])
        room = np.array([np.inf, *(float(self.limits[list(group)].min()) for group in self.groups)]) + self.edge
        counts, left, moved = np.zeros((len(size), len(self.plates)), dtype=np.intp), self.quantities.copy(), True
        while moved:
            moved = False
            for kind in np.argsort(-self.plates):
                mass, short = self.plates[kind], columns @ (counts @ self.plates) - self.target
                here = (counts[:, kind] > 0) | (size == 0)
                allowed = here[:, None] & (left[kind] + size[:, None] >= size) & (counts @ self.plates + mass <= room)
                heavier = mass * (parts[:, None, :] - parts[:, :, None])
                together = (parts @ (counts @ self.plates))[:, None, None] + heavier
                allowed &= (together <= self.totals[:, None, None] + self.edge).all(axis=0)
                change = mass * (columns[:, None, :] - columns[:, :, None])
                values = np.where(allowed, np.sum((short[:, None, None] + change) ** 2, axis=0), np.inf)
                one, other = np.unravel_index(np.argmin(values), values.shape)
                if values[one, other] < float(short @ short) - self.tie:
                    counts[one, kind] -= 1
                    counts[other, kind] += 1
                    counts[0] = 0
                    left[kind] += size[one] - size[other]
                    moved = True
        placed = np.zeros((len(self.limits), len(self.plates)), dtype=np.intp)
        for group, taken in zip(self.groups, counts[1:], strict=True):
            placed[list(group)] = taken
        return placed

    @property
    def bound(self) -> float:
        """J of no selection is less than this, once the search was run."""
        return self.relaxed if self.late else min(self.found[0].value, self.open_value)

    def _is_done(self) -> bool:
        """Whether time is up, or what was found is so near the bound that no other is better by what counts.

        An equal one may be lighter where sites have the same effect.
        """
        worst = self._worst()
        if self.late or worst > self.relaxed * (1.0 + _GOOD) + self.tie:
            return self.late
        return worst > self.relaxed + self.tie or self.found[-1].masses.sum() <= self.lightest + self.edge

    def _descend(self, level: int, offset: Floats, cost: float) -> None:
        """Choose the mass of one site after the other; ``offset`` from the centre [kg]."""
        row = self.triangle[level]
        pull = float(row[level + 1 :] @ offset[level + 1 :])
        masses = self._window(level, pull, cost, (self.centre + offset)[level + 1 :])
        steps = masses - self.centre[level]
        costs = cost + (row[level] * steps + pull) ** 2 + self.gradient[level] * steps
        if level == 0:
            chosen = self.every[:, 1:] @ (self.centre + offset)[1:] + self.every[:, :1].T * masses[:, None]
            costs = costs + (self.within - chosen) @ self.prices
        for k in np.lexsort((masses, costs)):
            done = self._is_done() or (self.first and self.found[0].masses.any())
            if done or costs[k] > self._budget():
                return
            if time.monotonic() > self.deadline:
                self.late = True
                return
            offset[level] = steps[k]
            if level == 0 and not self._is_better(
                self.relaxed + float(costs[k]), float(self.weight @ (self.centre + offset))
            ):
                continue
            counts = self._counts(level, self.centre + offset)
            if counts is None and self.steps < 0:
                self.open_value = min(self.open_value, self.relaxed + float(costs[k]))
            elif counts is not None and level:
                self._descend(level - 1, offset, float(costs[k]))
            elif counts is not None:
                self._offer(counts)
        offset[level] = 0.0

    def _window(self, level: int, pull: float, cost: float, chosen: Floats) -> Floats:
        """Masses of a site that may lead to a better selection, rising; ``chosen`` [kg] are those of others so far."""
        masses, left = self.reachable[level], self._budget() - cost
        reach, steep, centre = abs(self.triangle[level, level]), self.gradient[level], self.centre[level]
        low, high = 0.0, np.inf
        if reach > 1e-9 * float(np.abs(self.triangle).max()):
            middle = centre - pull / self.triangle[level, level]
            low, high = middle - np.sqrt(max(left, 0.0)) / reach, middle + np.sqrt(max(left, 0.0)) / reach
        if steep:
            low, high = (
                (low, min(high, centre + left / steep)) if steep > 0.0 else (max(low, centre + left / steep), high)
            )
        if self._worst() <= self.relaxed + self.tie:  # none is better, but one may be lighter
            high = min(high, (self.found[-1].masses.sum() - self.weight[level + 1 :] @ chosen) / self.weight[level])
        parts = self.parts[:, level]
        room = self.totals - self.parts[:, level + 1 :] @ chosen
        high = min(high, (room[parts > 0.0] / parts[parts > 0.0]).min(initial=np.inf))
        first, last = np.searchsorted(masses, [low - self.edge, high + self.edge])
        return masses[first:last]

    def _worst(self) -> float:
        return self.found[-1].value if len(self.found) >= self.best else np.inf

    def _budget(self) -> float:
        """What J may be above that of the centre, for a selection that is worth to be found."""
        return min(self._worst() - self.relaxed + self.tie, self.cap)

    def _is_better(self, value: float, mass: float) -> bool:
        worst = self._worst()
        return value < worst - self.tie or (
            value <= worst + self.tie and mass < self.found[-1].masses.sum() - self.edge
        )

    def _offer(self, counts: Indices) -> None:
        """Keep plates ``counts`` (sites, kinds), if they are among the best, and others than are kept."""
        made = counts @ self.plates
        if (self.sums[0] @ made > self.sums[1] + self.edge).any():  # of plates that are rounded
            return
        one = Selection(counts, made, float(np.sum((self.columns @ made - self.target) ** 2)))
        if any(np.allclose(made, other.masses, rtol=0.0, atol=self.edge) for other in self.found):
            return
        place = sum(
            other.value < one.value - self.tie
            or (other.value <= one.value + self.tie and other.masses.sum() <= made.sum())
            for other in self.found
        )
        self.found.insert(place, one)
        del self.found[self.best :]

    def _counts(self, level: int, masses: Floats) -> Indices | None:
        """Plates (sites, kinds) that make the masses of the groups from ``level`` on together.

        None where there are none, or ``steps`` is negative after that: none were found. Plates that are rounded make
        equal masses only where they are the same.
        """
        parts = [
            (part, mass)
            for k, mass in zip(self.order[level:], masses[level:].tolist(), strict=True)
            for part in ([list(self.groups[k])] if self.rounded else [[i] for i in self.groups[k]])
        ]
        self.steps = _STEPS
        found = self._together(parts[::-1], self.quantities)
        if found is None:
            return None
        counts = np.zeros((len(self.columns[0]), len(self.plates)), dtype=np.intp)
        for (part, _), taken in zip(parts[::-1], found, strict=True):
            counts[part] = taken
        return counts

    def _together(self, parts: list[tuple[list[int], float]], available: Indices) -> list[Indices] | None:
        """Plates (kinds,) for each part, of those ``available``."""
        if not parts:
            return []
        (part, wanted), *others = parts
        for taken in self._subsets(wanted, available // len(part)):
            if not self.rounded or (taken @ self.plates <= self.limits[part] + self.edge).all():
                rest = self._together(others, available - len(part) * taken)
                if rest is not None or self.steps < 0:
                    return None if rest is None else [taken, *rest]
        return None

    def _subsets(self, mass: float, available: Indices) -> Iterator[Indices]:
        """Plates (kinds,) of those ``available`` that make a mass [kg], few first; each takes one of the ``steps``."""
        first, last = np.searchsorted(self.pile_masses, [mass - self.edge, mass + self.edge])
        piles = self.piles[first:last]
        for pile in piles[(piles <= available).all(axis=1)]:
            self.steps -= 1
            yield pile


@dataclass
class _UnitSearch(_Search):
    """Plates as multiples of a unit, which bits count.

    What is found has no proof where plates are rounded, since they are multiples of no unit that can be counted by, or
    where there are so many that only masses up to about twice what is wanted are looked at.
    """

    def __post_init__(self) -> None:
        """Choose the unit and how far is counted, and count."""
        rising = np.argsort(self.plates)
        self.places, self.plates, self.quantities = np.argsort(rising), self.plates[rising], self.quantities[rising]
        super().__post_init__()
        kinds, steps = len(self.plates), self.plates / _STEP_KG
        unit = _STEP_KG * float(np.gcd.reduce(np.round(steps).astype(np.intp)))
        self.rounded, self.reach = bool(np.abs(steps - np.round(steps)).max() > _STEP_ROUNDING), self.upper.max()
        if self.rounded or unit * _MOST_BITS < self.reach * kinds:
            self.reach = min(self.reach, 2.0 * float(self.centre.max() + self.plates.max()))
            self.rounded = self.rounded or unit * _MOST_BITS < self.reach * kinds
        self.unit = max(self.reach * kinds / _ROUNDED_BITS, 1e-3 * _STEP_KG) if self.rounded else unit
        self.units = np.round(self.plates / self.unit).astype(np.intp).tolist()
        self.sums_of = _sums(self.units, self.quantities.tolist(), round(self.reach / self.unit))
        """For the first 0, 1, 2 ... kinds: bit k tells whether some of them make k units."""

    @property
    def bound(self) -> float:
        """J of no selection is less than this, once the search was run."""
        return self.relaxed if self.rounded or self.reach < self.upper.max() else super().bound

    def run(self) -> list[Selection]:
        """Search through all multiples of the unit that some plates make."""
        bits = np.unpackbits(np.frombuffer(self.sums_of[-1], np.uint8), bitorder="little")
        found = self._search(np.flatnonzero(bits) * self.unit)
        return [Selection(one.counts[:, self.places], one.masses, one.value) for one in found]

    def _subsets(self, mass: float, available: Indices) -> Iterator[Indices]:
        for chosen in self._along(len(self.units), round(mass / self.unit), available.tolist()):
            taken = np.zeros(len(available), dtype=np.intp)
            taken[[kind for kind, _ in chosen]] = [count for _, count in chosen]
            yield taken

    def _along(self, kinds: int, wanted: int, available: list[int]) -> Iterator[list[tuple[int, int]]]:
        """Kinds and numbers of plates, of the first ``kinds``, that make ``wanted`` units; heavy plates first."""
        if not wanted:
            yield []
            return
        kind, sums = kinds - 1, self.sums_of[kinds - 1]
        unit = max(self.units[kind], 1)
        for count in range(min(available[kind], wanted // unit), -1, -1):
            self.steps -= 1
            if self.steps < 0:
                return
            rest = wanted - count * unit
            if sums[rest >> 3] >> (rest & 7) & 1:
                for others in self._along(kind, rest, available):
                    yield [(kind, count), *others] if count else others


def _sums(units: Sequence[int], quantities: Sequence[int], most: int) -> list[bytes]:
    """For the first 0, 1, 2 ... kinds: bit k tells whether some of their plates make k, up to ``most``."""
    sums, mask = [1], (1 << (most + 1)) - 1
    for unit, quantity in zip(units, quantities, strict=True):
        found, parcel, rest = sums[-1], 1, quantity
        while rest:  # 1, 2, 4 ... plates and the rest: some of them make any number
            parcel = min(parcel, rest)
            found = (found | found << unit * parcel) & mask
            parcel, rest = 2 * parcel, rest - parcel
        sums.append(found)
    return [found.to_bytes(most // 8 + 1, "little") for found in sums]


def _search_order(columns: Floats) -> list[int]:
    """Sites, the one that is chosen first last: that whose effect is least like that of the others."""
    rest, order = list(range(columns.shape[1])), list[int]()
    while rest:
        apart = []
        for k in rest:
            others = columns[:, [j for j in rest if j != k]]
            like = others @ np.linalg.lstsq(others, columns[:, k], rcond=None)[0] if len(rest) > 1 else 0.0
            apart.append(float(np.sum((columns[:, k] - like) ** 2)))
        order.insert(0, rest.pop(int(np.argmax(apart))))
    return order


def _piles(plates: Floats, quantities: Indices, edge: float) -> tuple[Floats, Indices]:
    """All piles of plates by mass, (n,) [kg] and (n, kinds); of one mass, to ``edge`` [kg], few plates first."""
    piles = np.indices(tuple(quantities + 1), dtype=np.int16).reshape(len(quantities), int(np.prod(quantities + 1))).T
    sums = piles @ plates
    order = np.argsort(sums, kind="stable")
    piles, sums = piles[order], sums[order]
    same = np.cumsum(np.concatenate([[0], np.diff(sums) > edge]))
    order = np.lexsort((piles.sum(axis=1), same))
    return sums[order], piles[order]


def _largest_mass(plates: Floats, quantities: Indices, limit: float, edge: float) -> float:
    """The largest mass up to ``limit`` [kg] that plates make; the limit itself where they make too many to list."""
    sums = np.zeros(1)
    for mass, quantity in zip(plates, quantities, strict=True):
        sums = np.add.outer(sums, mass * np.arange(quantity + 1)).ravel()
        sums = np.sort(sums[sums <= limit + edge])
        sums = sums[np.concatenate([[True], np.diff(sums) > edge])]
        if len(sums) > _MOST_MASSES:
            return limit
    return float(sums[-1])
