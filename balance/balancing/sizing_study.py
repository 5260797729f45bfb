"""Counter-masses with all there is to say of them: how good they are, what remains and why, a motion with them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import PurePath
from typing import Any

import numpy as np

from ..arrays import Floats, conic_optimum, root_mean_square
from ..closure import Trajectory
from ..datasets import FileDigest
from ..dynamics.inverse_dynamics import Response, simulate
from ..errors import SizingError
from ..mechanism.mechanism import PARAMETERS, Mechanism, Site
from ..results import Shown, per_cent_text, plain
from . import objective
from .conditions import balance_conditions
from .objective import Exact, Objective
from .sizing import (
    COMPLETE,
    CounterMass,
    Sizing,
    StockUse,
    best_sets_from_stock,
    chosen_sites,
    exact_sizing,
    refuse_swinging,
    site_groups,
    sizing_document,
    sizing_of_given,
    stock_use,
    total_limit,
    upper_limits,
)

STEPS = 0.05
"""Share of the shaking force that steps of stock plates may leave where other masses would balance completely."""

_LESS = 1e-3
"""Part of what is left by which another site must lessen it to be worth naming."""
REACHES = (1.0, 2.0, 4.0)
"""How far from its joint a further site may be, in distances of the body's own points from there."""
_FARTHER = 0.1
"""Part of what is left by which a site farther out must lessen it."""
_LIGHT, _ROUNDING = 1e-5, 1e-9
"""Weight of mass against the residual, both near one; and such a mass that is none."""


@dataclass(frozen=True)
class RemainingDirection:
    """A principal direction of what is left; what is along different ones is uncorrelated."""

    direction: Floats
    """Unit vector in the base frame, (3,) [-]."""
    before: float
    """Root mean square along it without counter-masses [unit of the objective]."""
    after: float
    """With them."""


def remaining_directions(before: Floats, after: Floats) -> tuple[RemainingDirection, ...]:
    """Principal directions of what is left, most first, from samples (n, 3) without and with counter-masses [N].

    Along several in which as much is left, to rounding, those of what there was: samples alone do not tell them apart.
    """
    sizes, axes = np.linalg.eigh(after.T @ after / len(after))
    whole = before.T @ before / len(before)
    rounding = COMPLETE**2 * np.trace(whole)
    steps = np.flatnonzero(np.diff(sizes) > rounding) + 1
    axes = np.hstack([alike @ np.linalg.eigh(alike.T @ whole @ alike)[1] for alike in np.split(axes, steps, axis=1)])
    sizes = np.where(sizes > rounding, sizes, 0.0)
    found = []
    for size, axis in zip(sizes[::-1], axes.T[::-1], strict=True):
        axis = np.where(np.abs(axis) > 1e-6, axis, 0.0) * np.sign(axis[np.argmax(np.abs(axis))]) + 0.0
        found.append(RemainingDirection(axis, root_mean_square(before @ axis), float(size**0.5)))
    return tuple(found)


Restrictions = tuple[Mapping[str, float] | None, Sequence[Sequence[str]], float | None]
"""Of a sizing: limits [kg] by site, groups of sites of equal masses, and the limit of all masses [kg]."""


def needed_sites(sizing: Sizing, restrictions: Restrictions) -> tuple[tuple[tuple[Sizing, ...], ...], dict[str, str]]:
    """The sizing with further sites: one on the body where it helps most, then with a second one on another, and so on.

    Until nothing is left or nothing helps. Each further site is where on its body a counter-mass lessens most what is
    left, and is sized with the others. Of bodies that do as well all are given, by name; the next site is beside that
    on the first. Beside them, of bodies of which it was not found, why.
    """
    before, left = sizing.root_mean_squares()
    found, chosen, unknown = list[tuple[Sizing, ...]](), list[str](), dict[str, str]()
    while left > COMPLETE * before and len(chosen) < len(sizing.before.bodies):
        rest = sorted(set(sizing.before.bodies) - set(chosen))
        trials = dict[str, Sizing]()
        for body in rest:
            try:
                trials[body] = _with_sites_on([*chosen, body], sizing, restrictions)
            except SizingError as error:
                unknown.setdefault(body, str(error))
        remain = {body: one.root_mean_squares()[1] for body, one in trials.items()}
        if not min(remain.values(), default=left) < (1.0 - _LESS) * left:
            break
        left = min(remain.values())
        best = [body for body in remain if remain[body] <= left + COMPLETE * before]
        found.append(tuple(trials[body] for body in best))
        chosen.append(best[0])
    return tuple(found), unknown


