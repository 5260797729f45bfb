"""Counter-masses with all there is to say of them: how good they are, what remains and why, a motion with them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import PurePath
from typing import Any

import numpy as np

from ..arrays import Floats, root_mean_square
from ..closure import Closure, Trajectory
from ..dynamics.inverse_dynamics import Response, simulate
from ..errors import SizingError
from ..mechanism.mechanism import PARAMETERS, Mechanism
from ..results import Shown, per_cent_text, plain
from . import objective
from .conditions import balance_conditions
from .least_masses import bounded_least_squares
from .objective import Exact, Objective
from .sizing import (
    COMPLETE,
    CounterMass,
    Sizing,
    StockUse,
    along_axes,
    best_sets_from_stock,
    chosen_sites,
    exact_sizing,
    site_groups,
    sizing_document,
    stock_use,
    total_limit,
    upper_limits,
)

STEPS = 0.05
"""Share of the shaking force that steps of stock plates may leave where other masses would balance completely."""

_LESS = 1e-3
"""Part of what is left by which another site must lessen it to be worth naming."""
_SMALL = 1e-6
"""Weight that holds unknowns small where nothing else does, columns of length one."""


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


@dataclass(frozen=True)
class NeededSite:
    """A body that lacks a site at the right place."""

    body: str
    after: float
    """Root of the objective that the best masses leave with it, and with those named before it [its unit]."""
    first_moment: Floats
    """Which the counter-mass has there, about the origin of the body's frame and along its axes, (3,) [kg m], once
    those on all bodies named are mounted; of several as good that of least squares."""
    alternatives: tuple[str, ...] = ()
    """Other bodies that would do as well in its place."""
    masses: Mapping[str, float] = field(default_factory=dict)
    """Counter-masses at the sizing's sites then [kg]."""


def needed_sites(
    sizing: Sizing, limits: Mapping[str, float] | None = None, equal: Sequence[Sequence[str]] = ()
) -> tuple[NeededSite, ...]:
    """Bodies where a counter-mass of any mass at any place would lessen what is left, the most helpful first.

    Each with those before it, besides those at the sizing's sites of any mass within ``limits`` [kg], those of a group
    of ``equal`` the same, until nothing is left or nothing helps. Of bodies that would do as well the first by name, so
    that the order of the file does not matter.
    """
    mechanism, objective = sizing.before, sizing.objective
    assert objective is not None
    names = [c.site for c in sizing.counter_masses]
    columns, target = objective.system(mechanism, names)
    groups = site_groups(names, equal)
    columns = np.column_stack([columns[:, group].sum(axis=1) for group in groups])
    most = np.array([upper_limits(names, limits)[group].min() for group in groups])
    before, left = sizing.root_mean_squares()
    found: list[NeededSite] = []
    chosen, bounds = columns, np.zeros(columns.shape[1])
    while left > COMPLETE * before and len(found) < len(mechanism.bodies):
        trials = []
        for body in sorted(set(mechanism.bodies) - {one.body for one in found}):
            first = len(PARAMETERS) * mechanism.body_index(body)
            added = np.hstack([chosen, objective.factor[:, first : first + 4]])
            least = np.concatenate([bounds, [0.0], np.full(3, -np.inf)])
            trials.append((_least_squares(added, target, least, most)[0], body, added, least))
        smallest = min(size for size, *_ in trials)
        if not smallest < (1.0 - _LESS) * left:
            break
        (left, body, chosen, bounds), *others = (one for one in trials if one[0] <= smallest + COMPLETE * before)
        alternatives = tuple(name for _, name, *_ in others)
        found.append(NeededSite(body, left if left > COMPLETE * before else 0.0, np.zeros(3), alternatives))
    _, unknown = _least_squares(chosen, target, bounds, most, _SMALL)
    masses = {names[i]: float(mass) for group, mass in zip(groups, unknown, strict=False) for i in group}
    moments = unknown[len(groups) :].reshape(-1, 4)[:, 1:]
    return tuple(replace(one, first_moment=moment, masses=masses) for one, moment in zip(found, moments, strict=True))


