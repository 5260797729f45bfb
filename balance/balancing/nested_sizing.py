"""Counter-masses for several payloads of one mechanism: sets that only grow with the payload, or one set for all.

What is mounted for one payload stays for the next; a fixed set suits a machine that carries them in turn. Least is the
sum over the payloads of what is made small.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ..arrays import Floats
from ..closure import Trajectory
from ..datasets import FileDigest
from ..errors import SizingError
from ..mechanism.mechanism import Mechanism
from ..results import IN_BODY, Key, Shown, per_cent_text
from .conditions import balance_conditions
from .objective import MADE_SMALL, made_small, motion_objective, workspace_objective
from .sizing import (
    COMPLETE,
    Sizing,
    StockUse,
    chosen_sites,
    exact_sizing,
    of_any_mass,
    piles_of,
    refuse_swinging,
    sizing_document,
    sizing_of_given,
    sizing_system,
    stock_system,
    stock_use,
)
from .sizing_study import STEPS, allowed, refuse_sized

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PayloadMass:
    """A counter-mass for one of several payloads.

    >>> import balance
    >>> nested = balance.size_nested("parallelogram-6bar", [{"platform": "1.451 kg"}, {"platform": "5 kg"}])
    >>> [round(one.added, 4) for one in nested.counter_masses if one.site == "counter_A0A"]
    [10.099, 14.1771]
    """

    payload: Annotated[Mapping[str, float], Key("payload_kg", "payload [kg]", lambda given: _masses(given))]
    """Masses of bodies [kg]."""
    site: Annotated[str, Key("", "site")]
    mass: Annotated[float, Key("mass_kg", "mass [kg]", ".4f")]
    """[kg]"""
    added: Annotated[float, Key("added_kg", "added [kg]", ".4f")]
    """To what is mounted for the payload before [kg]."""
    position: Annotated[Floats, IN_BODY]
    """Of the site in the frame of its body as in the mechanism's file, (3,) [m]."""
    plates: Annotated[tuple[str, ...], Key("plates_added", "plates added", lambda names: " + ".join(names) or "-")] = ()
    """Stock plates that are added."""


@dataclass(frozen=True)
class PayloadRemainder:
    """What remains with one of several payloads.

    >>> import balance
    >>> nested = balance.size_nested("four-bar", [{"AB": "1 kg"}, {"AB": "2 kg"}], "four-bar", fixed=True)
    >>> [one.after < one.before for one in nested.remainders]
    [True, True]
    """

    payload: Annotated[Mapping[str, float], Key("payload_kg", "payload [kg]", lambda given: _masses(given))]
    """Masses of bodies [kg]."""
    before: Annotated[float, Key("rms_before", "without", ".4g")]
    """Root mean square of what is made small without counter-masses [its unit]."""
    after: Annotated[float, Key("rms", "with", ".4g")]
    """With them."""
    percent: Annotated[float | None, Key("remaining_percent", "remain", per_cent_text)]
    """Part of it that remains [%]; None where there is nothing to balance."""


def _masses(masses: Mapping[str, float]) -> str:
    return ", ".join(f"{body} {mass:.4f}" for body, mass in masses.items())