def _with_sites_on(bodies: Sequence[str], sizing: Sizing, restrictions: Restrictions) -> Sizing:
    """The sizing with further sites, each named after its body; far out where that leaves less by _FARTHER.

    Their places in the file's frames are rounded as far as that loses nothing: what remains is with them as stated.
    """
    model, names, (limits, equal, added) = sizing.before, [one.site for one in sizing.counter_masses], restrictions
    best, rounding = sizing, COMPLETE * sizing.root_mean_squares()[0]

    def sized(places: Mapping[str, Floats], digits: int | None = None) -> tuple[float, Sizing]:
        sites = dict[str, Site]()
        for body, place in places.items():
            stated = place if digits is None else np.round(model.in_file(body, place), digits) + 0.0
            at = place if digits is None else model.anchor(body, stated).position
            sites[f"on {body}"] = Site(f"on {body}", model.body_index(body), at, on=body)
        wider = replace(model, sites={**model.sites, **sites})
        one = exact_sizing(sizing.conditions, wider, [*names, *sites], limits, sizing.objective, equal, added)
        return one.root_mean_squares()[1], one

    for times in REACHES:
        places = _best_places(bodies, times, sizing, restrictions)
        exact, _ = sized(places)
        if times == REACHES[0] or exact < (1.0 - _FARTHER) * best.root_mean_squares()[1] - rounding:
            rounded = (sized(places, k) for k in range(4, 12))
            best = next((one for left, one in rounded if left <= exact + 0.5 * rounding), best)
    return best


def _extent(model: Mechanism, body: str) -> float:
    """Distance from a body's joint to the farthest joint, site or centre of mass on it, else on any body [m]."""
    index = model.body_index(body)
    places = [(site.body, site.position) for site in model.sites.values()]
    places += [(k, model.centre(one)) for k, one in enumerate(model.bodies) if model.mass(one)]
    for one in model.tree.joints:
        places += [(k, one.position) for k, joint in enumerate(model.tree.bodies) if joint == one.parent]
    apart = [(k, float(np.linalg.norm(place))) for k, place in places]
    return max((far for k, far in apart if k == index), default=0.0) or max((far for _, far in apart), default=1.0)