def _least_squares(
    columns: Floats, target: Floats, least: Floats, most: Floats, small: float = 0.0
) -> tuple[float, Floats]:
    """Root of the least square error with unknowns of at least ``least``, the first of at most ``most``, and the
    unknowns; ``small`` holds those that change nothing small.
    """
    size, upper = np.linalg.norm(columns, axis=0), np.full(columns.shape[1], np.inf)
    upper[: len(most)] = most
    used = (size > 1e-12 * size.max(initial=0.0)) & (upper > least)
    unknown = np.zeros(len(size))
    if used.any():
        unit = columns[:, used] / size[used]
        count = unit.shape[1]
        augmented, wanted = np.vstack([unit, small * np.eye(count)]), np.pad(target, (0, count))
        unknown[used] = bounded_least_squares(augmented, wanted, least[used], upper[used] * size[used]) / size[used]
    return float(np.linalg.norm(columns @ unknown - target)), unknown


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
    needed: tuple[NeededSite, ...]
    """Empty where masses of any size at these sites would do, or their total is what holds them, or where not the
    force alone is made small: inertia of what is mounted adds to moment and torque by the place, which is open here."""

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
    needed = () if attainable or is_full or samples is None else needed_sites(any_mass, limits, equal)
    if needed and sum(needed[-1].masses.values()) > total_limit(added):
        needed = ()
    least = None if found.bound is None else min(found.bound**0.5, after)
    return Verdict(balanced, attainable, before, after, least, directions, needed)


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
    any_total: Sizing | None = None
    """The best ones of any mass without that limit."""

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
            "balanced": verdict.balanced,
            "attainable_with_any_mass": verdict.attainable,
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
                    "body": one.body,
                    "alternatives": list(one.alternatives),
                    "first_moment_kgm": one.first_moment.tolist(),
                    "counter_masses_kg": dict(one.masses),
                    f"rms{unit}": one.after,
                }
                for one in verdict.needed
            ],
        }
        if self.stock_use:
            found |= self.stock_use.document()
        if len(self.sets) > 1:
            found["sets"] = [
                {"counter_masses": plain(one.counter_masses), "remaining_percent": one.remaining_percent()}
                for one in self.sets
            ]
        if self.any_total:
            found |= {
                "added_limit_kg": self.added,
                "without_added_limit": {
                    "added_mass_kg": self.any_total.added_mass,
                    "remaining_percent": self.any_total.remaining_percent(),
                },
            }
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
        what = "momentum" if self.motion is None else " and ".join(objective.MADE_SMALL[name] for name in self.weights)
        sizes = f" ({verdict.after:.4g} {unit} of {verdict.before:.4g} {unit})" if unit else ""
        yield (
            f"Not balanced completely: {self._share(verdict.after)} of the RMS {what} remains {where}{sizes}, {added}."
        )
        yield self._proof()
        for one in verdict.directions:
            if one.after > 1e-6 * verdict.before:
                along = ", ".join(f"{x:.3g}" for x in one.direction)
                after, before = (f"{x:.4g} {unit}" if unit else self._share(x) for x in (one.after, one.before))
                yield f"  along ({along}): {after}, without counter-masses {before}"
        if self.stock:
            remain = per_cent_text(self.any_mass.remaining_percent())
            yield "Masses of other sizes at these sites would " + (
                "balance it completely." if verdict.attainable else f"leave {remain}{self._in_all()}."
            )
        if self.any_total and self.any_total.added_mass > self.any_mass.added_mass * (1.0 + COMPLETE):
            free = self.any_total
            left = f"leave {per_cent_text(free.remaining_percent())}"
            yield (
                f"Without the limit of {self.added:.4g} kg in all, masses of any size at these sites would "
                f"{'balance it completely' if free.is_complete() else left}, with {free.added_mass:.4f} kg added."
            )
        if self.stock_use and (use := str(self.stock_use)):
            yield use
        needed = max(one.mass for one in self.any_mass.counter_masses)
        name, lightest = self.stock_use.lightest if self.stock_use else ("", 0.0)
        if self.stock_use and self.added is not None and self.added < lightest:
            yield f"The lightest plate, {name} of {lightest:.4f} kg, is heavier than the {self.added:.4g} kg in all."
        elif self.stock_use and not self.best.added_mass and 0.0 < needed < lightest:
            yield (
                f"The lightest plate, {name} of {lightest:.4f} kg, is heavier than the mass needed at every site (at "
                f"most {needed:.4f} kg): add lighter plates, or correct the unit of their masses (mass_kg, mass_g)."
            )
        yield from self._needed()
        if verdict.needed:
            then = verdict.needed[-1].masses
            changed = [
                f"{then[one.site]:.4f} kg at {one.site}"
                for one in self.best.counter_masses
                if abs(then[one.site] - one.mass) > 1e-3 * max(then[one.site], one.mass)
            ]
            if changed:
                any_size = ", of any size" if self.stock else ""
                yield f"The masses are other ones then{any_size}: {', '.join(changed)}."
        if verdict.directions and not verdict.attainable and not verdict.needed and self.added is None:
            yield "No counter-mass on any body would lessen it."

    def _needed(self) -> Iterator[str]:
        """Further sites one after the other, what remains with each, and the first moments that all of them take."""
        needed, alone = self.verdict.needed, len(self.verdict.needed) == 1
        moments = [f"{along_axes(s.first_moment)} kg m on {s.body}" for s in needed if s.first_moment.any()]
        takes = f", with the first moment {moments[0]}" if alone and moments else ""
        for number, site in enumerate(needed):
            bodies = " or ".join([site.body, *site.alternatives])
            left = f"{self._share(site.after)} would" if site.after else "nothing would"
            on = f"And on body {bodies} too" if number else f"With another site, on body {bodies}"
            yield f"{on}{takes}: {left} remain."
        if moments and not alone:
            yield f"All of them take the first moments {', '.join(moments)}."
        if moments:
            yield "A mass that gives such a moment counts on the bodies that carry it, too: size again with the site."

    def _share(self, value: float) -> str:
        """Part of what is made small without counter-masses."""
        return per_cent_text(100.0 * value / self.verdict.before)

    def _in_all(self) -> str:
        """The limit of the total, where there is one."""
        return "" if self.added is None else f" within {self.added:.4g} kg in all"

    def _proof(self) -> str:
        """How near the masses are to the best."""
        within = self._in_all()
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
) -> SizingStudy:
    """Counter-masses at ``sites`` of least ``weights`` over a trajectory, or the workspace; of plates with a ``stock``.

    ``motion`` names the trajectory; ``limits`` [kg] by site, ``added`` [kg] of all masses together. Raises SizingError,
    or DataError for a file.
    """
    weights = weights or {"force": 1.0}
    _refuse_unlike(weights, trajectory, rig, best if stock is None else 1)
    conditions, sites = balance_conditions(model), chosen_sites(model, sites)
    if conditions.idle and Closure(model.with_counter_mass(dict.fromkeys(sites, 1.0))).idle != conditions.idle:
        raise SizingError(
            f"{model.name}: with masses at {', '.join(sites)}, bodies that turn idly ({', '.join(conditions.idle)}) "
            "would swing, which no motor determines: leave those sites out, or put them on the line they turn about"
        )
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
        of_any_mass = partial(base_vibration.least_vibration, conditions, model, sites, vibration, limits, equal)
    else:
        target = objective.motion_objective(model, trajectory, weights) if trajectory else conditions.objective
        of_any_mass = partial(exact_sizing, conditions, model, sites, limits, target, equal)
    any_mass, any_total = of_any_mass(added), None if added is None else of_any_mass(None)
    sets: Sequence[Sizing] = [any_mass]
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
        (first, *sets[1:]), any_mass, verdict, weights, motion, stock, use, trajectory, rig, left_out, added, any_total
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