@dataclass(frozen=True)
class NestedSizing(Shown, rows="counter_masses"):
    """Counter-masses for each of several payloads, and what remains with each.

    >>> import balance
    >>> nested = balance.size_nested("parallelogram-6bar", [{"platform": "1.451 kg"}, {"platform": "5 kg"}])
    >>> print(nested)
    Balanced completely with each payload.
    """

    payloads: tuple[Mapping[str, float], ...]
    """Masses of bodies [kg], rising."""
    sets: tuple[Sizing, ...]
    """One for each payload; with a ``bound`` where no other sets have a lesser sum."""
    any_mass: tuple[Sizing, ...]
    """For each payload alone the best counter-masses of any mass, within the same limits."""
    weights: Mapping[str, float]
    """What is made small, by name."""
    motion: str | None
    stock: str | None
    fixed: bool
    """Whether one set is for all payloads."""
    stock_use: StockUse | None = None
    trajectory: Trajectory | None = None
    limits: Mapping[str, float] = field(default_factory=dict)
    """Largest mass by site of each set [kg], of sites that have one."""
    equal: tuple[tuple[str, ...], ...] = ()
    """Groups of sites of equal masses."""
    added: float | None = None
    """What the masses of each set together may weigh [kg]; None without such a limit."""
    given: bool = False
    """Whether the one set was given, not sized."""
    any_percent: float | None = None
    """What such sets of any mass, without limits, leave over all payloads [%]; None where these are so sized."""
    files: tuple[FileDigest, ...] = ()
    """What was read: mechanism, motion, stock."""

    @property
    def counter_masses(self) -> tuple[PayloadMass, ...]:
        """Of each set, with what it adds to the one before it."""
        found, masses, plates = list[PayloadMass](), dict[str, float](), dict[str, Counter[str]]()
        for payload, one in zip(self.payloads, self.sets, strict=True):
            for at in one.counter_masses:
                new = Counter(at.plates) - plates.get(at.site, Counter())
                added = at.mass - masses.get(at.site, 0.0)
                found.append(PayloadMass(payload, at.site, at.mass, added, at.position, tuple(new.elements())))
                masses[at.site], plates[at.site] = at.mass, Counter(at.plates)
        return tuple(found)

    @property
    def remainders(self) -> tuple[PayloadRemainder, ...]:
        """What remains with each payload."""
        return tuple(
            PayloadRemainder(payload, *one.root_mean_squares(), 0.0 if one.is_complete() else one.remaining_percent())
            for payload, one in zip(self.payloads, self.sets, strict=True)
        )

    @property
    def made_small(self) -> str:
        """What is made small, in words."""
        return made_small(self.weights, self.motion)

    @property
    def allowed(self) -> str:
        """Where masses may be mounted, and the limits of each set, in words."""
        return allowed(self.sets[0].counter_masses, self.limits, self.equal, self.added)

    @property
    def unit(self) -> str:
        """Of what is made small over a motion; empty for several quantities, and for the momentum."""
        objective = self.sets[0].objective
        return objective.unit if objective and self.motion and len(self.weights) == 1 else ""

    @property
    def proven(self) -> bool:
        """Whether no other sets that are allowed have a lesser sum."""
        return all(one.bound is not None for one in self.sets)

    @property
    def balanced(self) -> bool:
        """Whether each payload is balanced completely."""
        return all(one.is_complete() for one in self.sets)

    @property
    def has_finding(self) -> bool:
        """Whether with some payload more remains than steps of stock plates leave, or the motion is coarse."""
        largest = max(one.remaining_percent() or 0.0 for one in self.sets)
        others = (self.stock or self.given) and all(one.is_complete() for one in self.any_mass)
        coarse = bool(self.trajectory and self.trajectory.coarse)
        return coarse or (not self.balanced and not (others and largest <= 100.0 * STEPS))

    def document(self) -> dict[str, Any]:
        """For JSON: units in the keys."""
        sets, rows, unit = [], self.counter_masses, f"_{self.unit}" if self.unit else ""
        for payload, one, alone in zip(self.payloads, self.sets, self.any_mass, strict=True):
            added = {row.site: row.added for row in rows if row.payload is payload}
            sets.append(
                {"payload_kg": dict(payload)}
                | dict(zip((f"rms_before{unit}", f"rms{unit}"), one.root_mean_squares(), strict=True))
                | sizing_document(one)
                | {"increments_kg": added, "balanced": one.is_complete(), "remaining_percent": one.remaining_percent()}
                | {"attainable_with_any_mass": alone.is_complete(), "proven": one.bound is not None}
            )
        use = self.stock_use.document() if self.stock_use else {}
        told: dict[str, Any] = {"stock": self.stock, "fixed": self.fixed, "given": self.given}
        told |= {} if self.any_percent is None else {"without_limits_percent": self.any_percent}
        return {"mechanism": self.sets[0].before.name, **told, "sets": sets} | use

    def __str__(self) -> str:
        """First how much remains with each payload; then what would remove it."""
        return "\n".join(self._sentences())

    def _sentences(self) -> Iterator[str]:
        if self.balanced:
            yield "Balanced completely with each payload."
            return
        each = self.remainders
        left = ", ".join(f"{per_cent_text(one.percent)} with {_masses(one.payload)} kg" for one in each)
        whole = 100.0 * (sum(one.after**2 for one in each) / sum(one.before**2 for one in each)) ** 0.5
        over = f"{per_cent_text(whole)} of the RMS {self.made_small} remains over all payloads"
        yield f"Not balanced completely: {over} ({left})."
        if self.any_percent is not None and self.any_percent < whole * (1.0 - COMPLETE):
            limits = ", without limits," if self.limits or self.added is not None else ""
            left = (
                "balance it completely"
                if self.any_percent < 100.0 * COMPLETE
                else f"leave {per_cent_text(self.any_percent)}"
            )
            yield f"Masses of any size at these sites{limits} would {left}."
        if self.stock_use:
            yield from self.stock_use.sentences(lambda part: f"{per_cent_text(100.0 * part)} over all payloads")

    def plot(self) -> "Figure":
        """The mechanism to scale with the last set, the first moments that it gives (matplotlib)."""
        return self.sets[-1].plot()

    def below(self) -> tuple[str, ...]:
        """First-moment residuals, and whether the sets are the best."""
        found = []
        for payload, one, alone in zip(self.payloads, self.sets, self.any_mass, strict=True):
            if alone.is_complete():
                given = ", ".join(f"{body} = {mass:.4f} kg" for body, mass in payload.items())
                residual = f"{one.residual():.4g} kg m  ({per_cent_text(one.residual_percent())})"
                found.append(f"First-moment residual at {given}  {residual}")
        if not found:
            within = " within the limits" if self.limits or self.added is not None else ""
            found.append(f"No masses at these sites{within} balance it completely with any of these payloads.")
        return (*found, self.proof)

    @property
    def proof(self) -> str:
        """How near the sets are to the best, in words."""
        if self.given:
            return "These masses were given, not sized."
        sets = "fixed sets" if self.fixed else "sets that only grow"
        proof = "proven" if self.proven else "the best found in the time, not proven"
        within = " within the limits" if self.limits or self.added is not None else ""
        return f"Least in the sum over the payloads of all {sets}{within}: {proof}."