def _best_places(bodies: Sequence[str], times: float, sizing: Sizing, restrictions: Restrictions) -> dict[str, Floats]:
    """Where on each of ``bodies`` a counter-mass has the least residual, of equals the least mass in all, (3,) [m].

    At most ``times`` as far from the joint as the body's own points. A mass m at p counts by m and m p: what is left is
    the length of a vector linear in them and in the other masses, |m p| <= m times that distance, a conic programme.
    """
    model, goal = sizing.before, sizing.objective or sizing.conditions.objective
    names, (limits, equal, added) = [one.site for one in sizing.counter_masses], restrictions
    columns, target = goal.system(model, names)
    groups = site_groups(names, equal)
    own = np.column_stack([columns[:, group].sum(axis=1) for group in groups])
    most = np.array([upper_limits(names, limits)[group].min() for group in groups])
    far = np.array([times * _extent(model, body) for body in bodies])
    first = [len(PARAMETERS) * model.body_index(body) for body in bodies]
    further = [goal.factor[:, k : k + 4] * [1.0, r, r, r] for k, r in zip(first, far, strict=True)]
    size = np.concatenate(
        [np.linalg.norm(own, axis=0)] + [np.full(4, np.linalg.norm(one, axis=0).max()) for one in further]
    )
    size = np.where(size > 1e-12 * size.max(), size, size.max() or 1.0) / np.linalg.norm(target)
    count, sites = len(size), len(groups)
    triangle = np.asarray(np.linalg.qr(np.column_stack([own, *further, target]), mode="r")) / np.linalg.norm(target)
    triangle[:, :-1] /= size
    unit, capped = np.eye(count), np.flatnonzero(np.isfinite(most))
    weight = np.concatenate([[len(group) for group in groups], np.tile([1.0, 0.0, 0.0, 0.0], len(bodies))]) / size
    total = total_limit(added) / weight.max()
    weight /= weight.max()
    sides = [np.zeros((1, count)), triangle[:, :-1], -unit[sites:], -unit[:sites], unit[capped]]
    right = [np.zeros(1), triangle[:, -1], np.zeros(count), most[capped] * size[capped]]
    if np.isfinite(total):
        sides, right = [*sides, weight[None]], [*right, np.array([total])]
    rows = np.vstack(sides)
    rows = np.column_stack([rows, np.zeros(len(rows))])  # the last unknown: the length of what is left
    rows[0, -1] = -1.0
    cones = [("SecondOrder", 1 + len(triangle)), *[("SecondOrder", 4)] * len(bodies)]
    cones.append(("Nonnegative", len(rows) - 1 - len(triangle) - 4 * len(bodies)))
    found = conic_optimum(np.append(_LIGHT * weight, 1.0), rows, np.concatenate(right), cones, 1e-12)
    if str(found.status) not in {"Solved", "AlmostSolved"}:
        raise SizingError(f"its place did not converge: the conic solver stopped at {found.status}")
    masses = np.asarray(found.x)[sites:-1].reshape(-1, 4)
    return {
        body: moment / mass * r
        for body, (mass, *moment), r in zip(bodies, masses, far, strict=True)
        if mass > _ROUNDING
    }


@dataclass(frozen=True)
class Verdict:
    """Whether counter-masses balance a mechanism completely, and what they leave."""

    balanced: bool
    attainable: bool
    """Whether masses of any size at these sites, within their limits, would."""
    before: float
    """Root of the objective without counter-masses [its unit]."""
    after: float
    """With them."""
    least: float | None
    """What no masses that are allowed are below; None where that is not known."""
    directions: tuple[RemainingDirection, ...]
    """Empty where it is balanced, or where not the force alone is made small."""
    needed: tuple[tuple[Sizing, ...], ...]
    """``needed_sites``. Empty where masses of any size at these sites would do, or their total is what holds them, or
    where not the force alone is made small: what is mounted adds to moment and torque by its inertia, which is open."""
    unknown: Mapping[str, str] = field(default_factory=dict)
    """Of bodies on which the best further site was not found, why."""

    @property
    def has_finding(self) -> bool:
        """Whether it is not balanced, steps of stock plates aside."""
        return not self.balanced and not (self.attainable and self.after <= STEPS * self.before)


def verdict_of(
    found: Sizing,
    any_mass: Sizing,
    samples: Callable[[Mechanism], Floats] | None,
    limits: Mapping[str, float] | None = None,
    equal: Sequence[Sequence[str]] = (),
    added: float | None = None,
) -> Verdict:
    """The verdict on counter-masses, ``any_mass`` the best ones of any mass.

    Both of the same ``limits``, ``added`` [kg] and ``equal``.

    ``samples`` gives the force, or the momentum over the workspace, of a mechanism, (n, 3) [unit of the objective].
    """
    before, after = found.root_mean_squares()
    balanced, attainable = found.is_complete(), any_mass.is_complete()
    directions = (
        () if balanced or samples is None else remaining_directions(samples(found.before), samples(found.after))
    )
    is_full = added is not None and any_mass.added_mass >= added * (1.0 - COMPLETE)
    has_needs = not (attainable or is_full or samples is None)
    needed, unknown = needed_sites(any_mass, (limits, equal, added)) if has_needs else ((), {})
    least = None if found.bound is None else min(found.bound**0.5, after)
    return Verdict(balanced, attainable, before, after, least, directions, needed, unknown)


@dataclass(frozen=True)
class SizingStudy(Shown, rows="counter_masses", figure="balance.figures.mechanism:draw_sizing"):
    """Counter-masses of a mechanism, the verdict on them, and a motion with and without them.

    >>> import balance
    >>> sizing = balance.size("four-bar")
    >>> sizing.balanced, [one.site for one in sizing.counter_masses]
    (True, ['counter_A0A', 'counter_B0B'])
    """

    sets: tuple[Sizing, ...]
    """The best set of counter-masses, then the next best that were asked for."""
    any_mass: Sizing
    """The best ones of any mass: other than the first set where there is a stock."""
    verdict: Verdict
    weights: Mapping[str, float]
    """What is made small, by name."""
    motion: str | None
    stock: str | None
    stock_use: StockUse | None = None
    trajectory: Trajectory | None = None
    rig: str | None = None
    left_out: tuple[str, ...] = ()
    """Keys of the rig that the base's vibration is computed without."""
    added: float | None = None
    """What all counter-masses together may weigh [kg]; None without such a limit."""
    unlimited: Sizing | None = None
    """The best ones of any mass without that limit and those of the sites; None where there is none."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Largest mass by site [kg], of sites that have one."""
    equal: tuple[tuple[str, ...], ...] = ()
    """Groups of sites of equal masses."""
    given: bool = False
    """Whether the masses were given, not sized."""
    files: tuple[FileDigest, ...] = ()
    """What was read: mechanism, motion, stock, rig."""

    @property
    def best(self) -> Sizing:
        """The best set."""
        return self.sets[0]

    @property
    def counter_masses(self) -> tuple[CounterMass, ...]:
        """Of the best set."""
        return self.best.counter_masses

    @property
    def before(self) -> Mechanism:
        """The mechanism without them."""
        return self.best.before

    @property
    def after(self) -> Mechanism:
        """The mechanism with them."""
        return self.best.after

    @property
    def balanced(self) -> bool:
        """Whether they balance it completely."""
        return self.verdict.balanced

    @property
    def has_finding(self) -> bool:
        """Whether more remains than steps of stock plates leave, something was left out, or the motion is coarse."""
        coarse = self.trajectory.coarse if self.trajectory else ()
        return self.verdict.has_finding or bool(self.left_out) or bool(coarse)

    @cached_property
    def without_slides(self) -> Sizing | None:
        """Other masses, with which all first moments are zero: what is left is what slides move along their own axes.

        None where there are none, or on a motion, which weighs both.
        """
        found = self.any_mass.conditions
        if self.motion is not None or "kg" not in found.units:
            return None
        rows = found.on_first_moments @ found.matrix
        target = Objective(np.pad(rows, ((0, 0), (0, 1))), "kg m")
        sites = [one.site for one in self.counter_masses]
        other = exact_sizing(found, self.before, sites, self.limits, target, self.equal, self.added)
        nearer = other.is_complete() and not replace(self.any_mass, objective=target).is_complete()
        return other if nearer else None

    @property
    def made_small(self) -> str:
        """What is made small, in words."""
        return objective.made_small(self.weights, self.motion)

    @property
    def allowed(self) -> str:
        """Where masses may be mounted, and the limits, in words."""
        return allowed(self.counter_masses, self.limits, self.equal, self.added)

    @cached_property
    def responses(self) -> dict[str, Response]:
        """The motion ``before`` and ``after`` balancing; none without a motion."""
        if self.trajectory is None:
            return {}
        return {name: simulate(getattr(self, name), self.trajectory) for name in ("before", "after")}

    def document(self) -> dict[str, Any]:
        """For JSON: units in the keys."""
        verdict, result = self.verdict, self.best
        unit = f"_{result.objective.unit}" if result.objective and self.motion and len(self.weights) == 1 else ""
        over = "workspace" if self.motion is None else "motion"
        found: dict[str, Any] = {
            "payload_kg": self.before.carried,
            "given": self.given,
            "balanced": verdict.balanced,
            "attainable_with_any_mass": verdict.attainable,
            "limits_kg": dict(self.limits),
            "equal": [list(group) for group in self.equal],
            "objective": {"weights": dict(self.weights), "over": over, "motion": self.motion},
            f"rms_before{unit}": verdict.before,
            f"rms{unit}": verdict.after,
            f"rms_bound{unit}": verdict.least,
            "remaining_percent": result.remaining_percent(),
            "remaining_directions": [
                {"direction": one.direction.tolist(), f"rms_before{unit}": one.before, f"rms{unit}": one.after}
                for one in verdict.directions
            ],
            "sites_needed": [
                {
                    "new_sites": [{"body": body, **plain(mass)} for body, mass in self.further(one)],
                    "counter_masses_kg": {at.site: at.mass for at in one.counter_masses[: len(self.counter_masses)]},
                    "added_mass_kg": one.added_mass,
                    f"rms{unit}": one.root_mean_squares()[1],
                    "remaining_percent": one.remaining_percent(),
                }
                for equals in verdict.needed
                for one in equals
            ],
            "sites_unknown": dict(verdict.unknown),
        }
        if self.stock_use:
            found |= self.stock_use.document()
        if len(self.sets) > 1:
            found["sets"] = [
                {"counter_masses": plain(one.counter_masses), "remaining_percent": one.remaining_percent()}
                for one in self.sets
            ]
        if self.unlimited:
            found |= {
                "added_limit_kg": self.added,
                "without_limits": {
                    "added_mass_kg": self.unlimited.added_mass,
                    "remaining_percent": self.unlimited.remaining_percent(),
                },
            }
        if self.without_slides:
            found["zero_first_moments_kg"] = {one.site: one.mass for one in self.without_slides.counter_masses}
        if self.rig:
            found |= {"rig": self.rig, "left_out": list(self.left_out)}
        return sizing_document(result) | found

    def __str__(self) -> str:
        """First how much remains; then what would remove it."""
        return "\n".join(self._sentences())

    def _sentences(self) -> Iterator[str]:
        verdict = self.verdict
        where = "over the workspace" if self.motion is None else f"in motion {PurePath(self.motion).name}"
        added = f"{self.best.added_mass:.4f} kg added"
        if verdict.balanced:
            yield f"Balanced completely {where}, {added}."
            return
        unit = {"N": "N", "Nm": "N m", "m_per_s2": "m/s2"}.get(self.best.objective.unit if self.best.objective else "")
        sizes = f" ({verdict.after:.4g} {unit} of {verdict.before:.4g} {unit})" if unit else ""
        remains = f"{self._share(verdict.after)} of the RMS {self.made_small} remains"
        yield f"Not balanced completely: {remains} {where}{sizes}, {added}."
        yield self._proof()
        for one in verdict.directions:
            if one.after > 1e-6 * verdict.before:
                along = ", ".join(f"{x:.3g}" for x in one.direction)
                after, before = (f"{x:.4g} {unit}" if unit else self._share(x) for x in (one.after, one.before))
                yield f"  in direction ({along}) of the base: {after} of {before}"
        if self.stock or self.given:
            remain = per_cent_text(self.any_mass.remaining_percent())
            yield "Masses of other sizes at these sites would " + (
                "balance it completely." if verdict.attainable else f"leave {remain}{self._within()}."
            )
        bound = self.any_mass.root_mean_squares()[1] - COMPLETE * verdict.before
        if self.unlimited and self.unlimited.root_mean_squares()[1] < bound:
            free, what = self.unlimited, ["the limits of the sites"] * bool(self.limits)
            what += [] if self.added is None else [f"the limit of {self.added:.4g} kg in all"]
            left = f"leave {per_cent_text(free.remaining_percent())}"
            yield (
                f"Without {' and '.join(what)}, masses of any size at these sites would "
                f"{'balance it completely' if free.is_complete() else left}, with {free.added_mass:.4f} kg added."
            )
        if self.stock_use:
            yield from self.stock_use.sentences(
                lambda part: f"{part * verdict.before:.4g} {unit}" if unit else per_cent_text(100.0 * part)
            )
        needed = max(one.mass for one in self.any_mass.counter_masses)
        name, lightest = self.stock_use.lightest if self.stock_use else ("", 0.0)
        if self.stock_use and self.added is not None and self.added < lightest:
            yield f"The lightest plate, {name} of {lightest:.4f} kg, is heavier than the {self.added:.4g} kg in all."
        elif self.stock_use and not self.best.added_mass and 0.0 < needed < lightest:
            yield (
                f"The lightest plate, {name} of {lightest:.4f} kg, is heavier than the mass needed at every site (at "
                f"most {needed:.4f} kg): add lighter plates, or correct the unit of their masses (mass_kg, mass_g)."
            )
        for equals in verdict.needed:
            *others, _ = [body for body, _ in self.further(equals[0])]
            bodies = " or ".join(self.further(one)[-1][0] for one in equals)
            sites = f"further sites, on {' and '.join([*others, bodies])}" if others else f"a further site, on {bodies}"
            left = "nothing" if equals[0].is_complete() else per_cent_text(equals[0].remaining_percent())
            yield f"With {sites}: {left} would remain."
        for body, why in verdict.unknown.items():
            yield f"Whether a further site on {body} would do better was not found ({why}): try sites there by --site."
        if self.without_slides:
            masses = ", ".join(f"{one.mass:.4f} kg at {one.site}" for one in self.without_slides.counter_masses)
            yield (
                "What slides move along their own axes no mass balances, and masses on them add to it. All first "
                f"moments are zero with {masses}; a motion tells which of both shakes less."
            )
        elif verdict.directions and not verdict.attainable and not verdict.needed and self.added is None:
            yield f"No counter-mass on any {'other ' * bool(verdict.unknown)}body would lessen it."

    def further(self, one: Sizing) -> list[tuple[str, CounterMass]]:
        """Body and counter-mass at each of the further sites of one of the verdict's ``needed``."""
        bodies = one.before.bodies
        return [(bodies[one.before.site(at.site).body], at) for at in one.counter_masses[len(self.counter_masses) :]]

    def _share(self, value: float) -> str:
        """Part of what is made small without counter-masses."""
        return per_cent_text(100.0 * value / self.verdict.before)

    def _within(self) -> str:
        """The limits, where there are any."""
        limits = ["their limits"] * bool(self.limits) + ([] if self.added is None else [f"{self.added:.4g} kg in all"])
        return f" within {' and '.join(limits)}" if limits else ""

    def _proof(self) -> str:
        """How near the masses are to the best."""
        if self.given:
            return "These masses were given, not sized."
        within = self._within()
        what = f"choice of these plates{within} leaves" if self.stock else f"masses at these sites{within} leave"
        if self.verdict.least is None:
            return f"No other {what} less nearby, where it is linear in the masses; a bound is not known."
        if self.verdict.after <= self.verdict.least * (1.0 + 1e-6):
            return f"No other {what} less."
        return f"Not proven to be the least, which is above {self._share(self.verdict.least)}."