def study_nested(
    mechanism: Mechanism,
    payloads: Sequence[Mapping[str, float]],
    trajectory: Trajectory | None = None,
    *,
    motion: str | None = None,
    sites: Sequence[str] = (),
    stock: str | None = None,
    limits: Mapping[str, float] | None = None,
    equal: Sequence[Sequence[str]] = (),
    weights: Mapping[str, float] | None = None,
    added: float | None = None,
    fixed: bool = False,
    given: Mapping[str, float] | None = None,
) -> NestedSizing:
    """Counter-masses for each of ``payloads`` [kg], in their order, of least ``weights``; or one set that is ``given``.

    The other arguments as for ``study_sizing``. Raises SizingError, also for one payload alone; DataError for a file.
    """
    from .stock_plates import load_stock

    if len(payloads) < 2:
        raise SizingError(f"expected two payloads or more, got {len(payloads)}: one is sized by balance.size")
    weights = weights or {"force": 1.0}
    if unlike := sorted(set(weights) - ({*MADE_SMALL} - {"vibration"} if trajectory else {"force"})):
        raise SizingError(f"the objective {', '.join(unlike)} is of a motion and of one payload")
    if given:
        refuse_sized(sites=sites, stock=stock, limits=limits, equal=equal, added=added is not None, fixed=fixed)
        sites, fixed = list(given), True
    models, names = [mechanism.with_payload(one) for one in payloads], chosen_sites(mechanism, sites)
    conditions, plates = balance_conditions(models[0]), load_stock(stock) if stock else None
    refuse_swinging(conditions, models[0], names)
    objectives = [motion_objective(m, trajectory, weights) if trajectory else workspace_objective(m) for m in models]
    each, steps = list(zip(objectives, models, strict=True)), 1 if fixed else len(models)
    system = sizing_system(each, names, limits, equal, added, fixed)
    piles: Sequence[Any] = [None] * len(models)
    if given:
        masses, proven = np.array([[given[name] for name in names]]), False
    elif plates is None:
        grown, bound = of_any_mass(system)
        masses = np.cumsum(grown.reshape(steps, len(names)), axis=0)
        least = float(np.sum((system["columns"] @ grown - system["target"]) ** 2))
        proven = least - bound <= COMPLETE**2 * float(np.sum(system["target"] ** 2))
    else:
        from .stock_search import best_plates  # late: masses of any size are found without it

        found = best_plates(**system, **(of_plates := stock_system(each, names, plates, fixed)))
        counts = np.cumsum(found.selections[0].counts.reshape(steps, len(names), len(plates)), axis=0)
        masses, proven = counts @ of_plates["masses"], not found.gap > 0.0
        piles = [piles_of(names, one, plates) for one in np.broadcast_to(counts, (len(models), *counts.shape[1:]))]
    sets, alone, masses = [], [], np.broadcast_to(masses, (len(models), len(names)))
    for payload, (objective, model), pile, row in zip(payloads, each, piles, masses, strict=True):
        one = sizing_of_given(conditions, model, dict(zip(names, row, strict=True)), pile, objective)
        bodies = tuple(name for name in payload if name in model.own_mass) or model.payload_bodies
        sets.append(replace(one, payload_bodies=bodies, bound=objective.value(one.after) if proven else None))
        alone.append(exact_sizing(conditions, model, names, limits, objective, equal, added))
    use = stock_use(sets, plates, limits, equal, added=added, fixed=fixed) if plates else None
    any_percent = None
    if (whole := float(np.sum(system["target"] ** 2))) > 0.0 and (limits or plates or given or added is not None):
        free = sizing_system(each, names, None, equal, None, fixed)
        left = float(np.sum((free["columns"] @ of_any_mass(free)[0] - free["target"]) ** 2))
        any_percent = 100.0 * (left / whole) ** 0.5
    return NestedSizing(
        tuple(payloads), tuple(sets), tuple(alone), weights, motion, stock, fixed, use, trajectory, dict(limits or {}),
        tuple(map(tuple, equal)), added, bool(given), any_percent,
    )  # fmt: skip