def study_sizing(
    model: Mechanism,
    trajectory: Trajectory | None = None,
    *,
    motion: str | None = None,
    sites: Sequence[str] = (),
    stock: str | None = None,
    limits: Mapping[str, float] | None = None,
    equal: Sequence[Sequence[str]] = (),
    best: int = 1,
    weights: Mapping[str, float] | None = None,
    rig: str | None = None,
    payload_bodies: Sequence[str] = (),
    added: float | None = None,
    given: Mapping[str, float] | None = None,
) -> SizingStudy:
    """Counter-masses at ``sites`` of least ``weights`` over a trajectory, or the workspace; of plates with a ``stock``.

    ``motion`` names the trajectory; ``limits`` [kg] by site, ``added`` [kg] of all masses together; ``given`` masses
    [kg] by site are judged beside the best ones at their sites. Raises SizingError, or DataError for a file.
    """
    weights = weights or {"force": 1.0}
    if given:
        refuse_sized(sites=sites, stock=stock, limits=limits, equal=equal, added=added is not None, rig=rig)
        sites = list(given)
    _refuse_unlike(weights, trajectory, rig, best if stock is None else 1)
    conditions, sites = balance_conditions(model), chosen_sites(model, sites)
    refuse_swinging(conditions, model, sites)
    left_out: tuple[str, ...] = ()
    if rig and trajectory:
        from . import base_vibration  # late: forces are balanced without reading a rig

        measured = base_vibration.load_measured_base(rig)
        if PurePath(measured.mechanism).stem not in {"", "none", model.name}:
            raise SizingError(
                f"rig {rig} is of mechanism {measured.mechanism!r}, not {model.name!r}: give a rig of the mechanism "
                "that is sized"
            )
        left_out = tuple(f"bench.{key}" for key in measured.left_out)
        vibration = base_vibration.vibration_objective(model, trajectory, measured, weights)
        of_any_mass = partial(base_vibration.least_vibration, conditions, model, sites, vibration)
    else:
        target = objective.motion_objective(model, trajectory, weights) if trajectory else conditions.objective
        of_any_mass = partial(exact_sizing, conditions, model, sites, objective=target)
    any_mass = of_any_mass(limits=limits, equal=equal, added=added)
    unlimited = of_any_mass(equal=equal) if limits or added is not None else None
    sets: Sequence[Sizing] = [any_mass]
    if given:
        sets = [sizing_of_given(conditions, model, given, objective=any_mass.objective)]
    use: StockUse | None = None
    if stock:
        from .stock_plates import load_stock
        from .stock_search import selections

        plates = load_stock(stock)
        ways = selections(np.array([plate.quantity for plate in plates]), len(sites))

        def from_stock(target: Objective | None, exact: Exact | None = None) -> Sequence[Sizing]:
            return best_sets_from_stock(conditions, model, plates, sites, limits, target, equal, best, exact, added)

        least = any_mass.objective
        if rig and trajectory and isinstance(least, base_vibration.VibrationObjective):
            sets = base_vibration.least_vibration_from_stock(model, sites, least, ways, from_stock)
        else:
            sets = from_stock(least)
        use = stock_use(sets[:1], plates, limits, equal, is_linear=rig is None, added=added)
    first = replace(sets[0], payload_bodies=tuple(payload_bodies) or model.payload_bodies)
    samples = _samples(trajectory, model) if set(weights) == {"force"} else None
    verdict = verdict_of(first, any_mass, samples, limits, equal, added)
    return SizingStudy(
        (first, *sets[1:]), any_mass, verdict, weights, motion, stock, use, trajectory, rig, left_out, added, unlimited,
        dict(limits or {}), tuple(map(tuple, equal)), bool(given),
    )  # fmt: skip


def allowed(
    masses: Sequence[CounterMass], limits: Mapping[str, float], equal: Sequence[Sequence[str]], added: float | None
) -> str:
    """Where ``masses`` may be mounted, and the ``limits`` [kg] by site and of all, in words."""
    limited = [f"{c.site}, at most {limits[c.site]:.4g} kg" if c.site in limits else c.site for c in masses]
    parts = ["; ".join(limited), *(f"equal at {' and '.join(group)}" for group in equal)]
    return "; ".join([*parts, *([] if added is None else [f"at most {added:.4g} kg in all"])])


def refuse_sized(**asked: object) -> None:
    """Raise SizingError, naming what is asked of a sizing, where masses are given."""
    if named := [name for name, value in asked.items() if value]:
        raise SizingError(
            f"masses that are given are not sized: leave out {', '.join(named)}, or leave out the masses and have them "
            "sized"
        )


def _refuse_unlike(weights: Mapping[str, float], trajectory: Trajectory | None, rig: str | None, best: int) -> None:
    """Raise SizingError for weights that are none, or that ask for what the rest does not give."""
    for name, weight in weights.items():
        if name not in objective.MADE_SMALL or not 0.0 < weight < np.inf:
            names = ", ".join(objective.MADE_SMALL)
            raise SizingError(f"objective {name!r} of weight {weight:g}: expected {names}, weights above zero")
    if bool(rig) != ("vibration" in weights):
        raise SizingError("the objective vibration and a rig go together")
    if trajectory is None and set(weights) != {"force"}:
        raise SizingError(f"the objective {', '.join(weights)} is of a motion: give one")
    if best != 1:
        raise SizingError(f"best {best}: several sets are of plates, from stock; of any mass one is the best")


def _samples(trajectory: Trajectory | None, model: Mechanism) -> Callable[[Mechanism], Floats]:
    """The force along a motion, or the momentum over the workspace, of a mechanism."""
    if trajectory is not None:
        return lambda one: simulate(one, trajectory).force
    rows = cache(partial(objective.workspace_momentum, model))  # found where something remains
    return lambda one: rows() @ one.pi
